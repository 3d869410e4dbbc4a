"""Which world to try next: any at random, or the one of many in which a rehearsal without physics comes closest to a contact."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import TypeAlias

from antdrive.base import Pose
from antdrive.planners import PlannerError, smooth
from antdrive.robots import NoiseModel, PursuitState, Twist, footprint_clearance
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
    world, period = s.task.world, 1 / s.control_hz
    route = smooth(answer, grid, s.task, kind=s.smoothing)
    tracked = s.controller.prepare(route, world, s.robot, s.margin, period, s.task.goal_tolerance)
    level = s.robot.noise.scaled(s.noise)
    noise = NoiseModel(level, s.robot.track, period, s.task.start, s.rng("noise")) if level.nonzero else None
    poses, state = [s.task.start], PursuitState()
    command = actuated = Twist(0.0, 0.0)
    for _ in range(round((SETTLING + PATIENCE * route.length / s.robot.max_speed) * s.control_hz)):
        believed = poses[-1]
        if noise is not None:
            noise.estimate_pose(believed, actuated)
            believed = noise.pose_after_delay()
        command, state = s.controller.step(tracked, believed, command, state)
        actuated = noise.actuate(command) if noise is not None else command
        poses.append(_moved(poses[-1], actuated, period))
        if state.arc > tracked.length - tracked.goal_distance and abs(actuated.speed) < STANDING:
            break
    return float(footprint_clearance(s.driven_world, s.robot.footprint, poses).min())


def _moved(pose: Pose, twist: Twist, time: float) -> Pose:
    """A pose after driving with a twist for a time [s]."""
    x, y, yaw = pose
    middle = yaw + twist.yaw_rate * time / 2
    way = twist.speed * time
    return x + way * math.cos(middle), y + way * math.sin(middle), math.remainder(yaw + twist.yaw_rate * time, math.tau)
