"""A robot that knows its world's map and looks out for whatever else is there with its lidar."""

from __future__ import annotations

from antdrive.sim.driving.survey import Senses
from antdrive.sim.driving.watching import Watch
from antdrive.sim.sensing.ground import Ground
from antdrive.worlds import Pose


class Lookout:
    """Takes scans when they are due. True poses and the true world are used for nothing but their ranges.

    Attributes:
        watch: what the scans tell of movers

    Args:
        senses: the lidar in the true world
        ground: the map that the robot was given
        watch: what the scans tell of movers
    """

    def __init__(self, senses: Senses, ground: Ground, watch: Watch) -> None:
        self.watch = watch
        self._senses, self._ground = senses, ground
        self._last = -1

    def look(self, tick: int, pose: Pose, estimate: Pose) -> Pose:
        """Take a scan if one is due in a control period; the estimated pose.

        Args:
            tick: the number of the control period
            pose: the robot's true pose, from which the lidar sees
            estimate: where the robot believes it is
        """
        if self._senses.due(tick, self._last):
            self._last = tick
            self.watch.read(self._ground, estimate, self._senses.ranges(tick, pose), tick)
        return estimate
