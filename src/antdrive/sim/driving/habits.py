"""Prediction of movers by the ways that movers took before.

Constant velocity is wrong wherever a mover turns. Movers in buildings take the same ways again, in both directions: maps of
dynamics (T. P. Kucner et al., *Survey of maps of dynamics for mobile robots*, IJRR 42, 2023). A mover may go on as one did
before at the same place with the same velocity. With the opposite velocity it may go back where that one came from.
"""

from __future__ import annotations

import itertools
import math
from typing import NamedTuple

import numpy as np

from antdrive.base import Floats, Point
from antdrive.sim.driving.perceived_movers import STANDS, PerceivedMovers

PERIOD = 0.1  # between two remembered positions [s]
AGO = 2.0  # younger positions are no memory [s]
NEAR = 0.25  # a mover is where one was before within this distance [m]
ALIKE = 0.3  # and if both velocities differ by at most this fraction of its speed
APART = 0.15  # a way counts if it leads this far from other predictions of its mover [m]
AHEAD = 100  # most positions of a way ahead
REACH = 5.0  # movers count within this distance of the robot, and the travel of two seconds [m]
KEPT = 100  # positions remembered in a square of side `NEAR`, the latest


class Way(NamedTuple):
    """Way that a mover may take.

    Attributes:
        number: of the mover
        points: positions along it, from where the mover is (N, 2) [m]
        period: time between them at the mover's speed [s]
        since: time of the first point [s]
    """

    number: int
    points: Floats
    period: float
    since: float

    def at(self, times: Floats) -> Floats:
        """Return the positions (K, 2) [m] at times (K,) [s]; beyond its end the way goes straight on."""
        along = (times - self.since) / self.period
        k = np.minimum(along.astype(np.int64), len(self.points) - 2)
        share = (along - k)[:, None]
        return np.asarray((1 - share) * self.points[k] + share * self.points[k + 1])


class Habits:
    """Remembered ways of movers, and those that movers near the robot may take again.

    Args:
        movers: the perceived movers
        hz: control periods per second
    """

    def __init__(self, movers: PerceivedMovers, hz: int) -> None:
        self._movers = movers
        self._every = max(1, round(PERIOD * hz))  # control periods
        self._period = self._every / hz  # [s]
        self._old = round(AGO / self._period)
        self._ways: list[tuple[int, list[Point]]] = []  # movers, and positions without a gap
        self._latest: dict[int, tuple[int, int]] = {}  # the way on which a mover was last, and when [control periods]
        self._squares: dict[tuple[int, int], list[tuple[int, int]]] = {}  # way and index of its positions by square
        self._known: list[Way] = []

    def predict(self, ahead: Floats, places: Floats) -> tuple[Floats, Floats]:
        """Return other positions (K, G, 2) [m] of movers at times ahead (K,) [s], and these movers' radii (G,) [m].

        Call it in every control period. `places` (K, M, 2) are those at constant velocity.
        """
        movers, radii = self._movers, self._movers.near.radii
        if movers.tick % self._every == 0:
            self._observe()
        index = {number: m for m, number in enumerate(movers.near.numbers.tolist())}
        others: list[tuple[int, Floats]] = []
        for way in self._known:
            if way.number in index:
                there, m = way.at(movers.t + ahead), index[way.number]
                same = (places[:, m], *(other for number, other in others if number == m))
                if all(np.hypot(*(there - other).T).max() > APART for other in same):
                    others.append((m, there))
        if not others:
            return places[:, :0], radii[:0]
        return np.stack([there for _, there in others], axis=1), radii[[m for m, _ in others]]

    def _observe(self) -> None:
        """Remember where the perceived movers are, and recall what those near the robot may do."""
        movers = self._movers
        self._known = []
        for number, (x, y), velocity, _ in zip(*(part.tolist() for part in movers.near), strict=True):
            speed = math.hypot(*velocity)
            taken = self._way_of(number, movers.tick, (x, y), speed)
            way = self._ways[taken][1]
            if speed >= STANDS:
                square = self._squares.setdefault((math.floor(x / NEAR), math.floor(y / NEAR)), [])
                square.append((taken, len(way)))
                del square[:-KEPT]
            way.append((x, y))
            if speed >= STANDS and math.dist((x, y), movers.position) <= REACH + 2 * speed:
                for forwards in (True, False):
                    points, pace = self._recalled(number, (x, y), velocity, forwards)
                    if len(points) > 1:
                        moved = np.array(points) + (np.array((x, y)) - points[0])
                        self._known.append(Way(number, moved, self._period * pace, movers.t))

    def _way_of(self, number: int, tick: int, place: Point, speed: float) -> int:
        """Return the index of a mover's way: a new one after a gap in time or a jump."""
        taken, latest = self._latest.get(number, (-1, tick))
        if latest != tick - self._every or math.dist(self._ways[taken][1][-1], place) > NEAR + 2 * speed * self._period:
            taken = len(self._ways)
            self._ways.append((number, []))
        self._latest[number] = taken, tick
        return taken

    def _recalled(self, number: int, place: Point, velocity: list[float], forwards: bool) -> tuple[list[Point], float]:
        """Return how a mover once went on from a place with a velocity, or came there with the opposite, and its pace.

        A mover's own ways come first, then the nearest. The pace is its speed then, as a multiple of its speed now.
        """
        (x, y), speed, sign = place, math.hypot(*velocity), 1 if forwards else -1
        best, found = (True, math.inf), None
        column, row = math.floor(x / NEAR), math.floor(y / NEAR)
        for square in itertools.product((column - 1, column, column + 1), (row - 1, row, row + 1)):
            for one, k in self._squares.get(square, ()):
                mover, way = self._ways[one]
                if not 0 < k < len(way) - (self._old if forwards else 1):
                    continue
                rank = mover != number, math.dist(way[k], place)
                if rank[1] > NEAR or rank >= best:
                    continue
                (ax, ay), (bx, by) = way[k - 1], way[k + 1]
                vx, vy = (bx - ax) / (2 * self._period), (by - ay) / (2 * self._period)
                if math.dist((sign * vx, sign * vy), velocity) <= ALIKE * speed:
                    best, found = rank, (way, k, math.hypot(vx, vy) / speed)
        if found is None:
            return [], 1.0
        way, k, pace = found
        return way[k : k + AHEAD] if forwards else way[max(0, k - AHEAD) : k + 1][::-1], pace
