"""Compiled painting on the ground plane and blending of rendered crops: arrays in, arrays out, no validation.

`inv` (3, 3) maps pixels to the ground, `fwd` (3, 3) the ground to pixels. Edges are anti-aliased by the exact distance
to them, divided by the extent of one pixel across the edge.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from antdrive.worlds._kernels import inline, kernel

Array = Any


@inline
def _ramp(value: float) -> float:
    """Return a smooth step: 0 below 0, 1 above 1."""
    t = min(1.0, max(0.0, value))
    return t * t * (3.0 - 2.0 * t)


@kernel
def pixel_box(
    fwd: Array, inv: Array, x0: float, y0: float, x1: float, y1: float, width: int, height: int
) -> tuple[int, int, int, int]:
    """Return the pixel bounds x0, y0, x1, y1 of a ground rectangle; empty behind the camera."""
    left, top, right, bottom = 1e30, 1e30, -1e30, -1e30
    # Edges nearer than any visible ground are cut: close to the camera, boxes would be huge.
    left_edge = max(inv[2, 2], inv[2, 1] * height + inv[2, 2])
    near = 0.5 / max(left_edge, left_edge + inv[2, 0] * width)
    for i in range(4):
        ax, ay = (x0 if i in (0, 3) else x1), (y0 if i < 2 else y1)
        bx, by = (x0 if i in (2, 3) else x1), (y0 if i in (0, 3) else y1)
        aw = fwd[2, 0] * ax + fwd[2, 1] * ay + fwd[2, 2]
        bw = fwd[2, 0] * bx + fwd[2, 1] * by + fwd[2, 2]
        for k in range(2):
            x, y, w = ax, ay, aw
            if k == 1:
                if (aw > near) == (bw > near):
                    continue
                t = (near - aw) / (bw - aw)
                x, y, w = ax + t * (bx - ax), ay + t * (by - ay), near
            if w < near:
                continue
            px = (fwd[0, 0] * x + fwd[0, 1] * y + fwd[0, 2]) / w
            py = (fwd[1, 0] * x + fwd[1, 1] * y + fwd[1, 2]) / w
            left, right = min(left, px), max(right, px)
            top, bottom = min(top, py), max(bottom, py)
    if left > right:
        return 0, 0, 0, 0
    return (
        int(min(max(math.floor(left) - 1, 0), width)),
        int(min(max(math.floor(top) - 1, 0), height)),
        int(min(max(math.ceil(right) + 1, 0), width)),
        int(min(max(math.ceil(bottom) + 1, 0), height)),
    )


@inline
def ground_at(inv: Array, px: float, py: float) -> tuple[float, float, float]:
    """Return the ground point at a pixel's centre and its homogeneous scale."""
    w = inv[2, 0] * px + inv[2, 1] * py + inv[2, 2]
    return (inv[0, 0] * px + inv[0, 1] * py + inv[0, 2]) / w, (inv[1, 0] * px + inv[1, 1] * py + inv[1, 2]) / w, w


@inline
def _span(inv: Array, x: float, y: float, w: float, nx: float, ny: float) -> float:
    """Return the extent of one pixel on the ground along the unit vector n [m]."""
    across = nx * (inv[0, 0] - x * inv[2, 0]) + ny * (inv[1, 0] - y * inv[2, 0])
    down = nx * (inv[0, 1] - x * inv[2, 1]) + ny * (inv[1, 1] - y * inv[2, 1])
    return math.sqrt(across * across + down * down) / abs(w) + 1e-12


@kernel
def lay_floor(rgb: Array, inside: Array, inv: Array, bounds: Array, step: float, weight: float, colours: Array) -> None:
    """Paint the floor (H, W, 3), and set `inside` to the ground within the bounds.

    `colours` (3, 3): inside, outside and grid lines, which are `weight` pixels wide.
    """
    height, width = rgb.shape[0], rgb.shape[1]
    for row in range(height):
        for col in range(width):
            x, y, w = ground_at(inv, col + 0.5, row + 0.5)
            out = max(max(bounds[0] - x, x - bounds[2]), max(bounds[1] - y, y - bounds[3]))
            line = 0.0
            inside[row, col] = out < 0.0
            if out < 0.0:
                gap_x = abs(x / step - math.floor(x / step + 0.5)) * step
                gap_y = abs(y / step - math.floor(y / step + 0.5)) * step
                line_x = (0.5 + 0.5 * weight) - gap_x / _span(inv, x, y, w, 1.0, 0.0)
                line_y = (0.5 + 0.5 * weight) - gap_y / _span(inv, x, y, w, 0.0, 1.0)
                line = min(1.0, max(0.0, max(line_x, line_y)))
            for k in range(3):
                base = colours[0, k] if out < 0.0 else colours[1, k]
                rgb[row, col, k] = base + (colours[2, k] - base) * line


