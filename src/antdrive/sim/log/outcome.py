"""How a run can end."""

from __future__ import annotations

import enum

from antdrive.base.errors import FieldError


class Outcome(enum.Enum):
    """How a run ended. The value is the sentence shown to people.

    The first contact ends a drive, and the outcome says who caused the contact; `antdrive.sim.log.contacts` has the
    exact rule. `COLLIDED` is the robot's own doing, also when a mover comes towards the driving robot. The planner is
    not blamed for `HIT_WHILE_STANDING` and `HIT_BY_TELEPORT`, but neither is a success, and no drive with a contact is
    certified. `BLOCKED` means that movers closed every way and stood still until the robot's patience was over
    (`ReplanPolicy.patience`). `NO_PATH`, `STOPPED` and `INVALID_PLAN` end a run before the robot drives, so that there is
    no rollout; but a wrong plan on the way ends the drive, as `INVALID_PLAN` too, and its log has the rows until then.

    `antdrive run` exits with 0 if the run ended with `SUCCEEDED` and the drive is certified, else with 1.
    """

    SUCCEEDED = "stopped at the goal without contact"
    COLLIDED = "touched an obstacle"
    HIT_WHILE_STANDING = "was hit by a moving obstacle while it stood still"
    HIT_BY_TELEPORT = "a moving obstacle appeared on the robot, or nearer than it could stop"
    TIMED_OUT = "the time limit passed before the goal was reached"
    BLOCKED = "obstacles that stand still block the way to the goal"
    STUCK = "stopped making progress"
    NO_PATH = "no path on this grid"
    STOPPED = "planning stopped early"
    INVALID_PLAN = "the planner gave a wrong plan"

    @property
    def key(self) -> str:
        """The word for this outcome in logs, JSON and tables, such as `timed_out`."""
        return self.name.lower()

    @property
    def with_contact(self) -> bool:
        """Whether the robot and an obstacle touched."""
        return self in (Outcome.COLLIDED, Outcome.HIT_WHILE_STANDING, Outcome.HIT_BY_TELEPORT)

    @classmethod
    def from_key(cls, key: str) -> Outcome:
        """The outcome with this key.

        Args:
            key: a word such as `timed_out`

        Raises:
            FieldError: there is no such outcome.
        """
        known = {outcome.key: outcome for outcome in cls}
        if key not in known:
            raise FieldError("", f"unknown outcome {key!r:.40}; choose from {', '.join(known)}")
        return known[key]
