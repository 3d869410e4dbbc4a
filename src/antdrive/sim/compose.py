"""Composition of a drive. Only this module selects parts by map, localisation, perception and replanning.

`docs/explanation/architecture.md` lists the parts of each kind of drive.
"""

from __future__ import annotations

import dataclasses
import math
from typing import NamedTuple

from antdrive.robots import LIMITERS, Avoidance, Briefing, PurePursuit, capabilities_of_controller
from antdrive.robots.control.controller import Following
from antdrive.robots.default_margin import clearances_off_route
from antdrive.robots.lidar import Lidar
from antdrive.sim.driving.drive import full_turn, no_scan
from antdrive.sim.driving.exploring import Exploration
from antdrive.sim.driving.habits import Habits
from antdrive.sim.driving.localising import localiser_of
from antdrive.sim.driving.movers_ahead import MoversSeenAhead
from antdrive.sim.driving.parts import Localiser, Logs, RouteGuide, Rule, Scanning
from antdrive.sim.driving.perceived_movers import GroundTruth, PerceivedMovers, Tracked
from antdrive.sim.driving.replanning import CellByCell, Replanning
from antdrive.sim.driving.routes import OneRoute, RoutePlanner
from antdrive.sim.driving.rules import (
    EXPLORING_LIMITERS,
    GOAL_SHARE,
    Avoid,
    Follow,
    KeepToSchedule,
    Pursuit,
    SlowAtCorners,
    TurnToScan,
)
from antdrive.sim.driving.stopping_constraint import StoppingConstraint
from antdrive.sim.driving.survey import MoverDetector, MoverTracking, SimulatedLidar, Survey
from antdrive.sim.policy import Perception
from antdrive.sim.scenario import Scenario
from antdrive.sim.sensing.tracking import KnownGround
from antdrive.worlds import Task, World

DRIFTING_SHARE = 0.6  # `GOAL_SHARE` of a mapless robot that tracks movers by lidar
BLIND_SHARE = (
    0.3  # such a robot backs into its blind sector at this fraction of its top speed, unless it avoids a mover
)


class Parts(NamedTuple):
    """Parts of a drive, and their entries in its record; None: unused."""

    localiser: Localiser
    scan: Scanning
    guide: RouteGuide
    rules: tuple[Rule, ...]  # in order of application
    logs: tuple[Logs, ...]
    limiters: tuple[str, ...]  # names of the rules that limit the speed


def compose(s: Scenario) -> Parts:
    """Select the parts of a scenario's drive."""
    perception, avoidance, hz = perception_of(s), avoidance_of(s), s.control_hz
    tracks_movers, mapless = perception.kind == "lidar", s.mapless
    moving = s.moving
    start = s.task.start
    localiser = localiser_of(s.localisation, s.robot, s.noise, s.odometry, 1 / hz, start, s.seed, mapless=mapless)
    survey = _survey(s, tracks_movers, matching=localiser.matched) if mapless else None
    scans = _mover_detector(s) if not mapless and tracks_movers else survey
    tracking = scans.tracking if scans else None
    movers: PerceivedMovers = (
        Tracked(tracking, perception, hz) if tracking else GroundTruth(s.trajectories, perception, hz)
    )
    # A scan may be one scan period old, and commands are delayed.
    reaction = 1 / hz + (1 / _lidar(s).rate if scans else 0.0) + s.robot.noise.scaled(s.noise).delay
    rules: list[Rule] = [_follow(s, movers if moving else None)]
    guide: RouteGuide
    if survey:
        guide = exploration = _exploration(s, survey)
        rules.append(TurnToScan(exploration, s.robot, hz))
    else:
        guide = _guide(s, movers, moving)
    if s.timed:
        rules.append(KeepToSchedule(guide, s.robot, hz))
    if moving and avoidance is not None and not capabilities_of_controller(s.controller).avoids_movers:
        if not mapless and tracking:  # without a map, the stopping constraint keeps the robot to ground that it sees
            rules.append(SlowAtCorners(tracking, s.robot, hz, reaction))
        drifts = survey is not None and tracks_movers
        share = DRIFTING_SHARE if drifts else GOAL_SHARE
        blind = drifts and not _lidar(s).full_circle
        backwards = BLIND_SHARE * s.robot.max_speed if blind else math.inf
        habits = Habits(movers, hz) if movers.uncertain else None
        delay, losses = s.robot.noise.scaled(s.noise).delay, clearances_off_route(s.robot, s.pursuit, s.noise)
        rules.append(
            Avoid(
                avoidance, movers, guide, s.task, s.robot, hz, goal_share=share, backwards=backwards, delay=delay,
                losses=losses, habits=habits,
            )
        )  # fmt: skip
    if survey:
        rules.append(StoppingConstraint(survey, s.robot, hz, reaction, exploration.note_command))
    return Parts(
        localiser,
        scans.scan if scans else no_scan,
        guide,
        tuple(rules),
        tuple(part for part in (localiser, guide, scans, tracking) if part is not None),
        limiters=EXPLORING_LIMITERS if survey else LIMITERS,
    )


