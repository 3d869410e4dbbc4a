"""Physics bodies of movers.

Movers are massless multibodies with a velocity. PyBullet integrates the velocity exactly, nothing slows them down, and the
solver pushes the robot out of them. Each body costs time at every physics step, however distant, so only movers that the
robot could soon meet have one.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple, TypeAlias

import numpy as np
import numpy.typing as npt

from antdrive.base.types import Floats
from antdrive.sim.physics.bodies import Bodies, Point3, size_of
from antdrive.sim.physics.bullet import CHASSIS, OBSTACLE, bullet, drawn_as
from antdrive.worlds.trajectories import Trajectories
from antdrive.worlds.world import World

SAME_VELOCITY = 1e-10  # velocities within this differ by rounding only [m/s]
CHUNK = 480  # physics steps whose velocities are computed together
WINDOW = 60  # physics steps between updates of the bodies; divides CHUNK
MARGIN = 0.2  # a mover that could come this close to the robot's circumscribed circle has a body [m]
HOLD = 0.3  # additional distance at which a body is parked [m]

#: A mover's index, its velocity x and y [m/s], and a position to set first [m]
Change: TypeAlias = tuple[int, float, float, tuple[float, float] | None]


class MoverBodies:
    """Bodies of the movers near the robot. Velocities take them exactly from one step's position to the next."""

    def __init__(
        self,
        world: World,
        trajectories: Trajectories,
        radius: float,
        speed: float,
        where: Callable[[], tuple[float, float]],
        hz: int,
        bodies: Bodies,
    ) -> None:
        p, client = bullet(), bodies.client
        self._p, self._client, self._bodies = p, client, bodies
        self._trajectories, self._hz = trajectories, hz
        self._radius, self._speed, self._where = radius, speed, where
        self._first = len(world.obstacles)  # contact index of the first mover
        sizes = [size_of(mover) for mover in world.movers]
        shapes = {
            size: p.createCollisionShape(p.GEOM_CYLINDER, radius=size[0], height=size[1], physicsClientId=client)
            for size in dict.fromkeys(sizes)
        }
        self._shapes, self._heights = [shapes[size] for size in sizes], [height for _, height in sizes]
        self._chunk = _Chunk.of(trajectories, hz, 0)
        self._past = [self._chunk.positions]
        self._drawn = drawn_as(client)

    @property
    def held(self) -> dict[int, int]:
        """Body numbers by mover index, for the movers with a body."""
        held, movers = self._bodies.held, range(len(self._shapes))
        return {m: held[self._first + m] for m in movers if self._first + m in held}

    def park(self) -> None:
        """Park all bodies."""
        for m in self.held:
            self._park(m)

    def restart(self) -> None:
        """Place the movers at their positions at time 0."""
        self._chunk = _Chunk.of(self._trajectories, self._hz, 0)
        self._past = [self._chunk.positions]
        self.park()
        self._choose(0)

    def steer(self, step: int) -> None:
        """Set the velocities that change at a physics step, and carry out jumps."""
        if step % WINDOW == 0:
            if step >= self._chunk.end:
                self._chunk = _Chunk.of(self._trajectories, self._hz, step)
                self._past.append(self._chunk.positions)
            self._choose(step)
        for m, vx, vy, jump in self._chunk.changes.get(step, ()):
            if self._first + m in self._bodies.held:
                if jump is not None:
                    self._bodies.move(self._first + m, self._place(m, jump))
                self._set_velocity(m, vx, vy)

    def positions(self, step: int) -> Floats:
        """Return the positions of all movers before a physics step (M, 2) [m]: those of bodies where they exist."""
        places = self.trajectory(step).copy()
        for m, body in self.held.items():
            places[m] = self._p.getBasePositionAndOrientation(body, self._client)[0][:2]
        return places

    def trajectory(self, step: int) -> Floats:
        """Return the positions of the trajectories before a physics step (M, 2) [m]."""
        chunk = self._chunk
        if chunk.first <= step < chunk.end:
            return np.asarray(chunk.positions[step - chunk.first])
        return np.asarray(self._trajectories.positions(step / self._hz)[0])

    def track(self, steps: int) -> Floats:
        """Return the positions of all movers before each of the first steps since the restart (steps, M, 2) [m]."""
        while sum(map(len, self._past)) < steps:
            chunk = _Chunk.of(self._trajectories, self._hz, CHUNK * len(self._past))
            self._past.append(chunk.positions)
        return np.concatenate(self._past)[:steps]

    def _choose(self, step: int) -> None:
        """Keep bodies for the movers that the robot can meet in the window beginning at `step`."""
        chunk, w = self._chunk, (step - self._chunk.first) // WINDOW
        robot = np.array(self._where())
        # Before a contact the robot drives at its own speed; after one, a mover may push it at the mover's speed. In the step of
        # a jump the body begins off the trajectory, by the mover's travel in that step.
        travel = (self._speed * WINDOW + chunk.fastest[w] * (WINDOW + 1)) / self._hz
        off = np.maximum(np.maximum(chunk.low[w] - robot, robot - chunk.high[w]), 0.0)
        away = np.hypot(off[:, 0], off[:, 1]) - self._trajectories.radii - self._radius - travel
        held = self.held
        for m in held:
            if away[m] > MARGIN + HOLD:
                self._park(m)
        for m in np.flatnonzero(away <= MARGIN).tolist():
            if m not in held:
                self._add(m, step)

    def _add(self, m: int, step: int) -> None:
        position, velocity = self._chunk.state(m, step)
        place = self._place(m, position)
        if not self._bodies.reuse(self._first + m, self._shapes[m], place):
            self._create(m, place)
        self._set_velocity(m, *velocity)

    def _create(self, m: int, place: Point3) -> None:
        p, shape, client = self._p, self._shapes[m], self._client
        # Unlike an obstacle, a mover must be awake; with maximal coordinates it would not move.
        body = p.createMultiBody(0, shape, self._drawn, basePosition=place, physicsClientId=client)
        p.setCollisionFilterGroupMask(body, -1, OBSTACLE, CHASSIS, physicsClientId=client)
        self._bodies.add(self._first + m, body, shape)

    def _park(self, m: int) -> None:
        self._set_velocity(m, 0.0, 0.0)
        self._bodies.park(self._first + m)

    def _place(self, m: int, position: tuple[float, float]) -> Point3:
        return (*position, self._heights[m] / 2)

    def _set_velocity(self, m: int, vx: float, vy: float) -> None:
        body = self._bodies.held[self._first + m]
        self._p.resetBaseVelocity(body, (vx, vy, 0), (0, 0, 0), physicsClientId=self._client)


