"""Which world to try next: any at random, or the one of many in which a rehearsal without physics comes closest to a contact."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import TypeAlias

import numpy as np

from antdrive.base import Pose
from antdrive.planners import PlannerError
from antdrive.robots import PurePursuit, TrackedPath, Twist, footprint_clearance
from antdrive.sim.compose import route_planner
from antdrive.sim.driving.drive import drive
from antdrive.sim.driving.given import GivenMap
from antdrive.sim.driving.localising import localiser_of
from antdrive.sim.driving.parts import Decider, Ending, Step
from antdrive.sim.driving.plants import Kinematic
from antdrive.sim.driving.routes import OneRoute
from antdrive.sim.log.outcome import Outcome
from antdrive.sim.physics.engine import State
from antdrive.sim.pipeline import plan
from antdrive.sim.scenario import Scenario

REHEARSED = 24  # worlds that the guided search rehearses for each that it runs
PATIENCE = 3.0  # a rehearsal ends after so many times the time that the route takes at full speed, and SETTLING
SETTLING = 5.0  # [s]
STANDING = 1e-3  # a robot that was told to stop has stopped at this speed [m/s]

#: Draws a scenario; None where the world is of no use.
Draw: TypeAlias = Callable[[], Scenario | None]


def random_world(draw: Draw) -> Scenario | None:
    """The next world, as it comes."""
    return draw()


def guided_world(draw: Draw) -> Scenario | None:
    """Of `REHEARSED` random worlds, the one in which the rehearsed drive comes closest to a contact.

    The winner of the UAV testing competition of 2025 chooses its tests in this way, with a simulator of low fidelity
    before each run of the real one (*Pseudo-random UAV test generation using low-fidelity path simulator*, 2025).
    """
    drawn = [scenario for scenario in (draw() for _ in range(REHEARSED)) if scenario is not None]
    return min(drawn, key=rehearsed_clearance, default=None)


#: The methods of search by name.
METHODS: Mapping[str, Callable[[Draw], Scenario | None]] = MappingProxyType(
    {"guided": guided_world, "random": random_world}
)


def rehearsed_clearance(s: Scenario) -> float:
    """The least clearance of a scenario's drive if its wheels did exactly as told, without movers [m].

    The noise is that of the real run; infinite where no path is planned, minus infinity where the planner raises
    something: that is a failure as well.
    """
    try:
        grid, answer = plan(s)
    except PlannerError:
        return -math.inf
    if not answer.solved:
        return math.inf
    known = dataclasses.replace(route_planner(s), task=s.task, smoothing=s.smoothing)
    route, path = OneRoute(known).route(grid, answer)
    localiser = localiser_of("fixes", s.robot, s.noise, 1.0, 1 / s.control_hz, s.task.start, s.seed)
    plant = Kinematic(s.task.start, lambda pose, twist: np.array([_moved(pose, twist, 1 / s.control_hz)]))
    limit = SETTLING + PATIENCE * route.length / s.robot.max_speed
    drive(plant, Rehearsing(path, s.controller), localiser, GivenMap(), hz=s.control_hz, limit=limit)
    return float(footprint_clearance(s.driven_world, s.robot.footprint, plant.poses).min())


class Rehearsing(Decider):
    """Follows a path with the controller alone, until the robot stands at its end."""

    def __init__(self, path: TrackedPath, controller: PurePursuit) -> None:
        self.step = Step()
        self._path, self._controller = path, controller

    def decide(self, tick: int, pose: Pose, state: State) -> None:
        """The controller's command."""
        self.step = Step(*self._controller.step(self._path, pose, self.step.command, self.step.pursuit))

    def gives_up(self, state: State) -> Ending | None:
        """The end of a robot that stands at the end of the path."""
        there = self.step.pursuit.arc > self._path.length - self._path.goal_distance
        return Ending(Outcome.SUCCEEDED) if there and abs(state.speed) < STANDING else None


def _moved(pose: Pose, twist: Twist, time: float) -> Pose:
    """A pose after driving with a twist for a time [s]."""
    x, y, yaw = pose
    middle = yaw + twist.yaw_rate * time / 2
    way = twist.speed * time
    return x + way * math.cos(middle), y + way * math.sin(middle), math.remainder(yaw + twist.yaw_rate * time, math.tau)
