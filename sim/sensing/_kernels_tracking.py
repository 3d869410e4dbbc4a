"""Compiled search for movers in a scan: clusters of points, and the circle of each. Arrays in, arrays out."""

from __future__ import annotations

import math

from antdrive.worlds._kernels import Array, kernel

ROUNDS = 12  # of the fit of a circle's centre


@kernel
def clusters(points: Array, beam: Array, beams: int, closed: bool, gap: float, label: Array) -> int:
    """label[i] = the cluster of point i; the number of clusters.

    Points come in the order of their beams. Two in a row belong together if they are at most `gap` apart; on a lidar that
    sees all around so do the last and the first.
    """
    n = points.shape[0]
    count = 0
    for i in range(n):
        if i == 0 or math.hypot(points[i, 0] - points[i - 1, 0], points[i, 1] - points[i - 1, 1]) > gap:
            count += 1
        label[i] = count - 1
    if closed and count > 1 and beam[0] == 0 and beam[n - 1] == beams - 1:
        apart = math.hypot(points[0, 0] - points[n - 1, 0], points[0, 1] - points[n - 1, 1])
        for i in range(n):
            if apart <= gap and label[i] == count - 1:
                label[i] = 0
        count -= 1 if apart <= gap else 0
    return count


@kernel
def visible_radius(points: Array, eye_x: float, eye_y: float, spacing: float) -> float:
    """The radius of a circle from the angle under which it is seen and its nearest point.

    With the centre at distance d, the nearest point is at d - r, and half of the angle has the sine r / d. The edges lie,
    on average, half a beam beyond the outermost hits.
    """
    n = points.shape[0]
    mx, my = 0.0, 0.0
    nearest = math.inf
    for i in range(n):
        dx, dy = points[i, 0] - eye_x, points[i, 1] - eye_y
        away = math.hypot(dx, dy)
        nearest = min(nearest, away)
        mx, my = mx + dx / away, my + dy / away
    low, high = math.inf, -math.inf
    for i in range(n):
        dx, dy = points[i, 0] - eye_x, points[i, 1] - eye_y
        angle = math.atan2(mx * dy - my * dx, mx * dx + my * dy)
        low, high = min(low, angle), max(high, angle)
    sine = math.sin(min(0.5 * (high - low + spacing), 0.49 * math.pi))
    return nearest * sine / (1.0 - sine)


@kernel
def centre_of(points: Array, eye_x: float, eye_y: float, radius: float, out: Array) -> None:
    """The centre of the circle of a given radius nearest to points on its near side, by Gauss-Newton steps."""
    n = points.shape[0]
    x, y = 0.0, 0.0
    for i in range(n):
        x, y = x + points[i, 0] / n, y + points[i, 1] / n
    away = math.hypot(x - eye_x, y - eye_y)
    ux, uy = (x - eye_x) / away, (y - eye_y) / away
    x, y = x + radius * ux, y + radius * uy
    for _ in range(ROUNDS):
        a, b, c, p, q = 1e-3, 0.0, 1e-3, 0.0, 0.0  # a little damping, for points on one line of sight
        for i in range(n):
            dx, dy = x - points[i, 0], y - points[i, 1]
            d = max(math.hypot(dx, dy), 1e-9)
            gx, gy, error = dx / d, dy / d, d - radius
            a, b, c = a + gx * gx, b + gx * gy, c + gy * gy
            p, q = p + gx * error, q + gy * error
        det = a * c - b * b
        sx, sy = (c * p - b * q) / det, (a * q - b * p) / det
        x, y = x - sx, y - sy
        if sx * sx + sy * sy < 1e-12:
            break
    out[0], out[1] = x, y
