"""Consistency of a log: rows against the record, plan against itself. Limits, commands, noise, outcome, route, replans.

Each check is a function that yields a sentence per error. Tolerances are multiples of what genuine drives show: in
the catalogue's worlds and generated ones, with its robots and every planner, with and without noise. Collided drives
count up to the contact.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Collection, Iterator

import numpy as np
import numpy.typing as npt

from antdrive.base.plane import polyline_length, wrap_angle
from antdrive.base.types import Floats
from antdrive.robots.clearance import footprint_clearance
from antdrive.robots.spec import SAMPLE_RATE, Odometry
from antdrive.sim.log.ending import false_endings
from antdrive.sim.log.metrics import driven_length_m, nearest_on_route, succeeded
from antdrive.sim.log.record import FROM_OUTSIDE, DriveRecord, free_radius
from antdrive.sim.log.rollout import Rollout, estimates_of
from antdrive.sim.policy import Trigger
from antdrive.worlds.route import NEAR, longest_line, short_of_goal

JUST_ROOM = 1e-6  # a goal with at most this much more room than the inflation may count as too narrow [m]
ROUTE_SLACK = 0.012  # smoothed routes keep the inflation; logged replans are rounded to 0.1 mm [m]
SAME_LENGTH = 1e-6  # relative tolerance of lengths that are computed twice
OPTIMA = ("grid_optimum_m", "euclidean_optimum_m")  # in the order of `optima_of`
SAME_OPTIMUM = 1e-9  # relative tolerance of optima
AWAY_TIME = 0.5  # largest deviation from the route: the radius plus the travel in this time [s]
LONGEST_ROUTE = 50_000.0  # [m]
POINT_SPACING = 0.05  # spacing of the route points whose clearance is checked [m]


def contradictions(rollout: Rollout, end: int) -> Iterator[str]:
    """Yield every contradiction of the plan with the world, itself or the rows."""
    if not rollout.record.mapless:  # else plans refer to the occupancy map, in the frame of its odometry
        yield from _check_routes(rollout)
        yield from _check_cells(rollout)
        yield from _check_cost(rollout)
        yield from _check_followed(rollout, end)
    elif len(rollout.cells):
        yield "cells: must be empty without a map"
        rollout = dataclasses.replace(rollout, cells=rollout.cells[:0])
    yield from _check_length(rollout)
    yield from _check_optima(rollout)
    yield from _check_movers_known(rollout)
    yield from _check_replans(rollout)


def _check_routes(rollout: Rollout) -> Iterator[str]:
    """Check that routes lie in the world, avoid static obstacles, and lead from the start to the goal."""
    record, route = rollout.record, rollout.route
    task, near = record.task, NEAR * record.cell
    if math.dist(route[0], task.start[:2]) > near:
        yield f"route: begins {math.dist(route[0], task.start[:2]):.3g} m from the task's start"
    if math.dist(route[-1], task.goal) > _short_of_goal(rollout):
        yield f"route: ends {math.dist(route[-1], task.goal):.3g} m from the task's goal"
    routes = [("route", route)]
    routes += [(f"record.replans[{i}].route", np.array(r.route)) for i, r in enumerate(record.replans) if r.solved]
    for name, points in routes:
        xmin, ymin, xmax, ymax = record.world.bounds
        if (points < (xmin, ymin)).any() or (points > (xmax, ymax)).any():
            yield f"{name}: leaves the world's bounds"
            continue
        if polyline_length(points) > LONGEST_ROUTE:
            yield f"{name}: is {polyline_length(points):.3g} m long; the longest that can be checked has {LONGEST_ROUTE:g} m"
            continue
        yield from _check_room(rollout, name, _spaced(points), ROUTE_SLACK)


def _short_of_goal(rollout: Rollout) -> float:
    """Return how far from the goal the route may end [m].

    It ends short of a goal without room for the disc. For a footprint it ends at its last cell where the straight from there to
    the goal, or the turn to it, is not clear.
    """
    record = rollout.record
    if record.footprint_margin is None and _has_room(rollout, record.inflate):
        return NEAR * record.cell
    return short_of_goal(record.task.goal_tolerance, record.cell)


def _has_room(rollout: Rollout, radius: float) -> bool:
    """Return whether a disc of a radius [m] surely fits at the goal."""
    return float(_room(rollout, np.array([rollout.record.task.goal]))[0]) >= radius + JUST_ROOM


def _check_room(rollout: Rollout, name: str, points: Floats, slack: float) -> Iterator[str]:
    """Check that points (N, 2) along a route keep the inflation, less a slack [m]; near a narrow start, the room of the start.

    A replan begins anywhere, even beside a mover, so its first leg may pass closer to other obstacles, but does not bring the
    robot's inner circle into one. Cells have no lead.
    """
    record = rollout.record
    if record.footprint_margin is None:
        keeps, what, rooms = record.inflate, "inflation", _room(rollout, points)
        begin = rooms[0]
    else:
        keeps, what, rooms = record.footprint_margin, "margin", _room_of_footprint(rollout, points)
        begin = footprint_clearance(record.task.world, record.robot.footprint, record.task.start)[0]
    own = min(keeps, float(begin)) if name == "route" else -math.inf
    leaving = (np.hypot(*(points - points[0]).T) <= record.reach[0]) & (name != "cells")
    if name not in ("route", "cells"):
        centres = _room(rollout, points[leaving])
        if not centres.min() >= min(record.robot.footprint.inner_radius, float(centres[0])) - slack:
            yield f"{name}: leads through an obstacle"
            return
    needed = np.where(leaving, own, keeps)
    worst = int((rooms - needed).argmin())
    if not rooms[worst] >= needed[worst] - slack:
        start = f", its start has {own:.3g} m" if leaving[worst] and own < keeps else ""
        yield f"{name}: leads {rooms[worst]:.3g} m past an obstacle; the plan's {what} is {keeps:.3g} m{start}"


def _spaced(route: Floats) -> Floats:
    """Return points (N, 2) along a route, its corners among them, `POINT_SPACING` apart or closer [m]."""
    steps = np.diff(route, axis=0)
    counts = np.ceil(np.hypot(*steps.T) / POINT_SPACING).astype(np.int64)
    if not counts.any():
        return route[[0, -1]]
    leg = np.repeat(np.arange(len(steps)), counts)
    share = (np.arange(len(leg)) - (np.cumsum(counts) - counts)[leg]) / counts[leg]
    return np.vstack([route[leg] + share[:, None] * steps[leg], route[-1:]])


def _room(rollout: Rollout, points: Floats) -> Floats:
    """Return the distances of points (N, 2) [m] from known static obstacles (N,) [m]."""
    world = rollout.record.task.world
    xmin, ymin, xmax, ymax = world.bounds
    room = np.minimum(points - (xmin, ymin), (xmax, ymax) - points).min(axis=1)
    discs = world.discs
    for rows in np.array_split(np.arange(len(points)), 1 + len(points) * len(discs) // 1_000_000):
        some = points[rows]
        dx, dy = some[:, :1] - discs[:, 0], some[:, 1:] - discs[:, 1]
        gaps = np.sqrt(dx * dx + dy * dy) - discs[:, 2]  # a third of the time of hypot
        room[rows] = np.minimum(room[rows], gaps.min(axis=1, initial=math.inf))
    return np.asarray(room)


def _room_of_footprint(rollout: Rollout, points: Floats) -> Floats:
    """Return the distances of the footprint, facing along points (N, 2) [m], from known static obstacles (N,) [m].

    At corners it may face either way, and at the first points backwards, as a route's begin may be driven.
    """
    record = rollout.record
    steps = np.diff(points, axis=0)
    ahead = np.arctan2(steps[:, 1], steps[:, 0])
    before, after = np.append(ahead[:1], ahead), np.append(ahead, ahead[-1:])
    behind = np.hypot(*(points - points[0]).T) <= record.reach[0]
    rooms = [
        footprint_clearance(record.task.world, record.robot.footprint, np.column_stack([points, yaw]))
        for yaw in (
            before,
            after,
            np.where(behind, after + math.pi, after),
            np.where(behind, record.task.start[2], after),
        )
    ]
    return np.asarray(np.max(rooms, axis=0))


def _check_cells(rollout: Rollout) -> Iterator[str]:
    """Check that cells are neighbours on the grid, free in the record's world, and lead from near the start to near the goal."""
    record, cells = rollout.record, rollout.cells
    xmin, ymin, xmax, ymax = record.world.bounds
    rows, cols = math.ceil((ymax - ymin) / record.cell) + 1, math.ceil((xmax - xmin) / record.cell) + 1
    if (cells < 0).any() or (cells >= (rows, cols)).any():
        yield f"cells: must lie on the grid of {record.cell:g} m"
        return
    if (np.abs(np.diff(cells, axis=0)) > 1).any():
        yield "cells: must be neighbours on the grid"
    elif record.plan.cost_m is not None:  # else they are those under a line
        moves = (np.diff(cells, axis=0) != 0).any(axis=1)  # plans in time may wait
        if moves.any():
            some = _centres(rollout, np.concatenate([cells[:1], cells[1:][moves]]))
            each = math.ceil(math.sqrt(2) * record.cell / POINT_SPACING)
            along = np.linspace(0.0, len(some) - 1, (len(some) - 1) * each + 1)
            points = np.stack([np.interp(along, np.arange(len(some)), some[:, k]) for k in (0, 1)], axis=1)
            yield from _check_room(rollout, "cells", points, SAME_LENGTH)
    ends = zip(_leads(rollout), record.reach, ("begin", "end"), ("start", "goal"), strict=True)
    for lead, reach, does, end in ends:
        if lead > reach + SAME_LENGTH:
            yield f"cells: {does} {lead:.3g} m from the task's {end}"


