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
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from antdrive.base import Bounds, Floats
from antdrive.base.errors import FieldError, require
from antdrive.base.plane import polyline_length
from antdrive.planners.anyangle.tangent import Arc, Line, TangentPath
from antdrive.planners.plan import PlanResult
from antdrive.planners.smoothing.sweeps import smooth_lines
from antdrive.worlds import Grid, Route, Task

if TYPE_CHECKING:
    from antdrive.planners.smoothing._kernels_smooth import String


def _points_along(
    plan: PlanResult, grid: Grid, task: Task, more: float = 0.0, stretch: float = 0.0
) -> tuple[Floats, Floats, Floats, Floats]:
    """Return the points of the plan's line (N, 2), which differ, and clearance and length of its segments (N - 1,) [m].

    It leads from the exact start to the goal, without collinear points. The first or last point of the plan is omitted if the
    straight line past it keeps the grid's clearance, which avoids a kink between the exact end and the centre of its cell. If the
    goal has less clearance, the line ends at the plan's last point.

    Also returns the discs (M, 3) that count for routes at most `stretch` longer, with `more` than the grid's clearance. Others
    are left out; the clearance of a segment is that of these discs.
    """
    from antdrive.planners.smoothing import _kernels_smooth as kernels

    if not plan.solved:
        raise FieldError("plan", "has no path to follow")
    (*start, yaw), world = task.start, task.world
    cells, ends = np.ascontiguousarray(grid.xy(plan.line)), np.array((start, task.goal))
    discs = kernels.discs_about(cells, ends, stretch, grid.inflate + more + BESIDE, world.discs)
    bounds = np.array(world.bounds, dtype=np.float64)
    line, clearances, lengths = kernels.points_along(
        cells, ends, math.cos(yaw), math.sin(yaw), discs, bounds, grid.inflate
    )
    return line, clearances, lengths, discs


#: The kinds of smoothing: the plan's line, that line pulled taut, or taut with more clearance where there is room.
SMOOTHINGS: tuple[str, ...] = ("none", "taut", "clearance")

#: Notes on a smoothed line, by the return value of the kernel `smoothed`.
NOTES: tuple[str, ...] = (
    "",
    "the smoothed line would be longer than the plan's",
    "the smoothed line would come closer than the clearance",
    "the smoothed line would pass an obstacle on its other side",
    "the line could not be pulled taut",
    "no room or length to spare for more clearance",
)

SLACK = 1e-9  # rounding tolerance of clearances and lengths [m]
BESIDE = 0.01  # discs this much farther away still count: far above rounding [m]


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
    require("clearance", clearance, at_least=0)
    require("stretch", stretch, at_least=0)
    require("bulge", bulge, above=0)
    if grid.turns:
        return smooth_lines(plan, grid, task, kind)
    extra = clearance if kind == "clearance" else 0.0
    line, clearances, lengths, discs = _points_along(plan, grid, task, 2 * extra + bulge, stretch)
    if kind == "none":
        return Route(line)
    bounds, inflate = np.array(task.world.bounds, dtype=np.float64), grid.inflate
    spare = max(0.0, plan.cost - lengths.cumsum().item(-1)) if math.isfinite(plan.cost) else 0.0
    xy, curvature, kinds, notes = [line[:1]], [np.zeros(1)], [], []
    for first, last, clear in _runs(clearances, inflate):
        run, own = line[first : last + 1], float(lengths[first:last].sum())
        piece = Piece(run, np.zeros(len(run)))
        if clear:
            piece = _smoothed(run, own, discs, bounds, inflate, extra, stretch, spare, bulge)
            spare -= max(0.0, polyline_length(piece.xy) - own)
            kinds.append(piece.kind)
        elif len(run) > 2 or not (run[0] == line[0]).all():
            piece = replace(piece, note="the plan's line comes closer than the clearance and is kept there")
        if piece.note:
            notes.append(piece.note)
        curvature[-1][-1] = piece.curvature[0]
        xy.append(piece.xy[1:])
        curvature.append(piece.curvature[1:])
    made = min(kinds, key=SMOOTHINGS.index, default="none")
    return Route(np.concatenate(xy), np.concatenate(curvature), made, "; ".join(dict.fromkeys(notes)))


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
    from antdrive.worlds import _kernels

    line = np.array(xy, dtype=np.float64, order="C").reshape(-1, 2)
    built = np.array(discs, dtype=np.float64, order="C").reshape(-1, 3)
    if _kernels.polyline_clearance(line, built, np.asarray(bounds, dtype=np.float64)) < inflate - SLACK:
        return None
    string = _pulled(line, built, inflate)
    return None if string is None else _path(string)


@dataclass(frozen=True, eq=False)
class Piece:
    """A part of a route."""

    xy: Floats  # points (N, 2) [m]
    curvature: Floats  # curvature from each point on (N,) [1/m]
    kind: str = "none"  # kind of smoothing
    note: str = ""  # why it is not smoothed as requested; empty if it is


def _path(string: String) -> TangentPath:
    """Return the lines and arcs of a string."""
    (disc, turn, sweep), links, discs = string
    pieces: list[Line | Arc] = []
    for i, (ax, ay, bx, by) in enumerate(links.tolist()):
        if (ax, ay) != (bx, by):
            pieces.append(Line((ax, ay), (bx, by)))
        if i < len(disc) and sweep[i] > SLACK:
            x, y, radius = discs[disc[i]].tolist()
            pieces.append(Arc((x, y), radius, math.atan2(by - y, bx - x), float(turn[i] * sweep[i])))
    return TangentPath(tuple(pieces))


def _runs(clearances: Floats, inflate: float) -> Iterator[tuple[int, int, bool]]:
    """Yield first and last point of the parts of a polyline that keep the clearance or do not, and whether each keeps it.

    `clearances` is the clearance of each segment [m].
    """
    clear = clearances >= inflate - 1.01 * SLACK  # joined lines have exactly the clearance
    cuts = [0, *(np.flatnonzero(clear[1:] != clear[:-1]) + 1).tolist(), len(clear)]
    for first, last in itertools.pairwise(cuts):
        yield first, last, bool(clear[first])


def _smoothed(
    line: Floats, own: float, discs: Floats, bounds: Floats, inflate: float, extra: float, stretch: float, spare: float,
    bulge: float,
) -> Piece:  # fmt: skip
    """Smooth a clear polyline of a length `own` as far as the checks allow."""
    from antdrive.planners.smoothing import _kernels_smooth as kernels

    note, xy, curvature = kernels.smoothed(line, discs, bounds, inflate, own, extra, stretch, spare, bulge)
    kind = ("clearance" if extra else "taut") if not note else "taut" if note == kernels.CROWDED else "none"
    return Piece(xy, curvature, kind, NOTES[note])


def _pulled(line: Floats, discs: Floats, inflate: float) -> String | None:
    """Return the taut string that passes all discs on the same side as a clear polyline; None on failure."""
    from antdrive.planners.smoothing import _kernels_smooth as kernels

    found, disc, turn, sweep, links, grown = kernels.taut(line, discs, inflate)
    return kernels.String(kernels.Contacts(disc, turn, sweep), links, grown) if found else None
