"""How a path was planned, before the robot sets off: the planner's field on the ground and its best path so far.

A log holds no field. It is planned again from the log's seed, which gives the same iterations.
"""

from __future__ import annotations

import itertools
import math
import zlib
from collections.abc import Iterator
from typing import Any

import numpy as np
import numpy.typing as npt

from antdrive.planners import Iteration, IterativePlanner, Query, load_planner
from antdrive.sim.log.rollout import Rollout
from antdrive.sim.view.film.caption import Values
from antdrive.sim.view.film.video import Shot
from antdrive.worlds import Grid, InputError, rasterise

Picture = npt.NDArray[np.uint8]  # (H, W, 3)
Floats = npt.NDArray[np.float64]


def search(rollout: Rollout) -> tuple[Grid, int, Iterator[Iteration]]:
    """The grid of a run, how many iterations its planner was allowed, and these, planned again one at a time.

    Raises:
        InputError: the planner has no iterations, cannot be found, or its plan cannot be repeated.
    """
    record = rollout.record
    name = record.planner.name
    planner = load_planner(name, **record.planner.settings)
    if not isinstance(planner, IterativePlanner):
        raise InputError(f"prelude: {name} does not plan in iterations; there is no field to show")
    if planner.time_budget is not None:
        raise InputError("prelude: the plan was made under a time budget and cannot be repeated")
    grid = rasterise(record.task.world, record.cell, record.inflate)
    rng = np.random.default_rng([record.seed, zlib.crc32(b"planner")])  # as Scenario.rng
    states = itertools.islice(planner.iterate(Query.between(grid, record.task), rng), planner.iterations)
    return grid, planner.iterations, states


def check_field(rollout: Rollout) -> None:
    """Look, before anything is drawn, whether there is a field to show.

    Raises:
        InputError: there is none.
    """
    if next(search(rollout)[2]).landscape is None:
        raise InputError(f"prelude: {rollout.record.planner.name} keeps no field")


def planning_pictures(rollout: Rollout, setting: dict[str, Any], count: int) -> Iterator[Picture]:
    """`count` frames (H, W, 3) of a run's planning from first to last iteration.

    Raises:
        InputError: planning again led to another path.
    """
    grid, total, states = search(rollout)
    still = {**setting, "camera": "oblique" if setting["camera"] == "follow" else setting["camera"]}
    with Shot(rollout, **still, planning=True) as shot:
        number, state = 1, next(states)
        for k in range(count):
            due = math.ceil((k + 1) * total / count)
            for later in itertools.islice(states, due - number):
                number, state = number + 1, later
            assert state.landscape is not None
            levels = field_levels(grid, state.landscape)
            line = grid.xy(state.cells if state.waypoints is None else state.waypoints)
            yield shot.planning(_told(number, total, state), lambda stage: stage.field(grid, levels, line))  # noqa: B023
    if not np.array_equal(state.cells, rollout.cells):
        raise InputError("prelude: planning again led to another path; the log is of another version or machine")


def field_levels(grid: Grid, landscape: Floats) -> Floats:
    """A field (R, C) as 0 to 1 between its low and its high values, NaN where no cell is free.

    The square root keeps weak trails in sight beside strong ones.
    """
    values = np.where(grid.free, np.asarray(landscape, dtype=np.float64), np.nan)
    finite = values[np.isfinite(values)]
    if not len(finite):
        return values
    low, high = np.quantile(finite, (0.02, 0.998))
    return np.asarray(np.sqrt(np.clip((values - low) / max(high - low, 1e-300), 0.0, 1.0)))


def _told(number: int, total: int, state: Iteration) -> Values:
    def metres(value: float) -> str:
        return f"{value:.2f} m" if math.isfinite(value) else "—"

    return [
        (f"{number} / {total}", False),
        (metres(state.best), False),
        (metres(state.iteration_mean), False),
        (str(state.arrived), False),
    ]
