"""Following a route in physics, with everything logged."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from antdrive.robots import (
    LIMITERS,
    Avoidance,
    AvoidanceState,
    Progress,
    PurePursuit,
    RobotSpec,
    Senses,
    TrackedPath,
    Twist,
    footprint_clearance,
)
from antdrive.sim.driving import _kernels_movers
from antdrive.sim.driving.perception import Predictor
from antdrive.sim.driving.replanning import MISSED, ReplanMonitor
from antdrive.sim.driving.schedule import held
from antdrive.sim.log.contacts import touches
from antdrive.sim.log.rollout import Outcome
from antdrive.sim.physics.engine import Engine
from antdrive.worlds import Floats, Pose, Task, Trajectories
from antdrive.worlds.errors import FieldError

STOPPED_SPEED = 0.01  # slower than this counts as standing [m/s]
STUCK_AFTER = 8.0  # without progress for this long the robot is stuck [s]
STUCK_PROGRESS = 0.02  # what counts as progress along the route [m]
YIELD = LIMITERS.index("yield")
SLOW = 0.1  # a robot that yields and is no faster waits [m/s]
AFTER_CONTACT = 0.5  # a collision stays in the log for this long, braking [s]


@dataclass(frozen=True, eq=False)
class Drive:
    """What a drive logged, a row per physics step; row 0 is the start."""

    outcome: Outcome
    reason: str  # where the outcome's sentence does not say it all
    t: Floats  # (T,) [s]
    pose: Floats  # (T, 3)
    twist: Floats  # (T, 2) measured
    command: Floats  # (T, 2) in force when the row was reached
    clearance: Floats  # (T,) [m]
    limiter: np.ndarray[tuple[int], np.dtype[np.uint8]]  # (T,)
    movers: Floats  # (T, M, 2) [m]
    contacts: Floats  # (K, 4)
    estimate: Floats  # (T, 3) where the robot believed to be; (0, 3) where it knew


def drive(
    engine: Engine,
    controller: PurePursuit,
    guide: TrackedPath,
    task: Task,
    *,
    control_hz: int = 60,
    time_limit: float,
    senses: Senses | None = None,
    yielding: Avoidance | None = None,
    watch: Predictor | None = None,
    rerouter: ReplanMonitor | None = None,
    progress: Callable[[float], None] | None = None,
) -> Drive:
    """Drive along a guide until the robot stands at its end, touches something or is touched, is stuck or late.

    With `yielding` it keeps clear of the movers that it has a `watch` on; waiting is then no being stuck. With a `rerouter`
    it goes on by a new route where that sees a cause.
    With `senses` the robot sees and acts by them, else perfectly. `progress` is told the fraction of the route that is done,
    about ten times per simulated second.

    Raises:
        ValueError: the control rate does not divide the physics rate.
    """
    substeps, rest = divmod(engine.physics_hz, control_hz)
    if rest or substeps < 1:
        raise FieldError("control_hz", f"must divide the physics rate {engine.physics_hz}, got {control_hz}")
    engine.place(task.start)
    rows = [(*engine.state(), 0.0, 0.0, 0)]
    errors = [(0.0, 0.0, 0.0)]  # of the belief, a row each: it moves with the robot between two looks
    contacts = [(0, *contact) for contact in engine.contacts()]
    outcome = Outcome.COLLIDED if contacts else None
    command, state = Twist(0.0, 0.0), Progress()
    best, idle, turned = 0.0, 0, 0  # the farthest on the route, and periods since then without and with turning
    resolve = AvoidanceState()
    reason = ""
    ticks = round(time_limit * control_hz)
    patience = round(STUCK_AFTER * control_hz)
    full_turn = round(2 * math.pi / engine.robot.max_yaw_rate * control_hz)
    for tick in range(ticks):
        if outcome is not None:
            break
        x, y, yaw, speed, yaw_rate = rows[-1][:5]
        believed = (x, y, yaw)
        if senses:
            estimate = senses.look(believed, Twist(speed, yaw_rate))
            errors[-1] = (estimate[0] - x, estimate[1] - y, math.remainder(estimate[2] - yaw, 2 * math.pi))
            believed = senses.ahead()
        if rerouter:
            waits = state.limiter == YIELD and abs(speed) < SLOW
            cause = rerouter.cause(tick, believed, waits, guide, state.arc)
            renewed = rerouter.again(tick, believed, cause) if cause else None
            if renewed:
                guide, state, best = renewed, Progress(limiter=state.limiter), 0.0
        last, before = command, state
        command, state = controller.step(guide, believed, last, before)
        schedule, top = rerouter.schedule if rerouter else None, math.inf
        if schedule:
            top = schedule.speed(tick / control_hz, state.arc)
            command = held(command, last, top, engine.robot.max_acceleration / control_hz)
        if watch and yielding:
            settles = before.limiter == YIELD and _within(believed, last, task, engine.robot)
            if settles:
                if _standing(speed, yaw_rate):
                    outcome, reason = _arrived(x, y, task)
                    break
                command = _brake(last, engine.robot, control_hz)
            # Once it stands there it has arrived: then only what comes until that matters.
            ahead = yielding.ahead[: 2 + math.ceil(_stopping(last, engine.robot) / yielding.step) if settles else None]
            expected = watch.expected(tick, believed[:2], ahead)
            command, yields, resolve = yielding.avoid(
                guide, engine.robot, believed, last, before, command, resolve, *expected, top=top
            )
            if yields or settles:
                state = state._replace(turning=before.turning, limiter=YIELD)
        if guide.length - state.arc <= guide.goal_distance and _standing(speed, yaw_rate) and not any(command):
            end, why = _arrived(x, y, task)
            knows = end is Outcome.STUCK and math.dist(believed[:2], task.goal) > task.goal_tolerance
            renewed = rerouter.again(tick, believed, MISSED) if rerouter and knows else None
            if renewed:
                guide, state, best = renewed, Progress(limiter=state.limiter), 0.0
            elif not (rerouter and knows and rerouter.waits):
                outcome, reason = end, why
                break
        engine.command(*(senses.act(command) if senses else command))
        for _ in range(substeps):
            touched = engine.step()
            rows.append((*engine.state(), *command, state.limiter))
            errors.append(errors[-1])
            if touched:
                contacts += [(len(rows) - 1, *contact) for contact in touched]
                outcome = Outcome.COLLIDED
        if state.arc > best + STUCK_PROGRESS:
            best, idle, turned = state.arc, 0, 0
        else:
            waits = state.limiter == YIELD or top < SLOW
            idle, turned = idle + (not state.turning and not waits), turned + (state.turning and not waits)
            if outcome is None and (idle >= patience or turned >= patience + full_turn):
                outcome, reason = Outcome.STUCK, f"no progress along the route for {STUCK_AFTER:g} s"
        if progress is not None and tick % (control_hz // 10 or 1) == 0:
            progress(state.arc / guide.length)
    if outcome is Outcome.COLLIDED:
        engine.command(0.0, 0.0)
        for _ in range(round(AFTER_CONTACT * engine.physics_hz)):
            touched = engine.step()
            rows.append((*engine.state(), 0.0, 0.0, state.limiter))
            errors.append(errors[-1])
            contacts += [(len(rows) - 1, *contact) for contact in touched]
    log = np.array(rows)
    t = np.arange(len(log)) / engine.physics_hz
    pose = np.ascontiguousarray(log[:, :3])
    clearance = footprint_clearance(engine.world, engine.robot.footprint, pose)
    movers = np.empty((len(t), 0, 2))
    if engine.traffic:
        movers = engine.traffic.positions(t)
        foot = engine.robot.footprint
        shape = np.array([foot.half_length, foot.half_width, foot.rounding])
        _kernels_movers.lower_by_movers(pose, shape, movers, engine.traffic.radii, clearance)
        if outcome is Outcome.COLLIDED:
            outcome, reason = _blame(engine, engine.traffic, t, pose, log[:, 3:5], movers, np.array(contacts))
    return Drive(
        outcome=outcome or Outcome.TIMED_OUT,
        reason=reason,
        t=t,
        pose=pose,
        twist=np.ascontiguousarray(log[:, 3:5]),
        command=np.ascontiguousarray(log[:, 5:7]),
        clearance=clearance,
        limiter=log[:, 7].astype(np.uint8),
        movers=movers,
        contacts=np.array(contacts, dtype=np.float64).reshape(-1, 4),
        estimate=pose + np.array(errors) if senses else np.empty((0, 3)),
    )


def _blame(
    engine: Engine, traffic: Trajectories, t: Floats, pose: Floats, twist: Floats, movers: Floats, contacts: Floats
) -> tuple[Outcome, str]:
    """Whose the first touch is, and a sentence about a mover's."""
    discs = len(engine.world.obstacles)
    first = touches(
        contacts, pose, twist, movers, traffic.jumps(t),
        hz=engine.physics_hz, discs=discs, radii=traffic.radii,
        footprint=dataclasses.asdict(engine.robot.footprint), deceleration=engine.robot.max_acceleration,
    )[0]  # fmt: skip
    m, before = first.obstacle - discs, max(first.step - 1, 0)
    if not 0 <= m < len(traffic):
        return first.outcome, ""
    fast = math.hypot(*traffic.velocities(t[before])[0, m])
    return first.outcome, f"movers[{m}] at {fast:.2f} m/s, the robot at {abs(twist[before, 0]):.2f} m/s"


