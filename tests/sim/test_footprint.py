"""Drives through a door that only the robot's footprint passes."""

import math
from dataclasses import replace

import numpy as np
import pytest

from antdrive.base import FieldError
from antdrive.planners import load_planner
from antdrive.robots import load_robot
from antdrive.sim import Rollout, Scenario, certify, run
from antdrive.sim.idle_settings import idle_settings
from antdrive.sim.log.rollout import FORMS
from antdrive.sim.rerun import replayed
from antdrive.sim.verifying import false_claims
from antdrive.worlds import Disc, Keyframed, Task, World, generate
from tests.records import COARSE

#: Width of a door that the footprint passes and the disc around the robot does not [m].
DOORS = {"jackal": 0.62, "warehouse": 0.84}

#: Movers that cross the room behind the door, back and forth.
CROSSING = Keyframed(radius=0.2, keyframes=((0.0, 3.9, 0.6), (8.0, 3.9, 5.4)), loop="pingpong")
SLOW = Keyframed(radius=0.2, keyframes=((0.0, 3.9, 5.4), (18.0, 3.9, 0.6)), loop="pingpong")


def door(width, *movers):
    """A hall of two rooms, with a door of a given width between them."""
    ends = [*np.arange(3.0 + width / 2 + 0.1, 6.0, 0.2), *np.arange(3.0 - width / 2 - 0.1, 0.0, -0.2)]
    world = World("door", (0.0, 0.0, 6.0, 6.0), tuple(Disc(3.0, float(y), 0.1) for y in ends), movers=movers)
    return Task(world, (1.2, 2.8, 0.3), (4.8, 3.2), cell=0.1)


@pytest.fixture(scope="module")
def driven():
    """Runs by robot and noise."""
    runs = {}

    def one(robot, noise):
        if (robot, noise) not in runs:
            runs[robot, noise] = run(Scenario.of(door(DOORS[robot]), "astar", robot, noise=noise, seed=2, **COARSE))
        return runs[robot, noise]

    return one


@pytest.mark.parametrize("noise", [0.0, 1.0])
@pytest.mark.parametrize("robot", DOORS)
def test_a_footprint_passes_a_door_that_its_disc_does_not(driven, robot, noise):
    made = driven(robot, noise)
    record = made.rollout.record
    assert made.succeeded
    assert certify(made.rollout).certified
    assert 0 < record.footprint_margin < DOORS[robot] / 2 - load_robot(robot).footprint.inner_radius
    assert not run(replace(made.scenario, footprint="disc")).succeeded


@pytest.mark.parametrize("noise", [0.0, 1.0])
@pytest.mark.parametrize("robot", [pytest.param("husky", marks=pytest.mark.slow), "warehouse"])
def test_avoidance_in_a_door_keeps_the_footprint_clear(robot, noise):
    made = run(
        Scenario.of(door({**DOORS, "husky": 0.9}[robot], CROSSING), "astar", robot, noise=noise, seed=2, **COARSE)
    )
    assert made.succeeded, (made.outcome, made.reason)
    assert certify(made.rollout).certified
    assert made.rollout.record.footprint_margin > 0


@pytest.mark.parametrize(("robot", "noise"), [("jackal", 1.0), ("warehouse", 0.0)])
def test_a_plan_in_time_for_a_footprint_passes_a_door_behind_a_mover_on_schedule(robot, noise):
    made = run(Scenario.of(door(DOORS[robot], SLOW), "sipp", robot, noise=noise, seed=2, footprint="exact", **COARSE))
    plan, rate = made.plan, made.plan.options["yaw_rate"]
    assert made.succeeded, (made.outcome, made.reason)
    assert certify(made.rollout).certified
    assert made.rollout.record.footprint_margin > 0
    assert made.rollout.t[-1] < plan.arrive[-1] + 2.0
    turns = np.abs(np.diff(plan.cells, 2, axis=0)).any(axis=1)
    stops = (plan.leave - plan.arrive)[1:-1]
    assert stops[turns].min() >= np.pi / 4 / rate - 1e-9
    assert stops.sum() > turns.sum() * np.pi / 4 / rate + 0.5  # it waits for the mover as well


