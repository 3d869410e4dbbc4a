"""Gaps beside movers that stand still: wide enough for a plan, too narrow for local avoidance.

Planning keeps the safety margin from movers, local avoidance more. A robot that waits before such a gap would be sent
into it again by every replan, so the monitor notes the mover and plans with what avoidance keeps. If there is no other
way, and all movers have stood still since, the robot passes at the safety margin, as it passes a cylinder; a robot that
has to wait nevertheless does not try again.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from antdrive.base import Floats
from antdrive.robots import TrackedPath
from antdrive.sim.driving.blocking import covered_discs
from antdrive.sim.driving.parts import Others
from antdrive.worlds import Disc, Grid

STILL = 0.05  # a mover that stays this close to where it was stands still [m]
LOOK_AHEAD = 3.0  # the route is looked at for this far [m]
STEP = 0.05  # between two points of it [m]
SLACK = 0.05  # avoidance may still refuse a route that passes a mover with this much more than it keeps [m]


class NarrowGaps:
    """The movers beside which the robot has waited for a gap that local avoidance does not enter.

    Attributes:
        keeps: the distance that local avoidance keeps between the robot's centre and a mover's surface [m]
    """

    def __init__(self, grid: Grid, predictor: Others, keeps: float) -> None:
        self.keeps = keeps
        self._grid, self._predictor = grid, predictor
        self._places: dict[int, tuple[float, float]] = {}
        self._widths: dict[int, float] = {}  # what plans keep from their surfaces [m]
        self._passed: set[int] = set()  # those of them that the robot passes at the safety margin
        self._refused: set[int] = set()  # those of them where it had to wait nevertheless
        self._all = np.empty((0, 2))  # where all movers were when the last one was noted

    def note(
        self, tick: int, robot: tuple[float, float], tracked: TrackedPath, arc: float, standing: npt.NDArray[np.int64]
    ) -> None:
        """Note the movers that the route ahead passes hardly farther away than avoidance keeps, or than was noted before."""
        if self.keeps <= self._grid.inflate or not len(standing):
            return
        ahead = np.arange(arc, min(arc + LOOK_AHEAD, tracked.length), STEP)
        route, positions = tracked.route, self._predictor.perceived(tick, robot)[1]
        points = np.stack([np.interp(ahead, route.arc, route.xy[:, k]) for k in (0, 1)], axis=1)
        noted = self.noted(tick, robot)
        for m in standing.tolist():
            gap = np.hypot(*(points - positions[m]).T).min(initial=np.inf) - self._predictor.radius_of(m)
            width = self._widths[m] if m in noted else self.keeps
            if gap < width + SLACK:
                self._widths[m] = max(width, gap + SLACK)
                self._places[m] = (float(positions[m, 0]), float(positions[m, 1]))
                self._all = positions
                if m in self._passed:
                    self._passed.remove(m)
                    self._refused.add(m)

    def noted(self, tick: int, robot: tuple[float, float]) -> npt.NDArray[np.int64]:
        """The movers (N,) that the robot noted and that stand where they stood."""
        positions = self._predictor.perceived(tick, robot)[1]
        self._places = {m: at for m, at in self._places.items() if np.hypot(*(positions[m] - at)) <= STILL}
        self._passed &= self._places.keys()
        self._refused &= self._places.keys()
        return np.array(sorted(self._places), dtype=np.int64)

    def discs(self, tick: int, ends: Floats, only: npt.NDArray[np.int64] | None = None) -> list[Disc]:
        """The noted movers as discs, so much larger that a plan keeps from them what avoidance keeps."""
        noted = self.noted(tick, (float(ends[0, 0]), float(ends[0, 1])))
        wanted = np.setdiff1d(noted if only is None else np.intersect1d(noted, only), list(self._passed))
        found: list[Disc] = []
        for m in wanted:
            wider = self._widths[int(m)] - self._grid.inflate
            found += covered_discs(self._predictor, tick, ends, 0.0, self._grid, np.array([m]), wider)
        return found

    def may_pass(self, tick: int, robot: tuple[float, float], standing: npt.NDArray[np.int64]) -> bool:
        """Allow the robot to pass the noted movers at the safety margin, if all movers have stood still since."""
        noted = np.setdiff1d(self.noted(tick, robot), [*self._passed, *self._refused])
        perceived, positions = self._predictor.perceived(tick, robot)
        if not len(noted) or not np.isin(perceived, standing).all():
            return False
        if len(positions) != len(self._all):  # a mover has come into sight
            return False
        if not (np.hypot(*(positions - self._all)[perceived].T) <= STILL).all():
            return False
        self._passed |= set(noted.tolist())
        return True

    def closer(self, tick: int, robot: tuple[float, float]) -> Floats:
        """How much closer than usual the robot may come to each mover that it perceives (P,) [m]."""
        perceived = self._predictor.within_range(tick, robot)
        if not self._passed:
            return np.zeros(len(perceived))
        passed = np.isin(perceived, self.noted(tick, robot)) & np.isin(perceived, list(self._passed))
        return np.where(passed, self.keeps - self._grid.inflate, 0.0)
