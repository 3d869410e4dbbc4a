"""Bodies of moving obstacles in physics.

Movers are massless multibodies with a velocity: PyBullet integrates the velocity exactly, nothing slows
them down, and the solver pushes the robot away from them instead of letting it sink in.
"""

from __future__ import annotations

from typing import Any, NamedTuple, TypeAlias

import numpy as np

from antdrive.sim.physics.bullet import CHASSIS, OBSTACLE, bullet, drawn_as
from antdrive.worlds.trajectories import Trajectories

SAME_VELOCITY = 1e-10  # velocities closer than this differ by rounding only [m/s]
CHUNK = 480  # physics steps whose velocities are computed at once
PARKED = (0.0, 0.0, -1e3)  # a place where bodies meet nothing [m]

#: A mover's index, its velocity x and y [m/s], and a position to set first [m]
Change: TypeAlias = tuple[int, float, float, tuple[float, float] | None]


class MoverBodies:
    """One body per mover. Its velocity takes it exactly from its position at one step to that at the next.

    Attributes:
        bodies: PyBullet's body numbers, in the movers' order
    """

    def __init__(self, trajectories: Trajectories, hz: int, client: int) -> None:
        p = self._p = bullet()
        self._trajectories, self._hz, self._client = trajectories, hz, client
        self._half_heights = [max(height, 0.05) / 2 for height in trajectories.heights.tolist()]
        self._chunk = _Chunk.of(trajectories, hz, 0)
        self.bodies: list[int] = []
        drawn = drawn_as(client)
        for radius, half, (x, y) in zip(
            trajectories.radii.tolist(), self._half_heights, self._chunk.positions, strict=True
        ):
            shape = p.createCollisionShape(p.GEOM_CYLINDER, radius=radius, height=2 * half, physicsClientId=client)
            # Unlike an obstacle, a mover must be awake, and it would not move with maximal coordinates.
            body = p.createMultiBody(0, shape, drawn, basePosition=(x, y, half), physicsClientId=client)
            p.setCollisionFilterGroupMask(body, -1, OBSTACLE, CHASSIS, physicsClientId=client)
            self.bodies.append(body)

    def park(self) -> None:
        """Take all movers out of the world, at rest."""
        for m, body in enumerate(self.bodies):
            self._p.resetBasePositionAndOrientation(body, PARKED, (0, 0, 0, 1), physicsClientId=self._client)
            self._set_velocity(m, 0.0, 0.0)

    def restart(self) -> None:
        """Put all movers where they are at time 0."""
        self._chunk = _Chunk.of(self._trajectories, self._hz, 0)
        for m, (x, y) in enumerate(self._chunk.positions):
            self._set_position(m, x, y)

    def steer(self, step: int) -> None:
        """Set the velocities that change with physics step number `step`, and carry out jumps."""
        if step >= self._chunk.end:
            self._chunk = _Chunk.of(self._trajectories, self._hz, step)
        for m, vx, vy, jump in self._chunk.changes.get(step, ()):
            if jump is not None:
                self._set_position(m, *jump)
            self._set_velocity(m, vx, vy)

    def _set_position(self, m: int, x: float, y: float) -> None:
        position = (x, y, self._half_heights[m])
        self._p.resetBasePositionAndOrientation(self.bodies[m], position, (0, 0, 0, 1), physicsClientId=self._client)

    def _set_velocity(self, m: int, vx: float, vy: float) -> None:
        self._p.resetBaseVelocity(self.bodies[m], (vx, vy, 0), (0, 0, 0), physicsClientId=self._client)


class _Chunk(NamedTuple):
    """The changes of velocity during a number of steps, computed at once."""

    end: int  # the first step after the chunk
    positions: list[Any]  # (x, y) of each mover at the chunk's first step [m]
    changes: dict[int, list[Change]]  # by physics step

    @classmethod
    def of(cls, trajectories: Trajectories, hz: int, first: int) -> _Chunk:
        """The steps from `first` on. The first step sets all velocities, later steps those that change."""
        t = np.arange(first, first + CHUNK + 2) / hz
        positions = trajectories.positions(t)
        velocity = np.diff(positions, axis=0) * hz
        jumps = trajectories.jumps(t)
        # In the step of a jump, a body starts from where its next velocity would have brought it from.
        velocity[:-1] = np.where(jumps[:-1, :, None], velocity[1:], velocity[:-1])
        came_from = positions[1:] - velocity / hz
        changed = np.ones(jumps[:-1].shape, dtype=np.bool_)
        differs = (np.abs(np.diff(velocity[:-1], axis=0)) > SAME_VELOCITY).any(axis=2)
        changed[1:] = differs | jumps[:-2] | jumps[1:-1]
        changes: dict[int, list[Change]] = {}
        for k, m in np.argwhere(changed).tolist():
            # The first step of a chunk also sets positions, so that rounding errors do not add up.
            jump = tuple(came_from[k, m].tolist()) if k == 0 or jumps[k, m] else None
            changes.setdefault(first + k, []).append((m, *velocity[k, m].tolist(), jump))
        return cls(first + CHUNK, [tuple(position) for position in positions[0].tolist()], changes)
