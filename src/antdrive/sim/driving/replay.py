"""Drive a logged drive again: the motors' logged targets, open loop, in the record's world with the record's robot.

Nothing is planned or decided, so the replay depends on physics alone. The noise of a noisy robot is drawn again from the
record's seed: it must turn the logged commands into the logged targets, and the logged poses into the logged estimates. The
scans that are in the log are taken again, too, and those of a robot without a map matched.
On the machine and with the versions that wrote a
log it gives the same bits; elsewhere rounding differs, and `ROUNDING` says how much is allowed.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from antdrive.base.errors import FieldError
from antdrive.base.plane import wrap_angle
from antdrive.base.types import Floats
from antdrive.robots import NoiseModel, Twist
from antdrive.sim.driving.localising import OdometryModel, noise_model_of
from antdrive.sim.driving.recorder import Ending, Recorder
from antdrive.sim.driving.rescanning import Relooking, Rescanning, rescanning_of
from antdrive.sim.log.outcome import Outcome
from antdrive.sim.log.rollout import Rollout
from antdrive.sim.physics.engine import Engine

#: How far a replay on another machine or with other versions may be off, in metres, radians, m/s and rad/s.
ROUNDING = 1e-3
#: How far noise that is drawn again may be off, in metres, radians, m/s and rad/s: it takes a few dozen operations only.
SAME_NOISE = 1e-6


@dataclass(frozen=True)
class ReplayCheck:
    """How a replay differs from the log.

    Attributes:
        exact: whether pose, twist and contacts are the log's, bit for bit
        position: the largest distance between replayed and logged positions [m]
        turn: the largest difference of headings [rad]
        twist: the largest difference of speeds [m/s] or yaw rates [rad/s]
        problems: why the log is not that of a drive, a sentence each
    """

    exact: bool
    position: float
    turn: float
    twist: float
    problems: tuple[str, ...]

    @property
    def sentence(self) -> str:
        """The outcome in words."""
        if self.exact:
            return "replayed bit for bit"
        same = "differs" if self.problems else "replayed within rounding"
        return f"{same}: at most {self.position:.3g} m, {self.turn:.3g} rad and {self.twist:.3g} m/s or rad/s off"

    def as_dict(self) -> dict[str, Any]:
        """The comparison as plain values, for JSON."""
        return {"exact": self.exact, "position_m": self.position, "turn_rad": self.turn, "twist": self.twist}


def replay(rollout: Rollout) -> ReplayCheck:
    """Drive the logged targets of the motors again and compare.

    Raises:
        InputError: the log's movers find no place to start from.
        FieldError: the control rate does not divide the physics rate.
    """
    record = rollout.record
    substeps, rest = divmod(record.physics_hz, record.control_hz)
    if rest or substeps < 1:
        raise FieldError("record.control_hz", f"must divide the physics rate {record.physics_hz}")
    targets = rollout.actuated if len(rollout.actuated) else rollout.command
    movers = rollout.trajectories()
    with Engine(record.world, record.robot, physics_hz=record.physics_hz, trajectories=movers) as engine:
        log = Recorder(engine, record.task.start, noisy=False)
        for row in range(1, len(rollout.t), substeps):
            target = Twist(*targets[row].tolist())
            engine.command(*target)
            log.advance(min(substeps, len(rollout.t) - row), target, 0)
        drive = log.finish(Ending(rollout.outcome))
    moved = drive.pose - rollout.pose
    position = _most(np.hypot(moved[:, 0], moved[:, 1]))
    turn, twist = _most(np.abs(wrap_angle(moved[:, 2]))), _most(np.abs(drive.twist - rollout.twist))
    same = np.array_equal(drive.pose, rollout.pose) and np.array_equal(drive.twist, rollout.twist)
    exact = same and np.array_equal(drive.contacts, rollout.contacts)
    problems = []
    if not max(position, turn, twist) <= ROUNDING:
        problems.append(f"replay: the logged commands lead up to {position:.3g} m and {turn:.3g} rad away from the log")
    if bool(len(drive.contacts)) != bool(len(rollout.contacts)) or (same and not exact):
        problems.append(
            f"replay: physics reports {len(drive.contacts)} contact points, the log {len(rollout.contacts)}"
        )
    problems += _other_senses(rollout)
    return ReplayCheck(exact, position, turn, twist, tuple(problems))


def _other_senses(rollout: Rollout) -> Iterator[str]:
    """What of a log is not as the seed's noise and the lidar make it: estimates, targets of the motors, scans."""
    record = rollout.record
    again = rescanning_of(rollout)
    if record.exploring and again is None:
        yield "replay: the log of a robot without a map has no scans"
        return
    odometry = 1.0 if record.sensing is None else record.sensing.odometry
    model = noise_model_of(
        record.localisation, record.robot, record.noise, odometry, 1 / record.control_hz, record.task.start, record.seed
    )
    if model is not None and not len(rollout.actuated) == len(rollout.estimate) == len(rollout.t):
        yield "replay: actuated and estimate are missing; the log of a robot with noise has them"
        model = None
    found: list[tuple[float, ...]] = []
    # A period's first row is the last of the period before; a contact ends the control of the robot.
    touched = int(rollout.contacts[0, 0]) if len(rollout.contacts) else len(rollout.t)
    rows = range(0, min(touched, len(rollout.t) - 1), record.physics_hz // record.control_hz)
    for tick, row in enumerate(rows):
        x, y, yaw = rollout.pose[row].tolist()
        estimate = x, y, yaw
        if model is not None:
            estimate = model.estimate_pose((x, y, yaw), Twist(*rollout.twist[row].tolist()))
        if again is not None:
            estimate = again.look(tick, (x, y, yaw), estimate)
            if isinstance(model, OdometryModel):
                model.correct(estimate)
            if isinstance(again, Rescanning):
                again.plan(tick, model.pose_after_delay() if model is not None else estimate)
        if model is not None:
            found.append((*estimate, *model.actuate(Twist(*rollout.command[row + 1].tolist()))))
    if again is not None:
        _look_once_more(rollout, again, model)
        yield from again.problems()
    if not found:
        return
    drawn = np.array(found)
    off = drawn[:, :3] - rollout.estimate[rows]
    off[:, 2] = wrap_angle(off[:, 2])
    for name, error in (("estimate", off), ("actuated", drawn[:, 3:] - rollout.actuated[np.array(rows) + 1])):
        wrong = (np.abs(error) > SAME_NOISE).any(axis=1)
        if wrong.any():
            t = rollout.t[rows[int(wrong.argmax())]]
            yield f"replay: {name} is not what the noise of seed {record.seed} makes of the log, from t = {t:.3f} s"


def _look_once_more(rollout: Rollout, again: Rescanning | Relooking, model: NoiseModel | None) -> None:
    """Take the scan of the period in which the robot decided that its drive was over; other drives end without one."""
    record, last = rollout.record, len(rollout.t) - 1
    tick, rest = divmod(last, record.physics_hz // record.control_hz)
    decided = rollout.outcome is Outcome.SUCCEEDED or last in rollout.scan_rows
    if rest or len(rollout.contacts) or not decided:
        return
    x, y, yaw = rollout.pose[last].tolist()
    estimate = x, y, yaw
    if model is not None:
        estimate = model.estimate_pose((x, y, yaw), Twist(*rollout.twist[last].tolist()))
    again.look(tick, (x, y, yaw), estimate)


def _most(values: Floats) -> float:
    most = float(values.max())
    return most if math.isfinite(most) else math.inf
