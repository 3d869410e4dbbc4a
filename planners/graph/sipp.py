"""Plans in space and time, among movers whose motions are known: safe-interval path planning.

M. Phillips and M. Likhachev, *SIPP: Safe interval path planning for dynamic environments*, ICRA 2011.
"""

from __future__ import annotations

import math
import time
from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np
import numpy.typing as npt

from antdrive.planners.graph.search import NO_WAY, reachable
from antdrive.planners.iterative import require
from antdrive.planners.plan import GridPlanner, PlanResult, PlanStatus, Query, path_cost
from antdrive.worlds import Floats, MoverMotion
from antdrive.worlds.errors import FieldError
from antdrive.worlds.plane import segment_lengths

STEP = 0.05  # s: how often a motion is looked at; turns in between are then looked for
INSTANT = 1e-6  # s: a motion that is not straight over so short a time jumps
TOLERANCE = 1e-3  # m: how far a motion may stray from the straight legs it is told by; kept in addition


@dataclass(frozen=True, eq=False, kw_only=True)
class TimedPlan(PlanResult):
    """A plan that says when: each cell is reached at `arrive`, left at `leave`, and the robot waits in between.

    From one cell to the next it drives straight at the plan's speed.
    """

    arrive: Floats = field(default_factory=lambda: np.empty(0))  # (N,) [s]
    leave: Floats = field(default_factory=lambda: np.empty(0))  # (N,) [s]
    xy: Floats = field(default_factory=lambda: np.empty((0, 2)))  # (N, 2) centres of the cells [m]

    @property
    def duration(self) -> float:
        """From the first instant to the arrival [s]; inf without a way."""
        return float(self.arrive[-1] - self.arrive[0]) if len(self.arrive) else math.inf

    @property
    def waited(self) -> float:
        """How long the robot stands on its way [s]."""
        return float((self.leave - self.arrive).sum())

    def at(self, t: npt.ArrayLike) -> Floats:
        """Where the robot is (T, 2) [m] at times (T,) [s]; before the plan begins and after it ends, at its ends.

        Raises:
            ValueError: there is no way.
        """
        if not self.solved:
            raise FieldError("plan", "has no path to follow")
        knots = np.stack([self.arrive, self.leave], axis=1).ravel()
        when = np.asarray(t, dtype=np.float64)
        return np.stack([np.interp(when, knots, np.repeat(self.xy[:, k], 2)) for k in (0, 1)], axis=-1)

    def clearance(self, movers: Iterable[MoverMotion], step: float = 0.01) -> float:
        """The least distance between the robot's centre and a mover's surface [m], looked at every `step` seconds."""
        ticks = max(1, math.ceil(self.duration / step))
        t = np.linspace(self.arrive[0], self.arrive[-1], ticks + 1)
        robot = self.at(t)
        return min((float(np.hypot(*(robot - m.at(t)).T).min()) - m.radius for m in movers), default=math.inf)


@dataclass(frozen=True, kw_only=True)
class SafeIntervals(GridPlanner):
    """The way that arrives first among movers whose motions are known, waiting where that helps: SIPP.

    The motions are the query's. Without any it is the shortest path. The answer is a `TimedPlan`.
    """

    speed: float = 0.5  # [m/s] on every move
    horizon: float = 120.0  # the motions are known, and the goal must be reached, so long [s]
    stay: bool = False  # the goal must also be safe from the arrival to the horizon

    needs_motions: ClassVar[bool] = True  # cells that are blocked now are not enough

    def __post_init__(self) -> None:
        require("speed", self.speed, above=0)
        require("horizon", self.horizon, above=0)

    def _plan(self, query: Query, rng: np.random.Generator) -> PlanResult:
        return plan_in_time(query, query.motions, speed=self.speed, horizon=self.horizon, stay=self.stay)