def perception_of(s: Scenario) -> Perception:
    """Return the robot's perception of movers: their motions, if the planner needs them."""
    return Perception(kind="motions") if s.timed else s.known_perception


def route_planner(s: Scenario) -> RoutePlanner:
    """Create the route planner of a scenario."""
    return RoutePlanner(
        planner=s.planner,
        planner_label=s.planner_label,
        task=mapless_task(s.task) if s.mapless else s.task,
        robot=s.robot,
        controller=s.pursuit,
        margin=s.planned_margin,
        outline_margins=s.outline_margins,
        usual_margin=s.usual_margin,
        cell=s.planning_cell,
        smoothing=s.driven_smoothing,
        footprint=s.footprint if s.follows_turns else "disc",
        hz=s.control_hz,
        seed=s.seed,
        noise=s.noise,
        motions=s.trajectories.motions if s.timed else (),
        mapless=s.mapless,
        whole=not s.cell_by_cell,
    )


def _follow(s: Scenario, movers: PerceivedMovers | None) -> Rule:
    """Return the rule that follows the path: pure pursuit, or another controller on what it is given."""
    if isinstance(s.controller, PurePursuit):
        return Pursuit(s.controller, full_turn(s.robot, s.control_hz))
    task = s.task
    known = None if s.mapless else dataclasses.replace(task.world, movers=())
    briefing = Briefing(robot=s.robot, goal=task.goal, tolerance=task.goal_tolerance, map=known, hz=s.control_hz)
    return Follow(Following(s.controller, s.controller_label, briefing), movers, s.control_hz)


def mapless_task(task: Task) -> Task:
    """Return the task as known to a mapless robot: start pose, goal and tolerance."""
    (x0, y0), (x1, y1) = task.start[:2], task.goal
    empty = World("unknown", (min(x0, x1) - 1.0, min(y0, y1) - 1.0, max(x0, x1) + 1.0, max(y0, y1) + 1.0))
    return Task(empty, task.start, task.goal, task.goal_tolerance)


def avoidance_of(s: Scenario) -> Avoidance | None:
    """Return the avoidance settings, adapted to the perception of movers.

    Movers with known motions do not reverse unexpectedly, so reversals are ignored. Plans in space and time already avoid
    movers, so the horizon is short.
    """
    if s.avoidance is None or perception_of(s).kind != "motions":
        return s.avoidance
    horizon = min(s.avoidance.horizon, 1.0) if s.timed else s.avoidance.horizon
    return dataclasses.replace(s.avoidance, reversal_weight=0.0, horizon=horizon)


def _guide(s: Scenario, movers: PerceivedMovers, moving: bool) -> RouteGuide:
    """Create the guide of a robot with a map."""
    policy, avoidance = s.replanning, avoidance_of(s)
    if policy is None or not moving:
        return OneRoute(route_planner(s))
    kind = CellByCell if s.cell_by_cell else Replanning
    return kind(route_planner(s), policy, movers, s.robot.radius + avoidance.min_clearance if avoidance else 0.0)


def _exploration(s: Scenario, survey: Survey) -> Exploration:
    """Create the guide of a mapless robot; it plans around tracked movers if the policy says so."""
    policy, ahead = s.replanning, None
    assert policy is not None  # `Scenario` checks that a mapless robot replans
    if survey.tracking is not None and policy.around_movers:
        tracked = Tracked(survey.tracking, perception_of(s), s.control_hz)
        ahead = MoversSeenAhead(tracked, survey, policy, s.robot, s.task.goal, s.inflate, s.control_hz)
    return Exploration(route_planner(s), survey, policy, ahead)


def _survey(s: Scenario, tracks_movers: bool, *, matching: bool) -> Survey:
    """Create the mapping of a mapless robot."""
    tracking = MoverTracking(_lidar(s), s.control_hz) if tracks_movers else None
    return Survey.of(s.robot, s.task, _sensor(s), matching=matching, tracking=tracking)


def _mover_detector(s: Scenario) -> MoverDetector:
    """Create the detection of movers and unknown obstacles for a robot with a map."""
    noise, lidar = s.robot.noise.scaled(s.noise), _lidar(s)
    errors = (noise.pose_xy, noise.pose_yaw) if s.localisation == "fixes" else (0.0, 0.0)
    ground = KnownGround(lidar, s.task.world, *errors)
    return MoverDetector(_sensor(s), ground, MoverTracking(lidar, s.control_hz, *errors))


def _lidar(s: Scenario) -> Lidar:
    assert s.robot.lidar is not None  # `Scenario` checks that the robot has a lidar
    return s.robot.lidar


def _sensor(s: Scenario) -> SimulatedLidar:
    """Simulate the lidar in the driven world."""
    return SimulatedLidar.of(_lidar(s), s.driven_world, s.trajectories, seed=s.seed, noisy=s.noise > 0, hz=s.control_hz)
