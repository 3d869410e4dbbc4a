"""From a plan to a line worth driving: pulled taut in the plan's own corridor, and eased off the discs where that is cheap.

The shortest line among discs that is homotopic to a given one consists of tangents and of arcs along the discs. It is
found by carrying the end of a string along the given line, as the funnel algorithm does in a sleeve of triangles (Lee &
Preparata, *Euclidean shortest paths in the presence of rectilinear barriers*, Networks 14, 1984; for homotopy among
obstacles Hershberger & Snoeyink, *Computing minimum length paths of a given homotopy class*, Comput. Geom. 4, 1994).
Here the bends are the discs themselves, so no triangles are needed: between two events the string's last link turns about
one disc, and the next event is the first of its tangents to come. Walls take no part, as a line within a convex room is
never shortened by leaving it.

A wide line is the taut one among discs that have grown: each by up to a preferred clearance, in a gap by no more than its
share of it.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from antdrive.planners.anyangle.tangent import Arc, Line, TangentPath
from antdrive.planners.plan import PlanResult
from antdrive.planners.smoothing.cells import route_along
from antdrive.worlds import Bounds, Floats, Route, Task, World, polyline_clearance, segment_clearance
from antdrive.worlds.errors import FieldError
from antdrive.worlds.plane import polyline_length

if TYPE_CHECKING:  # brings the compiler with it
    from antdrive.worlds import Grid

#: What a route can be: the plan's own line, that line pulled taut, or one that keeps to the middle of gaps.
SMOOTHINGS: tuple[str, ...] = ("none", "taut", "clearance")

SLACK = 1e-9  # m: what falls short of the clearance, or is longer than allowed, by no more than this is rounding
SHRINK = 2e-9  # m: strings are first pulled among discs this much smaller, which the plan's line surely clears


def smooth(
    plan: PlanResult,
    grid: Grid,
    task: Task,
    *,
    kind: str = "taut",
    clearance: float = 0.2,
    stretch: float = 0.03,
    bulge: float = 5e-4,
) -> Route:
    """The route for a plan: its own line (`grid`), that line pulled taut, or taut but in the middle of gaps (`wide`).

    A wide route keeps up to `clearance` [m] more from discs than the grid asks and is at most `stretch` longer than the
    taut one. Corners stand off arcs by at most `bulge` [m]. A refined route keeps the grid's clearance exactly, passes
    every disc on the same side as the plan's line and is never longer than it, or than the plan's cells. What cannot be
    refined so stays as planned, and the route's note tells why. Where the plan's line itself comes closer than the grid
    asks, as a start with too little room does, it is kept.

    Raises:
        ValueError: the plan has no path, an unknown kind, or a setting outside its range.
    """
    if kind not in SMOOTHINGS:
        raise FieldError("kind", f"unknown route {kind!r}; choose from {', '.join(SMOOTHINGS)}")
    for key, value in (("clearance", clearance), ("stretch", stretch)):
        if not (math.isfinite(value) and value >= 0):
            raise FieldError(key, f"must be at least 0, got {value:g}")
    if not (math.isfinite(bulge) and bulge > 0):
        raise FieldError("bulge", f"must be greater than 0, got {bulge:g}")
    line = route_along(plan, grid, task)
    if kind == "none":
        return line
    world, inflate = task.world, grid.inflate
    spare = max(0.0, plan.cost - line.length) if math.isfinite(plan.cost) else 0.0
    extra = clearance if kind == "clearance" else 0.0
    xy, curvature, kinds, notes = [line.xy[:1]], [np.zeros(1)], [], []
    for run, clear in _runs(line.xy, world, inflate):
        piece = Piece(run, np.zeros(len(run)))
        if clear:
            piece = _refined(run, world, inflate, extra, stretch, spare, bulge)
            spare -= max(0.0, _length(piece.xy) - _length(run))
            kinds.append(piece.kind)
        elif len(run) > 2 or not (run[0] == line.xy[0]).all():
            piece = replace(piece, note="the plan's line comes closer than the clearance and is kept there")
        if piece.note:
            notes.append(piece.note)
        curvature[-1] = np.append(curvature[-1][:-1], piece.curvature[0])
        xy.append(piece.xy[1:])
        curvature.append(piece.curvature[1:])
    made = min(kinds, key=SMOOTHINGS.index, default="none")
    return Route(np.vstack(xy), np.concatenate(curvature), made, "; ".join(dict.fromkeys(notes)))


def pull_taut(xy: npt.ArrayLike, discs: npt.ArrayLike, bounds: Bounds, inflate: float) -> TangentPath | None:
    """The shortest path that keeps `inflate` [m] from all discs (N, 3) and passes each as the polyline (M, 2) does.

    None where the polyline itself does not keep it.
    """
    line = np.ascontiguousarray(xy, dtype=np.float64).reshape(-1, 2)
    built = np.ascontiguousarray(discs, dtype=np.float64).reshape(-1, 3)
    if not _clears(line, built, bounds, inflate):
        return None
    string = _pulled(line, built, inflate)
    return None if string is None else string.path


@dataclass(frozen=True, eq=False)
class Piece:
    """A part of a route."""

    xy: Floats  # (N, 2) [m]
    curvature: Floats  # (N,) from each point on [1/m]
    kind: str = "none"
    note: str = ""


@dataclass(frozen=True, eq=False)
class String:
    """A taut string as the kernels tell it: K contacts and K + 1 links."""

    disc: npt.NDArray[np.int64]  # (K,) which disc it bends around
    turn: Floats  # (K,) 1 left, -1 right
    sweep: Floats  # (K,) [rad]
    links: Floats  # (K + 1, 4) x, y from, x, y to [m]
    discs: Floats  # (N, 3) the discs that it goes round, grown to the radii of its arcs [m]

    @property
    def length(self) -> float:
        """[m]."""
        from antdrive.planners.smoothing import _kernels_smooth as _kernels_refine

        return float(_kernels_refine.way_length(self.disc, self.sweep, self.links, self.discs))

    @property
    def path(self) -> TangentPath:
        """Its lines and arcs."""
        pieces: list[Line | Arc] = []
        for i, (ax, ay, bx, by) in enumerate(self.links.tolist()):
            if (ax, ay) != (bx, by):
                pieces.append(Line((ax, ay), (bx, by)))
            if i < len(self.disc) and self.sweep[i] > SLACK:
                x, y, radius = self.discs[self.disc[i]].tolist()
                begin, sweep = math.atan2(by - y, bx - x), float(self.turn[i] * self.sweep[i])
                pieces.append(Arc((x, y), radius, begin, sweep))
        return TangentPath(tuple(pieces))

    def clearance(self, world: World) -> float:
        """The exact distance to the nearest disc surface or wall [m]."""
        from antdrive.planners.smoothing import _kernels_smooth as _kernels_refine

        box = np.asarray(world.bounds, dtype=np.float64)
        return float(
            _kernels_refine.way_clearance(self.disc, self.turn, self.sweep, self.links, self.discs, world.discs, box)
        )

    def drawn(self, world: World, inflate: float, bulge: float) -> tuple[Floats, Floats]:
        """As a polyline (M, 2) [m] whose corners stand off its arcs by at most `bulge`, and the curvature (M,)."""
        from antdrive.planners.smoothing import _kernels_smooth as _kernels_refine

        box = np.asarray(world.bounds, dtype=np.float64)
        xy, curvature = _kernels_refine.way_points(
            self.disc, self.turn, self.sweep, self.links, self.discs, world.discs, box, inflate, bulge
        )
        return xy, curvature


def _runs(xy: Floats, world: World, inflate: float) -> Iterator[tuple[Floats, bool]]:
    """The polyline cut where it starts or ceases to keep the clearance, each part with whether it does."""
    clear = segment_clearance(world, xy[:-1], xy[1:]) >= inflate - 1.01 * SLACK  # as joined lines just have it
    cuts = [0, *(np.flatnonzero(clear[1:] != clear[:-1]) + 1).tolist(), len(clear)]
    for first, last in itertools.pairwise(cuts):
        yield np.ascontiguousarray(xy[first : last + 1]), bool(clear[first])


def _clears(xy: Floats, discs: Floats, bounds: Bounds, inflate: float) -> bool:
    from antdrive.worlds import _kernels

    room = np.empty(len(xy) - 1)
    box = np.asarray(bounds, dtype=np.float64)
    _kernels.segment_clearances(np.ascontiguousarray(xy[:-1]), np.ascontiguousarray(xy[1:]), discs, box, room)
    return bool((room >= inflate - SLACK).all())


def _refined(
    line: Floats, world: World, inflate: float, extra: float, stretch: float, spare: float, bulge: float
) -> Piece:
    """A clear polyline refined as far as its checks allow."""
    own = _length(line)
    taut = _pulled(line, world.discs, inflate)
    if taut is None:
        return Piece(line, np.zeros(len(line)), note="the line could not be pulled taut")
    note = ""
    for fine in (bulge, bulge / 100.0):  # a plan whose arcs are drawn finer than ours is the shorter one
        drawn = taut.drawn(world, inflate, fine)
        note = _fault(taut, drawn[0], line, world, inflate, own)
        if not note:
            break
    if note:
        return Piece(line, np.zeros(len(line)), note=note)
    piece = Piece(*drawn, "taut")
    if not extra:
        return piece
    found = _widened(taut, piece.xy, world, inflate, extra, min(taut.length * (1.0 + stretch), own + spare), bulge)
    return replace(piece, note="no room or length to spare for a wider line") if found is None else found


def _pulled(line: Floats, discs: Floats, inflate: float) -> String | None:
    """The taut string in the class of a clear polyline."""
    from antdrive.planners.smoothing import _kernels_smooth as _kernels_refine

    grown = discs[_kernels_refine.outermost(discs)]
    grown[:, 2] += inflate - SHRINK
    found, disc, turn, sweep = _kernels_refine.pull(line, grown)
    if not found:
        return None
    ends = np.ascontiguousarray(line[[0, -1]])
    for more in (SHRINK, SHRINK * 0.6):  # of the exact radius there may be none where a gap is closed by rounding
        exact = grown.copy()
        exact[:, 2] += more
        string = _settled(disc, turn, sweep, exact, ends)
        if string is not None:
            return string
    return None


def _settled(disc: npt.NDArray[np.int64], turn: Floats, sweep: Floats, discs: Floats, ends: Floats) -> String | None:
    from antdrive.planners.smoothing import _kernels_smooth as _kernels_refine

    found, disc, turn, sweep, links = _kernels_refine.settle(disc, turn, sweep, discs, ends)
    return String(disc, turn, sweep, links, discs) if found else None


def _fault(string: String, xy: Floats, line: Floats, world: World, inflate: float, longest: float) -> str:
    """What is wrong with a refined line, empty if nothing."""
    from antdrive.planners.smoothing import _kernels_smooth as _kernels_refine

    if _length(xy) > longest + SLACK:
        return "the refined line would be longer than the plan's"
    if min(string.clearance(world), polyline_clearance(world, xy)) < inflate - SLACK:
        return "the refined line would come closer than the clearance"
    if _kernels_refine.encloses(line, xy, world.discs):
        return "the refined line would pass an obstacle on its other side"
    return ""


def _length(xy: Floats) -> float:
    return polyline_length(xy)


def _widened(
    taut: String, xy: Floats, world: World, inflate: float, extra: float, longest: float, bulge: float
) -> Piece | None:
    """The widest line of at most a length, by discs that grow together; None where not even a little is possible."""
    from antdrive.planners.smoothing import _kernels_smooth as _kernels_refine

    near = np.flatnonzero(_kernels_refine.within(xy, taut.discs, 2.0 * extra))
    discs = np.ascontiguousarray(taut.discs[near])
    disc = np.searchsorted(near, taut.disc)
    xmin, ymin, xmax, ymax = world.bounds
    box = np.array([xmin + inflate, ymin + inflate, xmax - inflate, ymax - inflate])
    ends = np.ascontiguousarray(xy[[0, -1]])
    room = np.empty(len(discs))
    _kernels_refine.spare(xy, discs, box, ends, extra, room)

    def grown(part: float) -> Piece | None:
        wider = discs.copy()
        wider[:, 2] += np.minimum(room, part * extra)
        string = _settled(disc, taut.turn, taut.sweep, wider, ends)
        if string is None or string.length > longest + SLACK:
            return None
        drawn = string.drawn(world, inflate, bulge)
        return None if _fault(string, drawn[0], xy, world, inflate, longest) else Piece(*drawn, "clearance")

    best = grown(1.0)
    low, high = 0.0, 1.0
    for _ in range(0 if best else 10):
        middle = 0.5 * (low + high)
        piece = grown(middle)
        if piece is None:
            high = middle
        else:
            best, low = piece, middle
    return best
