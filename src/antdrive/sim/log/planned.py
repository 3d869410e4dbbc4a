"""What a log's plan says about itself and about the rows: route, cells, costs, replans, and what was known of movers.

Each check is a function that yields a sentence for every fault. Tolerances are some times what genuine drives show, over
the catalogue's worlds and robots and generated worlds, with every planner.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from antdrive.base.plane import arc_lengths, polyline_length
from antdrive.base.types import Floats
from antdrive.sim.log.record import DECISION
from antdrive.sim.log.rollout import Rollout
from antdrive.worlds.ends import end_reach, longest_line

NEAR = 1.5  # cells between a route's end and a point that has room, at most
JUST_ROOM = 1e-6  # a goal with no more room than the inflation and this may count as one with too little [m]
ROUTE_SLACK = (
    0.012  # smoothed routes keep the inflation, replans are logged rounded to 0.1 mm; the rest is allowance [m]
)
SAME_LENGTH = 1e-6  # lengths that are computed twice agree to this share
AWAY_TIME = 0.5  # a robot is no farther off its route than its radius and what it drives in this time [s]
POINT_SPACING = 0.05  # of the points of a route whose clearance is looked at [m]


def contradictions(rollout: Rollout, end: int) -> Iterator[str]:
    """Every way in which the plan contradicts the world, itself or the rows."""
    if rollout.record.exploring:  # its plans are right for what the robot had seen, in the frame of its odometry
        yield from _check_movers_known(rollout)
        yield from _check_replans(rollout)
        return
    yield from _check_routes(rollout)
    yield from _check_cells(rollout)
    yield from _check_lengths(rollout)
    yield from _check_movers_known(rollout)
    yield from _check_replans(rollout)
    yield from _check_followed(rollout, end)


def _by_cells(rollout: Rollout) -> bool:
    """Whether the planner decided anew at every cell, so that its first route need not reach the goal."""
    return any(replan.trigger == DECISION for replan in rollout.record.replans)


def _check_routes(rollout: Rollout) -> Iterator[str]:
    """Routes must lie in the world, keep off what stands still, and lead from the start to the goal."""
    record, route = rollout.record, rollout.route
    task, near = record.task, NEAR * record.cell
    if len(route) < 2:
        yield f"route: must have two points or more, found {len(route)}"
        return
    if math.dist(route[0], task.start[:2]) > near:
        yield f"route: begins {math.dist(route[0], task.start[:2]):.3g} m from the task's start"
    if not _by_cells(rollout) and math.dist(route[-1], task.goal) > _short_of_goal(rollout):
        yield f"route: ends {math.dist(route[-1], task.goal):.3g} m from the task's goal"
    routes = [("route", route)]
    routes += [(f"record.replans[{i}].route", np.array(r.route)) for i, r in enumerate(record.replans) if r.solved]
    for name, points in routes:
        xmin, ymin, xmax, ymax = record.world.bounds
        if (points < (xmin, ymin)).any() or (points > (xmax, ymax)).any():
            yield f"{name}: leaves the world's bounds"
            continue
        yield from _check_room(rollout, name, points)


def _short_of_goal(rollout: Rollout) -> float:
    """How far from the goal the route may end [m]: a goal with too little room is not reached itself."""
    task, near = rollout.record.task, NEAR * rollout.record.cell
    room = float(_room(rollout, np.array([task.goal]))[0])
    return max(near, task.goal_tolerance) if room < rollout.record.inflate + JUST_ROOM else near


def _check_room(rollout: Rollout, name: str, route: Floats) -> Iterator[str]:
    """A route keeps the inflation from what stands still; on leaving a tight start, only what the start itself has.

    A replan begins wherever the robot is, also beside a mover, and its first leg need not keep more from other obstacles.
    """
    record = rollout.record
    arc = arc_lengths(route)
    along = np.linspace(0.0, arc[-1], min(100_000, 2 + math.ceil(float(arc[-1]) / POINT_SPACING)))
    points = np.stack([np.interp(along, arc, route[:, k]) for k in (0, 1)], axis=1)
    own = min(record.inflate, float(_room(rollout, route[:1])[0])) if name == "route" else -math.inf
    leaving = np.hypot(*(points - route[0]).T) <= end_reach(record.inflate, record.cell)
    needed = np.where(leaving, own, record.inflate)
    room = _room(rollout, points)
    worst = int((room - needed).argmin())
    if not room[worst] >= needed[worst] - ROUTE_SLACK:
        start = f", its start has {own:.3g} m" if leaving[worst] and own < record.inflate else ""
        yield (
            f"{name}: leads {room[worst]:.3g} m past an obstacle; the plan's inflation is {record.inflate:.3g} m{start}"
        )


def _room(rollout: Rollout, points: Floats) -> Floats:
    """The distances of points (N, 2) [m] from what stands still and was known (N,) [m]."""
    world = rollout.record.task.world
    xmin, ymin, xmax, ymax = world.bounds
    room = np.minimum(points - (xmin, ymin), (xmax, ymax) - points).min(axis=1)
    discs = world.discs
    for rows in np.array_split(np.arange(len(points)), 1 + len(points) * len(discs) // 1_000_000):
        some = points[rows]
        gaps = np.hypot(some[:, :1] - discs[:, 0], some[:, 1:] - discs[:, 1]) - discs[:, 2]
        room[rows] = np.minimum(room[rows], gaps.min(axis=1, initial=math.inf))
    return np.asarray(room)


def _check_cells(rollout: Rollout) -> Iterator[str]:
    """Cells must be neighbours on the grid, and lead from near the start to near the goal."""
    record, cells = rollout.record, rollout.cells
    xmin, ymin, xmax, ymax = record.world.bounds
    rows, cols = math.ceil((ymax - ymin) / record.cell) + 1, math.ceil((xmax - xmin) / record.cell) + 1
    if (cells < 0).any() or (cells >= (rows, cols)).any():
        yield f"cells: must lie on the grid of {record.cell:g} m"
        return
    if (np.abs(np.diff(cells, axis=0)) > 1).any():
        yield "cells: must be neighbours on the grid"
    reach = end_reach(record.inflate, record.cell) + SAME_LENGTH
    for lead, does, end in zip(_leads(rollout), ("begin", "end"), ("start", "goal"), strict=True):
        if lead > reach:
            yield f"cells: {does} {lead:.3g} m from the task's {end}"


def _leads(rollout: Rollout) -> tuple[float, float]:
    """The distances of the first cell from the start and of the last from the goal [m]; 0 without cells."""
    record, cells = rollout.record, rollout.cells
    if not len(cells):
        return 0.0, 0.0
    xmin, ymin, _, _ = record.world.bounds
    first, last = (cells[[0, -1], ::-1] + 0.5) * record.cell + (xmin, ymin)
    return math.dist(first, record.task.start[:2]), math.dist(last, record.task.goal)


def _check_lengths(rollout: Rollout) -> Iterator[str]:
    """The plan's length must be that of its cells, and no shorter than what is shortest."""
    plan, cell, task = rollout.record.plan, rollout.record.cell, rollout.record.task
    length = polyline_length(rollout.cells) * cell
    slack = SAME_LENGTH * max(1.0, length)
    if plan.cost_m is None:
        if plan.grid_optimum_m is not None:
            yield f"record.plan.cost_m: must not be null, since the grid has a path of {plan.grid_optimum_m:.6g} m"
    elif abs(plan.cost_m - length) > slack:
        yield f"record.plan.cost_m: {plan.cost_m:.6g} m, but the cells are {length:.6g} m long"
    elif plan.grid_optimum_m is not None and plan.grid_optimum_m > plan.cost_m + slack:
        yield f"record.plan.grid_optimum_m: {plan.grid_optimum_m:.6g} m is longer than the plan's {plan.cost_m:.6g} m"
    leads = sum(_leads(rollout))
    straight = math.dist(task.start[:2], task.goal) - max(leads, 2 * NEAR * cell)
    for key in ("length_m", "euclidean_optimum_m", "grid_optimum_m"):
        value = getattr(plan, key)
        if value is not None and not _by_cells(rollout) and value < straight:
            yield f"record.plan.{key}: {value:.6g} m, but start and goal are farther apart"
    if plan.cost_m is not None and plan.length_m > longest_line(plan.cost_m, leads, cell) + slack:
        yield f"record.plan.length_m: {plan.length_m:.6g} m, but the cells are {plan.cost_m:.6g} m long"


