"""Movers as a robot perceives and predicts them: those that it is given, or lidar tracks."""

from __future__ import annotations

import abc
import math
from collections.abc import Callable
from typing import TYPE_CHECKING, TypeAlias

import numpy as np
import numpy.typing as npt

from antdrive.base import Floats, Point
from antdrive.robots.control.observation import NOBODY, Movers
from antdrive.sim.policy import Perception

if TYPE_CHECKING:
    from antdrive.sim.driving.mover_tracking import MoverTracking
    from antdrive.sim.sensing.tracking import TrackedMovers

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

    @property
    @abc.abstractmethod
    def count(self) -> int:
        """Number of movers so far."""

    @abc.abstractmethod
    def radius_of(self, mover: int) -> float:
        """Return the radius of a mover [m]."""

    @abc.abstractmethod
    def name_of(self, mover: int) -> str:
        """Return the name of a mover in messages."""

    def perceived(self, tick: int, position: Point) -> tuple[Numbers, Floats]:
        """Return the numbers (P,) of the perceived movers, and all positions by number (M, 2) [m]; nan where unknown."""
        numbers, places, _, _ = self._now(tick)
        everywhere = np.full((self.count, 2), np.nan)
        everywhere[numbers] = places
        return self.within_range(tick, position), everywhere

    def predict(self, tick: int, position: Point, ahead: Floats) -> tuple[Floats, Floats]:
        """Return the positions (K, M, 2) [m] of the perceived movers at times ahead (K,) [s], and their radii (M,) [m]."""
        _, places, velocities, radii = self._near(tick, position)
        # Flat rows: numpy takes longer for pairs of numbers.
        flat = places.reshape(-1) + ahead[:, None] * velocities.reshape(-1)
        return flat.reshape(len(ahead), -1, 2), radii

    def near(self, tick: int, position: Point) -> Movers:
        """Return the perceived movers, with the observed velocities."""
        return Movers(*self._near(tick, position))

    def velocities(self, tick: int, position: Point) -> Floats:
        """Return the observed velocities of the perceived movers (M, 2) [m/s]."""
        return self.near(tick, position).velocities

    def within_range(self, tick: int, position: Point) -> Numbers:
        """Return the numbers (P,) of the perceived movers."""
        return self._near(tick, position)[0]

    def _near(
        self, tick: int, position: Point, observed: Floats | None = None
    ) -> tuple[Numbers, Floats, Floats, Floats]:
        numbers, places, velocities, radii = self._now(tick)
        velocities = velocities if observed is None else observed
        if self._perception.range == math.inf:
            return numbers, places, velocities, radii
        near = np.hypot(*(places - position).T) - radii <= self._perception.range
        return numbers[near], places[near], velocities[near], radii[near]


class Given(PerceivedMovers):
    """Movers whose positions and velocities, or motions, the robot is given.

    Args:
        perception: what it is given, and within which range
        hz: control periods per second
        count: number of all movers
        motions: positions (K, M, 2) [m] of all movers at times (K,) [s], if it is given their motions
    """

    def __init__(
        self, perception: Perception, hz: int, count: int, motions: Callable[[Floats], Floats] | None = None
    ) -> None:
        super().__init__(perception, hz)
        self.uncertain = perception.kind in ("velocities", "lidar")
        self._count, self._motions, self._given = count, motions, NOBODY

    def read(self, movers: Movers) -> None:
        """Note the movers that the robot is given in this control period."""
        self._given = movers

    def predict(self, tick: int, position: Point, ahead: Floats) -> tuple[Floats, Floats]:
        """Return the positions (K, M, 2) [m] of the perceived movers at times ahead (K,) [s], and their radii (M,) [m]."""
        if self._motions is None:
            return super().predict(tick, position, ahead)
        perceived, _, _, radii = self._near(tick, position)
        return np.ascontiguousarray(self._motions(ahead + tick / self._hz)[:, perceived]), radii

    def near(self, tick: int, position: Point) -> Movers:
        """Return the perceived movers, with the velocities also of those that are predicted to stay."""
        return Movers(*self._near(tick, position, self._given.velocities))

    def radius_of(self, mover: int) -> float:
        """Return the radius of a mover [m]."""
        return float(self._given.radii[self._given.numbers == mover][0])

    def name_of(self, mover: int) -> str:
        """Return the name of a mover in messages."""
        return f"movers[{mover}]"

    @property
    def count(self) -> int:
        """Number of movers so far."""
        return self._count

    def _now(self, tick: int) -> tuple[Numbers, Floats, Floats, Floats]:
        numbers, places, velocities, radii = self._given
        return numbers, places, np.zeros_like(velocities) if self._perception.kind == "positions" else velocities, radii


class Tracked(PerceivedMovers):
    """Movers tracked by a lidar, numbered in the order of detection.

    Attributes:
        tracking: the tracks
    """

    def __init__(self, tracking: MoverTracking, perception: Perception, hz: int) -> None:
        super().__init__(perception, hz)
        self.tracking = tracking

    @property
    def count(self) -> int:
        """Number of movers so far."""
        return self.tracking.tracker.tracks_begun

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
