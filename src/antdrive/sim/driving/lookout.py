"""Scans of a robot with a map, and the movers that they show."""

from __future__ import annotations

from typing import Any

from antdrive.base import Floats, Pose
from antdrive.sim.driving.parts import Rows
from antdrive.sim.driving.survey import Senses
from antdrive.sim.driving.watching import Watch
from antdrive.sim.log.scans import scans_logged
from antdrive.sim.sensing.ground import Ground


class Scans:
    """The scans of a lidar, each taken when it is due. Nothing but their ranges depends on true poses and the true world.

    Attributes:
        taken: the control period and the ranges (beams,) [m] of each scan so far
    """

    def __init__(self, senses: Senses) -> None:
        self.taken: list[tuple[int, Floats]] = []
        self._senses = senses

    def scan(self, tick: int, pose: Pose, estimate: Pose) -> Pose:
        """Take a scan from the true pose if one is due; the estimate, which no scan corrects."""
        if self._senses.due(tick, self.taken[-1][0] if self.taken else -1):
            ranges = self._senses.ranges(tick, pose)
            self.taken.append((tick, ranges))
            self.read(tick, estimate, ranges)
        return estimate

    def read(self, tick: int, estimate: Pose, ranges: Floats) -> None:
        """Read a scan."""

    def logged(self, log: Rows, per_tick: int) -> dict[str, Any]:
        """The arrays of a log that hold the scans."""
        return scans_logged(self.taken, per_tick, len(log.t))


class Lookout(Scans):
    """Lidar-based mover detection for a robot with a map.

    Attributes:
        watch: the tracks of the movers
    """

    def __init__(self, senses: Senses, ground: Ground, watch: Watch) -> None:
        super().__init__(senses)
        self.watch, self._ground = watch, ground

    def read(self, tick: int, estimate: Pose, ranges: Floats) -> None:
        """Look for movers in a scan."""
        self.watch.read(self._ground, estimate, ranges, tick)
