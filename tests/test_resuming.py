"""Benchmarks in pieces do nothing again that is in their file; the searches over readings try designs that planners accept."""

import math

import numpy as np
import pytest

from antdrive.planners import load_planner
from benchmarks import readings, suites
from benchmarks.markdown import append_line, read_lines
from tests.audit.suite_runs import rounds_with_pytest


def test_a_file_holds_whole_lines(tmp_path):
    path = tmp_path / "new" / "results.jsonl"
    assert read_lines(path) == read_lines(None) == []
    for number in range(3):
        append_line(path, {"number": number, "text": "a\nb"})
    whole = read_lines(path)
    assert [line["number"] for line in whole] == [0, 1, 2]
    path.write_text(path.read_text()[:-5])
    assert read_lines(path) == whole[:2]
    append_line(path, whole[2])
    assert read_lines(path) == whole


def test_repeats_go_on_and_a_flake_is_exit_code_1(tmp_path, monkeypatch, capsys):
    """Runs of the tests are put in place; the sixth drives otherwise, the seventh fails."""
    calls = []

    def run(folder, *words, **_):
        calls.append(len(calls))
        digest, passed = ("x" if calls[-1] == 5 else "y"), calls[-1] != 6
        return {"a": {"passed": passed, "message": "it broke\nhere", "digest": digest, "outcome": "", "results": ""}}

    def rounds(folder, *words, times, **_):
        return [run(folder) for _ in range(times)]

    monkeypatch.setattr(suites, "with_check", run)
    monkeypatch.setattr(suites, "rounds_with_pytest", rounds)

    def main(*words):
        monkeypatch.setattr("sys.argv", ["suites", *words, "--results", str(tmp_path / "r.jsonl")])
        try:
            suites.main()
        except SystemExit as stopped:
            return int(stopped.code or 0)
        return 0

    assert (main("--repeats", "4", "--within", "1"), len(calls)) == (0, 4)
    assert (main("--repeats", "5", "--within", "1"), len(calls)) == (0, 5)
    assert (main("--repeats", "6", "--within", "1"), len(calls)) == (1, 6), "another drive"
    assert (main("--repeats", "7", "--within", "1"), len(calls)) == (1, 7)
    capsys.readouterr()
    assert (main(), len(calls)) == (1, 7), "says what the file has"
    out = capsys.readouterr().out
    assert "| `pytest, shuffled` | 2 | 2 | 0 | 1 |" in out
    assert "round 6, pytest -n 2: a: it broke" in out
    main("--repeats", "9", "--within", "3")
    assert len(calls) == 10, "one run of pytest makes three rounds, more than are missing"


def test_one_run_of_pytest_gives_each_test_as_often_as_asked_for(tmp_path):
    (tmp_path / "test_two.py").write_text(
        "import pytest\nseen = []\n@pytest.fixture\ndef fresh():\n    seen.append(1)\n    return len(seen)\n"
        "def test_a(fresh): assert fresh == len(seen)\ndef test_b(): assert False, 'always'\n"
        "def test_c(fresh, known=[]): assert fresh not in known; known.append(fresh)\n"
    )
    rounds = rounds_with_pytest(tmp_path, "test_two.py", times=6, env={"ANTDRIVE_SHUFFLE": "1"})
    assert [{name: test["passed"] for name, test in tests.items()} for tests in rounds] == [
        {"test_two.py::test_a": True, "test_two.py::test_b": False, "test_two.py::test_c": True}
    ] * 6


@pytest.mark.parametrize("name", readings.SEARCHES)
def test_every_design_is_of_options_that_exist_and_no_two_are_the_same(name):
    search = readings.SEARCHES[name]
    load_planner(search.rival[0], **search.rival[1])
    planners = [load_planner(search.planner, **{**search.fixed, **options}) for _, options in readings.designs(search)]
    assert len(set(planners)) == len(planners)
    full = math.prod(len(values) for values in search.readings.values())
    assert len(planners) == full + 8 * len(search.under)
    drawn = (draw for kind, draw in search.maps.items() if kind != "40×40")  # drawn as 30×30 is, in seconds
    assert all(draw(0).grid.free.any() for draw in drawn)


def test_each_constant_of_the_fractional_design_is_at_each_level_half_of_the_time():
    search = readings.SEARCHES["pfaco"]
    rows = [options for words, options in readings.designs(search) if ":" in words and options["form"] == "local"]
    for key, pair in search.constants.items():
        assert [row[key] for row in rows].count(pair[0]) == 4
    signs = np.array([[1 if row[key] == pair[1] else -1 for key, pair in search.constants.items()] for row in rows])
    assert (signs.T @ signs == 8 * np.eye(5)).all()  # main effects do not mix


def test_a_row_counts_who_was_shorter():
    text = readings.line("reading", [1.0, 2.0, math.inf, math.inf], [2.0, 1.0, 3.0, math.inf], 0.5)
    assert "| 2/4 |" in text
    assert "| 1 : 2 |" in text
