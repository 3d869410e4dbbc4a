"""Drawing of bodies: ray casting of static cylinders and boxes, rasterisation of moving meshes."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple, TypeAlias

import numpy as np

from antdrive.base.types import Floats, Ints
from antdrive.views.colours import Colour
from antdrive.views.film import _kernels_raycast as casting
from antdrive.views.film import _kernels_triangles as triangles
from antdrive.views.film.camera import Camera
from antdrive.views.film.meshes import Mesh

Box: TypeAlias = tuple[int, int, int, int]  # x0, y0, x1, y1 [px]; x1 and y1 are excluded

AMBIENT, DIFFUSE = 0.62, 0.46  # strength of ambient light and of the lamp


@dataclass(frozen=True, eq=False)
class Solids:
    """Cylinders on the ground and axis-aligned boxes."""

    cylinders: Floats  # x, y, radius and height of each (N, 4) [m]
    cylinder_colours: Floats  # red, green, blue of each (N, 3), 0 to 255
    boxes: Floats  # x0, y0, z0, x1, y1, z1 of each (M, 6) [m]
    box_colours: Floats  # red, green, blue of each (M, 3), 0 to 255

    @classmethod
    def of(cls, cylinders: Floats, colours: list[Colour], boxes: Floats, box_colour: Colour) -> Solids:
        """Build from cylinders (N, 4) with a colour each and boxes (M, 6) of one colour."""
        tints = np.array(colours, dtype=np.float64).reshape(-1, 3)
        box_tints = np.tile(np.array(box_colour, dtype=np.float64), (len(boxes), 1))
        return cls(np.ascontiguousarray(cylinders), tints, boxes, box_tints)

    def render(self, camera: Camera, fine: int, light: tuple[float, float, float]) -> tuple[Any, Any, Any]:
        """Render picture (h, w, 4), depth (h, w) and body indices (h, w), -1 for none."""
        width, height = camera.size
        image, depth, seg = _blank(width * fine, height * fine, 4)
        turn, projection = camera.view[:3, :3], camera.projection
        eye, scale, lamp = -turn.T @ camera.view[:3, 3], _depth_and_light(camera), np.array(light)
        across, down = 2 / width / projection[0, 0], -2 / height / projection[1, 1]
        lens = np.array([[across, 0, -across * width / 2], [0, down, -down * height / 2], [0, 0, -1.0]])
        rays = np.ascontiguousarray(turn.T @ lens)
        x, y, radius, tall = self.cylinders.T
        around = np.column_stack([x - radius, y - radius, 0 * x, x + radius, y + radius, tall])
        for cast, bodies, boxes, tints, first in (
            (casting.cast_cylinders, self.cylinders, around, self.cylinder_colours, 0),
            (casting.cast_boxes, self.boxes, self.boxes, self.box_colours, len(self.cylinders)),
        ):
            cast(image, depth, seg, fine, eye, rays, scale, lamp, bodies, _spans(camera, boxes), tints, first)
        return image, depth, seg


def _blank(wide: int, high: int, channels: int) -> tuple[Any, Any, Any]:
    """Return an empty picture with depth 1 and body indices -1."""
    image = np.zeros((high, wide, channels), dtype=np.uint8)
    return image, np.ones((high, wide), dtype=np.float32), np.full((high, wide), -1, dtype=np.int32)


def _depth_and_light(camera: Camera) -> Floats:
    """Return the coefficients of the depth in clip space and the strengths of the light (4,)."""
    projection = camera.projection
    return np.array([(1 - projection[2, 2]) / 2, projection[2, 3] / 2, AMBIENT, DIFFUSE])


def _spans(camera: Camera, boxes: Floats) -> Ints:
    """Return the pixel bounds x0, y0, x1, y1 (N, 4) of each box; empty outside the picture."""
    points = boxes[:, [(i, 1 + j, 2 + k) for i in (0, 3) for j in (0, 3) for k in (0, 3)]]  # (N, 8, 3)
    clip = np.concatenate([points, np.ones((*points.shape[:2], 1))], axis=2) @ camera.full.T
    with np.errstate(divide="ignore", invalid="ignore"):
        at = clip[..., :2] / clip[..., 3:]
    size = np.array(camera.size)
    at = (1 + at * [1, -1]) * size / 2
    low, high = np.floor(at.min(axis=1)) - 1, np.ceil(at.max(axis=1)) + 1
    partly_behind = (clip[..., 3] <= 0).any(axis=1)  # such corners have no projection: take all pixels
    low[partly_behind], high[partly_behind] = 0, size
    behind = (clip[..., 3] <= 0).all(axis=1)
    low[behind], high[behind] = 0, 0
    spans = np.hstack([np.clip(low, 0, size), np.clip(high, 0, size)])
    return spans.astype(np.int64)


class Solid(NamedTuple):
    """Mesh of one colour at a pose."""

    mesh: Mesh
    colour: Colour
    place: Floats  # rotation and, in the last column, position (3, 4) [m]


def placed(at: tuple[float, float, float], quaternion: tuple[float, float, float, float]) -> Floats:
    """Return the transform (3, 4) of a rotation followed by a translation."""
    x, y, z, w = quaternion
    return np.array(
        [
            (1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w), at[0]),
            (2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w), at[1]),
            (2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y), at[2]),
        ]
    )


def draw_solids(
    solids: list[Solid], camera: Camera, box: Box, fine: int, light: tuple[float, float, float]
) -> tuple[Any, Any, Any]:
    """Draw picture (h, w, 3), depth (h, w) and body mask (h, w): 0 for a body, -1 for none."""
    x0, y0, x1, y1 = box
    target = _blank((x1 - x0) * fine, (y1 - y0) * fine, 3)
    (width, height), full = camera.size, camera.full
    ahead = full[3]
    lens = np.array(
        [
            fine * (0.5 * width * (ahead + full[0]) - x0 * ahead),
            fine * (0.5 * height * (ahead - full[1]) - y0 * ahead) - ahead,  # samples are at lower left corners
            ahead,
        ]
    )
    common = (lens, _depth_and_light(camera), np.array(light))
    for mesh, colour, place in solids:
        tint = np.array(colour, dtype=np.float64)
        triangles.draw_mesh(*target, *common, place, mesh.vertices, mesh.normals, mesh.triangles, tint)
    return target


def overlap(a: Box, b: Box) -> bool:
    """Return whether two boxes share a pixel."""
    return a[0] < b[2] and b[0] < a[2] and a[1] < b[3] and b[1] < a[3]


def merged(boxes: list[Box]) -> list[Box]:
    """Join overlapping boxes: bodies that may hide each other are drawn together, every pixel once."""
    done: list[Box] = []
    for box in boxes:
        while True:
            hit = next((b for b in done if overlap(b, box)), None)
            if hit is None:
                break
            done.remove(hit)
            box = (min(hit[0], box[0]), min(hit[1], box[1]), max(hit[2], box[2]), max(hit[3], box[3]))
        done.append(box)
    return done
