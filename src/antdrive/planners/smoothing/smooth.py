"""Path smoothing: string pulling within the plan's homotopy class, with more clearance where there is room.

The shortest line among discs that is homotopic to a given one consists of tangents and of arcs along the
discs. The end of a string is carried along the given line, as in the funnel algorithm for a sleeve of triangles
(Lee & Preparata, *Euclidean shortest paths in the presence of rectilinear barriers*, Networks 14, 1984; for
homotopy among obstacles Hershberger & Snoeyink, *Computing minimum length paths of a given homotopy class*,
Comput. Geom. 4, 1994). Here the string bends around the discs directly, without triangles: between two events
its last link turns about one disc, and the next event is the first tangent it meets. Walls are ignored, as
leaving a convex room never shortens a line.

A line with more clearance is the taut line among grown discs: each grows by up to a preferred clearance, and
in a gap by no more than its half of the gap.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from antdrive.base import Bounds, Floats
from antdrive.base.errors import FieldError
from antdrive.base.plane import arc_lengths, polyline_length, segment_lengths
from antdrive.planners.anyangle.tangent import Arc, Line, TangentPath
from antdrive.planners.plan import PlanResult
from antdrive.planners.smoothing.sweeps import smooth_lines
from antdrive.worlds import Grid, Route, Task, World, point_clearance, segment_clearance

if TYPE_CHECKING:
    from antdrive.worlds import Grid


def route_along(plan: PlanResult, grid: Grid, task: Task) -> Route:
    """Return the plan's line in metres from the exact start to the goal, without collinear points.

    The first or last point of the plan is omitted if the straight line past it keeps the grid's clearance. This
    avoids a kink between the exact end and the centre of its cell. If the goal has less than the grid's
    clearance, the route ends at the plan's last point.

    Args:
        plan: a plan with a path
        grid: the plan's grid
        task: the task of the grid

    Raises:
        ValueError: the plan has no path.
    """
    return Route(_points_along(plan, grid, task))


def _points_along(plan: PlanResult, grid: Grid, task: Task) -> Floats:
    """Return the points of the plan's line (N, 2), which differ [m]."""
    if not plan.solved:
        raise FieldError("plan", "has no path to follow")
    xy = _join(grid.xy(plan.line), np.array(task.start[:2]), grid, task)
    if point_clearance(task.world, [task.goal])[0] >= grid.inflate - 1e-9:
        xy = _join(xy[::-1], np.array(task.goal), grid, task)[::-1]
    xy = _straightened(xy)
    if np.ptp(xy, axis=0).max() < 1e-6:
        # The robot is already at the goal; a route needs two points, so it is 0.1 mm long.
        yaw = task.start[2]
        xy = np.vstack([xy[0], xy[0] + 1e-4 * np.array([math.cos(yaw), math.sin(yaw)])])
    return xy


def _join(xy: Floats, end: Floats, grid: Grid, task: Task) -> Floats:
    if len(xy) > 1 and segment_clearance(task.world, [end], [xy[1]])[0] >= grid.inflate - 1e-9:
        xy = xy[1:]
    return np.vstack([end, xy])


def _straightened(xy: Floats) -> Floats:
    far = segment_lengths(xy[:-1]) > 1e-6  # points that differ only by rounding define no direction
    xy = np.vstack([xy[:1], xy[1:-1][far], xy[-1:]])
    if len(xy) > 2 and np.hypot(*(xy[-1] - xy[-2])) <= 1e-6:
        xy = np.vstack([xy[:-2], xy[-1:]])
    ahead, behind = xy[2:] - xy[1:-1], xy[1:-1] - xy[:-2]
    cross = ahead[:, 0] * behind[:, 1] - ahead[:, 1] * behind[:, 0]
    straight = (np.abs(cross) < 1e-12) & ((ahead * behind).sum(axis=1) > 0)
    return xy[np.concatenate(([True], ~straight, [True]))]


#: The kinds of smoothing: the plan's line, that line pulled taut, or taut with more clearance where there is room.
SMOOTHINGS: tuple[str, ...] = ("none", "taut", "clearance")

#: Reasons to reject a smoothed line, by the return value of the kernel `fault`.
REJECTIONS: tuple[str, ...] = (
    "",
    "the smoothed line would be longer than the plan's",
    "the smoothed line would come closer than the clearance",
    "the smoothed line would pass an obstacle on its other side",
)

