"""Movers as a robot perceives and predicts them: those that it is given, or lidar tracks."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

from antdrive.base import Floats
from antdrive.robots.control.observation import NOBODY, Movers, Observation
from antdrive.sim.policy import Perception

if TYPE_CHECKING:
    from antdrive.sim.driving.mover_tracking import MoverTracking

STANDS = 0.08  # tracks slower than this stand still [m/s]


class PerceivedMovers:
    """Movers that a robot is given, as it perceives them in a control period, predicted at constant velocity.

    Attributes:
        uncertain: whether movers may deviate from their prediction
        tick: the number of the control period
        t: its time since the start [s]
        position: where the robot is when its command takes effect [m]
        near: the perceived movers, with the observed velocities

    Args:
        perception: what the robot is given, and within which range
        count: number of all movers
        motions: positions (K, M, 2) [m] of all movers at times (K,) [s], if it is given their motions
    """

    def __init__(
        self, perception: Perception, count: int = 0, motions: Callable[[Floats], Floats] | None = None
    ) -> None:
        self.uncertain = perception.kind in ("velocities", "lidar")
        self._perception, self._count, self._motions = perception, count, motions
        self.near = self._all = NOBODY

    def read(self, now: Observation) -> None:
        """Note a control period, observed with the pose when its command takes effect."""
        self.tick, self.t, self.position = now.tick, now.t, now.pose[:2]
        self.near = self._all = movers = self._everybody(now)
        if self._perception.range != math.inf and len(movers.numbers):
            near = np.hypot(*(movers.positions - self.position).T) - movers.radii <= self._perception.range
            self.near = Movers(*(part[near] for part in movers))

    def _everybody(self, now: Observation) -> Movers:
        return now.movers

    @property
    def count(self) -> int:
        """Number of movers so far."""
        return self._count

    @property
    def places(self) -> Floats:
        """Positions of all movers by number (M, 2) [m]; nan where unknown."""
        everywhere = np.full((self.count, 2), np.nan)
        everywhere[self._all.numbers] = self._all.positions
        return everywhere

    def predict(self, ahead: Floats) -> Floats:
        """Return the positions (K, P, 2) [m] of the perceived movers at times ahead (K,) [s]."""
        numbers, places, velocities, _ = self.near
        if self._motions is not None:
            return np.ascontiguousarray(self._motions(ahead + self.t)[:, numbers])
        if self._perception.kind == "positions":
            velocities = np.zeros_like(velocities)
        # Flat rows: numpy takes longer for pairs of numbers.
        flat = places.reshape(-1) + ahead[:, None] * velocities.reshape(-1)
        return flat.reshape(len(ahead), -1, 2)

    def name_of(self, mover: int) -> str:
        """Return the name of a mover in messages."""
        return f"movers[{mover}]"


class Tracked(PerceivedMovers):
    """Movers tracked by a lidar, numbered in the order of detection.

    Attributes:
        tracking: the tracks
    """

    def __init__(self, tracking: MoverTracking, perception: Perception) -> None:
        super().__init__(perception)
        self.tracking, self.uncertain = tracking, True

    @property
    def count(self) -> int:
        """Number of movers so far."""
        return self.tracking.tracker.tracks_begun

    @property
    def visible(self) -> Floats:
        """Positions of the movers hit by the last scan (N, 2) [m]; hidden movers are omitted."""
        return self._all.positions[self.tracking.tracker.movers().met]

    def name_of(self, mover: int) -> str:
        """Return the name of a mover in messages."""
        return f"tracked mover {mover}"

    def _everybody(self, now: Observation) -> Movers:
        tracks, tracking = self.tracking.tracker.movers(), self.tracking
        velocities = np.where(np.hypot(*tracks.velocities.T)[:, None] < STANDS, 0.0, tracks.velocities)
        places = tracks.positions + (now.tick - tracking.tick) / tracking.hz * velocities
        return Movers(tracks.numbers, places, velocities, tracks.radii)