def _check_movers_known(rollout: Rollout) -> Iterator[str]:
    """What was known of movers, and how they were avoided, is recorded where there are movers, and nowhere else."""
    record = rollout.record
    watching = record.perception is not None and record.perception.kind == "lidar"
    moving = bool(record.world.movers) or watching
    if (record.perception is not None) != moving:
        yield f"record.perception: must {'not ' if moving else ''}be null {'among' if moving else 'without'} movers"
    if len(rollout.tracks) and not watching:
        yield "tracks: must be empty, since the robot did not look for movers with its lidar"
    if len(rollout.scans) and not (watching or record.exploring):
        yield "scans: must be empty, since the robot did not use its lidar"
    if watching and len(rollout.tracks) and not (rollout.tracks[:, 6] > 0).all():
        yield "tracks: radii must be greater than 0"
    for key in ("avoidance", "replanning"):
        if getattr(record, key) is not None and not moving and not (key == "replanning" and record.exploring):
            yield f"record.{key}: must be null without movers"


def _check_replans(rollout: Rollout) -> Iterator[str]:
    """Replans must happen during the drive, where the robot is, and with a policy for them."""
    record, near = rollout.record, NEAR * rollout.record.cell
    if record.replans and record.replanning is None:
        yield "record.replans: must be empty, since record.replanning is null"
    seen = rollout.estimate if len(rollout.estimate) else rollout.pose
    for i, replan in enumerate(record.replans):
        if replan.t > rollout.t[-1] + 1 / record.control_hz:
            yield f"record.replans[{i}].t: {replan.t:g} s is after the end of the drive, {rollout.t[-1]:g} s"
        elif replan.solved:
            here = seen[min(len(seen) - 1, round(replan.t * record.physics_hz)), :2]
            late = record.robot.noise.delay * record.noise * record.robot.max_speed
            if math.dist(replan.route[0], here) > near + late:
                away = math.dist(replan.route[0], here)
                yield f"record.replans[{i}].route: begins {away:.3g} m from the robot"


def _check_followed(rollout: Rollout, end: int) -> Iterator[str]:
    """In a world without movers, the robot must stay near its route."""
    record = rollout.record
    if record.world.movers or len(rollout.route) < 2:
        return
    every = max(1, record.physics_hz // 20)
    places = rollout.pose[:end:every, :2]
    best = np.full(len(places), np.inf)
    for a, b in zip(rollout.route[:-1], rollout.route[1:], strict=True):
        along = b - a
        share = np.clip((places - a) @ along / max(float(along @ along), 1e-300), 0.0, 1.0)
        best = np.minimum(best, np.hypot(*(a + share[:, None] * along - places).T))
    most = record.robot.radius + AWAY_TIME * record.robot.max_speed + NEAR * record.cell
    if not best.max() <= most:
        t = float(rollout.t[int(best.argmax()) * every])
        yield f"route: the robot is {best.max():.3g} m off it at t = {t:.3f} s"
