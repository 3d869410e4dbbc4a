"""Replay of a log: play the logged motor targets open loop, in the record's world with the record's robot.

The replay depends on physics alone. The record's seed reproduces the noise, which must turn the logged commands into the
logged targets and the logged poses into the logged estimates. Logged scans are measured again and, for a mapless
robot, matched. The machine and versions that wrote a log reproduce it bit for bit; `ROUNDING` is the tolerance for
others.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from antdrive.base import Pose
from antdrive.base.errors import FieldError
from antdrive.base.plane import wrap_angle
from antdrive.base.types import Floats
from antdrive.robots import Twist
from antdrive.robots.noise import moved_by
from antdrive.sim.driving.body import Body
from antdrive.sim.driving.localising import Exact
from antdrive.sim.driving.mover_tracking import MoverTracking
from antdrive.sim.driving.observation import Note
from antdrive.sim.driving.plants import Bullet
from antdrive.sim.driving.senses import Senses, logged_positioning
from antdrive.sim.driving.simulated_lidar import SimulatedLidar
from antdrive.sim.driving.survey import Survey, reset_ticks, turning_room
from antdrive.sim.log.outcome import Outcome
from antdrive.sim.log.rollout import Rollout
from antdrive.sim.physics.engine import Engine, State

#: Tolerance of a replay on another machine or version, in metres, radians, m/s and rad/s.
ROUNDING = 1e-3
#: Tolerance of reproduced noise, in metres, radians, m/s and rad/s; small, since few operations compute the noise.
SAME_NOISE = 1e-6


@dataclass(frozen=True)
class ReplayCheck:
    """Differences between a replay and its log."""

    exact: bool  # whether everything compared agrees bit for bit
    position: float  # largest distance between replayed and logged positions [m]
    turn: float  # largest difference of headings [rad]
    twist: float  # largest difference of speeds [m/s] or yaw rates [rad/s]
    problems: tuple[str, ...]  # why the log cannot come from a drive, one sentence each
    rounded: tuple[str, ...] = ()  # arrays and keys of the record that agree within rounding only

    @property
    def sentence(self) -> str:
        """The result in words."""
        if self.exact:
            return "replayed bit for bit"
        same = "the replay differs" if self.problems else "replayed within rounding"
        same += f" ({', '.join(self.rounded)})" if self.rounded and not self.problems else ""
        if not any((self.position, self.turn, self.twist)):  # the difference is elsewhere, for example in the route
            return same
        return f"{same}: at most {self.position:.3g} m, {self.turn:.3g} rad and {self.twist:.3g} m/s or rad/s off"

    def as_dict(self) -> dict[str, Any]:
        """Return the comparison as plain values, for JSON."""
        return {"exact": self.exact, "position_m": self.position, "turn_rad": self.turn, "twist": self.twist}


def offsets(pose: Floats, twist: Floats, rollout: Rollout) -> tuple[float, float, float]:
    """Return the largest differences of positions [m], headings [rad] and speeds [m/s, rad/s] from a log."""
    moved = pose - rollout.pose
    position, turn = _most(np.hypot(moved[:, 0], moved[:, 1])), _most(np.abs(wrap_angle(moved[:, 2])))
    return position, turn, _most(np.abs(twist - rollout.twist))


def replay(rollout: Rollout) -> ReplayCheck:
    """Replay the logged motor targets and compare."""
    record = rollout.record
    substeps, rest = divmod(record.physics_hz, record.control_hz)
    if rest or substeps < 1:
        raise FieldError("record.control_hz", f"must divide the physics rate {record.physics_hz}")
    targets = rollout.actuated if len(rollout.actuated) else rollout.command
    movers = rollout.trajectories()
    with Engine(record.world, record.robot, physics_hz=record.physics_hz, trajectories=movers) as engine:
        again = Bullet(engine, record.task.start, record.control_hz).play(targets[1:])
    position, turn, twist = offsets(again.pose, again.twist, rollout)
    same = np.array_equal(again.pose, rollout.pose) and np.array_equal(again.twist, rollout.twist)
    exact = same and np.array_equal(again.contacts, rollout.contacts)
    problems = [f"replay: physics' contacts are no evidence, since {again.physics}"] if again.physics else []
    if not max(position, turn, twist) <= ROUNDING:
        problems.append(
            f"replay: the logged commands lead to poses up to {position:.3g} m and {turn:.3g} rad off the log"
        )
    if bool(len(again.contacts)) != bool(len(rollout.contacts)) or (same and not exact):
        problems.append(
            f"replay: physics reports {len(again.contacts)} contact points, the log {len(rollout.contacts)}"
        )
    problems += _other_senses(rollout)
    return ReplayCheck(exact, position, turn, twist, tuple(problems))


def _other_senses(rollout: Rollout) -> Iterator[str]:
    """Yield where estimates, motor targets or scans differ from the seed's noise and the lidar's measurements."""
    record = rollout.record
    if record.exploring and not len(rollout.scans):
        yield "replay: a log without a map must have scans"
        return
    senses, localiser = logged_positioning(record)
    if senses.noisy and not len(rollout.actuated) == len(rollout.estimate) == len(rollout.t):
        yield "replay: actuated and estimate are missing; required with noise"
        senses, localiser = Senses(), Exact(record.task.start, 1 / record.control_hz)
    per_tick = record.rows_per_period
    # A period's first row is the last row of the previous period; a contact ends control.
    rows = range(0, min(rollout.first_contact, len(rollout.t) - 1), per_tick)
    lidar, scans, resets = scans_of(rollout)
    plant = Logged(rollout)
    body = Body(
        plant,
        senses,
        localiser,
        lidar,
        hz=record.control_hz,
        limit=(len(rows) + 1) / record.control_hz,
    )
    for tick, row in enumerate(rows):
        now = body.observe()
        pose = now.pose if now.scan is None or scans is None else scans.read(tick, now.pose, now.scan)
        if tick in resets:
            resets[tick](moved_by(pose, now.pending, 1 / record.control_hz))
        body.step(Twist(*rollout.command[row + 1].tolist()), Note(pose))
    if _decided_at_the_end(rollout, per_tick):
        body.observe()
    if lidar:
        yield from _other_scans(rollout, **lidar.logged(rollout, per_tick))
    if not senses.noisy or not rows:
        return
    off = np.array(body.estimates[: len(rows)]) - rollout.estimate[rows]
    off[:, 2] = wrap_angle(off[:, 2])
    for name, error in (
        ("estimate", off),
        ("actuated", np.array(plant.actuated) - rollout.actuated[np.array(rows) + 1]),
    ):
        wrong = (np.abs(error) > SAME_NOISE).any(axis=1)
        if wrong.any():
            t = rollout.t[rows[int(wrong.argmax())]]
            yield f"replay: {name} differs from the noise of seed {record.seed}, from t = {t:.3f} s"


class Logged:
    """Plant that returns the logged poses and ignores commands.

    Attributes:
        state: true pose and velocity
        actuated: the motor targets so far
    """

    touched = False

    def __init__(self, rollout: Rollout) -> None:
        self.actuated: list[Twist] = []
        self._rollout, self._row = rollout, 0
        self._per_tick = rollout.record.rows_per_period
        self.state = self._state()

    def advance(self, command: Twist, actuated: Twist, limiter: int = 0) -> None:
        """Advance to the row of the next control period."""
        self.actuated.append(actuated)
        self._row = min(self._row + self._per_tick, len(self._rollout.t) - 1)
        self.state = self._state()

    def _state(self) -> State:
        return State(*self._rollout.pose[self._row].tolist(), *self._rollout.twist[self._row].tolist())


def scans_of(
    rollout: Rollout,
) -> tuple[SimulatedLidar | None, Survey | None, Mapping[int, Callable[[Pose], None]]]:
    """Return the lidar that repeats a log's scans, if there are any, the map of a mapless robot, and its resets by period."""
    record, spec = rollout.record, rollout.record.robot.lidar
    if not len(rollout.scans):
        return None, None, {}
    assert spec is not None
    hz, noisy, task = record.control_hz, record.noise > 0, record.task
    lidar = SimulatedLidar.of(spec, record.world, rollout.trajectories(), seed=record.seed, noisy=noisy, hz=hz)
    if not record.exploring:
        return lidar, None, {}
    tracks_movers = record.perception is not None and record.perception.kind == "lidar"
    tracking = MoverTracking(spec, hz) if tracks_movers else None
    matching = logged_positioning(record)[1].matched and (tracks_movers or not task.world.movers)
    sight = lidar.first(task.start, turning_room(record.robot.radius))
    survey = Survey(record.robot, task.start, task.goal, hz, sight, matching=matching, tracking=tracking)
    return lidar, survey, dict.fromkeys(reset_ticks(record), survey.reset)


def _decided_at_the_end(rollout: Rollout, per_tick: int) -> bool:
    """Return whether the robot ended its drive by a decision in the last row, after a scan."""
    last = len(rollout.t) - 1
    decided = rollout.outcome is Outcome.SUCCEEDED or last in rollout.scan_rows
    return len(rollout.scans) > 0 and last % per_tick == 0 and not len(rollout.contacts) and decided


def _other_scans(rollout: Rollout, scans: npt.NDArray[np.uint16], scan_rows: npt.NDArray[np.int32]) -> Iterator[str]:
    """Yield the first logged scan that differs from its repetition."""
    rows, again = rollout.scan_rows, dict(zip(scan_rows.tolist(), scans, strict=True))
    last = max(again, default=-1)
    for row in sorted({*again, *(row for row in rows.tolist() if row <= last)}):
        at = np.flatnonzero(rows == row)
        if row in again and len(at) == 1 and np.array_equal(again[row], rollout.scans[at[0]]):
            continue
        yield f"replay: scans differ from the lidar at the logged poses, from t = {rollout.t[row]:.3f} s"
        return


def _most(values: Floats) -> float:
    most = float(values.max())
    return most if math.isfinite(most) else math.inf
