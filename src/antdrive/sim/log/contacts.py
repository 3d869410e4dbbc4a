"""Attribution of contacts to the robot or to a mover, from the log.

Contact points within half a second of each other form one touch, attributed to the first obstacle: contacts with obstacles
that the robot is pushed into belong to the push. The outcome of a touch is

- `HIT_BY_TELEPORT` if the mover has just teleported to within the robot's braking distance (0 for a standing robot), so that
  the robot could not stop;
- `HIT_WHILE_STANDING` if the obstacle is a mover and, just before the contact, the fastest point of the robot exceeded
  neither 0.02 m/s nor the mover's speed;
- `COLLIDED` otherwise, as always with walls and static cylinders.
"""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from antdrive.base.types import Floats
from antdrive.robots.spec import Footprint
from antdrive.sim.log.outcome import Outcome
from antdrive.sim.log.rollout import Rollout

STANDING_SPEED = 0.02  # highest speed of any point of a standing robot [m/s]
TOUCH_GAP = 0.5  # contacts farther apart in time are different touches [s]
TELEPORT_SLACK = 0.01  # physics reports a contact at the mover's previous position, up to this far off [m]


class Touch(NamedTuple):
    """Touch of the robot and an obstacle."""

    step: int  # first row of the touch
    obstacle: int  # index of the obstacle: cylinders, then movers, then walls
    outcome: Outcome  # COLLIDED, HIT_WHILE_STANDING or HIT_BY_TELEPORT


def touches_of(rollout: Rollout) -> list[Touch]:
    """Return the touches of a logged drive in temporal order."""
    if not len(rollout.contacts):
        return []
    record, movers = rollout.record, rollout.trajectories()
    return Attribution(
        pose=rollout.pose,
        twist=rollout.twist,
        movers=rollout.movers,
        jumps=movers.jumps(rollout.t),
        hz=record.physics_hz,
        discs=len(record.world.obstacles),
        radii=movers.radii,
        footprint=record.robot.footprint,
        deceleration=record.robot.max_acceleration,
    ).touches(rollout.contacts)


def attributed(rollout: Rollout) -> Rollout:
    """Attribute the first contact of a log, if it has one among movers, to the robot or to the mover, with both speeds."""
    movers = rollout.trajectories()
    if not movers or not len(rollout.contacts):
        return rollout
    first = touches_of(rollout)[0]
    m, before, reason = first.obstacle - len(rollout.record.world.obstacles), max(first.step - 1, 0), ""
    if 0 <= m < len(movers):
        speed = math.hypot(*movers.velocities(rollout.t[before])[0, m])
        reason = f"movers[{m}] at {speed:.2f} m/s, the robot at {abs(rollout.twist[before, 0]):.2f} m/s"
    return dataclasses.replace(
        rollout, record=dataclasses.replace(rollout.record, outcome=first.outcome, reason=reason)
    )


@dataclass(frozen=True, eq=False, kw_only=True)
class Attribution:
    """Rows of a drive, as needed to attribute contacts."""

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
        """Return the touches among contact points in temporal order."""
        touches: list[Touch] = []
        last = -math.inf
        for step, obstacle in contacts[:, :2].astype(np.int64).tolist():
            if step - last > TOUCH_GAP * self.hz:
                touches.append(Touch(step, obstacle, self._outcome(step, obstacle - self.discs)))
            last = step
        return touches

    def _outcome(self, step: int, mover: int) -> Outcome:
        """Return the outcome of a touch; `mover` is outside 0 to M - 1 for static obstacles."""
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
        """Return whether the mover appeared within the braking distance, and the robot had no time to stop."""
        jumped = np.flatnonzero(self.jumps[:step, mover])
        if not len(jumped):
            return False
        row = int(jumped[-1]) + 1
        speed = abs(float(self.twist[row - 1, 0]))
        gap = _gap(self.footprint, self.pose[row], self.movers[row, mover], float(self.radii[mover]))
        in_time = step - row <= speed / self.deceleration * self.hz + 2
        return in_time and gap <= speed**2 / (2 * self.deceleration) + TELEPORT_SLACK


def _gap(footprint: Footprint, pose: Any, centre: Any, radius: float) -> float:
    """Return the distance from a footprint to a disc, negative where they overlap [m]."""
    dx, dy, (cos, sin) = centre[0] - pose[0], centre[1] - pose[1], (math.cos(pose[2]), math.sin(pose[2]))
    return -footprint.depth(cos * dx + sin * dy, cos * dy - sin * dx) - radius
