"""Smoothed routes keep the clearance and the homotopy class, are never longer, and are optimal in the best corridor."""

import dataclasses
import itertools
import math

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from antdrive.planners import AStar, PlanResult, PlanStatus, Query, load_planner, path_cost
from antdrive.planners.anyangle.tangent import Arc, Line, shortest
from antdrive.planners.smoothing.smooth import SMOOTHINGS, pull_taut, smooth
from antdrive.worlds import (
    Disc,
    Route,
    Task,
    World,
    forest,
    point_clearance,
    polyline_clearance,
    rasterise,
)
from tests.planners.worlds_to_solve import catalogue as small_worlds

RNG = np.random.default_rng(0)  # unused by these planners
SMOOTHED = ("taut", "clearance")


# -- oracles that share no code with the smoothing


def word(xy, centres):
    """Return the homotopy class of a line among points: the crossed rays from the points, in order and reduced."""
    angle = 0.7390851  # no ray may pass through another point
    turn = np.array([[math.cos(angle), -math.sin(angle)], [math.sin(angle), math.cos(angle)]])
    line, points = xy @ turn.T, np.unique(centres @ turn.T, axis=0)
    reduced = []
    for a, b in itertools.pairwise(line):
        k = np.flatnonzero((a[0] < points[:, 0]) != (b[0] < points[:, 0]))
        t = (points[k, 0] - a[0]) / (b[0] - a[0])
        above = a[1] + t * (b[1] - a[1]) > points[k, 1]
        for j in k[above][np.argsort(t[above])]:
            if reduced and reduced[-1] == (int(j), bool(b[0] <= a[0])):
                reduced.pop()
            else:
                reduced.append((int(j), bool(b[0] > a[0])))
    return reduced


def sampled(path, count=60):
    points = []
    for piece in path.pieces:
        if isinstance(piece, Arc):
            points += [piece.at(abs(piece.sweep) * k / count) for k in range(count + 1)]
        else:
            a, b = np.array(piece.start), np.array(piece.end)
            points += list(a + np.linspace(0, 1, count + 1)[:, None] * (b - a))
    return np.array(points)


def wander(seed):
    """Draw a plan through a random world of overlapping discs: loops, spirals, dead ends."""
    rng = np.random.default_rng(seed)
    while True:
        largest = rng.choice([0.2, 0.6, 1.8])
        discs = [Disc(*rng.uniform(-0.3, 10.3, 2), rng.uniform(0.05, largest)) for _ in range(rng.integers(1, 40))]
        if rng.random() < 0.3:  # a lattice, where tangents coincide
            discs = [Disc(*at, 0.2) for at in {(round(2 * d.x) / 2, round(2 * d.y) / 2) for d in discs}]
        world = World("wander", (0, 0, 10, 10), tuple(discs))
        grid = rasterise(world, float(rng.choice([0.1, 0.25, 0.4])), float(rng.choice([0.05, 0.2, 0.3])))
        free = np.argwhere(grid.free)
        if len(free) < 5:
            continue
        stops = [tuple(map(int, cell)) for cell in rng.choice(free, size=int(rng.integers(2, 7)))]
        legs = [AStar().plan(Query(grid, a, b), rng).cells for a, b in itertools.pairwise(stops)]
        legs = list(itertools.takewhile(len, legs))
        cells = np.vstack([legs[0][:1], *(leg[1:] for leg in legs)]) if legs else np.empty((0, 2))
        if len(cells) < 2 or (cells[0] == cells[-1]).all():
            continue
        start, goal = grid.xy(cells[[0, -1]]) + rng.uniform(-0.1, 0.1, (2, 2)) * grid.cell
        if point_clearance(world, [start, goal]).min() <= 0:
            continue
        task = Task(world, (float(start[0]), float(start[1]), 0.0), (float(goal[0]), float(goal[1])))
        cost = path_cost(cells, grid.cell)
        return task, grid, PlanResult(status=PlanStatus.SOLVED, cells=cells.astype(np.int32), cost=cost)


