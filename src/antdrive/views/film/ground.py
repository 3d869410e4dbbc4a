"""Ground of a film: floor, grid, no-go area, soft shadows, planned route, start and goal."""

from __future__ import annotations

import math

import numpy as np

from antdrive.base.plane import segment_lengths
from antdrive.base.types import Floats
from antdrive.views.colours import GOAL, GRID, GROUND, PAPER, ROUTE, START, ZONE, Colour
from antdrive.views.film import _kernels_paint as kernels
from antdrive.views.film.camera import Camera, Picture
from antdrive.views.scene import Scene

SHADOW_DEPTH = 0.30  # fraction of the light that the deepest shadow removes
SHADOW_TINT = (1.0, 0.94, 0.80)  # of red, green and blue: outdoor shadows are slightly blue
RING_SIDES = 64  # of a circle
SHEET = 0.6  # distance between sheets of a moving camera, as a fraction of the visible ground


class GroundPainter:
    """Painter of the ground below a camera: a whole picture, or around a moving camera a sheet that its frames sample."""

    def __init__(self, camera: Camera, scene: Scene, route: Floats, tall: Floats, sun: tuple[float, float]) -> None:
        self._camera, self._scene, self._route, self._tall, self._sun = camera, scene, route, tall, sun
        self._step, self._sheets = grid_step(camera), dict[tuple[int, int], tuple[Picture, float, float]]()
        width, height = camera.size
        corners = np.array([(x, y, 1.0) for x in (0, width) for y in (0, height)]) @ np.linalg.inv(camera.ground).T
        seen = corners[:, :2] / corners[:, 2:]
        self._low, self._high = seen.min(axis=0), seen.max(axis=0)  # of the visible ground [m]

    def paint(self, camera: Camera) -> Picture:
        """Paint the ground (H, W, 3) of a camera, with the grid of the first."""
        arrays = self._scene, self._route, self._tall, self._sun
        return _paint_ground(camera.size, camera.ground, camera.pixel, self._step, *arrays)

    def paint_moved(self, camera: Camera, moved: tuple[float, float]) -> Picture:
        """Paint the ground (H, W, 3) of the painter's camera, moved along the ground [m], from a sheet."""
        texel, stride = 1.25 * self._camera.pixel, SHEET * (self._high - self._low)
        place = np.floor(np.array(moved) / stride)
        key = (int(place[0]), int(place[1]))
        if key not in self._sheets:
            for old in list(self._sheets)[:-1]:
                del self._sheets[old]
            low, high = self._low + place * stride, self._high + (place + 1) * stride
            forward = np.array([(1 / texel, 0, -low[0] / texel), (0, 1 / texel, -low[1] / texel), (0, 0, 1)])
            width, height = np.ceil((high - low) / texel).astype(int).tolist()
            arrays = self._scene, self._route, self._tall, self._sun
            sheet = _paint_ground((width, height), forward, texel, self._step, *arrays)
            self._sheets[key] = sheet, float(low[0]), float(low[1])
        picture = np.empty((*camera.size[::-1], 3), dtype=np.uint8)
        kernels.sample_sheet(picture, np.linalg.inv(camera.ground), *self._sheets[key], texel)
        return picture


def _paint_ground(
    size: tuple[int, int],
    forward: Floats,
    pixel: float,
    step: float,
    scene: Scene,
    route: Floats,
    tall: Floats,
    sun: tuple[float, float],
) -> Picture:
    """Paint the ground (H, W, 3) in pixels of a width [m], with grid lines every `step` [m]."""
    width, height = size
    brush = _Brush(size, forward)
    under = kerb_width(scene) / 2  # the kerb hides the floor's edge
    bounds = np.array(scene.bounds) + np.array([-under, -under, under, under])
    tints = np.array([GROUND, PAPER, GRID], dtype=np.float64)
    kernels.lay_floor(brush.rgb, brush.inside, brush.inverse, bounds, step, 1.0, tints)
    line = 1.5 * pixel
    if scene.has_no_go_area:
        brush.zones(scene, line)
    shade = np.ones((height, width), dtype=np.float32)
    cylinders = scene.obstacles.copy()
    cylinders[:, 3] = tall
    kernels.cast_shadows(shade, brush.forward, brush.inverse, cylinders, *sun, SHADOW_DEPTH)
    for channel, tint in enumerate(SHADOW_TINT):
        brush.rgb[..., channel] *= 1 - tint * (1 - shade)
    if len(route) > 1:
        brush.capsules(dashes(route, line), ROUTE, 0.85)
    brush.start(scene, line)
    brush.goal(scene, line)
    return (brush.rgb + np.float32(0.5)).astype(np.uint8)


def kerb_width(scene: Scene) -> float:
    """Return the width of the kerb around the world [m]."""
    x0, y0, x1, y1 = scene.bounds
    return min(0.12, 0.02 * min(x1 - x0, y1 - y0))


def grid_step(camera: Camera) -> float:
    """Return the distance between grid lines [m]: the smallest of 0.1, 0.25, 0.5, 1, 2, 5, ... that is legible."""
    least = max(34.0, camera.size[0] / 24)  # [px]
    for step in (0.1, 0.25, 0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 50.0):
        if step / camera.pixel >= least:
            return step
    return 100.0


