"""The controller's kernels where a plausible mistake would go unnoticed on the road."""

import math

import numpy as np
import pytest

from antdrive.robots.control._kernels_obstacles import ObstacleIndex, index_discs, nearby
from antdrive.robots.control._kernels_path import PathSamples
from antdrive.robots.control._kernels_pursuit import pursue, stopping_clearance
from tests.robots.control.test_rules import LIMITS, TUNING

WIDE = np.array([-50.0, -50.0, 50.0, 50.0])
NO_DISCS = np.empty((0, 3))


@pytest.mark.parametrize(("v", "w"), [(1.0, 0.0), (1.0, 0.8), (0.6, -1.5), (2.0, 1e-9), (0.3, 3.0)])
def test_the_stopping_arc_is_that_of_a_period_and_of_braking(v: float, w: float) -> None:
    """Against the arc in a thousand small steps, from a rest of v dt + v^2 / 2a metres."""
    period, deceleration = 0.1, 1.0
    length = v * period + v**2 / (2 * deceleration)
    s = np.linspace(0, length, 1001)
    yaw = 0.4 + w / v * (s[1:] + s[:-1]) / 2
    x = 1.0 + np.concatenate([[0.0], np.cumsum(np.cos(yaw) * np.diff(s))])
    y = 2.0 + np.concatenate([[0.0], np.cumsum(np.sin(yaw) * np.diff(s))])
    for along in (0.0, 0.5, 0.9, 1.0):
        k = round(along * 1000)
        aside = 0.4 + w / v * s[k] + math.pi / 2
        disc = np.array([[x[k] + 0.3 * math.cos(aside), y[k] + 0.3 * math.sin(aside), 0.1]])
        expected = np.hypot(x - disc[0, 0], y - disc[0, 1]).min() - 0.1
        found = stopping_clearance(1.0, 2.0, 0.4, v, w, deceleration, period, disc, WIDE)
        assert found == pytest.approx(expected, abs=1e-4), along


def test_between_two_samples_the_shorter_lookahead_counts() -> None:
    """The robot is 2 cm beside a straight route; the arc to a carrot at 0.2 m has a curvature of 1/m."""
    xy, arc = np.array([(0.0, 0.0), (4.0, 0.0)]), np.array([0.0, 4.0])
    count = 202
    for first, second in ((1.0, 0.2), (0.2, 1.0)):
        lookahead = np.full(count, second)
        lookahead[: int(1.01 / TUNING.spacing) + 1] = first
        path = PathSamples(xy, arc, lookahead, np.full(count, 9.0), np.full(count, math.nan), np.zeros(count))
        obstacles = ObstacleIndex(*index_discs(NO_DISCS, WIDE, 10.0, 1.0), WIDE, 10.0)
        v, w, *_ = pursue(1.01, 0.02, 0.0, 0.5, 0.0, 0.9, False, path, obstacles, LIMITS, TUNING)
        assert w / v == pytest.approx(-2 * 0.02 / 0.2**2, rel=1e-6)


def test_the_discs_near_a_place_are_all_those_that_come_within_the_distance() -> None:
    rng = np.random.default_rng(4)
    bounds = np.array([-3.0, 2.0, 5.0, 8.0])
    discs = rng.uniform((-3, 2, 0.01), (5, 8, 1.5), (40, 3))
    for side, distance in ((0.5, 0.3), (1.0, 1.0), (7.0, 0.0)):
        obstacles = ObstacleIndex(*index_discs(discs, bounds, side, distance), bounds, side)
        for x, y in rng.uniform((-4, 1), (6, 9), (50, 2)):
            here = {tuple(row) for row in nearby(x, y, obstacles).tolist()}
            inside = np.clip((x, y), bounds[:2], bounds[2:])
            gap = np.hypot(*(discs[:, :2] - inside).T) - discs[:, 2]
            assert {tuple(row) for row in discs[gap <= distance].tolist()} <= here
            assert all(gap[k] <= distance + side * math.sqrt(2) for k in range(40) if tuple(discs[k].tolist()) in here)