def _leads(rollout: Rollout) -> tuple[float, float]:
    """Return the distances of the first cell from the start and of the last from the goal [m]; the largest without cells."""
    if not len(rollout.cells):
        return rollout.record.reach
    task, (first, last) = rollout.record.task, _centres(rollout, rollout.cells[[0, -1]])
    return math.dist(first, task.start[:2]), math.dist(last, task.goal)


def _centres(rollout: Rollout, cells: npt.NDArray[np.int32]) -> Floats:
    """Return the centres (N, 2) of cells (N, 2) of the plan's grid [m]."""
    record = rollout.record
    return np.asarray((cells[:, ::-1] + 0.5) * record.cell + record.world.bounds[:2])


def _check_cost(rollout: Rollout) -> Iterator[str]:
    """Check that the plan's cost is the length of its cells."""
    plan, length = rollout.record.plan, polyline_length(rollout.cells) * rollout.record.cell
    if plan.cost_m is None:
        if plan.grid_optimum_m is not None:
            yield f"record.plan.cost_m: must not be null, since the grid has a path of {plan.grid_optimum_m:.6g} m"
    elif abs(plan.cost_m - length) > SAME_LENGTH * max(1.0, length):
        yield f"record.plan.cost_m: {plan.cost_m:.6g} m, but the cells are {length:.6g} m long"