def capsules(starts: Floats, ends: Floats, half: float | Floats) -> Floats:
    """Return capsules (N, 5) from `starts` (N, 2) to `ends` (N, 2): ax, ay, bx, by, half width [m]."""
    return np.ascontiguousarray(np.column_stack([starts, ends, np.full(len(starts), half)]))


def ring(x: float, y: float, radius: float, half: float) -> Floats:
    """Return capsules (N, 5) that draw a circle with half the width of a line [m]."""
    turn = np.linspace(0, 2 * math.pi, RING_SIDES + 1)
    rim = np.column_stack([x + radius * np.cos(turn), y + radius * np.sin(turn)])
    return capsules(rim[:-1], rim[1:], half)


def dashes(line: Floats, width: float) -> Floats:
    """Return capsules (M, 5) that draw a polyline (N, 2) dashed with a line width [m]."""
    on, off = 7 * width, 5 * width
    steps = segment_lengths(line)
    arc = np.concatenate([[0.0], np.cumsum(steps)])
    starts = np.arange(0.0, arc[-1], on + off)
    at = np.unique(np.concatenate([arc, starts, np.minimum(starts + on, arc[-1])]))
    points = np.column_stack([np.interp(at, arc, line[:, 0]), np.interp(at, arc, line[:, 1])])
    rows = capsules(points[:-1], points[1:], 0.9 * width)
    return np.ascontiguousarray(rows[(at[:-1] + at[1:]) / 2 % (on + off) < on])


class _Brush:
    """Colours of the ground, and a coverage mask through which shapes are painted."""

    def __init__(self, size: tuple[int, int], forward: Floats) -> None:
        width, height = size
        self.forward, self.inverse = forward, np.linalg.inv(forward)
        self.inside = np.empty((height, width), dtype=np.bool_)  # the ground within the world's bounds
        self.rgb = np.zeros((height, width, 3), dtype=np.float32)
        self.cover = np.zeros((height, width), dtype=np.float32)

    def blend(self, colour: Colour, strength: float) -> None:
        """Blend a colour into the covered pixels and clear the mask."""
        kernels.blend_cover(self.rgb, self.cover, self.inside, np.array(colour, dtype=np.float64), strength)

    def capsules(self, rows: Floats, colour: Colour, strength: float) -> None:
        """Paint capsules (N, 5): ax, ay, bx, by, half width [m]."""
        kernels.cover_capsules(self.cover, self.forward, self.inverse, rows)
        self.blend(colour, strength)

    def zones(self, scene: Scene, line: float) -> None:
        """Tint the no-go area and draw its outline."""
        kernels.cover_capsules(self.cover, self.forward, self.inverse, _zone_rows(scene, 0.0))
        outer = self.cover.copy()
        self.blend(ZONE, 0.20)
        kernels.cover_capsules(self.cover, self.forward, self.inverse, _zone_rows(scene, line))
        np.subtract(outer, self.cover, out=self.cover)
        self.blend(ZONE, 0.38)

    def start(self, scene: Scene, line: float) -> None:
        """Mark the start with a ring of the robot's size and a tick along its heading."""
        x, y, yaw = scene.start
        radius = scene.robot.footprint.radius + line
        self.capsules(ring(x, y, radius, 0.8 * line), START, 0.9)
        dx, dy = math.cos(yaw), math.sin(yaw)
        tick = [(x + radius * dx, y + radius * dy, x + 1.5 * radius * dx, y + 1.5 * radius * dy, 0.8 * line)]
        self.capsules(np.array(tick), START, 0.9)

    def goal(self, scene: Scene, line: float) -> None:
        """Mark the goal's tolerance disc and its centre."""
        (x, y), radius = scene.goal, scene.goal_tolerance
        self.capsules(np.array([(x, y, x, y, radius)]), GOAL, 0.22)
        self.capsules(ring(x, y, radius, 0.9 * line), GOAL, 0.95)
        self.capsules(ring(x, y, 0.5 * radius, 0.5 * line), GOAL, 0.6)
        self.capsules(np.array([(x, y, x, y, max(0.10 * radius, 1.4 * line))]), GOAL, 0.95)


def _zone_rows(scene: Scene, shrink: float) -> Floats:
    """Return the no-go area as capsules (N, 5), shrunk by `shrink` [m]."""
    x, y, radius, _ = scene.obstacles[~scene.unseen].T
    reach = scene.inflate - shrink
    discs = np.column_stack([x, y, x, y, radius + reach])
    x0, y0, x1, y1 = scene.bounds
    far = 2 * scene.inflate
    walls = [
        (x0, y0 - far, x0, y1 + far, reach),
        (x1, y0 - far, x1, y1 + far, reach),
        (x0 - far, y0, x1 + far, y0, reach),
        (x0 - far, y1, x1 + far, y1, reach),
    ]
    rows = np.vstack([discs, walls])
    return np.ascontiguousarray(rows[rows[:, 4] > 0])
