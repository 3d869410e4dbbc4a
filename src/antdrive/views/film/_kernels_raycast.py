"""Compiled ray casting of static bodies: arrays in, arrays out, no validation.

`rays` (3, 3) maps a pixel (x, y, 1) to its direction, one metre deep: the distance of a hit along that direction is its
depth. Light follows PyBullet's TinyRenderer.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from antdrive.worlds._kernels import inline, kernel

Array = Any


@inline
def _lit(normal_x: float, normal_y: float, normal_z: float, light: Array, ambient: float, diffuse: float) -> float:
    facing: float = normal_x * light[0] + normal_y * light[1] + normal_z * light[2]
    return ambient + diffuse * max(0.0, facing)


@inline
def _put(
    image: Array, depth: Array, seg: Array, row: int, col: int, z: float, body: int, colour: Array, lit: float
) -> None:
    depth[row, col] = z
    seg[row, col] = body
    for k in range(3):
        image[row, col, k] = np.uint8(min(255.0, colour[k] * lit))


@kernel
def cast_cylinders(
    image: Array,
    depth: Array,
    seg: Array,
    fine: int,
    eye: Array,
    rays: Array,
    scale: Array,
    light: Array,
    cylinders: Array,
    spans: Array,
    colours: Array,
    first: int,
) -> None:
    """Draw cylinders (N, 4) x, y, radius, height on the ground, each within its span of pixels.

    `spans` (N, 4) are x0, y0, x1, y1. `image` (h, w, 4), `depth` and `seg` (h, w) have `fine` times as many rows and
    columns as the spans' pixels. `scale` holds the offset and the factor from 1 / depth to the projection's depth, then
    the ambient and the diffuse light. The first body has the index `first`.
    """
    for n in range(cylinders.shape[0]):
        cx, cy, radius, tall = cylinders[n, 0], cylinders[n, 1], cylinders[n, 2], cylinders[n, 3]
        ox, oy = eye[0] - cx, eye[1] - cy
        roof = _lit(0.0, 0.0, 1.0, light, scale[2], scale[3])
        for row in range(spans[n, 1] * fine, spans[n, 3] * fine):
            for col in range(spans[n, 0] * fine, spans[n, 2] * fine):
                px, py = (col + 0.5) / fine, (row + 0.5) / fine
                dx = rays[0, 0] * px + rays[0, 1] * py + rays[0, 2]
                dy = rays[1, 0] * px + rays[1, 1] * py + rays[1, 2]
                dz = rays[2, 0] * px + rays[2, 1] * py + rays[2, 2]
                lit, t = 0.0, (tall - eye[2]) / dz if dz < 0.0 else -1.0
                x, y = ox + t * dx, oy + t * dy
                if t > 0.0 and x * x + y * y <= radius * radius:
                    lit = roof
                else:
                    a, b = dx * dx + dy * dy, ox * dx + oy * dy
                    room = b * b - a * (ox * ox + oy * oy - radius * radius)
                    if room <= 0.0:
                        continue
                    t = (-b - math.sqrt(room)) / a
                    z = eye[2] + t * dz
                    if t <= 0.0 or z < 0.0 or z > tall:
                        continue
                    lit = _lit((ox + t * dx) / radius, (oy + t * dy) / radius, 0.0, light, scale[2], scale[3])
                near = scale[0] + scale[1] / t
                if near < depth[row, col]:
                    _put(image, depth, seg, row, col, near, first + n, colours[n], lit)


@kernel
def cast_boxes(
    image: Array,
    depth: Array,
    seg: Array,
    fine: int,
    eye: Array,
    rays: Array,
    scale: Array,
    light: Array,
    boxes: Array,
    spans: Array,
    colours: Array,
    first: int,
) -> None:
    """Draw boxes (N, 6) x0, y0, z0, x1, y1, z1, as `cast_cylinders` draws cylinders."""
    for n in range(boxes.shape[0]):
        for row in range(spans[n, 1] * fine, spans[n, 3] * fine):
            for col in range(spans[n, 0] * fine, spans[n, 2] * fine):
                px, py = (col + 0.5) / fine, (row + 0.5) / fine
                enter, leave, face, side = 0.0, 1e30, -1, 0.0
                for k in range(3):
                    d = rays[k, 0] * px + rays[k, 1] * py + rays[k, 2]
                    if abs(d) < 1e-12:
                        if eye[k] < boxes[n, k] or eye[k] > boxes[n, k + 3]:
                            leave = -1.0
                        continue
                    a, b = (boxes[n, k] - eye[k]) / d, (boxes[n, k + 3] - eye[k]) / d
                    if min(a, b) > enter:
                        enter, face, side = min(a, b), k, -math.copysign(1.0, d)
                    leave = min(leave, max(a, b))
                if face < 0 or enter >= leave:
                    continue
                near = scale[0] + scale[1] / enter
                if near < depth[row, col]:
                    lit = _lit(
                        side if face == 0 else 0.0,
                        side if face == 1 else 0.0,
                        side if face == 2 else 0.0,
                        light,
                        scale[2],
                        scale[3],
                    )
                    _put(image, depth, seg, row, col, near, first + n, colours[n], lit)
