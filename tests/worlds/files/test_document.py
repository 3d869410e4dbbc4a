"""Documents are the same whichever parser reads them, and no text exhausts the stack."""

from typing import Any

import pytest
import yaml
from hypothesis import given, settings
from hypothesis import strategies as st

from antdrive.worlds import InputError, load_task
from antdrive.worlds.files import document
from antdrive.worlds.files.document import MAX_DEPTH, parse_document, read_yaml
from antdrive.worlds.files.world_file import list_worlds
from antdrive.worlds.world import World

PIECES = (
    "a", "b: ", "- ", "[", "]", "{", "}", ", ", ": ", ":", "\n", "\n  ", "\n    ", '"x"', "'y'", '"', "'", "1.5", "-0.0",
    "010", "1e3", "true", "null", "~", "# c\n", "#", "<<: ", "x: 1\n", "obstacles:\n", "  - {x: 1.0, y: 2.0}\n", "1:30",
    ".inf", "\\n", '"\\x41"', " ", "key: [1, 2]\n", "=", "-", "?", "---\n", "...\n", "\t", "&a ", "*a", "!t ", "|\n  t\n",
    ">\n", "%YAML 1.1\n", "@", "`", "\r\n", "\u00e9", "\x85", "\u2028", ",", "0x1F", "2001-01-01",
)  # fmt: skip


def read(text: str) -> Any:
    """The data and the lines of a text, or the sentence about its fault."""
    try:
        found = parse_document(text, "file")
    except InputError as error:
        return str(error)
    return repr(found.data), found.lines


def read_by_pyyaml(text: str, monkeypatch: pytest.MonkeyPatch) -> Any:
    with monkeypatch.context() as patch:
        patch.setattr(yaml, "__with_libyaml__", False)
        return read(text)


@settings(max_examples=800)
@given(st.lists(st.sampled_from(PIECES), max_size=14).map("".join))
def test_both_parsers_read_the_same(text: str) -> None:
    with pytest.MonkeyPatch.context() as patch:
        assert read(text) == read_by_pyyaml(text, patch)


@pytest.mark.parametrize("name", list_worlds())
def test_both_parsers_read_the_same_of_the_catalogue(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    text = read_yaml(list_worlds()[name])
    assert read(text) == read_by_pyyaml(text, monkeypatch)
    assert isinstance(load_task(name).world, World)


@pytest.mark.skipif(not yaml.__with_libyaml__, reason="PyYAML was built without libyaml")
def test_a_usual_world_is_read_by_libyaml(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(document, "_Loader", None)  # PyYAML's own parser would need it
    assert parse_document("schema: 1\nobstacles:\n  - {x: -1.0, y: 2.5e-3}  # a post\n", "file").lines[("schema",)] == 1


@pytest.mark.parametrize("opening", ["[", "{a: ", "- ", "[\n"])
def test_a_deep_text_is_refused_and_not_followed(opening: str) -> None:
    with pytest.raises(InputError, match=f"nested deeper than {MAX_DEPTH} levels|cannot be parsed|not YAML"):
        parse_document(opening * 300_000, "file")


@pytest.mark.parametrize("levels", range(MAX_DEPTH - 3, MAX_DEPTH + 3))
def test_both_parsers_allow_the_same_depth(levels: int, monkeypatch: pytest.MonkeyPatch) -> None:
    text = "a: " + "[" * levels + "1" + "]" * levels
    assert read(text) == read_by_pyyaml(text, monkeypatch)