@kernel
def cast_shadows(shade: Array, fwd: Array, inv: Array, discs: Array, sun_x: float, sun_y: float, depth: float) -> None:
    """Darken `shade` (H, W), 1 = fully lit, where cylinders (N, 4) x, y, radius, height block the sun or the sky.

    A cylinder's shadow is its disc swept along (sun_x, sun_y) times its height; the edge softens with the distance.
    """
    height, width = shade.shape
    for i in range(discs.shape[0]):
        ax, ay, radius, tall = discs[i, 0], discs[i, 1], discs[i, 2], discs[i, 3]
        dx, dy = sun_x * tall, sun_y * tall
        length2 = dx * dx + dy * dy
        near = 0.10 + 0.35 * radius
        pad = radius + near + 0.15 * tall
        left, top, right, bottom = capsule_box(fwd, inv, ax, ay, ax + dx, ay + dy, pad, width, height)
        for row in range(top, bottom):
            for col in range(left, right):
                x, y, _ = ground_at(inv, col + 0.5, row + 0.5)
                ex, ey = x - ax, y - ay
                t = min(1.0, max(0.0, (ex * dx + ey * dy) / length2)) if length2 > 0.0 else 0.0
                soft = 0.02 + 0.22 * tall * t * math.sqrt(length2) / max(tall, 1e-9)
                gap = math.hypot(ex - t * dx, ey - t * dy) - radius
                sun = depth * (1.0 - 0.35 * t) * _ramp(0.5 - gap / soft)
                base = math.hypot(ex, ey) - radius
                sky = 0.55 * depth * (1.0 - _ramp(base / near)) if base > 0.0 else 0.55 * depth
                lit = (1.0 - sun) * (1.0 - sky * (1.0 - 0.5 * sun / max(depth, 1e-9)))
                shade[row, col] = min(shade[row, col], lit)


@kernel
def cover_capsules(cover: Array, fwd: Array, inv: Array, rows: Array) -> None:
    """Raise `cover` (H, W) to 1 inside capsules (N, 5): segment ax, ay, bx, by and half width [m]."""
    height, width = cover.shape
    for i in range(rows.shape[0]):
        ax, ay, bx, by, half = rows[i, 0], rows[i, 1], rows[i, 2], rows[i, 3], rows[i, 4]
        left, top, right, bottom = capsule_box(fwd, inv, ax, ay, bx, by, half, width, height)
        for row in range(top, bottom):
            for col in range(left, right):
                value = capsule_cover(inv, row, col, ax, ay, bx, by, half)
                if value > cover[row, col]:
                    cover[row, col] = value


@kernel
def capsule_box(
    fwd: Array, inv: Array, ax: float, ay: float, bx: float, by: float, half: float, width: int, height: int
) -> tuple[int, int, int, int]:
    """Return the pixel bounds x0, y0, x1, y1 of a capsule; empty behind the camera."""
    x0, y0, x1, y1 = min(ax, bx) - half, min(ay, by) - half, max(ax, bx) + half, max(ay, by) + half
    return pixel_box(fwd, inv, x0, y0, x1, y1, width, height)


@kernel
def capsule_cover(inv: Array, row: int, col: int, ax: float, ay: float, bx: float, by: float, half: float) -> float:
    """Return the fraction of a pixel that a capsule covers."""
    x, y, w = ground_at(inv, col + 0.5, row + 0.5)
    dx, dy = bx - ax, by - ay
    length2 = dx * dx + dy * dy
    t = 0.0
    if length2 > 0.0:
        t = min(1.0, max(0.0, ((x - ax) * dx + (y - ay) * dy) / length2))
    ex, ey = x - ax - t * dx, y - ay - t * dy
    distance = math.sqrt(ex * ex + ey * ey)
    if distance <= 1e-12:
        return 1.0
    span = _span(inv, x, y, w, ex / distance, ey / distance)
    return min(1.0, max(0.0, 0.5 + (half - distance) / span)) * min(1.0, 2.0 * half / span)


@kernel
def blend_cover(rgb: Array, cover: Array, ground: Array, colour: Array, strength: float) -> None:
    """Blend a colour into `rgb` (H, W, 3) by coverage where `ground` is true; clear the coverage."""
    for row in range(rgb.shape[0]):
        for col in range(rgb.shape[1]):
            value = cover[row, col]
            if value > 0.0:
                cover[row, col] = 0.0
                if ground[row, col]:
                    for k in range(3):
                        rgb[row, col, k] += (colour[k] - rgb[row, col, k]) * value * strength