def check(route, line, task, inflate, *, longest=math.inf):
    world = task.world
    np.testing.assert_allclose(route.xy[[0, -1]], line.xy[[0, -1]], atol=1e-9)
    assert route.length <= min(max(line.length, longest if route.kind == "clearance" else 0.0), longest) + 1e-9
    assert polyline_clearance(world, route.xy) >= min(inflate, polyline_clearance(world, line.xy)) - 1e-9
    assert word(route.xy, world.discs[:, :2]) == word(line.xy, world.discs[:, :2])
    assert len(route.curvature) == len(route.xy)


# -- by hand


def one_disc(side):
    """The radius-5 world of Han's thesis (2007), with its disc passed on one side."""
    task = Task(World("han", (-2, -2, 22, 22), (Disc(10, 10, 5),)), (0.0, 0.0, 0.0), (20.0, 20.0))
    grid = rasterise(task.world, 0.5)
    corner = (0.0, 20.0) if side > 0 else (20.0, 0.0)
    waypoints = grid.fractional([(0, 0), corner, (20, 20)])
    return task, grid, PlanResult(status=PlanStatus.SOLVED, waypoints=waypoints, cost=40.0)


@pytest.mark.parametrize("side", [1, -1])
def test_one_disc_has_its_closed_form(side):
    task, grid, plan = one_disc(side)
    route = smooth(plan, grid, task)
    to_centre = math.hypot(10, 10)
    by_hand = 2 * math.sqrt(to_centre**2 - 25) + 5 * (math.pi - 2 * math.acos(5 / to_centre))
    path = pull_taut(grid.xy(plan.line), task.world.discs, task.world.bounds, 0.0)
    assert [type(piece) for piece in path.pieces] == [Line, Arc, Line]
    assert path.length == pytest.approx(by_hand, abs=1e-9)
    assert route.length == pytest.approx(by_hand, rel=1e-4)
    assert route.kind == "taut"
    assert route.note == ""
    np.testing.assert_allclose(route.curvature[1:-2], -side / 5)
    np.testing.assert_allclose(route.curvature[[0, -2, -1]], 0.0)
    assert route.xy[len(route.xy) // 2] @ (-1, 1) * side > 0
    off = np.hypot(*(route.xy[1:-1] - 10).T) - 5
    assert off.min() >= -1e-9
    assert off.max() <= 5e-4 + 1e-9


def test_clearance_keeps_the_preferred_clearance_where_there_is_room():
    task, grid, plan = one_disc(1)
    route = smooth(plan, grid, task, kind="clearance", clearance=0.4)
    assert route.kind == "clearance"
    assert polyline_clearance(task.world, route.xy) == pytest.approx(0.4, abs=1e-9)
    assert route.length == pytest.approx(
        shortest([(10, 10, 5.4)], task.world.bounds, 0, (0, 0), (20, 20)).length, rel=1e-4
    )
    short = smooth(plan, grid, task, kind="clearance", clearance=0.4, stretch=0.01)
    taut = smooth(plan, grid, task)
    assert taut.length < short.length <= 1.01 * taut.length + 1e-3
    assert 0.1 < polyline_clearance(task.world, short.xy) < 0.4
    assert (smooth(plan, grid, task, kind="clearance", clearance=0.0).xy == taut.xy).all()


def test_clearance_takes_the_middle_of_a_gap_between_discs_and_of_one_at_a_wall():
    gap = (Disc(5, 3.7, 1.0), Disc(5, 6.5, 1.0))  # 0.8 m between them, middle at y = 5.1
    task = Task(World("gap", (0, 0, 10, 10), gap), (1.0, 2.0, 0.0), (9.0, 2.0))
    grid = rasterise(task.world, 0.25, 0.3)
    over = grid.fractional([(1, 2), (1.5, 5.1), (8.5, 5.1), (9, 2)])
    plan = PlanResult(status=PlanStatus.SOLVED, waypoints=over)
    route = smooth(plan, grid, task, kind="clearance", clearance=0.5, stretch=0.1)
    assert np.interp(5.0, *route.xy.T) == pytest.approx(5.1, abs=0.01)
    assert np.interp(5.0, *smooth(plan, grid, task).xy.T) == pytest.approx(5.0, abs=1e-3)
    task = Task(World("wall", (0, 0, 10, 10), (Disc(5, 8.0, 1.0),)), (1.0, 5.0, 0.0), (9.0, 5.0))
    plan = PlanResult(status=PlanStatus.SOLVED, waypoints=grid.fractional([(1, 5), (1.5, 9.5), (8.5, 9.5), (9, 5)]))
    route = smooth(plan, grid, task, kind="clearance", clearance=0.5, stretch=0.2)
    assert np.interp(5.0, *route.xy.T) == pytest.approx(9.5, abs=0.01)


def test_a_string_around_a_disc_more_than_once_keeps_its_windings():
    angles = np.linspace(0, 2 * math.tau + math.pi / 2, 60)
    loops = np.stack((5 + 3 * np.cos(angles), 5 + 3 * np.sin(angles)), axis=1)
    path = pull_taut(loops, [(5, 5, 1)], (0, 0, 10, 10), 0.5)
    (arc,) = (piece for piece in path.pieces if isinstance(piece, Arc))
    by_hand = 2 * math.tau + math.pi / 2 - 2 * math.acos(1.5 / 3)
    assert arc.sweep == pytest.approx(by_hand, abs=1e-9)
    assert path.length == pytest.approx(1.5 * by_hand + 2 * math.sqrt(9 - 2.25), abs=1e-9)
    unwound = pull_taut(np.vstack([loops, loops[-2::-1] + 1e-3]), [(5, 5, 1)], (0, 0, 10, 10), 0.5)
    assert unwound.length == pytest.approx(math.hypot(1e-3, 1e-3))


# -- properties


@settings(max_examples=60)
@given(st.integers(0, 10**6))
def test_any_plan_in_any_forest_is_smoothed(seed):
    task, grid, plan = wander(seed)
    world, inflate = task.world, grid.inflate
    line = smooth(plan, grid, task, kind="none")
    for kind in SMOOTHED:
        route = smooth(plan, grid, task, kind=kind)
        check(route, line, task, inflate, longest=max(line.length, plan.cost))
        assert route.kind == kind
        redone = dataclasses.replace(plan, waypoints=grid.fractional(route.xy))
        assert smooth(redone, grid, task, kind=kind).length == pytest.approx(route.length, abs=1e-7)
    if polyline_clearance(world, line.xy) < inflate - 1e-9:
        return
    there, back = (pull_taut(xy, world.discs, world.bounds, inflate) for xy in (line.xy, line.xy[::-1]))
    optimum = shortest(world.discs, world.bounds, inflate, tuple(line.xy[0]), tuple(line.xy[-1]))
    assert point_clearance(world, sampled(there)).min() >= inflate - 1e-9
    for before, after in itertools.pairwise(there.pieces):
        assert math.dist(before.end, after.start) < 1e-9
    assert back.length == pytest.approx(there.length, abs=1e-7)
    assert there.length >= optimum.length - 1e-7
    best = pull_taut(optimum.polyline(1e-3, world.discs, world.bounds, inflate), world.discs, world.bounds, inflate)
    assert best.length == pytest.approx(optimum.length, abs=1e-7)
    if word(sampled(there), world.discs[:, :2]) == word(sampled(optimum), world.discs[:, :2]):
        assert there.length == pytest.approx(optimum.length, abs=1e-7)


@settings(max_examples=40)
@given(st.integers(0, 10**6), st.floats(0, math.tau), st.booleans(), st.sampled_from(SMOOTHED))
def test_a_turned_or_mirrored_world_has_a_turned_or_mirrored_route(seed, angle, mirror, kind):
    task, grid, plan = wander(seed)
    flip = -1.0 if mirror else 1.0
    turn = np.array([[math.cos(angle), -flip * math.sin(angle)], [math.sin(angle), flip * math.cos(angle)]])

    def smoothed(matrix):
        discs = tuple(Disc(*map(float, matrix @ (d.x, d.y)), d.radius) for d in task.world.obstacles)
        ends = [matrix @ np.array(end) for end in (task.start[:2], task.goal)]
        far = Task(World("far", (-99, -99, 99, 99), discs), (*ends[0], 0.0), tuple(ends[1]))  # walls do not turn
        moved = dataclasses.replace(plan, waypoints=grid.fractional(grid.xy(plan.cells) @ matrix.T))
        return smooth(moved, grid, far, kind=kind)

    here, there = smoothed(np.eye(2)), smoothed(turn)
    assert there.length == pytest.approx(here.length, abs=1e-6)
    s = np.linspace(0, 1, 50)
    ours, theirs = (np.stack([np.interp(s * r.length, r.arc, axis) for axis in r.xy.T], axis=1) for r in (here, there))
    np.testing.assert_allclose(theirs, ours @ turn.T, atol=1e-3)


PLANNERS = ("astar", "as", "mmas-dstar", "ga-han", "tangent")  # searches, ants, fields, waypoints, exact lines


@settings(max_examples=40)
@given(
    st.integers(0, 10**6), st.sampled_from([0.0, 0.03]), st.sampled_from([0.2, 0.5]), st.sampled_from([0.0, 0.03, 0.4])
)
def test_discs_that_are_left_out_change_no_bit(seed, margin, clearance, stretch):
    from antdrive.planners.smoothing import _kernels_smooth as kernels

    task, more = forest(np.random.default_rng(seed)), np.random.default_rng(seed).uniform(25, 40, (100, 2)).tolist()
    far = tuple(Disc(x, y, 0.2) for x, y in more)
    task = dataclasses.replace(task, world=World("far", (0.0, 0.0, 41.0, 41.0), (*task.world.obstacles, *far)))
    grid = rasterise(task.world, 0.1, 0.2 + margin)
    plan = AStar().plan(Query.between(grid, task), RNG)
    assume(plan.solved)
    counts = []

    def routes():
        for kind in SMOOTHINGS:
            made = smooth(plan, grid, task, kind=kind, clearance=clearance, stretch=stretch)
            yield made.xy.tobytes(), None if made.curvature is None else made.curvature.tobytes(), made.kind, made.note

    usual, some = list(routes()), kernels.discs_about
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(kernels, "discs_about", lambda *given: counts.append(len(some(*given))) or given[-1])
        assert list(routes()) == usual
    assert counts
    assert all(count < len(task.world.discs) for count in counts)


@pytest.mark.parametrize("name", PLANNERS)
def test_every_planners_plans_are_smoothed(name):
    solved = 0
    for query in small_worlds().values():
        plan = load_planner(name).plan(query, np.random.default_rng(1))
        if not plan.solved:
            continue
        solved += 1
        line = smooth(plan, query.grid, query.task, kind="none")
        longest = max(line.length, plan.cost if math.isfinite(plan.cost) else 0.0)
        taut, wide = (smooth(plan, query.grid, query.task, kind=kind) for kind in SMOOTHED)
        check(taut, line, query.task, query.grid.inflate)
        check(wide, line, query.task, query.grid.inflate, longest=longest)
        assert (taut.kind, taut.note, wide.note) == ("taut", "", "")
        assert taut.length <= wide.length + 1e-9
        if name == "tangent":
            assert taut.length == pytest.approx(plan.length, rel=5e-4)
    assert solved


# -- lines that cannot be smoothed, and misuse


def test_a_start_with_too_little_room_is_left_as_planned():
    task = Task(World("w", (0, 0, 10, 10), (Disc(2, 2, 0.5), Disc(5, 5, 1.0))), (2.6, 2.0, 0.0), (8.0, 8.0))
    grid = rasterise(task.world, 0.5, 0.4)
    query = Query.between(grid, task)
    plan = AStar().plan(query, RNG)
    route = smooth(plan, grid, task)
    np.testing.assert_allclose(route.xy[:2], [task.start[:2], grid.xy([query.start])[0]])
    assert polyline_clearance(task.world, route.xy[1:]) >= 0.4 - 1e-9
    assert (route.kind, route.note) == ("taut", "")
    assert route.length == pytest.approx(load_planner("tangent").plan(query, RNG).length, rel=1e-3)


def test_a_route_to_a_goal_with_too_little_room_ends_where_the_plan_ends():
    task = Task(World("w", (0, 0, 10, 10), (Disc(8, 8, 0.5),)), (2.0, 2.0, 0.0), (7.4, 7.8), goal_tolerance=0.7)
    grid = rasterise(task.world, 0.5, 0.3)
    query = Query.between(grid, task)
    route = smooth(AStar().plan(query, RNG), grid, task)
    np.testing.assert_allclose(route.xy[-1], grid.xy([query.goal])[0])
    assert polyline_clearance(task.world, route.xy) >= 0.3 - 1e-9


def test_a_plan_that_comes_too_close_is_kept_there_with_a_note():
    task = Task(World("w", (0, 0, 10, 10), (Disc(5, 5, 1.0),)), (1.0, 5.0, 0.0), (9.0, 5.0))
    grid = rasterise(task.world, 0.5, 0.3)
    over = [(1.0, 5.0), (1.0, 8.0), (4.0, 6.2), (6.0, 6.2), (9.0, 8.0), (9.0, 5.0)]
    plan = PlanResult(status=PlanStatus.SOLVED, waypoints=grid.fractional(over))
    for kind in SMOOTHED:
        route = smooth(plan, grid, task, kind=kind)
        assert "closer than the clearance" in route.note
        assert all((np.abs(route.xy - point) < 1e-9).all(axis=1).any() for point in over[2:4])
        assert route.length < smooth(plan, grid, task, kind="none").length
    assert pull_taut(over, task.world.discs, task.world.bounds, 0.3) is None


def test_spare_length_is_spent_only_once():
    """A line of two clear parts around one below the clearance, with 1 cm of spare length in total."""
    posts = ((5.0, -0.5, 0.5), (5.0, 2.6, 0.5), (10.0, 0.45, 0.3), (15.0, -0.5, 0.5), (15.0, 2.6, 0.5))
    task = Task(
        World("w", (0.0, -3.0, 20.0, 3.0), tuple(Disc(*post) for post in posts)), (1.0, 0.25, 0.0), (19.0, 0.25)
    )
    grid = rasterise(task.world, 0.5, 0.2)
    xy = np.array(
        [(1, 0.25), (4.2, 0.25), (5.8, 0.25), (9, 0), (10, 0), (11, 0), (14.2, 0.25), (15.8, 0.25), (19, 0.25)]
    )
    waypoints = (xy - grid.origin)[:, ::-1] / grid.cell
    cost = float(np.hypot(*np.diff(xy, axis=0).T).sum()) + 0.01
    route = smooth(PlanResult(status=PlanStatus.SOLVED, waypoints=waypoints, cost=cost), grid, task, kind="clearance")
    assert route.kind == "clearance"
    assert route.length <= cost + 1e-9


def test_none_is_the_plans_own_line_and_misuse_is_refused():
    task, grid, plan = one_disc(1)
    route = smooth(plan, grid, task, kind="none")
    np.testing.assert_array_equal(route.xy, grid.xy(plan.line))
    assert (route.kind, route.curvature) == ("none", None)
    with pytest.raises(ValueError, match="kind: unknown smoothing 'tight'; choose from none, taut, clearance"):
        smooth(plan, grid, task, kind="tight")
    for invalid in ({"clearance": -0.1}, {"stretch": math.nan}, {"bulge": 0.0}):
        with pytest.raises(ValueError, match=next(iter(invalid))):
            smooth(plan, grid, task, **invalid)
    with pytest.raises(ValueError, match="no path"):
        smooth(PlanResult(status=PlanStatus.NO_PATH), grid, task)
    assert SMOOTHINGS == ("none", "taut", "clearance")


def test_a_routes_curvature_follows_its_points():
    route = Route([[0, 0], [0, 0], [1, 0], [1, 0], [2, 0]], [1.0, 2.0, 3.0, 4.0, 5.0])
    np.testing.assert_allclose(route.xy, [[0, 0], [1, 0], [2, 0]])
    np.testing.assert_allclose(route.curvature, [2.0, 4.0, 5.0])
    assert not route.curvature.flags.writeable
    for invalid in ([1.0], [1.0, math.inf]):
        with pytest.raises(ValueError, match="curvature: must be 2 finite numbers"):
            Route([[0, 0], [1, 0]], invalid)


def test_a_forest_of_400_discs_is_smoothed():
    task = forest(
        np.random.default_rng(1), size=40, count=400, radius=(0.3, 0.7), clearance=1, spacing=0.1, robot_radius=0.25
    )
    grid = rasterise(task.world, 0.25, 0.3)
    plan = AStar().plan(Query.between(grid, task), RNG)
    line = smooth(plan, grid, task, kind="none")
    for kind in SMOOTHED:
        route = smooth(plan, grid, task, kind=kind)
        check(route, line, task, grid.inflate, longest=plan.cost)
        assert route.kind == kind