SLACK = 1e-9  # rounding tolerance of clearances and lengths [m]
SHRINK = 2e-9  # strings are first pulled among discs smaller by this, which the plan's line certainly clears [m]


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
    """Smooth a plan into a route.

    A smoothed route keeps the grid's clearance exactly, passes every disc on the same side as the plan's
    line, and is never longer than that line or than the plan's cells. Parts that cannot be smoothed this way
    stay as planned, and the route's note gives the reason. Where the plan's line itself comes closer than the
    grid's clearance, for example at a start close to a disc, the line is kept.

    Args:
        plan: a plan with a path
        grid: the plan's grid
        task: the task of the grid
        kind: `none` for the plan's line, `taut` for that line pulled taut, `clearance` for a taut line with more
            distance from discs where there is room
        clearance: maximum additional clearance of the kind `clearance` [m]
        stretch: maximum additional length of the kind `clearance`, relative to the taut line
        bulge: maximum distance of the route's corners from an arc [m]

    Raises:
        ValueError: the plan has no path, the kind is unknown, or a setting is out of range.
    """
    if kind not in SMOOTHINGS:
        raise FieldError("kind", f"unknown smoothing {kind!r}; choose from {', '.join(SMOOTHINGS)}")
    for key, value in (("clearance", clearance), ("stretch", stretch)):
        if not (math.isfinite(value) and value >= 0):
            raise FieldError(key, f"must be at least 0, got {value:g}")
    if not (math.isfinite(bulge) and bulge > 0):
        raise FieldError("bulge", f"must be greater than 0, got {bulge:g}")
    if grid.turns:
        return smooth_lines(plan, grid, task, kind)
    line = _points_along(plan, grid, task)
    if kind == "none":
        return Route(line)
    world, inflate = task.world, grid.inflate
    spare = max(0.0, plan.cost - arc_lengths(line).item(-1)) if math.isfinite(plan.cost) else 0.0
    extra = clearance if kind == "clearance" else 0.0
    xy, curvature, kinds, notes = [line[:1]], [np.zeros(1)], [], []
    for run, clear in _runs(line, world, inflate):
        piece = Piece(run, np.zeros(len(run)))
        if clear:
            piece = _smoothed(run, world, inflate, extra, stretch, spare, bulge)
            spare -= max(0.0, polyline_length(piece.xy) - polyline_length(run))
            kinds.append(piece.kind)
        elif len(run) > 2 or not (run[0] == line[0]).all():
            piece = replace(piece, note="the plan's line comes closer than the clearance and is kept there")
        if piece.note:
            notes.append(piece.note)
        curvature[-1] = np.append(curvature[-1][:-1], piece.curvature[0])
        xy.append(piece.xy[1:])
        curvature.append(piece.curvature[1:])
    made = min(kinds, key=SMOOTHINGS.index, default="none")
    return Route(np.vstack(xy), np.concatenate(curvature), made, "; ".join(dict.fromkeys(notes)))


