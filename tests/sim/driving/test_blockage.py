"""Movers that stand still: a robot gives up where they close every way, and drives a gap beside them if nothing moves."""

from dataclasses import replace

import numpy as np
import pytest

from antdrive.sim import Outcome, Perception, ReplanPolicy, Scenario, certify, run
from antdrive.sim.log.certificate import closed_form_clearance
from antdrive.worlds import Disc, Keyframed, Task, World
from tests.records import COARSE, changed

LANE = World("lane", (0.0, 0.0, 8.0, 1.2))
TASK = Task(LANE, (0.6, 0.6, 0.0), (7.2, 0.6), cell=0.1)
PLUG = Keyframed(radius=0.3, keyframes=((0.0, 5.0, 0.6), (9.0, 5.0, 0.6)))


def among(*movers, robot, planner="dstar-lite", **settings):
    task = changed(TASK, "world", movers=movers)
    return run(Scenario.of(task, planner, robot, **COARSE, **settings))


@pytest.fixture(scope="module")
def blocked(turtlebot):
    return among(PLUG, robot=turtlebot).rollout


def with_record(log, **changes):
    return changed(log, "record", digest=None, **changes)


def test_each_search_waits_twice_as_long_as_the_one_before(blocked):
    assert blocked.outcome is Outcome.BLOCKED
    assert blocked.record.reason == (
        "movers[0] stands still at (5.00, 0.60) and closes the way; no route to the goal for 30 s, in 6 attempts"
    )
    times = [replan.t for replan in blocked.record.replans]
    assert np.diff(times) == pytest.approx([1, 2, 4, 8, 15], abs=0.06)  # to a control period
    assert not any(replan.solved for replan in blocked.record.replans)
    assert blocked.t[-1] == pytest.approx(times[-1])
    assert certify(blocked).certified


@pytest.mark.parametrize("planner", ["ants", "tangent", "mmas-dstar"])
def test_planners_of_every_kind_give_up(planner, turtlebot):
    done = among(PLUG, robot=turtlebot, planner=planner, replanning=ReplanPolicy(patience=5.0))
    assert done.outcome is Outcome.BLOCKED, done.reason
    assert sum(not replan.solved for replan in done.rollout.record.replans) <= 4
    assert done.certificate.certified


def test_a_mover_that_leaves_in_time_is_waited_for(turtlebot):
    leaves = Keyframed(radius=0.3, keyframes=((0.0, 5.0, 0.6), (14.0, 5.0, 0.6), (17.0, 9.0, 0.6)), loop="once")
    assert among(leaves, robot=turtlebot).succeeded
    assert among(leaves, robot=turtlebot, replanning=ReplanPolicy(patience=3.0)).outcome is Outcome.BLOCKED


def test_a_mover_that_is_known_to_leave_is_waited_for_without_end(turtlebot):
    leaves = Keyframed(radius=0.3, keyframes=((0.0, 5.0, 0.6), (12.0, 5.0, 0.6), (16.0, 9.0, 0.6)), loop="once")
    policy = ReplanPolicy(patience=6.5)
    assert among(leaves, robot=turtlebot, replanning=policy).outcome is Outcome.BLOCKED
    assert among(leaves, robot=turtlebot, replanning=policy, perception=Perception(kind="motions")).succeeded


def test_patience_restarts_when_the_mover_moves_on(turtlebot):
    frames = ((0.0, 5.0, 0.6), (10.0, 5.0, 0.6), (12.0, 5.6, 0.6))
    moves_on = Keyframed(radius=0.3, keyframes=frames, loop="once")
    done = among(moves_on, robot=turtlebot, replanning=ReplanPolicy(patience=12.0))
    assert done.outcome is Outcome.BLOCKED
    assert "(5.60, 0.60)" in done.reason
    assert 22.0 < done.rollout.t[-1] < 27.0


@pytest.mark.slow
def test_a_mover_that_moves_is_never_given_up_on(turtlebot):
    """It walks to and fro by 0.3 m, and the lane is closed all the time; the robot looks for a way every 1 to 2 s."""
    restless = Keyframed(radius=0.3, keyframes=((0.0, 5.0, 0.6), (3.0, 5.3, 0.6)))
    done = among(restless, robot=turtlebot, time_limit=50.0)
    assert done.outcome is Outcome.TIMED_OUT
    assert len(done.rollout.record.replans) > 20


def test_a_way_that_only_movers_on_the_move_close_is_open(turtlebot):
    """A mover stands in one gate, and another walks in the other."""
    wall = tuple(Disc(4.0, y, 0.25) for y in np.arange(0.25, 6.0, 0.5) if not (2.2 < y < 3.8 or y > 5.0))
    hall = World("hall", (0.0, 0.0, 8.0, 6.5), wall)
    stands = Keyframed(radius=0.45, keyframes=((0.0, 4.0, 3.0), (9.0, 4.0, 3.0)))
    walks = Keyframed(radius=0.6, keyframes=((0.0, 4.0, 5.6), (3.0, 4.2, 5.8)))
    for second, outcome in (
        (walks, Outcome.TIMED_OUT),
        (replace(walks, keyframes=((0.0, 4.0, 5.6), (3.0, 4.0, 5.6))), Outcome.BLOCKED),
    ):
        task = Task(replace(hall, movers=(stands, second)), (1.0, 3.0, 0.0), (7.0, 3.0), cell=0.25)
        policy = ReplanPolicy(patience=5.0)
        done = run(Scenario.of(task, "dstar-lite", turtlebot, replanning=policy, time_limit=25.0, **COARSE))
        assert done.outcome is outcome, done.reason


