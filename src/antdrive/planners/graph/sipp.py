"""Safe-interval path planning (SIPP): space-time planning among movers with known motions.

M. Phillips and M. Likhachev, *SIPP: Safe interval path planning for dynamic environments*, ICRA 2011.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np
import numpy.typing as npt

from antdrive.base import Floats
from antdrive.base.errors import FieldError, require
from antdrive.base.kernel_cache import clock
from antdrive.base.plane import segment_lengths
from antdrive.planners.entrances import clear_lead, outline_at, turn_at
from antdrive.planners.graph.search import UNREACHABLE, reachable
from antdrive.planners.plan import Capabilities, GridPlanner, PlanResult, PlanStatus, Query, TimedPlan, path_cost
from antdrive.worlds import MoverMotion

STEP = 0.05  # initial sampling period of a motion; refined where it turns [s]
INSTANT = 1e-6  # a motion that is not straight over this time is a jump [s]
# Maximum distance between a motion and the chords that join its samples, and between the samples and the legs that
# replace them [m]. Twice this is added to the clearance.
TOLERANCE = 1e-3
EIGHTH = math.pi / 4  # between the headings of a grid [rad]
UNIT = "safe intervals expanded"


@dataclass(frozen=True, kw_only=True)
class SafeIntervals(GridPlanner):
    """The earliest arrival among movers with known motions, by SIPP.

    The plan waits where that helps. The motions are those of the query; without any, the path is the shortest.
    The plan is a `TimedPlan`.

    Known weaknesses, measured (docs/notebook/planning-speed.md): all motions must be known in advance, and the
    effort grows with their number. Among 40 movers in circles the median plan takes 43 ms on 50 x 50 cells and 92
    ms on 200 x 200; among 10 movers, 12 and 30 ms.

    Attributes:
        speed: the robot's speed on every move [m/s]
        yaw_rate: mean yaw rate of turns on the spot, with the stop before and after, on grids with turns [rad/s]
        horizon: time after departure for which motions are known and within which the robot must arrive [s]
        stay: whether the goal must also be safe from the arrival to the horizon
    """

    speed: float = 0.5
    yaw_rate: float = 0.5
    horizon: float = 120.0
    stay: bool = False

    def __post_init__(self) -> None:
        require("speed", self.speed, above=0)
        require("yaw_rate", self.yaw_rate, above=0)
        require("horizon", self.horizon, above=0)

    capabilities: ClassVar[Capabilities] = Capabilities(needs_motions=True, deterministic=True, turns=True)

    def search(self, query: Query, rng: np.random.Generator) -> PlanResult:
        """Find the earliest arrival among the motions of the query."""
        return plan_in_time(
            query,
            query.motions,
            speed=self.speed,
            yaw_rate=self.yaw_rate,
            start_time=query.start_time,
            horizon=self.horizon,
            stay=self.stay,
        )


def plan_in_time(
    query: Query,
    movers: Iterable[MoverMotion],
    *,
    speed: float,
    yaw_rate: float = 0.5,
    start_time: float = 0.0,
    horizon: float = 120.0,
    stay: bool = False,
) -> TimedPlan:
    """Return the earliest-arrival path over the grid's moves, or `NO_PATH` if none arrives within `horizon` seconds.

    The robot makes each move at `speed` and may wait in any cell for any time. Straight legs, at most
    `2 * TOLERANCE` off, replace each motion. On these legs, the robot's centre keeps `inflate + 2 * TOLERANCE`
    from a mover's surface, and so at least the grid's `inflate` from the mover itself. With the legs as motions the
    plan is exact: no path on this grid, at this speed, arrives sooner. Motions are sampled every `STEP`, more densely
    near turns and jumps; two turns within half a `STEP` may be missed.

    On a grid with turns the robot faces ahead on each move, and turns on the spot at `yaw_rate` between moves in
    different directions. Obstacles are kept from its outline, movers from the circle around it: the plan is exact, in
    position, heading and time, for that clearance. If the query has a task, the robot first turns and drives from the
    exact start to the first cell; on this lead, movers are kept from the cell alone.

    Args:
        query: the grid and its ends; its own motions are ignored
        movers: the motions of the movers
        speed: the robot's speed on every move [m/s]
        yaw_rate: the robot's yaw rate in turns on the spot, on a grid with turns [rad/s]
        start_time: departure time on the clock of the motions [s]
        horizon: latest arrival after `start_time` [s]
        stay: whether the goal must also be safe from the arrival to the horizon

    Raises:
        ValueError: the speed, the yaw rate or the horizon is not positive, or a mover's position is not finite.
    """
    require("speed", speed, above=0, below=math.inf)
    require("yaw_rate", yaw_rate, above=0, below=math.inf)
    require("horizon", horizon, above=0)
    spent = clock()
    reason = query.blocked_end or ("" if reachable(query) else UNREACHABLE)
    plan = (
        TimedPlan(status=PlanStatus.NO_PATH, reason=reason)
        if reason
        else _earliest(query, movers, speed, yaw_rate, start_time=start_time, horizon=horizon, stay=stay)
    )
    return replace(plan, work_unit=UNIT, wall_s=spent())


def _earliest(
    query: Query,
    movers: Iterable[MoverMotion],
    speed: float,
    yaw_rate: float,
    *,
    start_time: float,
    horizon: float,
    stay: bool,
) -> TimedPlan:
    """Return the earliest-arrival plan on a grid whose goal is reachable without movers."""
    from antdrive.planners.graph import _kernels_sipp as kernels

    grid = query.grid
    known = [_legs(mover, start_time, start_time + horizon, grid.inflate) for mover in movers]
    legs = np.concatenate([np.empty((0, 7)), *known])
    legs = legs[np.argsort(legs[:, kernels.BEGIN], kind="stable")]
    end = start_time + horizon if known else math.inf
    start = query.start[0] * grid.shape[1] + query.start[1]
    frame = kernels.Frame(*grid.origin, grid.cell)
    near = kernels.NearLegs(legs, *kernels.near_legs(legs, grid.free, frame))
    intervals = kernels.Intervals(*kernels.safe_intervals(near, grid.free, frame, start_time, end))
    first = intervals.first[start]
    if first == intervals.first[start + 1] or intervals.since[first] > start_time:
        reason = "a mover is too close to the start at departure"
        return TimedPlan(status=PlanStatus.NO_PATH, reason=reason)
    trip = kernels.Trip(start, query.goal_cell, float(speed), EIGHTH / yaw_rate, float(start_time), end, stay)
    ready = _ready(query, speed, yaw_rate)
    cells, arrive, leave, work = kernels.earliest(grid.graph, grid.turns.joints, ready, frame, near, intervals, trip)
    if not len(cells):
        stays = " and can stay there" if stay else ""
        reason = f"no path past the movers reaches the goal within {horizon:g} s{stays}"
        return TimedPlan(status=PlanStatus.NO_PATH, reason=reason, work=work)
    arrive[0] = start_time
    return TimedPlan(
        status=PlanStatus.SOLVED,
        cells=cells,
        cost=path_cost(cells, grid.cell),
        work=work,
        arrive=arrive,
        leave=leave,
        xy=grid.xy(cells),
    )


def _ready(query: Query, speed: float, yaw_rate: float) -> Floats:
    """Return the time that the robot takes from the exact start to each heading of the start's node (8,) [s].

    It is infinite at other headings, and 0 without a task. Without turns there is one entry, 0 (1,).
    """
    grid, task = query.grid, query.task
    if not grid.turns:
        return np.zeros(1)
    own = grid.turns.label[query.start[0] * grid.shape[1] + query.start[1]] == query.start_node
    ready = np.where(own, 0.0, math.inf)
    if task is None:
        return ready
    x, y = grid.xy([query.start])[0].tolist()
    outlines = grid.turns.outline, outline_at(task, grid.turns.outline)
    for k in np.flatnonzero(own).tolist():
        facing = clear_lead(task, (x, y), k * EIGHTH, outlines[1]).heading
        before = turn_at(task.start, facing, task, outlines)
        after = turn_at((x, y, facing), k * EIGHTH, task, outlines)
        ready[k] = (abs(before) + abs(after)) / yaw_rate + math.dist((x, y), task.start[:2]) / speed
    return ready


def _legs(mover: MoverMotion, start: float, end: float, inflate: float) -> Floats:
    """Return a motion as straight legs (L, 7) at constant speed, with the columns of `_kernels_sipp`."""
    from antdrive.planners.graph import _kernels_sipp as kernels

    t, xy, jump = _samples(mover, start, end)
    first, last, count = kernels.legs_within(t, np.ascontiguousarray(xy), jump, TOLERANCE)
    first, last = first[:count], last[:count]
    span = t[last] - t[first]
    velocity = (xy[last] - xy[first]) / span[:, np.newaxis]
    keep = np.full(count, mover.radius + inflate + 2 * TOLERANCE)
    return np.column_stack([t[first], t[last], xy[first], velocity, keep])


def _samples(mover: MoverMotion, start: float, end: float) -> tuple[Floats, Floats, npt.NDArray[np.bool_]]:
    """Return a motion as times (T,), positions (T, 2), and whether it jumps after each sample (T - 1,).

    Between samples without a jump, the motion is within `TOLERANCE` of the straight line that joins them.
    """
    t = np.linspace(start, end, max(2, math.ceil((end - start) / STEP) + 1))
    xy = np.asarray(mover.at(t), dtype=np.float64)
    unchecked = np.arange(len(t) - 1)  # intervals to be checked for straightness
    while len(unchecked):
        middle = (t[unchecked] + t[unchecked + 1]) / 2
        there = np.asarray(mover.at(middle), dtype=np.float64)
        # A motion that turns once within an interval deviates from the interval's chord at most twice as far as it
        # does at half time.
        stray = 2 * np.hypot(*(there - (xy[unchecked] + xy[unchecked + 1]) / 2).T)
        bent = (stray > TOLERANCE) & (t[unchecked + 1] - t[unchecked] > INSTANT)
        if not bent.any():
            break
        at = unchecked[bent] + 1
        t, xy = np.insert(t, at, middle[bent]), np.insert(xy, at, there[bent], axis=0)
        halves = at + np.arange(len(at))  # the indices of the middles
        unchecked = np.stack([halves - 1, halves], axis=1).ravel()
    if not np.isfinite(xy).all():
        raise FieldError("movers", "a mover's position is not finite")
    return t, xy, (np.diff(t) <= INSTANT) & (segment_lengths(xy) > TOLERANCE)
