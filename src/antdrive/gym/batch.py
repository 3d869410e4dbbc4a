"""The kinematic plant of many robots at once: motion within limits, noise and delay, exact rays and exact contact."""

from __future__ import annotations

import dataclasses
from collections.abc import Hashable
from typing import Any, NamedTuple

import numpy as np

from antdrive.base.errors import InputError
from antdrive.base.types import Flags, Floats
from antdrive.gym import _kernels_batch as kernels
from antdrive.robots import Lidar, RobotSpec
from antdrive.robots.clearance import kernel_shape
from antdrive.robots.noise import fix_gains
from antdrive.sim.log.outcome import Outcome
from antdrive.worlds import Task, Trajectories

ACTION_HZ, CONTROL_HZ, PHYSICS_HZ = 10, 60, 240
SCAN_RATE = ACTION_HZ * (1 + 1e-6)  # due at each action, whatever the rounding [Hz]
MOST_DELAY = CONTROL_HZ  # control periods in the longest delay that `Noise` allows
#: How an episode ended, by the kernels' number; None while it goes on.
ENDINGS = (None, *map(Outcome.__getitem__, ("SUCCEEDED", "STUCK", "COLLIDED", "HIT_WHILE_STANDING", "HIT_BY_TELEPORT")))


class Episode(NamedTuple):
    """All that an episode depends on."""

    task: Task
    key: Hashable  # of the world and its movers' motions: those with equal keys are equal
    seed: int  # of its random numbers
    noise: float  # factor on the robot's documented noise


def thinned(robot: RobotSpec, beams: int, reach: float) -> RobotSpec:
    """Return a robot whose lidar has this number of beams, a reach of at most `reach` [m] and a scan for each action.

    Raises:
        InputError: the robot has no lidar, or a value is out of range.
    """
    if robot.lidar is None:
        raise InputError(f"robot: {robot.name} has no lidar; add one to its file, or drive jackal or turtlebot4")
    try:
        most = min(reach, robot.lidar.max_range)
        lidar = dataclasses.replace(robot.lidar, beams=beams, max_range=most, rate=SCAN_RATE)
    except (ValueError, TypeError) as error:
        raise InputError(f"lidar: {error}") from None
    return dataclasses.replace(robot, lidar=lidar)