def test_a_robot_that_may_not_replan_around_movers_waits_to_the_end(turtlebot):
    for policy in (None, ReplanPolicy(around_movers=False, patience=2.0)):
        assert among(PLUG, robot=turtlebot, replanning=policy, time_limit=12.0).outcome is Outcome.TIMED_OUT


def test_an_unseen_cylinder_in_the_lane_is_run_into(turtlebot):
    done = among(robot=turtlebot, unseen=(Disc(5.0, 0.6, 0.3),))
    assert done.outcome is Outcome.COLLIDED


def test_a_log_that_ends_with_a_route_is_not_blocked(blocked):
    *rest, last = blocked.record.replans
    for replans in ((), (*rest, replace(last, solved=True, cost_m=1.0, route=((4.0, 0.6), blocked.record.task.goal)))):
        (problem,) = certify(with_record(blocked, replans=replans)).problems
        assert problem == "outcome: blocked, but the drive does not end with a search that found no route"


def test_a_log_whose_movers_all_move_is_not_blocked(turtlebot):
    restless = Keyframed(radius=0.3, keyframes=((0.0, 5.0, 0.6), (3.0, 5.3, 0.6)))
    log = among(restless, robot=turtlebot, time_limit=12.0).rollout
    assert certify(log).certified
    problems = certify(with_record(log, outcome=Outcome.BLOCKED)).problems
    assert "outcome: blocked, but no mover stood still for 30 s" in problems


WIDTH, RADIUS = 2.0, 0.3
RESTLESS = Keyframed(radius=0.1, keyframes=((0.0, 7.0, 0.3), (3.0, 7.5, 0.3)))


def standing(gap, *later):
    y = WIDTH - gap - RADIUS
    return Keyframed(radius=RADIUS, keyframes=((0.0, 5.0, y), (9.0, 5.0, y), *later), loop="once")


def past(gap, *others, mover=None, robot, planner="dstar-lite", **settings):
    """A lane that cylinders close but for a mover and a gap between it and the wall."""
    y = WIDTH - gap - RADIUS
    posts = tuple(Disc(5.0, 0.1 + 0.2 * k, 0.1) for k in range(9) if 0.1 + 0.2 * k < y)
    world = World("gap", (0.0, 0.0, 8.0, WIDTH), posts, movers=(mover or standing(gap), *others))
    task = Task(world, (0.6, 1.0, 0.0), (7.2, 1.0), cell=0.05)
    return run(Scenario.of(task, planner, robot, **COARSE, **settings))


@pytest.mark.parametrize(("gap", "planner"), [(0.44, "dstar-lite"), (0.5, "tangent"), (0.44, "astar")])
def test_a_gap_beside_a_mover_that_stands_still_is_driven_at_the_margin(turtlebot, gap, planner):
    done = past(gap, robot=turtlebot, planner=planner)
    assert done.succeeded, done.reason
    least = float(closed_form_clearance(done.rollout).min())
    assert 0.02 < least < gap / 2 - turtlebot.radius + 1e-9, "closer than avoidance usually lets the robot come"
    assert len(done.rollout.record.replans) <= 4


def test_while_anything_moves_the_gap_is_refused_with_the_reason(turtlebot):
    done = past(0.46, RESTLESS, robot=turtlebot, replanning=ReplanPolicy(patience=8.0), time_limit=60.0)
    assert done.outcome is Outcome.BLOCKED
    assert done.reason.startswith(
        "movers[0] stands still at (5.00, 1.24) and leaves a gap too narrow for local avoidance, which keeps the robot's "
        "centre 0.28 m from it; no route to the goal for 8 s"
    )
    assert done.certificate.certified
    assert len(done.rollout.record.replans) <= 8


def test_a_mover_beyond_the_range_of_perception_does_not_count(turtlebot):
    assert past(0.46, RESTLESS, robot=turtlebot, perception=Perception(range=1.5)).succeeded


def test_a_gap_that_no_plan_passes_closes_the_way(turtlebot):
    done = past(0.41, robot=turtlebot, replanning=ReplanPolicy(patience=3.0))
    assert done.outcome is Outcome.BLOCKED
    assert "and closes the way;" in done.reason


def test_a_wider_way_is_taken_instead(turtlebot):
    """The way through the gap is shorter, the way past the other end of the wall wider."""
    wall = tuple(Disc(5.0, y, 0.1) for y in np.arange(1.7, 4.4, 0.2))
    mover = Keyframed(radius=0.3, keyframes=((0.0, 5.0, 4.7), (9.0, 5.0, 4.7)))
    world = World("two ways", (0.0, 0.0, 9.0, 5.5), wall, movers=(mover,))  # gaps of 0.5 m and 1.6 m
    task = Task(world, (2.0, 4.7, 0.0), (8.0, 4.7), cell=0.1)
    done = run(Scenario.of(task, "dstar-lite", turtlebot, **COARSE))
    assert done.succeeded, done.reason
    assert done.rollout.pose[:, 1].min() < 1.5


@pytest.mark.parametrize(("seconds", "x"), [(12.0, 3.0), (13.0, 7.0)])
def test_a_mover_that_sets_out_while_the_robot_passes_is_not_run_into(turtlebot, seconds, x):
    """It moves away along the lane, either way, when the robot is about to enter its gap."""
    y = WIDTH - 0.5 - RADIUS
    leaves = standing(0.5, (seconds, 5.0, y), (seconds + 8.0, x, y))
    assert past(0.5, mover=leaves, robot=turtlebot, time_limit=22.0).outcome is not Outcome.COLLIDED


def test_a_robot_without_avoidance_notes_no_gaps(turtlebot):
    assert past(0.46, robot=turtlebot, avoidance=None).succeeded