def pull_taut(xy: npt.ArrayLike, discs: npt.ArrayLike, bounds: Bounds, inflate: float) -> TangentPath | None:
    """Return the shortest path that keeps a distance from all discs and passes each on the same side as a polyline.

    Args:
        xy: the polyline (M, 2) [m]
        discs: the discs (N, 3) as x, y, radius [m]
        bounds: the walls as xmin, ymin, xmax, ymax [m]
        inflate: the distance to keep [m]

    Returns:
        The path, or None if the polyline itself does not keep the distance.
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

    xy: Floats  # points (N, 2) [m]
    curvature: Floats  # curvature from each point on (N,) [1/m]
    kind: str = "none"  # kind of smoothing
    note: str = ""  # why it is not smoothed as requested; empty if it is


@dataclass(frozen=True, eq=False)
class TautString:
    """A taut string with K contacts, where it bends around discs, and K + 1 straight links."""

    disc: npt.NDArray[np.int64]  # index of the disc at each contact (K,)
    turn: Floats  # direction of the bend: 1 left, -1 right (K,)
    sweep: Floats  # angle of the bend (K,) [rad]
    links: Floats  # ends of each link as x, y from and x, y to (K + 1, 4) [m]
    discs: Floats  # the discs, with the radii of the arcs (N, 3) [m]

    @property
    def length(self) -> float:
        """Length [m]."""
        from antdrive.planners.smoothing import _kernels_smooth as kernels

        return float(kernels.string_length(self.compiled))

    @property
    def path(self) -> TangentPath:
        """Lines and arcs of the string."""
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
        """Return the exact distance to the nearest disc surface or wall [m]."""
        from antdrive.planners.smoothing import _kernels_smooth as kernels

        box = np.asarray(world.bounds, dtype=np.float64)
        return float(kernels.string_clearance(self.compiled, world.discs, box))

    def drawn(self, world: World, inflate: float, bulge: float) -> tuple[Floats, Floats]:
        """Return a polyline (M, 2) [m] with corners at most `bulge` from the arcs, and its curvature (M,)."""
        from antdrive.planners.smoothing import _kernels_smooth as kernels

        box = np.asarray(world.bounds, dtype=np.float64)
        xy, curvature = kernels.string_points(self.compiled, world.discs, box, inflate, bulge)
        return xy, curvature

    @property
    def compiled(self) -> Any:
        """The string as a record for kernels."""
        from antdrive.planners.smoothing import _kernels_smooth as kernels

        return kernels.String(kernels.Contacts(self.disc, self.turn, self.sweep), self.links, self.discs)


def _runs(xy: Floats, world: World, inflate: float) -> Iterator[tuple[Floats, bool]]:
    """Yield the parts of a polyline that keep the clearance and those that do not, and whether each keeps it."""
    clear = (
        segment_clearance(world, xy[:-1], xy[1:]) >= inflate - 1.01 * SLACK
    )  # joined lines have exactly the clearance
    cuts = [0, *(np.flatnonzero(clear[1:] != clear[:-1]) + 1).tolist(), len(clear)]
    for first, last in itertools.pairwise(cuts):
        yield _constant(np.ascontiguousarray(xy[first : last + 1])), bool(clear[first])


def _constant(xy: Floats) -> Floats:
    """Return a read-only view of a line. Kernels compile apart for lines that can be written, so no line is one."""
    view = xy.view()
    view.setflags(write=False)
    return view


def _clears(xy: Floats, discs: Floats, bounds: Bounds, inflate: float) -> bool:
    from antdrive.worlds import _kernels

    room = np.empty(len(xy) - 1)
    box = np.asarray(bounds, dtype=np.float64)
    _kernels.segment_clearances(np.ascontiguousarray(xy[:-1]), np.ascontiguousarray(xy[1:]), discs, box, room)
    return bool((room >= inflate - SLACK).all())


def _smoothed(
    line: Floats, world: World, inflate: float, extra: float, stretch: float, spare: float, bulge: float
) -> Piece:
    """Smooth a clear polyline as far as the checks allow."""
    own = polyline_length(line)
    taut = _pulled(line, world.discs, inflate)
    if taut is None:
        return Piece(line, np.zeros(len(line)), note="the line could not be pulled taut")
    note = ""
    for fine in (bulge, bulge / 100.0):  # a plan with finer arcs may be shorter
        drawn = taut.drawn(world, inflate, fine)
        note = _rejection(taut, drawn[0], line, world, inflate, own)
        if not note:
            break
    if note:
        return Piece(line, np.zeros(len(line)), note=note)
    piece = Piece(_constant(drawn[0]), drawn[1], "taut")
    if not extra:
        return piece
    wider = _with_clearance(
        taut, piece.xy, world, inflate, extra, min(taut.length * (1.0 + stretch), own + spare), bulge
    )
    return replace(piece, note="no room or length to spare for more clearance") if wider is None else wider


def _pulled(line: Floats, discs: Floats, inflate: float) -> TautString | None:
    """Return the taut string that passes all discs on the same side as a clear polyline; None on failure."""
    from antdrive.planners.smoothing import _kernels_smooth as kernels

    grown = discs[kernels.outermost(discs)]
    grown[:, 2] += inflate - SHRINK
    pulled, disc, turn, sweep = kernels.pull(line, grown)
    if not pulled:
        return None
    ends = np.ascontiguousarray(line[[0, -1]])
    for more in (SHRINK, SHRINK * 0.6):  # rounding may close a gap between discs of exact radius
        exact = grown.copy()
        exact[:, 2] += more
        string = _settled(disc, turn, sweep, exact, ends)
        if string is not None:
            return string
    return None


def _settled(
    disc: npt.NDArray[np.int64], turn: Floats, sweep: Floats, discs: Floats, ends: Floats
) -> TautString | None:
    from antdrive.planners.smoothing import _kernels_smooth as kernels

    settled, disc, turn, sweep, links = kernels.settle(kernels.Contacts(disc, turn, sweep), discs, ends)
    return TautString(disc, turn, sweep, links, discs) if settled else None


def _rejection(string: TautString, xy: Floats, line: Floats, world: World, inflate: float, longest: float) -> str:
    """Return the reason to reject a smoothed line; empty if it is usable."""
    from antdrive.planners.smoothing import _kernels_smooth as kernels

    box = np.asarray(world.bounds, dtype=np.float64)
    return REJECTIONS[kernels.fault(string.compiled, xy, line, world.discs, box, inflate - SLACK, longest + SLACK)]


def _with_clearance(
    taut: TautString, xy: Floats, world: World, inflate: float, extra: float, longest: float, bulge: float
) -> Piece | None:
    """Return the line with the most clearance no longer than `longest`; None if there is no room or length for more."""
    from antdrive.planners.smoothing import _kernels_smooth as kernels

    near = np.flatnonzero(kernels.near_polyline(xy, taut.discs, 2.0 * extra))
    discs = np.ascontiguousarray(taut.discs[near])
    contacts = kernels.Contacts(np.searchsorted(near, taut.disc), taut.turn, taut.sweep)
    xmin, ymin, xmax, ymax = world.bounds
    box = np.array([xmin + inflate, ymin + inflate, xmax - inflate, ymax - inflate])
    room = np.empty(len(discs))
    kernels.room_to_grow(xy, discs, box, np.ascontiguousarray(xy[[0, -1]]), extra, room)
    fits, wide, curvature = kernels.widest(
        contacts, discs, room, extra, xy, world.discs, np.asarray(world.bounds, dtype=np.float64), inflate, SLACK,
        longest + SLACK, bulge,
    )  # fmt: skip
    return Piece(wide, curvature, "clearance") if fits else None
