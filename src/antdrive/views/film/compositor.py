"""Compose the pictures of a film: everything that stands still is rendered once; each frame adds robot and movers.

PyBullet's TinyRenderer draws the bodies that stand still. This backdrop keeps its depth, so a frame costs only the
pixels around the robot and the movers: a kernel draws these as TinyRenderer would, and they are blended in where they
are nearer than the backdrop. A camera that moves needs a new backdrop in every frame; ray casting draws it faster
than TinyRenderer.
"""

from __future__ import annotations

import contextlib
import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from antdrive.sim.physics.bullet import bullet, client
from antdrive.views.film import _kernels_paint as kernels
from antdrive.views.film.camera import Camera
from antdrive.views.film.ground import dashes, kerb_width, paint_ground
from antdrive.views.film.meshes import Mesh, Part, cylinder, join, kerb, robot_height, robot_parts
from antdrive.views.film.raycast import Solids
from antdrive.views.film.sight import FanPainter, SightPainter
from antdrive.views.film.text import glow
from antdrive.views.film.tiny_renderer import Box, add_mesh, merged, overlap, render
from antdrive.views.film.triangles import Solid, draw_solids, placed
from antdrive.views.scene import Scene
from antdrive.views.style import (
    FOLLOWED,
    KERB,
    MOVER,
    OBSTACLE,
    ROUTE,
    SHELL,
    UNSEEN,
    Colour,
    field_colours,
    speed_colours,
)

if TYPE_CHECKING:
    from antdrive.worlds import Grid

Floats = npt.NDArray[np.float64]
Picture = npt.NDArray[np.uint8]  # (H, W, 3)

HIDDEN_OPACITY = 0.16  # of a robot behind a cylinder, so that it is never lost
SHADOW_BLUR = 0.05  # softness of the shadow of a flat body [m]
MANY, FEW_SIDES = 1000, 12  # in worlds of more cylinders, which look small, each is drawn with few sides
RING_SIDES, RING_OFF = 32, 0.05  # of the ring around a mover that is followed, and how far off its surface [m]
FORECAST = 1.5  # how far ahead the motion of movers is drawn [s]


@dataclass(frozen=True, eq=False)
class Backdrop:
    """What a camera sees of everything that stands still.

    Attributes:
        camera: the camera
        pixels: the picture (H, W, 3)
        visible: the fraction of each pixel that shows ground (H, W)
        depth: depth of the bodies in clip space, 1 where there is none, at the resolution they were rendered in
        bodies: at the same resolution the number of the obstacle in sight, -1 for ground; empty where none is painted pale
    """

    camera: Camera
    pixels: Picture
    visible: npt.NDArray[np.float32]
    depth: npt.NDArray[np.float32]
    bodies: npt.NDArray[np.int32]


