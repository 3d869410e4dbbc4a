"""Reasons for missing paths, with the decisive sizes and remedies."""

from __future__ import annotations

from typing import TYPE_CHECKING

from antdrive.base.plane import format_position
from antdrive.planners import Query, capabilities_of
from antdrive.planners.graph.search import reachable
from antdrive.robots.clearance import obstacle_name
from antdrive.robots.default_margin import LEAST
from antdrive.worlds import Grid, Task, rasterise
from antdrive.worlds.passage import feasible, widest_passage

if TYPE_CHECKING:
    from antdrive.robots import RobotSpec
    from antdrive.sim.driving.routes import RoutePlanner

FINER = (2, 4, 8)  # cells are tried this many times smaller
MOST_CELLS = 2_000_000  # largest grid built only to test for a path


def no_path_reason(s: RoutePlanner, grid: Grid, said: str) -> str:
    """Explain why a planner found no path: its reason, the disc that does not fit, and a remedy."""
    robot = s.robot
    disc = f"a disc of {s.inflate:.3g} m (radius {robot.radius:.3g} + margin {s.margin:.3g})"
    if grid.turns:
        disc = f"{_shape(robot)} with a margin of {grid.turns.outline.reach - robot.footprint.rounding:.3g} m"
    if reachable(Query.between(grid, s.task)):
        says = f": {said}" if said else ""
        finds = "" if s.motions else f"; astar finds one on these cells of {grid.cell:g} m"  # astar ignores motions
        return f"{s.planner_label} found no path for {disc}{says}{finds}"
    start = f"no path for {disc} on cells of {grid.cell:g} m"
    if s.turns and not grid.turns:
        start += f", nor for {_shape(robot)}"
    if feasible(s.task, s.inflate):
        if grid.turns:
            return start
        finer = next((grid.cell / k for k in FINER if _has_path(s.task, grid.cell / k, s.inflate)), None)
        return f"{start}; there is one on {f'cells of {finer:g} m' if finer else 'finer cells'}"
    return f"{start}; {_narrowest_place(s)}"


def _narrowest_place(s: RoutePlanner) -> str:
    """Describe the widest passable disc, its bottleneck, and whether a smaller margin would help."""
    task = s.task
    passage = widest_passage(task)
    if passage is None:
        return "not even a point gets through"
    at = format_position(task.frame, *passage.at)
    ends = ((task.start[:2], "the start has no more room"), (task.goal, "the goal has no more room"))
    where = " and ".join(obstacle_name(task.world, k) for k in passage.between)
    where = f"between {where}" if where else next(says for end, says in ends if end == passage.at)
    return (
        f"the widest disc that passes has a radius of {passage.radius:.3g} m, at {at}, {where}; "
        f"{_what_it_takes(s, passage.radius)}"
    )


def _what_it_takes(s: RoutePlanner, passes: float) -> str:
    """Describe the room that the robot needs where only discs of radius `passes` [m] fit, and a remedy."""
    robot, foot = s.robot, s.robot.footprint
    spare = passes - robot.radius
    helps = f"a margin below {spare:.3g} m leaves a way on fine cells" if spare > 0 else ""
    if helps and LEAST < s.usual_margin <= s.margin:
        helps += ", but noise may then cause contacts; --margin auto measures its effect"
    if foot.is_disc:
        return helps or "this robot does not fit through"
    _, ymin, _, ymax = foot.bounds
    width, gap = ymax - ymin + 2 * s.margin, 2 * passes
    fits = f"of the {gap:.3g} m straight ahead" if width <= gap else f"straight ahead, more than the {gap:.3g} m there"
    needs = f"{_shape(robot)} needs {width:.3g} m {fits}"
    if s.turns and width <= gap:
        needs += "; between cells, by straight moves and turns on the spot, it does not get through"
    if not s.turns:
        able = capabilities_of(s.planner).turns
        others = "" if able or width > gap else "; astar plans for the footprint"
        needs = f"plans use the disc of {robot.name}; {needs}{others}"
    return f"{needs}{'; ' * bool(helps)}{helps}"


def _shape(robot: RobotSpec) -> str:
    """Return the name and size of a robot's footprint."""
    xmin, ymin, xmax, ymax = robot.footprint.bounds
    return f"its {'rectangle' if robot.footprint.box else 'outline'} of {xmax - xmin:.3g} x {ymax - ymin:.3g} m"


def _has_path(task: Task, cell: float, inflate: float) -> bool:
    width, height = task.world.size
    return width * height <= MOST_CELLS * cell**2 and reachable(
        Query.between(rasterise(task.world, cell, inflate), task)
    )
