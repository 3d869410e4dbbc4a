"""Safe-interval planning against an independent oracle in discrete time."""

import dataclasses
import functools
import itertools
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from antdrive.planners import PlanStatus, Query, TimedPlan, load_planner, plan_in_time, validate_plan
from antdrive.planners.graph.sipp import TOLERANCE, _legs, _samples
from antdrive.worlds import Grid, MoverMotion
from tests.planners.worlds_to_solve import optimum, random_query

SPEED, CELL, INFLATE = 0.5, 0.5, 0.2


@dataclasses.dataclass(frozen=True)
class Keyframed:
    """A mover that drives straight between keyframes, back and forth, or jumps from the last to the first."""

    radius: float
    frames: np.ndarray  # (K, 3) t, x, y
    again: bool = True  # there and back, else from the start

    def at(self, t):
        last = self.frames[-1, 0]
        t = np.asarray(t) % (2 * last if self.again else last)
        t = np.minimum(t, 2 * last - t) if self.again else t
        return np.stack([np.interp(t, self.frames[:, 0], self.frames[:, k]) for k in (1, 2)], axis=-1)


@dataclasses.dataclass(frozen=True)
class Circling:
    radius: float
    centre: tuple[float, float]
    far: float
    rate: float  # [rad/s]

    def at(self, t):
        angle = self.rate * np.asarray(t)
        return np.asarray(self.centre) + self.far * np.stack([np.cos(angle), np.sin(angle)], axis=-1)


@dataclasses.dataclass(frozen=True)
class Passing:
    """A mover at constant velocity."""

    radius: float
    place: tuple[float, float]
    velocity: tuple[float, float]

    def at(self, t):
        return np.asarray(self.place) + np.asarray(t)[:, np.newaxis] * np.asarray(self.velocity)


def ground(free):
    return dataclasses.replace(Grid.from_free(free, cell=CELL), inflate=INFLATE)


def some_mover(rng, side):
    radius = float(rng.uniform(0.05, 0.4))
    if rng.random() < 0.3:
        far = float(rng.uniform(0.3, side / 2))
        return Circling(radius, tuple(rng.uniform(0, side, 2)), far, float(rng.uniform(0.2, 0.6) / far))
    count = int(rng.integers(2, 5))
    t = np.concatenate([[0.0], np.cumsum(rng.uniform(2.0, 6.0, count - 1))])
    return Keyframed(radius, np.column_stack([t, rng.uniform(0, side, (count, 2))]), bool(rng.random() < 0.8))


# The oracle tabulates the reachable states at each tick: cells, on grids with turns also the heading.

TICK = 0.05
FINE = 2  # samples per tick
MOVES = [(dr, dc) for dr, dc in itertools.product((-1, 0, 1), repeat=2) if (dr, dc) != (0, 0)]


def first_tick(ways, starts, goals, movers, horizon, *, inflate=INFLATE, slack, hurry, stay=False):
    """Return the earliest arrival of a robot that acts only on ticks [s]; inf: not within the horizon.

    `ways` has for each state its place and its ways on: next state, next place, duration [s]. The robot may also wait. `slack`
    is added to the clearance. Durations are rounded up to ticks; with `hurry`, also down.
    """
    ticks = round(horizon / TICK)
    t = np.arange(ticks * FINE + 1) * TICK / FINE
    where = [(m.at(t), m.radius + inflate + 2 * TOLERANCE + slack) for m in movers]

    @functools.cache
    def clear(a, b, n, exact):
        """Return for each tick whether a robot that drives from there straight from a to b keeps the clearance."""
        part = np.minimum(1.0, np.arange(n * FINE + 1) * TICK / FINE / exact)[:, np.newaxis]
        path = np.array(a) + part * (np.array(b) - np.array(a))
        samples = FINE * np.arange(ticks - n + 1)[:, np.newaxis] + np.arange(len(path))
        gaps = [np.hypot(*np.moveaxis(xy[samples] - path, -1, 0)) - reach for xy, reach in where]
        return np.asarray((np.array(gaps) >= 0).all(axis=(0, 2)))

    options = {}
    for state, (at, onward) in ways.items():
        options[state] = [(state, 1, clear(at, at, 1, TICK))]
        for to, there, exact in onward:
            for n in {math.ceil(exact / TICK - 1e-9), *([math.floor(exact / TICK + 1e-9)] if hurry else [])}:
                options[state].append((to, n, clear(at, there, n, exact)))
    can = {state: np.zeros(ticks + 1, dtype=np.bool_) for state in ways}
    for state in starts:
        can[state][0] = bool(clear(ways[state][0], ways[state][0], 0, TICK)[0])
    for tick in range(ticks):
        for state in [state for state, when in can.items() if when[tick]]:
            for to, n, ok in options[state]:
                if tick + n <= ticks and ok[tick]:
                    can[to][tick + n] = True
    reached = np.any([can[state] for state in goals], axis=0)
    if stay:
        waiting = options[goals[0]][0][2]
        reached &= np.append(np.logical_and.accumulate(waiting[::-1])[::-1], True)
    return float(np.argmax(reached)) * TICK if reached.any() else math.inf


