"""Plan validation before anything is drawn or driven."""

from __future__ import annotations

import dataclasses
import math
import numbers
from collections.abc import Mapping
from typing import Any, cast

import numpy as np

from antdrive.base import Floats
from antdrive.base.guarded import one_line, value_text
from antdrive.base.plane import arc_lengths, format_point, format_position, polyline_length, segment_lengths, wrap_angle
from antdrive.planners.errors import PlannerError, place_of, planner_errors
from antdrive.planners.plan import Cell, History, Planner, PlanResult, PlanStatus, Query, TimedPlan
from antdrive.worlds.route import end_reach, longest_line
from antdrive.worlds.world import Task, obstacle_name

RELATIVE = 1e-9  # relative tolerance of costs and lengths
NEAR = 1e-6  # tolerance of waypoints and clearances [m]


def request_plan(planner: Planner, query: Query, rng: np.random.Generator, name: str = "") -> PlanResult:
    """Return a planner's plan without checking it; errors have the planner's name, without one its class.

    Raises:
        InputError: the planner rejects the query.
        PlannerError: the planner raised another exception, or did not return a `PlanResult`.
    """
    arrays = query.grid.free, query.grid.moves
    locked = [not array.flags.writeable for array in arrays]
    with planner_errors(planner, name):
        answer = require_result(planner, planner.plan(query, rng), name)
    if any(lock and array.flags.writeable for lock, array in zip(locked, arrays, strict=True)):
        raise PlannerError(name or type(planner).__name__, f"made the grid writable ({place_of(planner)})")
    return answer


def require_result(planner: Planner, answer: Any, name: str = "") -> PlanResult:
    """Return the answer of a planner or its replanner if it is a `PlanResult`; errors are named as in `request_plan`.

    Raises:
        PlannerError: the answer has another type, or a field that raises an exception.
    """
    called = name or type(planner).__name__
    if not issubclass(type(answer), PlanResult):  # `isinstance` would believe the `__class__` of user code
        raise PlannerError(called, f"returned {value_text(answer, 60)} instead of a PlanResult ({place_of(planner)})")
    with planner_errors(planner, name):  # a subclass may compute its fields, and options may be any object
        if type(answer) not in (PlanResult, TimedPlan):
            kind = TimedPlan if issubclass(type(answer), TimedPlan) else PlanResult
            answer = kind(**{field.name: getattr(answer, field.name) for field in dataclasses.fields(kind)})
        str(answer.options)
    return cast(PlanResult, answer)


def validated(query: Query, answer: PlanResult, radius: float = 0.0) -> PlanResult:
    """Return the planner's answer if it is valid, else one without a path, with status `INVALID` and the reason.

    For `answer` and `radius` see `validate_plan`.
    """
    problem = validate_plan(query, answer, radius)
    if not problem:
        # Copied: the planner may reuse its arrays.
        copies: dict[str, Any] = {key: np.array(getattr(answer, key)) for key in _arrays(answer)}
        answer = dataclasses.replace(answer, **{**copies, "cells": copies["cells"].astype(np.int32, copy=False)})
        reason = one_line(answer.reason) if answer.reason else ""
        return answer if reason == answer.reason else dataclasses.replace(answer, reason=reason)
    sane = isinstance(answer.wall_s, float) and 0 <= answer.wall_s < math.inf
    options = answer.options if type(answer.options) is dict else {}
    wall = answer.wall_s if sane else 0.0
    return PlanResult(status=PlanStatus.INVALID, reason=problem, wall_s=wall, options=options)


def _arrays(answer: PlanResult) -> list[str]:
    """Return the names of the fields that hold a path."""
    return [field.name for field in dataclasses.fields(answer) if isinstance(getattr(answer, field.name), np.ndarray)]


def validate_plan(query: Query, result: PlanResult, radius: float = 0.0) -> str:
    """Return the first error in the `result` of a planner and its place; empty if the plan is valid.

    Cells run from start to goal along allowed moves; their cost is that of `path_cost`. Waypoints join the same ends
    and keep the clearance; `length` is that of a curve that rounds their corners. From a start with less clearance,
    they come no closer within `end_reach`. Waypoints are no longer than `longest_line` allows for their
    cells. A plan with waypoints may have an infinite cost: the grid has no path, and the cells are those under
    the line. The times of a `TimedPlan` increase. Paths of plans that stopped early are checked as well.
    A robot's `radius` [m], if known, tells what it would touch from what lacks its margin alone.
    """
    problem = _types(result) or _figure_data(query, result)
    if problem:
        return problem
    if not len(result.cells):
        if result.solved:
            return "cells: none, but the status is SOLVED"
        return "" if result.waypoints is None else "waypoints: given without cells"
    if result.status is PlanStatus.NO_PATH:
        return "cells: given, but the status is NO_PATH"
    if query.motions and result.solved and not isinstance(result, TimedPlan):
        return "times: none, but a query with motions needs a TimedPlan"
    off_grid = result.waypoints is not None and result.cost == math.inf
    if query.blocked_end and result.waypoints is None:
        return f"cells: given, but {query.blocked_end}"
    problem = _cells(query, result, off_grid)
    if not problem and result.waypoints is not None:
        problem = _waypoints(query, result, query.grid.xy(result.waypoints), radius)
    elif not problem and result.length is not None and not _same(result.length, result.cost):
        problem = f"length: {result.length:.9g} m, but the cells are {result.cost:.9g} m long"
    if not problem and isinstance(result, TimedPlan):
        problem = _times(query, result)
    return problem