class Compositor:
    """Draws frames of one scene for one camera. Use it in a `with` block.

    >>> with Compositor(scene, camera, route=rollout.route) as compositor:
    ...     compositor.extend_trail(points, speeds)
    ...     picture = compositor.frame(pose, wheels)
    """

    def __init__(
        self,
        scene: Scene,
        camera: Camera,
        *,
        route: Floats,
        fine: int = 2,
        moving_camera: bool = False,
        sight: FanPainter | None = None,
    ) -> None:
        self.scene = scene
        self.camera = camera
        self.fine = fine
        self._moving_camera, self._sight = moving_camera, sight
        self.tall = np.minimum(scene.obstacles[:, 3], drawn_height(scene))
        self._route = np.ascontiguousarray(route, dtype=np.float64).reshape(-1, 2)
        self._sun, self._light = _sun(camera)
        self._trail_width = trail_width(scene, camera)
        self._trail: list[tuple[Floats, Floats]] = []
        self._labels: list[tuple[Picture, float, float, float]] = []
        self._changing_route = (np.empty((0, 5)), np.empty((0, 5)))  # dashes and dots, as capsules
        self._open = contextlib.ExitStack()

    def __enter__(self) -> Compositor:
        self._still = self._open.enter_context(client())
        self._meshes = still_meshes(self.scene, self.tall)
        self._solids = still_solids(self._meshes, self.scene, self.tall)
        balls = [mesh.ball for mesh, _ in self._meshes]
        self._centres = np.array([centre for centre, _ in balls])
        self._radii = np.array([radius for _, radius in balls])
        self._loaded = np.zeros(len(balls), dtype=np.bool_)
        self._parts = robot_parts(self.scene.robot)
        tall = drawn_height(self.scene)
        self._mover_meshes = [cylinder(radius, 0.0, tall) for radius in self.scene.mover_radii]
        self.set_camera(self.camera)
        return self

    def __exit__(self, *_: object) -> None:
        self._open.close()

    def set_camera(self, camera: Camera) -> None:
        """Render the backdrop through a camera, with the labels and the trail so far."""
        self.camera = camera
        self.backdrop = self._render_still(camera)
        self._forward = camera.ground
        self._inverse = np.linalg.inv(self._forward)
        height, width = self.backdrop.visible.shape
        self._canvas = self.backdrop.pixels.copy()
        self._painted = np.zeros((height, width, 4), dtype=np.uint8)
        for label in self._labels:
            self._put_on_ground(*label)
        if self._trail:
            rows, colours = (np.concatenate(part) for part in zip(*self._trail, strict=True))
            ends = rows[:, :4].reshape(-1, 2, 2)
            middles = np.column_stack([ends.mean(axis=1), np.zeros(len(rows))])
            seen = camera.sees(middles, np.hypot(*(ends[:, 1] - ends[:, 0]).T) / 2 + self._trail_width)
            self._paint_trail(rows[seen], colours[seen])

    def extend_trail(self, points: Floats, speeds: npt.ArrayLike) -> None:
        """Continue the driven path along points (N, 2) [m], N >= 2, coloured by the speeds (N,) there [m/s]."""
        share = np.abs(np.asarray(speeds, dtype=np.float64)) / self.scene.robot.max_speed
        half = np.full(len(points) - 1, self._trail_width / 2)
        rows = np.ascontiguousarray(np.column_stack([points[:-1], points[1:], half]))
        colours = speed_colours((share[:-1] + share[1:]) / 2)
        self._trail.append((rows, colours))
        self._paint_trail(rows, colours)

    def show_route(self, route: Floats, replanned_at: Floats) -> None:
        """Replace the route that later frames show."""
        half = 1.5 * self.camera.pixel
        dots = np.column_stack([replanned_at, replanned_at, np.full(len(replanned_at), 2.4 * half)])
        self._changing_route = (dashes(route, 7 * half, 5 * half, 0.9 * half), np.ascontiguousarray(dots))

    def frame(
        self,
        pose: npt.ArrayLike,
        wheels: tuple[float, float] = (0.0, 0.0),
        movers: npt.ArrayLike = (),
        velocities: npt.ArrayLike | None = None,
        followed: Floats | None = None,
    ) -> Picture:
        """The picture (H, W, 3) with robot and movers."""
        x, y, yaw = (float(value) for value in np.asarray(pose))
        places = np.asarray(movers, dtype=np.float64).reshape(-1, 2)
        frame = self._canvas.copy()
        if self._sight is not None:
            if isinstance(self._sight, SightPainter):
                self._sight.cover(frame, self.backdrop, self._inverse, self.fine)
            self._sight.lay_fan(frame, self.backdrop, self._forward, self._inverse)
            for label in self._labels:
                self._put_label(frame, *label)
        for rows in self._changing_route:
            self._blend(frame, rows, ROUTE, 0.85)
        if velocities is not None:
            self._draw_forecast(frame, places, np.asarray(velocities, dtype=np.float64).reshape(-1, 2))
        self._draw_shadows(frame, np.array([x, y, yaw]), places)
        boxes = self._boxes(x, y, places)
        bodies = [self._robot_at(x, y, yaw, wheels), *self._movers_at(places)]
        for box in merged([b for b in boxes if b is not None]):
            inside = [body for body, b in zip(bodies, boxes, strict=True) if b is not None and overlap(b, box)]
            self._put_bodies(frame, box, [solid for body in inside for solid in body])
        if isinstance(self._sight, SightPainter):
            self._sight.put_hits(frame, self.backdrop)
        if followed is not None:
            self._draw_followed(frame, followed)
        return frame

    def field_frame(self, grid: Grid, levels: Floats, path: Floats) -> Picture:
        """The picture (H, W, 3) without a robot, with a planner's field on the ground and a path over it."""
        frame = self.backdrop.pixels.copy()
        tints = field_colours(np.linspace(0, 1, 256))
        visible, (x, y) = self.backdrop.visible, grid.origin
        kernels.lay_field(frame, visible, self._inverse, np.ascontiguousarray(levels), x, y, grid.cell, tints)
        half = np.full(max(0, len(path) - 1), 1.6 * self.camera.pixel)
        rows = np.ascontiguousarray(np.column_stack([path[:-1], path[1:], half]))
        painted = np.zeros((*visible.shape, 4), dtype=np.uint8)
        colours = np.tile(np.array(SHELL, dtype=np.float64), (len(rows), 1))
        kernels.draw_trail(frame, frame.copy(), visible, painted, self._forward, self._inverse, rows, colours)
        for sprite, x, y, reach in self._labels:
            self._put_label(frame, sprite, x, y, reach)
        return frame

    def add_label(self, sprite: Picture, x: float, y: float, reach: float) -> None:
        """Put an RGBA picture on the ground for good, below (or above) the disc of radius `reach` at x, y [m]."""
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
        kernels.put_sprite(frame, sprite, round(left), round(top), 1.0)

    def pixel(self, x: float, y: float, z: float = 0.0) -> tuple[float, float]:
        """Where a point of the world [m] appears: column and row [px]."""
        at = self.camera.pixels([(x, y, z)])[0]
        return float(at[0]), float(at[1])

    def _load(self, chosen: npt.NDArray[np.bool_]) -> None:
        """Have exactly these meshes in the client; the renderer spends time on meshes out of sight, too."""
        if (chosen == self._loaded).all():
            return
        bullet().resetSimulation(physicsClientId=self._still)
        for mesh, colour in merged_by_colour([self._meshes[k] for k in np.flatnonzero(chosen)]):
            add_mesh(self._still, mesh, colour)
        self._loaded = chosen

    def _render_still(self, camera: Camera) -> Backdrop:
        if self._moving_camera:
            image, depth, seg = self._solids.render(camera, self.fine, self._light)
        else:
            self._load(camera.sees(self._centres, self._radii))
            image, depth, seg = render(self._still, camera, None, self.fine, self._light)
        bodies = np.empty((0, 0), dtype=np.int32)
        if isinstance(self._sight, SightPainter):  # TinyRenderer draws many obstacles as one body
            bodies = seg if self._moving_camera else self._solids.render(camera, self.fine, self._light)[2]
        width, height = camera.size
        visible = np.empty((height, width), dtype=np.float32)
        ground = np.empty((height, width), dtype=np.bool_)
        kernels.count_ground(seg, self.fine, visible, ground)
        depth[seg < 0] = 1.0
        rgb = paint_ground(camera, self.scene, self._route, ground, self.tall, self._sun)
        pixels = np.empty((height, width, 3), dtype=np.uint8)
        kernels.resolve(rgb, image, seg, self.fine, visible, pixels)
        return Backdrop(camera, pixels, visible, depth, bodies)

    def _paint_trail(self, rows: Floats, colours: Floats) -> None:
        visible = self.backdrop.visible
        kernels.draw_trail(
            self._canvas,
            self.backdrop.pixels,
            visible,
            self._painted,
            self._forward,
            self._inverse,
            rows,
            colours,
        )

    def _draw_forecast(self, frame: Picture, places: Floats, velocities: Floats) -> None:
        """Draw a line from each mover to where it will be at constant velocity, with a dot at each half second."""
        half = 1.1 * self.camera.pixel
        ahead = places + FORECAST * velocities
        lines = np.column_stack([places, ahead, np.full(len(places), half)])
        stops = [places + share * (ahead - places) for share in (1 / 3, 2 / 3, 1.0)]
        moving = np.hypot(*velocities.T) > 0.01
        dots = np.vstack([np.column_stack([stop, stop, np.full(len(stop), 2.2 * half)])[moving] for stop in stops])
        for rows, strength in ((lines[moving], 0.45), (dots, 0.75)):
            self._blend(frame, np.ascontiguousarray(rows), MOVER, strength)

    def _draw_followed(self, frame: Picture, followed: Floats) -> None:
        """Draw a ring where the robot believes a mover to be, and a line to where it will be at the estimated velocity."""
        turn = np.linspace(0, 2 * math.pi, RING_SIDES + 1)
        half = 1.2 * self.camera.pixel
        circle = np.column_stack([np.cos(turn), np.sin(turn)])
        rims = [np.array([x, y]) + (radius + RING_OFF) * circle for x, y, _, _, radius in followed]
        rows = [np.column_stack([rim[:-1], rim[1:], np.full(RING_SIDES, half)]) for rim in rims]
        ahead = followed[:, :2] + FORECAST * followed[:, 2:4]
        rows.append(np.column_stack([followed[:, :2], ahead, np.full(len(followed), half)]))
        everywhere = np.ones_like(self.backdrop.visible)
        lines, tint = np.ascontiguousarray(np.concatenate(rows)), np.array(FOLLOWED, dtype=np.float64)
        kernels.blend_capsules(frame, everywhere, self._forward, self._inverse, lines, tint, 0.8)

    def _blend(self, frame: Picture, rows: Floats, colour: Colour, strength: float) -> None:
        """Blend capsules (N, 5) of one colour into the ground."""
        tint = np.array(colour, dtype=np.float64)
        kernels.blend_capsules(frame, self.backdrop.visible, self._forward, self._inverse, rows, tint, strength)

    def _draw_shadows(self, frame: Picture, pose: Floats, movers: Floats) -> None:
        """Draw the soft shadows of robot and movers, and a glow under a robot that is small in the picture."""
        tall, foot = robot_height(self.scene.robot), self.scene.robot.footprint
        shape, place = np.array([foot.half_length, foot.half_width, foot.rounding]), pose
        if foot.corners:  # the shadow of the rectangle around it
            xmin, ymin, xmax, ymax = foot.bounds
            x, y, turn = (xmin + xmax) / 2, (ymin + ymax) / 2, np.exp(1j * pose[2])
            off = (x + 1j * y) * turn
            place = np.array([pose[0] + off.real, pose[1] + off.imag, pose[2]])
            shape = np.array([(xmax - xmin) / 2 - foot.rounding, (ymax - ymin) / 2 - foot.rounding, foot.rounding])
        self._draw_shadow(frame, place, shape, tall, SHADOW_BLUR + 0.3 * tall)
        wide = round(2 * foot.radius / self.camera.pixel)
        if wide < 0.05 * frame.shape[1]:
            px, py = self.pixel(pose[0], pose[1], tall / 2)
            halo = glow(2 * wide + round(0.02 * frame.shape[1]), SHELL)
            kernels.put_sprite(frame, halo, round(px - len(halo) / 2), round(py - len(halo) / 2), 1.0)
        for (x, y), radius in zip(movers, self.scene.mover_radii, strict=True):
            tall = drawn_height(self.scene)
            disc = np.array([0.0, 0.0, radius])
            self._draw_shadow(frame, np.array([x, y, 0.0]), disc, tall, SHADOW_BLUR + 0.3 * tall)

    def _draw_shadow(self, frame: Picture, pose: Floats, shape: Floats, tall: float, soft: float) -> None:
        """Darken the ground beside a body, where it keeps off the sun, and below it, where it keeps off the sky."""
        sun = np.array(self._sun) * tall
        for reach, blur, strength in ((sun, soft, 0.30), (np.zeros(2), 0.5 * shape.sum(), 0.22)):
            kernels.shade_body(
                frame,
                self.backdrop.visible,
                self._forward,
                self._inverse,
                pose,
                shape,
                reach,
                float(blur),
                strength,
            )

    def _robot_at(self, x: float, y: float, yaw: float, wheels: tuple[float, float]) -> list[Solid]:
        poses = [(part, part_pose(part, x, y, yaw, wheels)) for part in self._parts]
        return [Solid(part.mesh, part.colour, placed(*pose)) for part, pose in poses]

    def _movers_at(self, places: Floats) -> list[list[Solid]]:
        turn = (0.0, 0.0, 0.0, 1.0)
        return [
            [Solid(mesh, MOVER, placed((x, y, 0.0), turn))]
            for mesh, (x, y) in zip(self._mover_meshes, places.tolist(), strict=True)
        ]

    def _boxes(self, x: float, y: float, movers: Floats) -> list[Box | None]:
        """The pixels that the robot and each mover may cover; None for one that is out of sight."""
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

    def _put_bodies(self, frame: Picture, box: Box, solids: list[Solid]) -> None:
        """Draw bodies within a box and blend them into the frame."""
        image, depth, seg = draw_solids(solids, self.camera, box, self.fine, self._light)
        kernels.put_bodies(frame, image, depth, seg, self.backdrop.depth, box[0], box[1], self.fine, HIDDEN_OPACITY)


