"""Plans of footprints by other libraries in BARN's worlds: `python -m benchmarks.footprint_peers [--worlds N]`.

Needs the extra `peers`. OMPL plans in SE(2) and with Reeds-Shepp curves; its validity checker is one compiled call from Python
at each sample. `fastsim-navigation` is a hybrid A* on the cells that discs overlap. All keep the same margin and reach the goal
within the task's tolerance. Answers are judged at poses every 2 mm by exact distances. Prints Markdown.
"""

from __future__ import annotations

import itertools
import math
import statistics
import time
from collections.abc import Callable, Iterator
from typing import Any, NamedTuple

import numpy as np

from antdrive.base import Floats
from antdrive.planners import Query, load_planner
from antdrive.planners.smoothing.sweeps import smooth_lines
from antdrive.robots import RobotSpec, load_robot
from antdrive.robots.clearance import footprint_clearance, outline_of
from antdrive.worlds import Task, rasterise
from antdrive.worlds._kernels import polygon_distance, polygon_wall_distance
from benchmarks.drives import barn_tasks
from benchmarks.markdown import command_line, missing, print_table
from tools.shared_data import BARN

try:
    import fastsim_navigation as fastsim
    import numba
    from ompl import base as ob
    from ompl import geometric as og
    from ompl import util as ou
except ImportError as error:
    missing(f"{error}: the extra `peers` brings what is measured against")

SMALLEST = ("--worlds 1",)
ROBOTS = ("husky", "warehouse")
MARGIN, CELL = 0.03, 0.05  # [m]
COARSE = 0.1  # cells of the hybrid A*, which on 5 cm finds hardly any path within 4 s [m]
STEP = 0.002  # between judged poses [m]
RADIUS = 0.3  # of Reeds-Shepp curves and of the hybrid A* [m]


class Answer(NamedTuple):
    """The answer to one task."""

    poses: Floats  # (N, 3), none without a path
    seconds: float
    checks: int = 0  # calls of a validity checker


Solve = Callable[[RobotSpec, Task, float], Answer]
NONE = np.empty((0, 3))


def antdrive(robot: RobotSpec, task: Task, _: float) -> Answer:
    """Plan with `astar` on labels made anew, and pull the route taut."""
    began = time.perf_counter()
    outline = outline_of(robot.footprint, MARGIN)
    grid = rasterise(task.world, CELL, robot.footprint.radius + MARGIN, outline)
    plan = load_planner("astar").plan(Query.between(grid, task), np.random.default_rng(0))
    if not plan.solved:
        return Answer(NONE, time.perf_counter() - began)
    route = smooth_lines(plan, grid, task, "taut")
    seconds, yaw, poses = time.perf_counter() - began, task.start[2], []
    for (a, b), turn in zip(itertools.pairwise(route.xy.tolist()), route.turns.tolist(), strict=False):
        poses += [(*a, yaw + turn * k / 50) for k in range(51)]
        yaw += turn
        poses += [(*b, yaw)]
    return Answer(np.array(poses), seconds)


@numba.njit(error_model="numpy")
def clear(
    x: float, y: float, yaw: float, corners: Floats, reach: float, outer: float, discs: Floats, walls: Floats
) -> bool:
    """Return whether an outline at a pose touches nothing."""
    cos, sin = math.cos(yaw), math.sin(yaw)
    if polygon_wall_distance(x, y, cos, sin, corners, walls) <= reach:
        return False
    for j in range(len(discs)):
        dx, dy, size = discs[j, 0] - x, discs[j, 1] - y, discs[j, 2] + reach
        near = dx * dx + dy * dy < (outer + size) ** 2
        if near and polygon_distance(cos * dx + sin * dy, cos * dy - sin * dx, corners) <= size:
            return False
    return True


