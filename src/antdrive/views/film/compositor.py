"""Compositor of film frames: ground, bodies, robots and movers of a scene through a camera.

The ground and, behind robots and movers, the bodies of a camera are painted once.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import numpy.typing as npt
from PIL import Image

from antdrive.base.types import Floats, Point
from antdrive.robots.spec import RobotSpec
from antdrive.views import colours
from antdrive.views.colours import Colour
from antdrive.views.film import ground
from antdrive.views.film.camera import Camera, Picture
from antdrive.views.film.lidar_view import PALENESS, BeamPainter, OwnMapPainter
from antdrive.views.film.meshes import Part, cylinder, robot_height, robot_parts
from antdrive.views.film.painter import Painter, UprightBody
from antdrive.views.film.text import put
from antdrive.views.map_reconstruction import enclosed
from antdrive.views.scene import Scene

if TYPE_CHECKING:
    from antdrive.worlds import Grid


SHINES = 0.5  # opacity of a robot over whatever covers it
RING_OFF = 0.05  # distance of a ring from the surface of its tracked mover [m]
FORECAST = 1.5  # horizon of the movers' drawn motion [s]
POST = cylinder(1.0, 0.0, 1.0)


class Actor(NamedTuple):
    """Robot of a frame."""

    robot: RobotSpec
    parts: tuple[Part, ...]
    pose: tuple[float, float, float]  # x, y [m] and heading [rad]

    @property
    def body(self) -> UprightBody:
        """Its body."""
        x, y, yaw = self.pose
        cosine, sine = math.cos(yaw), math.sin(yaw)
        place = np.array([(cosine, -sine, 0.0, x), (sine, cosine, 0.0, y), (0.0, 0.0, 1.0, 0.0)])
        return UprightBody(x, y, self.robot.footprint.radius, 1.1 * robot_height(self.robot), self.parts, place)


class DrivenPath(NamedTuple):
    """Path of a drive."""

    pieces: Sequence[tuple[Floats, Colour]]  # polylines (N, 2) [m] and their colours
    width: float = 1.0  # in multiples of the usual one


class Compositor:
    """Compositor of the frames of one scene.

    >>> compositor = Compositor(scene, camera)
    >>> picture = compositor.frame(pose)

    Attributes:
        route: the planned route (N, 2) [m]
        replanned_at: places of replans (N, 2) [m]
    """

    def __init__(
        self, scene: Scene, camera: Camera, *, route: Floats | None = None, lidar_view: BeamPainter | None = None
    ) -> None:
        self.scene = scene
        self.route = np.empty((0, 2)) if route is None else route
        self.replanned_at = np.empty((0, 2))
        self._lidar_view, self._step = lidar_view, ground.grid_step(camera)
        self._tall = np.minimum(scene.obstacles[:, 3], drawn_height(scene))
        self._parts = robot_parts(scene.robot)
        self._labels: list[tuple[Picture, float, float, float]] = []
        self._bodies = [
            _post(x, y, radius, tall, colours.UNSEEN if unseen else colours.OBSTACLE)
            for (x, y, radius, _), tall, unseen in zip(scene.obstacles, self._tall, scene.unseen, strict=True)
        ]
        self._outer = ~enclosed(scene.obstacles)
        self.set_camera(camera)

    def set_camera(self, camera: Camera, *, moves: bool = False) -> None:
        """Paint the ground through a camera; `moves`: it shows one frame, and its bodies are not kept."""
        self.camera, self._moves = camera, moves
        self.painter = Painter(camera, drawn_height(self.scene))
        ground.paint_ground(self.painter, self.scene, self._tall, self._step)
        self._ground = self.painter.pixels.copy()
        self._layer: Image.Image | None = None
        near = self.painter.near(self.scene.obstacles[:, :2], self.scene.obstacles[:, 2] + self._tall)
        self._seen = [self._bodies[k] for k in np.flatnonzero(near & self._outer)]

    def frame(self, pose: npt.ArrayLike, movers: npt.ArrayLike = ()) -> Picture:
        """Return the picture (H, W, 3) with robot and movers."""
        x, y, yaw = (float(value) for value in np.asarray(pose))
        return self.frame_of([Actor(self.scene.robot, self._parts, (x, y, yaw))], movers)

    def frame_of(
        self,
        actors: Sequence[Actor],
        movers: npt.ArrayLike = (),
        *,
        velocities: Floats | None = None,
        tracked: Floats | None = None,
        gap: tuple[Point, Point] | None = None,
        trails: Sequence[DrivenPath] = (),
    ) -> Picture:
        """Return the picture (H, W, 3) with robots, movers, driven paths, and a line across a gap between two points [m]."""
        places = np.asarray(movers, dtype=np.float64).reshape(-1, 2)
        painter, lidar, pixel = self.painter, self._lidar_view, self.camera.pixel
        painter.pixels[:] = self._ground
        if isinstance(lidar, OwnMapPainter):
            lidar.veil_unknown(painter)
            ground.paint_edge(painter, self.scene)
        if lidar is not None:
            lidar.draw_beams(painter)
        if len(self.route) > 1:
            painter.fill(ground.dashes(self.route, 1.5 * pixel), colours.ROUTE, 0.85)
        self._paint_trails(trails)
        for size, colour in ((6.3, colours.ROUTE), (3.6, colours.WHITE)):
            painter.fill(ground.discs(self.replanned_at, size * pixel), colour)
        if velocities is not None:
            self._paint_forecast(places, velocities)
        for actor in actors:
            self._paint_shadow(actor)
        ground.paint_shadow(painter, places, np.array(self.scene.mover_radii), drawn_height(self.scene))
        self._put_labels()
        self._draw_bodies(actors, places)
        if tracked is not None:
            self._draw_tracked(tracked)
        if gap is not None:
            half, height = 1.3 * pixel, robot_height(self.scene.robot) / 2
            ends = np.array(gap)
            for wide, colour in ((2.2 * half, colours.WHITE), (half, colours.INK)):
                line = [*ground.capsules(ends[:1], ends[1:], wide), *ground.discs(ends, wide + 0.8 * half)]
                painter.fill(line, colour, height=height)
        return painter.pixels[..., :3].copy()

    def _draw_bodies(self, actors: Sequence[Actor], movers: Floats) -> None:
        """Draw all bodies; a robot shines through whatever covers it."""
        painter, lidar, tall = self.painter, self._lidar_view, drawn_height(self.scene)
        robots = [actor.body for actor in actors]
        there = zip(movers.tolist(), self.scene.mover_radii, strict=False)  # none while planning
        moving = [*robots, *(_post(x, y, radius, tall, colours.MOVER) for (x, y), radius in there)]
        if isinstance(lidar, OwnMapPainter):
            pale = dict(zip(map(id, self._bodies), lidar.unmet.tolist(), strict=True))
            bodies = [_paled(body) if pale[id(body)] else body for body in self._seen]
            painter.draw_bodies([*bodies, *moving], hits=lidar.hits)
        elif self._moves:
            painter.draw_bodies([*self._seen, *moving])
        else:
            self._draw_over_layer(moving)
        for robot in robots:
            x0, y0, x1, y1 = painter.box_of([robot])[0].tolist()
            part = painter.pixels[y0:y1, x0:x1]
            covered = part.astype(np.float32)
            painter.draw_bodies([robot])
            part[:] = covered + SHINES * (part - covered)

    def _draw_over_layer(self, moving: Sequence[UprightBody]) -> None:
        """Lay the picture of all static bodies over the ground, and draw those around moving bodies again with these."""
        painter = self.painter
        below = painter.pixels.copy()
        if self._layer is None:
            painter.pixels[:] = 0
            painter.draw_bodies(self._seen)
            self._layer, self._boxes = Image.fromarray(painter.pixels.copy()), painter.box_of(self._seen)
        painter.pixels[:] = np.asarray(Image.alpha_composite(Image.fromarray(below), self._layer))
        if moving:
            boxes = painter.box_of(moving)
            x0, y0 = boxes[:, :2].min(axis=0).tolist()
            x1, y1 = boxes[:, 2:].max(axis=0).tolist()
            painter.pixels[y0:y1, x0:x1] = below[y0:y1, x0:x1]
            inside = ((self._boxes[:, :2] < (x1, y1)) & (self._boxes[:, 2:] > (x0, y0))).all(axis=1)
            painter.draw_bodies([*(self._seen[k] for k in np.flatnonzero(inside)), *moving], (x0, y0, x1, y1))

    def field_frame(self, grid: Grid, levels: Floats, paths: Iterable[tuple[Floats, Colour | None]]) -> Picture:
        """Return the picture (H, W, 3) without a robot: a planner's field on the ground, paths (N, 2) [m] in colours over it."""
        painter, (x, y), cell = self.painter, grid.origin, grid.cell
        painter.pixels[:] = self._ground
        shown = np.nan_to_num(np.minimum(1.0, 2.5 * levels))
        tints = colours.field_colours(np.nan_to_num(levels)).reshape(*levels.shape, 3)
        to_cells = np.array([(1.0, 0.0, cell / 2 - x), (0.0, 1.0, cell / 2 - y), (0.0, 0.0, cell)])
        painter.lay(tints.astype(np.uint8), (230 * shown).astype(np.uint8), to_cells)
        for k, (path, colour) in enumerate(paths):
            painter.fill(ground.band(path, max(2.4 - 0.8 * k, 0.8) * self.camera.pixel), colour or colours.SHELL)
        self._put_labels()
        self._draw_bodies((), np.empty((0, 2)))
        return painter.pixels[..., :3].copy()

    def add_label(self, sprite: Picture, x: float, y: float, reach: float) -> None:
        """Add an RGBA picture on the ground, below (or above) the disc of radius `reach` at x, y [m], to all frames."""
        self._labels.append((sprite, x, y, reach))

    def _put_labels(self) -> None:
        width, height = self.camera.size
        for sprite, x, y, reach in self._labels:
            high, wide = sprite.shape[:2]
            rim = np.array([(*point, 0.0) for point in ground.discs(np.array([(x, y)]), reach)[0]])
            px, rows = self.pixel(x, y)[0], self.camera.pixels(rim)[:, 1]
            top = rows.max() + 1 if rows.max() + 1 + high < height else rows.min() - 1 - high
            left = min(max(px - wide / 2, 0), width - wide) if -wide < px < width + wide else px
            put(self.painter.pixels[..., :3], sprite, left, top)

    def pixel(self, x: float, y: float, z: float = 0.0) -> tuple[float, float]:
        """Return the column and row [px] at which a point of the world [m] appears."""
        at = self.camera.pixels([(x, y, z)])[0]
        return float(at[0]), float(at[1])

    def _paint_trails(self, trails: Sequence[DrivenPath]) -> None:
        half = max(0.32 * self.scene.robot.footprint.radius, 4.0 * self.camera.pixel) / 2
        for trail in trails:
            for line, colour in trail.pieces:
                self.painter.fill(ground.band(line, trail.width * half), colour)

    def _paint_forecast(self, places: Floats, velocities: Floats) -> None:
        """Paint each mover's path at constant velocity as a line with a dot every 0.5 s."""
        half, moving = 1.1 * self.camera.pixel, np.hypot(*velocities.T) > 0.01
        starts, ahead = places[moving], FORECAST * velocities[moving]
        stops = [ground.discs(starts + part * ahead, 2.2 * half) for part in (1 / 3, 2 / 3, 1.0)]
        self.painter.fill([*ground.capsules(starts, starts + ahead, half), *np.concatenate(stops)], colours.MOVER, 0.6)

    def _draw_tracked(self, tracked: Floats) -> None:
        """Draw a ring at each mover's estimated position, and its path at the estimated velocity."""
        half = 1.2 * self.camera.pixel
        rims = [part for x, y, _, _, radius in tracked for part in ground.ring(x, y, radius + RING_OFF, half)]
        ways = ground.capsules(tracked[:, :2], tracked[:, :2] + FORECAST * tracked[:, 2:4], half)
        self.painter.fill([*rims, *ways], colours.TRACKED, 0.8)

    def _paint_shadow(self, actor: Actor) -> None:
        """Paint the shadow of a robot: of discs along the rectangle around its footprint."""
        x, y, yaw = actor.pose
        xmin, ymin, xmax, ymax = actor.robot.footprint.bounds
        half = min(xmax - xmin, ymax - ymin) / 2
        along = np.linspace((xmin + half, ymin + half), (xmax - half, ymax - half), 5)
        turn = np.array([(math.cos(yaw), math.sin(yaw)), (-math.sin(yaw), math.cos(yaw))])
        ground.paint_shadow(self.painter, along @ turn + [x, y], half, robot_height(actor.robot))


def drawn_height(scene: Scene) -> float:
    """Return the maximum drawn height of cylinders [m]; taller ones would hide the robot."""
    return max(0.3, 2.0 * robot_height(scene.robot))


def _post(x: float, y: float, radius: float, tall: float, colour: Colour) -> UprightBody:
    place = np.column_stack([np.diag([radius, radius, tall]), [x, y, 0.0]])
    return UprightBody(x, y, radius, tall, (Part(POST, colour),), place)


def _paled(body: UprightBody) -> UprightBody:
    """Return an undetected body."""
    parts = [Part(part.mesh, colours.mixed(part.colour, colours.PALE, PALENESS)) for part in body.parts]
    return body._replace(parts=parts)
