"""Movers that a robot is given, at any time that a test asks for."""

import dataclasses
import math

from antdrive.robots import Observation, PursuitState, Twist
from antdrive.robots.control.observation import NOBODY
from antdrive.sim.driving.guide import Follow, Moment
from antdrive.sim.driving.parts import Step, StuckClock
from antdrive.sim.driving.perceived_movers import PerceivedMovers
from antdrive.sim.driving.senses import MoverSense


def observed(tick, pose=(0.0, 0.0, 0.0), hz=60, movers=NOBODY):
    return Observation(tick, tick / hz, pose, Twist(0.0, 0.0), movers=movers)


def moment(tick, pose, path=None, arc=0.0, waiting=False):
    return Moment(observed(tick, pose), Follow(path), Step(pursuit=PursuitState(arc)), StuckClock(), waiting)


class GroundTruth(PerceivedMovers):
    def __init__(self, trajectories, perception, hz=60):
        motions = trajectories.positions if perception.kind == "motions" else None
        super().__init__(perception, len(trajectories), motions)
        self._sense, self._hz = MoverSense(trajectories, dataclasses.replace(perception, range=math.inf), hz), hz
        self.at(0)

    def at(self, tick, position=(0.0, 0.0)):
        self.read(observed(tick, (*position, 0.0), self._hz, self._sense.read(tick, (0.0, 0.0))))
        return self
