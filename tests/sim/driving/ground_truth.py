"""Movers that a robot is given, at any time that a test asks for."""

import dataclasses
import math

from antdrive.sim.driving.perceived_movers import Given
from antdrive.sim.driving.senses import MoverSense


class GroundTruth(Given):
    def __init__(self, trajectories, perception, hz):
        motions = trajectories.positions if perception.kind == "motions" else None
        super().__init__(perception, hz, len(trajectories), motions)
        self._sense = MoverSense(trajectories, dataclasses.replace(perception, range=math.inf), hz)

    def velocities(self, tick, position):
        self._now(tick)
        return super().velocities(tick, position)

    def _now(self, tick):
        self.read(self._sense.read(tick, (0.0, 0.0)))
        return super()._now(tick)