def plan_in_time(
    query: Query,
    movers: Iterable[MoverMotion],
    *,
    speed: float,
    start_time: float = 0.0,
    horizon: float = 120.0,
    stay: bool = False,
) -> TimedPlan:
    """The way over the grid's moves that arrives first, or `NO_PATH` when none does within `horizon` seconds.

    The robot makes each move at `speed` [m/s] and may wait in any cell for any time. All along, its centre keeps the
    grid's `inflate` from every mover's surface, and a little more, up to `2 * TOLERANCE`, for motions that are not
    made of straight legs. Over those legs the answer is exact: no way on this grid, at this speed, arrives sooner.
    Motions are told by samples `STEP` apart, closer about turns and jumps; one that turns twice within half a
    `STEP` may be missed. With `stay` the goal must be safe from the arrival to the horizon.

    Raises:
        ValueError: the speed or the horizon is not positive, or a mover's position is not finite.
    """
    from antdrive.planners.graph import _kernels_sipp as kernels

    require("speed", speed, above=0, below=math.inf)
    require("horizon", horizon, above=0)
    started = time.perf_counter()

    def without(reason: str, work: int = 0) -> TimedPlan:
        wall = time.perf_counter() - started
        return TimedPlan(status=PlanStatus.NO_PATH, reason=reason, work=work, work_unit=UNIT, wall_s=wall)

    if query.blocked_end:
        return without(query.blocked_end)
    if not reachable(query):
        return without(NO_WAY)
    grid = query.grid
    known = [_legs(mover, start_time, start_time + horizon, grid.inflate) for mover in movers]
    legs = np.concatenate([np.empty((0, 7)), *known])
    legs = legs[np.argsort(legs[:, 0], kind="stable")]
    end = start_time + horizon if known else math.inf
    (x0, y0), cols = grid.origin, grid.shape[1]
    begin, listed = kernels.near_legs(legs, grid.free, x0, y0, grid.cell)
    own, since, until = kernels.safe_intervals(legs, begin, listed, grid.free, x0, y0, grid.cell, start_time, end)
    start, goal = (cell[0] * cols + cell[1] for cell in (query.start, query.goal))
    if own[start] == own[start + 1] or since[own[start]] > start_time:
        return without("a mover is too close to the start when the robot sets out")
    cells, arrive, leave, work = kernels.earliest(
        grid.moves, start, goal, x0, y0, grid.cell, float(speed), end, stay,
        legs, begin, listed, own, since, until, start_time,
    )  # fmt: skip
    if not len(cells):
        stays = " and can stay there" if stay else ""
        return without(f"no way past the movers reaches the goal within {horizon:g} s{stays}", work)
    return TimedPlan(
        status=PlanStatus.SOLVED,
        cells=cells,
        cost=path_cost(cells, grid.cell),
        work=work,
        work_unit=UNIT,
        wall_s=time.perf_counter() - started,
        arrive=arrive,
        leave=leave,
        xy=grid.xy(cells),
    )


UNIT = "safe intervals expanded"


def _legs(mover: MoverMotion, start: float, end: float, inflate: float) -> Floats:
    """A motion as straight legs (L, 7) at constant speed: t0, t1, x, y, vx, vy, the distance to be kept."""
    from antdrive.planners.graph import _kernels_sipp as kernels

    t, xy, jump = _samples(mover, start, end)
    first, last, count = kernels.legs_within(t, xy, jump, TOLERANCE)
    first, last = first[:count], last[:count]
    span = t[last] - t[first]
    velocity = (xy[last] - xy[first]) / span[:, np.newaxis]
    reach = np.full(count, mover.radius + inflate + 2 * TOLERANCE)
    return np.column_stack([t[first], t[last], xy[first], velocity, reach])


def _samples(mover: MoverMotion, start: float, end: float) -> tuple[Floats, Floats, npt.NDArray[np.bool_]]:
    """Times (T,), places (T, 2) that straight lines join to within `TOLERANCE`, and, (T - 1,), where it jumps instead."""
    t = np.linspace(start, end, max(2, math.ceil((end - start) / STEP) + 1))
    xy = np.asarray(mover.at(t), dtype=np.float64)
    open_ = np.arange(len(t) - 1)  # stretches not yet known to be straight
    while len(open_):
        middle = (t[open_] + t[open_ + 1]) / 2
        there = np.asarray(mover.at(middle), dtype=np.float64)
        # Where two straight legs meet within a stretch, they stray at most twice as far from it as its middle does.
        stray = 2 * np.hypot(*(there - (xy[open_] + xy[open_ + 1]) / 2).T)
        bent = (stray > TOLERANCE) & (t[open_ + 1] - t[open_] > INSTANT)
        if not bent.any():
            break
        at = open_[bent] + 1
        t, xy = np.insert(t, at, middle[bent]), np.insert(xy, at, there[bent], axis=0)
        halves = at + np.arange(len(at))  # where the middles have come to be
        open_ = np.stack([halves - 1, halves], axis=1).ravel()
    if not np.isfinite(xy).all():
        raise FieldError("movers", "a mover's position is not finite")
    return t, xy, (np.diff(t) <= INSTANT) & (segment_lengths(xy) > TOLERANCE)