def on_discs(query):
    """Return the ways of a disc between the cells of a query, its start and its goal."""
    free = query.grid.free
    ways = {}
    for r, c in np.argwhere(free).tolist():
        onward = []
        for dr, dc in MOVES:
            q, d = r + dr, c + dc
            if 0 <= q < free.shape[0] and 0 <= d < free.shape[1] and free[q, d] and free[r, d] and free[q, c]:
                onward.append(((q, d), (CELL * d, CELL * q), CELL * math.hypot(dr, dc) / SPEED))
        ways[r, c] = (CELL * c, CELL * r), onward
    return ways, [query.start], [query.goal]


def small_world(seed):
    rng = np.random.default_rng([17, seed])
    free = rng.random((5, 5)) >= 0.2
    free[0, 0] = free[4, 4] = True
    movers = [some_mover(rng, 4 * CELL) for _ in range(int(rng.integers(1, 4)))]
    return Query(ground(free), (0, 0), (4, 4)), movers


HORIZON = 12.0
FEW, MANY = range(3, 7), pytest.param(range(14, 60), marks=pytest.mark.slow)
ABOVE, BELOW = 0.03, -2.0 * TICK  # m: motion of robot and mover between two samples, and per tick


@pytest.fixture(scope="module")
def small_plans():
    worlds = [small_world(seed) for seed in range(60)]
    return [(q, m, plan_in_time(q, m, speed=SPEED, horizon=HORIZON)) for q, m in worlds]


@pytest.mark.parametrize("stay", [False, True], ids=["arrive", "stay"])
@pytest.mark.parametrize("seeds", [FEW, MANY], ids=["few", "many"])
def test_no_path_arrives_sooner_and_none_is_missed(seeds, stay):
    gaps, without = [], 0
    for query, movers in map(small_world, seeds):
        plan = plan_in_time(query, movers, speed=SPEED, horizon=HORIZON, stay=stay)
        # A robot on ticks with more clearance bounds the free robot from above ...
        above = first_tick(*on_discs(query), movers, HORIZON, slack=ABOVE, hurry=False, stay=stay)
        # ... and one with less clearance bounds it from below.
        below = first_tick(*on_discs(query), movers, HORIZON, slack=BELOW, hurry=True, stay=stay)
        assert below - TICK - 1e-9 <= plan.duration <= above + 1e-9
        without += math.isinf(below)
        if math.isfinite(above):
            gaps.append(above - below)
    # The oracle is tight: bounds mostly differ by rounding only, and some worlds have no path.
    assert np.median(gaps) < 1.0
    assert len(gaps) > len(seeds) / 4
    assert without > 0


def test_the_distance_is_kept_at_every_instant(small_plans):
    careless = 0
    for query, movers, plan in small_plans:
        if plan.solved:
            assert plan.clearance(movers, step=0.002) >= INFLATE
            blind = plan_in_time(query, [], speed=SPEED)
            careless += blind.clearance(movers, step=0.002) < INFLATE
    assert careless > 10  # paths that ignore movers come too close