class KinematicPlant:
    """Robots of one kind, each in a world of its own.

    Attributes:
        robots: their state, for the kernels
        tasks: the task of each

    Args:
        robot: their specification
        number: number of robots
        steps: largest number of actions in an episode
    """

    def __init__(self, robot: RobotSpec, number: int, steps: int) -> None:
        assert robot.lidar is not None
        self._spec, self._eye, self._shared = robot, robot.lidar.height, _shared_spec(robot, robot.lidar)
        self._periods = steps * CONTROL_HZ // ACTION_HZ + 2  # rows of a mover's track
        state = np.zeros((number, kernels.COLUMNS))
        self.robots = kernels.Robots(
            state=state,
            bits=state.view(np.uint64),
            random=np.ones(number, dtype=np.uint64),
            digest=np.ones(number, dtype=np.uint64),
            tick=np.zeros(number, dtype=np.int64),
            pending=np.zeros((number, MOST_DELAY, 2)),
            world=np.zeros(number, dtype=np.int64),
            goal=np.zeros((number, 3)),
            noise=np.zeros((number, 7)),
            timing=np.ones((number, 2), dtype=np.int64),
            ending=np.zeros(number, dtype=np.int64),
            facts=np.zeros((number, 3)),
            seen=np.zeros((number, robot.lidar.beams + 5)),
        )
        self.tasks: list[Task | None] = [None] * number
        self._known: dict[Hashable, int] = {}
        self._maps = kernels.Maps(np.empty((0, 7), dtype=np.int64), np.empty((0, 4)), *(np.empty(0) for _ in range(4)))

    def place(self, i: int, episode: Episode) -> None:
        """Put robot i at the start of an episode, and observe."""
        robots, task, spec = self.robots, episode.task, self._spec
        levels = spec.noise.scaled(episode.noise)
        robots.state[i] = 0.0
        robots.state[i, :3] = robots.state[i, kernels.BELIEVED : kernels.BELIEVED + 3] = task.start
        robots.random[i] = robots.digest[i] = np.random.SeedSequence(episode.seed).generate_state(1, np.uint64)[0] | 1
        robots.tick[i] = robots.ending[i] = 0
        robots.pending[i] = 0.0
        if episode.key not in self._known:
            self._add(task)
        self.tasks[i], robots.world[i] = task, self._known.setdefault(episode.key, len(self._known))
        robots.goal[i] = (*task.goal, task.goal_tolerance)
        sizes = levels.pose_xy, levels.pose_yaw, levels.encoder, levels.slip
        robots.noise[i] = (*sizes, *fix_gains(levels, spec.track), episode.noise)
        robots.timing[i] = round(levels.delay * CONTROL_HZ), max(1, round(CONTROL_HZ / levels.pose_rate))
        self._start(i, episode)

    def _start(self, i: int, episode: Episode) -> None:
        """Observe at the start of an episode."""
        kernels.place(i, self._shared, self.robots, self._maps)

    def drive(self, chosen: Flags, actions: Floats) -> None:
        """Drive the chosen robots for one action each (N, 2), in parts of the highest speed and yaw rate."""
        kernels.drive(chosen, actions, self._shared, self.robots, self._maps)

    def leave(self, i: int) -> None:
        """End the episode of robot i; nothing is open."""

    def results(self, i: int) -> dict[str, Any]:
        """Return what is known of an episode at its end: the digest of all its states."""
        return {"digest": f"{int(self.robots.digest[i]):016x}"}

    def movers(self, i: int) -> Floats:
        """Return the present positions of the movers in the world of robot i (M, 2) [m]."""
        _, _, _, _, _, count, first = self._maps.rows[self.robots.world[i]]
        at = first + 2 * count * self.robots.tick[i]
        return np.asarray(self._maps.tracks[at : at + 2 * count].reshape(count, 2))

    def _add(self, task: Task) -> None:
        """Add a task's world to the maps."""
        world, maps, movers = task.world, self._maps, Trajectories.of(task.world, task.start[:2])
        discs, heights = world.discs, np.array([disc.height for disc in world.obstacles])
        visible = discs[heights >= self._eye]
        radii = np.where(movers.heights >= self._eye, movers.radii, -movers.radii)
        tracks = movers.positions(np.arange(self._periods if len(movers) else 0) / CONTROL_HZ)
        row = (len(maps.discs), len(discs), len(maps.visible), len(visible), len(maps.radii), len(radii))
        parts: Any = (
            [[*row, len(maps.tracks)]],
            [world.bounds],
            discs.ravel(),
            visible.T.ravel(),
            radii,
            tracks.ravel(),
        )
        self._maps = kernels.Maps(*(np.concatenate(pair) for pair in zip(maps, parts, strict=True)))


def _shared_spec(robot: RobotSpec, lidar: Lidar) -> Any:
    angles = lidar.angles - lidar.yaw
    limits = (robot.max_speed, robot.max_yaw_rate, robot.max_acceleration, robot.max_yaw_acceleration)
    rim = robot.max_wheel_speed * robot.wheel_radius
    return kernels.SharedSpec(
        np.array((*limits, robot.max_lateral_acceleration, rim, robot.track / 2)),
        *kernel_shape(robot.footprint),
        np.array((lidar.x, lidar.y, lidar.yaw, float(angles[0]), lidar.spacing)),
        np.stack((np.cos(angles), np.sin(angles))),
        np.array((lidar.min_range, lidar.max_range, lidar.resolution, lidar.sigma)),
        np.array((CONTROL_HZ // ACTION_HZ, PHYSICS_HZ // CONTROL_HZ, CONTROL_HZ)),
    )
