"""Compiled rasterisation of small meshes, equal to PyBullet's TinyRenderer at a tenth of its cost: arrays in, arrays out.

Samples are at lower left corners, as in TinyRenderer. Depth and light follow its formulas, so pictures agree up to
rounding.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from antdrive.worlds._kernels import kernel

Array = Any

NEAREST = 1e-3  # near plane of the camera [m]
EDGE = 1e-9  # tolerance of negative weights, so that no sample falls between two triangles


@kernel
def draw_mesh(
    image: Array,
    depth: Array,
    seg: Array,
    lens: Array,
    scale: Array,
    light: Array,
    place: Array,
    vertices: Array,
    normals: Array,
    triangles: Array,
    colour: Array,
    body: int,
) -> None:
    """Draw the outside of a mesh into `image` (h, w, 3) and `depth` (h, w) where it is nearest, and set `seg` to `body` there.

    `place` (3, 4) turns the mesh, or stretches it along its axes, and moves it. `lens` (3, 4) maps the world to samples: column
    and row, both times the distance ahead, and the distance ahead. `scale` holds the offset and the factor from 1 / distance to
    depth, then the ambient and the diffuse light.
    """
    corners = np.empty((vertices.shape[0], 6))  # projected by `lens`, then the normal
    spots = np.empty((vertices.shape[0], 2))  # column and row of the corners ahead of the camera
    for i in range(vertices.shape[0]):
        point = (vertices[i, 0], vertices[i, 1], vertices[i, 2])
        out = (normals[i, 0], normals[i, 1], normals[i, 2])
        wx = place[0, 0] * point[0] + place[0, 1] * point[1] + place[0, 2] * point[2] + place[0, 3]
        wy = place[1, 0] * point[0] + place[1, 1] * point[1] + place[1, 2] * point[2] + place[1, 3]
        wz = place[2, 0] * point[0] + place[2, 1] * point[1] + place[2, 2] * point[2] + place[2, 3]
        for k in range(3):
            corners[i, k] = lens[k, 0] * wx + lens[k, 1] * wy + lens[k, 2] * wz + lens[k, 3]
            corners[i, 3 + k] = place[k, 0] * out[0] + place[k, 1] * out[1] + place[k, 2] * out[2]
        for k in range(2):
            spots[i, k] = corners[i, k] / corners[i, 2] if corners[i, 2] >= NEAREST else math.inf
    cut = np.empty((4, 6))
    for t in range(triangles.shape[0]):
        i, j, m = triangles[t, 0], triangles[t, 1], triangles[t, 2]
        if max(max(spots[i, 0], spots[j, 0]), spots[m, 0]) < math.inf:  # nothing to cut off
            down = (spots[j, 0] - spots[i, 0]) * (spots[m, 1] - spots[i, 1])
            if down < (spots[m, 0] - spots[i, 0]) * (spots[j, 1] - spots[i, 1]):  # the outside faces the camera
                _fill(image, depth, seg, scale, light, corners[i], corners[j], corners[m], colour, body)
            continue
        count = 0
        for n in range(3):
            here, there = corners[triangles[t, n]], corners[triangles[t, (n + 1) % 3]]
            if here[2] >= NEAREST:
                cut[count] = here
                count += 1
            if (here[2] >= NEAREST) != (there[2] >= NEAREST):
                share = (NEAREST - here[2]) / (there[2] - here[2])
                for k in range(6):
                    cut[count, k] = here[k] + share * (there[k] - here[k])
                count += 1
        for n in range(2, count):
            _fill(image, depth, seg, scale, light, cut[0], cut[n - 1], cut[n], colour, body)


@kernel
def _fill(
    image: Array,
    depth: Array,
    seg: Array,
    scale: Array,
    light: Array,
    a: Array,
    b: Array,
    c: Array,
    colour: Array,
    body: int,
) -> None:
    """Draw one triangle unless its inside faces the camera."""
    ax, ay, aw = a[0] / a[2], a[1] / a[2], 1.0 / a[2]
    bx, by, bw = b[0] / b[2], b[1] / b[2], 1.0 / b[2]
    cx, cy, cw = c[0] / c[2], c[1] / c[2], 1.0 / c[2]
    area = (bx - ax) * (cy - ay) - (cx - ax) * (by - ay)
    if area >= 0.0:  # rows count downwards
        return
    height, width = depth.shape
    top = max(0.0, math.ceil(min(ay, min(by, cy))))
    bottom = min(height - 1.0, math.floor(max(ay, max(by, cy))))
    # The corners' weights are linear along a row: start + slope * column.
    share = 1.0 / area
    slope_a, slope_b = (by - cy) * share, (cy - ay) * share
    slope_c = -slope_a - slope_b
    run_a, run_b, run_c = 1.0 / slope_a, 1.0 / slope_b, 1.0 / slope_c  # infinite where a weight is constant
    for row in range(int(top), int(bottom) + 1):
        start_a = ((bx * cy - cx * by) - row * (bx - cx)) * share
        start_b = ((cx * ay - ax * cy) - row * (cx - ax)) * share
        start_c = 1.0 - start_a - start_b
        low, high = 0.0, width - 1.0
        for start, slope, run in ((start_a, slope_a, run_a), (start_b, slope_b, run_b), (start_c, slope_c, run_c)):
            if slope > 0.0:
                low = max(low, -(start + EDGE) * run)
            elif slope < 0.0:
                high = min(high, -(start + EDGE) * run)
            elif start < -EDGE:
                high = -1.0
        if low > high:
            continue
        for col in range(int(math.ceil(low)), int(math.floor(high)) + 1):
            pa = (start_a + slope_a * col) * aw
            pb = (start_b + slope_b * col) * bw
            pc = (start_c + slope_c * col) * cw
            z = scale[0] + scale[1] * (pa + pb + pc)
            if z >= depth[row, col]:
                continue
            nx = pa * a[3] + pb * b[3] + pc * c[3]
            ny = pa * a[4] + pb * b[4] + pc * c[4]
            nz = pa * a[5] + pb * b[5] + pc * c[5]
            towards = (nx * light[0] + ny * light[1] + nz * light[2]) / math.sqrt(nx * nx + ny * ny + nz * nz)
            lit = scale[2] + scale[3] * max(0.0, towards)
            depth[row, col] = z
            seg[row, col] = body
            for k in range(3):
                image[row, col, k] = np.uint8(min(255.0, colour[k] * lit))
