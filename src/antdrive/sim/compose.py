"""Compose the parts of a scenario's drive. Only this module asks for map, localisation, perception, replanning and capabilities.

| run | localiser | map | guide | others | rules, in order |
|---|---|---|---|---|---|
| given map, nothing moves | Exact, Fixes, TruePose, Reckoned | GivenMap | OneRoute | - | Pursuit |
| among movers | the same | GivenMap or Lookout | Replanning or OneRoute | Told or Tracked | Pursuit, Avoid |
| planner in space and time | the same | GivenMap | Replanning | Told | Pursuit, KeepToSchedule, Avoid |
| cell by cell | the same | GivenMap or Lookout | CellByCell | Told or Tracked | Pursuit, Avoid |
| no map | the same | Survey | Exploration | Told or Tracked | Pursuit, LookRound, Avoid, StayInSight |
"""

from __future__ import annotations

import dataclasses
import math
from typing import NamedTuple

from antdrive.planners import capabilities_of
from antdrive.robots import LIMITERS, Avoidance
from antdrive.sim.driving.cellwise import CellByCell
from antdrive.sim.driving.driver import full_turn
from antdrive.sim.driving.exploring import Exploration
from antdrive.sim.driving.given import Exact, GivenMap
from antdrive.sim.driving.localising import Fixes, localiser_of
from antdrive.sim.driving.lookout import Lookout
from antdrive.sim.driving.movers_ahead import MoversSeenAhead
from antdrive.sim.driving.parts import Localiser, Logs, Map, Others, RouteGuide, Rule
from antdrive.sim.driving.perception import Told
from antdrive.sim.driving.replanning import Replanning
from antdrive.sim.driving.routes import OneRoute, RoutePlanner
from antdrive.sim.driving.rules import (
    EXPLORING_LIMITERS,
    GOAL_SHARE,
    Avoid,
    KeepToSchedule,
    LookRound,
    Pursuit,
    StayInSight,
)
from antdrive.sim.driving.stopping_constraint import Caution
from antdrive.sim.driving.survey import Senses, Survey
from antdrive.sim.driving.watching import Tracked, Watch
from antdrive.sim.policy import Perception, ReplanPolicy
from antdrive.sim.scenario import Scenario
from antdrive.sim.sensing.ground import KnownGround
from antdrive.worlds import Task, World

DRIFTING_SHARE = 0.6  # of the goal's tolerance, as `GOAL_SHARE`, of a robot that finds movers and its way by its lidar
BLIND_SHARE = 0.3  # of its top speed such a robot backs off where its lidar does not look, unless a mover is met then


class Composition(NamedTuple):
    """What the record says of a composition; None: the robot has no use for it."""

    perception: Perception | None  # what the robot perceives of movers
    avoidance: Avoidance | None  # how it avoids them
    replanning: ReplanPolicy | None  # when it looks for a new route
    limiters: tuple[str, ...]  # the names of the rules that limit its speed
    mapped: bool  # whether its plans are those of the world's map


class Parts(NamedTuple):
    """The parts of one drive. The rules apply in their order."""

    localiser: Localiser
    map: Map
    guide: RouteGuide
    rules: tuple[Rule, ...]
    logs: tuple[Logs, ...]
    declared: Composition


def compose(s: Scenario) -> Parts:
    """The parts of a scenario's drive."""
    localiser = localiser_of(s.localisation, s.robot, s.noise, s.odometry, 1 / s.control_hz, s.task.start, s.seed)
    return _without_map(s, localiser) if s.exploring else _with_map(s, localiser)


def _with_map(s: Scenario, localiser: Exact | Fixes) -> Parts:
    """A robot that knows the world's map."""
    lookout = _lookout(s) if s.watching else None
    others = _others(s, lookout.watch if lookout else None)
    guide = _guide(s, others)
    rules: list[Rule] = [_pursuit(s)]
    if isinstance(guide, Replanning) and capabilities_of(s.planner).needs_motions:
        rules.append(KeepToSchedule(guide, s.robot, s.control_hz))
    avoidance = avoidance_of(s)
    if s.among_movers and avoidance is not None:
        rules.append(Avoid(avoidance, others, guide, s.task, s.robot, s.control_hz))
    logs = (localiser, lookout, lookout.watch) if lookout else (localiser,)
    return Parts(localiser, lookout or GivenMap(), guide, tuple(rules), logs, _declared(s, LIMITERS))


