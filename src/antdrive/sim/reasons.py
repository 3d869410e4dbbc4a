"""Reasons for missing paths, with the decisive sizes and a remedy that planning has confirmed."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from antdrive.base.errors import FieldError
from antdrive.base.plane import format_number, format_position
from antdrive.planners import AStar, Query, is_built_in
from antdrive.planners.graph.search import reachable
from antdrive.planners.plan import within_goal
from antdrive.robots.default_margin import LEAST
from antdrive.worlds import Grid
from antdrive.worlds.passage import Passage, feasible, widest_passage
from antdrive.worlds.route import end_reach
from antdrive.worlds.world import obstacle_name

if TYPE_CHECKING:
    from antdrive.robots import RobotSpec
    from antdrive.sim.driving.route_planner import RoutePlanner

CELLS = (0.5, 0.25, 0.1, 0.05, 0.025, 0.01)  # sides of finer cells to try [m]
MARGINS = (0.5, 0.4, 0.3, 0.2, 0.15, 0.1, 0.08, 0.06, 0.05, 0.04, 0.03, 0.02, 0.01)  # smaller margins to try [m]
MOST_CELLS = 2_000_000  # of the largest grid to try
MOST_WORK = 24_000_000  # cells of all grids to try for remedies
MOST_TRIES = 20  # plans to try for a remedy
OUTLINED, TIMED = 4, 4  # a cell of a footprint's grid, or among known motions, counts as this many
NEAR = 1.0  # longest move of a start or a goal as a remedy [m]
ROUNDING = 1e-6  # [m]

#: Whether a route planner finds a first path that its robot can follow.
FindsPath = Callable[["RoutePlanner"], bool]


class Remedy(NamedTuple):
    """Options that change a run, and the route planner of the changed run."""

    options: str
    routes: RoutePlanner

    def and_(self, option: str, **changes: Any) -> Remedy:
        """Return the remedy with a further option and its changes."""
        return Remedy(f"{self.options} {option}".strip(), dataclasses.replace(self.routes, **changes))


def no_path_reason(s: RoutePlanner, grid: Grid, said: str, finds_path: FindsPath) -> str:
    """Explain why a planner found no path: its reason, the disc that does not fit, and a remedy that works."""
    robot, query = s.robot, Query.between(grid, s.task)
    disc = f"a disc of {s.inflate:.3g} m (radius {robot.radius:.3g} + margin {s.margin:.3g})"
    if grid.turns:
        disc = f"{_shape(robot)} with a margin of {grid.turns.outline.reach - robot.footprint.rounding:.3g} m"
    head = f"no path for {disc} on cells of {grid.cell:g} m"
    if query.blocked_end is None and reachable(query):
        same = _astar(s)
        works = not s.motions and finds_path(same.routes)  # astar ignores motions
        finds = f"; {same.options} finds one on these cells" if works else ""
        return f"{s.planner_label} found {head}{f': {said}' if said else ''}{finds}"
    if s.tries_footprint and not grid.turns:
        fine = f" on cells of {s.outlined_cell:g} m" if s.outlined_cell < grid.cell else ""
        head += f", nor for {_shape(robot)}{fine}"
    reach = end_reach(s.inflate, grid.cell), within_goal(s.task)
    fits = feasible(s.task, s.inflate, reach)
    passage = None if fits else widest_passage(s.task, reach)
    says = [head, query.unreachable if fits else _narrowest_place(s, passage)]
    found = _first_that_works(_remedies(s, grid, query, passage, fits=fits), finds_path)
    if found is not None:
        risk = found.routes.margin < s.margin and LEAST < s.usual_margin <= s.margin
        says += [f"{found.options} finds one{', but noise may then cause contacts' if risk else ''}"]
    return "; ".join(filter(None, says))


def _narrowest_place(s: RoutePlanner, passage: Passage | None) -> str:
    """Describe the widest passable disc, its bottleneck, and the room that the robot needs there."""
    if passage is None:
        return "obstacles close off the goal from the start"
    task = s.task
    where = "between " + " and ".join(obstacle_name(task.world, k) for k in passage.between)
    if not passage.between:
        tolerance = f" within its tolerance of {task.goal_tolerance:g} m" if passage.end == "goal" else ""
        where = f"the roomiest place for the {passage.end}{tolerance}"
    at = format_position(task.frame, *passage.at)
    needs = _needs(s, passage)
    return f"the widest disc that passes has a radius of {passage.radius:.3g} m, at {at}, {where}{'; ' * bool(needs)}{needs}"


def _needs(s: RoutePlanner, passage: Passage) -> str:
    """Describe the room that the robot needs at a bottleneck; empty if a smaller margin could do."""
    robot, foot = s.robot, s.robot.footprint
    if foot.is_disc:
        return "" if passage.radius > robot.radius + ROUNDING else "this robot does not fit through"
    plans = "" if s.tries_footprint else f"plans use the disc of {robot.name}"
    if not passage.between:
        return plans
    _, ymin, _, ymax = foot.bounds
    width, gap = ymax - ymin + 2 * s.margin, 2 * passage.radius
    fits = f"of the {gap:.3g} m straight ahead" if width <= gap else f"straight ahead, more than the {gap:.3g} m there"
    needs = f"{_shape(robot)} needs {width:.3g} m {fits}"
    if s.tries_footprint and width <= gap:
        needs += "; on these cells, by straight moves and turns on the spot, it does not get through"
    return f"{plans}{'; ' * bool(plans)}{needs}"


def _remedies(s: RoutePlanner, grid: Grid, query: Query, passage: Passage | None, *, fits: bool) -> Iterator[Remedy]:
    """Yield changes that could lead to a path, the smallest first.

    Finer cells come first, then the footprint instead of the disc, a smaller margin, and another start or goal nearby.
    """
    same = _same(s)
    if same is None:
        return
    shapes = [same]
    if fits or s.tries_footprint:
        yield from _on_finer_cells(same)
    if not (s.tries_footprint or s.robot.footprint.is_disc):
        shapes.append((same if s.plans_footprints else _astar(s)).and_("--footprint exact", footprint="exact"))
        yield from _on_finer_cells(shapes[-1])
    widest = math.inf if fits else passage.radius if passage else 0.0
    for shape in shapes:
        least = s.robot.footprint.inner_radius if shape.routes.tries_footprint else s.robot.radius
        margins = [m for m in MARGINS if m < s.margin - ROUNDING and least + m < widest - ROUNDING]
        halves = [m for m in margins if m <= margins[0] / 2]
        for margin in dict.fromkeys((*margins[:1], *halves[:1], *margins[-1:])):
            yield from _on_finer_cells(shape.and_(f"--margin {margin:g}", margin=margin, outline_margins=(margin,)))
    yield from _other_ends(s, same, grid, query, passage)


def _on_finer_cells(remedy: Remedy) -> Iterator[Remedy]:
    """Yield a remedy on the run's cells, if it changes anything, and on finer ones."""
    s = remedy.routes
    if remedy.options:
        yield remedy
    for cell in CELLS:
        # Plans for the footprint alone use no larger cells anyway.
        if cell < (s.outlined_cell if s.tries_footprint and s.footprint == "exact" else s.cell) - ROUNDING:
            yield remedy.and_(f"--cell {cell:g}", cell=cell)