@pytest.mark.parametrize("noise", [pytest.param(0.0, marks=pytest.mark.slow), 1.0])
def test_a_robot_that_turns_slower_than_planned_is_late_and_plans_again(noise):
    hasty = load_planner("sipp", speed=1.0, yaw_rate=5.0)
    made = run(
        Scenario.of(door(DOORS["jackal"], CROSSING), hasty, "jackal", noise=noise, seed=2, footprint="exact", **COARSE)
    )
    assert made.succeeded, (made.outcome, made.reason)
    assert certify(made.rollout).certified
    assert {(one.trigger, one.solved) for one in made.rollout.record.replans} == {("late", True)}


def test_a_result_names_the_cell_that_the_footprint_was_planned_on(driven):
    made = driven("jackal", 0.0)
    log, result = made.rollout, made.as_dict()
    assert (made.scenario.planning_cell, log.record.cell, result["cell_m"]) == (0.1, 0.05, 0.05)
    assert list(false_claims(result, made.logged)) == []


def test_a_route_that_ends_short_of_a_goal_with_room_for_the_disc_is_genuine():
    """The straight from the last cell to the goal is not clear for the footprint."""
    task = generate("forest", np.random.default_rng(24), {}, name="forest", note="")
    made = run(Scenario.of(task, "astar", "husky", footprint="exact", noise=1.0, **COARSE))
    short = math.dist(made.rollout.route[-1], task.goal)
    assert 1.5 * made.rollout.record.cell < short < task.goal_tolerance
    assert made.succeeded, made.certificate.problems


def test_a_plan_for_a_footprint_on_finer_cells_is_made_again_from_its_log(tmp_path):
    """The footprint is planned on cells of 0.05 m, and only because the way of the disc on the asked cells is long."""
    world = World("open", (0.0, 0.0, 6.0, 3.0), (Disc(3.0, 1.5, 0.2),))
    done = run(Scenario.of(Task(world, (1.0, 1.5, 0.0), (5.0, 1.5), cell=0.5), "astar", "husky", **COARSE))
    record = done.rollout.record
    assert record.cell < record.asked_cell == 0.5
    assert record.footprint_margin is not None
    assert not replayed(Rollout.load(done.rollout.save(tmp_path / "rollout.npz"))).problems


def test_an_exact_footprint_is_recorded(driven):
    made = driven("jackal", 0.0)
    exact = run(replace(made.scenario, footprint="exact"))
    assert exact.rollout.record.settings["footprint"] == "exact"
    assert "footprint" not in (made.rollout.record.settings or {})
    assert exact.rollout.record.footprint_margin == made.rollout.record.footprint_margin
    assert np.array_equal(exact.rollout.pose, made.rollout.pose)


def test_in_open_ground_auto_takes_the_disc_bit_for_bit(jackal):
    drives = [
        run(Scenario.of(door(3.0), "astar", jackal, footprint=shape, **COARSE)).rollout for shape in ("auto", "disc")
    ]
    assert drives[0].record.footprint_margin is None
    for name in FORMS:
        assert getattr(drives[0], name).tobytes() == getattr(drives[1], name).tobytes()


def test_exact_needs_a_planner_for_footprints(jackal):
    with pytest.raises(FieldError, match=r"^footprint: exact: .* plans for the disc around the robot; [^\n]*$"):
        Scenario.of(door(3.0), load_planner("tangent"), jackal, footprint="exact")


def test_a_disc_has_no_choice_of_shape(turtlebot):
    notes = idle_settings(Scenario.of(door(3.0), "astar", turtlebot, footprint="exact"), {"footprint"})
    assert notes == {"footprint": "turtlebot is a disc"}
