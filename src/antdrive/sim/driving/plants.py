"""Plants: a robot in physics that logs every step, and a kinematic robot."""

from __future__ import annotations

import itertools
import math

import numpy as np

from antdrive.base import Pose
from antdrive.base.errors import FieldError
from antdrive.robots import RobotSpec, Twist, footprint_clearance
from antdrive.robots.clearance import kernel_shape
from antdrive.robots.noise import moved
from antdrive.sim.driving import _kernels_movers
from antdrive.sim.driving.parts import Drive, Ending
from antdrive.sim.log.ending import rows_after_contact
from antdrive.sim.physics.engine import Engine, State
from antdrive.worlds import World

STEP = 2e-4  # longest motion of a footprint point between two poses that a kinematic robot checks [m]


class Bullet:
    """Robot in a physics engine, placed at a pose. It logs one row per physics step.

    Attributes:
        state: true pose and velocity in the last row

    Raises:
        FieldError: the control rate does not divide the physics rate.
    """

    def __init__(self, engine: Engine, start: Pose, control_hz: int) -> None:
        self.per_tick, rest = divmod(engine.physics_hz, control_hz)
        if rest or self.per_tick < 1:
            raise FieldError("control_hz", f"must divide the physics rate {engine.physics_hz}, got {control_hz}")
        self._engine = engine
        engine.place(start)
        self.state: State = engine.state()
        self._motion: list[bytes] = []  # of each step
        self._in_force: list[tuple[float, ...]] = [(0.0, 0.0, 0, 0.0, 0.0)]  # command, limiter and motor targets
        self._lengths = [1]  # number of rows of each
        self._rows = 1
        self._contacts: list[tuple[float, ...]] = []
        self._start = [*self.state]
        self._contacts += [(0, *contact) for contact in engine.contacts()]

    @property
    def touched(self) -> bool:
        """Whether the robot has touched anything so far."""
        return bool(self._contacts)

    def advance(self, command: Twist, actuated: Twist, limiter: int = 0) -> None:
        """Drive for one control period."""
        self._engine.command(*actuated)
        self._log(self.per_tick, (*command, limiter, *actuated))

    def _log(self, steps: int, in_force: tuple[float, ...]) -> None:
        self.state, contacts = self._engine.advance(steps, self._motion)
        if contacts:
            self._contacts += [(self._rows + step, *contact) for step, contact in contacts]
        self._rows += steps
        self._in_force.append(in_force)
        self._lengths.append(steps)

    def finish(self, ending: Ending) -> Drive:
        """Return the whole log. After a contact the robot brakes first."""
        if self.touched:
            self._engine.command(0.0, 0.0)
            self._log(rows_after_contact(self._engine.physics_hz), (0.0, 0.0, self._in_force[-1][2], 0.0, 0.0))
        engine = self._engine
        states = np.concatenate([[self._start], engine.states(self._motion)])
        in_force = np.repeat(np.array(self._in_force, dtype=np.float64), self._lengths, axis=0)
        t = np.arange(self._rows) / engine.physics_hz
        pose, twist = np.ascontiguousarray(states[:, :3]), np.ascontiguousarray(states[:, 3:])
        clearance = footprint_clearance(engine.world, engine.robot.footprint, pose)
        movers = engine.mover_track(len(t))
        contacts = np.array(self._contacts, dtype=np.float64).reshape(-1, 4)
        if engine.trajectories:
            shape = kernel_shape(engine.robot.footprint)
            _kernels_movers.lower_by_movers(pose, *shape, movers, engine.trajectories.radii, clearance)
        return Drive(
            outcome=ending.outcome,
            reason=ending.reason,
            t=t,
            pose=pose,
            twist=twist,
            command=np.ascontiguousarray(in_force[:, :2]),
            clearance=clearance,
            limiter=in_force[:, 2].astype(np.uint8),
            movers=movers,
            contacts=contacts,
            actuated=np.ascontiguousarray(in_force[:, 3:]),
            physics=engine.audit(),
        )


class Kinematic:
    """Kinematic robot: follows its commands exactly.

    Attributes:
        state: pose and velocity
        touched: whether its footprint touched the world in the last control period
        way: the poses (K, 3) of that period [m, m, rad]
        poses: the pose at the start and after each control period [m, m, rad]

    Args:
        start: the first pose
        period: control period [s]
        robot: the robot
        world: the obstacles that end its drive, checked each `STEP`; None: none
    """

    def __init__(self, start: Pose, period: float, robot: RobotSpec, world: World | None = None) -> None:
        self._period, self._robot, self._world = period, robot, world
        self.state, self.touched = State(*start, 0.0, 0.0), False
        self.way, self.poses = np.array([start]), [start]

    def advance(self, command: Twist, actuated: Twist, limiter: int = 0) -> None:
        """Drive for one control period."""
        count, (speed, yaw_rate) = 1, actuated
        if self._world is not None:
            longest = (abs(speed) + abs(yaw_rate) * self._robot.radius) * self._period
            count = max(1, math.ceil(longest / STEP))
        time = self._period / count
        part = Twist(time * speed, time * yaw_rate)
        way = list(itertools.accumulate(itertools.repeat(part, count), moved, initial=self.state.pose))[1:]
        self.state = State(*way[-1], *actuated)
        self.poses.append(way[-1])
        self.way = np.array(way)
        if self._world is not None:
            self.touched = bool((footprint_clearance(self._world, self._robot.footprint, self.way) <= 0).any())
