"""Benchmarks in pieces do nothing again that is in their file; the searches over readings try designs that planners accept."""

import math

import numpy as np
import pytest

from antdrive.planners import load_planner
from benchmarks import readings
from benchmarks.markdown import append_line, read_lines


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
