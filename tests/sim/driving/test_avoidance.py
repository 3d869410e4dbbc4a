"""Robots that avoid movers."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from antdrive.robots import LIMITERS, Avoidance
from antdrive.sim import Outcome, Perception, Scenario, run
from antdrive.sim.log.record import PerceptionRecord
from antdrive.worlds import Cruising, Disc, Keyframed, Task, Trajectories, World
from tests.records import COARSE, changed
from tests.sim.driving.ground_truth import GroundTruth

HALL = World("hall", (0.0, 0.0, 9.0, 6.0))
TASK = Task(HALL, (1.0, 3.0, 0.0), (8.0, 3.0), cell=0.25)
AISLE = World("aisle", (0.0, 0.0, 9.0, 1.0))


def keyframed(*frames, radius=0.3, **rest):
    return Keyframed(radius=radius, keyframes=frames, **{"loop": "once", **rest})


def among(*movers, robot, task=TASK, **settings):
    """A drive among movers; without replanning, unless the settings say otherwise."""
    settings = {"replanning": None, **COARSE, **settings}
    task = changed(task, "world", movers=movers)
    return run(Scenario.of(task, "astar", robot, **settings))


CROSSING = keyframed((0.0, 4.5, 0.6), (10.7, 4.5, 5.4))  # crosses the route where the robot is at that time
HEAD_ON = keyframed((0.0, 8.4, 3.0), (12.0, 0.6, 3.0), (13.0, 0.6, 5.0))
OVERTAKING = keyframed((0.0, -0.9, 3.0), (8.0, 10.3, 3.0))
REVERSING = keyframed((0.0, 4.6, 1.0), (5.0, 4.6, 3.5), (9.0, 4.6, 1.5), radius=0.25)
SLOW = keyframed((0.0, 3.0, 3.0), (50.0, 8.0, 3.0), (52.0, 8.0, 5.0))


@pytest.mark.parametrize("mover", [CROSSING, HEAD_ON, SLOW], ids=["crossing", "head on", "slower in front"])
def test_a_mover_on_the_route_is_avoided(mover, turtlebot):
    """A robot without avoidance collides with each of them."""
    blind = among(mover, robot=turtlebot, avoidance=None)
    assert blind.outcome is Outcome.COLLIDED
    seeing = among(mover, robot=turtlebot)
    assert seeing.succeeded, (seeing.outcome, seeing.reason, seeing.certificate)
    assert "avoid" in {LIMITERS[k] for k in np.unique(seeing.rollout.limiter)}
    assert seeing.rollout.clearance.min() > 0.03


def test_a_faster_mover_from_behind_is_let_pass(turtlebot):
    blind, seeing = (among(OVERTAKING, robot=turtlebot, avoidance=y) for y in (None, Avoidance()))
    assert blind.outcome is Outcome.COLLIDED
    assert seeing.succeeded, (seeing.outcome, seeing.reason)


def test_in_a_narrow_aisle_the_robot_stops_for_a_crossing_mover_and_goes_on(turtlebot):
    crossing = keyframed((0.0, 4.5, -1.0), (4.0, 4.5, 0.4), (7.5, 4.5, 0.6), (9.0, 4.5, 2.5), radius=0.2)
    task = Task(AISLE, (1.0, 0.5, 0.0), (8.0, 0.5), cell=0.1)
    assert among(crossing, robot=turtlebot, task=task, avoidance=None).outcome is Outcome.COLLIDED
    done = among(crossing, robot=turtlebot, task=task)
    assert done.succeeded, (done.outcome, done.reason)
    speed = done.rollout.twist[:, 0]
    assert speed[80:-80].min() < 0.1, "the robot waits"
    assert np.abs(done.rollout.pose[:, 1] - 0.5).max() < 0.15


def test_in_a_narrow_aisle_the_robot_backs_off_from_an_approaching_mover(turtlebot):
    comes = keyframed((0.0, 6.0, 0.5), (12.0, 2.0, 0.5), (20.0, 8.7, 0.5), radius=0.2)
    task = Task(AISLE, (3.0, 0.5, 0.0), (7.0, 0.5), cell=0.1, time_limit=40.0)
    assert among(comes, robot=turtlebot, task=task, avoidance=None).outcome is Outcome.COLLIDED
    done = among(comes, robot=turtlebot, task=task)
    assert not len(done.rollout.contacts), (done.outcome, done.reason)
    assert done.rollout.pose[:, 0].min() < 2.0, "the robot went back past its start"


def test_a_robot_near_its_goal_gets_out_of_the_way_of_an_approaching_mover(turtlebot):
    """The mover comes before the robot can stop within the goal tolerance."""
    comes = Cruising(radius=0.3, position=(4.0, 3.0), velocity=(-0.6, 0.0))
    done = among(comes, robot=turtlebot)
    assert done.rollout is not None
    assert done.succeeded, (done.outcome, done.reason)


@pytest.mark.parametrize(("speed", "t"), [(0.3, 5.4), (0.5, 5.0), (0.5, 6.2)])
def test_a_mover_that_has_just_passed_may_reverse(speed, t, turtlebot):
    """A robot that trusts the prediction drives close behind the mover and is hit when it reverses."""
    begin = t - 2.5 / speed
    frames = ((0.0, 4.6, 3.5 - speed * t),) if begin <= 0 else ((0.0, 4.6, 1.0), (begin, 4.6, 1.0))
    turns = keyframed(*frames, (t, 4.6, 3.5), (t + 4.0, 4.6, 3.5 - 4.0 * speed), radius=0.25)
    trusting, careful = (
        among(turns, robot=turtlebot, avoidance=y) for y in (Avoidance(reversal_weight=0.0), Avoidance())
    )
    assert trusting.rollout.clearance.min() < 0.03, "it is hit, or dodges in the last moment"
    assert careful.succeeded, (careful.outcome, careful.reason)
    assert careful.rollout.clearance.min() > 0.03


def test_a_mover_whose_motion_is_known_is_not_expected_to_reverse(turtlebot):
    known = Perception(kind="motions")
    one, other = (
        among(REVERSING, robot=turtlebot, avoidance=y, perception=known)
        for y in (Avoidance(reversal_weight=0.0), Avoidance())
    )
    assert one.succeeded
    assert (one.rollout.pose == other.rollout.pose).all()


def test_where_contact_cannot_be_avoided_the_robot_stands_still(turtlebot):
    """A piston as wide as the aisle, faster than the robot."""
    piston = keyframed((0.0, 8.0, 0.5), (4.0, 0.0, 0.5), radius=0.45)
    task = Task(AISLE, (1.0, 0.5, 0.0), (8.0, 0.5), cell=0.1)
    done = among(piston, robot=turtlebot, task=task, physics_hz=240, control_hz=60)
    assert done.outcome is Outcome.HIT_WHILE_STANDING, done.reason


@pytest.mark.parametrize(("told", "gap"), [("positions", 0.08), ("velocities", 0.02)])
def test_a_standing_mover_closer_than_the_least_clearance_is_not_driven_into(turtlebot, told, gap):
    """The mover blocks the aisle, and the robot waits in front of it."""
    plug = keyframed((0.0, 1.48 + gap, 0.5), (100.0, 1.48 + gap, 0.501))
    task = Task(AISLE, (1.0, 0.5, 0.0), (8.0, 0.5), cell=0.1, time_limit=8.0)
    done = among(plug, robot=turtlebot, task=task, perception=Perception(kind=told))
    assert done.outcome is Outcome.TIMED_OUT
    assert np.abs(done.rollout.twist[:, 0]).max() < 1e-3


def test_a_robot_that_cannot_escape_stands_still(turtlebot):
    """A wall is behind the robot, and the mover arrives before the robot could turn."""
    comes = keyframed((0.0, 2.2, 0.5), (4.0, 0.2, 0.5), radius=0.4)
    task = Task(AISLE, (0.4, 0.5, math.pi / 2), (8.0, 0.5), cell=0.1)
    done = among(comes, robot=turtlebot, task=task)
    assert done.outcome is Outcome.HIT_WHILE_STANDING, done.reason
    end = int(done.rollout.contacts[0, 0])
    assert np.abs(done.rollout.twist[end - 4 : end]).max() < 1e-3


def test_static_obstacles_are_kept_clear_of_while_movers_are_avoided(turtlebot):
    posts = tuple(Disc(x, y, 0.15) for x in (2.5, 4.0, 5.5) for y in (2.2, 3.8))
    task = changed(TASK, "world", obstacles=posts)
    done = among(CROSSING, HEAD_ON, robot=turtlebot, task=task)
    assert not any(done.rollout.contacts[:, 1] < len(posts))


def test_a_robot_does_not_avoid_what_it_does_not_see(turtlebot):
    near = among(CROSSING, robot=turtlebot, perception=Perception(range=1e-3))
    assert near.outcome is Outcome.COLLIDED
    for told in ("positions", "motions"):
        known = among(CROSSING, robot=turtlebot, perception=Perception(kind=told))
        assert known.rollout.record.perception == PerceptionRecord(kind=told, range_m=None)


@given(st.integers(0, 2000), st.sampled_from(["positions", "velocities", "motions"]))
def test_movers_are_predicted_as_the_perception_allows(tick, told):
    movers = (CROSSING, Cruising(radius=0.2, position=(2.0, 2.0), velocity=(0.5, 0.3)))
    traffic = Trajectories.of(replace(HALL, movers=movers), (1.0, 3.0))
    ahead = Avoidance().prediction_times
    truth = GroundTruth(traffic, Perception(kind=told)).at(tick)
    places, radii = truth.predict(ahead), truth.near.radii
    now, speed = traffic.positions(tick / 60)[0], traffic.velocities(tick / 60)[0]
    expected = {
        "positions": np.repeat(now[None], len(ahead), axis=0),
        "velocities": now + ahead[:, None, None] * speed,
        "motions": traffic.positions(tick / 60 + ahead),
    }[told]
    np.testing.assert_allclose(places, expected, atol=1e-12)
    assert radii.tolist() == [0.3, 0.2]


def test_a_robot_with_too_little_clearance_gains_more(turtlebot):
    """A mover that starts closer than the minimum clearance follows it slowly."""
    creeps = keyframed((0.0, 1.51, 3.0), (20.0, -2.5, 3.0), radius=0.25)
    assert among(creeps, robot=turtlebot, avoidance=None).outcome is Outcome.COLLIDED
    done = among(creeps, robot=turtlebot)
    assert done.succeeded, (done.outcome, done.reason)


def test_a_robot_that_can_stop_at_its_goal_in_time_does_so(turtlebot):
    """A mover arrives there later; if the drive went on, the robot would avoid it."""
    comes = keyframed((0.0, 8.0, 5.7), (9.5, 8.0, 5.7), (13.5, 8.0, 2.9), radius=0.25)
    done = among(comes, robot=turtlebot)
    assert done.succeeded, (done.outcome, done.reason)
    assert done.rollout.t[-1] < 11.0


def test_an_abrupt_turn_of_the_avoidance_is_no_reason_to_refuse_a_log():
    """Slowed along the same curve, the commanded yaw rate falls faster than the robot could turn by itself."""
    done = run(Scenario.of("plaza-moving", "mmas-dstar", **COARSE))
    steps = np.abs(np.diff(done.rollout.command[1::4, 1]))
    assert steps.max() > 1.5 * done.scenario.robot.max_yaw_acceleration / COARSE["control_hz"]
    assert done.certificate.problems == ()


@pytest.mark.parametrize("speed", [0.8, 9.0])
def test_a_robot_slows_down_near_a_person_ahead_and_drives_on_fast(jackal, speed):
    walks = keyframed((0.0, 8.0, 3.8), (20.0, 0.0, 3.8))
    done = among(walks, robot=replace(jackal, near_speed=speed))
    assert done.succeeded, (done.outcome, done.reason)
    log = done.rollout
    to = log.movers[:, 0] - log.pose[:, :2]
    ahead = to[:, 0] * np.cos(log.pose[:, 2]) + to[:, 1] * np.sin(log.pose[:, 2]) > 0
    near = ahead & (np.hypot(*to.T) - 0.3 - jackal.radius < 1.0)
    assert (log.twist[near, 0].max() > 0.85) == (speed > 0.8)
    assert log.twist[:, 0].max() > 1.5