def _without_map(s: Scenario, localiser: Exact | Fixes) -> Parts:
    """A robot that knows what its lidar has seen."""
    lidar, hz = s.robot.lidar, s.control_hz
    assert lidar is not None  # a scenario without a map has one
    survey = Survey.of(
        s.robot,
        s.task,
        Senses.of(lidar, s.driven_world, s.trajectories, seed=s.seed, noisy=s.noise > 0, hz=hz),
        matching=s.localisation == "matching",
        watch=Watch(lidar, hz) if s.watching else None,
    )
    watch, others = survey.watch, _others(s, survey.watch)
    planner, policy = route_planner(s), s.replanning or ReplanPolicy()
    ahead = None
    if watch is not None and s.replanning is not None and policy.around_movers:
        tracked = Tracked(watch, s.effective_perception, hz)
        ahead = MoversSeenAhead(tracked, survey, policy, s.robot, s.task.goal, s.inflate, hz)
    guide = Exploration(planner, survey, policy, ahead)
    rules: list[Rule] = [_pursuit(s), LookRound(guide, s.robot, hz)]
    avoidance = avoidance_of(s)
    if s.among_movers and avoidance is not None:
        drifts = watch is not None
        share = DRIFTING_SHARE if drifts else GOAL_SHARE
        backwards = BLIND_SHARE * s.robot.max_speed if drifts and not lidar.full_circle else math.inf
        rules.append(Avoid(avoidance, others, guide, s.task, s.robot, hz, goal_share=share, backwards=backwards))
    # One scan may be as old as their period, and commands are late.
    reaction = 1 / hz + 1 / lidar.rate + s.robot.noise.scaled(s.noise).delay
    rules.append(StayInSight(Caution(survey, s.robot, hz, reaction), guide))
    logs = (localiser, survey, guide, watch) if watch else (localiser, survey, guide)
    return Parts(localiser, survey, guide, tuple(rules), logs, _declared(s, EXPLORING_LIMITERS))


def route_planner(s: Scenario) -> RoutePlanner:
    """What plans the routes of a scenario."""
    return RoutePlanner(
        planner=s.planner,
        planner_label=s.planner_label,
        task=told(s.task) if s.exploring else s.task,
        robot=s.robot,
        controller=s.controller,
        margin=s.margin,
        cell=s.planning_cell,
        smoothing="none" if s.timed else s.smoothing,
        hz=s.control_hz,
        seed=s.seed,
        motions=s.trajectories.motions if s.timed else (),
    )


def told(task: Task) -> Task:
    """All that a robot without a map is given of a task: its first pose, where the goal is from there, and the tolerance."""
    (x0, y0), (x1, y1) = task.start[:2], task.goal
    empty = World("unknown", (min(x0, x1) - 1.0, min(y0, y1) - 1.0, max(x0, x1) + 1.0, max(y0, y1) + 1.0))
    return Task(empty, task.start, task.goal, task.goal_tolerance)


def avoidance_of(s: Scenario) -> Avoidance | None:
    """How the robot avoids movers, given what it knows of them.

    Movers whose motions are known do not reverse unexpectedly, so reversals are not considered. A plan in
    space and time avoids the movers already, so the horizon is short.
    """
    if s.avoidance is None or s.effective_perception.kind != "motions":
        return s.avoidance
    horizon = min(s.avoidance.horizon, 1.0) if s.timed else s.avoidance.horizon
    return dataclasses.replace(s.avoidance, reversal_weight=0.0, horizon=horizon)


def _guide(s: Scenario, others: Others) -> OneRoute:
    """What plans the routes of a robot with a map."""
    policy, avoidance = s.replanning, avoidance_of(s)
    if policy is None or not s.among_movers:
        return OneRoute(route_planner(s))
    kind = CellByCell if capabilities_of(s.planner).cell_by_cell and policy.around_movers else Replanning
    return kind(route_planner(s), policy, others, s.robot.radius + avoidance.min_clearance if avoidance else 0.0)


def _others(s: Scenario, watch: Watch | None) -> Others:
    """The movers as the robot perceives them."""
    perception = s.effective_perception
    return Tracked(watch, perception, s.control_hz) if watch else Told(s.trajectories, perception, s.control_hz)


def _lookout(s: Scenario) -> Lookout:
    """What looks for movers, and for obstacles that are not on the given map."""
    lidar = s.robot.lidar
    assert lidar is not None  # a scenario in which a lidar sees has one
    noise = s.robot.noise.scaled(s.noise)
    errors = (noise.pose_xy, noise.pose_yaw) if s.localisation == "fixes" else (0.0, 0.0)
    ground = KnownGround(lidar, s.task.world, math.inf, *errors)
    senses = Senses.of(lidar, s.driven_world, s.trajectories, seed=s.seed, noisy=s.noise > 0, hz=s.control_hz)
    return Lookout(senses, ground, Watch(lidar, s.control_hz, *errors))


def _pursuit(s: Scenario) -> Pursuit:
    return Pursuit(s.controller, full_turn(s.robot, s.control_hz))


def _declared(s: Scenario, limiters: tuple[str, ...]) -> Composition:
    moving = s.among_movers
    return Composition(
        perception=s.effective_perception if moving else None,
        avoidance=avoidance_of(s) if moving else None,
        replanning=s.replanning if moving or s.exploring else None,
        limiters=limiters,
        mapped=not s.exploring,
    )
