"""Metrics of a drive, computed from its log alone. Names end in the unit.

A function's docstring is the metric's definition in `docs/reference/metrics.md`; it must suffice to recompute the metric.
To add a metric, write a function, a row of the table `METRICS` at the end, and its oracle in
`tests/sim/log/metrics_oracle.py`.
"""

from __future__ import annotations

import inspect
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Literal, TypeAlias

import numpy as np
import numpy.typing as npt

from antdrive.base.errors import FieldError
from antdrive.base.plane import polyline_length, wrap_angle
from antdrive.base.types import Floats
from antdrive.sim.log.contacts import touches_of
from antdrive.sim.log.outcome import Outcome
from antdrive.sim.log.rollout import Rollout

BARN_SPEED = 2.0  # the challenge's reference speed [m/s]
BARN_CLOCK = 0.1  # the challenge's clock starts at this distance from the start [m]
JERK_WINDOW = 0.1  # averaging time of the measured speed before differentiation [s]
AVOIDING = "avoid"  # name of the avoidance rule in `record.limiters`


Better: TypeAlias = Literal["lower", "higher", "neither"]


@dataclass(frozen=True)
class Tolerance:
    """Allowed deterioration of a metric relative to an earlier drive."""

    absolute: float = 0.0  # in the metric's unit
    relative: float = 0.0  # fraction of the earlier value; both allowances add up

    def allowed(self, earlier: float) -> float:
        """Return the allowance, in the metric's unit."""
        return self.absolute + self.relative * abs(earlier)


@dataclass(frozen=True)
class Metric:
    """Metric of a drive, called with a rollout."""

    unit: str  # unit; "1" for a ratio or a count
    function: Callable[[Rollout], float]  # the metric's function
    better: Better = "neither"  # whether lower or higher is better, or neither
    # allowed deterioration; None for metrics that are not compared, such as wall-clock times
    tolerance: Tolerance | None = None
    proof: Literal["log", "clock"] = "log"  # what the metric follows from; a clock differs between repetitions

    @property
    def name(self) -> str:
        """Key in `METRICS`, in JSON and in reports."""
        return self.function.__name__

    @property
    def definition(self) -> str:
        """Definition in words."""
        return " ".join((inspect.getdoc(self.function) or "").split())

    def __call__(self, rollout: Rollout | None) -> float:
        """Return the metric of one drive; NaN if its log does not tell it."""
        driven = _driven(rollout)
        return self.function(driven) if driven.measured is None or self.name in driven.measured else math.nan


def _driven(rollout: Rollout | None) -> Rollout:
    if rollout is None:
        raise FieldError("rollout", "missing; the run ended before the robot drove, so it has no metrics")
    return rollout


def path_length_m(rollout: Rollout) -> float:
    """Length of the first plan. If there are `cells` and `plan.length_m` equals `plan.cost_m`, the plan is `cells`, of length
    `cell` times the sum of |`cells[i + 1] - cells[i]`|. Else it is `plan.length_m`: an any-angle planner drew its own line, or a
    mapless robot planned on the occupancy map of its first scan, whose cells are not logged; `verify --replay` recomputes it.
    """
    plan, cells = rollout.record.plan, rollout.cells
    if len(cells) and plan.length_m == plan.cost_m:
        return polyline_length(cells) * rollout.record.cell
    return plan.length_m


def route_length_m(rollout: Rollout) -> float:
    """Length of the polyline `route`, the first route."""
    return polyline_length(rollout.route)


def driven_length_m(rollout: Rollout) -> float:
    """Length of the polyline `pose[:, :2]`, the line of the axle's centre."""
    return polyline_length(rollout.pose[:, :2])


def gap_to_grid_optimum(rollout: Rollout) -> float:
    """`path_length_m` / `plan.grid_optimum_m` - 1; below 0 where an any-angle line is shorter. NaN if the optimum is null or
    0, and for a mapless robot, whose first plan precedes its knowledge of the world.
    """
    if rollout.record.mapless:
        return math.nan
    return _over(path_length_m(rollout), rollout.record.plan.grid_optimum_m)


def gap_to_euclidean_optimum(rollout: Rollout) -> float:
    """`route_length_m` / `plan.euclidean_optimum_m` - 1. NaN if the optimum is null or 0, and for a mapless robot."""
    if rollout.record.mapless:
        return math.nan
    return _over(route_length_m(rollout), rollout.record.plan.euclidean_optimum_m)


