"""Margin loss of a calibration drive along a random course."""

from __future__ import annotations

import dataclasses
import hashlib
import json
import math
from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from antdrive.base import Floats
from antdrive.base.kernel_cache import sources_stamp
from antdrive.base.version import versions
from antdrive.planners import PLANNERS, Query, smooth
from antdrive.proof.track import Track, between_rows
from antdrive.robots import RobotSpec, outline_of
from antdrive.sim.driving.drive import follow
from antdrive.sim.driving.senses import positioning
from antdrive.sim.log.metrics import nearest_on_route
from antdrive.sim.log.outcome import Outcome
from antdrive.sim.log.streams import random_stream
from antdrive.sim.physics.engine import Engine
from antdrive.sim.scenario import LossFactors
from antdrive.worlds import Disc, Task, World, point_clearance, rasterise
from antdrive.worlds.grid import DIRECTIONS, DISC

CELLS = (0.5, 1.5)  # smallest and largest cell, in radii of the robot
PILLARS = (0.2, 2.0)  # smallest and largest radius of a pillar, in radii of the robot
SECONDS, RADII = 2.5, 8.0  # length of a course: this time at full speed plus this many radii
SPACING = 1.0  # mean distance between pillars along a leg, in radii of the robot
LEFT_OUT = (0.0, 0.5)  # least and largest fraction of omitted pillars
ROUNDING = 1e-6  # extra distance of the pillars beyond the planning distance [m]
TOLERANCE = 0.5  # of the goal, plus the robot's radius; a course does not test arriving [m]
HEADINGS = (6, 7, 0, 1, 2)  # indices of DIRECTIONS from south via east to north: a course never turns back


def course(robot: RobotSpec, inflate: float, rng: np.random.Generator, beside: float | None = None) -> Task:
    """Return a task with a path that bends between pillars at the distance `inflate` from it.

    The path leads through cells; planning with that distance finds it or a shorter one. For a footprint, pillars stand at
    that distance from corners, where it turns, and at the distance `beside` from legs.
    """
    cell = robot.radius * float(rng.uniform(*CELLS))
    cells = _bends(cell, SECONDS * robot.max_speed + RADII * robot.radius, rng)
    pad = math.ceil((inflate + 2 * robot.radius) / cell) + 1
    cells = cells - cells.min(axis=0) + pad
    rows, cols = (cells.max(axis=0) + pad + 1).tolist()
    line, corners = (np.asarray((at[:, ::-1] + 0.5) * cell, dtype=np.float64) for at in (cells, _beside(cells)))
    if beside is not None:
        turns = line[1:-1][np.abs(np.diff(np.diff(line, axis=0), axis=0)).sum(axis=1) > cell / 2]
        corners = np.concatenate([line[:1], turns])
    distance = (inflate if beside is None else beside) + ROUNDING
    pillars = _pillars(line, corners, robot.radius, distance, inflate + ROUNDING, rng)
    world = World("course", (0.0, 0.0, cols * cell, rows * cell), pillars)
    (x, y), (goal_x, goal_y) = line[0].tolist(), line[-1].tolist()
    yaw = math.atan2(*(line[1] - line[0])[::-1].tolist())
    return Task(world, (x, y, yaw), (goal_x, goal_y), goal_tolerance=TOLERANCE + robot.radius, cell=cell)


def _bends(cell: float, length: float, rng: np.random.Generator) -> npt.NDArray[np.int64]:
    """Draw the cells (N, 2) of straight legs with bends of 45 and 90 degrees between them."""
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
    """Return the two cells beside each diagonal step (N, 2), which must be free."""
    before, after = cells[:-1], cells[1:]
    diagonal = (before != after).all(axis=1)
    (row, col), (next_row, next_col) = before[diagonal].T, after[diagonal].T
    return np.concatenate([np.stack([row, next_col], axis=1), np.stack([next_row, col], axis=1)])