@kernel
def draw_trail(
    canvas: Array,
    base: Array,
    visible: Array,
    trail: Array,
    fwd: Array,
    inv: Array,
    rows: Array,
    colours: Array,
) -> None:
    """Paint capsules (N, 5) in colours (N, 3) into `canvas`; `trail` (H, W, 4) holds colour and coverage so far."""
    height, width = canvas.shape[0], canvas.shape[1]
    for i in range(rows.shape[0]):
        ax, ay, bx, by, half = rows[i, 0], rows[i, 1], rows[i, 2], rows[i, 3], rows[i, 4]
        left, top, right, bottom = capsule_box(fwd, inv, ax, ay, bx, by, half, width, height)
        for row in range(top, bottom):
            for col in range(left, right):
                value = capsule_cover(inv, row, col, ax, ay, bx, by, half)
                if value <= 0.0:
                    continue
                before = trail[row, col, 3] / 255.0
                mix = value if before > 0.0 else 1.0
                cover = max(before, value)
                trail[row, col, 3] = np.uint8(255.0 * cover + 0.5)
                weight = cover * visible[row, col]
                for k in range(3):
                    tint = trail[row, col, k] + (colours[i, k] - trail[row, col, k]) * mix
                    trail[row, col, k] = np.uint8(tint + 0.5)
                    under = float(base[row, col, k])
                    canvas[row, col, k] = np.uint8(under + (tint - under) * weight + 0.5)


@kernel
def blend_capsules(
    frame: Array, visible: Array, fwd: Array, inv: Array, rows: Array, colour: Array, strength: float
) -> None:
    """Blend capsules (N, 5) of one colour into the ground of `frame` (H, W, 3)."""
    height, width = visible.shape
    for i in range(rows.shape[0]):
        ax, ay, bx, by, half = rows[i, 0], rows[i, 1], rows[i, 2], rows[i, 3], rows[i, 4]
        left, top, right, bottom = capsule_box(fwd, inv, ax, ay, bx, by, half, width, height)
        for row in range(top, bottom):
            for col in range(left, right):
                weight = capsule_cover(inv, row, col, ax, ay, bx, by, half) * strength * visible[row, col]
                if weight > 0.0:
                    for k in range(3):
                        under = float(frame[row, col, k])
                        frame[row, col, k] = np.uint8(under + (colour[k] - under) * weight + 0.5)


@kernel
def shade_body(
    frame: Array,
    visible: Array,
    fwd: Array,
    inv: Array,
    pose: Array,
    shape: Array,
    sun: Array,
    soft: float,
    strength: float,
) -> None:
    """Darken the ground below a rounded rectangle (half length, half width, rounding) swept along `sun` [m]."""
    height, width = visible.shape
    cx, cy, yaw = pose[0], pose[1], pose[2]
    cosine, sine = math.cos(yaw), math.sin(yaw)
    places = 5 if sun[0] != 0.0 or sun[1] != 0.0 else 1  # along the shadow
    unlit2 = (shape[2] + 0.5 * soft) ** 2 * (1.0 + 1e-9)  # squared distance of the shadow's end
    reach = math.hypot(shape[0], shape[1]) + shape[2] + soft
    left, top, right, bottom = capsule_box(fwd, inv, cx, cy, cx + sun[0], cy + sun[1], reach, width, height)
    for row in range(top, bottom):
        for col in range(left, right):
            if visible[row, col] <= 0.0:
                continue
            x, y, _ = ground_at(inv, col + 0.5, row + 0.5)
            apart2 = 1e30
            for i in range(places):
                ex, ey = x - cx - sun[0] * i / 4, y - cy - sun[1] * i / 4
                across = max(abs(ex * cosine + ey * sine) - shape[0], 0.0)
                aside = max(abs(ey * cosine - ex * sine) - shape[1], 0.0)
                apart2 = min(apart2, across * across + aside * aside)
            if apart2 >= unlit2:
                continue
            gap = math.sqrt(apart2) - shape[2]
            dark = strength * _ramp(0.5 - gap / soft) * visible[row, col]
            for k in range(3):
                tone = dark * (1.0 - 0.1 * k)
                frame[row, col, k] = np.uint8(frame[row, col, k] * (1.0 - tone) + 0.5)


