"""The reason of a run without a path: for which disc, on which cells, where it is narrow, and what helps."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
import pytest

from antdrive.planners import AStar, GridPlanner, PlanResult, PlanStatus
from antdrive.robots import Footprint
from antdrive.sim import Outcome, Scenario, plan, reasons, run
from antdrive.worlds import Cruising, Disc, Task, World, load_task
from tests.records import changed


def gate(robot, width, *, planner="astar", cell=0.1, **settings):
    """A wall of overlapping cylinders with one opening around (3, 2)."""
    ys = np.arange(2 + width / 2 + 0.25, 4.2, 0.3)
    wall = tuple(Disc(3.0, float(y), 0.25) for y in (*ys, *(4 - ys)))
    task = Task(World("gate", (0.0, 0.0, 6.0, 4.0), wall), (1.0, 2.0, 0.0), (5.0, 2.0), cell=cell)
    return Scenario.of(task, planner, robot, **settings)


@pytest.mark.parametrize(
    ("planner", "remedy"),
    [
        ("astar", "--margin 0.04 --cell 0.01"),
        ("ants", "-p astar --margin 0.04 --cell 0.01"),  # ants may miss a path
        ("tangent", "--margin 0.04"),  # plans between the cylinders themselves
    ],
)
def test_a_gate_that_is_too_narrow_for_the_margin_is_named_with_a_margin_that_would_do(turtlebot, planner, remedy):
    tight = gate(turtlebot, 0.45, planner=planner, margin=0.08)
    done = run(tight)
    assert done.outcome is Outcome.NO_PATH
    assert done.reason.startswith("no path for a disc of 0.26 m (radius 0.18 + margin 0.08) on cells of 0.1 m; ")
    assert done.reason.endswith(
        "; the widest disc that passes has a radius of 0.225 m, at (3.00, 2.00), between obstacles[0] at (3, 2.475) with "
        f"radius 0.25 and obstacles[{len(tight.task.world.obstacles) // 2}] at (3, 1.525) with radius 0.25; {remedy} finds one"
    )


@pytest.mark.parametrize("most", [0, 20_000, 100_000, 10_000_000])
def test_the_cells_of_all_plans_for_a_remedy_are_bounded_and_only_a_planned_one_is_named(turtlebot, most, monkeypatch):
    tried, first = [], reasons._first_that_works

    def spied(remedies, finds_path):
        return first(remedies, lambda routes: tried.append((routes, finds_path(routes))) or tried[-1][1])

    monkeypatch.setattr(reasons, "_first_that_works", spied)
    monkeypatch.setattr(reasons, "MOST_WORK", most)
    tight = gate(turtlebot, 0.45, margin=0.08)
    reason = plan(tight)[1].reason
    area = math.prod(tight.task.world.size)
    assert sum(area / routes.cell**2 for routes, _ in tried) <= most
    assert reason.endswith("finds one") == any(found for _, found in tried)
    if most == 10_000_000:
        assert reason.endswith("; --margin 0.04 --cell 0.01 finds one")


def test_less_than_the_default_is_said_to_be_a_risk(turtlebot):
    tight = gate(turtlebot, 0.45, noise=1.0, smoothing="none")
    reason = run(tight).reason
    assert reason.startswith("no path for a disc of 0.256 m (radius 0.18 + margin 0.076)")
    assert reason.endswith("; --margin 0.04 --cell 0.01 finds one, but noise may then cause contacts")
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
        "plans use the disc of cart; its rectangle of 0.9 x 0.6 m needs 0.66 m of the 0.95 m straight ahead; "
        "--footprint exact finds one"
    )
    assert len(reason) < 400
    assert run(gate(robot, 0.95, cell=0.05)).succeeded, "the footprint passes"
    tight = gate(robot, 0.62, cell=0.05)
    narrow = run(tight).reason
    assert run(tight, planned=plan(tight)).reason == narrow, "as whole as in `antdrive plan`"
    assert "on cells of 0.05 m, nor for its rectangle of 0.9 x 0.6 m; " in narrow
    assert "; its rectangle of 0.9 x 0.6 m needs 0.66 m straight ahead, more than the 0.62 m there" in narrow
    exact = run(gate(robot, 0.62, cell=0.05, footprint="exact")).reason
    assert exact.startswith("no path for its rectangle of 0.9 x 0.6 m with a margin of 0.03 m on cells of 0.05 m; ")
    assert exact.endswith(narrow[narrow.index("the widest disc") :])
    beside = run(gate(robot, 0.67, cell=0.05)).reason
    assert (
        "needs 0.66 m of the 0.67 m straight ahead; on these cells, by straight moves and turns on the spot, it does not get "
        "through; --margin 0.02 --cell 0." in beside
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
    assert run(gate(robot, 0.95, planner="tangent")).reason.endswith("; -p astar --footprint exact finds one")


def test_the_footprint_comes_before_a_smaller_margin(jackal):
    reason = run(gate(jackal, 0.7, cell=0.05, footprint="disc")).reason
    assert reason.endswith(
        "its rectangle of 0.508 x 0.43 m needs 0.49 m of the 0.7 m straight ahead; --footprint exact finds one"
    )


def test_cells_that_would_do_are_named(turtlebot):
    coarse = gate(turtlebot, 0.45, cell=0.6)
    reason = run(coarse).reason
    assert reason.startswith("no path for a disc of 0.21 m (radius 0.18 + margin 0.03) on cells of 0.6 m")
    assert reason.endswith("; --cell 0.025 finds one")
    assert run(replace(coarse, cell=0.025)).succeeded


def test_a_goal_behind_a_closed_wall_is_not_blamed_on_the_margin(turtlebot):
    closed = gate(turtlebot, 0.45)
    task = changed(closed.task, "world", obstacles=(*closed.task.world.obstacles, Disc(3.0, 2.0, 0.4)))
    assert run(replace(closed, task=task)).reason.endswith("; obstacles close off the goal from the start")


def test_a_goal_without_room_for_the_margin_is_the_narrowest_place(turtlebot):
    task = Task(World("corner", (0.0, 0.0, 6.0, 4.0)), (2.0, 2.0, 0.0), (5.7, 2.0), cell=0.1)
    done = run(Scenario.of(task, "astar", turtlebot, margin=0.5))
    assert done.reason.endswith(
        "has a radius of 0.53 m, at (5.47, 2.00), the roomiest place for the goal within its tolerance of 0.25 m; "
        "--margin 0.3 --cell 0.05 finds one"
    )


def shelf(robot, tolerance=0.25, goal=(9.85, 5.0), **settings):
    """A goal closer to a wall than the robot's radius, in an empty square."""
    task = Task(World("shelf", (0.0, 0.0, 10.0, 10.0)), (5.0, 5.0, 0.0), goal, tolerance)
    return Scenario.of(task, "astar", robot, **settings)


