"""What a log's own record says about its rows: limits of the robot, commands, noise and outcome.

Each check is a function that yields a sentence for every fault. Tolerances are some times what genuine drives show, over
the catalogue's worlds and robots with and without noise, collided drives up to the contact.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from antdrive.base.plane import wrap_angle
from antdrive.base.types import Floats
from antdrive.robots.odometry import SAMPLE_RATE, Odometry
from antdrive.sim.log.outcome import Outcome
from antdrive.sim.log.planned import contradictions
from antdrive.sim.log.rollout import Rollout

OVERSHOOT = 0.03  # measured speeds exceed limits and targets by at most this share; genuine drives: 0.2 %
MATCHED = 0.075, 0.02  # how far a scan may be laid wrong on the map: three grains of it [m], two corrections [rad]
STILL = 0.02  # and by this, which matters for very slow robots [m/s], [rad/s]
SIGMAS = 8.0  # noise stays within so many standard deviations; genuine drives: 4.2
ACCELERATION_WINDOW, HARDER = 0.25, 1.5  # [s], times the robot's limit; genuine drives: 1.16
SLOWEST_PHYSICS = 60  # at a lower rate robots jolt, and poses do not follow from the speeds [Hz]
EXACT = 1e-6  # commands keep their limits to this share
# How far the way by measured speeds may differ from the way by the motors' targets, over some seconds; motors are late by
# a few periods, which shows while speeds change. Genuine drives in 0.25 s: 2.1 mm and 0.011 rad.
FOLLOW_WINDOWS = (0.25, 1.0, 4.0)  # [s]
FOLLOW, FOLLOW_TURN, FOLLOW_SHARE = 0.01, 0.05, 0.02  # [m], [rad], fraction of the way
LATE = 2.0  # periods of control and of physics by which motors are late, at most
GRIP = 0.8  # wheels with less friction slide, the more the less
AFTER_CONTACT = 0.5  # a drive ends this long after the first contact [s]
STUCK_TIME = 8.0  # without progress for so long, a robot is stuck [s]
STUCK_SHARE = 0.25  # a stuck robot gets no farther in that time than this share of what it could drive
STOPPED = 0.02  # a robot at the end of its route stands: it is slower than this [m/s], [rad/s]


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
    yield from _check_targets(rollout, end)
    yield from contradictions(rollout, end)
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
    # Avoidance, and a robot at the edge of its sight, slow down along the same curve: the yaw rate falls with the speed at once.
    if record.task.world.movers or record.exploring:
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
        if (len(getattr(rollout, name)) == rows) != (noise.nonzero or record.localisation in ("odometry", "matching")):
            yield f"{name}: must have {rows if noise.nonzero else 0} rows at a noise of {record.noise:g}"
            return
    if not len(rollout.actuated):
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


def _check_targets(rollout: Rollout, end: int) -> Iterator[str]:
    """Measured speeds must follow the targets of the motors."""
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
    """The sum over each window of a number of values, (N - rows + 1,)."""
    total = np.concatenate(([0], np.cumsum(values)))
    return np.asarray(total[rows:] - total[:-rows])


def _check_estimate(rollout: Rollout) -> Iterator[str]:
    """The estimated pose must be as near to the true one as pose fixes and odometry keep it."""
    if not len(rollout.estimate):
        return
    if rollout.record.localisation != "fixes":
        yield from _check_unfixed_estimate(rollout)
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


def _check_unfixed_estimate(rollout: Rollout) -> Iterator[str]:
    """Without pose fixes the estimate must be the pose, or drift from it no faster than the documented odometry."""
    record = rollout.record
    off = rollout.estimate - rollout.pose
    apart, turned = np.hypot(off[:, 0], off[:, 1]), np.abs(wrap_angle(off[:, 2]))
    if record.localisation == "true":
        # A row between two control periods keeps the error of the one before, which is none.
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


def _check_end(rollout: Rollout) -> Iterator[str]:
    """The drive must end when its outcome says."""
    record, end = rollout.record, float(rollout.t[-1])
    period = 1 / record.control_hz
    # A planner may give a wrong plan on the way, too: then the drive ends with that attempt.
    wrong_replan = bool(record.replans) and not record.replans[-1].solved and rollout.outcome is Outcome.INVALID_PLAN
    if rollout.outcome in (Outcome.NO_PATH, Outcome.STOPPED, Outcome.INVALID_PLAN) and not wrong_replan:
        yield f"outcome: {rollout.outcome.key} ends a run before the robot drives, but the log has rows"
    if rollout.outcome is Outcome.TIMED_OUT and end < record.time_limit - period:
        yield f"outcome: timed_out, but the drive ends after {end:.3f} s of {record.time_limit:g} s"
    if not len(rollout.contacts) and end > record.time_limit + period:
        yield f"record.time_limit: {record.time_limit:g} s, but the drive lasts {end:.3f} s"
    if len(rollout.contacts):
        after = end - float(rollout.contacts[0, 0]) / record.physics_hz
        if after > AFTER_CONTACT + 2 * period:
            yield f"contacts: the first contact ends a drive, but the log goes on for {after:.3f} s"
    if rollout.outcome is Outcome.STUCK:
        yield from _check_stuck(rollout)


def _check_stuck(rollout: Rollout) -> Iterator[str]:
    """A stuck robot stands off the goal, at the end of its route, or has made no progress for some time."""
    record, task, last = rollout.record, rollout.record.task, rollout.pose[-1, :2]
    left = math.dist(last, task.goal)
    stands = bool((np.abs(rollout.twist[-1]) <= STOPPED).all())
    if stands and left > task.goal_tolerance:
        return
    if rollout.t[-1] < STUCK_TIME:
        yield f"outcome: stuck, but the drive ends after {rollout.t[-1]:.3f} s; that takes {STUCK_TIME:g} s without progress"
        return
    before = rollout.pose[-1 - round(STUCK_TIME * record.physics_hz), :2]
    if math.dist(before, last) > STUCK_SHARE * STUCK_TIME * record.robot.max_speed:
        yield f"outcome: stuck, but the robot got {math.dist(before, last):.3g} m farther in the last {STUCK_TIME:g} s"


def _wheels(twist: Floats, track: float) -> Floats:
    """The speeds of the left and right wheel over the floor (T, 2) [m/s]."""
    rim = twist[:, 1] * track / 2
    return np.stack([twist[:, 0] - rim, twist[:, 0] + rim], axis=1)
