"""What a robot perceives of movers, and the prediction that follows from it."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal, TypeAlias, get_args

import numpy as np
import numpy.typing as npt

from antdrive.base import Floats
from antdrive.base.errors import FieldError
from antdrive.worlds import Trajectories

PerceptionKind: TypeAlias = Literal["positions", "velocities", "motions", "lidar"]
CHUNK = 240  # control periods whose positions and velocities are computed at once


@dataclass(frozen=True, kw_only=True)
class Perception:
    """What the robot perceives of movers in every control period: without error, or what its lidar shows.

    Attributes:
        kind: `positions`: where movers are; the robot predicts that they stay there. `velocities`: their
            velocities too; the robot predicts constant velocity. `motions`: their positions at any time,
            turns and teleports included; the prediction is exact. `lidar`: what is found in the scans of the robot's
            lidar, see `antdrive.sim.sensing.MoverTracker`; the robot predicts constant velocity.
        range: movers are perceived if their surface is within this distance of the robot's centre [m]

    Raises:
        ValueError: an unknown kind, or a range that is not positive.
    """

    kind: PerceptionKind = "velocities"
    range: float = math.inf

    def __post_init__(self) -> None:
        if self.kind not in get_args(PerceptionKind):
            raise FieldError("kind", f"unknown {self.kind!r}; choose from {', '.join(get_args(PerceptionKind))}")
        if not self.range > 0:
            raise FieldError("range", f"must be greater than 0, got {self.range:g}")


def usual_perception(map: str, movers: bool) -> Perception:
    """What a robot perceives of movers where nobody says it by name: without a map nothing but what its lidar finds."""
    return Perception(kind="lidar") if map == "none" and movers else Perception()


class Predictor:
    """Predicts the movers of one drive from what the robot perceives of them.

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
