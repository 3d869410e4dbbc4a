"""The plant in physics: each robot drives a `Session`, whose log is certified at the end of its episode."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from antdrive import sim
from antdrive.base.errors import InputError
from antdrive.base.types import Flags, Floats
from antdrive.gym import _kernels_batch as kernels
from antdrive.gym.batch import ACTION_HZ, CONTROL_HZ, ENDINGS, PHYSICS_HZ, Episode, KinematicPlant
from antdrive.planners import load_planner
from antdrive.robots import RobotSpec, Twist, footprint_clearance
from antdrive.worlds import Disc, World


def open_session(scenario: sim.Scenario) -> Any:
    """Return a drive in physics that is commanded from outside.

    Raises:
        InputError: this version has no such drives, or the planner finds no path.
    """
    session = getattr(sim, "Session", None)
    if session is None:
        raise InputError("plant: bullet needs antdrive.Session, which this version lacks; use kinematic")
    drive = session(scenario)
    if drive.path is None:
        where = f"in {scenario.task.world.name}, seed {scenario.seed}"
        raise InputError(f"plant: bullet needs a path for its log, but {where}: {drive.plan.reason or 'no path'}")
    return drive.__enter__()


def true_pose(drive: Any) -> Any:
    """Return the robot's true pose, for rewards and infos alone."""
    return drive._plant.state.pose


class PhysicsPlant(KinematicPlant):
    """Robots in physics, one after the other; `make_vec(..., vectorization_mode="async")` uses a process for each."""

    def __init__(self, robot: RobotSpec, number: int, steps: int) -> None:
        super().__init__(robot, number, steps)
        self._limit, self._drives = steps / ACTION_HZ, dict[int, Any]()
        self._scenarios, self._results = dict[int, sim.Scenario](), dict[int, dict[str, Any]]()

    def place(self, i: int, episode: Episode) -> None:
        """Put robot i at the start of an episode, and observe."""
        self.leave(i)
        self.tasks[i], robots = episode.task, self.robots
        scenario = self._scenarios[i] = sim.Scenario(
            task=episode.task,
            planner=load_planner("astar"),
            planner_name="astar",
            robot=self._spec,
            seed=episode.seed,
            noise=episode.noise,
            margin=0.0,
            perception=sim.Perception(kind="lidar"),
            control_hz=CONTROL_HZ,
            physics_hz=PHYSICS_HZ,
            time_limit=self._limit,
        )
        self._drives[i] = open_session(scenario)
        robots.state[i], robots.ending[i], robots.tick[i] = 0.0, 0, 0
        robots.goal[i] = (*episode.task.goal, episode.task.goal_tolerance)
        self._look(i)

    def drive(self, chosen: Flags, actions: Floats) -> None:
        """Drive the chosen robots for one action each (N, 2), in parts of the highest speed and yaw rate."""
        robots = self.robots
        for i in np.flatnonzero(chosen).tolist():
            drive, before = self._drives[i], robots.facts[i, kernels.DISTANCE]
            for _ in range(CONTROL_HZ // ACTION_HZ):
                kernels.decide(i, float(actions[i, 0]), float(actions[i, 1]), self._body, robots)
                drive.step(Twist(*robots.state[i, kernels.TO_SPEED : kernels.TO_TURN + 1].tolist()))
                if not drive.ended:
                    self._observe(i)
                if drive.ended or kernels.arrived(i, robots):
                    break
            if not drive.ended and kernels.arrived(i, robots):
                drive.step(None)  # the referee judges where it stands
            self._look(i)
            robots.facts[i, kernels.PROGRESS] = before - robots.facts[i, kernels.DISTANCE]
            if drive.ended:
                self.leave(i)

    def leave(self, i: int) -> None:
        """End robot i's drive, if it has one, and keep its results."""
        drive = self._drives.pop(i, None)
        if drive is None:
            return
        drive.__exit__(None, None, None)
        log = drive.rollout
        self.robots.ending[i] = ENDINGS.index(log.outcome) if log.outcome in ENDINGS else 0
        self._results[i] = {"digest": log.digest, "certificate": sim.certify(log), "rollout": log}

    def results(self, i: int) -> dict[str, Any]:
        """Return the log of an episode that has ended, its digest and its certificate."""
        self.leave(i)
        return self._results.pop(i)

    def movers(self, i: int) -> Floats:
        """Return the present positions of the movers in the world of robot i (M, 2) [m]."""
        return np.asarray(self._scenarios[i].trajectories.positions(self.robots.tick[i] / CONTROL_HZ)[0])

    def _observe(self, i: int) -> None:
        """Note what robot i observes in this control period, and where it truly is."""
        now, state, robots = self._drives[i].observe(), self.robots.state[i], self.robots
        robots.tick[i] = now.tick
        state[kernels.BELIEVED : kernels.BELIEVED + 3] = now.pose
        state[kernels.SPEED], state[kernels.TURN] = now.twist
        count = self._body.beams.shape[1]
        if now.scan is not None:
            robots.seen[i, :count] = np.clip(now.scan / self._body.ranges[1], 0.0, 1.0)
        robots.timing[i, 0] = len(now.pending)
        for k, command in enumerate(now.pending):
            robots.pending[i, (now.tick + k) % len(now.pending)] = command
        kernels.see(i, self._body, robots)

    def _look(self, i: int) -> None:
        """Observe with robot i, if its drive goes on, and note what is true."""
        drive, scenario, robots = self._drives[i], self._scenarios[i], self.robots
        if not drive.ended:
            self._observe(i)
        pose, world, goal = true_pose(drive), scenario.driven_world, scenario.task.goal
        radii = scenario.trajectories.radii.tolist()
        there = [Disc(x, y, radius) for (x, y), radius in zip(self.movers(i).tolist(), radii, strict=True)]
        among = World(world.name, world.bounds, (*world.obstacles, *there)) if there else world
        clearance = float(footprint_clearance(among, self._spec.footprint, [pose])[0])
        if drive.ended and drive.ended.outcome.with_contact:
            clearance = min(clearance, 0.0)
        robots.state[i, :3] = pose
        robots.facts[i, : kernels.PROGRESS] = clearance, math.dist(pose[:2], goal)
