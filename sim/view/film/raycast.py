"""Rays instead of triangles: what a moving camera sees of cylinders and kerb, exact and several times as fast."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from antdrive.sim.view.film import _kernels_cast as kernels
from antdrive.sim.view.film.camera import Camera
from antdrive.sim.view.film.tiny import AMBIENT, DIFFUSE
from antdrive.sim.view.style import Colour

Floats = npt.NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Solids:
    """Cylinders on the ground and boxes along the axes, each with its colour (N, 3), 0 to 255."""

    cylinders: Floats  # (N, 4) x, y, radius, height [m]
    cylinder_colours: Floats
    boxes: Floats  # (M, 6) x0, y0, z0, x1, y1, z1 [m]
    box_colours: Floats

    @classmethod
    def of(cls, cylinders: Floats, colours: list[Colour], boxes: Floats, box_colour: Colour) -> Solids:
        """Cylinders of several colours, boxes of one."""
        tints = np.array(colours, dtype=np.float64).reshape(-1, 3)
        return cls(
            np.ascontiguousarray(cylinders),
            tints,
            boxes,
            np.tile(np.array(box_colour, dtype=np.float64), (len(boxes), 1)),
        )

    def seen(self, camera: Camera, fine: int, light: tuple[float, float, float]) -> tuple[Any, Any, Any]:
        """Picture (h, w, 4), depth and body numbers (h, w), -1 for none, `fine` times the camera's pixels."""
        width, height = camera.size
        image = np.empty((height * fine, width * fine, 4), dtype=np.uint8)
        depth = np.ones(image.shape[:2], dtype=np.float32)
        seg = np.full(image.shape[:2], -1, dtype=np.int32)
        turn, projection = camera.view[:3, :3], camera.projection
        eye = -turn.T @ camera.view[:3, 3]
        across, down = 2 / width / projection[0, 0], -2 / height / projection[1, 1]
        lens = np.array([[across, 0, -across * width / 2], [0, down, -down * height / 2], [0, 0, -1.0]])
        scale = np.array([(1 - projection[2, 2]) / 2, projection[2, 3] / 2, AMBIENT, DIFFUSE])
        common = (fine, eye, np.ascontiguousarray(turn.T @ lens), scale, np.array(light))
        x, y, radius, tall = self.cylinders.T
        around = np.column_stack([x - radius, y - radius, 0 * x, x + radius, y + radius, tall])
        kernels.cast_cylinders(
            image, depth, seg, *common, self.cylinders, _spans(camera, around), self.cylinder_colours, 0
        )
        kernels.cast_boxes(
            image, depth, seg, *common, self.boxes, _spans(camera, self.boxes), self.box_colours, len(self.cylinders)
        )
        return image, depth, seg


def _spans(camera: Camera, boxes: Floats) -> npt.NDArray[np.int64]:
    """The pixels x0, y0, x1, y1 (N, 4) that boxes may cover; empty ones where a box is out of sight."""
    points = boxes[:, [(i, 1 + j, 2 + k) for i in (0, 3) for j in (0, 3) for k in (0, 3)]]  # (N, 8, 3)
    clip = np.concatenate([points, np.ones((*points.shape[:2], 1))], axis=2) @ camera.full.T
    with np.errstate(divide="ignore", invalid="ignore"):
        at = clip[..., :2] / clip[..., 3:]
    size = np.array(camera.size)
    at = (1 + at * [1, -1]) * size / 2
    low, high = np.floor(at.min(axis=1)) - 1, np.ceil(at.max(axis=1)) + 1
    around = (clip[..., 3] <= 0).any(axis=1)  # part of it is behind the camera: anywhere
    low[around], high[around] = 0, size
    gone = (clip[..., 3] <= 0).all(axis=1)
    low[gone], high[gone] = 0, 0
    spans = np.hstack([np.clip(low, 0, size), np.clip(high, 0, size)])
    return spans.astype(np.int64)
