"""Margin budget: how a drive used up its safety margin.

Plans keep the disc around the robot, or its footprint, `margin` metres from every surface. Drives come closer, for the reasons
in `CAUSES`.
"""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from antdrive.base.plane import wrap_angle
from antdrive.base.types import Floats
from antdrive.robots import PurePursuit
from antdrive.robots.clearance import footprint_clearance
from antdrive.robots.default_margin import default_margin, line_margin, mapless_margins, outline_margins
from antdrive.sim.log.metrics import nearest_segments
from antdrive.sim.log.record import DriveRecord
from antdrive.sim.log.rollout import Rollout
from antdrive.sim.settings import SETTINGS
from antdrive.worlds import point_clearance

if TYPE_CHECKING:
    from antdrive.planners import Capabilities

#: Causes of a loss of margin, with descriptions.
CAUSES: dict[str, str] = {
    "rounding": "the route comes closer to obstacles than planned, where start and goal are no cell centres",
    "cutting": "the robot leaves the route to the inside of a corner",
    "tracking": "the robot leaves the route elsewhere",
    "heading": "the footprint leaves the heading of its straight",
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
    """Safety margin of a drive, broken down by cause. Clearances are those of the shape that plans kept clear."""

    margin: float  # planned margin of that shape [m]
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
        usual = default_margin(record.robot, controller, record.noise, route)
        lines = max(usual, line_margin(record.robot, controller, record.noise))
        return record.margin == usual and record.footprint_margin in (None, lines)
    except (KeyError, TypeError, ValueError):  # settings or noise that no drive has
        return False


def known_capabilities(record: DriveRecord) -> Capabilities | None:
    """Return what a record's planner can do; None for a planner of one's own."""
    from antdrive.planners import PLANNERS, capabilities_of

    return capabilities_of(PLANNERS[record.planner.name]) if record.planner.name in PLANNERS else None


def footprint_margins(record: DriveRecord) -> tuple[float, ...]:
    """Return the margins that a record's settings give to plans for the footprint [m]; empty if they plan for the disc.

    A controller or planner of one's own is believed where only its code knows.

    Raises:
        KeyError, TypeError, ValueError: the controller's settings are none that a drive has.
    """
    asked, can = (record.settings or {}).get("footprint", SETTINGS["footprint"].default), known_capabilities(record)
    moving = record.perception is not None and not record.mapless
    by_cell = moving and (record.replanning or {}).get("around_movers") and can is not None and can.cell_by_cell
    if asked == "disc" or record.robot.footprint.is_disc or by_cell or not (can is None or can.turns):
        return ()
    robot, noise, margin = record.robot, record.noise, record.margin
    settings, own = record.controller.settings, record.controller.name != PurePursuit.__name__
    restored = {key: math.inf if value is None else value for key, value in settings.items()}
    controller = PurePursuit() if own else PurePursuit(**restored)
    usual = [default_margin(robot, controller, noise, kind) for kind in (record.smoothing.asked, "none")]
    of_lines = own or margin in usual or (record.margin_choice is not None and asked == "auto")
    margins = outline_margins(robot, controller, noise, margin, of_lines=of_lines)
    return mapless_margins(margins, margin) if record.mapless else margins


def budget(rollout: Rollout) -> Budget:
    """Break a drive's safety margin down by cause.

    At each row, margin - clearance is the sum of four losses. The first is at the route's point nearest to the estimate, where
    the route itself may be closer to obstacles than the margin (rounding). The second lies between that point and the
    estimate: cutting near corners, else tracking. Slip is the part by which the robot is closer to an obstacle than its
    last commands would have brought it. The third is the footprint's rotation from the route's heading to the estimate's
    (heading); turns on the spot have all headings. The fourth lies between the estimate and the true pose (localisation).
    Unseen cylinders are omitted.
    """
    record, true = rollout.record, rollout.pose
    margin = record.kept_margin
    estimated = rollout.estimate if len(rollout.estimate) else true
    planned, cutting, turning = estimated.copy(), np.empty(len(true), dtype=np.bool_), rollout.command[:, 0] == 0
    for rows, route in rollout.legs():
        planned[rows] = _on_route(estimated[rows], route, turning[rows])
        cutting[rows] = _near_corner(planned[rows, :2], route)

    def clearance(poses: Floats) -> Floats:
        if record.footprint_margin is not None:
            return footprint_clearance(record.task.world, record.robot.footprint, poses)
        return point_clearance(record.task.world, np.ascontiguousarray(poses[:, :2])) - record.robot.radius

    left, at_estimate, on_route = clearance(true), clearance(estimated), clearance(planned)
    kept = clearance(np.column_stack([estimated[:, :2], planned[:, 2]]))
    off_route = on_route - kept
    slip = np.clip(clearance(_as_commanded(rollout)) - left, 0.0, np.maximum(off_route, 0.0))
    losses = {
        "rounding": margin - on_route,
        "cutting": np.where(cutting, off_route - slip, 0.0),
        "tracking": np.where(cutting, 0.0, off_route - slip),
        "heading": kept - at_estimate,
        "slip": slip,
        "localisation": at_estimate - left,
    }
    tightest = int(left.argmin())
    contributions = []
    for cause in CAUSES:
        # A loss only counts where the robot is closer to an obstacle than planned.
        harm = np.where(left < margin, np.minimum(losses[cause], margin - left), 0.0)
        at = int(harm.argmax())
        x, y = true[at, :2].tolist()
        most = max(0.0, float(harm[at]))
        contributions.append(Contribution(cause, most, float(rollout.t[at]), x, y, float(losses[cause][tightest])))
    x, y = true[tightest, :2].tolist()
    return Budget(margin, float(left[tightest]), float(rollout.t[tightest]), x, y, tuple(contributions))


def _on_route(poses: Floats, route: Floats, turning: npt.NDArray[np.bool_]) -> Floats:
    """Return the pose (T, 3) of a route (N, 2) nearest to each pose, forwards or backwards along its segment.

    At a corner, and where the robot turns on the spot (T,), the heading is that of the pose.
    """
    feet, segment = nearest_segments(np.ascontiguousarray(poses[:, :2]), route)
    steps = np.diff(route, axis=0)[segment]
    yaw, heading = poses[:, 2], np.arctan2(steps[:, 1], steps[:, 0])
    off = wrap_angle(yaw - heading)
    off = np.where(np.abs(off) > math.pi / 2, wrap_angle(off - math.pi), off)
    turning = turning | (feet == route[segment]).all(axis=1) | (np.abs(feet - route[segment + 1]) < 1e-9).all(axis=1)
    return np.column_stack([feet, np.where(turning, yaw, yaw - off)])


def _as_commanded(rollout: Rollout) -> Floats:
    """Return the poses (T, 3) of a robot that had followed the commands of the last `REACTION` seconds exactly."""
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
    return np.column_stack([xy, rollout.pose[begin, 2] + turned - turned[begin]])


def _near_corner(points: Floats, route: Floats) -> npt.NDArray[np.bool_]:
    """Return whether points (T, 2) are near a corner of a route (N, 2), shape (T,)."""
    steps = np.diff(route, axis=0)
    heading = np.arctan2(steps[:, 1], steps[:, 0])
    turn = np.abs(wrap_angle(np.diff(heading)))
    near = np.zeros(len(points), dtype=np.bool_)
    for corner in route[1:-1][turn >= CORNER]:
        near |= np.hypot(*(points - corner).T) <= NEAR_CORNER
    return near
