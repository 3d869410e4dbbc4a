"""`antdrive.compare`."""

import pytest

import antdrive
from antdrive.base.errors import FieldError
from antdrive.planners import PLANNERS, GridPlanner
from antdrive.runs.comparing import path_text

FEW = {"few": "aco-han", "astar": "astar", "dijkstra": "dijkstra"}


@pytest.fixture(scope="module")
def compared(small_task):
    return antdrive.compare(small_task, FEW, options={"few": {"iterations": 1}})


def test_the_table_has_a_row_for_each_different_drive(compared):
    names, lines = [row[0] for row in compared.rows], {run.label: run.drive for run in compared.runs}
    assert lines["few"] != lines["astar"]
    assert names == (["few", "astar, dijkstra"] if lines["astar"] == lines["dijkstra"] else list(FEW))
    assert all(len(row) == len(compared.headings) for row in compared.rows)
    assert all(run.facts["smoothing"] == "none" for run in compared.runs)
    path, certified = compared.rows[0][1], compared.rows[0][4]
    facts = compared.runs[0].facts
    values = facts["metrics"]
    assert path == f"{values['path_length_m']:.2f} → {values['driven_length_m']:.2f}"
    bound = facts["certificate"]["bound_m"]
    assert bound - 0.001 < float(certified.removeprefix("≥ ")) <= bound
    assert list(compared.logs) == list(FEW)


def test_a_comparison_is_short_as_text_and_a_table_in_notebooks(compared):
    assert repr(compared) == "<Comparison of few, astar and dijkstra in small: 3 of 3 runs succeeded>"
    lines = compared.to_markdown().splitlines()
    assert lines[0] == f"| {' | '.join(compared.headings)} |"
    assert all(line.count("|") == lines[0].count("|") for line in lines[1 : 2 + len(compared.rows)])
    assert compared._repr_markdown_() == compared.to_markdown()


def test_one_route_of_different_plans_is_one_row_and_one_sentence(small_task):
    smooth = antdrive.compare(small_task, FEW, options={"few": {"iterations": 1}}, smoothing="clearance")
    (row,) = smooth.rows
    assert row[0] == "few, astar, dijkstra"
    assert smooth.same == [
        "few, astar and dijkstra drive the same line: smoothing clearance makes one route of their different plans"
    ]


def test_an_error_of_a_planner_is_a_row_and_the_others_drive(small_task):
    class Broken(GridPlanner):
        def search(self, query, rng):
            raise RuntimeError("out of paint")

    made = antdrive.compare(small_task, {"broken": Broken(), "astar": "astar"}, seeds=[3, 4])
    assert [run.facts["succeeded"] for run in made.runs] == [False, True] * 2
    assert [row[:3] for row in made.rows[::2]] == [("small", "3", "broken"), ("small", "4", "broken")]
    assert "out of paint" in made.rows[0][-1]
    assert list(made.logs) == ["astar"]


@pytest.mark.parametrize(
    ("planners", "more", "key"),
    [
        (["astar"], {}, "planners"),
        (["astar", "apf"], {"options": {"aster": {}}}, "options"),
        (["astar", "apf"], {"seeds": 0}, "seeds"),
        (["astar", "apf"], {"noise": -1.0}, "noise"),
        (["astar", "apf"], {"progress": False}, "progress"),
        (["astar", "astar"], {}, "planners"),
    ],
)
def test_invalid_arguments_are_named(small_task, planners, more, key):
    with pytest.raises(FieldError) as told:
        antdrive.compare(small_task, planners, **more)
    assert told.value.key == key


def test_one_planner_is_named_as_one(small_task):
    with pytest.raises(FieldError, match="needs two or more, got astar"):
        antdrive.compare(small_task, "astar")


def test_a_planner_object_is_called_by_its_class(small_task):
    made = antdrive.compare(small_task, ["astar", PLANNERS["dijkstra"]])
    assert made.labels == ("astar", "Dijkstra")
    assert "astar, Dijkstra" in made.to_markdown() or "| Dijkstra |" in made.to_markdown()


def test_worlds_of_one_name_are_refused(small_task):
    with pytest.raises(FieldError, match="worlds: names must be unique"):
        antdrive.compare([small_task, small_task], ["astar", "apf"])


def test_different_plans_of_one_drive_are_all_in_its_label():
    assert path_text([20.338, 18.131, 18.13], 16.996) == "20.34, 18.13 → 17.00"
