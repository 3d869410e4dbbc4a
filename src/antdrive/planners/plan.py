"""Planner interface: queries, plans and declared capabilities."""

from __future__ import annotations

import abc
import dataclasses
import enum
import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, ClassVar, Protocol, TypeAlias, cast, runtime_checkable

import numpy as np
import numpy.typing as npt

from antdrive.base import Floats
from antdrive.base.errors import FieldError
from antdrive.base.kernel_cache import clock, compiled
from antdrive.base.plane import format_fixed
from antdrive.planners.errors import PlannerError
from antdrive.worlds import MoverMotion, Task
from antdrive.worlds.route import cells_beside

if TYPE_CHECKING:  # importing a grid loads the compiler
    from antdrive.worlds import Grid

#: A cell of a grid: row along +y, column along +x.
Cell: TypeAlias = tuple[int, int]
#: Cells of a grid, (N, 2): row and column of each.
Cells: TypeAlias = npt.NDArray[np.int32]


class PlanStatus(enum.Enum):
    """The outcome of planning. Each value is the displayed sentence."""

    SOLVED = "found a path"
    NO_PATH = "no path on this grid"
    STOPPED = "stopped early"
    INVALID = "returned an invalid plan"


@dataclass(frozen=True)
class Query:
    """A planning problem: a grid with a start cell and a goal cell.

    Attributes:
        grid: the grid to plan on
        start: the start cell (row, col)
        goal: the goal cell (row, col)
        task: the task whose world was rasterised, for any-angle planners
        unreachable: why no free cell connects to the start or the goal; empty if both connect
        motions: the motions of the movers, for space-time planners
        start_time: departure time on the clock of the motions [s]
        start_label: the start's node on a grid with turns

    Raises:
        ValueError: a cell lies outside the grid. For a blocked cell, planners return `NO_PATH`.
    """

    grid: Grid
    start: Cell
    goal: Cell
    task: Task | None = None
    unreachable: str = ""
    motions: tuple[MoverMotion, ...] = ()
    start_time: float = 0.0
    start_label: int = -1

    def __post_init__(self) -> None:
        rows, cols = self.grid.shape
        for key, (row, col) in (("start", self.start), ("goal", self.goal)):
            if not (0 <= row < rows and 0 <= col < cols):
                raise FieldError(key, f"cell ({row}, {col}) is outside the grid of {rows} rows and {cols} columns")

    @classmethod
    def between(cls, grid: Grid, task: Task) -> Query:
        """Build the query for a task: each end becomes the nearest free cell reachable on a straight line.

        If an end has no such cell, `unreachable` gives the reason and planners return `NO_PATH`.
        """
        if grid.turns:
            return cls._turning(grid, task)
        from antdrive.planners._kernels_entrances import entrances  # imports the compiler

        world, reach = task.world, cells_beside(grid.inflate, grid.cell)
        ends, bounds = np.array((task.start[:2], task.goal), dtype=np.float64), np.array(world.bounds, dtype=np.float64)
        # If the goal is closer to an obstacle than the inflation, the robot stops at a free cell within the goal tolerance.
        found = entrances(
            grid.free, *grid.origin, grid.cell, grid.inflate, reach, ends, within_goal(task), world.discs, bounds
        )
        (*start, can_leave), (*goal, can_arrive) = found.tolist()
        unreachable = _unreachable({"the start": can_leave, goal_of(task): can_arrive})
        return cls(grid, (start[0], start[1]), (goal[0], goal[1]), task, unreachable)

    @classmethod
    def _turning(cls, grid: Grid, task: Task) -> Query:
        """Build the query for a task on a grid with turns: the goal becomes a reachable cell within its tolerance."""
        from antdrive.planners.entrances import ends

        node, goal = ends(grid, task, within_goal(task))
        cols = grid.shape[1]
        start = divmod(int(grid.turns.cell[node]), cols) if node >= 0 else grid.cell_at(*task.start[:2])
        to = divmod(goal, cols) if goal >= 0 else grid.cell_at(*task.goal)
        unreachable = _unreachable({"the start": node >= 0, goal_of(task): goal >= 0})
        return cls(grid, start, to, task, unreachable, start_label=node)

    @property
    def start_node(self) -> int:
        """The start as a node of the grid's graph."""
        return self.start_label if self.grid.turns else self.start[0] * self.grid.shape[1] + self.start[1]

    @property
    def start_headings(self) -> tuple[int, ...]:
        """The headings of the start's node on a grid with turns, as indices of `DIRECTIONS`; none without turns."""
        if not self.grid.turns or self.start_label < 0:
            return ()
        row = self.start[0] * self.grid.shape[1] + self.start[1]
        return tuple(np.flatnonzero(self.grid.turns.label[row] == self.start_label).tolist())

    @property
    def goal_cell(self) -> int:
        """The goal as a flat cell."""
        return self.goal[0] * self.grid.shape[1] + self.goal[1]

    @property
    def blocked_end(self) -> str | None:
        """A sentence naming the unusable end; None if both are usable."""
        if self.unreachable:
            return self.unreachable
        for key, cell in (("start", self.start), ("goal", self.goal)):
            if not self.grid.free[cell]:
                return f"the {key} cell ({cell[0]}, {cell[1]}) is blocked"
        if self.grid.turns and self.start_label < 0:
            return f"the start cell ({self.start[0]}, {self.start[1]}) is blocked at the robot's heading"
        return None


