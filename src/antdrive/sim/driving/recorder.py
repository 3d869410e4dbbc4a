"""The log of one drive: a row per physics step, and what follows from the rows."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from antdrive.base import Floats, Pose
from antdrive.robots import Twist, footprint_clearance
from antdrive.robots.footprint import shape_of
from antdrive.sim.driving import _kernels_movers
from antdrive.sim.log.contacts import touches
from antdrive.sim.log.outcome import Outcome
from antdrive.sim.physics.engine import Contact, Engine, State
from antdrive.worlds import Trajectories


class Ending(NamedTuple):
    """How a drive ends.

    Attributes:
        outcome: the kind of ending
        reason: what the outcome's sentence leaves open; may be empty
    """

    outcome: Outcome
    reason: str = ""


@dataclass(frozen=True, eq=False)
class Drive:
    """What a drive logged: T rows, one per physics step; row 0 is the start.

    Attributes:
        outcome: how the drive ended
        reason: what the outcome's sentence leaves open; may be empty
        t: times since the start (T,) [s]
        pose: true poses of the axle's centre (T, 3) [m, m, rad]
        twist: measured speeds and yaw rates (T, 2) [m/s, rad/s]
        command: the commands that were in force when a row was reached (T, 2) [m/s, rad/s]
        clearance: distances from the footprint to the nearest obstacle, mover or wall (T,) [m]
        limiter: what held the speed (T,), an index into `LIMITERS`
        movers: positions of the movers (T, M, 2) [m]
        contacts: one line per contact (K, 4): row, obstacle, distance [m], force [N]
        estimate: estimated poses (T, 3) [m, m, rad]; (0, 3) where the robot knows its pose exactly
        actuated: the twists that the wheels' motors were set to (T, 2) [m/s, rad/s]; (0, 2) where they are the commands
    """

    outcome: Outcome
    reason: str
    t: Floats
    pose: Floats
    twist: Floats
    command: Floats
    clearance: Floats
    limiter: np.ndarray[tuple[int], np.dtype[np.uint8]]
    movers: Floats
    contacts: Floats
    estimate: Floats
    actuated: Floats


class Recorder:
    """Steps an engine and records a row per physics step.

    Attributes:
        state: the robot's true pose and velocity in the last row
    """

    def __init__(self, engine: Engine, start: Pose, *, noisy: bool) -> None:
        self._engine = engine
        engine.place(start)
        self.state: State = engine.state()
        self._rows: list[tuple[float, ...]] = [(*self.state, 0.0, 0.0, 0, 0.0, 0.0)]
        self._contacts: list[tuple[float, ...]] = []
        self._add_contacts(engine.contacts())
        # The error of the estimate in each row. Between two measurements it stays the same.
        self._errors: list[tuple[float, float, float]] | None = [(0.0, 0.0, 0.0)] if noisy else None

    @property
    def touched(self) -> bool:
        """Whether the robot has touched anything so far."""
        return bool(self._contacts)

    def note_estimate(self, estimate: Pose) -> None:
        """Record where a noisy robot estimates to be in the last row."""
        x, y, yaw = self.state.pose
        assert self._errors is not None
        turned = math.remainder(estimate[2] - yaw, 2 * math.pi)
        self._errors[-1] = (estimate[0] - x, estimate[1] - y, turned)

    def advance(self, steps: int, command: Twist, limiter: int, actuated: Twist | None = None) -> None:
        """Advance a number of physics steps; the rows show the command and the limiter in force."""
        in_force = (*command, limiter, *(actuated or command))
        engine, rows = self._engine, self._rows
        for _ in range(steps):
            contacts = engine.step()
            self.state = engine.state()
            rows.append((*self.state, *in_force))
            if contacts:
                self._add_contacts(contacts)
        if self._errors is not None:
            self._errors += [self._errors[-1]] * steps

    def finish(self, ending: Ending) -> Drive:
        """The whole log. A collision is attributed to the robot or to the mover."""
        engine, rows = self._engine, np.array(self._rows)
        t = np.arange(len(rows)) / engine.physics_hz
        pose, twist = np.ascontiguousarray(rows[:, :3]), np.ascontiguousarray(rows[:, 3:5])
        clearance = footprint_clearance(engine.world, engine.robot.footprint, pose)
        movers = engine.mover_track(len(t))
        contacts = np.array(self._contacts, dtype=np.float64).reshape(-1, 4)
        if engine.trajectories:
            shape = shape_of(engine.robot.footprint)
            _kernels_movers.lower_by_movers(pose, *shape, movers, engine.trajectories.radii, clearance)
            if ending.outcome is Outcome.COLLIDED:
                ending = _attribute(engine, engine.trajectories, t, pose, twist, movers, contacts)
        return Drive(
            outcome=ending.outcome,
            reason=ending.reason,
            t=t,
            pose=pose,
            twist=twist,
            command=np.ascontiguousarray(rows[:, 5:7]),
            clearance=clearance,
            limiter=rows[:, 7].astype(np.uint8),
            movers=movers,
            contacts=contacts,
            estimate=np.empty((0, 3)) if self._errors is None else pose + np.array(self._errors),
            actuated=np.empty((0, 2)) if self._errors is None else np.ascontiguousarray(rows[:, 8:10]),
        )

    def _add_contacts(self, contacts: list[Contact]) -> None:
        self._contacts += [(len(self._rows) - 1, *contact) for contact in contacts]


def _attribute(
    engine: Engine,
    trajectories: Trajectories,
    t: Floats,
    pose: Floats,
    twist: Floats,
    movers: Floats,
    contacts: Floats,
) -> Ending:
    """Attribute the first touch to the robot or to the mover, and name the mover and both speeds."""
    discs = len(engine.world.obstacles)
    first = touches(
        contacts,
        pose,
        twist,
        movers,
        trajectories.jumps(t),
        hz=engine.physics_hz,
        discs=discs,
        radii=trajectories.radii,
        footprint=engine.robot.footprint,
        deceleration=engine.robot.max_acceleration,
    )[0]
    m, before = first.obstacle - discs, max(first.step - 1, 0)
    if not 0 <= m < len(trajectories):
        return Ending(first.outcome)
    speed = math.hypot(*trajectories.velocities(t[before])[0, m])
    reason = f"movers[{m}] at {speed:.2f} m/s, the robot at {abs(twist[before, 0]):.2f} m/s"
    return Ending(first.outcome, reason)