def _check_length(rollout: Rollout) -> Iterator[str]:
    """Check that the plan's length is that of its cells, or of a line no longer than they allow and no shorter than any path."""
    record, plan, leads = rollout.record, rollout.record.plan, sum(_leads(rollout))
    slack = SAME_LENGTH * max(1.0, plan.length_m)
    drawn = not record.mapless and (plan.cost_m is None or abs(plan.length_m - plan.cost_m) > slack)
    if plan.length_m < _straight(rollout) - leads - slack:
        yield f"record.plan.length_m: {plan.length_m:.6g} m, but start and goal are farther apart"
    elif drawn and plan.length_m < (plan.euclidean_optimum_m or 0.0) - leads - slack:
        yield from _shorter_than_any(record, leads + slack)
    if plan.cost_m is not None and plan.length_m > longest_line(plan.cost_m, leads, record.cell) + slack:
        yield f"record.plan.length_m: {plan.length_m:.6g} m, but the cells are {plan.cost_m:.6g} m long"


def _shorter_than_any(record: DriveRecord, short: float) -> Iterator[str]:
    """Yield whether the plan's line is shorter than any path, by more than a length [m].

    Contact closes a gap to the shortest path, but not to a line, so the search is for slightly less margin.
    """
    less = dataclasses.replace(record, margin=max(0.0, record.margin - 2 * JUST_ROOM), margin_choice=None)
    try:
        shortest = _optima(less)[1]
    except ValueError as error:  # the grid has too many cells
        yield f"record.{error}"
        return
    if shortest is not None and record.plan.length_m < shortest - short:
        yield f"record.plan.length_m: {record.plan.length_m:.6g} m, but the shortest path in its world has {shortest:.6g} m"


