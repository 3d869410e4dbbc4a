"""The plant in physics: each robot drives a `Session`, whose log is certified at the end of its episode."""

from __future__ import annotations

from typing import Any

import numpy as np

from antdrive.base.errors import InputError
from antdrive.base.types import Flags, Floats
from antdrive.gym import _kernels_batch as kernels
from antdrive.gym.batch import ACTION_HZ, CONTROL_HZ, ENDINGS, PHYSICS_HZ, Episode, KinematicPlant
from antdrive.robots import RobotSpec, Twist
from antdrive.robots.control.observation import REST
from antdrive.sim import Perception, Scenario, Session, certify


class PhysicsPlant(KinematicPlant):
    """Robots in physics, one after the other; `make_vec(..., vectorization_mode="async")` uses a process for each.

    The policy gets no path. The log has that of `astar` with margin 0, to which its length is compared; a world without one is
    refused.
    """

    def __init__(self, robot: RobotSpec, number: int, steps: int) -> None:
        super().__init__(robot, number, steps)
        rates = {"control_hz": CONTROL_HZ, "physics_hz": PHYSICS_HZ, "time_limit": steps / ACTION_HZ}
        self._settings: dict[str, Any] = {"margin": 0.0, "perception": Perception(kind="lidar"), **rates}
        self._drives, self._results = dict[int, Session](), dict[int, dict[str, Any]]()

    def _start(self, i: int, episode: Episode) -> None:
        self.leave(i)
        self.robots.ending[i] = 0
        task, (_, _, seed, noise) = episode.task, episode
        drive = Session(Scenario.of(task, "astar", self._spec, seed=seed, noise=noise, **self._settings))
        if drive.path is None:
            raise InputError(f"plant: bullet needs a path for its log, but in {task.world.name}: {drive.plan.reason}")
        self._drives[i] = drive.__enter__()
        self._observe(i)
        self._note(i)

    def drive(self, chosen: Flags, actions: Floats) -> None:
        """Drive the chosen robots for one action each (N, 2), in parts of the highest speed and yaw rate."""
        robots = self.robots
        for i in np.flatnonzero(chosen).tolist():
            drive, before = self._drives[i], robots.facts[i, kernels.DISTANCE]
            for _ in range(CONTROL_HZ // ACTION_HZ):
                kernels.decide(i, float(actions[i, 0]), float(actions[i, 1]), self._shared, robots)
                drive.step(Twist(*robots.state[i, kernels.TO_SPEED : kernels.TO_TURN + 1].tolist()))
                if not drive.ended and self._observe(i) and kernels.arrived(i, robots) != kernels.DRIVING:
                    drive.step(None)  # the referee judges where it stands
                if drive.ended:
                    break
            self._note(i)
            robots.facts[i, kernels.PROGRESS] = before - robots.facts[i, kernels.DISTANCE]
            if drive.ended:
                self.leave(i)

    def leave(self, i: int) -> None:
        """End robot i's drive, if it has one, and keep its results."""
        drive, robots = self._drives.pop(i, None), self.robots
        if drive is None:
            return
        drive.__exit__(None, None, None)
        log = drive.rollout
        assert log is not None  # there is a path
        robots.ending[i] = ENDINGS.index(log.outcome) if log.outcome in ENDINGS else 0
        if log.outcome.with_contact:
            robots.facts[i, kernels.CLEARANCE] = min(robots.facts[i, kernels.CLEARANCE], 0.0)
        self._results[i] = {"digest": log.digest, "certificate": certify(log), "rollout": log}

    def results(self, i: int) -> dict[str, Any]:
        """Return the log of an episode that has ended, its digest and its certificate."""
        self.leave(i)
        return self._results.pop(i)

    def _observe(self, i: int) -> bool:
        """Note what robot i observes in this control period; return whether it stands."""
        now, state, robots = self._drives[i].observe(), self.robots.state[i], self.robots
        robots.tick[i], robots.timing[i, 0] = now.tick, len(now.pending)
        state[kernels.BELIEVED : kernels.BELIEVED + 3] = now.pose
        state[kernels.MEASURED : kernels.MEASURED + 2] = now.twist
        state[kernels.SPEED], state[kernels.TURN] = REST if now.standing else now.twist
        if now.scan is not None:
            robots.seen[i, : len(now.scan)] = np.clip(now.scan / self._shared.ranges[1], 0.0, 1.0)
        for k, command in enumerate(now.pending):
            robots.pending[i, (now.tick + k) % len(now.pending)] = command
        return now.standing

    def _note(self, i: int) -> None:
        """Write the observation of robot i, and what is true, for rewards and infos alone."""
        kernels.see(i, self._shared, self.robots)
        self.robots.state[i, :3] = self._drives[i].true_pose
        kernels.note(i, self._shared, self.robots, self._maps)