def within_goal(task: Task) -> float:
    """Return the farthest centre of a cell from the goal at which a robot may stop [m].

    The allowance covers the distance between the stopping point and the cell's centre.
    """
    return task.goal_tolerance - min(0.02, task.goal_tolerance / 2)


def goal_of(task: Task) -> str:
    """Return the name of a task's goal in messages."""
    return f"the goal within its tolerance of {task.goal_tolerance:g} m"


def _unreachable(ends: Mapping[str, bool]) -> str:
    """Return why ends are unusable; empty if all are usable."""
    return "; ".join(f"no free cell can be joined to {end}" for end, usable in ends.items() if not usable)


@dataclass(frozen=True, eq=False)
class History:
    """Results of each of the I iterations of an iterative planner; empty for a search. Infinite means no path.

    Attributes:
        best: length of the best path so far (I,) [m]
        iteration_best: length of the iteration's best path (I,) [m]
        iteration_mean: mean length of the iteration's complete paths (I,) [m]
        arrived: number of ants or chromosomes that reached the goal (I,)
    """

    best: Floats = dataclasses.field(default_factory=lambda: np.empty(0))
    iteration_best: Floats = dataclasses.field(default_factory=lambda: np.empty(0))
    iteration_mean: Floats = dataclasses.field(default_factory=lambda: np.empty(0))
    arrived: npt.NDArray[np.int64] = dataclasses.field(default_factory=lambda: np.empty(0, dtype=np.int64))

    def __len__(self) -> int:
        return len(self.best)


NO_HISTORY = History()