def _straight(rollout: Rollout) -> float:
    """Return the distance of the goal from the start [m]."""
    return math.dist(rollout.record.task.start[:2], rollout.record.task.goal)


def _check_optima(rollout: Rollout) -> Iterator[str]:
    """Check that the shortest paths are no shorter than the straight line and no longer than the paths in the log.

    The cells are a path on the grid. Another path in the log may pass where those of the optimum do not: a plan on the occupancy
    map with less margin, a gap that contact closes, a robot that left its route. A search in the record's world then decides,
    as it does without a path in the log, or if the optimum is null.
    """
    record, plan, straight = rollout.record, rollout.record.plan, _straight(rollout)
    leads, slack = sum(_leads(rollout)), SAME_LENGTH * max(1.0, straight)
    narrow = not _has_room(rollout, free_radius(record.robot, record.margin, record.footprint_margin))
    paths = [driven_length_m(rollout) + record.task.goal_tolerance] if succeeded(rollout) else []
    cells, on_grid = plan.length_m if plan.cost_m is None else plan.cost_m, paths
    if not record.mapless:
        route = polyline_length(rollout.route) + math.dist(rollout.route[-1], record.task.goal)
        on_grid, paths = [cells], [*paths, cells + leads, route]
    doubted = []
    for key, short, longest in zip(OPTIMA, (leads, record.task.goal_tolerance * narrow), (on_grid, paths), strict=True):
        value = getattr(plan, key)
        if value is not None and value < straight - short - slack:
            yield f"record.plan.{key}: {value:.6g} m, but start and goal are farther apart"
        elif value is not None and value <= min(longest, default=0.0) + slack:
            continue
        elif value is not None and longest is on_grid and not record.mapless and plan.cost_m is not None:
            yield f"record.plan.{key}: {value:.6g} m, but the cells are {plan.cost_m:.6g} m long"
        else:
            doubted.append(key)
    if doubted:
        yield from wrong_optima(record, doubted)


def wrong_optima(record: DriveRecord, keys: Collection[str] = OPTIMA) -> Iterator[str]:
    """Yield the shortest paths in a record, of some keys of its plan, that its world does not have."""
    try:
        computed = _optima(record)
    except ValueError as error:  # the grid has too many cells
        yield f"record.{error}"
        return
    for key, right in zip(OPTIMA, computed, strict=True):
        logged = getattr(record.plan, key)
        if (
            key in keys
            and logged != right
            and not (logged and right and math.isclose(logged, right, rel_tol=SAME_OPTIMUM))
        ):
            yield f"record.plan.{key}: {_length(logged)} in the log, {_length(right)} in its world"


def _optima(record: DriveRecord) -> tuple[float | None, float | None]:
    """Search the shortest paths on the grid and in the plane [m]; None for one that does not exist."""
    from antdrive.sim.recording import optima_of  # imports the compiler

    return optima_of(record.task, record.cell, record.robot, record.margin, record.footprint_margin)


def _length(metres: float | None) -> str:
    return "null" if metres is None else f"{metres:.6g} m"