def _pillars(
    line: Floats, free: Floats, radius: float, distance: float, around: float, rng: np.random.Generator
) -> tuple[Disc, ...]:
    """Draw cylinders at a distance from a line (N, 2), and at the distance `around` from the points `free` (M, 2)."""
    left_out, pillars = rng.uniform(*LEFT_OUT), []
    smallest, largest = (math.log(radius * share) for share in PILLARS)
    for at, away, factor in _places(line, radius, rng):
        size = math.exp(rng.uniform(smallest, largest))
        centre = at + (distance + size) * factor * np.array([math.cos(away), math.sin(away)])
        beside = math.dist(centre, nearest_on_route(centre[None], line)[0])
        room = min(beside, float(np.hypot(*(free - centre).T).min(initial=math.inf)) - around + distance)
        if rng.random() >= left_out and room >= distance + size - ROUNDING / 2:
            pillars.append(Disc(float(centre[0]), float(centre[1]), size))
    return tuple(pillars)


def _places(line: Floats, radius: float, rng: np.random.Generator) -> Iterator[tuple[Floats, float, float]]:
    """Yield where pillars may touch a line's clearance zone: a point, a direction, and a multiple of the distance."""
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


METHOD = 3  # increment when courses, statistics or search change, to invalidate cached results


class Loss(NamedTuple):
    """Margin used up by a drive."""

    footprint: float  # by the robot's footprint [m]
    disc: float  # by the shape that plans keep clear: its smallest enclosing disc, or again its footprint [m]


def calibration_key(conditions: LossFactors) -> str:
    """Return the SHA-256 of the loss factors and of the versions of the code that the loss depends on."""
    facts = dataclasses.asdict(conditions)
    if not conditions.outlined:
        del facts["outlined"]
    for label in ("name", "source"):
        del facts["robot"][label]
    current = {name: version for name, version in versions().items() if name in ("antdrive", "pybullet", "numpy")}
    facts |= {"method": METHOD, "versions": current, "kernels": sources_stamp()}
    return hashlib.sha256(json.dumps(facts, sort_keys=True).encode()).hexdigest()


def loss_on_course(conditions: LossFactors, margin: float, seed: int) -> Loss:
    """Return the margin that a drive along a random course uses up; infinite if it misses the goal.

    A loss is the margin minus the minimum clearance that a certificate would prove. It exceeds the margin if the drive could
    not be certified. The footprint's loss is negative if the footprint stayed farther from obstacles than the planned disc.
    """
    c, robot = conditions, conditions.robot
    right, left = -robot.footprint.bounds[1], robot.footprint.bounds[3]
    beside = max(left, right) + margin if c.outlined else None
    task = course(robot, robot.radius + margin, random_stream(seed, "course"), beside)
    outline = outline_of(robot.footprint, margin) if c.outlined else DISC
    grid = rasterise(task.world, task.cell, robot.radius + margin, outline)
    answer = PLANNERS["astar"].plan(Query.between(grid, task), random_stream(seed, "planner"))
    route = smooth(answer, grid, task, kind=c.smoothing)
    period, limit = 1 / c.control_hz, 30.0 + 10.0 * route.length / robot.max_speed
    path = c.controller.prepare(route, task.world, robot, margin, period, task.goal_tolerance, noise=c.noise)
    senses, localiser = positioning("fixes", robot, c.noise, 1.0, period, task.start, seed)
    with Engine(task.world, robot, physics_hz=c.physics_hz) as engine:
        rates: dict[str, Any] = {"limit": limit, "control_hz": c.control_hz}
        log = follow(engine, c.controller, path, task, **rates, senses=senses, localiser=localiser)
    if log.outcome is not Outcome.SUCCEEDED or log.physics:
        return Loss(math.inf, math.inf)
    disc = log.clearance if c.outlined else point_clearance(task.world, log.pose[:, :2]) - robot.radius
    reach = Track.measured(log.t, log.pose, log.twist, robot.footprint).reach
    between = (between_rows(room, reach).min(initial=room.min()) for room in (log.clearance, disc))
    return Loss(*(margin - float(bound) for bound in between))
