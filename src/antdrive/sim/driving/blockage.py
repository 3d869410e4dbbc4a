"""When waiting cannot help: movers that stand still close every way to the goal."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import numpy.typing as npt

from antdrive.base import Floats, Pose
from antdrive.base.plane import place_name
from antdrive.planners import Query
from antdrive.planners.graph.search import reachable
from antdrive.sim.driving.blocking import covered_discs, with_obstacles
from antdrive.sim.driving.mover_gaps import STILL, NarrowGaps
from antdrive.sim.driving.parts import Others
from antdrive.worlds import Grid, Task, rasterise

LOOK = 1.0  # predictions are checked this often for a mover that sets out again [s]


class Blockage:
    """Counts the searches for a route that failed because movers that stand still close every way.

    A mover that moves may open a way, so it never counts. While the same movers stand where they stood at the first
    such failure, each further search waits twice as long as the one before.

    Attributes:
        failures: failed searches in a row
        reason: which mover stands where, once the robot has no patience left; empty before
        gaps: the movers beside which there is too little room for local avoidance
    """

    def __init__(
        self,
        task: Task,
        grid: Grid,
        predictor: Others,
        hz: int,
        *,
        interval: float,
        patience: float,
        keeps: float = 0.0,
    ) -> None:
        self.failures, self.reason = 0, ""
        self.gaps = NarrowGaps(grid, predictor, keeps)
        self._task, self._grid, self._predictor, self._hz = task, grid, predictor, hz
        self._interval, self._patience = interval, patience
        self._since = self._due = -math.inf
        self._standing: npt.NDArray[np.int64] = np.empty(0, dtype=np.int64)
        self._places = np.empty((0, 2))

    def pause(self, tick: int, robot: tuple[float, float]) -> bool:
        """Whether a search now would only repeat the last one."""
        if not self.failures:
            return False
        if not self._still_there(tick, robot):
            self.found()
            return False
        return tick / self._hz < self._due

    def found(self) -> None:
        """Take note that there is a way, or that there may be one soon."""
        self.failures = 0

    def failed(self, tick: int, pose: Pose) -> None:
        """Take note that a search from a pose [m, m, rad] found no route."""
        now, robot = tick / self._hz, pose[:2]
        standing = self.standing(tick, robot)
        if self.failures and not self._closed(tick, pose, np.intersect1d(standing, self._standing)):
            self.found()
        if not self.failures:
            if not self._closed(tick, pose, standing):
                return
            self._since, self._standing = now, standing
            self._places = self._predictor.perceived(tick, robot)[1][standing]
        self.failures += 1
        if now - self._since >= self._patience:
            self.reason = self._sentence(tick, pose)
        wait = self._interval * 2.0 ** min(self.failures - 1, 30)
        self._due = min(now + wait, max(self._since + self._patience, now + self._interval))

    def may_pass(self, tick: int, robot: tuple[float, float]) -> bool:
        """Whether the robot now passes through a gap at the safety margin that it waited before; not at the first failure."""
        return self.failures > 0 and self.gaps.may_pass(tick, robot, self.standing(tick, robot))

    def standing(self, tick: int, robot: tuple[float, float]) -> npt.NDArray[np.int64]:
        """The movers (S,) that the robot perceives and predicts to stand still for as long as its patience lasts."""
        perceived = self._predictor.within_range(tick, robot)
        ahead = np.linspace(0.0, self._patience, 1 + math.ceil(self._patience / LOOK))
        positions, _ = self._predictor.predict(tick, robot, ahead)
        return np.asarray(perceived[np.hypot(*np.moveaxis(positions - positions[0], -1, 0)).max(axis=0) <= STILL])

    def _still_there(self, tick: int, robot: tuple[float, float]) -> bool:
        """Whether the robot sees all movers that it noted at the first failure where they stood."""
        perceived, positions = self._predictor.perceived(tick, robot)
        near = np.hypot(*(positions[self._standing] - self._places).T) <= STILL
        return bool(near.all() and np.isin(self._standing, perceived).all())

    def _closed(self, tick: int, pose: Pose, movers: npt.NDArray[np.int64]) -> bool:
        """Whether these movers alone close every way that is open without them."""
        return bool(len(movers)) and self._way(tick, pose, movers[:0]) and not self._way(tick, pose, movers)

    def _way(self, tick: int, pose: Pose, movers: npt.NDArray[np.int64], narrow: bool = False) -> bool:
        """Whether the grid has a way from a pose to the goal among these movers; `narrow`: even one that is refused."""
        task = dataclasses.replace(self._task, start=pose)
        ends: Floats = np.array([pose[:2], task.goal])
        discs = covered_discs(self._predictor, tick, ends, 0.0, self._grid, only=movers)
        discs += [] if narrow else self.gaps.discs(tick, ends, only=movers)
        world = with_obstacles(task, discs).world
        return reachable(Query.between(rasterise(world, self._grid.cell, self._grid.inflate), task))

    def _sentence(self, tick: int, pose: Pose) -> str:
        """The nearest mover without which there is a way, else the nearest of all; where it stands, how long for."""
        _, positions = self._predictor.perceived(tick, pose[:2])
        order = self._standing[np.argsort(np.hypot(*(positions[self._standing] - pose[:2]).T), kind="stable")]
        alone = (m for m in order.tolist() if self._way(tick, pose, order[order != m]))
        mover = next(alone, int(order[0]))
        at = place_name(self._task.frame, *positions[mover].tolist())
        narrow = mover in self.gaps.noted(tick, pose[:2]) and self._way(tick, pose, order, narrow=True)
        closes = (
            f"leaves a gap too narrow for local avoidance, which keeps the robot's centre {self.gaps.keeps:.3g} m from it"
            if narrow
            else "closes the way"
        )
        return (
            f"{self._predictor.name_of(mover)} stands still at {at} and {closes}; "
            f"no route to the goal for {self._patience:g} s, in {self.failures} attempts"
        )
