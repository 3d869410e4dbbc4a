"""What a robot perceives of movers, and the prediction that follows from it."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from antdrive.base import Floats
from antdrive.sim.policy import Perception
from antdrive.worlds import Trajectories

CHUNK = 240  # control periods whose positions and velocities are computed at once


class Told:
    """Movers by ground truth: positions, velocities or motions, within range.

    Attributes:
        trajectories: the movers' true motions
    """

    def __init__(self, trajectories: Trajectories, perception: Perception, hz: int) -> None:
        self.trajectories, self._perception, self._hz = trajectories, perception, hz
        self._everyone = np.arange(len(trajectories.radii))
        self._first, self._positions, self._velocities = 0, np.empty((0, 0, 2)), np.empty((0, 0, 2))

    @property
    def guesses(self) -> bool:
        """Whether the robot sees velocities but does not know what movers do next."""
        return self._perception.kind in ("velocities", "lidar")

    def predict(self, tick: int, robot: tuple[float, float], ahead: Floats) -> tuple[Floats, Floats]:
        """Predict the movers that the robot perceives.

        Returns:
            The movers' positions (K, M, 2) [m] and radii (M,) [m].
        """
        perceived = self.within_range(tick, robot)
        radii = self.trajectories.radii[perceived]
        if self._perception.kind == "motions":
            positions = self.trajectories.positions(ahead + tick / self._hz)
            return np.ascontiguousarray(positions[:, perceived]), radii
        positions, velocities = self._now(tick)
        if self._perception.kind == "positions":
            velocities = np.zeros_like(velocities)
        return positions[perceived] + ahead[:, None, None] * velocities[perceived], radii

    def perceived(self, tick: int, robot: tuple[float, float]) -> tuple[npt.NDArray[np.int64], Floats]:
        """The indices (P,) of the movers that a robot at a position [m] perceives, and where all movers are (M, 2) [m]."""
        return self.within_range(tick, robot), self._now(tick)[0]

    def within_range(self, tick: int, robot: tuple[float, float]) -> npt.NDArray[np.int64]:
        """The indices (M,) of the movers that a robot at a position [m] perceives in a tick."""
        if self._perception.range == math.inf:
            return self._everyone
        distances = np.hypot(*(self._now(tick)[0] - robot).T) - self.trajectories.radii
        return np.flatnonzero(distances <= self._perception.range)

    def radius_of(self, mover: int) -> float:
        """The radius of a mover [m]."""
        return float(self.trajectories.radii[mover])

    def name_of(self, mover: int) -> str:
        """What people call a mover."""
        return f"movers[{mover}]"

    def _now(self, tick: int) -> tuple[Floats, Floats]:
        """True positions (M, 2) [m] and velocities (M, 2) [m/s] at a tick."""
        if not self._first <= tick < self._first + len(self._positions):
            t = np.arange(tick, tick + CHUNK) / self._hz
            self._first = tick
            self._positions, self._velocities = self.trajectories.positions(t), self.trajectories.velocities(t)
        return self._positions[tick - self._first], self._velocities[tick - self._first]