def _types(result: PlanResult) -> str:
    """Return the first field of a plan with an invalid type, shape or value; or empty."""
    if not any(result.status is status for status in (PlanStatus.SOLVED, PlanStatus.NO_PATH, PlanStatus.STOPPED)):
        return f"status: must be SOLVED, NO_PATH or STOPPED, got {value_text(result.status)}"
    cells, waypoints = result.cells, result.waypoints
    if not (_is_array(cells) and cells.dtype.kind in "iu" and cells.ndim == 2 and cells.shape[1] == 2):
        return f"cells: must be an array of whole numbers (N, 2), got {_kind(cells)}"
    if waypoints is not None:
        if not (_floats(waypoints) and waypoints.ndim == 2 and waypoints.shape[1] == 2 and len(waypoints)):
            return f"waypoints: must be an array of numbers (M, 2), got {_kind(waypoints)}"
        if not np.isfinite(waypoints).all():
            return f"waypoints: number {int(np.argwhere(~np.isfinite(waypoints))[0, 0])} is not finite"
        if result.length is None:
            return "length: missing; a plan with waypoints needs one"
    for key in ("cost", "length", "wall_s", "work"):
        value: Any = getattr(result, key)
        whole = key == "work"
        wanted = numbers.Integral if whole else numbers.Real
        if key == "length" and value is None:
            continue
        if isinstance(value, bool) or not issubclass(type(value), wanted):
            return f"{key}: must be a {'whole ' if whole else ''}number, got {value_text(value)}"
        infinite = key == "cost" and (waypoints is not None or not len(cells))
        if not (0 <= float(value) < math.inf or (infinite and value == math.inf)):
            return f"{key}: must be finite and at least 0, got {value}"
    for key in ("reason", "work_unit"):
        if not issubclass(type(getattr(result, key)), str):
            return f"{key}: must be text, got {value_text(getattr(result, key))}"
    options: Any = result.options
    if not issubclass(type(options), Mapping):
        return f"options: must be a mapping, got {value_text(options)}"
    return ""


def _figure_data(query: Query, result: PlanResult) -> str:
    """Return the first error in the field and the history, which figures draw; or empty."""
    field, history = result.field, result.history
    made: Any = history  # by third-party code
    if field is not None and not (_floats(field) and field.shape == query.grid.shape):
        return f"field: must be an array of numbers {query.grid.shape}, got {_kind(field)}"
    if not issubclass(type(made), History):
        return f"history: must be a History, got {value_text(made)}"
    count = len(history.best) if _floats(history.best) and history.best.ndim == 1 else 0
    for key in ("best", "iteration_best", "iteration_mean", "arrived"):
        values = getattr(history, key)
        if not (_floats(values) and values.shape == (count,)):
            return f"history: {key} must be an array of numbers ({count},), got {_kind(values)}"
    return ""


def _floats(value: Any) -> bool:
    return _is_array(value) and value.dtype.kind in "fiu"


def _is_array(value: Any) -> bool:
    return issubclass(type(value), np.ndarray)


def _kind(value: Any) -> str:
    return f"{value.dtype} {value.shape}" if _is_array(value) else f"{value_text(value)}"


def _same(one: float, other: float) -> bool:
    return abs(one - other) <= RELATIVE * max(abs(one), abs(other))