@dataclass(frozen=True, eq=False, kw_only=True)
class PlanResult:
    """A plan, in cells.

    `cells` runs along allowed moves of the grid from start to goal. An interrupted planner returns its best
    path so far, if any, with the status `STOPPED`; such a path is drawn, not driven. An any-angle planner also
    returns `waypoints`.

    Attributes:
        status: how planning ended
        cells: the path as (row, col) of each cell (N, 2), empty without a path
        cost: length of `cells` [m], infinite without a path
        waypoints: the polyline to drive as fractional (row, col) (M, 2); None to drive `cells`
        length: exact length of the curve that `waypoints` approximates, arcs included [m]; None if equal to
            `cost`
        reason: why there is no path, or a remark on the plan; may be empty
        work: the planner's effort, such as the number of cells expanded, in units of `work_unit`
        work_unit: the unit of `work`
        history: results of each iteration
        field: the planner's final field for plots, such as pheromone or potential (R, C); None without one
        options: the planner's options by name
        wall_s: planning time [s]
    """

    status: PlanStatus
    cells: Cells = dataclasses.field(default_factory=lambda: np.empty((0, 2), dtype=np.int32))
    cost: float = math.inf
    waypoints: Floats | None = None
    length: float | None = None
    reason: str = ""
    work: int = 0
    work_unit: str = "cells expanded"
    history: History = NO_HISTORY
    field: Floats | None = None
    options: Mapping[str, Any] = dataclasses.field(default_factory=dict)
    wall_s: float = 0.0

    @property
    def solved(self) -> bool:
        """Whether there is a path to drive."""
        return self.status is PlanStatus.SOLVED

    @property
    def line_length(self) -> float:
        """Length of the line to drive [m]: `length` if the planner set it, else `cost`."""
        return self.cost if self.length is None else self.length

    @property
    def line(self) -> Floats:
        """The polyline to drive as fractional (row, col) (M, 2): `waypoints` if there are any, else `cells`."""
        return self.cells.astype(np.float64) if self.waypoints is None else self.waypoints

    def as_dict(self) -> dict[str, Any]:
        """Return the plan as plain values, without history and field."""
        return {
            "status": self.status.name.lower(),
            "sentence": self.status.value,
            "reason": self.reason,
            "cost_m": self.cost,
            "length_m": self.line_length,
            "work": self.work,
            "work_unit": self.work_unit,
            "plan_s": self.wall_s,
            "options": {key: plain(value) for key, value in self.options.items()},
            "cells": self.cells.tolist(),
        }

    def __repr__(self) -> str:
        path = f" of {format_fixed(self.line_length, 3)} m" if len(self.cells) else ""
        reason = f" ({self.reason:.200})" if self.reason else ""
        effort = f"{self.work:,} {self.work_unit}, {1000 * self.wall_s:.1f} ms"
        return f"<{type(self).__name__}: {self.status.value}{path}{reason}, {effort}>"

    def _repr_html_(self) -> str:
        from antdrive.worlds.svg import card, curve_svg, path_svg

        picture = (path_svg(self.line[:, ::-1]) if self.solved else "") + curve_svg(self.history.best)
        facts = {
            "length": f"{format_fixed(self.line_length, 3)} m",
            "work": f"{self.work:,} {self.work_unit}",
            "time": f"{1000 * self.wall_s:.1f} ms",
        }
        return card(picture, self.status.value + (f": {self.reason}" if self.reason else ""), facts)


@dataclass(frozen=True, eq=False, kw_only=True, repr=False)
class TimedPlan(PlanResult):
    """A plan with times: the robot reaches each cell at `arrive`, waits, and leaves it at `leave`.

    Between cells it drives straight at the plan's speed.

    Attributes:
        arrive: arrival time at each cell (N,) [s]
        leave: departure time from each cell (N,) [s]
        xy: centres of the cells (N, 2) [m]
    """

    arrive: Floats = field(default_factory=lambda: np.empty(0))
    leave: Floats = field(default_factory=lambda: np.empty(0))
    xy: Floats = field(default_factory=lambda: np.empty((0, 2)))

    @property
    def duration(self) -> float:
        """Time from departure to arrival [s]; infinite without a path."""
        return float(self.arrive[-1] - self.arrive[0]) if len(self.arrive) else math.inf

    @property
    def waited(self) -> float:
        """Total waiting time [s]."""
        return float((self.leave - self.arrive).sum())

    def at(self, t: npt.ArrayLike) -> Floats:
        """Return the robot's positions (T, 2) [m] at times `t` (T,) [s], clamped to the ends of the plan.

        Raises:
            ValueError: the plan has no path.
        """
        if not self.solved:
            raise FieldError("plan", "has no path to follow")
        knots = np.stack([self.arrive, self.leave], axis=1).ravel()
        when = np.asarray(t, dtype=np.float64)
        return np.stack([np.interp(when, knots, np.repeat(self.xy[:, k], 2)) for k in (0, 1)], axis=-1)

    def clearance(self, movers: Iterable[MoverMotion], step: float = 0.01) -> float:
        """Return the minimum distance between the robot's centre and a surface of `movers` [m], sampled every `step` [s]."""
        ticks = max(1, math.ceil(self.duration / step))
        t = np.linspace(self.arrive[0], self.arrive[-1], ticks + 1)
        xy = self.at(t)
        return min((float(np.hypot(*(xy - m.at(t)).T).min()) - m.radius for m in movers), default=math.inf)