def drawn_height(scene: Scene) -> float:
    """The tallest that cylinders are drawn [m]: taller ones would hide the robot."""
    return max(0.3, 2.0 * robot_height(scene.robot))


def trail_width(scene: Scene, camera: Camera) -> float:
    """The width of the driven path [m]: a fraction of the robot's, and at least four pixels."""
    return max(0.32 * scene.robot.footprint.radius, 4.0 * camera.pixel)


def still_meshes(scene: Scene, tall: Floats) -> list[tuple[Mesh, Colour]]:
    """Everything that stands still as coloured meshes: the kerb in pieces, and cylinders of heights `tall` (N,) [m]."""
    width = kerb_width(scene)
    found = [(mesh, KERB) for mesh in kerb(scene.bounds, width, 0.8 * width)]
    many = len(scene.obstacles) > MANY
    rough = cylinder(1.0, 0.0, 1.0, sides=FEW_SIDES)
    for (x, y, radius, _), z, unseen in zip(scene.obstacles, tall, scene.unseen, strict=True):
        if many:
            mesh = replace(rough, vertices=rough.vertices * (radius, radius, z) + (x, y, 0.0))
        else:
            mesh = cylinder(radius, 0.0, float(z), x=x, y=y)
        found.append((mesh, UNSEEN if unseen else OBSTACLE))
    return found


