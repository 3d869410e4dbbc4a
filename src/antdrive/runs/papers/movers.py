"""Robots that decide cell by cell among obstacles of one cell that go to a random free neighbouring cell, as in hasan."""

from __future__ import annotations

import dataclasses
import time
from collections.abc import Mapping
from typing import Any

import numpy as np
import numpy.typing as npt

from antdrive.planners import (
    Cell,
    OnlineAgent,
    Planner,
    PlannerError,
    PlanResult,
    PlanStatus,
    Query,
    agent_for,
    load_planner,
)
from antdrive.planners.plan import path_cost
from antdrive.runs.papers import maps
from antdrive.runs.papers.baselines import total_cost
from antdrive.runs.papers.trials import Trial
from antdrive.worlds import DIRECTIONS, Grid

DECISIONS = 5000  # after so many a drive has failed


class Strollers:
    """Movers of one cell each that go to a random free neighbouring cell in every step."""

    def __init__(self, grid: Grid, count: int, rng: np.random.Generator, away: tuple[Cell, ...]) -> None:
        """Put movers on random free cells."""
        self._grid, self._rng = grid, rng
        free = [tuple(map(int, cell)) for cell in np.argwhere(grid.free)]
        chosen = rng.permutation(len(free))
        self._cells = [free[i] for i in chosen if free[i] not in away][:count]

    @property
    def cells(self) -> npt.NDArray[np.int64]:
        """The cells that movers are in (N, 2)."""
        return np.array(self._cells, dtype=np.int64).reshape(-1, 2)

    def step(self, robot: Cell) -> None:
        """Move each to a free neighbouring cell other than the robot's, if there is one."""
        for n, (r, c) in enumerate(self._cells):
            moves = int(self._grid.moves[r, c])
            near = [(r + dr, c + dc) for k, (dr, dc) in enumerate(DIRECTIONS) if moves >> k & 1]
            draw = self._rng.random()  # one number per step, whatever the robot does
            near = [cell for cell in near if cell != robot and cell not in self._cells]
            if near:
                self._cells[n] = near[int(draw * len(near))]


class TimedAgent:
    """An agent whose decisions are timed, the movers' steps left out: `cpu_s` is their processor time so far [s]."""

    def __init__(self, agent: OnlineAgent, spent: float) -> None:
        """Time an agent."""
        self._agent, self.cpu_s = agent, spent

    @property
    def cell(self) -> Cell:
        """The robot's cell."""
        return self._agent.cell

    @property
    def arrived(self) -> bool:
        """Whether the robot is at the goal."""
        return self._agent.arrived

    def step(self, blocked: npt.ArrayLike) -> Cell | None:
        """The agent's decision."""
        started = time.process_time()
        to = self._agent.step(blocked)
        self.cpu_s += time.process_time() - started
        return to


def drive(
    robot: OnlineAgent | TimedAgent, query: Query, movers: Strollers, name: str = "", limit: int = DECISIONS
) -> list[Cell]:
    """The cells that a robot goes through, start included; the last is the goal if it arrives within the decisions.

    Raises:
        PlannerError: the robot went into a mover, or made a move that is not allowed.
    """
    cells, name = [robot.cell], name or type(robot).__name__
    for _ in range(limit):
        if robot.arrived:
            break
        movers.step(robot.cell)
        before, to = robot.cell, robot.step(movers.cells)
        if to is None:
            continue
        step = DIRECTIONS.index((to[0] - before[0], to[1] - before[1]))
        if not int(query.grid.moves[before]) >> step & 1:
            raise PlannerError(name, f"went from {before} to {to}, a move that is not allowed")
        if list(to) in movers.cells.tolist():
            raise PlannerError(name, f"went from {before} to {to}, into a mover")
        cells.append(to)
    return cells


def drive_among(planner: str | Planner, options: Mapping[str, Any], query: Query, seed: int, count: int) -> Trial:
    """Drive once, cell by cell, among movers; the trial's path is the one that was driven."""
    chosen = load_planner(planner, **options) if isinstance(planner, str) else planner
    movers = Strollers(query.grid, count, np.random.default_rng([seed, count]), (query.start, query.goal))
    started = time.process_time()
    robot = agent_for(chosen, query, np.random.default_rng(seed))
    timed = TimedAgent(robot, time.process_time() - started)
    path = np.array(
        drive(timed, query, movers, planner if isinstance(planner, str) else type(planner).__name__), dtype=np.int32
    )
    result = PlanResult(
        status=PlanStatus.SOLVED if robot.arrived else PlanStatus.STOPPED,
        cells=path,
        cost=path_cost(path, query.grid.cell),
        reason=robot.note if robot.arrived else f"not at the goal after {DECISIONS} decisions",
        work=robot.stats.propagated,
        work_unit="cells",
    )
    if not result.solved:
        result = dataclasses.replace(result, cells=path[:0], cost=float("inf"))
    return Trial(seed, seed, result, maps.optimum(query), timed.cpu_s, total_cost(query, result))
