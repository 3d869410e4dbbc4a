"""Meshes drawn as TinyRenderer draws them, without its cost for each call and each body."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from antdrive.views.film import _kernels_triangles as kernels
from antdrive.views.film.camera import Camera
from antdrive.views.film.meshes import Mesh
from antdrive.views.film.tiny_renderer import AMBIENT, DIFFUSE, Box
from antdrive.views.style import Colour

Floats = npt.NDArray[np.float64]


class Solid(NamedTuple):
    """A mesh of one colour at a place.

    Attributes:
        mesh: its shape
        colour: its colour
        place: the rotation and, in the last column, the position of the mesh (3, 4) [m]
    """

    mesh: Mesh
    colour: Colour
    place: Floats


def placed(at: tuple[float, float, float], quaternion: tuple[float, float, float, float]) -> Floats:
    """The place (3, 4) of a mesh that is turned, then moved."""
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
    """Picture (h, w, 3), depth (h, w) and 0 where there is a body, else -1 (h, w), like `tiny_renderer.render`."""
    x0, y0, x1, y1 = box
    shape = (y1 - y0) * fine, (x1 - x0) * fine
    image, depth = np.zeros((*shape, 3), dtype=np.uint8), np.ones(shape, dtype=np.float32)
    seg = np.full(shape, -1, dtype=np.int32)
    (width, height), full = camera.size, camera.full
    ahead = full[3]
    lens = np.array(
        [
            fine * (0.5 * width * (ahead + full[0]) - x0 * ahead),
            fine * (0.5 * height * (ahead - full[1]) - y0 * ahead) - ahead,  # samples are at lower left corners
            ahead,
        ]
    )
    projection = camera.projection
    scale = np.array([(1 - projection[2, 2]) / 2, projection[2, 3] / 2, AMBIENT, DIFFUSE])
    for mesh, colour, place in solids:
        kernels.draw_mesh(
            image,
            depth,
            seg,
            lens,
            scale,
            np.array(light),
            place,
            mesh.vertices,
            mesh.normals,
            mesh.triangles,
            np.array(colour, dtype=np.float64),
        )
    return image, depth, seg
