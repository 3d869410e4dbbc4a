"""What a robot without errors and without a lidar goes by: the exact pose and a given map."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from antdrive.base import Pose
from antdrive.robots import Twist
from antdrive.sim.driving.parts import Rows
from antdrive.sim.physics.engine import State


class Exact:
    """A robot that knows its pose and whose wheels do as they are told.

    Attributes:
        noisy: false
        estimates: empty: estimates are poses
    """

    noisy = False
    estimates: Sequence[Pose] = ()

    def sense(self, state: State) -> Pose:
        """The true pose."""
        return state.pose

    def settle(self, estimate: Pose) -> Pose:
        """The pose itself: commands take effect at once."""
        return estimate

    def actuate(self, command: Twist) -> Twist:
        """The command itself."""
        return command

    def logged(self, log: Rows, per_tick: int) -> dict[str, Any]:
        """Nothing: estimates are poses, and the motors are set to the commands."""
        return {}


class GivenMap:
    """The world's map, and no lidar."""

    def scan(self, tick: int, pose: Pose, estimate: Pose) -> Pose:
        """The estimate itself."""
        return estimate

    def logged(self, log: Rows, per_tick: int) -> dict[str, Any]:
        """Nothing: there are no scans."""
        return {}