def _check_movers_known(rollout: Rollout) -> Iterator[str]:
    """Check that perception and avoidance are recorded among movers only."""
    record = rollout.record
    watching = record.perception is not None and record.perception.kind == "lidar"
    moving = bool(record.world.movers) or watching
    if (record.perception is not None) != moving:
        yield f"record.perception: must {'not ' if moving else ''}be null {'among' if moving else 'without'} movers"
    if len(rollout.tracks) and not watching:
        yield "tracks: must be empty, since the lidar did not track movers"
    if len(rollout.scans) and not (watching or record.mapless):
        yield "scans: must be empty, since the robot did not use its lidar"
    if watching and len(rollout.tracks) and not (rollout.tracks[:, 6] > 0).all():
        yield "tracks: radii must be greater than 0"
    for key in ("avoidance", "replanning"):
        if getattr(record, key) is not None and not moving and not (key == "replanning" and record.mapless):
            yield f"record.{key}: must be null without movers"


def _check_replans(rollout: Rollout) -> Iterator[str]:
    """Check that replans happen during the drive, at the robot, and with a policy."""
    record, near = rollout.record, NEAR * rollout.record.cell
    if record.replans and record.replanning is None:
        yield "record.replans: must be empty, since record.replanning is null"
    seen = estimates_of(rollout)
    for i, replan in enumerate(record.replans):
        if replan.t > rollout.t[-1] + 1 / record.control_hz:
            yield f"record.replans[{i}].t: {replan.t:g} s is after the end of the drive, {rollout.t[-1]:g} s"
        elif replan.solved:
            here = seen[min(len(seen) - 1, round(replan.t * record.physics_hz)), :2]
            late = record.robot.noise.delay * record.noise * record.robot.max_speed
            if math.dist(replan.route[0], here) > near + late:
                away = math.dist(replan.route[0], here)
                yield f"record.replans[{i}].route: begins {away:.3g} m from the robot"
            left = math.dist(replan.route[-1], record.task.goal)
            if replan.trigger != Trigger.DECISION and not record.mapless and left > _short_of_goal(rollout):
                yield f"record.replans[{i}].route: ends {left:.3g} m from the task's goal"
        if replan.trigger == Trigger.DECISION and not _decides(record):
            yield f"record.replans[{i}].trigger: {Trigger.DECISION}, but the planner plans whole routes"


def _decides(record: DriveRecord) -> bool:
    """Return whether the planner may decide cell by cell; one of the user's own is believed."""
    from antdrive.sim.log.margin import known_capabilities  # imports the compiler

    can = known_capabilities(record)
    return can is None or can.cell_by_cell