def test_a_timed_plan_moves_at_its_speed_along_allowed_moves(small_plans):
    waits = 0
    for query, _, plan in small_plans:
        if not plan.solved:
            assert plan.status is PlanStatus.NO_PATH
            assert plan.reason
            assert math.isinf(plan.duration)
            continue
        assert validate_plan(query, plan) == ""
        far = CELL * np.hypot(*np.diff(plan.cells, axis=0).T)
        np.testing.assert_allclose(plan.arrive[1:] - plan.leave[:-1], far / SPEED, atol=1e-9)
        assert plan.arrive[0] == 0.0
        assert plan.duration == pytest.approx(plan.cost / SPEED + plan.waited)
        np.testing.assert_allclose(plan.at(plan.arrive), plan.xy)
        np.testing.assert_allclose(plan.at(plan.leave), plan.xy)
        waits += plan.waited > 0
    assert waits > 5


def corridor(length):
    return Query(ground(np.ones((1, length))), (0, 0), (0, length - 1))


def test_the_robot_waits_exactly_until_a_mover_has_crossed():
    """A mover crosses the middle of a corridor; the robot arrives there when the mover's disc leaves the line."""
    query = corridor(3)  # x from 0 to 1 m
    mover = Passing(0.25, (0.5, -0.4), (0.0, 0.1))
    reach = 0.25 + INFLATE + 2 * TOLERANCE
    plan = plan_in_time(query, [mover], speed=SPEED)
    # At its closest the robot, from (0, 0) towards +x, is at reach of the mover that rises: the least departure t of
    # min over s of |(0.5 s - 0.5, 0.4 - 0.1 (t + s))| = reach, once the mover is above the line.
    s = np.linspace(0, 2, 4001)
    times = np.arange(0, 12, 0.002)
    least = [float(np.hypot(0.5 * s - 0.5, 0.1 * (t + s) - 0.4).min()) for t in times]
    leaves = times[np.flatnonzero(np.array(least) < reach)[-1] + 1]
    assert leaves > 5
    assert plan.leave[0] == pytest.approx(leaves, abs=4e-3)
    assert plan.duration == pytest.approx(leaves + 2.0, abs=4e-3)


def test_a_robot_backs_into_a_bay_to_let_a_mover_pass():
    free = np.zeros((2, 9))
    free[0] = 1
    free[1, 3] = 1  # the bay
    query = Query(ground(free), (0, 2), (0, 8))
    oncoming = Passing(0.1, (4.5, 0.0), (-0.25, 0.0))
    plan = plan_in_time(query, [oncoming], speed=SPEED, horizon=60)
    assert [1, 3] in plan.cells.tolist()
    assert plan.waited > 0
    assert plan.clearance([oncoming]) >= INFLATE
    shut = plan_in_time(Query(ground(free[:1]), (0, 2), (0, 8)), [oncoming], speed=SPEED, horizon=60)
    assert shut.status is PlanStatus.NO_PATH
    assert "within 60 s" in shut.reason


def test_without_movers_it_is_the_shortest_path():
    rng = np.random.default_rng(3)
    for _ in range(60):
        query = random_query(rng)
        plan = plan_in_time(query, [], speed=2.0)
        assert plan.cost == pytest.approx(optimum(query))
        assert plan.duration == pytest.approx(optimum(query) / 2.0)


def test_the_planner_of_the_registry_plans_among_the_motions_of_the_query():
    mover = Passing(0.25, (0.5, -0.4), (0.0, 0.1))
    query = dataclasses.replace(corridor(3), motions=(mover,))
    plan = load_planner("sipp", speed=SPEED).plan(query, np.random.default_rng(0))
    assert isinstance(plan, TimedPlan)
    assert isinstance(mover, MoverMotion)
    np.testing.assert_array_equal(plan.leave, plan_in_time(query, [mover], speed=SPEED).leave)
    assert plan.waited > 5
    assert plan.options["horizon"] == 120.0


def test_plans_begin_at_their_start_time():
    mover = Keyframed(0.2, np.array([[0, 0.0, 1.0], [4, 2.0, 1.0]]))
    query = Query(ground(np.ones((5, 5))), (0, 2), (4, 2))
    for start in (0.0, 3.3, 8.0, 11.3):
        plan = plan_in_time(query, [mover], speed=SPEED, start_time=start)
        assert plan.arrive[0] == start
        assert plan.clearance([mover]) >= INFLATE
    same = [plan_in_time(query, [mover], speed=SPEED, start_time=s).duration for s in (3.3, 11.3)]
    assert same[0] == pytest.approx(same[1])


