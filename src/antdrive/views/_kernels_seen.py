"""Compiled painting of lidar beams, unknown ground and undetected obstacles: arrays in, arrays out, no validation.

`inv` (3, 3) maps pixels to the ground, `fwd` (3, 3) the ground to pixels.
"""

from __future__ import annotations

import math

import numpy as np

from antdrive.views.film._kernels_paint import ground_at, pixel_box
from antdrive.worlds._kernels import Array, inline, kernel


@inline
def _unknown(free: Array, occupied: Array, u: float, v: float) -> float:
    """Return the unknown fraction of the ground at a point, 0 to 1; u, v are in cells from the first cell's centre.

    Interpolation between cells smooths the edge of known ground.
    """
    c, r = math.floor(u), math.floor(v)
    if r < 0 or c < 0 or r + 1 >= free.shape[0] or c + 1 >= free.shape[1]:
        return 1.0
    a = 1.0 if free[r, c] or occupied[r, c] else 0.0
    b = 1.0 if free[r, c + 1] or occupied[r, c + 1] else 0.0
    d = 1.0 if free[r + 1, c] or occupied[r + 1, c] else 0.0
    e = 1.0 if free[r + 1, c + 1] or occupied[r + 1, c + 1] else 0.0
    fu, fv = u - c, v - r
    known = (a * (1.0 - fu) + b * fu) * (1.0 - fv) + (d * (1.0 - fu) + e * fu) * fv
    return min(1.0, max(0.0, 1.5 - 2.0 * known))


@kernel
def veil(
    frame: Array, visible: Array, inv: Array, bounds: Array, shift: Array, free: Array, occupied: Array, corner: Array,
    style: Array, tints: Array,
) -> None:  # fmt: skip
    """Hatch the ground of `frame` (H, W, 3) within bounds that is neither free nor occupied on a map.

    `shift` (4,) transforms the ground to the map: cosine and sine of a rotation, then x and y [m]; `corner` (3,) is the lower
    left corner of the map and the side of its cells [m]. `style` (4,): opacity of the veil and of the lines, spacing of the
    lines and width of a pixel [m]; `tints` (2, 3) are the colours of both. The map is sampled once for 2 x 2 pixels.
    """
    height, width = visible.shape
    for row in range(0, height, 2):
        for col in range(0, width, 2):
            x, y, w = ground_at(inv, col + 1.0, row + 1.0)
            if x < bounds[0] or x > bounds[2] or y < bounds[1] or y > bounds[3]:
                continue
            u = (shift[0] * x - shift[1] * y + shift[2] - corner[0]) / corner[2] - 0.5
            v = (shift[1] * x + shift[0] * y + shift[3] - corner[1]) / corner[2] - 0.5
            unknown = _unknown(free, occupied, u, v)
            if unknown <= 0.0:
                continue
            # Increments of x + y per pixel, linear within 2 x 2 pixels.
            right = (inv[0, 0] + inv[1, 0] - (x + y) * inv[2, 0]) / w
            down = (inv[0, 1] + inv[1, 1] - (x + y) * inv[2, 1]) / w
            for i in range(min(2, height - row)):
                for j in range(min(2, width - col)):
                    share = unknown * visible[row + i, col + j]
                    if share <= 0.0:
                        continue
                    t = (x + y + (j - 0.5) * right + (i - 0.5) * down) * math.sqrt(0.5) / style[2]
                    gap = abs(t - math.floor(t + 0.5)) * style[2] / style[3]  # [px]
                    line = share * style[1] * min(1.0, max(0.0, 1.1 - gap))
                    for k in range(3):
                        value = float(frame[row + i, col + j, k])
                        value += (tints[0, k] - value) * share * style[0]
                        value += (tints[1, k] - value) * line
                        frame[row + i, col + j, k] = np.uint8(value + 0.5)


@kernel
def pale_bodies(
    frame: Array, visible: Array, seg: Array, fine: int, unmet: Array, colour: Array, strength: float
) -> None:
    """Blend a colour into the bodies of `frame` (H, W, 3) whose index in `seg` is below len(unmet) and unmet."""
    height, width = visible.shape
    for row in range(height):
        for col in range(width):
            if visible[row, col] >= 1.0:
                continue
            count = 0
            for r in range(row * fine, row * fine + fine):
                for c in range(col * fine, col * fine + fine):
                    body = seg[r, c]
                    if 0 <= body < unmet.shape[0] and unmet[body]:
                        count += 1
            if count:
                share = strength * count / (fine * fine)
                for k in range(3):
                    value = float(frame[row, col, k])
                    frame[row, col, k] = np.uint8(value + (colour[k] - value) * share + 0.5)


@kernel
def lay_fan(
    frame: Array, visible: Array, fwd: Array, inv: Array, eye: Array, first: float, spacing: float, closed: bool,
    reaches: Array, every: int, style: Array, colour: Array,
) -> None:  # fmt: skip
    """Draw the beams of a scan on the ground of `frame` (H, W, 3): a tint over their area and every `every`-th as a line.

    `eye` is the lidar's x, y and yaw, `reaches` (B,) the length of each beam [m]. `style` (3,): opacity of tint and lines,
    and width of a pixel [m].
    """
    height, width = visible.shape
    beams, pixel = reaches.shape[0], style[2]
    far = 0.0
    for i in range(beams):
        far = max(far, reaches[i])
    x0, y0 = eye[0] - far, eye[1] - far
    left, top, right, bottom = pixel_box(fwd, inv, x0, y0, eye[0] + far, eye[1] + far, width, height)
    full = 2.0 * math.pi / spacing
    base = (eye[2] + first + math.pi) % (2.0 * math.pi) - math.pi
    for row in range(top, bottom):
        for col in range(left, right):
            if visible[row, col] <= 0.0:
                continue
            x, y, _ = ground_at(inv, col + 0.5, row + 0.5)
            dx, dy = x - eye[0], y - eye[1]
            away = math.sqrt(dx * dx + dy * dy)
            if away >= far:
                continue
            k = (math.atan2(dy, dx) - base) / spacing
            if k < -0.5:
                k += full
            nearest = math.floor(k + 0.5)
            if closed:
                nearest = nearest if nearest < beams else 0
            elif nearest >= beams:
                continue
            weight = style[0] * min(1.0, max(0.0, 0.5 + (reaches[nearest] - away) / pixel))
            drawn = math.floor(k / every + 0.5) * every
            if drawn < beams and away < reaches[drawn]:
                apart = every * spacing * away / pixel  # spacing of lines [px]
                aside = abs(k - drawn) * spacing * away / pixel
                weight += style[1] * min(1.0, max(0.0, 1.0 - aside)) * min(1.0, apart / 6.0)
            weight *= visible[row, col]
            if weight > 0.0:
                for c in range(3):
                    value = float(frame[row, col, c])
                    frame[row, col, c] = np.uint8(value + (colour[c] - value) * weight + 0.5)