def spl(rollout: Rollout) -> float:
    """Success weighted by path length (Anderson et al. 2018): L / max(`driven_length_m`, L) with L =
    `plan.euclidean_optimum_m`. 0 without success, and if L is null or 0.
    """
    optimum = rollout.record.plan.euclidean_optimum_m
    if not succeeded(rollout) or not optimum:
        return 0.0
    return optimum / max(driven_length_m(rollout), optimum)


def barn(rollout: Rollout) -> float:
    """Exact score of the BARN challenge: T / min(max(`arrival_s`, 2 T), 8 T), at most 0.5; T = `plan.euclidean_optimum_m` /
    (2 m/s). The challenge's own score, which `antdrive barn` shows beside it, has OT for T, by the length of its reference path.
    0 without success, if `arrival_s` is infinite, and if the optimum is null or 0.
    """
    optimum, arrival = rollout.record.plan.euclidean_optimum_m, arrival_s(rollout)
    if not succeeded(rollout) or not optimum or math.isinf(arrival):
        return 0.0
    fastest = optimum / BARN_SPEED
    return fastest / min(max(arrival, 2 * fastest), 8 * fastest)


def min_clearance_m(rollout: Rollout) -> float:
    """Minimum of `clearance`, the distance between the surfaces of the robot and the nearest cylinder, mover or wall."""
    return float(rollout.clearance.min())


def mean_clearance_m(rollout: Rollout) -> float:
    """Mean of `clearance` over the rows."""
    return float(rollout.clearance.mean())


def tracking_error_max_m(rollout: Rollout) -> float:
    """Maximum tracking error. The tracking error of a row is the distance of `pose[:, :2]` from the nearest point of the
    polyline that the robot followed: `route` from row 0, and each solved replan's route from the first row with `t` >=
    `replans[].t` - 1e-9 s.
    """
    return float(tracking_error(rollout).max())


def tracking_error_p95_m(rollout: Rollout) -> float:
    """95th percentile of the rows' tracking errors, interpolated between the two nearest ranks."""
    return float(np.percentile(tracking_error(rollout), 95))


def duration_s(rollout: Rollout) -> float:
    """Duration of the drive in simulated time: `t` of the last row."""
    return float(rollout.t[-1])


def arrival_s(rollout: Rollout) -> float:
    """Arrival by the BARN challenge's clock: max(0, `t[b] - t[a]`). Row a is the first at least 0.1 m from `pose[0]`, or row 0
    if there is none. Row b is the first of the last unbroken series of rows within `task.goal_tolerance` of `task.goal`.
    Infinite if the last row is not within it. The challenge ends a run at the first entry; a robot that leaves the
    goal again has not succeeded yet, so its return counts.
    """
    task = rollout.record.task
    xy = rollout.pose[:, :2]
    gone = np.hypot(*(xy - xy[0]).T) >= BARN_CLOCK
    outside = np.flatnonzero(np.hypot(*(xy - task.goal).T) > task.goal_tolerance)
    entry = outside[-1] + 1 if len(outside) else 0
    if entry == len(xy):
        return math.inf
    return max(0.0, float(rollout.t[entry] - rollout.t[gone.argmax()]))


def plan_s(rollout: Rollout) -> float:
    """Wall-clock time of planning before the drive: `times.plan_s`."""
    return rollout.record.times.plan_s


def drive_wall_s(rollout: Rollout) -> float:
    """Wall-clock time of driving, with physics and replanning: `times.drive_wall_s`."""
    return rollout.record.times.drive_wall_s


def turning_rad_per_m(rollout: Rollout) -> float:
    """Sum of the absolute differences of successive `pose[:, 2]`, each wrapped into ±π, over `driven_length_m`; 0 if that is
    0.
    """
    turned = np.abs(wrap_angle(np.diff(rollout.pose[:, 2]))).sum()
    length = driven_length_m(rollout)
    return float(turned / length) if length > 0 else 0.0


