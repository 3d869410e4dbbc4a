"""Why there is no path, with the sizes that matter and what would help."""

from __future__ import annotations

from typing import TYPE_CHECKING

from antdrive.planners import Query
from antdrive.planners.anyangle.passage import MOST_OBSTACLES, widest_passage
from antdrive.planners.anyangle.tangent import shortest
from antdrive.planners.graph.search import reachable
from antdrive.robots.placing import name_of
from antdrive.worlds import Grid, Task, rasterise

if TYPE_CHECKING:
    from antdrive.sim.scenario import Scenario

FINER = (2, 4, 8)  # cells are tried this many times smaller
MOST_CELLS = 2_000_000  # of a grid that is made only to see whether it has a path


def no_path_reason(s: Scenario, grid: Grid, said: str) -> str:
    """What the planner said about a world that it could not cross, for whom, and what would help.

    Args:
        s: the scenario
        grid: the grid that was planned on
        said: the planner's reason
    """
    robot = s.robot
    disc = f"a disc of {s.inflate:.3g} m (radius {robot.radius:.3g} + margin {s.margin:.3g})"
    says = f": {said}" if said else ""
    if reachable(Query.between(grid, s.task)):
        return f"{s.planner_label} found no path for {disc}{says}; astar finds one on these cells of {grid.cell:g} m"
    start = f"no path for {disc} on cells of {grid.cell:g} m{says}"
    if len(s.task.world.obstacles) > MOST_OBSTACLES:
        return start
    if shortest(s.task.world.discs, s.task.world.bounds, s.inflate, s.task.start[:2], s.task.goal) is not None:
        finer = next((grid.cell / k for k in FINER if _has_path(s.task, grid.cell / k, s.inflate)), None)
        return f"{start}; there is one on {f'cells of {finer:g} m' if finer else 'finer cells'}"
    return f"{start}; {_narrowest_place(s)}"


def _narrowest_place(s: Scenario) -> str:
    """How wide a disc passes, where that is decided, and whether a smaller margin would help."""
    task, robot = s.task, s.robot
    passage = widest_passage(task, s.inflate)
    if passage is None:
        return "not even a point gets through"
    x, y = passage.at
    ends = ((task.start[:2], "the start has no more room"), (task.goal, "the goal has no more room"))
    where = " and ".join(name_of(task.world, k) for k in passage.between)
    where = f"between {where}" if where else next(says for end, says in ends if end == passage.at)
    fits = passage.radius - robot.radius
    helps = (
        f"a margin below {fits:.3g} m leaves a way, on cells that are fine enough"
        if fits > 0
        else "this robot does not fit through"
    )
    return (
        f"the widest disc that passes has a radius of {passage.radius:.3g} m, at ({x:.2f}, {y:.2f}), {where}; {helps}"
    )


def _has_path(task: Task, cell: float, inflate: float) -> bool:
    width, height = task.world.size
    return width * height <= MOST_CELLS * cell**2 and reachable(
        Query.between(rasterise(task.world, cell, inflate), task)
    )
