"""Compositor of film frames: a static backdrop, rendered once, plus robot and movers in each frame.

The backdrop keeps its depth, so a frame costs only the pixels around robot and movers:
their meshes are drawn and blended in where they are nearer. A moving camera needs a new backdrop for every frame.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import numpy.typing as npt

from antdrive.base.types import Floats, Point
from antdrive.robots.spec import RobotSpec
from antdrive.views import colours
from antdrive.views.colours import Colour
from antdrive.views.film import _kernels_paint as kernels
from antdrive.views.film.camera import Camera, Picture
from antdrive.views.film.ground import GroundPainter, capsules, dashes, kerb_width, ring
from antdrive.views.film.lidar_view import Backdrop, BeamPainter, OwnMapPainter
from antdrive.views.film.meshes import Part, cylinder, join, kerb, robot_height, robot_parts
from antdrive.views.film.solids import Box, Solid, draw_solids, merged, overlap, placed
from antdrive.views.film.text import put
from antdrive.views.scene import Scene

if TYPE_CHECKING:
    from antdrive.worlds import Grid


HIDDEN_OPACITY = 0.16  # of a mover behind a cylinder
SHINES = 0.5  # opacity of a robot over whatever covers it
SHADOW_BLUR = 0.05  # softness of the shadow of a flat body [m]
RING_OFF = 0.05  # distance of a ring from the surface of its tracked mover [m]
FORECAST = 1.5  # horizon of the movers' drawn motion [s]


class Actor(NamedTuple):
    """Robot of a frame."""

    robot: RobotSpec
    parts: tuple[Part, ...]
    pose: tuple[float, float, float]  # x, y [m] and heading [rad]

    @property
    def solids(self) -> list[Solid]:
        """Its meshes."""
        place = placed(*self.pose)
        return [Solid(one.mesh, one.colour, place) for one in self.parts]


class Compositor:
    """Compositor of the frames of one scene for one camera.

    >>> compositor = Compositor(scene, camera, route=rollout.route)
    >>> compositor.extend_trail(points, tints)
    >>> picture = compositor.frame(pose)
    """

    def __init__(
        self, scene: Scene, camera: Camera, *, route: Floats, fine: int = 2, lidar_view: BeamPainter | None = None
    ) -> None:
        self.scene = scene
        self.camera = camera
        self.fine = fine
        self._lidar_view = lidar_view
        self.tall = np.minimum(scene.obstacles[:, 3], drawn_height(scene))
        self._sun, self._light = _sun(camera)
        route = np.ascontiguousarray(route, dtype=np.float64).reshape(-1, 2)
        self._ground = GroundPainter(camera, scene, route, self.tall, self._sun)
        self._trail_width = trail_width(scene, camera)
        self._trails: dict[int, list[tuple[Floats, Floats]]] = {}
        self._labels: list[tuple[Picture, float, float, float]] = []
        self._changing_route: tuple[Floats, ...] = (
            np.empty((0, 5)),
        ) * 3  # dashes, dots and their middles, as capsules
        self._solids = still_solids(scene, self.tall)
        self._middles = np.column_stack([scene.obstacles[:, :2], self.tall / 2])
        self._reaches = np.hypot(scene.obstacles[:, 2], self.tall / 2)
        self._parts = robot_parts(scene.robot)
        self._mover_meshes = [cylinder(radius, 0.0, drawn_height(scene)) for radius in scene.mover_radii]
        self.set_camera(camera)

    def set_camera(self, camera: Camera, moved: tuple[float, float] | None = None) -> None:
        """Render the backdrop through a camera, with the labels and the trail so far.

        `moved`: how far it is the first camera, moved along the ground [m]; None: another camera.
        """
        self.camera = camera
        floor = self._ground.paint(camera) if moved is None else self._ground.paint_moved(camera, moved)
        self.backdrop = self._render_still(camera, floor)
        self._canvas = self.backdrop.pixels.copy()
        self._painted = np.zeros((*self.backdrop.visible.shape, 4), dtype=np.uint8)
        for label in self._labels:
            self._put_on_ground(*label)
        for number in sorted(self._trails):
            rows, tints = (np.concatenate(part) for part in zip(*self._trails[number], strict=True))
            ends = rows[:, :4].reshape(-1, 2, 2)
            middles = np.column_stack([ends.mean(axis=1), np.zeros(len(rows))])
            seen = camera.sees(middles, np.hypot(*(ends[:, 1] - ends[:, 0]).T) / 2 + self._trail_width)
            self._paint_trail(rows[seen], tints[seen])

    def extend_trail(self, points: Floats, tints: Floats, number: int = 0, width: float = 1.0) -> None:
        """Extend the path of a drive along points (N, 2) [m], N >= 2, in colours (N - 1, 3), 0 to 255.

        Paths of later drives lie above those of earlier ones. `width` is in multiples of the usual one.
        """
        rows = capsules(points[:-1], points[1:], width * self._trail_width / 2)
        self._trails.setdefault(number, []).append((rows, tints))
        self._paint_trail(rows, tints)
        low, high = points.min(axis=0) - self._trail_width, points.max(axis=0) + self._trail_width
        for later in sorted(self._trails):
            if later > number:
                above, its = (np.concatenate(part) for part in zip(*self._trails[later], strict=True))
                near = ((above[:, :2] > low) & (above[:, :2] < high)).all(axis=1)
                self._paint_trail(above[near], its[near])

    def show_route(self, route: Floats, replanned_at: Floats) -> None:
        """Replace the route of later frames."""
        width = 1.5 * self.camera.pixel
        rings = (capsules(replanned_at, replanned_at, part * width) for part in (4.2, 2.4))
        self._changing_route = (dashes(route, width), *rings)

    def frame(
        self,
        pose: npt.ArrayLike,
        movers: npt.ArrayLike = (),
        velocities: npt.ArrayLike | None = None,
        tracked: Floats | None = None,
    ) -> Picture:
        """Return the picture (H, W, 3) with robot and movers."""
        x, y, yaw = (float(value) for value in np.asarray(pose))
        return self.frame_of([Actor(self.scene.robot, self._parts, (x, y, yaw))], movers, velocities, tracked)

    def frame_of(
        self,
        actors: Sequence[Actor],
        movers: npt.ArrayLike = (),
        velocities: npt.ArrayLike | None = None,
        tracked: Floats | None = None,
        gap: tuple[Point, Point] | None = None,
    ) -> Picture:
        """Return the picture (H, W, 3) with robots and movers, and a line across a gap between two points [m]."""
        places = np.asarray(movers, dtype=np.float64).reshape(-1, 2)
        frame, lidar = self._canvas.copy(), self._lidar_view
        if isinstance(lidar, OwnMapPainter):
            lidar.hatch_unknown(frame, self.backdrop, self.fine)
        boxes = self._boxes(actors, places)
        if lidar is not None:
            lidar.draw_beams(frame, self.backdrop)
            for label in self._labels:
                self._put_label(frame, *label)
        for rows, colour in zip(self._changing_route, (colours.ROUTE, colours.ROUTE, colours.WHITE), strict=True):
            self.backdrop.blend(frame, rows, colour, 0.85)
        if velocities is not None:
            self._draw_forecast(frame, places, np.asarray(velocities, dtype=np.float64).reshape(-1, 2))
        for actor in actors:
            self._draw_robot_shadow(frame, actor)
        for (x, y), radius in zip(places, self.scene.mover_radii, strict=True):
            disc = np.array([0.0, 0.0, radius])
            self._draw_shadow(frame, np.array([x, y, 0.0]), disc, drawn_height(self.scene))
        if isinstance(lidar, OwnMapPainter):
            lidar.draw_hits(frame, self.backdrop)
        self._draw_bodies(frame, actors, places, boxes)
        if tracked is not None:
            self._draw_tracked(frame, tracked)
        if gap is not None:
            half, height = 1.3 * self.camera.pixel, robot_height(self.scene.robot) / 2
            ends = np.array(gap)
            for wide, colour in ((2.2 * half, colours.WHITE), (half, colours.INK)):
                rows = np.vstack([capsules(ends[:1], ends[1:], wide), capsules(ends, ends, wide + 0.8 * half)])
                self.backdrop.blend(frame, rows, colour, 1.0, height=height)
        return frame

    def _draw_bodies(
        self, frame: Picture, actors: Sequence[Actor], movers: Floats, boxes: Sequence[Box | None]
    ) -> None:
        """Draw robots and movers; a robot shines through whatever covers it."""
        there = zip(self._mover_meshes, movers.tolist(), strict=True)
        bodies = [*(one.solids for one in actors), *([Solid(m, colours.MOVER, placed(x, y))] for m, (x, y) in there)]
        together = [
            (box, HIDDEN_OPACITY, 1.0, range(len(bodies))) for box in merged([b for b in boxes if b is not None])
        ]
        alone = [(box, 1.0, SHINES, (k,)) for k, box in enumerate(boxes[: len(actors)]) if box is not None]
        for box, ghost, strength, chosen in (*together, *alone):
            inside = [k for k in chosen if (b := boxes[k]) is not None and overlap(b, box)]
            drawn = draw_solids([one for k in inside for one in bodies[k]], self.camera, box, self.fine, self._light)
            kernels.put_bodies(frame, *drawn, self.backdrop.depth, box[0], box[1], self.fine, ghost, strength)

    def field_frame(self, grid: Grid, levels: Floats, paths: Iterable[tuple[Floats, Colour | None]]) -> Picture:
        """Return the picture (H, W, 3) without a robot: a planner's field on the ground, paths (N, 2) [m] in colours over it."""
        frame = self.backdrop.pixels.copy()
        tints = colours.field_colours(np.linspace(0, 1, 256))
        back, (x, y) = self.backdrop, grid.origin
        kernels.lay_field(frame, back.visible, back.inverse, np.ascontiguousarray(levels), x, y, grid.cell, tints)
        for k, (path, colour) in enumerate(paths):
            rows = capsules(path[:-1], path[1:], max(2.4 - 0.8 * k, 0.8) * self.camera.pixel)
            back.blend(frame, rows, colour or colours.SHELL, 1.0)
        for label in self._labels:
            self._put_label(frame, *label)
        return frame

    def add_label(self, sprite: Picture, x: float, y: float, reach: float) -> None:
        """Add an RGBA picture on the ground, below (or above) the disc of radius `reach` at x, y [m], to all frames."""
        self._labels.append((sprite, x, y, reach))
        self._put_on_ground(sprite, x, y, reach)

    def _put_on_ground(self, sprite: Picture, x: float, y: float, reach: float) -> None:
        for picture in (self.backdrop.pixels, self._canvas):
            self._put_label(picture, sprite, x, y, reach)

    def _put_label(self, frame: Picture, sprite: Picture, x: float, y: float, reach: float) -> None:
        height, width = self.backdrop.visible.shape
        high, wide = sprite.shape[:2]
        px = self.pixel(x, y)[0]
        turn = np.linspace(0, 2 * math.pi, 17)
        rim = self.camera.pixels(np.column_stack([x + reach * np.cos(turn), y + reach * np.sin(turn), 0 * turn]))[:, 1]
        top = rim.max() + 1 if rim.max() + 1 + high < height else rim.min() - 1 - high
        left = min(max(px - wide / 2, 0), width - wide) if -wide < px < width + wide else px
        put(frame, sprite, left, top)

    def pixel(self, x: float, y: float, z: float = 0.0) -> tuple[float, float]:
        """Return the column and row [px] at which a point of the world [m] appears."""
        at = self.camera.pixels([(x, y, z)])[0]
        return float(at[0]), float(at[1])

    def _render_still(self, camera: Camera, floor: Picture) -> Backdrop:
        """Render the static bodies that a camera sees on a floor (H, W, 3)."""
        width, height = camera.size
        seen = np.append(camera.sees(self._middles, self._reaches), True)
        box = (0, 0, width, height)
        kept = [(k, self._solids[k]) for k in np.flatnonzero(seen).tolist()]
        image, depth, seg = draw_solids(
            [one for _, one in kept], camera, box, self.fine, self._light, [k for k, _ in kept]
        )
        visible = np.empty((height, width), dtype=np.float32)
        kernels.put_on_floor(floor, visible, image, seg, self.fine)
        return Backdrop(camera, floor, visible, depth, seg)

    def _paint_trail(self, rows: Floats, tints: Floats) -> None:
        back = self.backdrop
        kernels.draw_trail(
            self._canvas, back.pixels, back.visible, self._painted, back.forward, back.inverse, rows, tints
        )

    def _draw_forecast(self, frame: Picture, places: Floats, velocities: Floats) -> None:
        """Draw each mover's path at constant velocity as a line with a dot every 0.5 s."""
        half = 1.1 * self.camera.pixel
        ahead = places + FORECAST * velocities
        moving = np.hypot(*velocities.T) > 0.01
        self.backdrop.blend(frame, capsules(places, ahead, half)[moving], colours.MOVER, 0.45)
        stops = [places + part * (ahead - places) for part in (1 / 3, 2 / 3, 1.0)]
        dots = np.vstack([capsules(stop, stop, 2.2 * half)[moving] for stop in stops])
        self.backdrop.blend(frame, dots, colours.MOVER, 0.75)

    def _draw_tracked(self, frame: Picture, tracked: Floats) -> None:
        """Draw a ring at each mover's estimated position, and its path at the estimated velocity."""
        half = 1.2 * self.camera.pixel
        rims = [ring(x, y, radius + RING_OFF, half) for x, y, _, _, radius in tracked]
        places, ahead = tracked[:, :2], tracked[:, :2] + FORECAST * tracked[:, 2:4]
        rows = [*rims, capsules(places, ahead, half)]
        self.backdrop.blend(frame, np.concatenate(rows), colours.TRACKED, 0.8, height=0.0)

    def _draw_robot_shadow(self, frame: Picture, actor: Actor) -> None:
        """Draw the soft shadow of a robot."""
        tall, foot, pose = robot_height(actor.robot), actor.robot.footprint, np.array(actor.pose)
        shape, place = np.array([foot.half_length, foot.half_width, foot.rounding]), pose
        if foot.corners:  # the shadow of the rectangle around it
            xmin, ymin, xmax, ymax = foot.bounds
            x, y, turn = (xmin + xmax) / 2, (ymin + ymax) / 2, np.exp(1j * pose[2])
            off = (x + 1j * y) * turn
            place = np.array([pose[0] + off.real, pose[1] + off.imag, pose[2]])
            shape = np.array([(xmax - xmin) / 2 - foot.rounding, (ymax - ymin) / 2 - foot.rounding, foot.rounding])
        self._draw_shadow(frame, place, shape, tall)

    def _draw_shadow(self, frame: Picture, pose: Floats, shape: Floats, tall: float) -> None:
        """Darken the ground beside a body, in its sun shadow, and below it, where it blocks the sky."""
        sun, soft, back = np.array(self._sun) * tall, SHADOW_BLUR + 0.3 * tall, self.backdrop
        for reach, blur, strength in ((sun, soft, 0.30), (np.zeros(2), float(0.5 * shape.sum()), 0.22)):
            kernels.shade_body(frame, back.visible, back.forward, back.inverse, pose, shape, reach, blur, strength)

    def _boxes(self, actors: Sequence[Actor], movers: Floats) -> list[Box | None]:
        """Return the pixel boxes of each robot and each mover; None outside the picture."""
        tall = drawn_height(self.scene)
        bodies = [
            (
                *one.pose[:2],
                1.05 * one.robot.footprint.radius,
                1.2 * max(robot_height(one.robot), 2.2 * one.robot.wheel_radius),
            )
            for one in actors
        ]
        bodies += [(mx, my, r, tall) for (mx, my), r in zip(movers, self.scene.mover_radii, strict=True)]
        corners = [
            (bx + i * radius, by + j * radius, z)
            for bx, by, radius, top in bodies
            for i in (-1, 1)
            for j in (-1, 1)
            for z in (0.0, top)
        ]
        at = self.camera.pixels(corners).reshape(-1, 8, 2)
        low = np.maximum(np.floor(at.min(axis=1)).astype(int) - 1, 0).tolist()
        high = np.minimum(np.ceil(at.max(axis=1)).astype(int) + 1, self.camera.size).tolist()
        return [(x0, y0, x1, y1) if x0 < x1 and y0 < y1 else None for (x0, y0), (x1, y1) in zip(low, high, strict=True)]


