"""Recording: what a scenario and its plan add to the record of a drive."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from antdrive.base.caches import Keyed, cached
from antdrive.planners import AStar, PlanResult, Query, Tangent
from antdrive.sim.compose import avoidance_of, perception_of
from antdrive.sim.driving.route_planner import by_contents, grid_of, outlined_grid_of
from antdrive.sim.log.record import (
    ComponentRecord,
    PerceptionRecord,
    PlanRecord,
    finite_or_none,
    free_radius,
    options_of,
    settings_of,
)
from antdrive.sim.log.streams import random_stream
from antdrive.worlds import Grid, Task
from antdrive.worlds.world import by_geometry

if TYPE_CHECKING:
    from antdrive.robots import RobotSpec
    from antdrive.sim.scenario import Scenario


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


def plan_record(s: Scenario, footprint_margin: float | None, grid: Grid, answer: PlanResult) -> PlanRecord:
    """Return a plan's figures, with the shortest path on its grid and among its discs."""
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
