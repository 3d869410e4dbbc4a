"""A robot that knows its world's map and looks out for whatever else is there with its lidar."""

from __future__ import annotations

from typing import Any

from antdrive.base import Floats, Pose
from antdrive.sim.driving.survey import Senses
from antdrive.sim.driving.watching import Watch
from antdrive.sim.log.scans import scans_logged
from antdrive.sim.sensing.ground import Ground


class Glances:
    """The scans of a lidar, each taken when it is due. True poses and the true world are used for nothing but their ranges.

    Attributes:
        taken: the control period and the ranges (beams,) [m] of each scan so far
    """

    def __init__(self, senses: Senses) -> None:
        self.taken: list[tuple[int, Floats]] = []
        self._senses = senses

    def scan(self, tick: int, pose: Pose) -> Floats | None:
        """The ranges (beams,) [m] of the scan that is due in a control period; None: none is."""
        if not self._senses.due(tick, self.taken[-1][0] if self.taken else -1):
            return None
        ranges = self._senses.ranges(tick, pose)
        self.taken.append((tick, ranges))
        return ranges


class Lookout:
    """Takes scans when they are due, and looks for movers in them.

    Attributes:
        watch: what the scans tell of movers
    """

    def __init__(self, senses: Senses, ground: Ground, watch: Watch) -> None:
        self.watch = watch
        self._glances, self._ground = Glances(senses), ground

    def look(self, tick: int, pose: Pose, estimate: Pose) -> Pose:
        """Take a scan if one is due in a control period; the estimated pose."""
        ranges = self._glances.scan(tick, pose)
        if ranges is not None:
            self.watch.read(self._ground, estimate, ranges, tick)
        return estimate

    def logged(self, per_tick: int, rows: int) -> dict[str, Any]:
        """The arrays of a log that hold the scans, by the names of `Rollout`."""
        return scans_logged(self._glances.taken, per_tick, rows)
