"""Compositor of film frames: a static backdrop, rendered once, plus robot and movers in each frame.

The backdrop keeps its depth, so a frame costs only the pixels around robot and movers:
their meshes are drawn and blended in where they are nearer. A moving camera needs a new backdrop for every frame.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt
from PIL import Image

from antdrive.base.types import Floats
from antdrive.views import colours
from antdrive.views.film import _kernels_paint as kernels
from antdrive.views.film.camera import Camera, Picture
from antdrive.views.film.ground import capsules, dashes, kerb_width, paint_ground, ring
from antdrive.views.film.lidar_view import Backdrop, BeamPainter, OwnMapPainter
from antdrive.views.film.meshes import Part, cylinder, join, kerb, robot_height, robot_parts
from antdrive.views.film.solids import Box, Solid, draw_solids, merged, overlap, placed
from antdrive.views.film.text import glow, put
from antdrive.views.scene import Scene

if TYPE_CHECKING:
    from antdrive.worlds import Grid


HIDDEN_OPACITY = 0.16  # of a body behind a cylinder
SHADOW_BLUR = 0.05  # softness of the shadow of a flat body [m]
RING_OFF = 0.05  # distance of a ring from the surface of its tracked mover [m]
FORECAST = 1.5  # horizon of the movers' drawn motion [s]


class Compositor:
    """Compositor of the frames of one scene for one camera.

    >>> compositor = Compositor(scene, camera, route=rollout.route)
    >>> compositor.extend_trail(points, speeds)
    >>> picture = compositor.frame(pose, wheels)
    """

    def __init__(
        self, scene: Scene, camera: Camera, *, route: Floats, fine: int = 2, lidar_view: BeamPainter | None = None
    ) -> None:
        self.scene = scene
        self.camera = camera
        self.fine = fine
        self._lidar_view = lidar_view
        self.tall = np.minimum(scene.obstacles[:, 3], drawn_height(scene))
        self._route = np.ascontiguousarray(route, dtype=np.float64).reshape(-1, 2)
        self._sun, self._light = _sun(camera)
        self._trail_width = trail_width(scene, camera)
        self._trail: list[tuple[Floats, Floats]] = []
        self._labels: list[tuple[Picture, float, float, float]] = []
        self._changing_route = (np.empty((0, 5)), np.empty((0, 5)))  # dashes and dots, as capsules
        self._solids = still_solids(scene, self.tall)
        self._parts = robot_parts(scene.robot)
        self._mover_meshes = [cylinder(radius, 0.0, drawn_height(scene)) for radius in scene.mover_radii]
        self.set_camera(camera)

    def set_camera(self, camera: Camera) -> None:
        """Render the backdrop through a camera, with the labels and the trail so far."""
        self.camera = camera
        self.backdrop = self._render_still(camera)
        self._canvas = self.backdrop.pixels.copy()
        self._painted = np.zeros((*self.backdrop.visible.shape, 4), dtype=np.uint8)
        for label in self._labels:
            self._put_on_ground(*label)
        if self._trail:
            rows, tints = (np.concatenate(part) for part in zip(*self._trail, strict=True))
            ends = rows[:, :4].reshape(-1, 2, 2)
            middles = np.column_stack([ends.mean(axis=1), np.zeros(len(rows))])
            seen = camera.sees(middles, np.hypot(*(ends[:, 1] - ends[:, 0]).T) / 2 + self._trail_width)
            self._paint_trail(rows[seen], tints[seen])

    def extend_trail(self, points: Floats, speeds: npt.ArrayLike) -> None:
        """Extend the driven path along points (N, 2) [m], N >= 2, coloured by the speeds (N,) there [m/s]."""
        fraction = np.abs(np.asarray(speeds, dtype=np.float64)) / self.scene.robot.max_speed
        rows = capsules(points[:-1], points[1:], self._trail_width / 2)
        tints = colours.speed_colours((fraction[:-1] + fraction[1:]) / 2)
        self._trail.append((rows, tints))
        self._paint_trail(rows, tints)

    def show_route(self, route: Floats, replanned_at: Floats) -> None:
        """Replace the route of later frames."""
        width = 1.5 * self.camera.pixel
        self._changing_route = (dashes(route, width), capsules(replanned_at, replanned_at, 2.4 * width))

    def frame(
        self,
        pose: npt.ArrayLike,
        wheels: tuple[float, float] = (0.0, 0.0),
        movers: npt.ArrayLike = (),
        velocities: npt.ArrayLike | None = None,
        tracked: Floats | None = None,
    ) -> Picture:
        """Return the picture (H, W, 3) with robot and movers."""
        x, y, yaw = (float(value) for value in np.asarray(pose))
        places = np.asarray(movers, dtype=np.float64).reshape(-1, 2)
        frame = self._canvas.copy()
        if self._lidar_view is not None:
            if isinstance(self._lidar_view, OwnMapPainter):
                self._lidar_view.hatch_unknown(frame, self.backdrop, self.fine)
            self._lidar_view.draw_beams(frame, self.backdrop)
            for label in self._labels:
                self._put_label(frame, *label)
        for rows in self._changing_route:
            self.backdrop.blend(frame, rows, colours.ROUTE, 0.85)
        if velocities is not None:
            self._draw_forecast(frame, places, np.asarray(velocities, dtype=np.float64).reshape(-1, 2))
        self._draw_shadows(frame, np.array([x, y, yaw]), places)
        boxes = self._boxes(x, y, places)
        parts = [Solid(part.mesh, part.colour, placed(*part_pose(part, x, y, yaw, wheels))) for part in self._parts]
        at = [placed((px, py, 0.0), (0.0, 0.0, 0.0, 1.0)) for px, py in places.tolist()]
        movers_there = zip(self._mover_meshes, at, strict=True)
        bodies = [parts, *([Solid(mesh, colours.MOVER, place)] for mesh, place in movers_there)]
        for box in merged([b for b in boxes if b is not None]):
            inside = [body for body, b in zip(bodies, boxes, strict=True) if b is not None and overlap(b, box)]
            solids = [solid for body in inside for solid in body]
            drawn = draw_solids(solids, self.camera, box, self.fine, self._light)
            kernels.put_bodies(frame, *drawn, self.backdrop.depth, box[0], box[1], self.fine, HIDDEN_OPACITY)
        if isinstance(self._lidar_view, OwnMapPainter):
            self._lidar_view.draw_hits(frame, self.backdrop)
        if tracked is not None:
            self._draw_tracked(frame, tracked)
        return frame

    def field_frame(self, grid: Grid, levels: Floats, path: Floats) -> Picture:
        """Return the picture (H, W, 3) without a robot, with a planner's field on the ground and a path over it."""
        frame = self.backdrop.pixels.copy()
        tints = colours.field_colours(np.linspace(0, 1, 256))
        back, (x, y) = self.backdrop, grid.origin
        kernels.lay_field(frame, back.visible, back.inverse, np.ascontiguousarray(levels), x, y, grid.cell, tints)
        rows = capsules(path[:-1], path[1:], 1.6 * self.camera.pixel)
        back.blend(frame, rows, colours.SHELL, 1.0)
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
        rim = [self.pixel(x + reach * math.cos(a), y + reach * math.sin(a))[1] for a in turn]
        top = max(rim) + 1 if max(rim) + 1 + high < height else min(rim) - 1 - high
        left = min(max(px - wide / 2, 0), width - wide) if -wide < px < width + wide else px
        put(frame, sprite, left, top)

    def pixel(self, x: float, y: float, z: float = 0.0) -> tuple[float, float]:
        """Return the column and row [px] at which a point of the world [m] appears."""
        at = self.camera.pixels([(x, y, z)])[0]
        return float(at[0]), float(at[1])

    def _render_still(self, camera: Camera) -> Backdrop:
        width, height = camera.size
        image, depth, seg = draw_solids(self._solids, camera, (0, 0, width, height), self.fine, self._light)
        bare = Image.fromarray(np.where(seg < 0, np.uint8(255), np.uint8(0))).reduce(self.fine)
        visible = np.asarray(bare, dtype=np.float32) / np.float32(255)
        rgb = paint_ground(camera, self.scene, self._route, visible > 0, self.tall, self._sun)
        bodies = np.asarray(Image.fromarray(image).reduce(self.fine))
        pixels = np.empty_like(bodies)
        for k in range(3):
            pixels[..., k] = np.minimum(rgb[..., k] * visible + bodies[..., k] + 0.5, 255)
        return Backdrop(camera, pixels, visible, depth, seg)

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
        self.backdrop.blend(frame, np.concatenate(rows), colours.TRACKED, 0.8, over=True)

    def _draw_shadows(self, frame: Picture, pose: Floats, movers: Floats) -> None:
        """Draw the soft shadows of robot and movers, and a glow around a robot that is small in the picture."""
        tall, foot = robot_height(self.scene.robot), self.scene.robot.footprint
        shape, place = np.array([foot.half_length, foot.half_width, foot.rounding]), pose
        if foot.corners:  # the shadow of the rectangle around it
            xmin, ymin, xmax, ymax = foot.bounds
            x, y, turn = (xmin + xmax) / 2, (ymin + ymax) / 2, np.exp(1j * pose[2])
            off = (x + 1j * y) * turn
            place = np.array([pose[0] + off.real, pose[1] + off.imag, pose[2]])
            shape = np.array([(xmax - xmin) / 2 - foot.rounding, (ymax - ymin) / 2 - foot.rounding, foot.rounding])
        self._draw_shadow(frame, place, shape, tall)
        if has_glow(self.scene, self.camera):
            px, py = self.pixel(pose[0], pose[1], tall / 2)
            wide = round(2 * foot.radius / self.camera.pixel)
            halo = glow(2 * wide + round(0.02 * frame.shape[1]), colours.SHELL)
            put(frame, halo, px - len(halo) / 2, py - len(halo) / 2)
        for (x, y), radius in zip(movers, self.scene.mover_radii, strict=True):
            disc = np.array([0.0, 0.0, radius])
            self._draw_shadow(frame, np.array([x, y, 0.0]), disc, drawn_height(self.scene))

    def _draw_shadow(self, frame: Picture, pose: Floats, shape: Floats, tall: float) -> None:
        """Darken the ground beside a body, in its sun shadow, and below it, where it blocks the sky."""
        sun, soft, back = np.array(self._sun) * tall, SHADOW_BLUR + 0.3 * tall, self.backdrop
        for reach, blur, strength in ((sun, soft, 0.30), (np.zeros(2), float(0.5 * shape.sum()), 0.22)):
            kernels.shade_body(frame, back.visible, back.forward, back.inverse, pose, shape, reach, blur, strength)

    def _boxes(self, x: float, y: float, movers: Floats) -> list[Box | None]:
        """Return the pixel boxes of the robot and each mover; None outside the picture."""
        tall = drawn_height(self.scene)
        robot = self.scene.robot
        bodies = [(x, y, 1.05 * robot.footprint.radius, 1.2 * max(robot_height(robot), 2.2 * robot.wheel_radius))]
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


