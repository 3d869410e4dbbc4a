"""Narrow starts: a rehearsal of the robot's first motion with its exact footprint."""

from __future__ import annotations

import math

import numpy as np

from antdrive.base import Floats, Pose
from antdrive.robots import PurePursuit, RobotSpec, TrackedPath, Twist, footprint_clearance
from antdrive.robots.clearance import footprint_distances, obstacle_name
from antdrive.sim.driving.drive import drive
from antdrive.sim.driving.localising import Exact
from antdrive.sim.driving.parts import Decider, Ending, Step
from antdrive.sim.driving.plants import Kinematic
from antdrive.sim.log.outcome import Outcome
from antdrive.sim.physics.engine import State
from antdrive.worlds import World, point_clearance

REHEARSED = 60.0  # limit of the rehearsal; the drive decides what follows [s]
STEP = 2e-4  # longest motion of a footprint point between two checked poses [m]


def is_narrow(world: World, robot: RobotSpec, pose: Pose) -> bool:
    """Return whether a robot that fits at a pose could touch something by turning there."""
    return not robot.footprint.is_disc and _room(world, pose) <= robot.radius


def cannot_leave(
    tracked: TrackedPath, controller: PurePursuit, world: World, robot: RobotSpec, start: Pose, control_hz: int
) -> str:
    """Describe the obstacle that keeps the robot in a narrow start, and the room that a turn needs; empty if it gets out.

    The rehearsal follows the controller's commands exactly, from rest, until the robot can turn freely. Only the
    route that the controller takes counts. The robot turns the shorter way round. If that is blocked, a robot not
    centred on its axle turns the other way.
    """
    if robot.footprint.corners:
        halting = Leaving(tracked, controller, world, robot, halts=True)
        if _rehearsed(halting, world, robot, start, control_hz)[0].outcome is Outcome.SUCCEEDED:
            return ""
    leaving = Leaving(tracked.ignoring_turn_clearance, controller, world, robot)
    ending, plant = _rehearsed(leaving, world, robot, start, control_hz)
    if ending.outcome is not Outcome.COLLIDED:
        return ""
    touching = footprint_clearance(world, robot.footprint, plant.way) <= 0
    gap = footprint_distances(world, robot, plant.way[touching][:1])[0]
    does = "turning on the spot" if leaving.step.pursuit.turning else "driving off"
    return (
        f"{does} at the start would bring {robot.name} into {obstacle_name(world, int(gap.argmin()))}; "
        f"a free turn needs {robot.radius:.3f} m around its centre, the start has {_room(world, start):.3f} m"
    )


class Leaving(Decider):
    """Decider that follows a path until the robot can turn freely; with `halts`, a stop by the controller ends it."""

    def __init__(
        self, path: TrackedPath, controller: PurePursuit, world: World, robot: RobotSpec, *, halts: bool = False
    ) -> None:
        self.step = Step()
        self._path, self._controller, self._world, self._robot, self._halts = path, controller, world, robot, halts

    def decide(self, tick: int, pose: Pose, state: State) -> Ending | None:
        """Return the controller's command while the place is narrow."""
        if not is_narrow(self._world, self._robot, pose):
            return Ending(Outcome.SUCCEEDED)
        self.step = Step(*self._controller.pursue(self._path, pose, self.step.command, self.step.pursuit))
        return Ending(Outcome.STUCK) if self._halts and not any(self.step.command) else None


def _rehearsed(leaving: Leaving, world: World, robot: RobotSpec, start: Pose, hz: int) -> tuple[Ending, Kinematic]:
    """Rehearse the start; return the ending and the robot."""
    plant = Kinematic(
        start,
        lambda pose, twist: _way(pose, twist, 1 / hz, robot.radius),
        lambda way: bool((footprint_clearance(world, robot.footprint, way) <= 0).any()),
    )
    return drive(plant, leaving, Exact(), hz=hz, limit=REHEARSED), plant


def _room(world: World, pose: Pose) -> float:
    return float(point_clearance(world, [pose[:2]])[0])


def _way(pose: Pose, command: Twist, period: float, radius: float) -> Floats:
    """Return the poses (K, 3) of a robot of this radius during a period, without the first."""
    speed, yaw_rate = command
    count = max(1, math.ceil((abs(speed) + abs(yaw_rate) * radius) * period / STEP))
    t = period * np.arange(1, count + 1) / count
    x, y, yaw = pose
    half = yaw_rate * t / 2
    chord = speed * t * np.sinc(half / np.pi)
    return np.stack([x + chord * np.cos(yaw + half), y + chord * np.sin(yaw + half), yaw + 2 * half], axis=1)
