"""Robot footprints: outlines from above and their geometry."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field

from antdrive.base.errors import FieldError
from antdrive.base.plane import format_point
from antdrive.base.types import Bounds, Point

MAX_CORNERS = 32  # of a polygon
STRAIGHT = 1e-9  # corners closer to the line between their neighbours are redundant [m]


@dataclass(frozen=True)
class Footprint:
    """A robot's outline from above, in the robot's frame: x ahead, y to the left, origin at the axle's centre.

    A rectangle centred on the axle, or the convex polygon of `corners`, offset outwards by `rounding`. A disc is a
    rectangle of size zero with a rounding; a disc off the axle is a single corner with a rounding.

    Attributes:
        half_length: half the rectangle's length, along the robot's heading [m]; 0 for a polygon
        half_width: half its width [m]; 0 for a polygon
        rounding: outward offset of the outline [m]
        corners: the polygon's corners, counter-clockwise [m]; none for shapes centred on the axle
    """

    half_length: float = 0.0
    half_width: float = 0.0
    rounding: float = 0.0
    # Omitted from records if empty, so that logs of centred robots keep their hashes.
    corners: tuple[Point, ...] = field(default=(), metadata={"omit_if_default": True})

    @classmethod
    def disc(cls, radius: float, centre: Point = (0.0, 0.0)) -> Footprint:
        """Return a disc of a radius [m] around a `centre`, from the axle's centre [m]."""
        return cls(rounding=radius, corners=(centre,) if any(centre) else ())

    @classmethod
    def rectangle(cls, length: float, width: float, centre: Point = (0.0, 0.0)) -> Footprint:
        """Return a rectangle of a length along the robot's heading, a `width` and a `centre`, from the axle's centre [m]."""
        a, b, (x, y) = length / 2, width / 2, centre
        if not any(centre):
            return cls(half_length=a, half_width=b)
        front, left, rear, right = (round(side, 12) for side in (x + a, y + b, x - a, y - b))  # 0.15 - 0.45 is -0.3
        return cls(corners=((front, right), (front, left), (rear, left), (rear, right)))

    @classmethod
    def polygon(cls, points: Sequence[Sequence[float]]) -> Footprint:
        """Return the convex polygon of corners in order, clockwise or counter-clockwise: `points` (K, 2) [m].

        Raises:
            FieldError: the points are not a convex polygon, or too many.
        """
        corners = [(float(x), float(y)) for x, y in points]
        if sum(_cross((0.0, 0.0), a, b) for a, b in _around(corners)) < 0:
            corners.reverse()
        corners = [
            b for k, b in enumerate(corners) if not _is_between(corners[k - 1], b, corners[k + 1 - len(corners)])
        ]
        footprint = cls(corners=tuple(corners))
        if len(corners) < 3:
            raise FieldError("corners", "must be at least three points that are not on one line")
        footprint.require_convex()
        return footprint

    @property
    def is_disc(self) -> bool:
        """Whether the footprint is a disc around the axle's centre."""
        return self.half_length == 0 and self.half_width == 0 and not self.corners

    @property
    def radius(self) -> float:
        """Radius of the smallest disc around the footprint, centred on the axle [m]."""
        if self.corners:
            return max(math.hypot(x, y) for x, y in self.corners) + self.rounding
        return math.hypot(self.half_length, self.half_width) + self.rounding

    @property
    def inner_radius(self) -> float:
        """Radius of the largest disc within the footprint, centred on the axle [m]."""
        if self.corners:
            return self.depth(0.0, 0.0)
        return min(self.half_length, self.half_width) + self.rounding

    @property
    def bounds(self) -> Bounds:
        """Bounding box along the robot's axes: xmin, ymin, xmax, ymax [m]."""
        a, b = self.half_length + self.rounding, self.half_width + self.rounding
        if not self.corners:
            return -a, -b, a, b
        x, y = zip(*self.corners, strict=True)
        return min(x) - a, min(y) - b, max(x) + a, max(y) + b

    @property
    def box(self) -> tuple[float, float, Point] | None:
        """Length, width and centre [m] of a rectangle along the robot's axes; None for any other shape."""
        xmin, ymin, xmax, ymax = self.bounds
        # Tolerance for corners that were computed from the rectangle's centre.
        sides = (xmin, xmax), (ymin, ymax)
        aligned = all(
            min(abs(v - s) for s in side) < 1e-12 for p in self.corners for v, side in zip(p, sides, strict=True)
        )
        if self.is_disc or self.rounding or not (aligned and len(self.corners) in (0, 4)):
            return None
        return xmax - xmin, ymax - ymin, ((xmin + xmax) / 2, (ymin + ymax) / 2)

    def depth(self, x: float, y: float) -> float:
        """Return the distance from the edge of a point `x` ahead of the axle and `y` to the left, negative outside [m]."""
        if self.corners:
            return self.rounding - _beyond(self.corners, (x, y))
        ahead, aside = self.half_length - abs(x), self.half_width - abs(y)
        if ahead >= 0 and aside >= 0:
            return min(ahead, aside) + self.rounding
        return self.rounding - math.hypot(min(ahead, 0.0), min(aside, 0.0))

    def nearest(self, x: float, y: float) -> Point:
        """Return the point of the footprint without its rounding that is nearest to (`x`, `y`), as in `depth` [m]."""
        if not self.corners:
            a, b = self.half_length, self.half_width
            return min(max(x, -a), a), min(max(y, -b), b)
        if _beyond(self.corners, (x, y)) <= 0:
            return x, y
        return min((_on_edge(a, b, (x, y)) for a, b in _around(self.corners)), key=lambda at: math.dist(at, (x, y)))

    def reach(self, direction: float) -> float:
        """Return the distance from the axle's centre to the edge in a `direction`, counter-clockwise from ahead [rad] [m]."""
        low, high = 0.0, self.radius
        for _ in range(60):  # bisection: the footprint is convex and contains the axle's centre
            middle = (low + high) / 2
            inside = self.depth(middle * math.cos(direction), middle * math.sin(direction)) >= 0
            low, high = (middle, high) if inside else (low, middle)
        return low

    def outline(self, steps: int = 16) -> list[Point]:
        """Return points on the outline, counter-clockwise, `steps` for each quarter turn of a round corner [m]."""
        a, b, r = self.half_length, self.half_width, self.rounding
        corners = self.corners or ((a, b), (-a, b), (-a, -b), (a, -b))
        if not r:
            return list(corners)
        points: list[Point] = []
        for k, (x, y) in enumerate(corners):
            if not self.corners:
                first, turn = k * math.pi / 2, math.pi / 2
            elif len(corners) == 1:
                first, turn = 0.0, 2 * math.pi
            else:
                first = _outwards(corners[k - 1], (x, y))
                turn = (_outwards((x, y), corners[k + 1 - len(corners)]) - first) % (2 * math.pi)
            count = max(1, round(4 * steps * turn / (2 * math.pi)))
            angles = (first + turn * j / count for j in range(count + (len(corners) > 1)))
            points += [(x + r * math.cos(angle), y + r * math.sin(angle)) for angle in angles]
        return points

    def require_convex(self) -> None:
        """Raise FieldError unless the corners are a counter-clockwise convex polygon.

        Raises:
            FieldError: the corners are invalid.
        """
        corners = self.corners
        if len(corners) == 2 or len(corners) > MAX_CORNERS:
            raise FieldError("corners", f"must be 1 or 3 to {MAX_CORNERS}, got {len(corners)}")
        if not all(math.isfinite(v) and abs(v) < 1e6 for corner in corners for v in corner):
            raise FieldError("corners", "must be finite")
        if corners and (self.half_length or self.half_width):
            raise FieldError("corners", "must not be given with half_length and half_width")
        if len(corners) == 1:
            return
        for k, (x, y) in enumerate(corners):
            if not _cross(corners[k - 1], (x, y), corners[k + 1 - len(corners)]) > 0:
                raise FieldError("corners", f"must be a convex polygon; it turns inwards at {format_point((x, y))}")
        for a, b in _around(corners):
            if any(not _cross(a, b, c) > 0 for c in corners if c not in (a, b)):
                raise FieldError("corners", "must go once around a convex polygon; its edges cross")


