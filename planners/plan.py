"""What every planner is asked and what it answers."""

from __future__ import annotations

import abc
import dataclasses
import enum
import math
import time
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Protocol, TypeAlias, runtime_checkable

import numpy as np
import numpy.typing as npt

from antdrive.worlds import Floats, MoverMotion, Point, Task
from antdrive.worlds.errors import FieldError

if TYPE_CHECKING:  # a grid brings the compiler with it; naming a planner should not
    from antdrive.worlds import Grid

Cell: TypeAlias = tuple[int, int]  # (row, col)
Cells: TypeAlias = npt.NDArray[np.int32]  # (N, 2)


class PlanStatus(enum.Enum):
    """How planning ended. The value is the sentence shown to people."""

    SOLVED = "found a path"
    NO_PATH = "no path on this grid"
    STOPPED = "stopped early"


@dataclass(frozen=True)
class Query:
    """A grid with a start and a goal cell.

    Raises:
        ValueError: a cell lies outside the grid. A blocked cell is no misuse: planners answer it with `NO_PATH`.
    """

    grid: Grid
    start: Cell
    goal: Cell
    task: Task | None = None  # the world behind the grid, for planners that are not bound to cells
    unreachable: str = ""  # why an end cannot be used although its cell may be free
    motions: tuple[MoverMotion, ...] = ()  # for planners of space and time; t = 0 is when the robot sets out

    def __post_init__(self) -> None:
        rows, cols = self.grid.shape
        for key, (row, col) in (("start", self.start), ("goal", self.goal)):
            if not (0 <= row < rows and 0 <= col < cols):
                raise FieldError(key, f"cell ({row}, {col}) is outside the grid of {rows} rows and {cols} columns")

    @classmethod
    def between(cls, grid: Grid, task: Task) -> Query:
        """The query for a task: each end becomes the nearest free cell that the robot reaches on a straight line.

        Where an end has no such cell, `unreachable` says so and planners answer `NO_PATH`.
        """
        from antdrive.worlds.geometry import point_clearance  # brings the compiler with it

        room = float(point_clearance(task.world, [task.goal])[0])
        start, out = _enter(grid, task, task.start[:2], math.inf)
        # A goal with too little room around it is reached where there is room, if that is within the tolerance.
        within = task.goal_tolerance - min(0.02, task.goal_tolerance / 2)  # the robot stops a little short, or aside
        goal, into = _enter(grid, task, task.goal, math.inf if room >= grid.inflate else within)
        reasons = {"the start": out, "the goal": into}
        unreachable = "; ".join(
            f"no free cell near {end} can be reached from it" for end, ok in reasons.items() if not ok
        )
        return cls(grid, start, goal, task, unreachable)

    @property
    def blocked_end(self) -> str | None:
        """A sentence naming the end that cannot be used, if one is."""
        if self.unreachable:
            return self.unreachable
        for key, cell in (("start", self.start), ("goal", self.goal)):
            if not self.grid.free[cell]:
                return f"the {key} cell ({cell[0]}, {cell[1]}) is blocked"
        return None


def _enter(grid: Grid, task: Task, point: Point, within: float) -> tuple[Cell, bool]:
    """The free cell nearest to a point whose centre a straight line reaches; without one, the point's own and False."""
    from antdrive.worlds.geometry import point_clearance, segment_clearance

    row, col = grid.cell_at(*point)
    rows, cols = grid.shape
    # Cells farther off than this are no entrance: the way to them would be a plan of its own.
    reach = max(3, math.ceil(grid.inflate / grid.cell) + 1)
    near = [
        (r, c)
        for r in range(max(0, row - reach), min(rows, row + reach + 1))
        for c in range(max(0, col - reach), min(cols, col + reach + 1))
        if grid.free[r, c]
    ]
    if not near:
        return (row, col), False
    centres = grid.xy(near)
    distance = np.hypot(*(centres - point).T)
    ends = np.broadcast_to(np.asarray(point, dtype=np.float64), centres.shape)
    # An end may itself lie closer to a disc than the inflation asks; then the way in must not come closer still.
    own = float(point_clearance(task.world, [point])[0])
    clear = segment_clearance(task.world, centres, ends) >= min(grid.inflate, own) - 1e-9
    fit = clear & (distance <= within)
    if not fit.any():
        return (row, col), False
    return near[int(np.where(fit, distance, np.inf).argmin())], True


