"""Collision shapes of SDF as exact discs or convex pieces, and the discs that cover pieces between two heights.

A piece is the convex hull of a few points. The shape of each piece over the floor, between the heights, is rasterised on a
lattice through the origin: cells that it reaches into are blocked, and `cellmap.cover` covers them.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Sequence
from xml.etree import ElementTree as ET

import numpy as np

from antdrive.base.errors import input_error
from antdrive.base.plane import tidy
from antdrive.base.types import Floats, Point
from antdrive.worlds.formats.cellmap import MAX_DISCS, SLACK, cover_inside
from antdrive.worlds.formats.xml import numbers_in
from antdrive.worlds.limits import MAX_COORDINATE
from antdrive.worlds.world import Disc

MAX_TILT = 1e-3  # largest tilt of an upright cylinder [rad]
ROUND = ("cylinder", "sphere", "cone", "capsule", "ellipsoid")
SIDES, ARC = 64, 32  # of a polygon around a circle, and of one around half of a circle
FACETS = 1 / (math.cos(math.pi / SIDES) * math.cos(math.pi / ARC / 2)) - 1  # how far these reach beyond it [radii]
TILE = 512  # cells along a side of an area that is rasterised at once
MAX_TILES = 500  # with obstacles
BAND = (0.01, 2.0)  # default heights between which shapes are obstacles, above the floor [m]
CELL, COARSEST = 0.02, 1.0  # smallest and largest default side of a cell [m]
MOST_RIMS = 60_000  # sides of blocked cells along free ones, of default cells: about 8,000 discs
HIGHEST_FLOOR, MOST_GROUND = 0.3, 0.75  # height [m] of plates that are the floor, and their least share of the ground
MAX_POINTS = 10_000  # of a polyline


class Unsupported(Exception):
    """A part of a world that cannot be imported; the message is the reason."""


def numbers(text: str | None, count: int, key: str) -> Floats:
    """Parse so many finite numbers."""
    values = numbers_in(text, count)
    if values is None:
        raise Unsupported(
            f"{key} must be {f'{count} numbers' if count > 1 else 'a number'} of at most {MAX_COORDINATE:g}, "
            f"got {(text or '').strip()[:40]!r}"
        )
    return values


def _sizes(shape: ET.Element, *keys: str, count: int = 1) -> Floats:
    """Parse so many positive numbers under each key."""
    values = np.concatenate([numbers(shape.findtext(key), count, key) for key in keys])
    if not (values > 0).all():
        raise Unsupported(f"a {shape.tag} of {' and '.join(keys)} {' '.join(f'{v:g}' for v in values)}")
    return values


def _round(shape: ET.Element) -> tuple[Floats, Floats]:
    """Return the profile of a body of revolution about z, (P, 2): z and radius, and the factors that stretch it, (3,)."""
    half = np.linspace(-math.pi / 2, math.pi / 2, ARC + 1)
    arc = np.column_stack([np.sin(half), np.cos(half)]) / math.cos(math.pi / ARC / 2)
    if shape.tag == "sphere":
        return arc * _sizes(shape, "radius"), np.ones(3)
    if shape.tag == "ellipsoid":
        return arc, _sizes(shape, "radii", count=3)
    radius, length = _sizes(shape, "radius", "length")
    ends = np.array([(-length / 2, radius), (length / 2, 0.0 if shape.tag == "cone" else radius)])
    if shape.tag != "capsule":
        return ends, np.ones(3)
    return arc * radius + np.sign(arc[:, :1]) * [length / 2, 0.0], np.ones(3)


def _upright(profile: Floats, place: Floats, low: float, high: float) -> Disc | None:
    """Return the disc of a body of revolution about an upright axis; None if nothing of it is between the heights."""
    z, radius = place[2, 3] + place[2, 2] * profile[:, 0], math.hypot(*place[:2, 0]) * profile[:, 1]
    order = np.argsort(z, kind="stable")
    inside = radius[(z > low) & (z < high)].tolist()
    inside += [np.interp(h, z[order], radius[order]) for h in (low, high) if z.min() < h < z.max()]
    if not max(inside, default=0.0) > 0:
        return None
    return Disc(float(place[0, 3]), float(place[1, 3]), float(max(inside)), float(z.max()))


def _wedges(profile: Floats) -> Floats:
    """Return a body of revolution as wedges around its axis, (K, 6, 3)."""
    turn = 2 * math.pi * np.arange(SIDES + 1) / SIDES
    ring = np.column_stack([np.cos(turn), np.sin(turn)]) / math.cos(math.pi / SIDES)
    points = np.empty((len(profile), SIDES + 1, 3))
    points[:, :, :2], points[:, :, 2] = profile[:, 1, None, None] * ring, profile[:, :1]
    axis = np.broadcast_to(points * [0.0, 0.0, 1.0], points.shape)
    corners = [points[:-1, :-1], points[:-1, 1:], points[1:, :-1], points[1:, 1:], axis[:-1, :-1], axis[1:, :-1]]
    return np.stack(corners, axis=2).reshape(-1, 6, 3)


def _extruded(shapes: Sequence[ET.Element]) -> Floats:
    """Return polylines as upright prisms, (K, 8, 3); what an odd number of them encloses is solid, as in Gazebo."""
    ends, height = [], max(_sizes(shape, "height")[0] for shape in shapes)
    for shape in shapes:
        points = np.array([numbers(point.text, 2, "point") for point in shape.findall("point")])
        if not 3 <= len(points) <= MAX_POINTS:
            raise Unsupported(f"a polyline of {len(points)} points")
        ends.append(np.stack([points, np.roll(points, -1, axis=0)], axis=1))
    edges = np.concatenate(ends)
    quads = [edges[:, [0, 1, 0, 1]]]
    for low, high in itertools.pairwise(np.unique(edges[:, :, 1])):
        across = edges[(edges[:, :, 1].min(axis=1) <= low) & (edges[:, :, 1].max(axis=1) >= high)]
        share = (np.array([low, high]) - across[:, :1, 1]) / (across[:, 1:, 1] - across[:, :1, 1])
        x = across[:, :1, 0] + share * (across[:, 1:, 0] - across[:, :1, 0])
        x = x[np.argsort(x.sum(axis=1))][: len(x) // 2 * 2].reshape(-1, 4)
        quads.append(np.stack([x, np.broadcast_to([low, high, low, high], x.shape)], axis=2))
    flat = np.concatenate(quads)
    return np.concatenate([np.insert(flat, 2, z, axis=2) for z in (0.0, height)], axis=1)


def solid(
    geometry: ET.Element, place: Floats, band: tuple[float, float], mesh: Callable[[ET.Element], Floats]
) -> Disc | Floats | float | str:
    """Return a <geometry> between two heights: a disc, convex pieces (K, V, 3), or why nothing of it is there.

    Of a ground plane, return the height [m].

    `place` (4, 4) includes the scale; `mesh` returns the triangles (K, 3, 3) of a <mesh>.
    """
    shape = next(iter(geometry), None)
    if shape is None or shape.tag == "empty":
        return "empty"
    if shape.tag == "plane":
        normal = place[:3, :3] @ numbers(shape.findtext("normal") or "0 0 1", 3, "normal")
        if math.hypot(normal[0], normal[1]) > MAX_TILT * normal[2] or not normal[2] > 0:
            raise Unsupported("a plane that does not face up")
        return round(float(place[2, 3]), 6)
    if shape.tag in ROUND:
        profile, stretch = _round(shape)
        place = place @ np.diag([*stretch, 1.0])
        if shape.tag == "sphere" and np.ptp(np.linalg.norm(place[:3, :3], axis=0)) < 1e-9:
            place = np.hstack([np.linalg.norm(place[:3, 0]) * np.eye(4)[:, :3], place[:, 3:]])
        across, axis = np.linalg.norm(place[:3, :3], axis=0), place[:3, 2]
        if math.hypot(axis[0], axis[1]) <= MAX_TILT * across[2] and abs(across[0] - across[1]) <= 1e-9:
            z = place[2, 3] + place[2, 2] * profile[:, 0]
            return _upright(profile, place, *band) or ("flat" if z.max() <= band[0] else "above")
        pieces = _wedges(profile)
    elif shape.tag == "box":
        pieces = np.array([list(itertools.product((-0.5, 0.5), repeat=3))]) * _sizes(shape, "size", count=3)
    elif shape.tag == "polyline":
        pieces = _extruded(geometry.findall("polyline"))
    elif shape.tag == "mesh":
        pieces = mesh(shape)
    else:
        raise Unsupported("uneven ground" if shape.tag == "heightmap" else f"shape {shape.tag}")
    pieces = pieces @ place[:3, :3].T + place[:3, 3]
    if not (np.abs(pieces) <= MAX_COORDINATE).all():
        raise Unsupported(f"reaches beyond {MAX_COORDINATE:g} m")
    z = pieces[:, :, 2]
    reaching = pieces[(z.max(axis=1) > band[0]) & (z.min(axis=1) < band[1])]
    return reaching if len(reaching) else "flat" if z.max() <= band[0] else "above"


def floor_height(solids: Sequence[Floats]) -> float:
    """Return the height of the floor [m]: of the top of low plates that cover most of the ground, or 0."""
    low = [pieces[pieces[:, :, 2].max(axis=1) <= HIGHEST_FLOOR] for pieces in solids]
    if not any(map(len, low)):
        return 0.0
    points = np.concatenate([pieces[:, :, :2].reshape(-1, 2) for pieces in solids])
    corner, extent = points.min(axis=0), np.ptp(points, axis=0)
    cell = float(extent.max()) / TILE
    tops = _rasterised((corner[0], corner[1]), low, (0.0, HIGHEST_FLOOR), cell)
    areas = np.bincount((tops[tops > 0] / BAND[0]).round().astype(np.int64), minlength=1) * cell**2
    return BAND[0] * float(areas.argmax()) if areas.max() > MOST_GROUND * extent.prod() else 0.0


def cover_pieces(
    solids: Sequence[Floats], band: tuple[float, float], cell: float | None = None, overhang: float | None = None
) -> tuple[list[Disc], float]:
    """Cover convex pieces (K, V, 3) between two heights; return discs, and the largest protrusion beyond the pieces [m].

    By default the side of a cell is 0.02 m, doubled until a few thousand discs suffice, and the overhang beyond blocked
    cells is one cell.
    """
    side = CELL if cell is None else cell
    tiles = _tiles(solids, side)
    while cell is None and side < COARSEST and (tiles is None or _rims(tiles, band, side) > MOST_RIMS):
        side *= 2
        tiles = _tiles(solids, side)
    if tiles is None:
        raise input_error(f"its shapes reach over too many cells of {side:g} m; give larger ones with --resolution")
    discs: list[Disc] = []
    reach = 0.0
    for number, tile in enumerate(sorted(tiles), 1):
        x0, y0 = tile
        tops = _rasterised(tile, tiles[tile], band, side)
        blocked, most = tops > -np.inf, side if overhang is None else overhang
        covered = cover_inside(blocked, side, (x0, y0), most, number / len(tiles))
        reach = max(reach, covered.overhang)
        for x, y, radius in covered.discs.tolist():
            left, right, low, high = (
                int(max(v, 0.0) / side) for v in (x - radius - x0, x + radius - x0, y - radius - y0, y + radius - y0)
            )
            discs.append(Disc(tidy(x), tidy(y), radius, float(tops[low : high + 1, left : right + 1].max())))
    if len(discs) > MAX_DISCS:
        fewer = "a larger --resolution or --overhang needs fewer"
        raise input_error(f"needs {len(discs)} cylinders; the limit is {MAX_DISCS}; {fewer}")
    return discs, reach + math.sqrt(2.0) * side


def _tiles(solids: Sequence[Floats], cell: float) -> dict[Point, list[Floats]] | None:
    """Return the pieces in each tile of cells by its lower left corner [m]; None if there are too many tiles."""
    tiles: dict[Point, list[Floats]] = {}
    for pieces in solids:
        ends = np.hstack([pieces[:, :, :2].min(axis=1), pieces[:, :, :2].max(axis=1)])
        spans, span_of = np.unique(np.floor(ends / (TILE * cell)).astype(np.int64), axis=0, return_inverse=True)
        for n, (left, below, right, above) in enumerate(spans.tolist()):
            if len(tiles) + (right - left + 1) * (above - below + 1) > MAX_TILES:
                return None
            for col, row in itertools.product(range(left, right + 1), range(below, above + 1)):
                tiles.setdefault((col * TILE * cell, row * TILE * cell), []).append(pieces[span_of.ravel() == n])
    return tiles


def _rims(tiles: dict[Point, list[Floats]], band: tuple[float, float], cell: float) -> int:
    """Return how many blocked cells have a free neighbour to the right or above."""
    blocked = (_rasterised(corner, parts, band, cell) > -np.inf for corner, parts in tiles.items())
    return sum(int(np.count_nonzero(np.diff(cells, axis=axis))) for cells in blocked for axis in (0, 1))


def _rasterised(corner: Point, parts: Sequence[Floats], band: tuple[float, float], cell: float) -> Floats:
    """Return the tops of pieces over the cells (TILE, TILE) from a lower left corner [m]; -inf where none are."""
    from antdrive.worlds.formats._kernels_cover import mark_pieces

    tops = np.full((TILE, TILE), -np.inf)
    for pieces in parts:
        mark_pieces(pieces, *band, np.array(corner), cell, SLACK, tops)
    return tops
