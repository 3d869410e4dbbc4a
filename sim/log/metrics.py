"""What a drive is worth, from its log alone: one name, one definition, the unit in the name."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from types import MappingProxyType

import numpy as np
import numpy.typing as npt

from antdrive.sim.log.contacts import touches_of
from antdrive.sim.log.rollout import Outcome, Rollout
from antdrive.worlds.plane import polyline_length, wrap_angle

Floats = npt.NDArray[np.float64]

BARN_SPEED = 2.0  # the challenge's reference [m/s]
BARN_CLOCK = 0.1  # its clock starts when the robot is this far from its start [m]
JERK_WINDOW = 0.1  # measured speed is averaged over this long before it is differentiated [s]


def path_length_m(rollout: Rollout) -> float:
    """Length of the planned path: of its cells, or of a planner's own any-angle line."""
    return float(rollout.meta["plan"]["length_m"])


def route_length_m(rollout: Rollout) -> float:
    """Length of the line that was to be followed."""
    return _length(rollout.route)


def driven_length_m(rollout: Rollout) -> float:
    """Length of the way driven by the axle's centre."""
    return _length(rollout.pose[:, :2])


def gap_to_grid_optimum(rollout: Rollout) -> float:
    """Planned length over Dijkstra's on the same moves, minus 1; any-angle lines fall below 0."""
    return _over(path_length_m(rollout), rollout.meta["plan"]["grid_optimum_m"])


def gap_to_euclidean_optimum(rollout: Rollout) -> float:
    """Route over the exact shortest path among the inflated discs, minus 1."""
    return _over(route_length_m(rollout), rollout.meta["plan"]["euclidean_optimum_m"])


def spl(rollout: Rollout) -> float:
    """Success weighted by path length (Anderson et al. 2018): optimum / max(driven, optimum), 0 without success."""
    optimum = float(rollout.meta["plan"]["euclidean_optimum_m"])
    if not succeeded(rollout) or not math.isfinite(optimum):
        return 0.0
    return optimum / max(driven_length_m(rollout), optimum)


def barn(rollout: Rollout) -> float:
    """The BARN challenge's score: OT / clip(arrival, 2 OT, 8 OT), OT = optimum / 2 m/s; at most 0.5, 0 without success."""
    fastest = float(rollout.meta["plan"]["euclidean_optimum_m"]) / BARN_SPEED
    if not succeeded(rollout) or not math.isfinite(fastest):
        return 0.0
    return fastest / min(max(arrival_s(rollout), 2 * fastest), 8 * fastest)


def min_clearance_m(rollout: Rollout) -> float:
    """Smallest distance between the robot's surface and an obstacle's or wall's."""
    return float(rollout.clearance.min())


def mean_clearance_m(rollout: Rollout) -> float:
    """Mean of that distance over time."""
    return float(rollout.clearance.mean())


def tracking_error_max_m(rollout: Rollout) -> float:
    """Largest distance of the axle's centre from the route that it followed then."""
    return float(tracking_error(rollout).max())


def tracking_error_p95_m(rollout: Rollout) -> float:
    """95th percentile of that distance over time."""
    return float(np.percentile(tracking_error(rollout), 95))


def duration_s(rollout: Rollout) -> float:
    """Simulated time."""
    return float(rollout.t[-1])


def arrival_s(rollout: Rollout) -> float:
    """Simulated time by the BARN challenge's clock: from 0.1 m off the start until first within the goal's tolerance.

    inf if it never gets there.
    """
    task = rollout.meta["task"]
    xy = rollout.pose[:, :2]
    gone = np.hypot(*(xy - xy[0]).T) >= BARN_CLOCK
    there = np.hypot(*(xy - task["goal"]).T) <= task["goal_tolerance"]
    if not there.any():
        return math.inf
    return max(0.0, float(rollout.t[there.argmax()] - rollout.t[gone.argmax()]))


