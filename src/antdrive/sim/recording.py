"""Recording: the rollout of a drive from its arrays, scenario and parts."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from antdrive.base.caches import Keyed, cached
from antdrive.base.version import versions
from antdrive.planners import AStar, PlanResult, Query, Tangent
from antdrive.sim.compose import avoidance_of, perception_of
from antdrive.sim.driving.plants import Drive
from antdrive.sim.driving.routes import by_contents, grid_of, outlined_grid_of
from antdrive.sim.log.contacts import attributed
from antdrive.sim.log.record import (
    ComponentRecord,
    DriveRecord,
    PerceptionRecord,
    PlanRecord,
    SmoothingRecord,
    TimesRecord,
    finite_or_none,
    free_radius,
    options_of,
    settings_of,
)
from antdrive.sim.log.rollout import Rollout
from antdrive.sim.log.streams import random_stream
from antdrive.sim.written import Written
from antdrive.worlds import Grid, Route, Task
from antdrive.worlds.world import by_geometry

if TYPE_CHECKING:
    from antdrive.robots import RobotSpec
    from antdrive.sim.compose import Parts
    from antdrive.sim.scenario import Scenario


def rollout_of(
    s: Scenario, parts: Parts, grid: Grid, answer: PlanResult, route: Route, log: Drive, limit: float, wall: float
) -> Rollout:
    """Assemble the log of a scenario's drive, with its time limit [s] and its wall time [s]."""
    record = DriveRecord(
        **configuration_of(s, grid, answer),
        plan=_plan_record(s, parts.guide.footprint_margin, grid, answer),
        smoothing=SmoothingRecord(asked=s.smoothing, made=route.kind, note=route.note),
        replans=tuple(parts.guide.log),
        limiters=parts.limiters,
        margin_choice=s.chosen.record if s.chosen is not None else None,
        inflate=s.inflate,
        time_limit=limit,
        footprint_margin=parts.guide.footprint_margin,
        outcome=log.outcome,
        reason=log.reason,
        physics=log.physics,
        written=settings_of(Written.of(s).plain()),
        versions=versions(),
        times=TimesRecord(plan_s=answer.wall_s, drive_wall_s=wall, replans_s=tuple(parts.guide.walls)),
    )
    driven = {name: array for name, array in vars(log).items() if isinstance(array, np.ndarray) and name != "actuated"}
    arrays: dict[str, Any] = {**driven, "route": route.xy, "cells": answer.cells}
    for part in parts.logs:
        arrays |= part.logged(log, s.physics_hz // s.control_hz)
    return attributed(Rollout(**arrays, record=record))


def configuration_of(s: Scenario, grid: Grid, answer: PlanResult) -> dict[str, Any]:
    """Return the fields of a scenario's record that a drive does not change, except its time limit and smoothing."""
    perception, avoidance = (perception_of(s), avoidance_of(s)) if s.moving else (None, None)
    replanning = s.replanning if s.moving or s.mapless else None
    return {
        "task": s.task,
        "unseen": s.unseen,
        "seed": s.seed,
        "planner": ComponentRecord(name=s.planner_label, settings=settings_of(answer.options)),
        "robot": s.robot,
        "controller": ComponentRecord(name=s.controller_label, settings=options_of(s.controller)),
        "perception": PerceptionRecord(kind=perception.kind, range_m=finite_or_none(perception.range))
        if perception
        else None,
        "avoidance": settings_of(avoidance) if avoidance else None,
        "replanning": settings_of(replanning) if replanning else None,
        "noise": s.noise,
        "margin": s.planned_margin,
        "sensing": s.sensing,
        "settings": s.other_settings,
        "cell": grid.cell,
        "asked_cell": None if grid.cell == s.planning_cell else s.planning_cell,
        "physics_hz": s.physics_hz,
        "control_hz": s.control_hz,
    }


def _plan_record(s: Scenario, footprint_margin: float | None, grid: Grid, answer: PlanResult) -> PlanRecord:
    grid_optimum, euclidean_optimum = optima_of(s.task, grid.cell, s.robot, s.planned_margin, footprint_margin)
    return PlanRecord(
        cost_m=finite_or_none(answer.cost),
        length_m=answer.line_length,
        grid_optimum_m=grid_optimum,
        euclidean_optimum_m=euclidean_optimum,
        work=answer.work,
        work_unit=answer.work_unit,
    )


def optima_of(
    task: Task, cell: float, robot: RobotSpec, margin: float, footprint_margin: float | None = None
) -> tuple[float | None, float | None]:
    """Return the lengths of the shortest path on a task's grid and among its inflated discs [m]; None without one.

    For a footprint, the second is a lower bound: that of the largest disc within it.

    Args:
        task: the true world, with start and goal
        cell: side of the grid cells [m]
        robot: the robot
        margin: clearance of plans on top of the robot's radius [m]
        footprint_margin: clearance of plans that keep the footprint clear [m]; None for those of the disc
    """
    world = by_geometry(task.world)
    free = grid = by_contents(grid_of(world, cell, free_radius(robot, margin, footprint_margin)), task)
    if footprint_margin is not None:
        grid = by_contents(outlined_grid_of(world, cell, robot.footprint, footprint_margin), task)
    return _on_grid(grid), _among_discs(free)


@cached(64)
def _on_grid(asked: Keyed[tuple[Grid, Task]]) -> float | None:
    """Return the length of the shortest path on the grid [m]; the search is deterministic."""
    return finite_or_none(AStar().untimed(Query.between(*asked.value), random_stream(0, "optimum")).cost)


@cached(64)
def _among_discs(asked: Keyed[tuple[Grid, Task]]) -> float | None:
    """Return the length of the shortest path among the inflated discs [m]; the search is deterministic."""
    return finite_or_none(Tangent().untimed(Query.between(*asked.value), random_stream(0, "optimum")).line_length)