def test_a_mover_on_the_start_is_named():
    plan = plan_in_time(corridor(3), [Passing(0.3, (0.1, 0.0), (0.0, 0.0))], speed=SPEED)
    assert plan.status is PlanStatus.NO_PATH
    assert "too close to the start" in plan.reason
    with pytest.raises(ValueError, match="no path"):
        plan.at([0.0])


def test_a_mover_that_jumps_blocks_nothing_in_between():
    """A mover that restarts at the other end is never in between."""
    loop = Keyframed(0.1, np.array([[0, 0.0, 0.0], [3.7, 0.0, 9.0]]), again=False)
    t, xy, jump = _samples(loop, 0.0, 10.0)
    assert jump.sum() == 2
    np.testing.assert_allclose(t[:-1][jump], [3.7, 7.4], atol=2e-6)
    legs = _legs(loop, 0.0, 10.0, INFLATE)
    assert len(legs) == 3
    np.testing.assert_allclose(legs[:, 5], 9 / 3.7, rtol=1e-3)
    assert xy[0].tolist() == [0.0, 0.0]


@settings(max_examples=30, deadline=None)
@given(seed=st.integers(0, 2**32))
def test_legs_stay_within_the_tolerance_of_the_motion(seed):
    rng = np.random.default_rng(seed)
    mover = some_mover(rng, 5.0)
    legs = _legs(mover, 0.0, 20.0, INFLATE)
    assert len(legs) < (30 if isinstance(mover, Keyframed) else 420)
    t = rng.uniform(0, 20, 3000)
    n = np.searchsorted(legs[:, 1], t)
    n = np.minimum(n, len(legs) - 1)
    inside = (legs[n, 0] <= t) & (t <= legs[n, 1])
    assert inside.mean() > 0.999  # all but jumps
    expected = legs[n, 2:4] + (t - legs[n, 0])[:, np.newaxis] * legs[n, 4:6]
    off = np.hypot(*(expected - mover.at(t)).T)[inside]
    assert off.max() <= 2 * TOLERANCE
    assert (legs[:, 6] >= mover.radius + INFLATE + 2 * TOLERANCE - 1e-12).all()


@settings(max_examples=60, deadline=None)
@given(seed=st.integers(0, 2**32))
def test_conflicts_are_those_found_by_sampling(seed):
    from antdrive.planners.graph._kernels_sipp import conflict

    rng = np.random.default_rng(seed)
    begins, span, lasts = rng.uniform(0, 5), rng.uniform(0.05, 3), rng.uniform(0.2, 1.5)
    place, velocity, u = rng.uniform(-1, 1, 2), rng.normal(0, 0.7, 2), rng.normal(0, 0.7, 2)
    if rng.random() < 0.3:
        velocity = u * rng.choice([-1.0, 0.0, 0.5, 1.0])  # alongside each other, or standing
    reach = rng.uniform(0.05, 0.8)
    lo, hi = conflict(np.array([begins, begins + span, *place, *velocity, reach]), 0.0, 0.0, *u, lasts)
    w, s = np.meshgrid(np.linspace(0, span, 241), np.linspace(0, lasts, 241))
    gap = np.hypot(*(place[k] + velocity[k] * w - u[k] * s for k in (0, 1)))
    hits = (begins + w - s)[gap < reach]
    step = span / 240 + lasts / 240
    if not len(hits):
        # Sampling may miss an interval shorter than what both move in one step.
        assert lo > hi or gap.min() < reach + step * (np.hypot(*velocity) + np.hypot(*u))
        return
    assert lo <= hits.min() + 1e-9
    assert hi >= hits.max() - 1e-9
    near = (begins + w - s)[gap < reach + step * (np.hypot(*velocity) + np.hypot(*u))]
    assert lo >= near.min() - step - 1e-9
    assert hi <= near.max() + step + 1e-9