@pytest.mark.parametrize("cell", [0.5, 0.25])
def test_a_goal_that_only_finer_cells_reach_within_its_tolerance_names_them(turtlebot, cell):
    """The robot's centre gets to 9.79 m, 0.06 m from the goal; the nearest centre of a coarse cell is 0.27 m from it."""
    assert run(shelf(turtlebot, cell=cell)).reason == (
        f"no path for a disc of 0.21 m (radius 0.18 + margin 0.03) on cells of {cell} m; no free cell can be joined to the "
        "goal within its tolerance of 0.25 m; --cell 0.1 finds one"
    )
    assert run(shelf(turtlebot, cell=0.1)).succeeded


def test_a_goal_beyond_reach_names_the_nearest_that_is_not(turtlebot):
    reason = run(shelf(turtlebot, 0.1, (9.95, 5.0))).reason
    assert reason.endswith(
        "the widest disc that passes has a radius of 0.13 m, at (9.87, 5.00), the roomiest place for the goal within its "
        "tolerance of 0.1 m; this robot does not fit through; --goal 9.75,4.75 finds one"
    )
    assert run(shelf(turtlebot, 0.1, (9.75, 4.75))).succeeded


def test_a_planner_that_decides_cell_by_cell_is_not_told_to_plan_for_the_footprint(jackal):
    robot = replace(jackal, name="cart", footprint=Footprint.rectangle(0.9, 0.6))
    among = gate(robot, 0.95)
    mover = Cruising(radius=0.2, position=(0.5, 0.5), velocity=(0.0, 0.1))
    task = changed(among.task, "world", movers=(mover,))
    reason = plan(Scenario.of(task, "mmas-dstar", robot, cell=0.05))[1].reason
    assert reason.endswith("; -p astar --footprint exact finds one")


@dataclass(frozen=True, kw_only=True)
class GivesUp(GridPlanner):
    """Finds no path, ever."""

    def search(self, query, rng):
        return PlanResult(status=PlanStatus.NO_PATH, reason="too tired")


def test_an_incomplete_planner_is_distinguished_from_a_world_without_a_path(small_scenario):
    done = run(replace(small_scenario, planner=GivesUp(), planner_name="lazy"))
    assert done.reason == (
        "lazy found no path for a disc of 0.21 m (radius 0.18 + margin 0.03) on cells of 0.2 m: too tired; "
        "-p astar finds one on these cells"
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