def drawn_height(scene: Scene) -> float:
    """Return the maximum drawn height of cylinders [m]; taller ones would hide the robot."""
    return max(0.3, 2.0 * robot_height(scene.robot))


def trail_width(scene: Scene, camera: Camera) -> float:
    """Return the width of the driven path [m]: a fraction of the robot's, at least four pixels."""
    return max(0.32 * scene.robot.footprint.radius, 4.0 * camera.pixel)


def still_solids(scene: Scene, tall: Floats) -> list[Solid]:
    """Return all static bodies: cylinders of heights `tall` (N,) [m], then the kerb."""
    width = kerb_width(scene)
    post, bounds = cylinder(1.0, 0.0, 1.0), join(*kerb(scene.bounds, width, 0.8 * width))
    rows = zip(scene.obstacles.tolist(), tall.tolist(), scene.unseen.tolist(), strict=True)
    posts = [
        Solid(post, colours.UNSEEN if unseen else colours.OBSTACLE, np.column_stack([np.diag([r, r, z]), [x, y, 0.0]]))
        for (x, y, r, _), z, unseen in rows
    ]
    return [*posts, Solid(bounds, colours.KERB, np.eye(3, 4))]


def _sun(camera: Camera) -> tuple[tuple[float, float], tuple[float, float, float]]:
    """Return the shadow's extent per metre of height and the direction to the lamp, left of the camera, in front."""
    right = camera.view[0, :3]
    ahead = np.array([-right[1], right[0], 0.0])
    reach = 0.55 * right + 0.28 * ahead
    lamp = -0.62 * right - 0.25 * ahead + np.array([0.0, 0.0, 0.74])
    lamp /= np.linalg.norm(lamp)
    return (float(reach[0]), float(reach[1])), (float(lamp[0]), float(lamp[1]), float(lamp[2]))
