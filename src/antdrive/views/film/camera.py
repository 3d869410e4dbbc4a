"""Pinhole cameras: framing and projection."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import TypeAlias

import numpy as np
import numpy.typing as npt

from antdrive.base.types import Floats

Picture: TypeAlias = npt.NDArray[np.uint8]  # (H, W, 3), red, green, blue

CAMERAS: tuple[str, ...] = ("oblique", "top", "follow")

_TILT = {"oblique": 52.0, "top": 90.0, "follow": 46.0}  # above the horizon [degrees]
PAD = 0.04  # free border of a picture, as a fraction of its side
_FOV = {"oblique": 30.0, "top": 6.0, "follow": 34.0}  # vertical [degrees]


@dataclass(frozen=True, eq=False)
class Camera:
    """Pinhole camera. Pixels count from the upper left corner, x to the right and y down."""

    view: Floats  # world to camera (4, 4)
    projection: Floats  # camera to clip space (4, 4), without depth
    size: tuple[int, int]  # width and height of the picture [px]

    @classmethod
    def framing(cls, points: Floats, size: tuple[int, int], *, tilt: float, fov: float, turned: bool = False) -> Camera:
        """Return the nearest camera that shows all points (N, 3) [m]."""
        right, up, back = _axes(math.radians(tilt), turned)
        basis = np.array([right, up, back])
        seen = points @ basis.T
        x, y, depth = seen[:, 0], seen[:, 1], -seen[:, 2]
        tan_y = math.tan(math.radians(fov) / 2)
        tan_x = tan_y * size[0] / size[1]
        # A point is right of the left edge if x - cx >= left (depth - cz): linear in the camera's position cx, cz.
        # The same holds for the other edges: the nearest position follows from the extreme points.
        left, right_edge = -tan_x * (1 - 2 * PAD), tan_x * (1 - 2 * PAD)
        top, bottom = tan_y * (1 - 2 * PAD), -tan_y * (1 - 2 * PAD)
        ax, bx = float((x - left * depth).min()), float((x - right_edge * depth).max())
        ay, by = float((y - bottom * depth).min()), float((y - top * depth).max())
        cz = min((ax - bx) / (right_edge - left), (ay - by) / (top - bottom))
        cx = (ax + left * cz + bx + right_edge * cz) / 2
        cy = (ay + bottom * cz + by + top * cz) / 2
        view = np.eye(4)
        view[:3, :3] = basis
        view[:3, 3] = -np.array([cx, cy, -cz])
        return cls(view, np.array([[1 / tan_x, 0, 0, 0], [0, 1 / tan_y, 0, 0], [0, 0, 0, 0], [0, 0, -1, 0]]), size)

    @property
    def is_turned(self) -> bool:
        """Whether it looks along -x."""
        return bool(abs(self.view[0, 0]) < 0.5)

    @property
    def eye(self) -> Floats:
        """Its position (3,) [m]."""
        return np.asarray(-self.view[:3, :3].T @ self.view[:3, 3])

    @cached_property
    def full(self) -> Floats:
        """World to clip space (4, 4)."""
        return self.projection @ self.view

    @cached_property
    def ground(self) -> Floats:
        """Homography (3, 3) from points (x, y, 1) on the ground to pixels."""
        return self.plane(0.0)

    def plane(self, height: float) -> Floats:
        """Return the homography (3, 3) from points (x, y, 1) at a height [m] to pixels."""
        clip = self.full[:, [0, 1, 3]]
        if height:
            clip = clip + np.outer(self.full[:, 2], [0.0, 0.0, height])
        width, height = self.size
        return np.array([0.5 * width * (clip[3] + clip[0]), 0.5 * height * (clip[3] - clip[1]), clip[3]])

    @cached_property
    def pixel(self) -> float:
        """Width of a pixel on the ground in the middle of the picture [m]."""
        width, height = self.size
        back = np.linalg.inv(self.ground)
        ends = np.array([(width / 2 + k, height / 2, 1.0) for k in (-0.5, 0.5)]) @ back.T
        return float(np.hypot(*(ends[1, :2] / ends[1, 2] - ends[0, :2] / ends[0, 2])))

    def pixels(self, points: npt.ArrayLike) -> Floats:
        """Project points (N, 3) [m] to pixels (N, 2) [px]."""
        xyz = np.asarray(points, dtype=np.float64).reshape(-1, 3)
        clip = np.column_stack([xyz, np.ones(len(xyz))]) @ self.full.T
        width, height = self.size
        ndc = clip[:, :2] / clip[:, 3:]
        return np.column_stack([(1 + ndc[:, 0]) * width / 2, (1 - ndc[:, 1]) * height / 2])

    def moved(self, x: float, y: float) -> Camera:
        """Return the camera shifted along the ground [m]."""
        shift = np.eye(4)
        shift[:2, 3] = -x, -y
        return Camera(self.view @ shift, self.projection, self.size)


def camera_for(
    name: str, low: npt.ArrayLike, high: npt.ArrayLike, height: float, size: tuple[int, int], turned: bool | None = None
) -> Camera:
    """Return the named camera that shows a ground rectangle and the bodies on it; None: `turned` if that fills the picture."""
    (x0, y0), (x1, y1) = np.asarray(low, dtype=np.float64), np.asarray(high, dtype=np.float64)
    corners = np.array([(x, y, z) for x in (x0, x1) for y in (y0, y1) for z in (0.0, height)])
    tilt, fov = _TILT[name], _FOV[name]
    if turned is None:  # the ground is tall, the picture wide
        shape = (x1 - x0) / ((y1 - y0) * math.sin(math.radians(tilt)))
        turned = name != "follow" and shape < 0.75 and size[0] > size[1]
    return Camera.framing(corners, size, tilt=tilt, fov=fov, turned=turned)


def _axes(tilt: float, turned: bool) -> tuple[Floats, Floats, Floats]:
    """Return the camera's right, up and back directions."""
    ahead = np.array([-1.0, 0.0, 0.0]) if turned else np.array([0.0, 1.0, 0.0])
    right = np.array([0.0, 1.0, 0.0]) if turned else np.array([1.0, 0.0, 0.0])
    sky = np.array([0.0, 0.0, 1.0])
    forward = math.cos(tilt) * ahead - math.sin(tilt) * sky
    return right, np.cross(right, forward), -forward
