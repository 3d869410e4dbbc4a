"""What a robot knows of movers, and where it expects them."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal, TypeAlias, get_args

import numpy as np
import numpy.typing as npt

from antdrive.worlds import Floats, Trajectories
from antdrive.worlds.errors import FieldError

Told: TypeAlias = Literal["positions", "velocities", "motions"]
CHUNK = 240  # instants worked out at once


@dataclass(frozen=True, kw_only=True)
class Perception:
    """What a robot is told of movers, without error, at every control period.

    `positions`: where they are; they are expected to stay. `velocities`: how they move, too; they are expected to move
    on so. `motions`: where they will be at any time, turns and jumps included. Each of those only whose surface is
    within `reach` of the robot's centre.

    Raises:
        ValueError: an unknown kind, or a reach that is not positive.
    """

    told: Told = "velocities"
    reach: float = math.inf  # [m]

    def __post_init__(self) -> None:
        if self.told not in get_args(Told):
            raise FieldError("told", f"unknown {self.told!r}; choose from {', '.join(get_args(Told))}")
        if not self.reach > 0:
            raise FieldError("reach", f"must be greater than 0, got {self.reach:g}")


class Predictor:
    """The movers of one drive, as the robot knows them, at multiples of its control period."""

    def __init__(self, traffic: Trajectories, knowledge: Perception, hz: int) -> None:
        self.traffic, self._knowledge, self._hz = traffic, knowledge, hz
        self._first, self._places, self._speeds = 0, np.empty((0, 0, 2)), np.empty((0, 0, 2))

    def expected(self, tick: int, robot: tuple[float, float], ahead: Floats) -> tuple[Floats, Floats]:
        """Where movers are expected (K, M, 2) [m] `ahead` (K,) [s] of a tick, and their radii (M,) [m]."""
        places, speeds = self._now(tick)
        seen = self.sensed(tick, robot)
        if self._knowledge.told == "motions":
            places = self.traffic.positions(ahead + tick / self._hz)
            return np.ascontiguousarray(places[:, seen]), self.traffic.radii[seen]
        if self._knowledge.told == "positions":
            speeds = np.zeros_like(speeds)
        return places[seen] + ahead[:, None, None] * speeds[seen], self.traffic.radii[seen]

    def sensed(self, tick: int, robot: tuple[float, float]) -> npt.NDArray[np.int64]:
        """Which movers (S,) are within reach."""
        away = np.hypot(*(self._now(tick)[0] - robot).T) - self.traffic.radii
        return np.flatnonzero(away <= self._knowledge.reach)

    def _now(self, tick: int) -> tuple[Floats, Floats]:
        if not self._first <= tick < self._first + len(self._places):
            t = np.arange(tick, tick + CHUNK) / self._hz
            self._first, self._places, self._speeds = tick, self.traffic.positions(t), self.traffic.velocities(t)
        return self._places[tick - self._first], self._speeds[tick - self._first]
