"""Metrics of a drive, computed from its log alone. Names end in the unit.

To add a metric, write a function and a row of the table `METRICS` at the end.
"""

from __future__ import annotations

import inspect
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Literal, TypeAlias

import numpy as np

from antdrive.base.errors import FieldError
from antdrive.base.plane import polyline_length, wrap_angle
from antdrive.base.types import Floats
from antdrive.sim.log.contacts import touches_of
from antdrive.sim.log.outcome import Outcome
from antdrive.sim.log.rollout import Rollout

BARN_SPEED = 2.0  # the challenge's reference speed [m/s]
BARN_CLOCK = 0.1  # the challenge's clock starts at this distance from the start [m]
JERK_WINDOW = 0.1  # averaging time of the measured speed before differentiation [s]
WALL_CLOCK = ("plan_s", "drive_wall_s")  # metrics that differ between repetitions
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

    @property
    def name(self) -> str:
        """Key in `METRICS`, in JSON and in reports."""
        return self.function.__name__

    @property
    def definition(self) -> str:
        """Definition in words."""
        return " ".join((inspect.getdoc(self.function) or "").split())

    def __call__(self, rollout: Rollout | None) -> float:
        """Return the metric of one drive."""
        return self.function(_driven(rollout))


def _driven(rollout: Rollout | None) -> Rollout:
    if rollout is None:
        raise FieldError("rollout", "missing; the run ended before the robot drove, so it has no metrics")
    return rollout


def path_length_m(rollout: Rollout) -> float:
    """Length of the planned path: of its cells, or of an any-angle planner's line."""
    return rollout.record.plan.length_m


def route_length_m(rollout: Rollout) -> float:
    """Length of the first route."""
    return polyline_length(rollout.route)


def driven_length_m(rollout: Rollout) -> float:
    """Distance travelled by the axle's centre."""
    return polyline_length(rollout.pose[:, :2])


def gap_to_grid_optimum(rollout: Rollout) -> float:
    """Planned length over the shortest path on the same grid, minus 1; below 0 where an any-angle line is shorter.

    NaN for a mapless robot, whose first plan precedes its knowledge of the world.
    """
    if rollout.record.exploring:
        return math.nan
    return _over(path_length_m(rollout), rollout.record.plan.grid_optimum_m)


def gap_to_euclidean_optimum(rollout: Rollout) -> float:
    """Length of the route over the exact shortest path among the inflated discs, minus 1; NaN without a map."""
    if rollout.record.exploring:
        return math.nan
    return _over(route_length_m(rollout), rollout.record.plan.euclidean_optimum_m)


def spl(rollout: Rollout) -> float:
    """Success weighted by path length (Anderson et al. 2018): optimum / max(driven, optimum), 0 without success."""
    optimum = rollout.record.plan.euclidean_optimum_m
    if not succeeded(rollout) or optimum is None:
        return 0.0
    return optimum / max(driven_length_m(rollout), optimum)


def barn(rollout: Rollout) -> float:
    """BARN challenge score: OT / clip(arrival, 2 OT, 8 OT), where OT = optimum / 2 m/s; at most 0.5.

    A drive without success scores 0.
    """
    optimum = rollout.record.plan.euclidean_optimum_m
    if not succeeded(rollout) or optimum is None:
        return 0.0
    fastest = optimum / BARN_SPEED
    return fastest / min(max(arrival_s(rollout), 2 * fastest), 8 * fastest)


def min_clearance_m(rollout: Rollout) -> float:
    """Least distance between the surfaces of the robot and an obstacle or wall."""
    return float(rollout.clearance.min())


def mean_clearance_m(rollout: Rollout) -> float:
    """Time average of the distance between the robot's surface and the nearest obstacle or wall."""
    return float(rollout.clearance.mean())


def tracking_error_max_m(rollout: Rollout) -> float:
    """Largest distance of the axle's centre from the current route."""
    return float(tracking_error(rollout).max())


def tracking_error_p95_m(rollout: Rollout) -> float:
    """95th percentile over time of the distance of the axle's centre from the current route."""
    return float(np.percentile(tracking_error(rollout), 95))


def duration_s(rollout: Rollout) -> float:
    """Duration of the drive in simulated time."""
    return float(rollout.t[-1])


def arrival_s(rollout: Rollout) -> float:
    """Arrival by the BARN challenge's clock: simulated time from 0.1 m of travel to first entering the goal's tolerance.

    Infinite if the robot never gets there.
    """
    task = rollout.record.task
    xy = rollout.pose[:, :2]
    gone = np.hypot(*(xy - xy[0]).T) >= BARN_CLOCK
    there = np.hypot(*(xy - task.goal).T) <= task.goal_tolerance
    if not there.any():
        return math.inf
    return max(0.0, float(rollout.t[there.argmax()] - rollout.t[gone.argmax()]))


