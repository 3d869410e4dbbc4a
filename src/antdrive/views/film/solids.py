"""Drawing of bodies: rasterisation of meshes."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import Any, NamedTuple, TypeAlias

import numpy as np

from antdrive.base.types import Floats
from antdrive.views.colours import Colour
from antdrive.views.film import _kernels_triangles as triangles
from antdrive.views.film.camera import Camera
from antdrive.views.film.meshes import Mesh

Box: TypeAlias = tuple[int, int, int, int]  # x0, y0, x1, y1 [px]; x1 and y1 are excluded

AMBIENT, DIFFUSE = 0.62, 0.46  # strength of ambient light and of the lamp


class Solid(NamedTuple):
    """Mesh of one colour at a pose."""

    mesh: Mesh
    colour: Colour
    place: Floats  # rotation and, in the last column, position (3, 4) [m]


def placed(x: float, y: float, yaw: float = 0.0) -> Floats:
    """Return the transform (3, 4) to a pose on the ground."""
    cosine, sine = math.cos(yaw), math.sin(yaw)
    return np.array([(cosine, -sine, 0.0, x), (sine, cosine, 0.0, y), (0.0, 0.0, 1.0, 0.0)])


def draw_solids(
    solids: Sequence[Solid],
    camera: Camera,
    box: Box,
    fine: int,
    light: tuple[float, float, float],
    numbers: Iterable[int] | None = None,
) -> tuple[Any, Any, Any]:
    """Draw picture (h, w, 3), depth (h, w), 1 for ground, and the visible solid's number, or index, (h, w), -1 for none."""
    x0, y0, x1, y1 = box
    high, wide = (y1 - y0) * fine, (x1 - x0) * fine
    image = np.zeros((high, wide, 3), dtype=np.uint8)
    target = image, np.ones((high, wide), dtype=np.float32), np.full((high, wide), -1, dtype=np.int32)
    (width, height), full, projection = camera.size, camera.full, camera.projection
    ahead = full[3]
    lens = np.array(
        [
            fine * (0.5 * width * (ahead + full[0]) - x0 * ahead),
            fine * (0.5 * height * (ahead - full[1]) - y0 * ahead) - ahead,  # samples are at lower left corners
            ahead,
        ]
    )
    scale = np.array([(1 - projection[2, 2]) / 2, projection[2, 3] / 2, AMBIENT, DIFFUSE])
    common = lens, scale, np.array(light)
    for number, (mesh, colour, place) in zip(numbers or range(len(solids)), solids, strict=True):
        tint = np.array(colour, dtype=np.float64)
        triangles.draw_mesh(*target, *common, place, mesh.vertices, mesh.normals, mesh.triangles, tint, number)
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