def has_glow(scene: Scene, camera: Camera) -> bool:
    """Return whether the robot is so small in the picture that a glow surrounds it."""
    return round(2 * scene.robot.footprint.radius / camera.pixel) < 0.05 * camera.size[0]


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


def part_pose(
    part: Part, x: float, y: float, yaw: float, wheels: tuple[float, float]
) -> tuple[tuple[float, float, float], tuple[float, float, float, float]]:
    """Return position [m] and quaternion of a part of the robot at a pose with wheel angles [rad]."""
    cosine, sine = math.cos(yaw), math.sin(yaw)
    ax, ay, az = part.axle
    angle = 0.0 if part.wheel == 0 else wheels[0] if part.wheel > 0 else wheels[1]
    cy, sy, ca, sa = math.cos(yaw / 2), math.sin(yaw / 2), math.cos(angle / 2), math.sin(angle / 2)
    at = (x + cosine * ax - sine * ay, y + sine * ax + cosine * ay, az)
    return at, (-sy * sa, cy * sa, sy * ca, cy * ca)


def _sun(camera: Camera) -> tuple[tuple[float, float], tuple[float, float, float]]:
    """Return the shadow's extent per metre of height and the direction to the lamp, left of the camera, in front."""
    right = camera.view[0, :3]
    ahead = np.array([-right[1], right[0], 0.0])
    reach = 0.55 * right + 0.28 * ahead
    lamp = -0.62 * right - 0.25 * ahead + np.array([0.0, 0.0, 0.74])
    lamp /= np.linalg.norm(lamp)
    return (float(reach[0]), float(reach[1])), (float(lamp[0]), float(lamp[1]), float(lamp[2]))