@kernel
def put_bodies(
    frame: Array,
    image: Array,
    z: Array,
    seg: Array,
    depth: Array,
    x0: int,
    y0: int,
    factor: int,
    ghost: float,
    strength: float,
) -> None:
    """Blend a crop, rendered `factor` times as fine, into `frame` at x0, y0, where its depth `z` is below `depth`.

    Elsewhere the crop is hidden, and shines through with `ghost` times its `strength`.
    """
    count = factor * factor
    rows, cols = z.shape[0] // factor, z.shape[1] // factor
    for row in range(rows):
        for col in range(cols):
            red, green, blue, seen = 0.0, 0.0, 0.0, 0.0
            for i in range(factor):
                for j in range(factor):
                    r, c = row * factor + i, col * factor + j
                    if seg[r, c] < 0:
                        continue
                    weight = strength
                    if z[r, c] >= depth[y0 * factor + r, x0 * factor + c]:
                        weight *= ghost
                    seen += weight
                    red += weight * image[r, c, 0]
                    green += weight * image[r, c, 1]
                    blue += weight * image[r, c, 2]
            if seen > 0.0:
                rest = count - seen
                y, x = y0 + row, x0 + col
                frame[y, x, 0] = np.uint8((frame[y, x, 0] * rest + red) / count + 0.5)
                frame[y, x, 1] = np.uint8((frame[y, x, 1] * rest + green) / count + 0.5)
                frame[y, x, 2] = np.uint8((frame[y, x, 2] * rest + blue) / count + 0.5)


@kernel
def sample_sheet(rgb: Array, inv: Array, sheet: Array, x0: float, y0: float, texel: float) -> None:
    """Paint the ground (H, W, 3) from a sheet (R, C, 3) whose texel (0, 0) has its corner at x0, y0 [m], between texels."""
    for row in range(rgb.shape[0]):
        for col in range(rgb.shape[1]):
            x, y, _ = ground_at(inv, col + 0.5, row + 0.5)
            u = min(max((x - x0) / texel - 0.5, 0.0), sheet.shape[1] - 1.001)
            v = min(max((y - y0) / texel - 0.5, 0.0), sheet.shape[0] - 1.001)
            c, r = int(u), int(v)
            u, v = u - c, v - r
            for k in range(3):
                low = sheet[r, c, k] * (1.0 - u) + sheet[r, c + 1, k] * u
                high = sheet[r + 1, c, k] * (1.0 - u) + sheet[r + 1, c + 1, k] * u
                rgb[row, col, k] = np.uint8(low + (high - low) * v + 0.5)


@kernel
def put_on_floor(pixels: Array, visible: Array, image: Array, seg: Array, factor: int) -> None:
    """Blend bodies, rendered `factor` times as fine, over the ground in `pixels` (H, W, 3); `visible`: its visible fraction."""
    count = factor * factor
    for row in range(visible.shape[0]):
        for col in range(visible.shape[1]):
            red, green, blue, seen = 0.0, 0.0, 0.0, 0
            for i in range(factor):
                for j in range(factor):
                    r, c = row * factor + i, col * factor + j
                    if seg[r, c] >= 0:
                        seen += 1
                        red += image[r, c, 0]
                        green += image[r, c, 1]
                        blue += image[r, c, 2]
            visible[row, col] = 1.0 - seen / count
            if seen > 0:
                rest = count - seen
                pixels[row, col, 0] = np.uint8((pixels[row, col, 0] * rest + red) / count + 0.5)
                pixels[row, col, 1] = np.uint8((pixels[row, col, 1] * rest + green) / count + 0.5)
                pixels[row, col, 2] = np.uint8((pixels[row, col, 2] * rest + blue) / count + 0.5)


@kernel
def lay_field(
    frame: Array, visible: Array, inv: Array, levels: Array, x0: float, y0: float, cell: float, tints: Array
) -> None:
    """Tint the ground by a field `levels` (R, C), 0 to 1 or NaN, with colours `tints` (256, 3).

    The centre of cell (0, 0) is at x0, y0 [m].
    """
    for row in range(frame.shape[0]):
        for col in range(frame.shape[1]):
            if visible[row, col] <= 0.0:
                continue
            x, y, _ = ground_at(inv, col + 0.5, row + 0.5)
            r, c = math.floor((y - y0) / cell + 0.5), math.floor((x - x0) / cell + 0.5)
            if r < 0 or c < 0 or r >= levels.shape[0] or c >= levels.shape[1] or math.isnan(levels[r, c]):
                continue
            level = levels[r, c]
            weight = 0.9 * min(1.0, 2.5 * level) * visible[row, col]
            for k in range(3):
                under = float(frame[row, col, k])
                frame[row, col, k] = np.uint8(under + (tints[int(255 * level), k] - under) * weight + 0.5)