def _other_ends(s: RoutePlanner, same: Remedy, grid: Grid, query: Query, passage: Passage | None) -> Iterator[Remedy]:
    """Yield the nearest goal that moves reach, if the goal has too little room; for a disc, also the nearest start."""
    from antdrive.worlds import _kernels_turns

    end = passage.end if passage else ""
    free = {"goal": query.start_node, "start": -1 if grid.turns else query.goal_cell}.get(end, -1)
    if free < 0 or not grid.graph.mask[free]:
        return
    *start, yaw = s.task.start
    exact = start if end == "start" else s.task.goal
    cells = grid.cells_of(_kernels_turns.led_to(grid.graph, free))
    centres = grid.xy(np.column_stack(np.divmod(cells, grid.shape[1])))
    away = np.hypot(*(centres - exact).T)
    if away.min() > NEAR:
        return
    place = centres[away.argmin()].tolist()
    text = ",".join(map(format_number, place if end == "goal" else (*place, yaw)))
    moved: dict[str, Any] = {end: tuple(map(float, text.split(",")))}
    try:
        task = dataclasses.replace(s.task, **moved)
    except FieldError:  # such as a goal at the start
        return
    yield same.and_(f"--{end} {text}", task=task)


def _first_that_works(remedies: Iterator[Remedy], finds_path: FindsPath) -> Remedy | None:
    """Return the first remedy whose plan is a path, of a bounded number and size."""
    tries, left = 0, float(MOST_WORK)
    for remedy in remedies:
        if tries == MOST_TRIES:
            return None
        cells = _cells(remedy.routes)
        if max(cells) <= MOST_CELLS and sum(cells) <= left:  # a later remedy may need fewer
            tries, left = tries + 1, left - sum(cells)
            if finds_path(remedy.routes):
                return remedy
    return None


def _cells(s: RoutePlanner) -> list[float]:
    """Return the cells of each grid of a plan, by what one of them costs."""
    area = math.prod(s.task.world.size)
    outlined = [OUTLINED * area / s.outlined_cell**2] * len(s.outline_margins) if s.tries_footprint else []
    return [(TIMED if s.motions else 1) * area / s.cell**2, *outlined]


def _same(s: RoutePlanner) -> Remedy | None:
    """Return the run's own planner if it is antdrive's and its answer is certain, else A*; None among known motions."""
    if is_built_in(s.planner) and s.can.complete and s.can.deterministic:
        return Remedy("", s)
    return None if s.motions else _astar(s)


def _astar(s: RoutePlanner) -> Remedy:
    """Return A* as a remedy."""
    return Remedy("-p astar", dataclasses.replace(s, planner=AStar(), planner_label="astar", whole=True, motions=()))


def _shape(robot: RobotSpec) -> str:
    """Return the name and size of a robot's footprint."""
    xmin, ymin, xmax, ymax = robot.footprint.bounds
    return f"its {'rectangle' if robot.footprint.box else 'outline'} of {xmax - xmin:.3g} x {ymax - ymin:.3g} m"
