"""The widest passage against a flood, the exact shortest paths and closed forms, in small and very large worlds."""

import heapq
import math

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from antdrive.planners.anyangle.tangent import shortest
from antdrive.worlds import Disc, Task, World, _kernels_passage, point_clearance
from antdrive.worlds.passage import Passage, feasible, widest_passage

STEP = 0.04  # of the field [m]


def flooded(task):
    """Return the widest disc from start to goal over a field of points, by a flood in the order of clearance."""
    xmin, ymin, xmax, ymax = task.world.bounds
    x, y = np.arange(xmin, xmax + STEP / 2, STEP), np.arange(ymin, ymax + STEP / 2, STEP)
    px, py = np.meshgrid(x, y)
    room = np.minimum.reduce([px - xmin, xmax - px, py - ymin, ymax - py])
    for disc in task.world.obstacles:
        room = np.minimum(room, np.hypot(px - disc.x, py - disc.y) - disc.radius)
    start, goal = (
        (round((b - ymin) / STEP), round((a - xmin) / STEP)) for a, b in (task.start[:2], task.goal)
    )  # fmt: skip
    best = {start: float(room[start])}
    queue = [(-best[start], start)]
    while queue:
        width, at = heapq.heappop(queue)
        if at == goal:
            return -width
        for dr in (-1, 0, 1):
            for dc in (-1, 0, 1):
                near = at[0] + dr, at[1] + dc
                if 0 <= near[0] < room.shape[0] and 0 <= near[1] < room.shape[1]:
                    wide = min(-width, float(room[near]))
                    if wide > best.get(near, -math.inf):
                        best[near] = wide
                        heapq.heappush(queue, (-wide, near))
    return -math.inf


def test_the_widest_disc_is_that_of_a_flood():
    rng, through_gaps, solved = np.random.default_rng(4), 0, 0
    for _ in range(12):
        discs = tuple(Disc(*rng.uniform((0.4, 0.0), (3.6, 3.0)).tolist(), rng.uniform(0.1, 0.35)) for _ in range(18))
        ends = (0.2, 1.5), (3.8, 1.5)
        discs = tuple(d for d in discs if all(math.dist((d.x, d.y), end) > d.radius + 0.1 for end in ends))
        task = Task(World("random", (0.0, 0.0, 4.0, 3.0), discs), (*ends[0], 0.0), ends[1])
        passage, flood = widest_passage(task), flooded(task)
        if passage is None:
            assert flood <= STEP
            continue
        solved += 1
        assert passage.radius == pytest.approx(flood, abs=STEP)
        assert point_clearance(task.world, [passage.at])[0] == pytest.approx(passage.radius, abs=1e-9)
        through_gaps += bool(passage.between)
    assert solved > 7
    assert through_gaps > 3


def test_the_bottleneck_is_the_middle_of_the_gap():
    wall = tuple(Disc(2.0, y, 0.25) for y in (0.25, 0.75, 1.25, 2.25, 2.75))  # a gap of 0.5 m around (2, 1.75)
    task = Task(World("gate", (0.0, 0.0, 4.0, 3.0), wall), (0.6, 0.6, 0.0), (3.4, 0.6))
    passage = widest_passage(task)
    assert passage == Passage(pytest.approx(0.25), pytest.approx((2.0, 1.75)), (2, 3))
    beside_a_wall = Task(World("side", (0.0, 0.0, 4.0, 3.0), (Disc(2.0, 1.2, 1.1),)), (0.6, 0.6, 0.0), (3.4, 0.6))
    assert widest_passage(beside_a_wall) == Passage(pytest.approx(0.35), pytest.approx((2.0, 2.65)), (0, 4))


def test_worlds_without_a_bottleneck():
    room = World("room", (0.0, 0.0, 4.0, 3.0))
    assert widest_passage(Task(room, (0.5, 1.5, 0.0), (3.7, 1.5))) == Passage(
        pytest.approx(0.3), (3.7, 1.5), (), "goal"
    )
    closed = World("closed", (0.0, 0.0, 4.0, 3.0), tuple(Disc(2.0, y, 0.3) for y in np.arange(0.0, 3.1, 0.5)))
    assert widest_passage(Task(closed, (0.6, 0.6, 0.0), (3.4, 0.6))) is None


