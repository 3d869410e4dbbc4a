"""The courses of a calibration: random bends between pillars that stand exactly at the distance that planning keeps."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
import numpy.typing as npt

from antdrive.base import Floats
from antdrive.robots import RobotSpec
from antdrive.worlds import Disc, Task, World
from antdrive.worlds.grid import DIRECTIONS

CELLS = (0.5, 1.5)  # smallest and largest cell, in radii of the robot
PILLARS = (0.2, 2.0)  # smallest and largest radius of a pillar, in radii of the robot
SECONDS, RADII = 2.5, 8.0  # a course is as long as the robot drives at full speed in this time, plus this many radii
SPACING = 1.0  # between the pillars along a leg, on average, in radii of the robot
LEFT_OUT = (0.0, 0.5)  # least and largest fraction of the pillars that a course does without
ROUNDING = 1e-6  # pillars stand farther by this than the distance that planning keeps [m]
TOLERANCE = 0.5  # of the goal, plus the robot's radius: arriving is not what a course tests [m]
HEADINGS = (6, 7, 0, 1, 2)  # from south by way of east to north, as indices of DIRECTIONS: a course never turns back


def course(robot: RobotSpec, inflate: float, rng: np.random.Generator) -> Task:
    """A task with a path that bends between pillars, each of which stands at the distance `inflate` from the path.

    The path leads through cells, and planning with that distance finds it or a shorter one.
    """
    cell = robot.radius * float(rng.uniform(*CELLS))
    cells = _bends(cell, SECONDS * robot.max_speed + RADII * robot.radius, rng)
    pad = math.ceil((inflate + 2 * robot.radius) / cell) + 1
    cells = cells - cells.min(axis=0) + pad
    rows, cols = (cells.max(axis=0) + pad + 1).tolist()
    line, corners = (np.asarray((at[:, ::-1] + 0.5) * cell, dtype=np.float64) for at in (cells, _beside(cells)))
    pillars = _pillars(line, corners, robot.radius, inflate + ROUNDING, rng)
    world = World("course", (0.0, 0.0, cols * cell, rows * cell), pillars)
    (x, y), (goal_x, goal_y) = line[0].tolist(), line[-1].tolist()
    yaw = math.atan2(*(line[1] - line[0])[::-1].tolist())
    return Task(world, (x, y, yaw), (goal_x, goal_y), goal_tolerance=TOLERANCE + robot.radius, cell=cell)


def _bends(cell: float, length: float, rng: np.random.Generator) -> npt.NDArray[np.int64]:
    """The cells (N, 2) of straight legs, step by step, with bends of 45 and 90 degrees between them."""
    cells, covered, heading = [(0, 0)], 0.0, HEADINGS.index(0)
    while covered < length:
        row, col = DIRECTIONS[HEADINGS[heading]]
        leg = math.exp(rng.uniform(math.log(cell), math.log(max(2 * cell, 0.4 * length))))
        for _ in range(max(1, round(leg / (cell * math.hypot(row, col))))):
            cells.append((cells[-1][0] + row, cells[-1][1] + col))
            covered += cell * math.hypot(row, col)
        turns = [turn for turn in (-2, -1, 1, 2) if 0 <= heading + turn < len(HEADINGS)]
        heading += turns[int(rng.integers(len(turns)))]
    return np.array(cells)


def _beside(cells: npt.NDArray[np.int64]) -> npt.NDArray[np.int64]:
    """The two cells beside each diagonal step (N, 2), which must be free, too."""
    before, after = cells[:-1], cells[1:]
    diagonal = (before != after).all(axis=1)
    (row, col), (next_row, next_col) = before[diagonal].T, after[diagonal].T
    return np.concatenate([np.stack([row, next_col], axis=1), np.stack([next_row, col], axis=1)])


def _pillars(line: Floats, free: Floats, radius: float, distance: float, rng: np.random.Generator) -> tuple[Disc, ...]:
    """Cylinders along a line (N, 2) that stand at a distance from it, and at no less from the points `free` (M, 2)."""
    left_out, found = rng.uniform(*LEFT_OUT), []
    smallest, largest = (math.log(radius * share) for share in PILLARS)
    for at, away, factor in _places(line, radius, rng):
        size = math.exp(rng.uniform(smallest, largest))
        centre = at + (distance + size) * factor * np.array([math.cos(away), math.sin(away)])
        room = min(_distance(centre, line), float(np.hypot(*(free - centre).T).min(initial=math.inf)))
        if rng.random() >= left_out and room >= distance + size - ROUNDING / 2:
            found.append(Disc(float(centre[0]), float(centre[1]), size))
    return tuple(found)


def _places(line: Floats, radius: float, rng: np.random.Generator) -> Iterator[tuple[Floats, float, float]]:
    """Where pillars may touch the surroundings of a line: a point, a direction, and how many distances away from it."""
    steps = np.diff(line, axis=0)
    heading = np.arctan2(steps[:, 1], steps[:, 0])
    for i, step in enumerate(steps):
        for side in (-1, 1):
            for _ in range(max(1, round(math.hypot(*step) / (SPACING * radius)))):
                yield line[i] + rng.random() * step, heading[i] + side * math.pi / 2, 1.0
    for i in np.flatnonzero(np.diff(heading)).tolist():
        turn = heading[i + 1] - heading[i]
        inside = heading[i] + turn / 2 + math.copysign(math.pi / 2, turn)
        yield line[i + 1], inside, 1 / math.cos(turn / 2)  # at the distance from both legs
        for _ in range(2):
            yield line[i + 1], inside + math.pi + rng.uniform(-0.5, 0.5) * turn, 1.0


def _distance(point: Floats, line: Floats) -> float:
    """The distance of a point (2,) from a line (N, 2) [m]."""
    steps, to = np.diff(line, axis=0), point - line[:-1]
    share = np.clip((to * steps).sum(axis=1) / (steps**2).sum(axis=1), 0.0, 1.0)
    return float(np.hypot(*(to - share[:, None] * steps).T).min())