def ompl(robot: RobotSpec, task: Task, limit: float, space: Any, algorithm: Any) -> Answer:
    """Plan with OMPL, and simplify the path in the time that is left."""
    outline, discs, walls = outline_of(robot.footprint, MARGIN), task.world.discs, np.array(task.world.bounds)
    corners, reach = np.ascontiguousarray(outline.corners), outline.reach
    outer, calls = robot.footprint.radius, 0
    clear(*task.start, corners, reach, outer, discs, walls)

    def valid(state: Any) -> bool:
        nonlocal calls
        calls += 1
        return clear(state.getX(), state.getY(), state.getYaw(), corners, reach, outer, discs, walls)

    began = time.perf_counter()
    box = ob.RealVectorBounds(2)
    for k in range(2):
        box.setLow(k, float(walls[k]))
        box.setHigh(k, float(walls[k + 2]))
    space.setBounds(box)
    setup = og.SimpleSetup(space)
    setup.setStateValidityChecker(valid)
    information = setup.getSpaceInformation()
    information.setStateValidityCheckingResolution(CELL / space.getMaximumExtent())
    ends = [space.allocState() for _ in range(2)]
    for state, (x, y, yaw) in zip(ends, (task.start, (*task.goal, heading_at_goal(task))), strict=True):
        state.setXY(x, y)
        state.setYaw(yaw)
    setup.setStartAndGoalStates(*ends, task.goal_tolerance)
    setup.setPlanner(algorithm(information))
    solved = bool(setup.solve(limit)) and setup.haveExactSolutionPath()
    left = limit - (time.perf_counter() - began)
    if solved and left > 0.001:
        setup.simplifySolution(left)
    seconds = time.perf_counter() - began
    if not solved:
        return Answer(NONE, seconds, calls)
    made, path = calls, setup.getSolutionPath()
    path.interpolate(max(2, math.ceil(path.length() / STEP)))
    poses = [(s.getX(), s.getY(), s.getYaw()) for s in path.getStates()]
    return Answer(np.array(poses), seconds, made)


def heading_at_goal(task: Task) -> float:
    """Return the direction from the start to the goal [rad]: peers need a heading at the goal."""
    return math.atan2(task.goal[1] - task.start[1], task.goal[0] - task.start[0])


def hybrid(robot: RobotSpec, task: Task, limit: float) -> Answer:
    """Plan with the hybrid A* of `fastsim-navigation`, which may turn on the spot."""
    xmin, ymin, xmax, ymax = task.world.bounds
    shape = math.ceil((ymax - ymin) / COARSE), math.ceil((xmax - xmin) / COARSE)
    y, x = ymin + (np.arange(shape[0])[:, None] + 0.5) * COARSE, xmin + (np.arange(shape[1])[None] + 0.5) * COARSE
    cells = np.zeros(shape, dtype=np.uint8)
    for cx, cy, size in task.world.discs.tolist():
        away = np.hypot(np.maximum(np.abs(x - cx) - COARSE / 2, 0), np.maximum(np.abs(y - cy) - COARSE / 2, 0))
        cells[away < size] = 254
    request, config = fastsim.PlanRequest(), fastsim.PlannerConfig()
    request.start = fastsim.Pose2D(*task.start)
    request.goal = fastsim.Pose2D(*task.goal, heading_at_goal(task))
    corners = np.array(outline_of(robot.footprint, 0.0).corners)
    grown = corners + np.sign(corners) * MARGIN  # the robots are rectangles
    request.footprint = fastsim.PolygonFootprint([fastsim.Point2D(*one) for one in grown.tolist()])
    config.allow_in_place_rotation = True
    config.max_planning_time_seconds = limit
    config.minimum_turning_radius = RADIUS
    config.position_tolerance = task.goal_tolerance
    config.yaw_tolerance = math.pi
    config.path_output_spacing = STEP
    began = time.perf_counter()
    planner = fastsim.HybridAStar(fastsim.Costmap(cells, COARSE, xmin, ymin))
    result = planner.plan(request, config)
    seconds = time.perf_counter() - began
    found = result.status == fastsim.PlannerStatus.SUCCESS
    return Answer(np.array(result.path_array) if found else NONE, seconds, result.diagnostics.collision_checks)


