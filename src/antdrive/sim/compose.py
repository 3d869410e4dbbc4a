"""Composition of a drive. Only this module selects parts by map, localisation, perception and replanning.

`docs/explanation/architecture.md` lists the parts of each kind of drive.
"""

from __future__ import annotations

import dataclasses
import math

from antdrive.base.records import unchecked_copy
from antdrive.robots import Avoidance, Briefing, PurePursuit, capabilities_of_controller
from antdrive.robots.control.controller import Following
from antdrive.robots.default_margin import clearances_off_route
from antdrive.robots.lidar import Lidar
from antdrive.sim.driving.driver import Driver, full_turn
from antdrive.sim.driving.exploring import Exploration
from antdrive.sim.driving.guide import Rule
from antdrive.sim.driving.habits import Habits
from antdrive.sim.driving.localising import Exact
from antdrive.sim.driving.mover_tracking import MoverTracking
from antdrive.sim.driving.movers_ahead import MoversSeenAhead
from antdrive.sim.driving.perceived_movers import PerceivedMovers, Tracked
from antdrive.sim.driving.replanning import CellByCell, Replanning
from antdrive.sim.driving.route_planner import RoutePlanner
from antdrive.sim.driving.routes import OneRoute
from antdrive.sim.driving.rules import (
    GOAL_SHARE,
    Avoid,
    ByController,
    KeepToSchedule,
    Pursuit,
    SlowAtCorners,
    TurnToScan,
)
from antdrive.sim.driving.senses import MoverSense, Senses, SimulatedLidar, positioning
from antdrive.sim.driving.stopping_constraint import StoppingConstraint
from antdrive.sim.driving.survey import MoverDetector, Survey, turning_room
from antdrive.sim.log.streams import random_stream
from antdrive.sim.policy import Perception
from antdrive.sim.scenario import Scenario
from antdrive.sim.sensing.tracking import KnownGround
from antdrive.worlds import Task, World

DRIFTING_SHARE = 0.6  # `GOAL_SHARE` of a mapless robot that tracks movers by lidar
# Such a robot backs into its blind sector at this fraction of its top speed, unless it avoids a mover.
BLIND_SHARE = 0.3


def compose(s: Scenario) -> tuple[tuple[Senses, Exact], OneRoute | Exploration, Driver]:
    """Create a scenario's senses with the localiser, and the guide and the mind, which know the briefing and observations."""
    perception, trajectories, hz, start = perception_of(s), s.trajectories, s.control_hz, s.task.start
    tracks_movers = perception.kind == "lidar"
    levels = s.localisation, s.robot, s.noise, s.odometry, 1 / hz
    senses, localiser = positioning(*levels, start, s.seed, mapless=s.mapless)
    if s.mapless or tracks_movers:
        rng = random_stream(s.seed, "lidar") if s.noise > 0 else None
        senses.lidar = SimulatedLidar(_lidar(s), s.driven_world, trajectories, hz, rng)
    if s.moving and not tracks_movers:
        senses.movers = MoverSense(trajectories, perception, hz)
    briefing = Briefing(
        s.robot, start, s.task.goal, s.task.goal_tolerance, hz,
        map=None if s.mapless else unchecked_copy(s.task.world, movers=()),
        sight=senses.lidar.first(start, turning_room(s.robot.radius)) if senses.lidar and s.mapless else None,
        matching=localiser.matched,
        movers=len(trajectories),
        motions=trajectories.positions if perception.kind == "motions" else None,
    )  # fmt: skip
    return (senses, localiser), *navigator(s, briefing)