class _Chunk(NamedTuple):
    """Motions of the movers over a number of steps."""

    first: int  # the first step
    end: int  # the first step after the chunk
    hz: int  # physics steps per simulated second
    positions: Floats  # positions before each step (K, M, 2) [m]
    changes: dict[int, list[Change]]  # velocity changes by physics step
    changed: npt.NDArray[np.bool_]  # whether a mover's velocity is set in a step (K, M)
    repositioned: npt.NDArray[np.bool_]  # whether its position is set as well (K, M)
    velocity: Floats  # velocity to the next position (K, M, 2) [m/s]
    came_from: Floats  # starting position of that velocity (K, M, 2) [m]
    low: Floats  # least x and y of each mover in each window (W, M, 2) [m]
    high: Floats  # greatest x and y [m]
    fastest: list[float]  # highest speed of any mover in each window [m/s]

    @classmethod
    def of(cls, trajectories: Trajectories, hz: int, first: int) -> _Chunk:
        """Compute the steps from `first` on. The first step sets all velocities, later steps those that change."""
        t = np.arange(first, first + CHUNK + 2) / hz
        positions = trajectories.positions(t)
        velocity = np.diff(positions, axis=0) * hz
        jumps = trajectories.jumps(t)
        if jumps.any():  # In the step of a jump, a body starts one step back along its next velocity.
            velocity[:-1] = np.where(jumps[:-1, :, None], velocity[1:], velocity[:-1])
        came_from = positions[1:] - velocity / hz
        changed = np.ones(jumps[:-1].shape, dtype=np.bool_)
        differs = np.abs(velocity[1:-1] - velocity[:-2]) > SAME_VELOCITY
        changed[1:] = differs[..., 0] | differs[..., 1] | jumps[:-2] | jumps[1:-1]
        # The first step of a chunk also sets positions, so that rounding does not accumulate.
        repositioned = jumps[:-1].copy()
        repositioned[0] = True
        changes: dict[int, list[Change]] = {}
        for k, m in np.argwhere(changed).tolist():
            jump = tuple(came_from[k, m].tolist()) if repositioned[k, m] else None
            changes.setdefault(first + k, []).append((m, *velocity[k, m].tolist(), jump))
        windows = (CHUNK // WINDOW, WINDOW, len(trajectories), 2)
        begin, end = positions[:-2].reshape(windows), positions[WINDOW:-1:WINDOW]  # a window's last step ends there
        low, high = np.minimum(begin.min(axis=1), end), np.maximum(begin.max(axis=1), end)
        squares = velocity[:-1].reshape(windows) ** 2
        fastest = np.sqrt((squares[..., 0] + squares[..., 1]).max(axis=(1, 2), initial=0.0)).tolist()
        return cls(
            first, first + CHUNK, hz, positions[:-2], changes, changed, repositioned, velocity[:-1], came_from[:-1],
            low, high, fastest,
        )  # fmt: skip

    def state(self, m: int, step: int) -> tuple[tuple[float, float], tuple[float, float]]:
        """Return position [m] and velocity [m/s] of a mover's body before a step, bit for bit as if it had always existed."""
        k = step - self.first
        begin = int(np.flatnonzero(self.repositioned[: k + 1, m])[-1])
        latest = np.maximum.accumulate(np.where(self.changed[: k + 1, m], np.arange(k + 1), 0))
        velocity = self.velocity[latest, m]
        moves = np.vstack([self.came_from[begin, m], velocity[begin:k] * (1.0 / self.hz)])
        x, y = np.add.accumulate(moves, axis=0)[-1].tolist()
        vx, vy = velocity[k].tolist()
        return (x, y), (vx, vy)