def jerk_rms(rollout: Rollout) -> float:
    """Root mean square of (v[i - 1] - 2 v[i] + v[i + 1]) / h². v[i] is the mean of `twist[:, 0]` over the rows i w to (i + 1) w -
    1, w = max(1, round(0.1 s `physics_hz`)) and h = w / `physics_hz`; the rows after the last whole block do not count.
    0 with fewer than three blocks.
    """
    hz = rollout.record.physics_hz
    window = max(1, round(JERK_WINDOW * hz))
    blocks = len(rollout.t) // window
    if blocks < 3:
        return 0.0
    speed = rollout.twist[: blocks * window, 0].reshape(blocks, window).mean(axis=1)
    jerk = np.diff(speed, 2) * (hz / window) ** 2
    return float(np.sqrt(np.mean(jerk**2)))


def contacts_driving(rollout: Rollout) -> float:
    """Count of touches that the driving robot caused. Points of `contacts` whose row is at most `physics_hz` / 2 rows after that
    of the previous point belong to one touch; its first point has the row k and the obstacle. The cylinders are those of
    `task.obstacles`, then those of `unseen`. The driving robot caused every touch of a cylinder or wall, and each of a mover
    that the next two metrics do not count.
    """
    return _touches(rollout, Outcome.COLLIDED)


def contacts_standing(rollout: Rollout) -> float:
    """Count of touches of a mover m at a standing robot: k = 0, or v + r ω is at most 0.02 m/s and at most
    |`movers[k, m] - movers[k - 1, m]`| `physics_hz`, with (v, ω) the absolute values of `twist[k - 1]` and r the distance of the
    footprint's farthest point from the axle's centre. The footprint is the rectangle of `half_length` and `half_width`, or the
    polygon of `corners`, offset outwards by `rounding`. `contacts_teleported` takes precedence.
    """
    return _touches(rollout, Outcome.HIT_WHILE_STANDING)


def contacts_teleported(rollout: Rollout) -> float:
    """Count of touches of a mover m that teleported to where the robot could not avoid it. Row j <= k is the last in which m,
    with `loop: teleport` and different first and last keyframes, began a new lap: floor((`t` + `phase` - t0) / (tn - t0)), at
    least 0, exceeds that of row j - 1, where t0 and tn are the times of its first and last keyframes. With v = |`twist[j - 1,
    0]`| and a = `robot.max_acceleration`: k - j <= v / a `physics_hz` + 2, and the gap between the footprint at `pose[j]`
    and m at `movers[j, m]` is at most v² / (2 a) + 0.01 m.
    """
    return _touches(rollout, Outcome.HIT_BY_TELEPORT)


def replans(rollout: Rollout) -> float:
    """Count of `replans`, the searches for a new route during the drive, with those that found none."""
    return float(len(rollout.record.replans))


def avoiding_s(rollout: Rollout) -> float:
    """Time of avoiding movers in simulation: the number of rows whose `limiter` is the index of `avoid` in `limiters`, over
    `physics_hz`; 0 if `limiters` has no `avoid`.
    """

    limiters = rollout.record.limiters
    if AVOIDING not in limiters:
        return 0.0
    return float((rollout.limiter == limiters.index(AVOIDING)).sum() / rollout.record.physics_hz)


def explored_m2(rollout: Rollout) -> float:
    """Area c² of each cell of the world that a mapless robot's lidar observed from the true poses. Scans 0, n, 2 n, … and the
    last count, n = max(1, round(`robot.lidar.rate` / 10 Hz)). Cells have the side c = max(0.1 m, sqrt(A / 4 000 000)), where A
    is the area of `task.bounds`, and begin at its lower left corner: ceil(width / c - 1e-9) columns and ceil(height / c
    - 1e-9) rows. A scan observes a cell whose centre is nearer to the lidar's position at `pose[scan_rows[k]]` than the end of
    the beam nearest in direction, if that is within half the angle between beams. From the lidar's heading, beam k of B points
    -F / 2 + k F / (B - 1) with F = `field_of_view`, and -π + 2 π k / B in a full circle, F >= 2 π - 1e-4. A beam ends at its
    range, at the lidar's `max_range` for the code 0, and at 0 for the code 1. The occupancy map covers less: it uses beams only
    up to the range at which they are one cell apart. NaN for a robot with a map or without scans.
    """
    if not (rollout.record.mapless and len(rollout.scans)):
        return math.nan
    from antdrive.sim.log.sights import seen_ground  # imported here, because it loads kernels

    seen, cell = seen_ground(rollout)
    return float(np.count_nonzero(seen)) * cell**2


