"""The search for the best candidate agrees with an exhaustive evaluation."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from antdrive.robots import Avoidance, AvoidanceState, PurePursuit, load_robot
from antdrive.robots.control import _kernels_avoidance as kernels
from antdrive.robots.control.avoidance import _weights
from antdrive.worlds import Disc, Route, World

ROBOT, AVOIDANCE = load_robot("turtlebot"), Avoidance()
TABLE = AVOIDANCE._candidates(ROBOT, AvoidanceState((1.0, 0.3, 0.4, 0.4, 0.3, 0.0), 0.2), 0.6, math.inf, math.inf, True)
near = st.floats(-2.5, 2.5)
speed = st.floats(-0.9, 0.9)


@pytest.fixture(scope="module")
def tracked():
    x = np.linspace(-6, 6, 49)
    world = World("bends", (-8, -8, 8, 8), (Disc(1.2, 1.3, 0.3), Disc(-1.0, -0.9, 0.2)))
    return PurePursuit().prepare(Route(np.stack([x, 0.4 * np.sin(2 * x)], axis=1)), world, ROBOT, 0.05, 1 / 60)


def in_turn(situation, contact_distances, near):
    """Return the choice and its contact from evaluating each candidate in order."""
    x, y, yaw, v, w, s, _, candidates, path, obstacles, limits, tuning, weights, places, radii = situation
    steps = len(places) - 1
    everyone = kernels.Reachable(np.tile(near, (steps, 1)), np.full(steps, len(near)))
    window = limits.speed * (weights.step * steps) + tuning.lookahead_max
    keeps = {
        on_route: kernels.least_clearance(x, y, yaw, on_route, False, obstacles, tuning, weights)
        for on_route in (False, True)
    }
    best, best_score, best_contact, unpassed = -1, -math.inf, -1.0, []
    for n, candidate in enumerate(candidates):
        required = keeps[candidate[kernels.KIND] == kernels.FOLLOW_ROUTE]
        trail = np.empty((steps + 1, 5))
        trail[0] = x, y, yaw, v, w
        end = kernels.follow(
            *situation[:7], candidate, path, obstacles, limits, tuning, weights.step, 0, True, required, trail
        )  # fmt: skip
        if end.blocked:
            continue
        met = kernels.encounter(trail, end, places, radii, near, everyone, contact_distances, weights, math.inf)
        if met.contact < math.inf:
            if best_contact < math.inf and met.contact > best_contact + 1e-9:
                best, best_contact = n, met.contact
            continue
        apart = np.hypot(*np.moveaxis(places[-2:, near] - trail[-2:, None, :2], -1, 0))
        if candidate[kernels.KIND] == kernels.BESIDE_ROUTE and (apart[1] < apart[0]).any():
            unpassed.append(n)
            continue
        if n == 0 and met.clearance >= weights.preferred_clearance and met.intrusion == 0:
            return 0, math.inf
        value = kernels.worth(trail[-1], s, window, path, tuning, weights)
        value -= weights.reversal_weight * met.intrusion
        value -= weights.clearance_weight * max(weights.preferred_clearance - met.clearance, 0.0)
        value += weights.persistence if n <= 1 else 0.0
        if best_contact < math.inf or value > best_score:
            best, best_score, best_contact = n, value, math.inf
    if best_contact < math.inf and unpassed:
        return unpassed[0], math.inf
    return best, best_contact


@settings(max_examples=60, deadline=None)
@given(
    yaw=st.floats(-3.2, 3.2),
    aside=st.floats(-0.5, 0.5),
    v=st.floats(-0.7, 0.7),
    w=st.floats(-1.5, 1.5),
    movers=st.lists(st.tuples(near, near, speed, speed, st.floats(0.1, 0.5)), min_size=1, max_size=8),
)
def test_no_skipped_candidate_is_better(tracked, yaw, aside, v, w, movers):
    table = np.array(movers)
    table[:, :2] += np.where(np.hypot(*table[:, :2].T) < 0.6, 1.0, 0.0)[:, None]
    places = table[:, :2] + AVOIDANCE.prediction_times[:, None, None] * table[:, 2:4]
    radii = table[:, 4].copy()
    weights = _weights(AVOIDANCE, tracked.tuning.robot_radius, ROBOT.footprint)
    tuning = tracked.tuning._replace(period=AVOIDANCE.step)
    here = (0.0, aside, yaw, v, w, 6.2, False)
    situation = (*here, TABLE, tracked.samples, tracked.obstacles, tracked.limits, tuning, weights, places, radii)
    close, distances = kernels.relevant_movers(0.0, aside, yaw, tracked.limits, tuning, weights, places, radii)
    if len(close):
        assert kernels.choose(*situation) == in_turn(situation, distances, close)
    else:
        assert kernels.choose(*situation) == (0, math.inf)


def test_the_limit_of_a_candidate_is_no_less_than_it_is_worth(tracked):
    weights = _weights(AVOIDANCE, tracked.tuning.robot_radius, ROBOT.footprint)
    tuning, rng = tracked.tuning._replace(period=AVOIDANCE.step), np.random.default_rng(0)
    steps = len(AVOIDANCE.prediction_times) - 1
    window = tracked.limits.speed * (weights.step * steps) + tuning.lookahead_max
    tight = 0
    for _ in range(40):
        v, w, yaw = rng.uniform(-0.7, 0.7), rng.uniform(-1.5, 1.5), rng.uniform(-math.pi, math.pi)
        here = (rng.uniform(-4, 4), rng.uniform(-1, 1), yaw, v, w)
        s = float(tracked.route.arc[np.argmin(np.hypot(*(tracked.route.xy - here[:2]).T))])
        common = (tracked.samples, tracked.limits, tuning, weights)
        limit = kernels.limit_worths(*here, s, TABLE, *common, weights.step * steps, window)
        for n, candidate in enumerate(TABLE):
            trail = np.empty((steps + 1, 5))
            trail[0] = here
            on_route = candidate[kernels.KIND] == kernels.FOLLOW_ROUTE
            required = kernels.least_clearance(*here[:3], on_route, False, tracked.obstacles, tuning, weights)
            path = tracked.samples, tracked.obstacles, tracked.limits, tuning
            motion = (*path, weights.step, 0, True, required, trail)
            if not kernels.follow(*here, s, False, candidate, *motion).blocked:
                worth = kernels.worth(trail[-1], s, window, tracked.samples, tuning, weights)
                assert worth <= limit[n]
                tight += limit[n] < worth + 0.3
    assert tight > 50  # the limits are worth having


def test_no_candidate_is_faster_than_it_may():
    whole = AVOIDANCE._candidates(ROBOT, AvoidanceState(), math.inf, math.inf, math.inf, True)
    speeds = [kernels.SPEED, kernels.NEXT_SPEED]
    for share in (0.0, 0.3, 0.6, 1.0):
        most = share * ROBOT.max_speed
        table = AVOIDANCE._candidates(ROBOT, AvoidanceState(), math.inf, math.inf, most, True)
        assert np.array_equal(table[:, speeds], np.maximum(whole[:, speeds], -most))
        table = AVOIDANCE._candidates(ROBOT, AvoidanceState(), math.inf, most, math.inf, True)
        assert np.array_equal(table[:, speeds], np.clip(whole[:, speeds], -most, most))
