"""Ray casting of cylinders and boxes for moving cameras: exact, and several times as fast as TinyRenderer."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from antdrive.views.film import _kernels_raycast as kernels
from antdrive.views.film.camera import Camera
from antdrive.views.film.tiny_renderer import AMBIENT, DIFFUSE
from antdrive.views.style import Colour

Floats = npt.NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Solids:
    """Cylinders that stand on the ground, and boxes along the axes.

    Attributes:
        cylinders: x, y, radius and height of each (N, 4) [m]
        cylinder_colours: red, green, blue of each (N, 3), 0 to 255
        boxes: x0, y0, z0, x1, y1, z1 of each (M, 6) [m]
        box_colours: red, green, blue of each (M, 3), 0 to 255
    """

    cylinders: Floats
    cylinder_colours: Floats
    boxes: Floats
    box_colours: Floats

    @classmethod
    def of(cls, cylinders: Floats, colours: list[Colour], boxes: Floats, box_colour: Colour) -> Solids:
        """Cylinders (N, 4) with a colour each, and boxes (M, 6) of one colour."""
        tints = np.array(colours, dtype=np.float64).reshape(-1, 3)
        return cls(
            np.ascontiguousarray(cylinders),
            tints,
            boxes,
            np.tile(np.array(box_colour, dtype=np.float64), (len(boxes), 1)),
        )

    def render(self, camera: Camera, fine: int, light: tuple[float, float, float]) -> tuple[Any, Any, Any]:
        """Picture (h, w, 4), depth (h, w) and body numbers (h, w), -1 for none, like `tiny_renderer.render`."""
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
            image,
            depth,
            seg,
            *common,
            self.boxes,
            _spans(camera, self.boxes),
            self.box_colours,
            len(self.cylinders),
        )
        return image, depth, seg


def _spans(camera: Camera, boxes: Floats) -> npt.NDArray[np.int64]:
    """The pixels x0, y0, x1, y1 (N, 4) that each box may cover; empty where the box is out of sight."""
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
