"""Mutation tests of the controller's kernels."""

import math

import numpy as np
import pytest

from antdrive.robots import PurePursuit
from antdrive.robots.control._kernels_avoidance import AvoidanceWeights, Encounter, among_movers, progress_by_distance
from antdrive.robots.control._kernels_obstacles import ObstacleIndex, index_discs
from antdrive.robots.control._kernels_path import PathSamples, clear_lookaheads, project
from antdrive.robots.control._kernels_pursuit import rotation
from antdrive.worlds import Route, World
from tests.robots.control.profiles import profile
from tests.robots.control.test_rules import LIMITS, TUNING

WIDE = np.array([-50.0, -50.0, 50.0, 50.0])
STRAIGHT = np.array([(0.0, 0.0), (1.0, 0.0), (2.0, 0.0), (3.0, 0.0)])


def samples(xy):
    arc = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(xy, axis=0).T))])
    empty = np.empty(0)
    return PathSamples(xy, arc, empty, empty, empty, empty)


@pytest.mark.parametrize("progress", [0.0, 0.5, 1.0, 1.5, 2.5, 3.0])
def test_a_projection_never_goes_back(progress):
    """The robot stands behind its progress, beside an earlier segment."""
    path = samples(STRAIGHT)
    for x in (0.0, 0.7, 1.4, 2.2):
        s, k = project(x, 0.1, progress, 0.4, path.xy, path.arc)
        assert s == pytest.approx(min(max(x, progress), progress + 0.4, 3.0))
        assert path.arc[k] <= s <= path.arc[k + 1]


def test_lookaheads_end_where_the_line_to_the_carrot_would_come_too_close():
    """Round a corner with a pillar in it; the route itself keeps 0.3 m, lines across the corner come nearer."""
    path, disc = samples(np.array([(0.0, 0.0), (2.0, 0.0), (2.0, 2.0)])), np.array([[1.5, 0.5, 0.2]])
    obstacles = ObstacleIndex(*index_discs(disc, WIDE, 100.0, 5.0), WIDE, WIDE[:2], 100.0)
    low, high, spacing, required = 0.2, 1.5, 0.1, 0.25
    found = np.empty(31)
    clear_lookaheads(path.xy, path.arc, obstacles, required, spacing, low, high, found)
    shares = np.linspace(0, 1, 2001)[:, None]

    def keeps(s, length):
        ends = [np.array([np.interp(at, path.arc, values) for values in path.xy.T]) for at in (s, min(s + length, 4.0))]
        line = ends[0] + shares * (ends[1] - ends[0])
        return bool(np.hypot(*(line - disc[0, :2]).T).min() - 0.2 > required - 1e-6)

    assert (found < high).any()
    assert (found == high).any()
    for i, length in enumerate(found):
        steps = np.append(np.arange(low + 0.1, high - 1e-9, 0.1), high)
        expected = low
        for step in steps:
            if not keeps(i * spacing, step):
                break
            expected = step
        assert length == pytest.approx(expected), i * spacing


def test_lookaheads_and_braking_keep_their_fractions_of_the_margin(turtlebot):
    world = World("open", (-5.0, -5.0, 5.0, 5.0))
    controller = PurePursuit(lookahead_margin=0.7, stopping_margin=0.4)
    tuning = controller.prepare(Route(STRAIGHT), world, turtlebot, 0.1, 1 / 60).tuning
    assert tuning.lookahead_clearance == pytest.approx(turtlebot.radius + 0.07)
    assert tuning.stopping_clearance == pytest.approx(turtlebot.radius + 0.04)


def test_the_yaw_rate_of_a_profile_turns_the_heading(turtlebot):
    angles = np.linspace(0, 2.0, 200)
    p = profile(Route(0.8 * np.stack([np.sin(angles), 1 - np.cos(angles)], axis=1)), turtlebot)
    turned = np.diff(p.time) * (p.yaw_rate[1:] + p.yaw_rate[:-1]) / 2
    assert turned.sum() == pytest.approx(p.heading[-1] - p.heading[0], rel=0.01)


def weights(**changes):
    values = dict.fromkeys(AvoidanceWeights._fields, 0.0)
    return AvoidanceWeights(**{**values, **changes})


def test_a_candidate_is_worth_less_the_nearer_it_comes_to_movers():
    near = weights(reversal_weight=2.0, clearance_weight=3.0, preferred_clearance=0.5)
    assert among_movers(7.0, Encounter(math.inf, 1.0, 0.0), near) == 7.0
    assert among_movers(7.0, Encounter(math.inf, 0.5, 0.25), near) == pytest.approx(6.5)
    assert among_movers(7.0, Encounter(math.inf, 0.3, 0.25), near) == pytest.approx(6.5 - 0.6)


@pytest.mark.parametrize("turn", [0.0, 0.9, math.pi / 2, 2.5, -2.0])
def test_progress_is_at_most_the_travel_in_the_routes_direction(turn):
    """On a straight route in any direction, for a robot a metre from its start and one that is behind."""
    cos, sin = math.cos(turn), math.sin(turn)
    path = samples(STRAIGHT @ np.array([[cos, sin], [-sin, cos]]))
    for along in (1.0, 0.6):
        found = np.empty(5)
        off = progress_by_distance(along * cos, along * sin, turn + 0.4, 1.0, 1.5, path, 2.0, found)
        np.testing.assert_allclose(found, np.clip(along + np.linspace(0, 2, 5), 1.0, 2.5), atol=1e-9)
        assert off == pytest.approx(0.4)


def test_before_it_rotates_a_robot_brakes_on_its_curve():
    fast = TUNING.creep_speed * 2
    assert rotation(fast, 2 * fast, 0.6, 1.0, LIMITS, TUNING) == pytest.approx(0.3)
    assert rotation(fast, 2 * fast, -0.6, 1.0, LIMITS, TUNING) == pytest.approx(-0.3)
    assert rotation(fast, 0.0, 0.6, 1.0, LIMITS, TUNING) == rotation(-fast, -2 * fast, 0.6, 1.0, LIMITS, TUNING) == 0.0
    full = min(LIMITS.yaw_rate, (LIMITS.yaw_acceleration * 2.0) ** 0.5)
    assert rotation(0.0, 0.0, 0.0, 2.0, LIMITS, TUNING) == pytest.approx(full)
    assert rotation(0.0, 0.0, 0.0, -2.0, LIMITS, TUNING) == pytest.approx(-full)