def navigator(s: Scenario, briefing: Briefing) -> tuple[OneRoute | Exploration, Driver]:
    """Create the guide and the mind of a robot from a scenario's settings."""
    perception, avoidance, hz = perception_of(s), avoidance_of(s), s.control_hz
    tracks_movers, mapless, moving = perception.kind == "lidar", s.mapless, s.moving
    survey = _survey(s, briefing, tracks_movers) if mapless else None
    scans = survey or (_mover_detector(s) if tracks_movers else None)
    tracking = scans.tracking if scans else None
    movers = PerceivedMovers(perception, briefing.movers, briefing.motions)
    if tracking:
        movers = Tracked(tracking, perception)
    # A scan may be one scan period old, and commands are delayed.
    reaction = 1 / hz + (1 / _lidar(s).rate if scans else 0.0) + s.robot.noise.scaled(s.noise).delay
    rules: list[Rule] = [_follow(s, briefing, movers)]
    guide: OneRoute | Exploration
    if survey:
        guide = exploration = _exploration(s, survey, movers)
        rules.append(TurnToScan(s.robot, hz))
    else:
        guide = _guide(s, movers, moving)
    if s.timed:
        rules.append(KeepToSchedule(s.robot, hz))
    if moving and avoidance is not None and not capabilities_of_controller(s.controller).avoids_movers:
        if not mapless and tracking:  # without a map, the stopping constraint keeps the robot to ground that it sees
            rules.append(SlowAtCorners(tracking, s.robot, hz, reaction))
        drifts = mapless and tracks_movers
        avoid = Avoid(
            avoidance, movers, s.task, s.robot, hz,
            goal_share=DRIFTING_SHARE if drifts else GOAL_SHARE,
            backwards=BLIND_SHARE * s.robot.max_speed if drifts and not _lidar(s).full_circle else math.inf,
            delay=s.robot.noise.scaled(s.noise).delay,
            losses=clearances_off_route(s.robot, s.pursuit, s.noise),
            habits=Habits(movers, hz) if movers.uncertain else None,
        )  # fmt: skip
        rules.append(avoid)
    if survey:
        rules.append(StoppingConstraint(survey, s.robot, hz, reaction, exploration.recovery.note_command))
    return guide, Driver(briefing, guide, rules, scans, movers if moving or tracking else None)


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


def _follow(s: Scenario, briefing: Briefing, movers: PerceivedMovers) -> Rule:
    """Return the rule that follows the path: pure pursuit, or another controller on what it is given."""
    if type(s.controller) is PurePursuit:
        return Pursuit(s.controller, full_turn(s.robot, s.control_hz))
    return ByController(Following(s.controller, s.controller_label, briefing), movers)


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


def _guide(s: Scenario, movers: PerceivedMovers, moving: bool) -> OneRoute:
    """Create the guide of a robot with a map."""
    policy, avoidance = s.replanning, avoidance_of(s)
    if policy is None or not moving:
        return OneRoute(route_planner(s))
    kind = CellByCell if s.cell_by_cell else Replanning
    return kind(route_planner(s), policy, movers, s.robot.radius + avoidance.min_clearance if avoidance else 0.0)


def _exploration(s: Scenario, survey: Survey, movers: PerceivedMovers) -> Exploration:
    """Create the guide of a mapless robot; it plans around tracked movers if the policy says so."""
    policy, ahead = s.replanning, None
    assert policy is not None  # `Scenario` checks that a mapless robot replans
    if isinstance(movers, Tracked) and policy.around_movers:
        ahead = MoversSeenAhead(movers, survey, policy, s.robot, s.task.goal, s.inflate)
    return Exploration(route_planner(s), survey, policy, ahead)


def _survey(s: Scenario, known: Briefing, tracks_movers: bool) -> Survey:
    """Create the mapping of a mapless robot."""
    tracking = MoverTracking(_lidar(s), s.control_hz) if tracks_movers else None
    matching = known.matching and (tracks_movers or not known.movers)  # those without tracks would shift the match
    return Survey(known.robot, known.start, known.goal, known.hz, known.sight, matching=matching, tracking=tracking)


def _mover_detector(s: Scenario) -> MoverDetector:
    """Create the detection of movers and unknown obstacles for a robot with a map."""
    noise, lidar = s.robot.noise.scaled(s.noise), _lidar(s)
    errors = (noise.pose_xy, noise.pose_yaw) if s.localisation == "fixes" else (0.0, 0.0)
    ground = KnownGround(lidar, s.task.world, *errors)
    return MoverDetector(ground, MoverTracking(lidar, s.control_hz, *errors))


def _lidar(s: Scenario) -> Lidar:
    assert s.robot.lidar is not None  # `Scenario` checks that the robot has a lidar
    return s.robot.lidar