def turning_rad_per_m(rollout: Rollout) -> float:
    """Total change of heading over the length driven."""
    turned = np.abs(wrap_angle(np.diff(rollout.pose[:, 2]))).sum()
    length = driven_length_m(rollout)
    return float(turned / length) if length > 0 else 0.0


def jerk_rms(rollout: Rollout) -> float:
    """Root mean square of the second derivative of the measured speed [m/s^3], smoothed over 0.1 s."""
    hz = int(rollout.meta["physics_hz"])
    window = max(1, round(JERK_WINDOW * hz))
    if len(rollout.t) < 3 * window:
        return 0.0
    speed = np.convolve(rollout.twist[:, 0], np.ones(window) / window, mode="valid")[::window]
    if len(speed) < 3:
        return 0.0
    jerk = np.diff(speed, 2) * (hz / window) ** 2
    return float(np.sqrt(np.mean(jerk**2)))


def contacts_driving(rollout: Rollout) -> float:
    """How often the robot touched something while it drove."""
    return _touches(rollout, Outcome.COLLIDED)


def contacts_standing(rollout: Rollout) -> float:
    """How often a moving obstacle ran into the robot while it stood still."""
    return _touches(rollout, Outcome.RUN_INTO)


def contacts_teleported(rollout: Rollout) -> float:
    """How often a moving obstacle appeared on the robot, or nearer than it could stop."""
    return _touches(rollout, Outcome.JUMPED_ON)


def replans(rollout: Rollout) -> float:
    """How often a new route was looked for while driving."""
    return float(len(rollout.meta.get("replans", ())))


def yielding_s(rollout: Rollout) -> float:
    """Simulated time for which the robot gave way to moving obstacles."""
    limiters = rollout.meta.get("limiters", ())
    if "yield" not in limiters:
        return 0.0
    return float((rollout.limiter == limiters.index("yield")).sum() / rollout.meta["physics_hz"])


METRICS: Mapping[str, Callable[[Rollout], float]] = MappingProxyType(
    {
        "path_length_m": path_length_m,
        "route_length_m": route_length_m,
        "driven_length_m": driven_length_m,
        "gap_to_grid_optimum": gap_to_grid_optimum,
        "gap_to_euclidean_optimum": gap_to_euclidean_optimum,
        "spl": spl,
        "barn": barn,
        "min_clearance_m": min_clearance_m,
        "mean_clearance_m": mean_clearance_m,
        "tracking_error_max_m": tracking_error_max_m,
        "tracking_error_p95_m": tracking_error_p95_m,
        "duration_s": duration_s,
        "arrival_s": arrival_s,
        "plan_s": lambda rollout: float(rollout.meta["times"]["plan_s"]),
        "drive_wall_s": lambda rollout: float(rollout.meta["times"]["drive_wall_s"]),
        "turning_rad_per_m": turning_rad_per_m,
        "jerk_rms": jerk_rms,
        "contacts_driving": contacts_driving,
        "contacts_standing": contacts_standing,
        "contacts_teleported": contacts_teleported,
        "replans": replans,
        "yielding_s": yielding_s,
    }
)


def measure(rollout: Rollout) -> dict[str, float]:
    """Every metric of a drive by name."""
    return {name: metric(rollout) for name, metric in METRICS.items()}


def succeeded(rollout: Rollout) -> bool:
    """Whether the robot stopped at the goal in time without contact."""
    return rollout.outcome is Outcome.SUCCEEDED


def tracking_error(rollout: Rollout) -> Floats:
    """Distance of the axle's centre from the route in force at each row, shape (T,) [m]."""
    xy = rollout.pose[:, :2]
    return np.concatenate([np.hypot(*(nearest_on_route(xy[rows], line) - xy[rows]).T) for rows, line in rollout.legs()])


def nearest_on_route(points: Floats, route: Floats) -> Floats:
    """The point of a route (N, 2) nearest to each of the points (T, 2), shape (T, 2) [m]."""
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


def _over(length: float, optimum: float) -> float:
    return length / optimum - 1 if 0 < optimum < math.inf else math.nan


def _length(xy: Floats) -> float:
    return polyline_length(xy)