_TABLE = (
    Metric("m", path_length_m, "lower", Tolerance(0.01, 0.01)),
    Metric("m", route_length_m, "lower", Tolerance(0.01, 0.01)),
    Metric("m", driven_length_m, "lower", Tolerance(0.02, 0.01)),
    Metric("1", gap_to_grid_optimum, "lower", Tolerance(0.01)),
    Metric("1", gap_to_euclidean_optimum, "lower", Tolerance(0.01)),
    Metric("1", spl, "higher", Tolerance(0.01)),
    Metric("1", barn, "higher", Tolerance(0.01)),
    Metric("m", min_clearance_m, "higher", Tolerance(0.005)),
    Metric("m", mean_clearance_m, "higher", Tolerance(0.01, 0.02)),
    Metric("m", tracking_error_max_m, "lower", Tolerance(0.005, 0.05)),
    Metric("m", tracking_error_p95_m, "lower", Tolerance(0.005, 0.05)),
    Metric("s", duration_s, "lower", Tolerance(0.1, 0.01)),
    Metric("s", arrival_s, "lower", Tolerance(0.1, 0.01)),
    Metric("s", plan_s, "lower", proof="clock"),
    Metric("s", drive_wall_s, "lower", proof="clock"),
    Metric("rad/m", turning_rad_per_m, "lower", Tolerance(0.02, 0.05)),
    Metric("m/s³", jerk_rms, "lower", Tolerance(0.1, 0.1)),
    Metric("1", contacts_driving, "lower", Tolerance()),
    Metric("1", contacts_standing, "lower", Tolerance()),
    Metric("1", contacts_teleported, "lower", Tolerance()),
    Metric("1", replans),
    Metric("s", avoiding_s),
    Metric("m²", explored_m2),
)

#: Metrics by name.
METRICS: Mapping[str, Metric] = MappingProxyType({metric.name: metric for metric in _TABLE})
#: Metrics that differ between repetitions.
WALL_CLOCK = tuple(name for name, metric in METRICS.items() if metric.proof == "clock")


def measure(rollout: Rollout | None) -> dict[str, float]:
    """Return all metrics of a drive by name.

    Raises:
        FieldError: there is no rollout, because the run ended before the robot drove.
    """
    driven = _driven(rollout)
    return {name: metric(driven) for name, metric in METRICS.items()}


def succeeded(rollout: Rollout) -> bool:
    """Return whether the robot stopped at the goal in time and without contact."""
    return rollout.outcome is Outcome.SUCCEEDED


def tracking_error(rollout: Rollout) -> Floats:
    """Return the distance of the axle's centre from the current route at each row, shape (T,) [m]."""
    xy = rollout.pose[:, :2]
    legs = rollout.legs()
    return np.concatenate([np.hypot(*(nearest_on_route(xy[rows], route) - xy[rows]).T) for rows, route in legs])


def nearest_on_route(points: Floats, route: Floats) -> Floats:
    """Return the point of a route (N, 2) nearest to each of the points (T, 2), shape (T, 2) [m]."""
    return nearest_segments(points, route)[0]


def nearest_segments(points: Floats, route: Floats) -> tuple[Floats, npt.NDArray[np.int64]]:
    """Return the point of a route (N, 2) nearest to each of the points (T, 2), shape (T, 2) [m], and its segment (T,)."""
    a, along = route[:-1], np.diff(route, axis=0)
    length2 = (along**2).sum(axis=1)
    nearest, segment = np.empty((len(points), 2)), np.empty(len(points), dtype=np.int64)
    for rows in np.array_split(np.arange(len(points)), 1 + len(points) * len(a) // 1_000_000):
        offset = points[rows, None, :] - a
        f = np.clip((offset * along).sum(axis=2) / np.where(length2 > 0, length2, 1.0), 0, 1)
        feet = a + f[:, :, None] * along
        best = np.linalg.norm(points[rows, None, :] - feet, axis=2).argmin(axis=1)
        nearest[rows], segment[rows] = feet[np.arange(len(rows)), best], best
    return nearest, segment


def _touches(rollout: Rollout, outcome: Outcome) -> float:
    return float(sum(touch.outcome is outcome for touch in touches_of(rollout)))


def _over(length: float, optimum: float | None) -> float:
    return length / optimum - 1 if optimum else math.nan
