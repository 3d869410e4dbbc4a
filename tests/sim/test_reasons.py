"""The reason of a run without a path: for which disc, on which cells, where it is narrow, and what helps."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import pytest

from antdrive.planners import AStar, GridPlanner, PlanResult, PlanStatus
from antdrive.robots import Footprint
from antdrive.sim import Outcome, Scenario, plan, run
from antdrive.worlds import Disc, Task, World, load_task
from tests.records import changed


def gate(robot, width, *, planner="astar", cell=0.1, **settings):
    """A wall of overlapping cylinders with one opening around (3, 2)."""
    ys = np.arange(2 + width / 2 + 0.25, 4.2, 0.3)
    wall = tuple(Disc(3.0, float(y), 0.25) for y in (*ys, *(4 - ys)))
    task = Task(World("gate", (0.0, 0.0, 6.0, 4.0), wall), (1.0, 2.0, 0.0), (5.0, 2.0), cell=cell)
    return Scenario.of(task, planner, robot, **settings)


@pytest.mark.parametrize("planner", ["astar", "ants", "tangent"])
def test_a_gate_that_is_too_narrow_for_the_margin_is_named_with_a_margin_that_would_do(turtlebot, planner):
    tight = gate(turtlebot, 0.45, planner=planner, margin=0.08)
    done = run(tight)
    assert done.outcome is Outcome.NO_PATH
    assert done.reason.startswith("no path for a disc of 0.26 m (radius 0.18 + margin 0.08) on cells of 0.1 m; ")
    assert done.reason.endswith(
        "; the widest disc that passes has a radius of 0.225 m, at (3.00, 2.00), between obstacles[0] at (3, 2.475) with "
        f"radius 0.25 and obstacles[{len(tight.task.world.obstacles) // 2}] at (3, 1.525) with radius 0.25; "
        "a margin below 0.045 m leaves a way on fine cells"
    )
    assert run(replace(tight, margin=0.035, cell=0.0125)).succeeded, "the advice is right"


def test_less_than_the_default_is_said_to_be_a_risk(turtlebot):
    tight = gate(turtlebot, 0.45, noise=1.0, smoothing="none")
    reason = run(tight).reason
    assert reason.startswith("no path for a disc of 0.256 m (radius 0.18 + margin 0.076)")
    assert reason.endswith(
        "a margin below 0.045 m leaves a way on fine cells, but noise may then cause contacts; --margin auto measures its effect"
    )
    assert "noise" not in run(replace(tight, margin=0.06)).reason, "the user has chosen"


def test_the_reason_names_a_robot_wider_than_the_gate(turtlebot):
    assert run(gate(turtlebot, 0.3)).reason.endswith("this robot does not fit through")


@pytest.mark.parametrize("centre", [(0.0, 0.0), (0.15, 0.0)])
def test_a_door_for_the_rectangle_and_not_for_the_disc_is_named_with_what_both_need(jackal, centre):
    """A robot of 0.9 x 0.6 m before a door of 0.95 m."""
    robot = replace(jackal, name="cart", footprint=Footprint.rectangle(0.9, 0.6, centre))
    reason = run(gate(robot, 0.95, cell=0.05, footprint="disc")).reason
    assert reason.startswith("no path for a disc of 0.")
    assert (
        "the widest disc that passes has a radius of 0.475 m, at (3.00, 2.00), between obstacles[0] at (3, 2.725)"
        in reason
    )
    assert reason.endswith(
        "plans use the disc of cart; its rectangle of 0.9 x 0.6 m needs 0.66 m of the 0.95 m straight ahead"
    )
    assert len(reason) < 350
    assert run(gate(robot, 0.95, cell=0.05)).succeeded, "the footprint passes"
    tight = gate(robot, 0.62, cell=0.05)
    narrow = run(tight).reason
    assert run(tight, planned=plan(tight)).reason == narrow, "as whole as in `antdrive plan`"
    assert "on cells of 0.05 m, nor for its rectangle of 0.9 x 0.6 m; " in narrow
    assert narrow.endswith("; its rectangle of 0.9 x 0.6 m needs 0.66 m straight ahead, more than the 0.62 m there")
    exact = run(gate(robot, 0.62, cell=0.05, footprint="exact")).reason
    assert exact.startswith("no path for its rectangle of 0.9 x 0.6 m with a margin of 0.03 m on cells of 0.05 m; ")
    assert exact.endswith(narrow[narrow.index("the widest disc") :])
    beside = run(gate(robot, 0.67, cell=0.05)).reason
    assert beside.endswith(
        "needs 0.66 m of the 0.67 m straight ahead; between cells, by straight moves and turns on the spot, it does not get "
        "through"
    )


@pytest.mark.parametrize("footprint", ["auto", "exact"])
def test_an_office_with_a_robot_too_wide_for_its_doors_names_the_door_of_the_goal(jackal, footprint):
    robot = replace(jackal, name="wide", footprint=Footprint.rectangle(1.2, 1.1))
    task = replace(load_task("office"), goal=(20.0, 5.0))
    reason = run(Scenario(task=task, planner=AStar(), robot=robot, footprint=footprint)).reason
    assert "a radius of 0.425 m, at (21.63, 10.90), between obstacles[385]" in reason, (
        "the room's only door, 0.85 m wide"
    )
    assert reason.endswith("needs 1.16 m straight ahead, more than the 0.85 m there")


def test_a_planner_for_discs_names_one_for_footprints(jackal):
    robot = replace(jackal, footprint=Footprint.rectangle(0.9, 0.6))
    assert run(gate(robot, 0.95, planner="tangent")).reason.endswith("; astar plans for the footprint")


def test_a_margin_that_would_do_is_named_for_a_rectangle_too(jackal):
    reason = run(gate(jackal, 0.7, cell=0.05, footprint="disc")).reason
    assert reason.endswith("its rectangle of 0.508 x 0.43 m needs 0.49 m of the 0.7 m straight ahead; "
                           "a margin below 0.0172 m leaves a way on fine cells")  # fmt: skip


def test_cells_that_would_do_are_named(turtlebot):
    coarse = gate(turtlebot, 0.45, cell=0.6)
    reason = run(coarse).reason
    assert reason.startswith("no path for a disc of 0.21 m (radius 0.18 + margin 0.03) on cells of 0.6 m")
    assert reason.endswith("; there is one on cells of 0.075 m")
    assert run(replace(coarse, cell=float(reason.split()[-2]))).succeeded


def test_a_goal_behind_a_closed_wall_is_not_blamed_on_the_margin(turtlebot):
    closed = gate(turtlebot, 0.45)
    task = changed(closed.task, "world", obstacles=(*closed.task.world.obstacles, Disc(3.0, 2.0, 0.4)))
    assert run(replace(closed, task=task)).reason.endswith("; not even a point gets through")


def test_a_start_without_room_for_the_margin_is_the_narrowest_place(turtlebot):
    task = Task(World("corner", (0.0, 0.0, 6.0, 4.0)), (2.0, 2.0, 0.0), (5.7, 2.0), cell=0.1)
    done = run(Scenario.of(task, "astar", turtlebot, margin=0.5))
    assert done.reason.endswith(
        "has a radius of 0.3 m, at (5.70, 2.00), the goal has no more room; a margin below 0.12 m leaves a way on fine "
        "cells"
    )


@dataclass(frozen=True, kw_only=True)
class GivesUp(GridPlanner):
    """Finds no path, ever."""

    def _plan(self, query, rng):
        return PlanResult(status=PlanStatus.NO_PATH, reason="too tired")


def test_an_incomplete_planner_is_distinguished_from_a_world_without_a_path(small_scenario):
    done = run(replace(small_scenario, planner=GivesUp(), planner_name="lazy"))
    assert done.reason == (
        "lazy found no path for a disc of 0.21 m (radius 0.18 + margin 0.03): too tired; astar finds one on these cells of 0.2 m"
    )


@pytest.mark.parametrize("margin", [0.035, 0.04])
def test_a_line_where_the_grid_has_no_path_is_driven_and_recorded(turtlebot, margin):
    done = run(gate(turtlebot, 0.45, planner="tangent", cell=0.05, margin=margin))
    assert done.succeeded, done.reason
    assert done.rollout.record.plan.cost_m is None
    assert done.rollout.record.plan.length_m > 4.0 - 1e-9


def test_a_planner_in_space_and_time_is_not_told_of_paths_that_ignore_movers(jackal):
    robot = replace(jackal, name="cart", footprint=Footprint.rectangle(0.9, 0.6))
    reason = run(Scenario.of("people-corridor", "sipp", robot, options={"horizon": 1.0})).reason
    assert reason.endswith("no path past the movers reaches the goal within 1 s")
