"""What a robot finds out by itself: without a map what it surveys with and what finds its routes, and movers by lidar."""

from __future__ import annotations

import math

from antdrive.sim.driving.caution import Caution
from antdrive.sim.driving.exploring import Exploration
from antdrive.sim.driving.lookout import Lookout
from antdrive.sim.driving.movers_ahead import MoversAhead
from antdrive.sim.driving.perception import Predictor
from antdrive.sim.driving.replanning import ReplanPolicy
from antdrive.sim.driving.rescanning import survey_of
from antdrive.sim.driving.survey import Senses
from antdrive.sim.driving.watching import TrackedPredictor, Watch
from antdrive.sim.scenario import Scenario
from antdrive.sim.sensing.ground import KnownGround
from antdrive.worlds import Task, World


def exploration_of(s: Scenario) -> Exploration:
    """What finds the routes of a drive without a map, after the first look from the start."""
    survey = survey_of(
        s.robot,
        s.task,
        s.driven_world,
        s.trajectories,
        seed=s.seed,
        noisy=s.noise > 0,
        matching=s.localisation == "matching",
        watching=s.watching,
        hz=s.control_hz,
    )
    movers = None
    if survey.watch is not None and s.replanning is not None and s.replanning.around_movers:
        predictor = TrackedPredictor(survey.watch, s.effective_perception, s.control_hz)
        movers = MoversAhead(predictor, survey, s.replanning, s.robot, s.task.goal, s.inflate, s.control_hz)
    return Exploration(
        s.planner,
        survey,
        told(s.task),
        s.rng("replanner"),
        robot=s.robot,
        controller=s.controller,
        policy=s.replanning or ReplanPolicy(),
        margin=s.margin,
        smoothing=s.smoothing,
        cell=s.planning_cell,
        hz=s.control_hz,
        movers=movers,
    )


def lookout_of(s: Scenario) -> Lookout | None:
    """What looks for movers, and for obstacles that are not on the map, where the robot is given a map; None: nothing does."""
    lidar = s.robot.lidar
    if not s.watching or s.exploring or lidar is None:
        return None
    noise = s.robot.noise.scaled(s.noise)
    errors = (noise.pose_xy, noise.pose_yaw) if s.localisation == "fixes" else (0.0, 0.0)
    ground = KnownGround(lidar, s.task.world, math.inf, *errors)
    senses = Senses.of(lidar, s.driven_world, s.trajectories, seed=s.seed, noisy=s.noise > 0, hz=s.control_hz)
    return Lookout(senses, ground, Watch(lidar, s.control_hz, *errors))


def predictor_of(s: Scenario, watch: Watch | None) -> Predictor | None:
    """What predicts the movers for avoidance and replanning: from what the robot is told of them, or from its scans."""
    if watch is not None:
        return TrackedPredictor(watch, s.effective_perception, s.control_hz)
    return Predictor(s.trajectories, s.effective_perception, s.control_hz) if s.trajectories else None


def told(task: Task) -> Task:
    """All that the robot is told of a task: its first pose, where the goal is from there, and how close it must come."""
    (x0, y0), (x1, y1) = task.start[:2], task.goal
    empty = World("unknown", (min(x0, x1) - 1.0, min(y0, y1) - 1.0, max(x0, x1) + 1.0, max(y0, y1) + 1.0))
    return Task(empty, task.start, task.goal, task.goal_tolerance)


def caution_of(s: Scenario, exploration: Exploration) -> Caution:
    """What keeps the robot within its sight: one scan may be as old as their period, and commands are late."""
    assert s.robot.lidar is not None
    reaction = 1 / s.control_hz + 1 / s.robot.lidar.rate + s.robot.noise.scaled(s.noise).delay
    return Caution(exploration.survey, s.robot, s.control_hz, reaction)