def with_ompl(space: Callable[[], Any], algorithm: Any) -> Solve:
    """Return the function that plans with an algorithm of OMPL in a state space."""
    return lambda robot, task, limit: ompl(robot, task, limit, space(), algorithm)


CONNECT = with_ompl(ob.SE2StateSpace, og.RRTConnect)
STAR = with_ompl(ob.SE2StateSpace, og.RRTstar)
CURVES = with_ompl(lambda: ob.ReedsSheppStateSpace(RADIUS), og.RRTConnect)
SOLVERS: tuple[tuple[str, Solve, float], ...] = (
    ("antdrive `astar`, labels and route", antdrive, 0.0),
    ("OMPL RRT-Connect, SE(2)", CONNECT, 0.02),
    ("OMPL RRT-Connect, SE(2)", CONNECT, 0.1),
    ("OMPL RRT-Connect, SE(2)", CONNECT, 1.0),
    ("OMPL RRT*, SE(2)", STAR, 0.1),
    ("OMPL RRT*, SE(2)", STAR, 1.0),
    ("OMPL RRT-Connect, Reeds-Shepp", CURVES, 0.02),
    ("OMPL RRT-Connect, Reeds-Shepp", CURVES, 0.1),
    ("OMPL RRT-Connect, Reeds-Shepp", CURVES, 1.0),
    ("fastsim-navigation, hybrid A*", hybrid, 2.0),
)


def filled(poses: Floats) -> Floats:
    """Return the poses with those between, every 2 mm and every 0.2 degrees."""
    out = []
    for a, b in itertools.pairwise(poses):
        by = b - a
        by[2] = math.remainder(by[2], 2 * math.pi)
        count = 1 + math.ceil(max(math.hypot(by[0], by[1]) / STEP, abs(by[2]) / 0.0035))
        out.append(a + np.linspace(0, 1, count + 1)[:, None] * by)
    return np.vstack(out)


def rows(worlds: int, source: Any) -> Iterator[list[str]]:
    """Yield the row of each robot and solver."""
    tasks = list(barn_tasks(source, worlds).values())
    ou.setLogLevel(ou.LogLevel.LOG_NONE)
    ou.RNG.setSeed(1)
    for robot in map(load_robot, ROBOTS):
        for name, solve, limit in SOLVERS:
            solve(robot, tasks[0], min(limit, 0.1))
            answers = [solve(robot, task, limit) for task in tasks]
            rooms, lengths = [], []
            for task, answer in zip(tasks, answers, strict=True):
                if len(answer.poses):
                    rooms.append(footprint_clearance(task.world, robot.footprint, filled(answer.poses)).min())
                    lengths.append(float(np.hypot(*np.diff(answer.poses[:, :2], axis=0).T).sum()))
            seconds = [answer.seconds for answer in answers]
            checks = sum(answer.checks for answer in answers)
            yield [
                f"`{robot.name}`",
                name,
                f"{limit:g} s" if limit else "none",
                f"{len(rooms)} of {len(tasks)}",
                f"{sum(room > MARGIN - 1e-6 for room in rooms)}",
                f"{sum(room <= 0 for room in rooms)}",
                f"{1e3 * min(rooms):.1f}" if rooms else "–",
                f"{1e3 * statistics.median(seconds):.0f} / {1e3 * max(seconds):.0f}",
                f"{statistics.median(lengths):.2f}" if lengths else "–",
                f"{checks / sum(seconds):,.0f}" if checks else "–",
            ]


def main() -> None:
    given = command_line(
        __doc__,
        barn=(BARN, "folder or archive of BARN's world_*.world files"),
        worlds=(0, "how many of BARN's worlds; 0: all"),
    )
    heads = "robot | planner | limit | paths | keep the margin | touch | least room [mm] | time [ms] | length [m] | checks/s"
    print_table(heads, rows(given.worlds, given.barn))


if __name__ == "__main__":
    main()
