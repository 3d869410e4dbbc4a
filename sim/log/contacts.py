"""Whose a contact is, told from the log.

Contacts belong to one touch, that of its first obstacle, until half a second passes without any; so what a robot is pushed
into is part of the push. A touch is

- `JUMPED_ON` if the mover's loop has just teleported it, and at that moment its surface was no farther from the robot's
  than the robot's braking distance (0 when it stands), so that it could not have stopped;
- `RUN_INTO` if it is a mover's, and just before no point of the robot moved faster than 0.02 m/s, nor than the mover;
- `COLLIDED` otherwise: the robot drove. What stands still is always met this way.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from antdrive.sim.log.rollout import Outcome, Rollout

Floats = npt.NDArray[np.float64]

STANDING = 0.02  # no point of a standing robot moves faster [m/s]
WAKE = 0.5  # [s]
TOUCHED = (Outcome.COLLIDED, Outcome.RUN_INTO, Outcome.JUMPED_ON)
LANDED = 0.01  # contacts are felt where a mover was a step before, up to this far off [m]


class Touch(NamedTuple):
    """One meeting with an obstacle, and what came of it."""

    step: int  # the row at which it began
    obstacle: int  # index: discs, then movers, then walls
    outcome: Outcome  # COLLIDED, RUN_INTO or JUMPED_ON


def touches(
    contacts: Floats,
    pose: Floats,
    twist: Floats,
    movers: Floats,
    jumps: npt.NDArray[np.bool_],
    *,
    hz: int,
    discs: int,
    radii: Floats,
    footprint: Mapping[str, float],
    deceleration: float,
) -> list[Touch]:
    """The touches among contacts (K, 4), in their order.

    Rows of pose (T, 3), twist (T, 2) and movers (T, M, 2) are `hz` a second; `jumps` (T - 1, M) tells which mover jumped
    before which row; `discs` is how many obstacles stand still, `radii` (M,) are the movers'.
    """
    found: list[Touch] = []
    last = -math.inf

    def outcome(step: int, obstacle: int) -> Outcome:
        m = obstacle - discs
        if not 0 <= m < movers.shape[1]:
            return Outcome.COLLIDED
        before = max(step - 1, 0)  # the row that the contact's step set out from
        landed = np.flatnonzero(jumps[:step, m])
        if len(landed):
            row = int(landed[-1]) + 1
            speed = abs(float(twist[row - 1, 0]))
            gap = _gap(footprint, pose[row], movers[row, m], float(radii[m]))
            in_time = step - row <= speed / deceleration * hz + 2
            if in_time and gap <= speed**2 / (2 * deceleration) + LANDED:
                return Outcome.JUMPED_ON
        radius = math.hypot(footprint["half_length"], footprint["half_width"]) + footprint["rounding"]
        fastest = abs(float(twist[before, 0])) + radius * abs(float(twist[before, 1]))
        came = math.dist(movers[step, m], movers[before, m]) * hz
        return Outcome.RUN_INTO if fastest <= min(STANDING, came) or step == 0 else Outcome.COLLIDED

    for step, obstacle in contacts[:, :2].astype(np.int64).tolist():
        if step - last > WAKE * hz:
            found.append(Touch(step, obstacle, outcome(step, obstacle)))
        last = step
    return found


def touches_of(rollout: Rollout) -> list[Touch]:
    """The touches of a logged drive.

    Raises:
        ValueError: the log defines movers that cannot be.
    """
    if not len(rollout.contacts):
        return []
    meta, traffic = rollout.meta, rollout.traffic()
    return touches(
        rollout.contacts, rollout.pose, rollout.twist, rollout.movers, traffic.jumps(rollout.t),
        hz=meta["physics_hz"], discs=len(meta["task"]["obstacles"]), radii=traffic.radii,
        footprint=meta["robot"]["footprint"], deceleration=meta["robot"]["max_acceleration"],
    )  # fmt: skip


def _gap(footprint: Mapping[str, float], pose: Any, place: Any, radius: float) -> float:
    """The distance from a footprint to a disc, 0 or less where they overlap [m]."""
    dx, dy, yaw = place[0] - pose[0], place[1] - pose[1], pose[2]
    ahead = abs(math.cos(yaw) * dx + math.sin(yaw) * dy) - footprint["half_length"]
    aside = abs(math.cos(yaw) * dy - math.sin(yaw) * dx) - footprint["half_width"]
    return math.hypot(max(ahead, 0.0), max(aside, 0.0)) - footprint["rounding"] - radius
