"""Which world to try next: at random, or guided by how close the drives so far came to a failure."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from types import MappingProxyType

import numpy as np

from antdrive.worlds import Floats, Point

FIRST = 12  # random worlds before the guided search uses what it knows
LUCKY = 0.03  # a least clearance below this was mostly chance, and does not make a world more promising [m]
PUSH, PUSHED = (0.8, 0.99), 0.8  # fraction of the push that a step takes, and how likely each cylinder is pushed
STEP = (0.003, 0.06)  # standard deviation of the change of one cylinder's coordinates: from millimetres to a cell
EXPLORING = 0.15  # fraction of random worlds later on
COLUMNS, ROWS = 8, 6  # cells of the archive, along and across the arena


@dataclass(frozen=True)
class Probe:
    """A world that was tried.

    Attributes:
        point: its coordinates (D,), from 0 to 1
        place: where the robot had least clearance, in fractions of the arena's length and width
        score: how far the drive was from failing [m]: its least clearance; 0 for a failure
        push: the change of the coordinates (D,) that moves the cylinders near the route towards it, until all the
            clearance that the plan need not keep is used up
    """

    point: Floats
    place: Point
    score: float
    push: Floats


class WorldSearch(ABC):
    """Proposes points of a unit cube, and is told how close the worlds there came to a failure."""

    def __init__(self, dimensions: int, rng: np.random.Generator) -> None:
        self._dimensions, self._rng = dimensions, rng

    @abstractmethod
    def ask(self) -> Floats:
        """The coordinates (D,) of the world to try next, from 0 to 1."""

    def tell(self, probe: Probe) -> None:  # noqa: B027 - a search may learn nothing
        """Learn from a world that was tried.

        Args:
            probe: the world and how its drive went
        """


class RandomSearch(WorldSearch):
    """Every world is drawn at random, independently of all others."""

    def ask(self) -> Floats:
        """A random point (D,)."""
        return self._rng.random(self._dimensions)


@dataclass
class _Elite:
    """The world of a cell that came closest to a failure, and how often it was varied since."""

    probe: Probe
    varied: int = field(default=0)


class GuidedSearch(WorldSearch):
    """Varies the worlds that came closest to a failure, one for each place of the least clearance (MAP-Elites).

    After J.-B. Mouret, J. Clune, *Illuminating search spaces by mapping elites*, 2015. A step pushes cylinders near
    the route towards it, as far as the plan allows, and moves one cylinder a little. The plan mostly stays as it is, with
    nothing left but what it must keep, so that a near miss becomes a nearer one. A cell whose world has failed is
    not varied any more: its neighbours fail in the same way, and failures that differ are wanted.
    """

    def __init__(self, dimensions: int, rng: np.random.Generator) -> None:
        super().__init__(dimensions, rng)
        self._elites: dict[tuple[int, int], _Elite] = {}
        self._told = 0

    def ask(self) -> Floats:
        """A random point (D,) at first, and now and then later; else a step from the nearest miss."""
        open_cells = [elite for _, elite in sorted(self._elites.items()) if elite.probe.score > 0]
        if self._told < FIRST or not open_cells or self._rng.random() < EXPLORING:
            return self._rng.random(self._dimensions)
        parent = min(open_cells, key=lambda elite: max(elite.probe.score, LUCKY) * (1 + elite.varied))
        parent.varied += 1
        return self._varied(parent.probe)

    def tell(self, probe: Probe) -> None:
        """Keep a world that came closer to a failure than the others with their least clearance in its cell.

        Args:
            probe: the world and how its drive went
        """
        self._told += 1
        cell = (int(min(probe.place[0], 0.999) * COLUMNS), int(min(probe.place[1], 0.999) * ROWS))
        known = self._elites.get(cell)
        if known is None or probe.score < known.probe.score:
            self._elites[cell] = _Elite(probe)

    def _varied(self, probe: Probe) -> Floats:
        rng, low, high = self._rng, *np.log(STEP)
        one = 3 * int(rng.integers(self._dimensions // 3))
        pushed = rng.random(self._dimensions // 3) < PUSHED
        step = probe.push * np.repeat(pushed, 3) * rng.uniform(*PUSH)
        step[one : one + 3] += math.exp(rng.uniform(low, high)) * rng.standard_normal(3)
        found = probe.point + step
        return np.asarray(1.0 - np.abs(1.0 - np.abs(found) % 2.0))  # reflected at the faces of the cube


#: The methods of search by name.
METHODS: Mapping[str, Callable[[int, np.random.Generator], WorldSearch]] = MappingProxyType(
    {"guided": GuidedSearch, "random": RandomSearch}
)