def _check_followed(rollout: Rollout, end: int) -> Iterator[str]:
    """Check that the robot stays near its route in a world without movers, unless it is commanded from outside."""
    record = rollout.record
    if record.world.movers or len(rollout.route) < 2 or record.controller.name == FROM_OUTSIDE:
        return
    every = max(1, record.physics_hz // 20)
    places = rollout.pose[:end:every, :2]
    off = np.hypot(*(nearest_on_route(places, rollout.route) - places).T)
    most = record.robot.radius + AWAY_TIME * record.robot.max_speed + NEAR * record.cell
    if not off.max() <= most:
        t = float(rollout.t[int(off.argmax()) * every])
        yield f"route: the robot is {off.max():.3g} m off it at t = {t:.3f} s"


OVERSHOOT = 0.03  # measured speeds exceed limits and targets by at most this fraction; genuine drives: 0.2 %
MATCHED = 0.075, 0.02  # largest mismatch of a scan: three grains of the map [m], two corrections [rad]
STILL = 0.02  # absolute tolerance, for very slow robots [m/s], [rad/s]
SIGMAS = 8.0  # bound of noise in standard deviations; genuine drives: 4.2
ACCELERATION_WINDOW, HARDER = 0.25, 1.5  # window [s], multiple of the robot's limit; genuine drives: 1.16
SLOWEST_PHYSICS = 60  # at a lower rate robots jerk, and poses do not follow from the speeds [Hz]
EXACT = 1e-6  # relative tolerance of commands at their limits
# Tolerance between the distance that measured speeds give over a window and the one that motor targets give; motors
# lag by a few periods while speeds change. Genuine drives in 0.25 s: 2.1 mm and 0.011 rad.
FOLLOW_WINDOWS = (0.25, 1.0, 4.0)  # [s]
FOLLOW, FOLLOW_TURN, FOLLOW_SHARE = 0.01, 0.05, 0.02  # [m], [rad], fraction of the distance
LATE = 2.0  # largest lag of the motors, in periods of control and of physics
GRIP = 0.8  # wheels with less friction slide


def inconsistencies(rollout: Rollout) -> Iterator[str]:
    """Yield every contradiction between the record and the rows before the first contact."""
    end = max(1, rollout.first_contact)
    yield from _check_record(rollout)
    yield from _check_speeds(rollout, end)
    yield from _check_commands(rollout, end)
    yield from _check_actuated(rollout, end)
    yield from _check_estimate(rollout)
    yield from _check_targets(rollout, end)
    yield from contradictions(rollout, end)
    yield from false_endings(rollout)


def _check_footprint_margin(record: DriveRecord) -> Iterator[str]:
    """Check that plans kept the footprint clear if the settings say so, and by a margin that the settings give."""
    found, exact = record.footprint_margin, (record.settings or {}).get("footprint") == "exact"
    if found is None:
        if exact and not record.robot.footprint.is_disc:
            yield "record.footprint_margin: missing, since the footprint is exact"
        return
    from antdrive.sim.log.margin import footprint_margins  # imports the compiler

    try:
        margins = sorted({max(margin, 0.0) for margin in footprint_margins(record)})
    except (KeyError, TypeError, ValueError):
        yield "record.controller.settings: none that a drive has"
        return
    if not margins:
        yield f"record.footprint_margin: {found:g} m, but planner, robot and settings plan for the disc"
    elif not any(abs(found - margin) <= JUST_ROOM for margin in margins):
        yield f"record.footprint_margin: {found:g} m; margin and settings give {' or '.join(f'{m:g} m' for m in margins)}"


def _check_record(rollout: Rollout) -> Iterator[str]:
    """Check that margin, inflation and rates fit each other."""
    record = rollout.record
    if not abs(record.inflate - record.robot.radius - record.margin) <= EXACT:
        yield (
            f"record.inflate: {record.inflate:g} m is not the robot's radius {record.robot.radius:g} m plus the margin "
            f"{record.margin:g} m"
        )
    yield from _check_footprint_margin(record)
    if record.physics_hz < SLOWEST_PHYSICS:
        yield f"record.physics_hz: must be at least {SLOWEST_PHYSICS} Hz, found {record.physics_hz}"
    if record.physics_hz % record.control_hz:
        yield f"record.control_hz: {record.control_hz} Hz does not divide the physics rate {record.physics_hz} Hz"


def _check_speeds(rollout: Rollout, end: int) -> Iterator[str]:
    """Check that measured speeds and their changes are within the robot's limits, except for slip."""
    record, robot, twist = rollout.record, rollout.record.robot, rollout.twist[:end]
    more = SIGMAS * robot.noise.slip * record.noise
    wheels = wheel_speeds(twist, robot.track)
    # Where the robot brakes and turns at once, the forward speed lags its command by up to a control period.
    late = robot.max_acceleration / record.control_hz / robot.wheel_radius
    limits = (
        ("forward speed", "m/s", np.abs(twist[:, 0]), robot.max_speed),
        ("yaw rate", "rad/s", np.abs(twist[:, 1]), robot.max_yaw_rate + more * robot.max_speed * 2 / robot.track),
        ("wheel speed", "rad/s", np.abs(wheels).max(axis=1) / robot.wheel_radius, robot.max_wheel_speed + late),
    )
    for what, unit, values, limit in limits:
        if not values.max() <= limit * (1 + OVERSHOOT + more) + STILL:
            row = int(values.argmax())
            yield f"twist: {what} of {values[row]:.4g} {unit} at t = {rollout.t[row]:.3f} s; the robot's limit is {limit:.4g}"
    back = max(1, round(ACCELERATION_WINDOW * record.physics_hz))
    if len(twist) > back:
        window = back / record.physics_hz + 1 / record.control_hz  # commands change in steps, period by period
        changes = np.abs(twist[back:] - twist[:-back])
        rim = more * robot.max_speed
        for k, (what, limit, slack) in enumerate(
            (
                ("forward speed", robot.max_acceleration, rim + STILL),
                ("yaw rate", robot.max_yaw_acceleration, 2 * rim / robot.track + 5 * STILL),
            )
        ):
            if not changes[:, k].max() <= HARDER * limit * window + slack:
                row = int(changes[:, k].argmax())
                yield f"twist: the {what} changes faster than the robot can, at t = {rollout.t[row]:.3f} s"


def _check_commands(rollout: Rollout, end: int) -> Iterator[str]:
    """Check that commands are within the robot's limits, constant within control periods, and 0 in row 0."""
    record, robot, command = rollout.record, rollout.record.robot, rollout.command
    limits = np.array([robot.max_speed, robot.max_yaw_rate])
    if not (np.abs(command) <= limits * (1 + EXACT)).all():
        yield f"command: beyond the robot's limits {robot.max_speed:g} m/s and {robot.max_yaw_rate:g} rad/s"
    if command[0].any():
        yield "command: row 0 is before the first command and must be 0"
    period = record.rows_per_period
    for name, values in (("command", command), ("actuated", rollout.actuated)):
        changed = np.flatnonzero(np.diff(values[1:], axis=0).any(axis=1)) + 1
        if (changed % period).any():
            yield f"{name}: changes within a control period, at row {int(changed[(changed % period) > 0][0]) + 1}"
    steps = np.abs(np.diff(np.concatenate([np.zeros((1, 2)), command[1:end:period]]), axis=0))
    most = HARDER * np.array([robot.max_acceleration, robot.max_yaw_acceleration]) / record.control_hz
    # Avoidance, schedules and the stopping constraint slow down on the same arc: the yaw rate falls with the speed at once.
    if record.perception is not None or record.mapless:
        most[1] = np.inf
    if not (steps <= most + EXACT).all():
        row = int((steps > most + EXACT).any(axis=1).argmax()) * period + 1
        yield f"command: changes faster than the robot's limits allow, at row {row}"


def _check_actuated(rollout: Rollout, end: int) -> Iterator[str]:
    """Check that motor targets are the delayed commands, except for wheel slip."""
    record, robot = rollout.record, rollout.record.robot
    noise = robot.noise.scaled(record.noise)
    rows = len(rollout.t)
    for name in ("estimate", "actuated"):
        if (len(getattr(rollout, name)) == rows) != (noise.nonzero or record.localisation in ("odometry", "matching")):
            yield f"{name}: must have {rows if noise.nonzero else 0} rows at a noise of {record.noise:g}"
            return
    if not len(rollout.actuated):
        return
    period = record.rows_per_period
    late = round(noise.delay * record.control_hz) * period
    delayed = np.concatenate([np.zeros((min(late, rows), 2)), rollout.command[: max(0, rows - late)]])
    if rows > late:
        delayed[: late + 1] = 0.0
    found, meant = (wheel_speeds(values[:end], robot.track) for values in (rollout.actuated, delayed))
    wrong = np.abs(found - meant) > SIGMAS * noise.slip * np.abs(meant) + EXACT
    if wrong.any():
        yield f"actuated: not the delayed command with the wheels' slip, at row {int(wrong.any(axis=1).argmax())}"


def _check_targets(rollout: Rollout, end: int) -> Iterator[str]:
    """Check that measured speeds follow the motor targets."""
    record, robot = rollout.record, rollout.record.robot
    targets = rollout.actuated if len(rollout.actuated) else rollout.command
    if len(targets) != len(rollout.t) or end < 3:
        return
    off = (rollout.twist[1:end] - targets[1:end]) / record.physics_hz
    way = np.abs(rollout.twist[1:end]) / record.physics_hz
    late = LATE * (1 / record.control_hz + 1 / record.physics_hz)
    share = FOLLOW_SHARE * max(1.0, GRIP / robot.wheel_friction)
    limits = (
        ("forward speed", FOLLOW, robot.max_acceleration, robot.max_speed),
        ("yaw rate", FOLLOW_TURN, robot.max_yaw_acceleration, robot.max_yaw_rate),
    )
    for k, (what, least, harder, fastest) in enumerate(limits):
        for seconds in FOLLOW_WINDOWS:
            rows = min(len(off), max(1, round(seconds * record.physics_hz)))
            apart, covered = (windowed(values[:, k], rows) for values in (off, way))
            change = min(HARDER * harder * seconds, 2 * fastest)
            wrong = np.abs(apart) > least + share * covered + late * change
            if wrong.any():
                yield f"twist: the {what} does not follow the motors' targets, from t = {rollout.t[1 + wrong.argmax()]:.3f} s"
                break


def windowed(values: Floats, rows: int) -> Floats:
    """Return the sum over each window of `rows` values, (N - rows + 1,)."""
    total = np.concatenate(([0], np.cumsum(values)))
    return np.asarray(total[rows:] - total[:-rows])


def _check_estimate(rollout: Rollout) -> Iterator[str]:
    """Check that the error of the estimate is within that of pose fixes and odometry."""
    if not len(rollout.estimate):
        return
    if rollout.record.localisation != "fixes":
        yield from _check_unfixed_estimate(rollout)
        return
    record, robot = rollout.record, rollout.record.robot
    noise = robot.noise.scaled(record.noise)
    scale, shift, twist = noise.slip + noise.encoder, 0.0, 0.0
    if record.mapless:
        assert record.sensing is not None
        errors, (shift, twist) = Odometry().scaled(record.sensing.odometry), MATCHED
        scale += errors.speed_scale + errors.speed_noise
    # The filter corrects an odometry error within twenty fixes, see MIN_GAIN.
    odometry = 20 * SIGMAS * scale / noise.pose_rate * robot.max_speed
    off = rollout.estimate - rollout.pose
    far = float(np.hypot(off[:, 0], off[:, 1]).max())
    turned = float(np.abs(wrap_angle(off[:, 2])).max())
    most = SIGMAS * (noise.pose_xy + robot.max_speed * noise.pose_yaw) + odometry + shift + STILL
    if not far <= most or not turned <= SIGMAS * noise.pose_yaw + 2 * odometry / robot.track + twist + STILL:
        yield f"estimate: up to {far:.3g} m and {turned:.3g} rad off the pose, more than the robot's noise allows"


def _check_unfixed_estimate(rollout: Rollout) -> Iterator[str]:
    """Check that the estimate without pose fixes is the true pose, or drifts no faster than documented odometry."""
    record = rollout.record
    off = rollout.estimate - rollout.pose
    apart, turned = np.hypot(off[:, 0], off[:, 1]), np.abs(wrap_angle(off[:, 2]))
    if record.localisation == "true":
        # A row between two control periods keeps the error of the earlier one, which is zero.
        if apart.max() > EXACT or turned.max() > EXACT:
            yield "estimate: must be the pose where the robot is localised without error"
        return
    assert record.sensing is not None
    errors, noise = Odometry().scaled(record.sensing.odometry), record.robot.noise.scaled(record.noise)
    way = np.cumsum(np.abs(rollout.twist[:, 0])) / record.physics_hz
    turn = np.cumsum(np.abs(rollout.twist[:, 1])) / record.physics_hz
    samples = SAMPLE_RATE * rollout.t
    steady = errors.gyro_bias * rollout.t + errors.yaw_scale * turn
    heading = SIGMAS * (steady + errors.gyro_noise * np.sqrt(samples) / SAMPLE_RATE)
    scale = errors.speed_scale + errors.speed_noise + noise.slip + noise.encoder
    far = SIGMAS * scale * way + 2 * np.minimum(heading, np.pi) * way
    shift, twist = MATCHED if record.localisation == "matching" else (0.0, 0.0)
    wrong = (turned > heading + twist + STILL) | (apart > far + shift + STILL)
    if wrong.any():
        yield f"estimate: farther off the pose than odometry drifts, from t = {rollout.t[int(wrong.argmax())]:.3f} s"


def wheel_speeds(twist: Floats, track: float) -> Floats:
    """Return the rim speeds of the left and right wheel (N, 2) [m/s] for twists (N, 2)."""
    rim = twist[:, 1] * track / 2
    return np.stack([twist[:, 0] - rim, twist[:, 0] + rim], axis=1)
