"""Outcomes of a run."""

from __future__ import annotations

import enum

from antdrive.base.errors import FieldError


class Outcome(enum.Enum):
    """Outcome of a run. The value is the sentence shown to users.

    The first contact ends a drive, and the outcome says who caused it; `antdrive.sim.log.contacts` has the exact rule.
    `COLLIDED` is the robot's own doing, even if a mover comes towards the driving robot. `HIT_WHILE_STANDING` and
    `HIT_BY_TELEPORT` are not the planner's fault, but count as failures; no drive with a contact is certified. `BLOCKED`: movers
    closed every route and stood still until the robot's patience (`ReplanPolicy.patience`) was over. `NO_PATH`, `STOPPED` and
    `INVALID_PLAN` end a run before the robot drives, without a rollout. An invalid replan ends the drive as `INVALID_PLAN`,
    and a `Session` that is left early as `STOPPED`, with the rows until then.

    `antdrive run` exits with 0 if the outcome is `SUCCEEDED` and the drive is certified, else with 1.
    """

    SUCCEEDED = "stopped at the goal without contact"
    COLLIDED = "touched an obstacle"
    HIT_WHILE_STANDING = "was hit by a moving obstacle while it stood still"
    HIT_BY_TELEPORT = "a moving obstacle appeared on the robot, or nearer than it could stop"
    TIMED_OUT = "the time limit passed before the goal was reached"
    BLOCKED = "obstacles that stand still block the way to the goal"
    STUCK = "stopped making progress"
    NO_PATH = "no path on this grid"
    STOPPED = "stopped early"
    INVALID_PLAN = "the planner's plan is invalid"

    @property
    def key(self) -> str:
        """Word for this outcome in logs, JSON and tables, such as `timed_out`."""
        return self.name.lower()

    @property
    def with_contact(self) -> bool:
        """Whether the robot and an obstacle touched."""
        return self in (Outcome.COLLIDED, Outcome.HIT_WHILE_STANDING, Outcome.HIT_BY_TELEPORT)

    @classmethod
    def from_key(cls, key: str) -> Outcome:
        """Return the outcome with this key.

        Args:
            key: a word such as `timed_out`

        Raises:
            FieldError: the outcome is unknown.
        """
        known = {outcome.key: outcome for outcome in cls}
        if key not in known:
            raise FieldError("", f"unknown outcome {key!r:.40}; choose from {', '.join(known)}")
        return known[key]
