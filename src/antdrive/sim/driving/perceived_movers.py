"""Movers as a robot perceives and predicts them: ground truth, or lidar tracks."""

from __future__ import annotations

import abc
import math
from typing import TYPE_CHECKING, TypeAlias

import numpy as np
import numpy.typing as npt

from antdrive.base import Floats, Point
from antdrive.sim.policy import Perception
from antdrive.worlds import Trajectories

if TYPE_CHECKING:
    from antdrive.sim.driving.survey import MoverTracking
    from antdrive.sim.sensing.tracking import TrackedMovers

CHUNK = 240  # control periods whose positions and velocities are computed at once
STANDS = 0.08  # tracks slower than this stand still [m/s]

#: Numbers (P,) that identify movers.
Numbers: TypeAlias = npt.NDArray[np.int64]


class PerceivedMovers(abc.ABC):
    """Perceived movers within range, predicted at constant velocity.

    Attributes:
        uncertain: whether movers may deviate from their prediction
    """

    uncertain = True

    def __init__(self, perception: Perception, hz: int) -> None:
        self._perception, self._hz = perception, hz

    @abc.abstractmethod
    def _now(self, tick: int) -> tuple[Numbers, Floats, Floats, Floats]:
        """Return the numbers (M,) of all movers in a tick, positions (M, 2) [m], velocities (M, 2) [m/s] and radii (M,) [m]."""

    @abc.abstractmethod
    def perceived(self, tick: int, position: Point) -> tuple[Numbers, Floats]:
        """Return the numbers (P,) of the perceived movers, and all positions by number (M, 2) [m]; nan where unknown."""

    @abc.abstractmethod
    def radius_of(self, mover: int) -> float:
        """Return the radius of a mover [m]."""

    @abc.abstractmethod
    def name_of(self, mover: int) -> str:
        """Return the name of a mover in messages."""

    def predict(self, tick: int, position: Point, ahead: Floats) -> tuple[Floats, Floats]:
        """Return the positions (K, M, 2) [m] of the perceived movers at times ahead (K,) [s], and their radii (M,) [m]."""
        _, places, velocities, radii = self._near(tick, position)
        # Flat rows: numpy takes longer for pairs of numbers.
        flat = places.reshape(-1) + ahead[:, None] * velocities.reshape(-1)
        return flat.reshape(len(ahead), -1, 2), radii

    def velocities(self, tick: int, position: Point) -> Floats:
        """Return the observed velocities of the perceived movers (M, 2) [m/s]."""
        return self._near(tick, position)[2]

    def within_range(self, tick: int, position: Point) -> Numbers:
        """Return the numbers (P,) of the perceived movers."""
        return self._near(tick, position)[0]

    def _near(self, tick: int, position: Point) -> tuple[Numbers, Floats, Floats, Floats]:
        numbers, places, velocities, radii = self._now(tick)
        if self._perception.range == math.inf:
            return numbers, places, velocities, radii
        near = np.hypot(*(places - position).T) - radii <= self._perception.range
        return numbers[near], places[near], velocities[near], radii[near]


class GroundTruth(PerceivedMovers):
    """Ground-truth positions, velocities or motions of movers."""

    def __init__(self, trajectories: Trajectories, perception: Perception, hz: int) -> None:
        super().__init__(perception, hz)
        self.uncertain = perception.kind in ("velocities", "lidar")
        self._trajectories, self._everyone = trajectories, np.arange(len(trajectories.radii))
        self._first, self._positions, self._velocities = 0, np.empty((0, 0, 2)), np.empty((0, 0, 2))

    def predict(self, tick: int, position: Point, ahead: Floats) -> tuple[Floats, Floats]:
        """Return the positions (K, M, 2) [m] of the perceived movers at times ahead (K,) [s], and their radii (M,) [m]."""
        if self._perception.kind != "motions":
            return super().predict(tick, position, ahead)
        perceived, _, _, radii = self._near(tick, position)
        positions = self._trajectories.positions(ahead + tick / self._hz)
        return np.ascontiguousarray(positions[:, perceived]), radii

    def velocities(self, tick: int, position: Point) -> Floats:
        """Return the velocities of the perceived movers (M, 2) [m/s]; those of exact positions, since the last period."""
        if self._perception.kind != "positions":
            return super().velocities(tick, position)
        perceived, places, _, _ = self._near(tick, position)
        before = self._trajectories.positions(np.array([max(tick - 1, 0) / self._hz]))[0, perceived]
        return np.asarray((places - before) * self._hz)

    def perceived(self, tick: int, position: Point) -> tuple[Numbers, Floats]:
        """Return the numbers (P,) of the perceived movers, and all positions (M, 2) [m]."""
        return self.within_range(tick, position), self._now(tick)[1]

    def radius_of(self, mover: int) -> float:
        """Return the radius of a mover [m]."""
        return float(self._trajectories.radii[mover])

    def name_of(self, mover: int) -> str:
        """Return the name of a mover in messages."""
        return f"movers[{mover}]"

    def _now(self, tick: int) -> tuple[Numbers, Floats, Floats, Floats]:
        if not self._first <= tick < self._first + len(self._positions):
            t = np.arange(tick, tick + CHUNK) / self._hz
            self._first, self._positions = tick, self._trajectories.positions(t)
            still = self._perception.kind == "positions"
            self._velocities = np.zeros_like(self._positions) if still else self._trajectories.velocities(t)
        row = tick - self._first
        return self._everyone, self._positions[row], self._velocities[row], self._trajectories.radii


class Tracked(PerceivedMovers):
    """Movers tracked by a lidar, numbered in the order of detection.

    Attributes:
        tracking: the tracks
    """

    def __init__(self, tracking: MoverTracking, perception: Perception, hz: int) -> None:
        super().__init__(perception, hz)
        self.tracking = tracking

    def perceived(self, tick: int, position: Point) -> tuple[Numbers, Floats]:
        """Return the numbers (P,) of the tracked movers, and all positions (M, 2) [m]; nan for lost tracks."""
        numbers, places, _, _ = self._now(tick)
        everywhere = np.full((self.tracking.tracker.tracks_begun, 2), np.nan)
        everywhere[numbers] = places
        return self.within_range(tick, position), everywhere

    def visible(self, tick: int) -> Floats:
        """Return the positions of the movers hit by the last scan (N, 2) [m], in a tick; hidden movers are omitted."""
        return self._now(tick)[1][self._tracks.met]

    def radius_of(self, mover: int) -> float:
        """Return the radius of a tracked mover [m]."""
        return float(self._tracks.radii[self._tracks.numbers == mover][0])

    def name_of(self, mover: int) -> str:
        """Return the name of a mover in messages."""
        return f"tracked mover {mover}"

    @property
    def _tracks(self) -> TrackedMovers:
        """The movers at the last scan."""
        return self.tracking.tracker.movers()

    def _now(self, tick: int) -> tuple[Numbers, Floats, Floats, Floats]:
        tracks = self._tracks
        velocities = np.where(np.hypot(*tracks.velocities.T)[:, None] < STANDS, 0.0, tracks.velocities)
        places = tracks.positions + (tick - self.tracking.tick) / self._hz * velocities
        return tracks.numbers, places, velocities, tracks.radii
