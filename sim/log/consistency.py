"""What a log's own record says about its rows: limits of the robot, commands, noise, route, cells and outcome.

Each check is a function that yields a sentence for every fault. Tolerances are some times what genuine drives show, over
the catalogue's worlds and robots with and without noise, collided drives up to the contact.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from antdrive.sim.log.outcome import Outcome
from antdrive.sim.log.record import DECISION
from antdrive.sim.log.rollout import Rollout
from antdrive.worlds.plane import wrap_angle
from antdrive.worlds.types import Floats

OVERSHOOT = 0.03  # measured speeds exceed limits and targets by at most this share; genuine drives: 0.2 %
STILL = 0.02  # and by this, which matters for very slow robots [m/s], [rad/s]
SIGMAS = 8.0  # noise stays within so many standard deviations; genuine drives: 4.2
ACCELERATION_WINDOW, HARDER = 0.25, 1.5  # [s], times the robot's limit; genuine drives: 1.16
SLOWEST_PHYSICS = 60  # at a lower rate robots jolt, and poses do not follow from the speeds [Hz]
EXACT = 1e-6  # commands keep their limits to this share


def inconsistencies(rollout: Rollout) -> Iterator[str]:
    """Every way in which the rows before the first contact contradict the record."""
    end = len(rollout.t)
    if len(rollout.contacts):
        end = max(1, int(rollout.contacts[0, 0]))
    yield from _check_record(rollout)
    yield from _check_speeds(rollout, end)
    yield from _check_commands(rollout, end)
    yield from _check_actuated(rollout, end)
    yield from _check_estimate(rollout)
    yield from _check_plan(rollout)
    yield from _check_end(rollout)


def _check_record(rollout: Rollout) -> Iterator[str]:
    """Margin, inflation and the rates must fit each other."""
    record = rollout.record
    if not abs(record.inflate - record.robot.radius - record.margin) <= EXACT:
        yield (
            f"record.inflate: {record.inflate:g} m is not the robot's radius {record.robot.radius:g} m plus the margin "
            f"{record.margin:g} m"
        )
    if record.physics_hz < SLOWEST_PHYSICS:
        yield f"record.physics_hz: must be at least {SLOWEST_PHYSICS} Hz, found {record.physics_hz}"
    if record.physics_hz % record.control_hz:
        yield f"record.control_hz: {record.control_hz} Hz does not divide the physics rate {record.physics_hz} Hz"


def _check_speeds(rollout: Rollout, end: int) -> Iterator[str]:
    """Measured speeds and their changes must be within the robot's limits, but for slip."""
    record, robot, twist = rollout.record, rollout.record.robot, rollout.twist[:end]
    more = SIGMAS * robot.noise.slip * record.noise
    wheels = _wheels(twist, robot.track)
    limits = (
        ("forward speed", "m/s", np.abs(twist[:, 0]), robot.max_speed),
        ("yaw rate", "rad/s", np.abs(twist[:, 1]), robot.max_yaw_rate + more * robot.max_speed * 2 / robot.track),
        ("wheel speed", "rad/s", np.abs(wheels).max(axis=1) / robot.wheel_radius, robot.max_wheel_speed),
    )
    for what, unit, values, limit in limits:
        if not values.max() <= limit * (1 + OVERSHOOT + more) + STILL:
            row = int(values.argmax())
            yield f"twist: {what} of {values[row]:.4g} {unit} at t = {rollout.t[row]:.3f} s; the robot's limit is {limit:.4g}"
    back = max(1, round(ACCELERATION_WINDOW * record.physics_hz))
    if len(twist) > back:
        window = back / record.physics_hz + 1 / record.control_hz  # commands change at once, period by period
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
    """Commands must be within the robot's limits, one for each control period, and none in row 0."""
    record, robot, command = rollout.record, rollout.record.robot, rollout.command
    limits = np.array([robot.max_speed, robot.max_yaw_rate])
    if not (np.abs(command) <= limits * (1 + EXACT)).all():
        yield f"command: beyond the robot's limits {robot.max_speed:g} m/s and {robot.max_yaw_rate:g} rad/s"
    if command[0].any():
        yield "command: row 0 is before the first command and must be 0"
    period = max(1, record.physics_hz // record.control_hz)
    for name, values in (("command", command), ("actuated", rollout.actuated)):
        changed = np.flatnonzero(np.diff(values[1:], axis=0).any(axis=1)) + 1
        if (changed % period).any():
            yield f"{name}: changes within a control period, at row {int(changed[(changed % period) > 0][0]) + 1}"
    steps = np.abs(np.diff(np.concatenate([np.zeros((1, 2)), command[1:end:period]]), axis=0))
    most = HARDER * np.array([robot.max_acceleration, robot.max_yaw_acceleration]) / record.control_hz
    if record.task.world.movers:  # avoidance slows down along the same curve: the yaw rate falls with the speed at once
        most[1] = np.inf
    if not (steps <= most + EXACT).all():
        row = int((steps > most + EXACT).any(axis=1).argmax()) * period + 1
        yield f"command: changes faster than the robot's limits allow, at row {row}"


def _check_actuated(rollout: Rollout, end: int) -> Iterator[str]:
    """The targets of the motors must be the delayed commands, but for slip of the wheels."""
    record, robot = rollout.record, rollout.record.robot
    noise = robot.noise.scaled(record.noise)
    rows = len(rollout.t)
    for name in ("estimate", "actuated"):
        if (len(getattr(rollout, name)) == rows) != noise.nonzero:
            yield f"{name}: must have {rows if noise.nonzero else 0} rows at a noise of {record.noise:g}"
            return
    if not noise.nonzero:
        return
    period = max(1, record.physics_hz // record.control_hz)
    late = round(noise.delay * record.control_hz) * period
    delayed = np.concatenate([np.zeros((min(late, rows), 2)), rollout.command[: max(0, rows - late)]])
    if rows > late:
        delayed[: late + 1] = 0.0
    found, meant = (_wheels(values[:end], robot.track) for values in (rollout.actuated, delayed))
    wrong = np.abs(found - meant) > SIGMAS * noise.slip * np.abs(meant) + EXACT
    if wrong.any():
        yield f"actuated: not the delayed command with the wheels' slip, at row {int(wrong.any(axis=1).argmax())}"


def _check_estimate(rollout: Rollout) -> Iterator[str]:
    """The estimated pose must be as near to the true one as pose fixes and odometry keep it."""
    if not len(rollout.estimate):
        return
    robot = rollout.record.robot
    noise = robot.noise.scaled(rollout.record.noise)
    # Twenty fixes after an error of odometry the filter has corrected it, see MIN_GAIN.
    odometry = 20 * SIGMAS * (noise.slip + noise.encoder) / noise.pose_rate * robot.max_speed
    off = rollout.estimate - rollout.pose
    far = float(np.hypot(off[:, 0], off[:, 1]).max())
    turned = float(np.abs(wrap_angle(off[:, 2])).max())
    most = SIGMAS * (noise.pose_xy + robot.max_speed * noise.pose_yaw) + odometry + STILL
    if not far <= most or not turned <= SIGMAS * noise.pose_yaw + 2 * odometry / robot.track + STILL:
        yield f"estimate: up to {far:.3g} m and {turned:.3g} rad off the pose, more than the robot's noise allows"


def _check_plan(rollout: Rollout) -> Iterator[str]:
    """Route and cells must lie in the world and lead from the start to the goal."""
    record, route, cells = rollout.record, rollout.route, rollout.cells
    xmin, ymin, xmax, ymax = record.world.bounds
    task, near = record.task, 1.5 * record.cell
    if len(route) < 2:
        yield f"route: must have two points or more, found {len(route)}"
        return
    if (route < (xmin, ymin)).any() or (route > (xmax, ymax)).any():
        yield "route: leaves the world's bounds"
    if math.dist(route[0], task.start[:2]) > near:
        yield f"route: begins {math.dist(route[0], task.start[:2]):.3g} m from the task's start"
    by_cells = any(replan.trigger == DECISION for replan in record.replans)
    if not by_cells and math.dist(route[-1], task.goal) > near:
        yield f"route: ends {math.dist(route[-1], task.goal):.3g} m from the task's goal"
    rows, cols = math.ceil((ymax - ymin) / record.cell) + 1, math.ceil((xmax - xmin) / record.cell) + 1
    if (cells < 0).any() or (cells >= (rows, cols)).any():
        yield f"cells: must lie on the grid of {record.cell:g} m"
    elif (np.abs(np.diff(cells, axis=0)) > 1).any():
        yield "cells: must be neighbours on the grid"


def _check_end(rollout: Rollout) -> Iterator[str]:
    """The drive must end when its outcome says."""
    record, end = rollout.record, float(rollout.t[-1])
    period = 1 / record.control_hz
    if rollout.outcome in (Outcome.NO_PATH, Outcome.STOPPED):
        yield f"outcome: {rollout.outcome.key} ends a run before the robot drives, but the log has rows"
    if rollout.outcome is Outcome.TIMED_OUT and end < record.time_limit - period:
        yield f"outcome: timed_out, but the drive ends after {end:.3f} s of {record.time_limit:g} s"
    if not len(rollout.contacts) and end > record.time_limit + period:
        yield f"record.time_limit: {record.time_limit:g} s, but the drive lasts {end:.3f} s"


def _wheels(twist: Floats, track: float) -> Floats:
    """The speeds of the left and right wheel over the floor (T, 2) [m/s]."""
    rim = twist[:, 1] * track / 2
    return np.stack([twist[:, 0] - rim, twist[:, 0] + rim], axis=1)
