"""Convex footprints around points in the plane, with few corners."""

from __future__ import annotations

import math
from collections.abc import Iterable

from antdrive.base.types import Point
from antdrive.robots.outline import Footprint

MAX_OUTLINE = 12  # corners of a computed outline
STEP = 1e-5  # resolution of a computed outline [m]
LOOSE = 1e-8  # tolerance for rounded quarter turns such as 1.5707963 [m]
ALIKE = 1e-4  # tolerance of mirror symmetry between left and right [m]
CHEAP = 1e-4  # relative gain in area that is accepted for one corner less
LIKE = 0.97  # minimum fraction of a disc or rectangle filled by the outline that it replaces


def convex_hull(points: Iterable[Point]) -> list[Point]:
    """Return the corners of the convex hull, counter-clockwise."""
    ordered = sorted({(round(x, 7), round(y, 7)) for x, y in points})
    halves: list[list[Point]] = []
    for direction in (ordered, ordered[::-1]):
        chain: list[Point] = []
        for point in direction:
            while len(chain) > 1 and _area(chain[-2], chain[-1], point) <= 1e-12:
                chain.pop()
            chain.append(point)
        halves.append(chain[:-1])
    return halves[0] + halves[1]


def fewer_corners(corners: list[Point], most: int) -> list[Point]:
    """Enclose a convex polygon in one with at most `most` corners by removing the edges whose removal adds the least area.

    Edges whose removal adds almost no area are always removed: a wheel turned by 1.57 is slightly askew. Symmetry is
    preserved: edges are removed together with their mirror images.
    """
    corners = list(corners)
    cheap = CHEAP * sum(_area((0.0, 0.0), a, b) for a, b in zip(corners, corners[1:] + corners[:1], strict=True))
    symmetric = all(_nearest(corners, (x, -y)) is not None for x, y in corners)
    while len(corners) > 4:
        costs = [_cost(corners, k) for k in range(len(corners))]
        affordable = [k for k, cost in enumerate(costs) if cost < math.inf and (len(corners) > most or cost <= cheap)]
        options = (_without_edge(corners, k, symmetric) for k in sorted(affordable, key=lambda k: costs[k]))
        fewer = next((option for option in options if option is not None), None)
        if fewer is not None:
            corners = fewer
        elif symmetric and len(corners) > most:
            symmetric = False  # no pair can be removed
        else:
            break
    return corners


def _around_edge(corners: list[Point], k: int) -> tuple[Point, Point, Point, Point]:
    """Return the corner before the edge from corner k, its two ends, and the corner after it."""
    a, b, c, d = (corners[(k + j) % len(corners)] for j in (-1, 0, 1, 2))
    return a, b, c, d


def _cost(corners: list[Point], k: int) -> float:
    """Return the area that a polygon gains without the edge from corner k; inf if it cannot be removed."""
    a, b, c, d = _around_edge(corners, k)
    tip = _meeting(a, b, d, c)
    return math.inf if tip is None else _area(b, tip, c)


def _without_edge(corners: list[Point], k: int, symmetric: bool) -> list[Point] | None:
    """Return the corners without the edge from corner k; None if it cannot be removed."""
    n, (a, b, c, d) = len(corners), _around_edge(corners, k)
    tip = _meeting(a, b, d, c)
    if tip is None:
        return None
    fewer = [tip if corner is b else corner for corner in corners if corner is not c]
    if not symmetric:
        return fewer
    twin = _nearest(corners, (c[0], -c[1])), _nearest(corners, (b[0], -b[1]))
    if twin == (k, (k + 1) % n):  # the edge is its own mirror image
        return fewer
    if None in twin or set(twin) & {k, (k + 1) % n} or n < 6:
        return None
    first = corners[twin[0] or 0]
    return _without_edge(fewer, next(j for j, corner in enumerate(fewer) if corner is first), False)