def _around(corners: Sequence[Point]) -> Iterator[tuple[Point, Point]]:
    """Return pairs of each corner and the next one."""
    return zip(corners, (*corners[1:], *corners[:1]), strict=True)


def _cross(a: Point, b: Point, c: Point) -> float:
    """Return twice the signed area of a triangle, positive if c is left of the line from a to b [m^2]."""
    return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])


def _beyond(corners: Sequence[Point], point: Point) -> float:
    """Return the signed distance from a polygon to a point, negative inside [m]."""
    over = max(-_cross(a, b, point) / math.dist(a, b) if a != b else math.inf for a, b in _around(corners))
    return over if over <= 0 else min(math.dist(_on_edge(a, b, point), point) for a, b in _around(corners))


def _on_edge(a: Point, b: Point, c: Point) -> Point:
    """Return the point of the segment a-b nearest to c."""
    ex, ey = b[0] - a[0], b[1] - a[1]
    length2 = ex * ex + ey * ey
    fraction = min(max(((c[0] - a[0]) * ex + (c[1] - a[1]) * ey) / length2, 0.0), 1.0) if length2 else 0.0
    return a[0] + fraction * ex, a[1] + fraction * ey


def _is_between(a: Point, b: Point, c: Point) -> bool:
    """Return whether b lies on the segment from a to c."""
    away = math.dist(a, c)
    if math.dist(a, b) <= STRAIGHT:
        return True
    ahead = (b[0] - a[0]) * (c[0] - b[0]) + (b[1] - a[1]) * (c[1] - b[1])
    return away > 0 and ahead > 0 and abs(_cross(a, b, c)) <= STRAIGHT * away


def _outwards(a: Point, b: Point) -> float:
    """Return the direction of the outward normal of the edge from a to b [rad]."""
    return math.atan2(a[0] - b[0], b[1] - a[1])