def _cells(query: Query, result: PlanResult, off_grid: bool) -> str:
    """Return the first invalid cell, step or cost; `off_grid`: cells need only be neighbours."""
    from antdrive.planners._kernels_checks import faulty_step  # imports the compiler

    grid, cells = query.grid, np.array(result.cells, dtype=np.int64, order="C")
    outside, k, near, diagonal = faulty_step(cells, grid.shape[0], grid.graph, query.start_node, off_grid)
    if outside >= 0:
        where = f"outside the grid of {grid.shape[0]} x {grid.shape[1]} cells"
        return f"cells: number {outside}, {_cell(cells[outside])}, is {where}"
    for at, key, wanted in ((0, "start", query.start), (-1, "goal", query.goal)):
        if tuple(cells[at].tolist()) != wanted:
            return (
                f"cells: the {'first' if at == 0 else 'last'} is {_cell(cells[at])}, but the {key} is {_cell(wanted)}"
            )
    if k >= 0:
        why = "is no allowed move" if near else "does not lead to a neighbour"
        return f"cells: step {k} from {_cell(cells[k])} to {_cell(cells[k + 1])} {why}"
    cost = grid.cell * (len(cells) - 1 - diagonal + math.sqrt(2.0) * diagonal)
    if not off_grid and not _same(result.cost, cost):
        return f"cost: {result.cost:.9g} m, but the cells are {cost:.9g} m long"
    return ""


def check_step(query: Query, cell: Cell, to: Any) -> str:
    """Return the error in a cell-by-cell planner's step from `cell` to `to`, None for a wait; empty for an allowed one."""
    for key, value in (("cell", cell), ("step", to)):
        if not (_is_cell(value) or (key == "step" and to is None)):
            return f"{key}: must be a cell (row, col){' or None' * (key == 'step')}, got {value_text(value)}"
    if not all(0 <= k < size for k, size in zip(cell, query.grid.shape, strict=True)):
        return f"cell: {_cell(cell)} is outside the grid"
    if to is None:
        return ""
    grid, step = query.grid, (int(to[0]) - cell[0], int(to[1]) - cell[1])
    bit = 8 if max(map(abs, step)) > 1 else int(_bits()[step[0] + 1, step[1] + 1])
    if bit == 8 or not int(grid.moves[cell]) >> bit & 1:
        return f"step: from {_cell(cell)} to {_cell(to)} is no allowed move"
    return ""


def _is_cell(value: Any) -> bool:
    return type(value) is tuple and len(value) == 2 and all(issubclass(type(k), numbers.Integral) for k in value)


def _bits() -> Any:
    """Return the bit of `Grid.moves` by row and column step, each + 1 (3, 3); 8 where there is no step."""
    from antdrive.worlds._kernels_turns import HEADINGS  # imports the compiler

    return HEADINGS


def _cell(cell: Any) -> str:
    return f"({int(cell[0])}, {int(cell[1])})"


def _waypoints(query: Query, result: PlanResult, xy: Floats, radius: float) -> str:
    """Return the first error in a plan's line (M, 2) [m]: its ends, clearance or length; or empty."""
    length = result.length
    assert length is not None
    starts, goals = _ends(query)
    problem = _off(xy[0], starts, "first is not at the start") or _too_near(query, xy, radius)
    if problem := problem or _off(xy[-1], goals, "last is not at the goal"):
        return f"waypoints: {problem}"
    drawn = polyline_length(xy)
    slack = RELATIVE * drawn + NEAR
    if not drawn - _rounded_off(xy) - slack <= length <= drawn + slack:
        return f"length: {length:.9g} m, but the waypoints are {drawn:.9g} m long"
    if length > longest_line(result.cost, _leads(query, result), query.grid.cell) + slack:
        return f"waypoints: {length:.9g} m long, but their cells only {result.cost:.9g} m"
    return ""


def _leads(query: Query, result: PlanResult) -> float:
    """Return the summed distance of the first cell from the exact start and of the last from the exact goal [m]."""
    if query.task is None:
        return 0.0
    first, last = query.grid.xy(result.cells[[0, -1]])
    return math.dist(first, query.task.start[:2]) + math.dist(last, query.task.goal)


def _ends(query: Query) -> list[list[tuple[float, float]]]:
    """Return the points where a line may begin and those where it may end: exact ends and cell centres."""
    cells = [[(float(x), float(y))] for x, y in query.grid.xy([query.start, query.goal])]
    if query.task is not None:
        # Without a usable start cell, the line must begin at the exact start.
        cells[0] = [query.task.start[:2], *([] if query.blocked_end else cells[0])]
        cells[1].insert(0, query.task.goal)
    return cells


def _off(point: Floats, ends: list[tuple[float, float]], what: str) -> str:
    if min(math.dist(point, end) for end in ends) <= NEAR:
        return ""
    return f"the {what}: {format_point(point.tolist(), 3)} is {math.dist(point, ends[0]):.3g} m away"


def _too_near(query: Query, xy: Floats, radius: float) -> str:
    """Return the first step of a line (M, 2) [m] that violates the clearance, by how much and where; or empty."""
    wrong = np.flatnonzero((lacks := _lacking(query, xy)) > NEAR) if len(xy) > 1 else np.empty(0)
    if not len(wrong):
        return ""
    k = int(wrong[0])
    step = f"step {k} from {format_point(xy[k].tolist(), 3)} to {format_point(xy[k + 1].tolist(), 3)} does not keep"
    if query.task is None:
        return f"{step} to free cells"
    where = _nearest(query.task, xy[k : k + 2], lacks[k], radius)
    return f"{step} {query.grid.inflate:g} m from obstacles: {where}"