@dataclass(frozen=True, kw_only=True)
class Capabilities:
    """Capabilities and requirements of a planner.

    Attributes:
        complete: finds a path whenever there is one
        iterative: improves its plan in iterations, as an `IterativePlanner` does
        needs_world: plans among the world's discs, so the query must have a task
        needs_motions: plans in space and time among the query's motions, and returns a `TimedPlan`
        own_replanner: has a method `replanner(query, rng)`; other planners plan from scratch after every change
        cell_by_cell: has a method `agent(query, rng)` for driving among movers, which knows cells, not headings; for other
            planners the robot follows the route
        deterministic: draws no random numbers, so every seed gives the same plan
        turns: plans on grids with turns, for the robot's footprint; other planners plan for the disc around it
        exact_line: its line is driven as it is, whatever the smoothing
    """

    complete: bool = True
    iterative: bool = False
    needs_world: bool = False
    needs_motions: bool = False
    own_replanner: bool = False
    cell_by_cell: bool = False
    deterministic: bool = False
    turns: bool = False
    exact_line: bool = False


@runtime_checkable
class Planner(Protocol):
    """A path planner. All randomness comes from `rng`: the same seed gives the same plan.

    An attribute `capabilities` declares deviations from the defaults of `Capabilities`.
    """

    def plan(self, query: Query, rng: np.random.Generator) -> PlanResult:
        """Find a path from the start cell to the goal cell."""
        ...


def plain(value: Any) -> Any:
    """Convert a planner's option to a JSON value."""
    return value if isinstance(value, bool | int | float | str | None) else str(value)


def capabilities_of(planner: Planner) -> Capabilities:
    """Return the declared capabilities of a planner; the defaults if it declares none.

    Raises:
        PlannerError: its attribute `capabilities` has another type, or raises an exception.
    """
    return PlannerError.declared(planner, Capabilities())


@dataclass(frozen=True, kw_only=True)
class GridPlanner(abc.ABC):
    """A planner whose fields are its options.

    It checks both ends, and records the planning time, without the compilation of kernels, and the options.
    """

    places: ClassVar[tuple[str, ...]] = ()  # options that say where a file is; records omit them

    @property
    def capabilities(self) -> Capabilities:
        """Capabilities and requirements of this planner."""
        return Capabilities()

    def plan(self, query: Query, rng: np.random.Generator) -> PlanResult:
        """Find a path from the start cell to the goal cell."""
        with compiled():
            spent = clock()
            result: Any = self.untimed(query, rng)
            wall_s = spent()
        if not isinstance(result, PlanResult):  # a user's `search`; `request_plan` refuses it
            return cast(PlanResult, result)
        options = {f.name: getattr(self, f.name) for f in dataclasses.fields(self) if f.name not in self.places}
        return dataclasses.replace(result, options=options, wall_s=wall_s)

    def untimed(self, query: Query, rng: np.random.Generator) -> PlanResult:
        """Find a path, without its planning time and options: Python runs kernels that take little time."""
        blocked = query.blocked_end
        return PlanResult(status=PlanStatus.NO_PATH, reason=blocked) if blocked else self.search(query, rng)

    @abc.abstractmethod
    def search(self, query: Query, rng: np.random.Generator) -> PlanResult:
        """Find a path between two free cells."""


def path_cost(cells: npt.ArrayLike, cell: float) -> float:
    """Return the length [m] of a path of cells (N, 2) with sides of `cell` [m]: a step costs 1 or sqrt(2) sides."""
    steps = np.abs(np.diff(np.asarray(cells), axis=0)).sum(axis=1)
    diagonal = int((steps == 2).sum())
    return cell * (len(steps) - diagonal + math.sqrt(2.0) * diagonal)
