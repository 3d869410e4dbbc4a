"""Ground of a film: floor, grid, no-go area, soft shadows, planned route, start and goal."""

from __future__ import annotations

import math

import numpy as np

from antdrive.base.plane import segment_lengths
from antdrive.base.types import Floats
from antdrive.views.colours import GOAL, GRID, GROUND, INK, KERB, PAPER, START, ZONE, mixed
from antdrive.views.film.camera import Camera
from antdrive.views.film.painter import Painter
from antdrive.views.scene import Scene

ARC = np.linspace(-math.pi / 2, math.pi / 2, 7)  # directions of the points on the end of a thin line [rad]
ROUND = np.linspace(-math.pi / 2, math.pi / 2, 25)  # and of a disc
SUN = np.array([0.55, 0.28])  # extent of shadows to the camera's right and ahead, per metre of height
LAYERS = (2, 1, 0, -1, -2)  # of a shadow, by growth in steps: at most 0.015 m or 3 px
SHADOW = 0.055  # opacity of a layer
MOST_LINES = 200  # of the grid, in each direction


def paint_ground(painter: Painter, scene: Scene, tall: Floats, step: float) -> None:
    """Paint the ground with grid lines every `step` [m]; `tall` (N,): heights of the obstacles [m]."""
    camera, line = painter.camera, 1.5 * painter.camera.pixel
    x0, y0, x1, y1 = scene.bounds
    painter.fill([rectangle(*painter.low, *painter.high)], GROUND)
    seen = painter.near(scene.obstacles[:, :2], scene.obstacles[:, 2] + scene.inflate + 2 * tall)
    if scene.has_no_go_area:
        known = scene.obstacles[seen & ~scene.unseen]
        for reach, tint in (
            (scene.inflate, mixed(GROUND, ZONE, 0.5)),
            (scene.inflate - line, mixed(GROUND, ZONE, 0.2)),
        ):
            walls = [
                rectangle(x0, y0, x0 + reach, y1),
                rectangle(x1 - reach, y0, x1, y1),
                rectangle(x0, y0, x1, y0 + reach),
                rectangle(x0, y1 - reach, x1, y1),
            ]
            painter.fill([*discs(known[:, :2], known[:, 2] + reach), *walls] if reach > 0 else [], tint)
    (left, low), (right, high) = np.maximum(painter.low, (x0, y0)), np.minimum(painter.high, (x1, y1))
    across = [(x, low, x, high) for x in step * np.arange(math.ceil(left / step), right / step)[:MOST_LINES]]
    along = [(left, y, right, y) for y in step * np.arange(math.ceil(low / step), high / step)[:MOST_LINES]]
    rows = np.array([*across, *along]).reshape(-1, 4)
    painter.fill(capsules(rows[:, :2], rows[:, 2:], 0.5 * camera.pixel), GRID, 0.8)
    cylinders = scene.obstacles[seen]
    paint_shadow(painter, cylinders[:, :2], cylinders[:, 2], tall[seen])
    paint_edge(painter, scene)
    _paint_ends(painter, scene, line)


def paint_edge(painter: Painter, scene: Scene) -> None:
    """Paint the surroundings of the world, and a line around it."""
    x0, y0, x1, y1 = scene.bounds
    inside, wide = rectangle(*scene.bounds)[::-1], min(0.12, 0.02 * min(x1 - x0, y1 - y0))
    painter.fill([rectangle(*painter.low, *painter.high), inside], PAPER)
    painter.fill([rectangle(x0 - wide, y0 - wide, x1 + wide, y1 + wide), inside], KERB)


def _paint_ends(painter: Painter, scene: Scene, line: float) -> None:
    """Mark the start with a ring of the robot's size and a tick along its heading, and the goal with its tolerance."""
    x, y, yaw = scene.start
    radius, ahead = scene.robot.footprint.radius + line, np.array([math.cos(yaw), math.sin(yaw)])
    tick = np.array([[x, y]]) + radius * ahead
    painter.fill(
        [*ring(x, y, radius, 0.8 * line), *capsules(tick, tick + 0.5 * radius * ahead, 0.8 * line)], START, 0.9
    )
    place, radius = np.array([scene.goal]), scene.goal_tolerance
    painter.fill(discs(place, radius), GOAL, 0.22)
    painter.fill(ring(*scene.goal, radius, 0.9 * line), GOAL, 0.95)
    painter.fill(discs(place, max(0.10 * radius, 1.4 * line)), GOAL, 0.95)