def _nearest(task: Task, ends: Floats, lack: float, radius: float) -> str:
    """Describe the obstacle or wall next to a segment (2, 2) [m] that lacks some clearance, and whether a robot touches it."""
    world, along = task.world, ends[1] - ends[0]
    discs, (xmin, ymin, xmax, ymax) = world.discs, world.bounds
    share = np.clip((discs[:, :2] - ends[0]) @ along / max(float(along @ along), 1e-18), 0.0, 1.0)
    points = ends[0] + share[:, None] * along
    walls = np.stack([ends - (xmin, ymin), (xmax, ymax) - ends], axis=1).reshape(2, 4)
    gaps = np.concatenate([np.hypot(*(points - discs[:, :2]).T) - discs[:, 2], walls.min(axis=0)])
    k = int(gaps.argmin())
    x, y = points[k] if k < len(discs) else ends[walls[:, k - len(discs)].argmin()]
    spare = float(gaps[k]) - radius
    robot = f"; the robot's disc of {radius:.3g} m {f'clears it by {spare:.3f} m' if spare > 0 else 'touches it'}"
    return f"at {format_position(task.frame, x, y)}, {lack:.3f} m too near {obstacle_name(world, k)}{robot if radius else ''}"


def _lacking(query: Query, xy: Floats) -> Floats:
    """Return by how much each segment of a line (M, 2) violates the clearance (M - 1,) [m]; infinite on a grid without world."""
    task, inflate = query.task, query.grid.inflate
    if task is None:
        from antdrive.planners.anyangle.lines import clear_line

        pairs = zip(xy[:-1].tolist(), xy[1:].tolist(), strict=True)
        return np.array([-math.inf if clear_line(query, tuple(a), tuple(b)) else math.inf for a, b in pairs])
    from antdrive.worlds.geometry import point_clearance, segment_clearance  # imports the compiler

    clearance = segment_clearance(task.world, xy[:-1], xy[1:])
    lacks, own, arc = inflate - clearance, float(point_clearance(task.world, xy[:1])[0]), arc_lengths(xy)
    leaving = int(np.searchsorted(arc, end_reach(inflate, query.grid.cell)))  # first point beyond
    if own < inflate:  # near such a start, no segment may come closer than the start itself
        lacks[:leaving] = own - clearance[:leaving]
        if leaving < len(xy):
            k, step = leaving - 1, arc[leaving] - arc[leaving - 1]
            away = xy[k] + (end_reach(inflate, query.grid.cell) - arc[k]) / step * (xy[leaving] - xy[k])
            lacks[k] = max(lacks[k], inflate - segment_clearance(task.world, [away], xy[leaving : leaving + 1])[0])
    return lacks


def _rounded_off(xy: Floats) -> float:
    """Return the length by which arcs at the corners can shorten a line (M, 2)."""
    sides = segment_lengths(xy)
    steps = np.diff(xy, axis=0)[sides > 0]
    heading, sides = np.arctan2(steps[:, 1], steps[:, 0]), sides[sides > 0]
    half = np.abs(wrap_angle(np.diff(heading))) / 2
    half = half[(corner := half > 1e-9)]
    reach = np.minimum(sides[:-1], sides[1:])[corner]
    return float((2 * reach * (1 - half / np.tan(half))).sum())


def _times(query: Query, plan: TimedPlan) -> str:
    """Return the first invalid time or cell centre of a plan; or empty."""
    count = len(plan.cells)
    for key in ("arrive", "leave"):
        times = getattr(plan, key)
        if not (_floats(times) and times.shape == (count,) and np.isfinite(times).all()):
            return f"{key}: must be a finite time for each of the {count} cells, got {_kind(times)}"
    invalid = plan.leave < plan.arrive
    invalid[1:] |= plan.arrive[1:] <= plan.leave[:-1]
    if invalid.any():
        k = int(invalid.argmax())
        return (
            f"times: cell {k} is reached at {plan.arrive[k]:g} s and left at {plan.leave[k]:g} s, which do not increase"
        )
    if plan.arrive[0] < query.start_time - 1e-9:
        return f"arrive: begins at {plan.arrive[0]:g} s, but the robot sets out at {query.start_time:g} s"
    shaped = _floats(plan.xy) and plan.xy.shape == (count, 2)
    if not (shaped and np.allclose(plan.xy, query.grid.xy(plan.cells), rtol=0, atol=NEAR)):
        return "xy: must be the centres of the cells"
    return ""
