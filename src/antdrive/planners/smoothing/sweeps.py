"""Smoothing for footprints: straights and turns on the spot, shortened only where the swept outline stays clear."""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass

import numpy as np

from antdrive.base import Point
from antdrive.planners.entrances import clear_lead, clear_turn, lead_heading, outline_at, turn_at
from antdrive.planners.plan import Cells, PlanResult
from antdrive.worlds import Grid, Route, Task
from antdrive.worlds.headings import Outline, sweep_clearance

PASSES = 2  # shortening runs this often, with new points on the straights
BETWEEN = 0.25  # distance of the points on a straight at which a shortcut may begin or end [m]
NEAR = 1e-6  # points this close are one [m]


@dataclass(frozen=True, eq=False)
class _Line:
    """A polyline that the robot drives straight by straight."""

    points: list[Point]
    headings: list[float]  # of the robot on the straight after each point but the last [rad]


def smooth_lines(plan: PlanResult, grid: Grid, task: Task, kind: str) -> Route:
    """Return the route of a plan on a grid with turns: straights, with a turn on the spot at each point.

    The first straight leads from the exact start to the first cell, backwards if the robot cannot turn to face it. The last
    leads to the exact goal if the outline stays clear on it; else the route ends at the last cell.

    The kind `none` keeps the plan's straights. `taut` and `clearance` replace stretches by straights where the outline, with
    its margin, stays clear on each and on the turns at both ends.
    """
    outline = grid.turns.outline
    line, backwards = _planned(plan, grid, task, outline)
    lead = int(backwards)  # straights that stay: a lead backwards
    for _ in range(PASSES if kind != "none" and len(line.headings) > lead else 0):
        rest = _Line(line.points[lead:], line.headings[lead:])
        rest = _shortened(_divided(rest), line.headings[0] if backwards else task.start[2], task, outline)
        line = _Line([*line.points[:lead], *rest.points], [*line.headings[:lead], *rest.headings])
    before = [task.start[2], *line.headings]
    leaving = outline_at(task, outline)
    turns = [
        turn_at((*point, was), heading, task, [outline] if k > 1 else [outline, leaving])
        for k, (point, was, heading) in enumerate(zip(line.points, before, line.headings, strict=False))
    ]
    first = math.dist(*line.points[:2]) if backwards else 0.0
    return Route(np.array(line.points), kind=kind, turns=np.array([*turns, 0.0]), backwards_until=first)


def _planned(plan: PlanResult, grid: Grid, task: Task, outline: Outline) -> tuple[_Line, bool]:
    """Return the plan's straights with the leads to the exact ends, and whether the first is driven backwards."""
    start, goal = task.start, task.goal
    points: list[Point] = [(x, y) for x, y in grid.xy(_corners(plan.cells)).tolist()]
    headings = [_heading(a, b) for a, b in itertools.pairwise(points)]
    backwards = False
    if math.dist(start[:2], points[0]) > NEAR:
        lead = clear_lead(task, points[0], next(iter(headings), None), outline_at(task, outline))
        backwards = lead.backwards
        points, headings = [start[:2], *points], [lead.heading, *headings]
    if math.dist(points[-1], goal) > NEAR:
        last = (*points[-1], headings[-1] if headings else start[2])
        heading = lead_heading(last, *goal, outline, task.world, backwards=False)
        if math.isfinite(heading):
            points, headings = [*points, goal], [*headings, heading]
    if len(points) < 2:  # the robot is at the goal; a route needs two points
        x, y, yaw = start
        points, headings = [(x, y), (x + 1e-4 * math.cos(yaw), y + 1e-4 * math.sin(yaw))], [yaw]
    return _Line(points, headings), backwards


def _corners(cells: Cells) -> Cells:
    """Return the first and last of some cells (N, 2) and those between where the direction changes."""
    if len(cells) < 3:
        return cells
    steps = np.diff(cells, axis=0)
    return cells[np.concatenate(([True], (steps[1:] != steps[:-1]).any(axis=1), [True]))]


def _divided(line: _Line) -> _Line:
    """Return the line with further points on its straights."""
    points: list[Point] = []
    headings: list[float] = []
    for (a, b), heading in zip(itertools.pairwise(line.points), line.headings, strict=True):
        count = max(1, math.ceil(math.dist(a, b) / BETWEEN))
        points += [(a[0] + (b[0] - a[0]) * k / count, a[1] + (b[1] - a[1]) * k / count) for k in range(count)]
        headings += [heading] * count
    return _Line([*points, line.points[-1]], headings)


def _shortened(line: _Line, heading: float, task: Task, outline: Outline) -> _Line:
    """Return the line, begun at a heading, with each stretch replaced by the longest clear straight found from its begin."""
    points, headings = line.points, line.headings
    kept, faces, i = [points[0]], [], 0
    while i < len(points) - 1:
        count = _reach(line, i, heading, task, outline)
        j = i + count
        heading = headings[i] if j == i + 1 else _heading(points[i], points[j])
        kept.append(points[j])
        faces.append(heading)
        i = j
    return _merged(kept, faces)


def _reach(line: _Line, i: int, heading: float, task: Task, outline: Outline) -> int:
    """Return the number of straights after point i that one clear straight replaces, found by doubling and bisection."""
    most = len(line.headings) - i
    count, span = 1, 2
    while count < most and _straight(line, i, i + min(span, most), heading, task, outline):
        count, span = min(span, most), 2 * span
    high = min(span, most)
    while high - count > 1:
        middle = (count + high) // 2
        if _straight(line, i, i + middle, heading, task, outline):
            count = middle
        else:
            high = middle
    return count


def _straight(line: _Line, i: int, j: int, heading: float, task: Task, outline: Outline) -> bool:
    """Return whether the robot can go straight from point i to point j: turn, drive, and turn to the line's heading."""
    a, b, world = line.points[i], line.points[j], task.world
    along = _heading(a, b)
    if sweep_clearance(*a, *b, along, outline, world.discs, world.bounds) <= 0:
        return False
    if math.isnan(clear_turn((*a, heading), along, outline, world)):
        return False
    return j == len(line.headings) or math.isfinite(clear_turn((*b, along), line.headings[j], outline, world))


def _merged(points: list[Point], headings: list[float]) -> _Line:
    """Return a line without points between straights of one heading."""
    keep = [k for k in range(1, len(headings)) if abs(headings[k] - headings[k - 1]) > 1e-9]
    return _Line([points[0], *(points[k] for k in keep), points[-1]], [headings[0], *(headings[k] for k in keep)])


def _heading(a: Point, b: Point) -> float:
    return math.atan2(b[1] - a[1], b[0] - a[0])