def paint_shadow(painter: Painter, places: Floats, radii: Floats | float, tall: Floats | float) -> None:
    """Paint the shadows of cylinders of heights `tall` at places (N, 2) [m]."""
    right = painter.camera.view[0, :2]
    sun = SUN[0] * right + SUN[1] * np.array([-right[1], right[0]])
    ends = places + np.outer(np.broadcast_to(tall, len(places)), sun)
    step = min(0.015, 3 * painter.camera.pixel)
    for layer in LAYERS:
        painter.fill(capsules(places, ends, np.maximum(radii + layer * step, 0.0), ROUND), INK, SHADOW)


def grid_step(camera: Camera) -> float:
    """Return the distance between grid lines [m]: the smallest of 0.1, 0.25, 0.5, 1, 2, 5, ... that is legible."""
    least = max(34.0, camera.size[0] / 24)  # [px]
    for step in (0.1, 0.25, 0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 50.0):
        if step / camera.pixel >= least:
            return step
    return 100.0


def rectangle(x0: float, y0: float, x1: float, y1: float) -> Floats:
    """Return a rectangle (4, 2) [m]."""
    return np.array([(x0, y0), (x1, y0), (x1, y1), (x0, y1)])


def discs(centres: Floats, radii: Floats | float) -> Floats:
    """Return discs (N, K, 2) at centres (N, 2) [m]."""
    return capsules(centres, centres, radii, ROUND)


def capsules(starts: Floats, ends: Floats, half: Floats | float, arc: Floats = ARC) -> Floats:
    """Return polygons (N, K, 2) around segments from `starts` (N, 2) to `ends` (N, 2) with half a width [m]."""
    ahead = np.arctan2(*(ends - starts).T[::-1])[:, None]
    turns = np.hstack([ahead + arc, ahead + math.pi + arc])
    rims = np.stack([np.cos(turns), np.sin(turns)], axis=-1) * np.broadcast_to(half, len(starts))[:, None, None]
    return np.asarray(np.stack([ends, starts], axis=1).repeat(len(arc), axis=1) + rims)


def ring(x: float, y: float, radius: float, half: float) -> list[Floats]:
    """Return a circle with half the width of a line [m]: its outer rim, and its inner rim in the other sense."""
    (outer,), (inner,) = (discs(np.array([(x, y)]), max(radius + off, 0.0)) for off in (half, -half))
    return [outer, inner[::-1]]


def band(line: Floats, half: float) -> list[Floats]:
    """Return polygons around a polyline (N, 2) with half a width [m] and round ends; none without two points."""
    if len(line) < 2:
        return []
    ahead = np.gradient(line, axis=0)
    aside = half * np.column_stack([-ahead[:, 1], ahead[:, 0]])
    aside /= np.maximum(np.hypot(*ahead.T), 1e-9)[:, None]
    return [np.vstack([line - aside, (line + aside)[::-1]]), *discs(line[[0, -1]], half)]


def dashes(line: Floats, width: float) -> Floats:
    """Return polygons (M, K, 2) that draw a polyline (N, 2) dashed with a line width [m]."""
    on, off = 7 * width, 5 * width
    arc = np.concatenate([[0.0], np.cumsum(segment_lengths(line))])
    starts = np.arange(0.0, arc[-1], on + off)
    at = np.unique(np.concatenate([arc, starts, np.minimum(starts + on, arc[-1])]))
    points = np.column_stack([np.interp(at, arc, line[:, 0]), np.interp(at, arc, line[:, 1])])
    drawn = (at[:-1] + at[1:]) / 2 % (on + off) < on
    return capsules(points[:-1][drawn], points[1:][drawn], 0.9 * width)