@dataclass(frozen=True, eq=False)
class History:
    """What an iterative planner achieved in each iteration; empty for a search. Lengths in metres, inf = none."""

    best: Floats = field(default_factory=lambda: np.empty(0))  # (I,) best length so far
    iteration_best: Floats = field(default_factory=lambda: np.empty(0))  # (I,)
    iteration_mean: Floats = field(default_factory=lambda: np.empty(0))  # (I,) over those that arrived
    arrived: npt.NDArray[np.int64] = field(default_factory=lambda: np.empty(0, dtype=np.int64))  # (I,)

    def __len__(self) -> int:
        return len(self.best)


@dataclass(frozen=True, eq=False, kw_only=True)
class PlanResult:
    """A planner's answer, in cells.

    `cells` runs along allowed moves of the grid from start to goal and `cost` is its length. One that was interrupted
    hands over the best path so far, if it has one, as `STOPPED`: to be looked at, not to be driven. A planner that is not bound
    to the grid's eight directions also gives `waypoints`, the polyline to be driven, in fractional cells.
    """

    status: PlanStatus
    cells: Cells = field(default_factory=lambda: np.empty((0, 2), dtype=np.int32))  # (N, 2), empty if there is none
    cost: float = math.inf  # length of `cells` [m]
    waypoints: Floats | None = None  # (M, 2) any-angle polyline in (row, col); None: the cells themselves
    length: float | None = None  # exact length of what `waypoints` stand for, arcs included [m]; None: `cost`
    reason: str = ""  # why there is no path, where the planner can tell
    work: int = 0  # cells expanded, ant steps taken, chromosomes rated
    work_unit: str = "cells expanded"
    history: History = field(default_factory=History)
    landscape: Floats | None = None  # (R, C) pheromone or potential at the end, for plots
    options: Mapping[str, Any] = field(default_factory=dict)  # the planner's parameters
    wall_s: float = 0.0  # planning time [s]

    @property
    def solved(self) -> bool:
        """Whether there is a path to be driven."""
        return self.status is PlanStatus.SOLVED

    @property
    def line_length(self) -> float:
        """The length of the line to drive [m]: the planner's own where it has one, else `cost`."""
        return self.cost if self.length is None else self.length

    @property
    def line(self) -> Floats:
        """The polyline to drive, (M, 2) fractional cells: the planner's own, else its cells."""
        return self.cells.astype(np.float64) if self.waypoints is None else self.waypoints

    def _repr_html_(self) -> str:
        from antdrive.worlds.drawing import card, curve_svg, path_svg

        picture = (path_svg(self.line[:, ::-1]) if self.solved else "") + curve_svg(self.history.best)
        facts = {"length": f"{self.line_length:.3f} m", "work": f"{self.work:,} {self.work_unit}",
                 "time": f"{1000 * self.wall_s:.1f} ms"}  # fmt: skip
        return card(picture, self.status.value + (f": {self.reason}" if self.reason else ""), facts)


@runtime_checkable
class Planner(Protocol):
    """Anything that answers a query. All chance comes from `rng`: the same seed gives the same plan."""

    def plan(self, query: Query, rng: np.random.Generator) -> PlanResult:
        """Find a path from the start cell to the goal cell."""
        ...


@dataclass(frozen=True, kw_only=True)
class GridPlanner(abc.ABC):
    """A planner whose fields are its options: ends are checked, and the time and the options recorded, in one place."""

    def plan(self, query: Query, rng: np.random.Generator) -> PlanResult:
        """Find a path from the start cell to the goal cell."""
        started = time.perf_counter()
        blocked = query.blocked_end
        result = PlanResult(status=PlanStatus.NO_PATH, reason=blocked) if blocked else self._plan(query, rng)
        options = {f.name: getattr(self, f.name) for f in dataclasses.fields(self)}
        return dataclasses.replace(result, options=options, wall_s=time.perf_counter() - started)

    @abc.abstractmethod
    def _plan(self, query: Query, rng: np.random.Generator) -> PlanResult:
        """Find a path between two free cells."""


def path_cost(cells: npt.ArrayLike, cell: float) -> float:
    """The length [m] of a path of cells (N, 2): 1 or sqrt(2) cell sides a step."""
    steps = np.abs(np.diff(np.asarray(cells), axis=0)).sum(axis=1)
    diagonal = int((steps == 2).sum())
    return cell * (len(steps) - diagonal + math.sqrt(2.0) * diagonal)
