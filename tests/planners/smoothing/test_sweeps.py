"""Routes for footprints: sampled poses along each, and their distances from obstacles by loops that share no code."""

import math

import numpy as np
import pytest

from antdrive.planners import AStar, PlanResult, PlanStatus, Query
from antdrive.planners.smoothing.sweeps import smooth_lines
from antdrive.worlds import Disc, Task, World, rasterise
from antdrive.worlds.headings import Outline

KINDS = ("none", "taut", "clearance")
OUTLINES = {
    "jackal": [(0.25, 0.21), (-0.25, 0.21), (-0.25, -0.21), (0.25, -0.21)],
    "long": [(0.5, 0.2), (-0.3, 0.2), (-0.3, -0.2), (0.5, -0.2)],
    "nose": [(0.6, 0.0), (0.2, 0.25), (-0.3, 0.25), (-0.3, -0.25), (0.2, -0.25)],
    "tail": [(0.15, 0.2), (-0.6, 0.05), (-0.6, -0.05), (0.15, -0.2)],
}
SIDE = 5.0  # of the worlds [m]


def poses_of(route, start):
    """Poses (M, 3) every 1 cm and 1 degree of a robot that follows a route, and the straight of each (M,)."""
    x, y, yaw = start
    assert math.dist(route.xy[0], (x, y)) < 2e-6
    poses, parts, arc = [], [], 0.0
    for k, (a, b) in enumerate(zip(route.xy[:-1], route.xy[1:], strict=True)):
        yaws = yaw + np.linspace(0, route.turns[k], 2 + math.ceil(abs(math.degrees(route.turns[k]))))
        poses += [(*a, one) for one in yaws]
        yaw += route.turns[k]
        back = math.pi if arc < route.backwards_until else 0.0
        along = math.atan2(*(b - a)[::-1]) + back
        assert abs(math.remainder(yaw - along, 2 * math.pi)) < 1e-6
        length = math.dist(a, b)
        poses += [(*(a + (b - a) * t), yaw) for t in np.linspace(0, 1, 2 + math.ceil(length / 0.01))]
        parts += [k] * (len(poses) - len(parts))
        arc += length
    assert route.turns[-1] == 0.0
    return np.array(poses), np.array(parts)


def rooms_of(poses, corners, world):
    """Distances (M,) of a convex polygon from discs and walls, negative where they overlap."""
    corners = np.array(corners)
    cos, sin = np.cos(poses[:, 2])[:, None], np.sin(poses[:, 2])[:, None]
    x = poses[:, :1] + cos * corners[:, 0] - sin * corners[:, 1]
    y = poses[:, 1:2] + sin * corners[:, 0] + cos * corners[:, 1]
    xmin, ymin, xmax, ymax = world.bounds
    room = np.min([x - xmin, xmax - x, y - ymin, ymax - y], axis=(0, 2))
    for disc in world.obstacles:
        away, inside = np.full(len(poses), np.inf), np.ones(len(poses), dtype=bool)
        for k in range(len(corners)):
            ax, ay, bx, by = x[:, k], y[:, k], x[:, k - 1], y[:, k - 1]
            ex, ey, dx, dy = bx - ax, by - ay, disc.x - ax, disc.y - ay
            t = np.clip((ex * dx + ey * dy) / (ex * ex + ey * ey), 0, 1)
            away = np.minimum(away, np.hypot(dx - t * ex, dy - t * ey))
            inside &= ex * dy - ey * dx <= 0
        room = np.minimum(room, np.where(inside, -away, away) - disc.radius)
    return room


def drawn(seed):
    """A random task and outline: (task, outline, rounding), the start of which touches nothing."""
    rng = np.random.default_rng(seed)
    name = sorted(OUTLINES)[seed % len(OUTLINES)]
    rounding, margin = float(rng.choice([0.0, 0.05])), float(rng.uniform(0.005, 0.08))
    count = int(rng.integers(10, 40))
    while True:
        discs = [
            Disc(*rng.uniform(0, SIDE, 2).tolist(), float(rng.choice([0.03, 0.08, 0.2]) * rng.uniform(0.8, 1.2)))
            for _ in range(count)
        ]
        world = World("random", (0.0, 0.0, SIDE, SIDE), tuple(discs))
        start = (*rng.uniform(0.3, SIDE - 0.3, 2).tolist(), float(rng.uniform(-3, 3)))
        goal = tuple(rng.uniform(0.3, SIDE - 0.3, 2).tolist())
        if math.dist(start[:2], goal) < 2 or any(math.dist(goal, (d.x, d.y)) <= d.radius for d in discs):
            continue
        if rooms_of(np.array([start]), OUTLINES[name], world)[0] > rounding + 1e-3:
            outline = Outline(np.array(OUTLINES[name]), rounding + margin)
            return Task(world, start, goal, goal_tolerance=0.25, cell=0.1), outline, rounding