def _nearest(corners: list[Point], place: Point) -> int | None:
    """Return the index of the corner at a point; None if there is none."""
    k = min(range(len(corners)), key=lambda j: math.dist(corners[j], place))
    return k if math.dist(corners[k], place) <= ALIKE else None


def footprint_around(points: Iterable[Point], kind: str = "auto") -> Footprint:
    """Return a footprint around all points: a disc or rectangle if they nearly fill one, otherwise a polygon.

    Its values are multiples of 0.01 mm, rounded so that no point is outside by more than `LOOSE`.
    """
    held = list(points)
    hull = convex_hull(held)
    area = sum(_area((0.0, 0.0), a, b) for a, b in zip(hull, hull[1:] + hull[:1], strict=True))
    xs, ys = zip(*held, strict=True)
    xmin, xmax, ymin, ymax = min(xs), max(xs), min(ys), max(ys)
    length, width, middle = xmax - xmin, ymax - ymin, (_near((xmin + xmax) / 2), _near((ymin + ymax) / 2))
    reach = max(math.dist(middle, point) for point in held)
    if kind == "disc" or (kind == "auto" and area >= LIKE * math.pi * reach**2):
        away = max(math.hypot(*point) for point in held)
        if kind == "disc" or away <= 1.02 * reach:
            return Footprint.disc(_up(away))
        return Footprint.disc(_up(reach), middle)
    if kind == "rectangle" or (kind == "auto" and area >= LIKE * length * width):
        x, y = (0.0 if abs(m) < 5e-4 else m for m in middle)
        return Footprint.rectangle(_up(2 * max(xmax - x, x - xmin)), _up(2 * max(ymax - y, y - ymin)), (x, y))
    return _polygon_around(held, fewer_corners(hull, MAX_OUTLINE))


def _polygon_around(held: list[Point], corners: list[Point]) -> Footprint:
    """Return a polygon with rounded coordinates, offset outwards until it contains all points."""
    out = 0.0
    while True:
        # The hull contains all rounded corners; rounding may make a nearly straight corner concave.
        polygon = Footprint.polygon(convex_hull((_near(x), _near(y)) for x, y in _moved_out(corners, out)))
        if min(polygon.depth(x, y) for x, y in held) >= -LOOSE:
            return polygon
        out += STEP


def _moved_out(corners: list[Point], distance: float) -> list[Point]:
    """Offset the edges of a convex polygon outwards."""
    moved = []
    for k, (x, y) in enumerate(corners):
        (ax, ay), (bx, by) = (
            _right_of(*edge) for edge in ((corners[k - 1], (x, y)), ((x, y), corners[k + 1 - len(corners)]))
        )
        scale = distance / (1 + ax * bx + ay * by)
        moved.append((x + scale * (ax + bx), y + scale * (ay + by)))
    return moved


def _right_of(a: Point, b: Point) -> Point:
    """Return the unit vector to the right of the direction from a to b: a polygon's outward normal."""
    away = math.dist(a, b)
    return (b[1] - a[1]) / away, (a[0] - b[0]) / away


def _near(value: float) -> float:
    """Round a coordinate to 0.01 mm."""
    return round(value, 5) + 0.0  # no -0.0


def _up(value: float) -> float:
    """Round a length up to 0.01 mm, ignoring rounding errors."""
    return math.ceil((value - LOOSE) / STEP) / 1e5


def _area(a: Point, b: Point, c: Point) -> float:
    return ((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])) / 2


def _meeting(a: Point, b: Point, d: Point, c: Point) -> Point | None:
    """Return the intersection of the rays from a through b and from d through c beyond b and c; None if they do not meet."""
    ux, uy, vx, vy = b[0] - a[0], b[1] - a[1], c[0] - d[0], c[1] - d[1]
    cross = ux * vy - uy * vx
    if cross >= -1e-12:  # the rays diverge or are antiparallel
        return None
    ahead = ((c[0] - b[0]) * vy - (c[1] - b[1]) * vx) / cross
    return (b[0] + ahead * ux, b[1] + ahead * uy) if ahead >= 0 else None