@settings(max_examples=25, deadline=None)
@given(
    st.lists(st.tuples(st.integers(-2, 42), st.integers(-2, 32), st.integers(1, 9)), max_size=30),
    st.tuples(st.integers(1, 39), st.integers(1, 29)),
    st.tuples(st.integers(1, 39), st.integers(1, 29)),
)
def test_the_shortest_path_exists_for_every_narrower_disc_and_for_no_wider_one(discs, start, goal):
    """On a lattice many gaps are equal, and discs lie across walls and each other."""
    world = World("lattice", (0.0, 0.0, 4.0, 3.0), tuple(Disc(x / 10, y / 10, r / 15) for x, y, r in discs))
    ends = [(x / 10 + 0.003, y / 10 - 0.004) for x, y in (start, goal)]
    assume(start != goal and point_clearance(world, ends).min() > 0.001)
    task = Task(world, (*ends[0], 0.0), ends[1])
    passage = widest_passage(task)
    radius = passage.radius if passage else 0.0
    for clearance in (radius - 1e-6, radius + 1e-6, 0.05, 0.2):
        if clearance > 0:
            path = shortest(world.discs, world.bounds, clearance, *ends)
            assert feasible(task, clearance) == (path is not None) == (clearance < radius)
    if passage:
        assert point_clearance(world, [passage.at])[0] == pytest.approx(radius, abs=1e-9)


def test_the_bottleneck_of_ten_thousand_cylinders_is_the_door_and_not_a_corridor():
    """Rooms and corridors of 40 x 25 m: a corridor of 1.2 m leads 31 m to the only door, of 0.9 m."""
    pitch, rows = 0.04, [(x, y) for y in (8.0, 9.3) for x in np.arange(0.02, 40, 0.04).tolist()]
    rows += [(35.0, y) for y in np.arange(9.34, 25, pitch).tolist() if not 17.0 < y < 18.0]
    field = np.argwhere(np.ones((80, 100))) * (0.3, 0.05) + (1.0, 20.0)  # columns 0.3 m apart: no way through
    rows += [(x, y) for x, y in field.tolist() if y < 24.9]
    opening = [(x, y) for x, y in rows if not (y == 9.3 and 36.0 < x < 38.0)]
    world = World("office", (0.0, 0.0, 40.0, 25.0), tuple(Disc(x, y, 0.05) for x, y in opening))
    assert len(world.obstacles) > 9900
    passage = widest_passage(Task(world, (1.0, 8.65, 0.0), (30.0, 15.0)))
    low, high = (np.array([y for x, y in opening if x == 35.0 and side(y, 17.5)]) for side in (np.less, np.greater))
    assert passage.radius == pytest.approx((high.min() - low.max() - 0.1) / 2)
    assert passage.at == pytest.approx((35.0, (high.min() + low.max()) / 2))
    assert {opening[k] for k in passage.between} == {(35.0, low.max()), (35.0, high.min())}


def test_an_end_with_little_room_counts_by_the_roomiest_place_within_reach():
    """In a corner the roomiest place is away from both walls; behind a row of cylinders no straight line leads to one."""
    room = World("room", (0.0, 0.0, 4.0, 3.0))
    task = Task(room, (0.1, 0.1, 0.0), (3.9, 2.9))
    reach = 0.4 / math.sqrt(2) + 0.1
    assert widest_passage(task).radius == pytest.approx(0.1)
    corner = widest_passage(task, (0.4, 0.4))
    assert (corner.radius, corner.end) == (pytest.approx(reach, abs=1e-4), "start")
    assert feasible(task, reach - 1e-3, (0.4, 0.4))
    assert not feasible(task, reach + 1e-3, (0.4, 0.4))
    row = tuple(Disc(x, 2.6, 0.05) for x in np.arange(0.0, 4.1, 0.1).tolist())
    behind = Task(World("row", room.bounds, row), (0.6, 0.6, 0.0), (2.0, 2.8))
    assert widest_passage(behind, (0.4, 0.4)) is None


def test_gaps_are_listed_again_only_for_a_wider_disc(monkeypatch):
    """Start and goal have room for several positions each."""
    asked, gaps = [], _kernels_passage.gaps
    monkeypatch.setattr(_kernels_passage, "gaps", lambda *given: asked.append(given[-1]) or gaps(*given))
    wall = tuple(Disc(3.0, y, 0.2) for y in np.arange(0.0, 4.01, 0.5).tolist())
    task = Task(World("wall", (0.0, 0.0, 6.0, 4.0), (*wall, Disc(0.7, 0.3, 0.1))), (0.5, 0.5, 0.0), (5.6, 3.6))
    assert widest_passage(task, (0.3, 0.3)).radius == pytest.approx(0.05)
    assert asked == sorted(set(asked))
    asked.clear()
    assert not feasible(task, 0.1, (0.3, 0.3))
    assert len(asked) == 1