def routed(task, outline):
    """The routes of each kind for a shortest path; none if there is no path."""
    radius = max(math.hypot(*corner) for corner in outline.corners) + outline.reach
    grid = rasterise(task.world, task.cell, radius, outline)
    plan = AStar().plan(Query.between(grid, task), np.random.default_rng(0))
    first = grid.xy(plan.cells[:1])[0] if plan.solved else None
    return first, [smooth_lines(plan, grid, task, kind) for kind in KINDS] if plan.solved else []


def faults_of(task, outline, rounding, first, route):
    """What is wrong with a route."""
    poses, parts = poses_of(route, task.start)
    rooms = rooms_of(poses, outline.corners, task.world) - rounding
    margin = outline.reach - rounding
    lead = np.where(parts == 0, True, np.hypot(*(poses[:, :2] - first).T) < 1e-6)
    lead &= np.hypot(*(poses[:, :2] - task.start[:2]).T) <= math.dist(first, task.start[:2]) + 1e-6
    least = np.where(lead, min(margin, rooms[0] - 1e-3), margin)
    if (rooms < least - 1e-6).any():
        worst = int((rooms - least).argmin())
        yield f"{route.kind}: room {rooms[worst]:.6f} of {least[worst]:.6f} at {poses[worst]} on straight {parts[worst]}"
    if math.dist(route.xy[-1], task.goal) > task.goal_tolerance:
        yield f"{route.kind}: ends {math.dist(route.xy[-1], task.goal):.3f} m from the goal"
    if route.length < math.dist(route.xy[0], route.xy[-1]) - 1e-9:
        yield f"{route.kind}: shorter than a straight line"
    if not 0 <= route.backwards_until <= 0.5:
        yield f"{route.kind}: backwards for {route.backwards_until} m"


def surveyed(seeds):
    """The number of routes for some random tasks, and their faults."""
    count, faults = 0, []
    for seed in seeds:
        task, outline, rounding = drawn(seed)
        first, routes = routed(task, outline)
        if not routes:
            continue
        count += len(routes)
        faults += [f"{seed}: {one}" for route in routes for one in faults_of(task, outline, rounding, first, route)]
        if any(route.length > routes[0].length + 1e-9 for route in routes):
            faults.append(f"{seed}: smoothing made the route longer")
    return count, faults


@pytest.mark.parametrize(
    ("seeds", "least"), [(range(40), 60), pytest.param(range(1000, 1250), 350, marks=pytest.mark.slow)]
)
def test_routes_of_footprints_keep_the_margin(seeds, least):
    count, faults = surveyed(seeds)
    assert count >= least
    assert not faults


def pocket():
    """A pocket open behind the robot, too narrow to turn in."""
    sides = [Disc(x, y, 0.05) for x in np.arange(2.0, 3.01, 0.1).tolist() for y in (1.65, 2.35)]
    end = [Disc(3.0, y, 0.05) for y in np.arange(1.65, 2.36, 0.1).tolist()]
    return World("pocket", (0.0, 0.0, 4.0, 4.0), (*sides, *end))


@pytest.mark.parametrize("goal", [(0.6, 2.0), (0.6, 0.6), (3.5, 3.4)])
def test_a_robot_backs_out_of_a_dead_end(goal):
    corners = np.array(OUTLINES["jackal"])
    outline, task = Outline(corners, 0.03), Task(pocket(), (2.05, 2.0, 0.0), goal, cell=0.05)
    first, routes = routed(task, outline)
    assert len(routes) == len(KINDS)
    for route in routes:
        assert 0 < route.backwards_until <= 0.5
        assert not list(faults_of(task, outline, 0.0, first, route))
    assert routes[1].length <= routes[0].length


def test_a_plan_may_go_on_forwards_at_the_heading_of_a_lead_backwards():
    outline, task = Outline(np.array(OUTLINES["jackal"]), 0.03), Task(pocket(), (2.075, 2.025, 0.0), (1.925, 2.025))
    grid = rasterise(task.world, 0.05, 0.4, outline)
    row, col = grid.cell_at(1.775, 2.025)
    plan = PlanResult(status=PlanStatus.SOLVED, cells=np.array([(row, col + k) for k in range(4)]), cost=0.15)
    for route in (smooth_lines(plan, grid, task, kind) for kind in KINDS):
        assert route.xy.tolist() == pytest.approx(np.array([(2.075, 2.025), (1.775, 2.025), (1.925, 2.025)]))
        assert route.backwards_until == pytest.approx(0.3)
        assert not list(faults_of(task, outline, 0.0, route.xy[1], route))
