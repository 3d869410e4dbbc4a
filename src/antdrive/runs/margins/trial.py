"""One drive of a calibration: how much of the margin it uses up on a random course."""

from __future__ import annotations

import dataclasses
import hashlib
import json
import math
from dataclasses import dataclass
from importlib import metadata
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from antdrive.base import Floats
from antdrive.base.errors import FieldError
from antdrive.base.kernel_cache import sources_stamp
from antdrive.base.plane import segment_lengths, wrap_angle
from antdrive.planners import PLANNERS, SMOOTHINGS, Query, smooth
from antdrive.robots import PurePursuit, RobotSpec
from antdrive.runs.margins.courses import course
from antdrive.sim.driving.following import follow
from antdrive.sim.driving.localising import localiser_of
from antdrive.sim.driving.plants import Drive
from antdrive.sim.log.outcome import Outcome
from antdrive.sim.log.streams import random_stream
from antdrive.sim.physics.engine import Engine
from antdrive.worlds import point_clearance, rasterise

if TYPE_CHECKING:
    from antdrive.sim.scenario import Scenario

METHOD = 3  # to be counted up when courses, statistic or search change, so that older results are not used


class Loss(NamedTuple):
    """How much of the margin a drive used up."""

    footprint: float  # by the robot's footprint [m]
    disc: float  # by the smallest disc around it, for which plans are made; never less than by the footprint [m]


@dataclass(frozen=True, kw_only=True)
class Conditions:
    """What the loss of margin depends on, as far as a calibration takes it into account."""

    robot: RobotSpec  # drives
    controller: PurePursuit  # follows the route
    noise: float  # the factor on the robot's documented noise
    smoothing: str  # how plans become routes
    physics_hz: int = 240  # physics steps per simulated second
    control_hz: int = 60  # control periods per simulated second

    @classmethod
    def of(cls, scenario: Scenario) -> Conditions:
        """The conditions of a scenario."""
        robot, controller, noise, smoothing, physics_hz, control_hz = scenario.loss_conditions
        return cls(
            robot=robot,
            controller=controller,
            noise=noise,
            smoothing=smoothing,
            physics_hz=physics_hz,
            control_hz=control_hz,
        )

    def __post_init__(self) -> None:
        if self.smoothing not in SMOOTHINGS:
            raise FieldError("smoothing", f"unknown {self.smoothing!r}; choose from {', '.join(SMOOTHINGS)}")

    @property
    def key(self) -> str:
        """The SHA-256 of the conditions, and of the versions of the code that the loss depends on."""
        facts = dataclasses.asdict(self)
        for label in ("name", "source"):
            del facts["robot"][label]
        versions = {name: metadata.version(name) for name in ("antdrive", "pybullet", "numpy")}
        facts |= {"method": METHOD, "versions": versions, "kernels": sources_stamp()}
        return hashlib.sha256(json.dumps(facts, sort_keys=True).encode()).hexdigest()


def loss_on_course(conditions: Conditions, margin: float, seed: int) -> Loss:
    """How much of the margin a drive along a random course uses up; infinite where it does not reach the goal.

    A loss is the margin minus the least distance from an obstacle that a certificate would prove. It exceeds the margin where
    the drive could not be certified. That of the footprint is negative where the footprint always was farther from
    obstacles than the disc that the plan was made for.
    """
    c, robot = conditions, conditions.robot
    task = course(robot, robot.radius + margin, random_stream(seed, "course"))
    grid = rasterise(task.world, task.cell, robot.radius + margin)
    answer = PLANNERS["astar"].plan(Query.between(grid, task), random_stream(seed, "planner"))
    route = smooth(answer, grid, task, kind=c.smoothing)
    period, limit = 1 / c.control_hz, 30.0 + 10.0 * route.length / robot.max_speed
    path = c.controller.prepare(route, task.world, robot, margin, period, task.goal_tolerance)
    localiser = localiser_of("fixes", robot, c.noise, 1.0, period, task.start, seed)
    with Engine(task.world, robot, physics_hz=c.physics_hz) as engine:
        log = follow(engine, c.controller, path, task, limit=limit, control_hz=c.control_hz, localiser=localiser)
    if log.outcome is not Outcome.SUCCEEDED:
        return Loss(math.inf, math.inf)
    disc = point_clearance(task.world, log.pose[:, :2]) - robot.radius
    return Loss(*(margin - least_bound(log, robot.radius, clearance) for clearance in (log.clearance, disc)))


def least_bound(log: Drive, radius: float, clearance: Floats) -> float:
    """The clearance from standing obstacles that is certain at and between all rows of a drive [m]."""
    dt, speed = np.diff(log.t), np.abs(log.twist)
    speed = np.maximum(speed[:-1], speed[1:])
    turned = np.abs(wrap_angle(np.diff(log.pose[:, 2])))
    travel = np.maximum(segment_lengths(log.pose[:, :2]), speed[:, 0] * dt)
    travel += radius * np.maximum(turned, speed[:, 1] * dt)
    between = (clearance[:-1] + clearance[1:] - travel) / 2
    return float(between.min(initial=clearance.min()))
