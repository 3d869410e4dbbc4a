"""Encounters with one mover: the limits near movers cause no contact that a robot without them avoids."""

import dataclasses
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from antdrive.robots import Avoidance, PurePursuit, load_robot
from antdrive.worlds import Route, World
from tests.robots.control.kinematics import avoiding

HZ = 60
JACKAL = load_robot("jackal")
LIMITED = JACKAL, Avoidance()
UNLIMITED = dataclasses.replace(JACKAL, near_speed=10.0), Avoidance(reverse_speed=10.0, reverse_distance=100.0)
ROUTE = Route(np.array([(0.0, 0.0), (14.0, 0.0)]))
TRACKED = PurePursuit().prepare(ROUTE, World("open", (-30, -30, 50, 30)), JACKAL, 0.05, 1 / HZ)


def least_gap(robot, avoidance, mover, velocity, radius, *, known, turn=(math.inf, 0.0)):
    """The least gap between the robot's circle and a mover that turns once by an angle, by kinematics [m]."""
    (when, by), ahead = turn, avoidance.prediction_times[:, None, None]
    turned = np.array([(math.cos(by), -math.sin(by)), (math.sin(by), math.cos(by))]) @ velocity
    kept = min(when, 8.0)

    def place(t):
        return np.add(mover, min(t, kept) * np.array(velocity) + max(t - kept, 0.0) * turned)

    def movers(k):
        now = turned if k >= kept * HZ else np.array(velocity)
        return place(k / HZ) + ahead * (now if known else 0.0 * now), now[None]

    poses = avoiding(TRACKED, robot, avoidance, movers, radius, start=np.zeros(3), speed=robot.max_speed, seconds=8)
    return min(math.dist(place((k + 1) / HZ), pose[:2]) - radius - robot.radius for k, pose in enumerate(poses))


@pytest.mark.slow
@settings(max_examples=40, deadline=None)
@given(
    meets=st.tuples(st.floats(2, 7), st.floats(-0.8, 0.8)),
    after=st.floats(1, 4),
    heading=st.floats(-math.pi, math.pi),
    speed=st.floats(0, 1.5),
    radius=st.floats(0.15, 0.4),
    known=st.booleans(),
    turn=st.one_of(st.just((math.inf, 0.0)), st.tuples(st.floats(0.5, 4), st.floats(-2.5, 2.5))),
)
def test_the_limits_cause_no_contact(meets, after, heading, speed, radius, known, turn):
    """A mover comes to a point near the route after some time. Its velocity is known, or only its position is."""
    velocity = speed * np.array((math.cos(heading), math.sin(heading)))
    mover = np.array(meets) - after * velocity
    if math.hypot(*mover) < radius + JACKAL.radius + 0.8:
        return
    gap = least_gap(*LIMITED, mover, velocity, radius, known=known, turn=turn)
    assert gap > 0 or least_gap(*UNLIMITED, mover, velocity, radius, known=known, turn=turn) <= 0


@pytest.mark.parametrize(("speed", "known"), [(1.2, False), (1.6, True)])
def test_a_mover_faster_than_people_or_unlike_its_prediction_lifts_the_limits(speed, known):
    """It comes from the side."""
    mover, velocity = (3.0, 2.0 * speed), (0.0, -speed)
    gaps = [least_gap(*which, mover, velocity, 0.3, known=known) for which in (LIMITED, UNLIMITED)]
    assert gaps[0] == gaps[1]


def test_a_person_on_the_way_does_not_lift_them():
    gaps = [least_gap(*which, (3.0, 2.4), (0.0, -1.2), 0.3, known=True) for which in (LIMITED, UNLIMITED)]
    assert gaps[0] != gaps[1]
