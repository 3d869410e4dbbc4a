"""Tasks that begin or end close to a wall are driven and certified on grids of any fineness; a plan that stays there is not."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from antdrive import Scenario, run
from antdrive.planners import PLANNERS, Query, validate_plan
from antdrive.sim import Outcome, certify
from antdrive.worlds import Disc, Task, World, rasterise
from antdrive.worlds.route import end_reach

ROOM = World("room", (0.0, 0.0, 6.0, 4.0), ())
GOAL_BY_WALL = Task(ROOM, (2.5, 2.0, 0.0), (4.5, 0.25), goal_tolerance=0.25)
START_BY_WALL = Task(ROOM, (0.5, 0.19, 0.0), (2.5, 1.5), goal_tolerance=0.2)
EDGE = replace(START_BY_WALL, cell=0.2)


@pytest.mark.parametrize(
    ("task", "cell", "margin", "planner"),
    [(GOAL_BY_WALL, 0.02, 0.2, "astar"), (START_BY_WALL, 0.02, 0.2, "astar"), (START_BY_WALL, 0.05, 0.2, "tangent")],
    ids=["goal", "start", "start, any angle"],
)
def test_a_drive_from_or_to_a_place_by_the_wall_is_certified(task, cell, margin, planner):
    """On fine cells the free ones are many cells away from the end."""
    result = run(Scenario.of(replace(task, cell=cell), planner, margin=margin))
    assert result.outcome is Outcome.SUCCEEDED
    assert result.certificate.problems == ()


@pytest.fixture(scope="module")
def log():
    result = run(Scenario.of(replace(START_BY_WALL, cell=0.05), "astar", margin=0.2))
    return result.rollout


def test_the_route_may_not_stay_by_the_wall_nor_end_elsewhere(log):
    start = log.record.task.start[:2]
    far = end_reach(log.record.inflate, log.record.cell) + 0.1
    along_wall = np.array([start, (start[0] + far, start[1]), log.record.task.goal])
    assert any("its start has" not in p and "past an obstacle" in p for p in said(log, along_wall))
    nearer = np.array([start, (start[0] + 0.3, start[1] - 0.05), log.record.task.goal])
    assert any("its start has 0.19 m" in p for p in said(log, nearer))
    short = np.vstack([log.route[:-1], [log.record.task.goal[0] - 0.1, log.record.task.goal[1]]])
    assert any("route: ends 0.1 m" in p for p in said(log, short))  # the goal has room, so the route reaches it


def said(log, route):
    return certify(replace(log, route=route)).problems


def test_cells_lead_from_the_start_to_the_goal(log):
    for cells, words in ((log.cells[40:], "cells: begin"), (log.cells[:-40], "cells: end")):
        assert any(words in p for p in certify(replace(log, cells=cells)).problems)


@settings(max_examples=40)
@given(st.floats(0.19, 5.8), st.floats(0.19, 3.8), st.sampled_from((0.05, 0.1, 0.3)), st.floats(0.0, 0.3), st.data())
def test_the_first_and_last_cells_are_within_reach_of_the_ends(x, y, cell, margin, data):
    disc = Disc(data.draw(st.floats(1.0, 5.0)), data.draw(st.floats(1.0, 3.0)), 0.3)
    if math.dist((x, y), (disc.x, disc.y)) < disc.radius + 0.18:
        return
    task = Task(World("one", (0.0, 0.0, 6.0, 4.0), (disc,)), (x, y, 0.0), (0.15, 0.15), goal_tolerance=0.25)
    grid = rasterise(task.world, cell, 0.18 + margin)
    query = Query.between(grid, task)
    for end, place in ((query.start, task.start[:2]), (query.goal, task.goal)):
        assert math.dist(grid.xy([end])[0], place) <= end_reach(grid.inflate, cell) + 1e-9


def with_line(task, *points, margin=0.03):
    """What is said of a shortest path whose line is another."""
    grid = rasterise(task.world, task.cell, 0.18 + margin)
    query = Query.between(grid, task)
    answer = PLANNERS["astar"].plan(query, np.random.default_rng(0))
    line = np.array([task.start[:2], *points, task.goal])
    length = float(np.hypot(*np.diff(line, axis=0).T).sum())
    return validate_plan(query, replace(answer, waypoints=grid.fractional(line), length=length))


def test_a_line_that_leads_elsewhere_than_its_cells_is_a_wrong_plan():
    """The certificate refuses it as well; it is said before the robot drives."""
    task = Task(ROOM, (0.5, 2.0, 0.0), (5.5, 2.0), cell=0.2)
    assert with_line(task, (3.0, 2.4)) == ""
    assert with_line(task, (0.5, 3.5), (5.5, 3.5)).startswith("waypoints: 8 m long, but their cells")


def test_a_plan_with_loops_is_driven_and_certified_but_not_with_the_cells_of_a_short_cut():
    """A genetic algorithm that is stopped early finds such lines: 13.4 m where 6.3 m are enough."""
    task = Task(World("hall", (0.0, 0.0, 8.0, 6.0), ()), (1.0, 1.0, 0.0), (7.0, 1.0), cell=0.2)
    few = {"iterations": 1, "population": 2, "via_points": 4}
    result = run(Scenario.of(task, "ga-han", seed=40, options=few))
    assert result.outcome is Outcome.SUCCEEDED
    assert result.certificate.problems == ()
    record, shortest = result.rollout.record, 6.0 + 0.2 * (math.sqrt(2.0) - 1.0)
    assert record.plan.length_m > shortest + 5.0
    (row, first), (_, last) = result.rollout.cells[[0, -1]].tolist()
    straight = np.array([(row, col) for col in range(first, last + 1)], dtype=np.int32)
    plan = replace(record.plan, cost_m=(len(straight) - 1) * record.cell)
    forged = replace(result.rollout, cells=straight, record=replace(record, plan=plan))
    assert any(p.startswith("record.plan.length_m: ") for p in certify(forged).problems)


def test_a_line_may_leave_a_tight_start_but_not_go_on_there():
    assert with_line(EDGE, (0.9, 0.6)) == ""
    assert "does not keep 0.21 m" in with_line(EDGE, (2.2, 0.2), (2.2, 1.4))
