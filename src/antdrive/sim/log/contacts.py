"""Attribute each contact of a drive to the robot or to a mover, from the log.

Contact points belong to one touch, that of the first obstacle among them, until half a second passes without contact:
what the robot is pushed into is part of the push. The outcome of a touch is

- `HIT_BY_TELEPORT` if the mover's loop has just teleported it, and its surface then was no farther from the robot's
  than the robot's braking distance (0 for a standing robot), so that the robot could not have stopped;
- `HIT_WHILE_STANDING` if the obstacle is a mover, and just before the contact no point of the robot moved faster than
  0.02 m/s, nor faster than the mover;
- `COLLIDED` otherwise, as always with walls and cylinders that stand still.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from antdrive.base.types import Floats
from antdrive.robots.spec import Footprint
from antdrive.sim.log.outcome import Outcome
from antdrive.sim.log.rollout import Rollout

STANDING_SPEED = 0.02  # no point of a standing robot moves faster [m/s]
TOUCH_GAP = 0.5  # contacts that are farther apart in time belong to different touches [s]
TELEPORT_SLACK = 0.01  # physics reports a contact at the mover's position one step earlier, up to this far off [m]


class Touch(NamedTuple):
    """One meeting of the robot with an obstacle."""

    step: int  # the row at which the touch began
    obstacle: int  # index of the obstacle: cylinders, then movers, then walls
    outcome: Outcome  # COLLIDED, HIT_WHILE_STANDING or HIT_BY_TELEPORT


def touches_of(rollout: Rollout) -> list[Touch]:
    """The touches of a logged drive, in the order of time."""
    if not len(rollout.contacts):
        return []
    record, movers = rollout.record, rollout.trajectories()
    attribution = Attribution(
        pose=rollout.pose,
        twist=rollout.twist,
        movers=rollout.movers,
        jumps=movers.jumps(rollout.t),
        hz=record.physics_hz,
        discs=len(record.world.obstacles),
        radii=movers.radii,
        footprint=record.robot.footprint,
        deceleration=record.robot.max_acceleration,
    )
    return attribution.touches(rollout.contacts)


@dataclass(frozen=True, eq=False, kw_only=True)
class Attribution:
    """The rows of a drive, to see who caused a contact."""

    pose: Floats
    twist: Floats
    movers: Floats
    jumps: npt.NDArray[np.bool_]
    hz: int
    discs: int
    radii: Floats
    footprint: Footprint
    deceleration: float

    def touches(self, contacts: Floats) -> list[Touch]:
        """The touches among contact points, in the order of time."""
        found: list[Touch] = []
        last = -math.inf
        for step, obstacle in contacts[:, :2].astype(np.int64).tolist():
            if step - last > TOUCH_GAP * self.hz:
                found.append(Touch(step, obstacle, self._outcome(step, obstacle - self.discs)))
            last = step
        return found

    def _outcome(self, step: int, mover: int) -> Outcome:
        """The outcome of a touch; `mover` is outside 0 to M - 1 for what stands still."""
        if not 0 <= mover < self.movers.shape[1]:
            return Outcome.COLLIDED
        if self._teleported(step, mover):
            return Outcome.HIT_BY_TELEPORT
        before = max(step - 1, 0)  # the row from which physics took the step to the contact
        speed, yaw_rate = np.abs(self.twist[before]).tolist()
        fastest_point = speed + self.footprint.radius * yaw_rate
        mover_speed = math.dist(self.movers[step, mover], self.movers[before, mover]) * self.hz
        if step == 0 or fastest_point <= min(STANDING_SPEED, mover_speed):
            return Outcome.HIT_WHILE_STANDING
        return Outcome.COLLIDED

    def _teleported(self, step: int, mover: int) -> bool:
        """Whether the mover appeared nearer than the robot could stop, and the robot has not had time to."""
        jumped = np.flatnonzero(self.jumps[:step, mover])
        if not len(jumped):
            return False
        row = int(jumped[-1]) + 1
        speed = abs(float(self.twist[row - 1, 0]))
        gap = _gap(self.footprint, self.pose[row], self.movers[row, mover], float(self.radii[mover]))
        in_time = step - row <= speed / self.deceleration * self.hz + 2
        return in_time and gap <= speed**2 / (2 * self.deceleration) + TELEPORT_SLACK


def _gap(footprint: Footprint, pose: Any, centre: Any, radius: float) -> float:
    """The distance from a footprint to a disc, 0 or less where they overlap [m]."""
    dx, dy, yaw = centre[0] - pose[0], centre[1] - pose[1], pose[2]
    if footprint.corners:
        place = math.cos(yaw) * dx + math.sin(yaw) * dy, math.cos(yaw) * dy - math.sin(yaw) * dx
        return -footprint.depth(*place) - radius
    ahead = abs(math.cos(yaw) * dx + math.sin(yaw) * dy) - footprint.half_length
    aside = abs(math.cos(yaw) * dy - math.sin(yaw) * dx) - footprint.half_width
    return math.hypot(max(ahead, 0.0), max(aside, 0.0)) - footprint.rounding - radius
