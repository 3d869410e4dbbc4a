"""Documents are the same whichever parser reads them, and no text exhausts the stack."""

import pytest
import yaml
from hypothesis import given, settings
from hypothesis import strategies as st

from antdrive.base import InputError, document
from antdrive.base.document import MAX_DEPTH, parse_document, read_yaml
from antdrive.worlds import load_task
from antdrive.worlds.files.world_file import list_worlds
from antdrive.worlds.world import World

PIECES = (
    "a", "b: ", "- ", "[", "]", "{", "}", ", ", ": ", ":", "\n", "\n  ", "\n    ", '"x"', "'y'", '"', "'", "1.5", "-0.0",
    "010", "1e3", "true", "null", "~", "# c\n", "#", "<<: ", "x: 1\n", "obstacles:\n", "  - {x: 1.0, y: 2.0}\n", "1:30",
    ".inf", "\\n", '"\\x41"', " ", "key: [1, 2]\n", "=", "-", "?", "---\n", "...\n", "\t", "&a ", "*a", "!t ", "|\n  t\n",
    ">\n", "%YAML 1.1\n", "@", "`", "\r\n", "\u00e9", "\x85", "\u2028", ",", "0x1F", "2001-01-01",
)  # fmt: skip


def read(text):
    """Return the data and the lines of a text, or the error's message."""
    try:
        found = parse_document(text, "file")
    except InputError as error:
        return str(error)
    return repr(found.data), dict(found.lines)


def read_by_pyyaml(text, monkeypatch):
    with monkeypatch.context() as patch:
        patch.setattr(yaml, "__with_libyaml__", False)
        return read(text)


@settings(max_examples=250)
@given(st.lists(st.sampled_from(PIECES), max_size=14).map("".join))
def test_both_parsers_read_the_same(text):
    with pytest.MonkeyPatch.context() as patch:
        assert read(text) == read_by_pyyaml(text, patch)


@pytest.mark.parametrize("name", list_worlds())
def test_both_parsers_read_the_same_of_the_catalogue(name, monkeypatch):
    text = read_yaml(list_worlds()[name])
    assert read(text) == read_by_pyyaml(text, monkeypatch)
    assert isinstance(load_task(name).world, World)


@pytest.mark.skipif(not yaml.__with_libyaml__, reason="PyYAML was built without libyaml")
def test_a_usual_world_is_read_by_libyaml(monkeypatch):
    monkeypatch.setattr(document, "_Loader", None)  # PyYAML's own parser would need it
    assert parse_document("schema: 1\nobstacles:\n  - {x: -1.0, y: 2.5e-3}  # a post\n", "file").lines[("schema",)] == 1


@pytest.mark.parametrize("opening", ["[", "{a: ", "- ", "[\n"])
def test_a_deep_text_is_refused_and_not_followed(opening):
    with pytest.raises(
        InputError, match=f"nested deeper than {MAX_DEPTH} levels|cannot be parsed|not YAML|has more than"
    ):
        parse_document(opening * 300_000, "file")


@pytest.mark.parametrize("levels", range(MAX_DEPTH - 3, MAX_DEPTH + 3))
def test_both_parsers_allow_the_same_depth(levels, monkeypatch):
    text = "a: " + "[" * levels + "1" + "]" * levels
    assert read(text) == read_by_pyyaml(text, monkeypatch)


NUMBERS = (
    "0", "1", "-3", "2.5", "-0.0", "1.0e-07", "12.25e+3", "1e5", "010", "1_0", ".5", "5.", "true", "x", "", "[1]",
    "'1'",
)  # fmt: skip
ENTRIES = (
    "  - {{x: {0}, y: {1}}}\n", "  - {{x: {0}, y: {1}}} \n", "  - {{x: {0}}}\n", "  - {{y: {1}, x: {0}}}\n", "  # a\n",
    "\n",
)  # fmt: skip
BEFORE = ("", "a: 1\n", "a: {b: 1,\n", "a: 'b\n", "a: b\n  c\n", "posts: []\n", "a:\n", "- a\n", "{\n", "\tb\n")
AFTER = ("", "a: 1\n", "  b: 1\n", "}\n", "'\n", "c: [1, 2]\n", "# end\n", "posts:\n  - {x: 1.0, y: 2.0}\n", "...\n")


@settings(max_examples=60)
@given(
    st.sampled_from(BEFORE),
    st.lists(
        st.tuples(st.sampled_from((ENTRIES[0],) * 8 + ENTRIES), *(st.sampled_from(NUMBERS[:7] * 4 + NUMBERS),) * 2),
        max_size=4,
    ),
    st.sampled_from(AFTER),
)
def test_a_table_is_the_same_however_it_is_read(before, rows, after):
    text = before + "posts:\n" + "".join(entry.format(*numbers) for entry, *numbers in rows) + after
    with pytest.MonkeyPatch.context() as patch:
        assert read(text) == read_by_pyyaml(text, patch)


@pytest.mark.skipif(not yaml.__with_libyaml__, reason="PyYAML was built without libyaml")
def test_no_parser_sees_the_rows_of_a_table(monkeypatch):
    seen = []
    compose = document._compose
    monkeypatch.setattr(document, "_compose", lambda text: seen.append(text) or compose(text))
    found = parse_document("a: 1\nposts:\n" + "  - {x: 1.5, y: -2}\n" * 300 + "b: 2\n", "file")
    assert found.data == {"a": 1, "posts": [{"x": 1.5, "y": -2}] * 300, "b": 2}
    assert (found.lines["posts", 299, "y"], found.lines["posts", 0], found.lines["b",]) == (302, 3, 303)
    assert [text.count("{") for text in seen] == [0]
    assert "file:302: posts[299].y: wrong" in str(found.error(("posts", 299, "y"), "wrong"))


@pytest.mark.parametrize(
    "row", ["- {x: 1, y: 2, radius: 1}\n", "- x: 1\n  y: 2\n  radius: 1\n", "- {x: 1, y: 2, radius: 1.0e+1}\n"]
)
def test_too_many_values_are_refused_before_they_are_parsed(row, monkeypatch):
    text = "schema: 1\nobstacles:\n" + row * 50_001
    monkeypatch.setattr("antdrive.base.document._compose", lambda text: pytest.fail("parsed"))
    with pytest.raises(InputError, match=r"^w.yaml: has more than 200000 values; a file holds up to 40000 cylinders"):
        parse_document(text, "w.yaml")


def test_too_many_values_are_blamed_on_aliases_only_where_there_are_some(monkeypatch):
    monkeypatch.setattr(document, "MAX_VALUES", 2000)
    with pytest.raises(InputError, match="has more than 200000 values"):
        parse_document(f"a: [{'1,' * 2001}]", "w.yaml")
    with pytest.raises(InputError, match="its aliases expand to too many values"):
        parse_document(f"a: &a [{'1,' * 20}]\nb: &b [{'*a,' * 20}]\nc: [{'*b,' * 20}]", "w.yaml")
