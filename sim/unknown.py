"""A scenario without a map: what the robot surveys with, and what finds its routes."""

from __future__ import annotations

from antdrive.sim.driving.caution import Caution
from antdrive.sim.driving.exploring import Exploration
from antdrive.sim.driving.replanning import ReplanPolicy
from antdrive.sim.driving.rescanning import survey_of
from antdrive.sim.scenario import Scenario
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
        hz=s.control_hz,
    )
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
    )


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
