"""Margin budget: how a drive used up its safety margin.

Planners keep the disc around the robot `margin` metres from every surface. Drives come closer, for the reasons in `CAUSES`.
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from antdrive.base.plane import wrap_angle
from antdrive.base.types import Floats
from antdrive.robots import PurePursuit
from antdrive.robots.default_margin import default_margin
from antdrive.sim.log.metrics import nearest_on_route
from antdrive.sim.log.record import DriveRecord
from antdrive.sim.log.rollout import Rollout
from antdrive.worlds import point_clearance

#: Causes of a loss of margin, with descriptions.
CAUSES: dict[str, str] = {
    "rounding": "the route comes closer to obstacles than planned, where start and goal are no cell centres",
    "cutting": "the robot leaves the route to the inside of a corner",
    "tracking": "the robot leaves the route elsewhere",
    "slip": "the wheels did not do as commanded during the last quarter of a second",
    "localisation": "the estimated pose is wrong",
}
CORNER = 0.3  # a bend of the route by at least this angle is a corner [rad]
NEAR_CORNER = 0.6  # deviations within this distance of a corner are cutting [m]
REACTION = 0.25  # the controller has corrected slip older than this [s]


@dataclass(frozen=True)
class Contribution:
    """Loss of margin by one cause, at the place of its maximum."""

    cause: str  # a key of `CAUSES`
    metres: float  # largest loss [m]; 0 if the cause never brought the robot closer than planned
    t: float  # time of the largest loss [s]
    x: float  # its position [m]
    y: float  # [m]
    at_tightest: float  # loss, or negative gain, at the place of minimum clearance [m]


@dataclass(frozen=True)
class Budget:
    """Safety margin of a drive, broken down by cause. Clearances are those of the disc around the robot."""

    margin: float  # planned margin [m]
    left: float  # least remaining clearance [m]
    t: float  # its time [s]
    x: float  # its position [m]
    y: float  # [m]
    # one per cause, in the order of `CAUSES`; their `at_tightest` add up to margin - left
    contributions: tuple[Contribution, ...]

    @property
    def largest(self) -> Contribution:
        """Contribution with the largest loss."""
        return max(self.contributions, key=lambda part: part.metres)

    def as_dict(self) -> dict[str, Any]:
        """Return the budget as plain values, for JSON."""
        return {**dataclasses.asdict(self), "largest": self.largest.cause}


def has_default(record: DriveRecord) -> bool:
    """Return whether a drive with noise had the default margin of its robot, controller, noise and route."""
    if not record.noise or record.controller.name != PurePursuit.__name__ or record.margin_choice is not None:
        return False
    route = record.smoothing.asked if record.smoothing.note else record.smoothing.made
    try:
        controller = PurePursuit(**record.controller.settings)
        return record.margin == default_margin(record.robot, controller, record.noise, route)
    except (KeyError, TypeError, ValueError):  # settings or noise that no drive has
        return False


def budget(rollout: Rollout) -> Budget:
    """Break a drive's safety margin down by cause.

    At each row, margin - clearance is the sum of three losses. The first is at the route's point nearest to the estimate, where
    the route itself may be closer to obstacles than the margin (rounding). The second lies between that point and the
    estimate: cutting near corners, else tracking. Slip is the part by which the robot is closer to an obstacle than its
    last commands would have brought it. The third lies between the estimate and the true pose (localisation). Unseen
    cylinders are omitted.
    """
    margin = rollout.record.margin
    true = np.ascontiguousarray(rollout.pose[:, :2])
    estimated = np.ascontiguousarray(rollout.estimate[:, :2]) if len(rollout.estimate) else true
    foot, cutting = np.empty_like(true), np.empty(len(true), dtype=np.bool_)
    for rows, route in rollout.legs():
        foot[rows] = nearest_on_route(estimated[rows], route)
        cutting[rows] = _near_corner(foot[rows], route)

    def clearance(points: Floats) -> Floats:
        return point_clearance(rollout.record.task.world, points) - rollout.record.robot.radius

    left, at_estimate, on_route = clearance(true), clearance(estimated), clearance(foot)
    off_route = on_route - at_estimate
    slip = np.clip(clearance(_as_commanded(rollout)) - left, 0.0, np.maximum(off_route, 0.0))
    losses = {
        "rounding": margin - on_route,
        "cutting": np.where(cutting, off_route - slip, 0.0),
        "tracking": np.where(cutting, 0.0, off_route - slip),
        "slip": slip,
        "localisation": at_estimate - left,
    }
    tightest = int(left.argmin())
    contributions = []
    for cause in CAUSES:
        # A loss only counts where the robot is closer to an obstacle than planned.
        harm = np.where(left < margin, np.minimum(losses[cause], margin - left), 0.0)
        at = int(harm.argmax())
        x, y = true[at].tolist()
        most = max(0.0, float(harm[at]))
        contributions.append(Contribution(cause, most, float(rollout.t[at]), x, y, float(losses[cause][tightest])))
    x, y = true[tightest].tolist()
    return Budget(margin, float(left[tightest]), float(rollout.t[tightest]), x, y, tuple(contributions))


def _as_commanded(rollout: Rollout) -> Floats:
    """Return the positions (T, 2) [m] of a robot that had followed the commands of the last `REACTION` seconds exactly."""
    dt = 1.0 / rollout.record.physics_hz
    back = min(round(REACTION / dt), len(rollout.t) - 1)
    turned = np.concatenate(([0.0], np.cumsum(rollout.command[1:, 1] * dt)))
    begin = np.maximum(np.arange(len(rollout.t)) - back, 0)
    xy = rollout.pose[begin, :2].copy()
    for step in range(1, back + 1):
        row = begin + step
        live = row <= np.arange(len(row))
        row = np.minimum(row, len(row) - 1)
        yaw = rollout.pose[begin, 2] + (turned[row] + turned[row - 1]) / 2 - turned[begin]
        distance = np.where(live, rollout.command[row, 0] * dt, 0.0)
        xy[:, 0] += distance * np.cos(yaw)
        xy[:, 1] += distance * np.sin(yaw)
    return xy


def _near_corner(points: Floats, route: Floats) -> npt.NDArray[np.bool_]:
    """Return whether points (T, 2) are near a corner of a route (N, 2), shape (T,)."""
    steps = np.diff(route, axis=0)
    heading = np.arctan2(steps[:, 1], steps[:, 0])
    turn = np.abs(wrap_angle(np.diff(heading)))
    near = np.zeros(len(points), dtype=np.bool_)
    for corner in route[1:-1][turn >= CORNER]:
        near |= np.hypot(*(points - corner).T) <= NEAR_CORNER
    return near