def plan_s(rollout: Rollout) -> float:
    """Wall-clock time of planning before the drive."""
    return rollout.record.times.plan_s


def drive_wall_s(rollout: Rollout) -> float:
    """Wall-clock time of driving, with physics and replanning."""
    return rollout.record.times.drive_wall_s


def turning_rad_per_m(rollout: Rollout) -> float:
    """Total absolute change of heading divided by the distance driven."""
    turned = np.abs(wrap_angle(np.diff(rollout.pose[:, 2]))).sum()
    length = driven_length_m(rollout)
    return float(turned / length) if length > 0 else 0.0


def jerk_rms(rollout: Rollout) -> float:
    """Root mean square of the second derivative of the measured speed, smoothed over 0.1 s."""
    hz = rollout.record.physics_hz
    window = max(1, round(JERK_WINDOW * hz))
    if len(rollout.t) < 3 * window:
        return 0.0
    speed = np.convolve(rollout.twist[:, 0], np.ones(window) / window, mode="valid")[::window]
    if len(speed) < 3:
        return 0.0
    jerk = np.diff(speed, 2) * (hz / window) ** 2
    return float(np.sqrt(np.mean(jerk**2)))


def contacts_driving(rollout: Rollout) -> float:
    """Count of touches caused by the driving robot."""
    return _touches(rollout, Outcome.COLLIDED)


def contacts_standing(rollout: Rollout) -> float:
    """Count of hits by a mover while the robot stood still."""
    return _touches(rollout, Outcome.HIT_WHILE_STANDING)


def contacts_teleported(rollout: Rollout) -> float:
    """Count of teleports of a mover onto the robot, or within its braking distance."""
    return _touches(rollout, Outcome.HIT_BY_TELEPORT)


def replans(rollout: Rollout) -> float:
    """Count of searches for a new route during the drive."""
    return float(len(rollout.record.replans))


def avoiding_s(rollout: Rollout) -> float:
    """Time in simulation during which the robot avoided movers."""

    limiters = rollout.record.limiters
    if AVOIDING not in limiters:
        return 0.0
    return float((rollout.limiter == limiters.index(AVOIDING)).sum() / rollout.record.physics_hz)


def explored_m2(rollout: Rollout) -> float:
    """Ground within the walls that a mapless robot's lidar observed from the true poses, in cells of 0.1 m.

    A cell counts if the beam nearest to its centre in direction reached beyond it, at any range. The occupancy map
    covers less: it uses beams only up to the range at which they are one cell apart. NaN for a robot with a map.
    """
    if not (rollout.record.exploring and len(rollout.scans)):
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
    Metric("s", plan_s, "lower"),
    Metric("s", drive_wall_s, "lower"),
    Metric("rad/m", turning_rad_per_m, "lower", Tolerance(0.02, 0.05)),
    Metric("m/s^3", jerk_rms, "lower", Tolerance(0.1, 0.1)),
    Metric("1", contacts_driving, "lower", Tolerance()),
    Metric("1", contacts_standing, "lower", Tolerance()),
    Metric("1", contacts_teleported, "lower", Tolerance()),
    Metric("1", replans),
    Metric("s", avoiding_s),
    Metric("m^2", explored_m2),
)

#: Metrics by name.
METRICS: Mapping[str, Metric] = MappingProxyType({metric.name: metric for metric in _TABLE})


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
    a, along = route[:-1], np.diff(route, axis=0)
    length2 = (along**2).sum(axis=1)
    nearest = np.empty((len(points), 2))
    for rows in np.array_split(np.arange(len(points)), 1 + len(points) * len(a) // 1_000_000):
        offset = points[rows, None, :] - a
        f = np.clip((offset * along).sum(axis=2) / np.where(length2 > 0, length2, 1.0), 0, 1)
        feet = a + f[:, :, None] * along
        best = np.linalg.norm(points[rows, None, :] - feet, axis=2).argmin(axis=1)
        nearest[rows] = feet[np.arange(len(rows)), best]
    return nearest


def _touches(rollout: Rollout, outcome: Outcome) -> float:
    return float(sum(touch.outcome is outcome for touch in touches_of(rollout)))


def _over(length: float, optimum: float | None) -> float:
    return length / optimum - 1 if optimum else math.nan
