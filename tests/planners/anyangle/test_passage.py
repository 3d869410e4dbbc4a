"""The widest disc that passes, against a flood over a fine field of distances that shares no code with it."""

from __future__ import annotations

import heapq
import math

import numpy as np
import pytest

from antdrive.planners.anyangle.passage import Passage, widest_passage
from antdrive.worlds import Disc, Task, World, point_clearance

STEP = 0.03  # of the field [m]


def flooded(task: Task) -> float:
    """The widest disc that gets from the start to the goal over a field of points, by a flood from the roomiest on."""
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


def test_the_widest_disc_is_that_of_a_flood() -> None:
    rng, through_gaps, found = np.random.default_rng(4), 0, 0
    for _ in range(25):
        discs = tuple(Disc(*rng.uniform((0.4, 0.0), (3.6, 3.0)).tolist(), rng.uniform(0.1, 0.35)) for _ in range(18))
        ends = (0.2, 1.5), (3.8, 1.5)
        discs = tuple(d for d in discs if all(math.dist((d.x, d.y), end) > d.radius + 0.1 for end in ends))
        task = Task(World("random", (0.0, 0.0, 4.0, 3.0), discs), (*ends[0], 0.0), ends[1])
        passage, flood = widest_passage(task, 10.0), flooded(task)
        if passage is None:
            assert flood <= STEP
            continue
        found += 1
        assert passage.radius == pytest.approx(flood, abs=STEP)
        assert point_clearance(task.world, [passage.at])[0] == pytest.approx(passage.radius, abs=1e-9)
        through_gaps += bool(passage.between)
    assert found > 15
    assert through_gaps > 8


def test_the_gap_is_named_and_its_middle_is_the_place() -> None:
    wall = tuple(Disc(2.0, y, 0.25) for y in (0.25, 0.75, 1.25, 2.25, 2.75))  # a gap of 0.5 m around (2, 1.75)
    task = Task(World("gate", (0.0, 0.0, 4.0, 3.0), wall), (0.6, 0.6, 0.0), (3.4, 0.6))
    passage = widest_passage(task, 0.4)
    assert passage == Passage(pytest.approx(0.25), pytest.approx((2.0, 1.75)), (2, 3))  # type: ignore[arg-type]
    beside_a_wall = Task(World("side", (0.0, 0.0, 4.0, 3.0), (Disc(2.0, 1.2, 1.1),)), (0.6, 0.6, 0.0), (3.4, 0.6))
    assert widest_passage(beside_a_wall, 0.9) == Passage(
        pytest.approx(0.35),  # type: ignore[arg-type]
        pytest.approx((2.0, 2.65)),  # type: ignore[arg-type]
        (0, 4),
    )


def test_what_has_no_narrowest_place() -> None:
    room = World("room", (0.0, 0.0, 4.0, 3.0))
    assert widest_passage(Task(room, (0.5, 1.5, 0.0), (3.7, 1.5)), 0.4) == Passage(pytest.approx(0.3), (3.7, 1.5))  # type: ignore[arg-type]
    closed = World("closed", (0.0, 0.0, 4.0, 3.0), tuple(Disc(2.0, y, 0.3) for y in np.arange(0.0, 3.1, 0.5)))
    assert widest_passage(Task(closed, (0.6, 0.6, 0.0), (3.4, 0.6)), 0.4) is None
