"""A mover turns straight at the robot from close by: the robot dodges where it can no longer keep the minimum clearance."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from antdrive.robots import Avoidance, PurePursuit, load_robot
from antdrive.robots.control import _kernels_avoidance as kernels
from antdrive.worlds import Route, World
from tests.robots.control.kinematics import avoiding

JACKAL, RADIUS, HZ = load_robot("jackal"), 0.5, 60
LENGTH, WIDTH = 0.508, 0.430


@pytest.fixture(scope="module")
def tracked():
    route = Route(np.array([(-15.0, 0.0), (15.0, 0.0)]))
    return PurePursuit().prepare(route, World("open", (-20, -20, 20, 20)), JACKAL, 0.05, 1 / HZ)


def gap_to(pose, mover):
    """The distance between the jackal's rectangle and a mover's surface, by points along the rectangle's outline [m]."""
    s = np.linspace(-1, 1, 101)
    outline = np.concatenate(
        [np.stack([s * LENGTH / 2, np.full(101, e * WIDTH / 2)], 1) for e in (-1, 1)]
        + [np.stack([np.full(101, e * LENGTH / 2), s * WIDTH / 2], 1) for e in (-1, 1)]
    )
    x, y, yaw = pose
    turned = outline @ np.array([[math.cos(yaw), math.sin(yaw)], [-math.sin(yaw), math.cos(yaw)]]) + (x, y)
    return float(np.hypot(*(turned - mover).T).min()) - RADIUS


def least_gap(tracked, speed, bearing, gap, mover_speed):
    """The least gap in two seconds after a mover has turned onto a collision course [m].

    The robot drives along the route. The mover's surface is `gap` from its circumscribed circle, at a bearing.
    """
    avoidance, reach = Avoidance(), gap + RADIUS + JACKAL.radius
    start = reach * np.array([math.cos(bearing), math.sin(bearing)])
    # It meets a robot that does not react: across the line of sight both move alike.
    sight, across = start / reach, np.array([-math.sin(bearing), math.cos(bearing)])
    alike = -speed * math.sin(bearing)
    velocity = alike * across - math.sqrt(max(mover_speed**2 - alike**2, 0.0)) * sight

    def movers(k):
        return (start + (k / HZ + avoidance.prediction_times[:, None]) * velocity)[:, None], None

    poses = avoiding(
        tracked, JACKAL, avoidance, movers, RADIUS, start=(0.0, 0.0, 0.0), speed=speed, arc=15.0, seconds=2
    )
    return min(gap_to(pose, start + (k + 1) / HZ * velocity) for k, pose in enumerate(poses))


@settings(max_examples=25, deadline=None)
@given(speed=st.floats(1.0, 2.0), bearing=st.floats(90, 180), side=st.sampled_from([-1, 1]), gap=st.floats(0.8, 2.0))
def test_a_mover_that_turns_at_the_robot_from_abeam_or_behind_is_escaped(tracked, speed, bearing, side, gap):
    assert least_gap(tracked, speed, side * math.radians(bearing), gap, 1.7) > 0.03


@pytest.mark.parametrize("side", [-1, 1])
def test_a_robot_dodges_a_mover_for_which_it_cannot_stop_in_time(tracked, side, monkeypatch):
    """It comes from ahead at an angle, at 0.9 m. A robot that stops instead is hit before it stands."""
    assert least_gap(tracked, 2.0, side * math.radians(45), 0.9, 1.7) > 0.03
    monkeypatch.setattr(kernels, "best_escape", lambda *_: -1)
    assert least_gap(tracked, 2.0, side * math.radians(45), 0.9, 1.7) < 0


def test_the_oracle_measures_the_gap_to_the_rectangle():
    assert gap_to((1.0, 2.0, math.pi / 2), np.array([1.0, 3.5])) == pytest.approx(1.5 - LENGTH / 2 - RADIUS)
    assert gap_to((1.0, 2.0, math.pi / 2), np.array([2.5, 2.0])) == pytest.approx(1.5 - WIDTH / 2 - RADIUS)
