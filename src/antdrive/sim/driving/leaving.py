"""Narrow starts: a rehearsal of the robot's first motion with its exact footprint."""

from __future__ import annotations

from antdrive.base import Pose
from antdrive.robots import PurePursuit, PursuitState, RobotSpec, TrackedPath, footprint_clearance
from antdrive.robots.clearance import footprint_distances
from antdrive.robots.control.observation import REST
from antdrive.sim.driving.body import Body
from antdrive.sim.driving.localising import Exact
from antdrive.sim.driving.plants import Kinematic
from antdrive.sim.driving.senses import Senses
from antdrive.worlds import World, point_clearance
from antdrive.worlds.world import obstacle_name

REHEARSED = 60.0  # limit of the rehearsal; the drive decides what follows [s]


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
    if robot.footprint.corners and not _rehearsed(tracked, controller, world, robot, start, control_hz, halts=True):
        return ""
    stopped = _rehearsed(tracked.ignoring_turn_clearance, controller, world, robot, start, control_hz)
    if stopped is None or not stopped[0].touched:
        return ""
    plant, turning = stopped
    touching = footprint_clearance(world, robot.footprint, plant.way) <= 0
    gap = footprint_distances(world, robot, plant.way[touching][:1])[0]
    does = "turning on the spot" if turning else "driving off"
    return (
        f"{does} at the start would bring {robot.name} into {obstacle_name(world, int(gap.argmin()))}; "
        f"a free turn needs {robot.radius:.3f} m around its centre, the start has {_room(world, start):.3f} m"
    )


def _rehearsed(
    path: TrackedPath,
    controller: PurePursuit,
    world: World,
    robot: RobotSpec,
    start: Pose,
    hz: int,
    *,
    halts: bool = False,
) -> tuple[Kinematic, bool] | None:
    """Follow a path until the robot can turn freely, and return None; else where it ended, and whether it turned.

    With `halts`, a stop by the controller ends it, too.
    """
    plant = Kinematic(start, 1 / hz, robot, world)
    body = Body(plant, Senses(), Exact(start, 1 / hz), hz=hz, limit=REHEARSED)
    command, state = REST, PursuitState()
    while body.ended is None:
        pose = body.observe().pose
        if not is_narrow(world, robot, pose):
            return None
        command, state = controller.pursue(path, pose, command, state)
        if halts and not any(command):
            break
        body.step(command)
    return plant, state.turning


def _room(world: World, pose: Pose) -> float:
    return float(point_clearance(world, [pose[:2]])[0])
