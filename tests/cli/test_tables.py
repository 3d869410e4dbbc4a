"""Tables and signs on terminals of any width."""

import sys
from collections import Counter

import pytest
from hypothesis import given
from hypothesis import strategies as st

from antdrive.base.tables import BAD, GOOD, LEAST_WRAPPED, marked, table
from antdrive.cli import console
from antdrive.cli.console import print_line
from antdrive.runs.barn_challenge import HEADS, PUBLISHED, PUBLISHED_HEADS, BarnLine
from antdrive.runs.campaigns.results import MEDIANS
from antdrive.runs.comparing import COMPARED, Comparison
from antdrive.runs.margins.choice import MARGIN_HEADS
from antdrive.runs.papers.claims import VERDICT_HEADS
from antdrive.runs.papers.reproduction import HEADS as PAPER_HEADS

RANGE = "16.996 (16.873 to 17.402)"
LONG = "the plan leads through a place that is 0.8 m wide, and the robot with its margin needs 0.81 m"
#: A table of each command that prints one, with cells of usual lengths.
TABLES = {
    "compare": ((*Comparison((), ()).headings, "outcome"), [("aco-han", "20.341 → 19.871", "31.20", "0.031", "0.028", LONG)]),
    "compare: differences": (("planner", "succeeded", "pairs", *COMPARED.values()), [("astar", "9 of 10", "9", *[RANGE] * 4)]),
    "compare: pairs": (
        ("first", "second", "lower", "difference", "95 % interval", "p (Holm)", "effect", "pairs", "less", "more", "ties"),
        [("aco-han-elite", "mmas-dstar", "astar", "-1.2 %", "-3.1 % to 0.4 %", "0.0021", "0.34", "120", "80", "39", "1")],
    ),
    "sweep": (("planner", "runs", *MEDIANS.values()), [("mmas", "100 of 100", *[RANGE] * len(MEDIANS))]),
    "barn": (HEADS, [BarnLine("world_54", 10, 10, 23.4, 0.4997, 0.4992).cells]),
    "barn: published": (PUBLISHED_HEADS, [entry.cells for entry in PUBLISHED]),
    "find-margin": (MARGIN_HEADS, [("0.050", "20", "0", "0.0213", "seed 7")]),
    "margin": (("cause", "used at most m", "at", "at the tightest place m"),
        [("wheel slip", "0.0121", "(4.20, 7.31), 12.50 s", "+0.0032")]),
    "falsify": (("name", "run", "repeats", "obstacles", "failure"), [("touched-1", "forest seed 41", "3 of 3", "1", LONG)]),
    "reproduce": (PAPER_HEADS, [tuple("0.123" for _ in PAPER_HEADS)]),
    "reproduce: claims": (VERDICT_HEADS,
        [("holds", "han2007", "N1", LONG, "median", "22", "21.3", "as : maco", LONG, "Table 3")]),
}  # fmt: skip
LISTS = [("controller",), ("planners",), ("planners", "aco-han", "astar"), ("worlds", "list"), ("robots", "list")]


@pytest.fixture
def terminal(monkeypatch):
    """A terminal of some width."""

    def of(columns):
        monkeypatch.setattr(sys.stdout, "isatty", lambda: True)
        monkeypatch.setenv("COLUMNS", str(columns))
        monkeypatch.setenv("NO_COLOR", "1")

    return of


def check_complete(lines, columns, heads, rows):
    """No line is wider than the terminal unless a word is, and every word of every cell is there."""
    text = Counter(" ".join(lines).split())
    longest = max(len(word) for row in (heads, *rows) for cell in row for word in cell.split() or [""])
    assert max(map(len, lines)) <= max(columns, longest + LEAST_WRAPPED + max(map(len, heads)) + 4)
    assert Counter(word for row in (heads, *rows) for cell in row for word in cell.split()) <= text


@pytest.mark.parametrize("columns", [60, 80])
def test_tables_fit_the_terminal(columns, terminal, file_regression):
    terminal(columns)
    shown = {}
    for name, (heads, rows) in TABLES.items():
        shown[name] = lines = list(table(heads, rows))
        check_complete(lines, columns, heads, rows)
        assert all(len(line) <= columns for line in lines)
    text = "\n\n".join(f"# {name}\n" + "\n".join(lines) for name, lines in shown.items())
    file_regression.check(text + "\n", basename=f"tables_{columns}")


@pytest.mark.parametrize("columns", [60, 80])
def test_lists_fit_the_terminal(columns, terminal, antdrive, file_regression):
    terminal(columns)
    text = "\n".join(antdrive(*words)[1] for words in LISTS)
    assert [line for line in text.splitlines() if len(line) > columns] == []
    file_regression.check(text, basename=f"lists_{columns}")


CELLS = st.text(st.characters(categories=("L", "N", "P")) | st.just(" "), max_size=40).map(str.strip)


@given(columns=st.integers(30, 120), data=st.data(), width=st.integers(2, 8))
def test_nothing_of_a_table_is_cut(columns, data, width):
    heads = data.draw(st.lists(CELLS.filter(bool), min_size=width, max_size=width))
    rows = data.draw(st.lists(st.lists(CELLS, min_size=width, max_size=width), min_size=1, max_size=4))
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(sys.stdout, "isatty", lambda: True)
        patch.setenv("COLUMNS", str(columns))
        lines = list(table(heads, rows))
    check_complete(lines, columns, heads, rows)


def test_elsewhere_tables_are_aligned_whatever_their_width():
    assert list(table(("a", "b"), [("x", "y" * 300)])) == ["a  b", "x  " + "y" * 300]


@pytest.mark.parametrize(("good", "code"), [(True, "\x1b[32m"), (False, "\x1b[31m")])
def test_signs_are_coloured_on_a_terminal_unless_no_color_is_set(good, code, monkeypatch, capsys):
    monkeypatch.delenv("NO_COLOR", raising=False)
    monkeypatch.setattr(sys.stdout, "isatty", lambda: True)
    print_line(marked(good, "forest"))
    assert capsys.readouterr().out == f"{code}{GOOD if good else BAD}\x1b[0m forest\n"
    monkeypatch.setattr(sys.stdout, "isatty", lambda: True)
    monkeypatch.setenv("NO_COLOR", "1")
    print_line(marked(good, "forest"))
    assert capsys.readouterr().out == f"{GOOD if good else BAD} forest\n"


def test_streams_that_cannot_encode_the_signs_get_plain_ones(monkeypatch, capsys):
    monkeypatch.setattr(console, "_encodes", lambda text: False)
    print_line(f"{GOOD} one, {BAD} other")
    assert capsys.readouterr().out == "+ one, x other\n"
