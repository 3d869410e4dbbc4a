"""Whether a robot gets away from a start where it cannot turn freely: its first motion, rehearsed with its footprint."""

from __future__ import annotations

import math

import numpy as np

from antdrive.base import Floats, Pose
from antdrive.robots import PurePursuit, PursuitState, RobotSpec, TrackedPath, Twist, footprint_clearance
from antdrive.robots.placing import gaps, name_of
from antdrive.worlds import World, point_clearance

REHEARSED = 60.0  # after this time a robot that is still in a narrow place is left to the drive [s]
STEP = 2e-4  # no point of the footprint moves farther between two poses that are checked [m]


def is_narrow(world: World, robot: RobotSpec, pose: Pose) -> bool:
    """Whether a robot that fits at a pose could touch something if it turned there."""
    return not robot.footprint.is_disc and _room(world, pose) <= robot.radius


def cannot_leave(
    tracked: TrackedPath, controller: PurePursuit, world: World, robot: RobotSpec, start: Pose, control_hz: int
) -> str:
    """What the robot would touch on its way out of a narrow place, and what turning needs there; empty if it gets out.

    The controller's own commands are followed exactly, from rest, until the robot could turn freely. A way out that it does
    not take is no way out. It turns the shorter way round; a robot that is not centred on its axle turns the other way
    where the shorter is blocked and the longer is not.
    """
    if robot.footprint.corners and _gets_away(tracked, controller, world, robot, start, control_hz):
        return ""
    pose, command, state = start, Twist(0.0, 0.0), PursuitState()
    path = tracked.for_any_turn
    for _ in range(round(REHEARSED * control_hz)):
        if not is_narrow(world, robot, pose):
            return ""
        command, state = controller.step(path, pose, command, state)
        way = _way(pose, command, 1 / control_hz, robot.radius)
        touching = footprint_clearance(world, robot.footprint, way) <= 0
        if touching.any():
            gap = gaps(world, robot, way[touching][:1])[0]
            does = "turning on the spot" if state.turning else "driving off"
            return (
                f"{does} at the start would bring {robot.name} into {name_of(world, int(gap.argmin()))}; "
                f"a free turn needs {robot.radius:.3f} m around its centre, the start has {_room(world, start):.3f} m"
            )
        x, y, yaw = way[-1].tolist()
        pose = (x, y, yaw)
    return ""


def _gets_away(
    tracked: TrackedPath, controller: PurePursuit, world: World, robot: RobotSpec, start: Pose, control_hz: int
) -> bool:
    """Whether a robot that turns only where nothing is in its way leaves the narrow place and touches nothing."""
    pose, command, state = start, Twist(0.0, 0.0), PursuitState()
    for _ in range(round(REHEARSED * control_hz)):
        if not is_narrow(world, robot, pose):
            return True
        command, state = controller.step(tracked, pose, command, state)
        if not any(command):
            return False
        way = _way(pose, command, 1 / control_hz, robot.radius)
        if (footprint_clearance(world, robot.footprint, way) <= 0).any():
            return False
        x, y, yaw = way[-1].tolist()
        pose = (x, y, yaw)
    return False


def _room(world: World, pose: Pose) -> float:
    return float(point_clearance(world, [pose[:2]])[0])


def _way(pose: Pose, command: Twist, period: float, radius: float) -> Floats:
    """The poses (K, 3) that a robot of this radius passes in a period, after the one given."""
    speed, yaw_rate = command
    count = max(1, math.ceil((abs(speed) + abs(yaw_rate) * radius) * period / STEP))
    t = period * np.arange(1, count + 1) / count
    x, y, yaw = pose
    half = yaw_rate * t / 2
    chord = speed * t * np.sinc(half / np.pi)
    return np.stack([x + chord * np.cos(yaw + half), y + chord * np.sin(yaw + half), yaw + 2 * half], axis=1)