def still_solids(meshes: list[tuple[Mesh, Colour]], scene: Scene, tall: Floats) -> Solids:
    """Everything that stands still as boxes and cylinders, for ray casting."""
    kerbs = [mesh.vertices for mesh, colour in meshes if colour == KERB]
    boxes = np.array([np.concatenate([corners.min(axis=0), corners.max(axis=0)]) for corners in kerbs])
    cylinders = np.column_stack([scene.obstacles[:, :3], tall])
    return Solids.of(cylinders, [UNSEEN if unseen else OBSTACLE for unseen in scene.unseen], boxes, KERB)


def merged_by_colour(meshes: list[tuple[Mesh, Colour]]) -> list[tuple[Mesh, Colour]]:
    """The meshes, up to 400 of one colour joined to one: PyBullet takes at most 131072 vertices per mesh."""
    found = []
    for colour in dict.fromkeys(colour for _, colour in meshes):
        alike = [mesh for mesh, c in meshes if c == colour]
        found += [(join(*alike[i : i + 400]), colour) for i in range(0, len(alike), 400)]
    return found


def part_pose(
    part: Part, x: float, y: float, yaw: float, wheels: tuple[float, float]
) -> tuple[tuple[float, float, float], tuple[float, float, float, float]]:
    """Position [m] and orientation (quaternion) of a part of the robot at a pose with its wheels turned [rad]."""
    cosine, sine = math.cos(yaw), math.sin(yaw)
    ax, ay, az = part.axle
    angle = 0.0 if part.wheel == 0 else wheels[0] if part.wheel > 0 else wheels[1]
    cy, sy, ca, sa = math.cos(yaw / 2), math.sin(yaw / 2), math.cos(angle / 2), math.sin(angle / 2)
    at = (x + cosine * ax - sine * ay, y + sine * ax + cosine * ay, az)
    return at, (-sy * sa, cy * sa, sy * ca, cy * ca)


def _sun(camera: Camera) -> tuple[tuple[float, float], tuple[float, float, float]]:
    """How far shadows reach per metre of height, and the direction to the lamp: left of the camera, in front."""
    right = camera.view[0, :3]
    ahead = np.array([-right[1], right[0], 0.0])
    reach = 0.55 * right + 0.28 * ahead
    lamp = -0.62 * right - 0.25 * ahead + np.array([0.0, 0.0, 0.74])
    lamp /= np.linalg.norm(lamp)
    return (float(reach[0]), float(reach[1])), (float(lamp[0]), float(lamp[1]), float(lamp[2]))