def _arrived(x: float, y: float, task: Task) -> tuple[Outcome, str]:
    """How a drive ends that ends here, by the robot's own will, and why."""
    left = math.dist((x, y), task.goal)
    if left <= task.goal_tolerance:
        return Outcome.SUCCEEDED, ""
    return Outcome.STUCK, f"the route ends here, {left:.3f} m from the goal; the tolerance is {task.goal_tolerance:g} m"


def _within(pose: Pose, command: Twist, task: Task, robot: RobotSpec) -> bool:
    """Whether a robot that brakes now stops within the goal's tolerance."""
    x, y, yaw = pose
    way = command.speed * abs(command.speed) / (2 * robot.max_acceleration)
    end = (x + way * math.cos(yaw), y + way * math.sin(yaw))
    return max(math.dist((x, y), task.goal), math.dist(end, task.goal)) < 0.95 * task.goal_tolerance


def _stopping(command: Twist, robot: RobotSpec) -> float:
    """How long a robot takes to stand still [s]."""
    return max(abs(command.speed) / robot.max_acceleration, abs(command.yaw_rate) / robot.max_yaw_acceleration)


def _brake(command: Twist, robot: RobotSpec, hz: int) -> Twist:
    less = max(0.0, 1 - robot.max_acceleration / hz / abs(command.speed)) if command.speed else 0.0
    return Twist(command.speed * less, command.yaw_rate * less)


def _standing(speed: float, yaw_rate: float) -> bool:
    return abs(speed) < STOPPED_SPEED and abs(yaw_rate) < STOPPED_SPEED
