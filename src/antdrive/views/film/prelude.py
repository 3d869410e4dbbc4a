"""Introduction of a film: planning with the planner's field and best path so far.

A log holds no field. Planning again from the log's seed repeats the same iterations.
"""

from __future__ import annotations

import itertools
import math
import zlib
from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np

from antdrive.base import InputError
from antdrive.base.types import Floats
from antdrive.planners import Iteration, Query, as_iterative
from antdrive.planners.iterative import without_iterations
from antdrive.planners.registry import recorded_planner
from antdrive.sim.log.rollout import Rollout
from antdrive.views.film.camera import Picture
from antdrive.views.film.overlay import Values
from antdrive.views.film.shot import Shot
from antdrive.worlds import Grid, rasterise


def plan_again(rollout: Rollout) -> tuple[Grid, int, Iterator[Iteration]]:
    """Repeat a run's planning and return its grid, the maximum number of iterations, and the iterations lazily."""
    record = rollout.record
    name = record.planner.name
    loaded = recorded_planner(name, **record.planner.settings)
    planner = as_iterative(loaded)
    if planner is None:
        raise InputError(f"prelude: {without_iterations(loaded, name)}")
    if planner.time_budget is not None:
        raise InputError("prelude: a plan under a time budget cannot be repeated")
    grid = rasterise(record.task.world, record.cell, record.inflate)
    rng = np.random.default_rng([record.seed, zlib.crc32(b"planner")])  # as Scenario.rng
    states = itertools.islice(planner.iterate(Query.between(grid, record.task), rng), planner.iterations)
    return grid, planner.iterations, states


def check_field(rollout: Rollout) -> None:
    """Raise `InputError` unless a run's planner has a field."""
    if next(plan_again(rollout)[2]).field is None:
        raise InputError(f"prelude: {rollout.record.planner.name} has no field; set the `field` of each Iteration")


def has_field(rollout: Rollout) -> bool:
    """Return whether a run's planning can be shown."""
    try:
        check_field(rollout)
    except InputError:
        return False
    return True


class PlanningStage(NamedTuple):
    """What a frame of planning shows."""

    number: int  # iterations so far
    total: int  # maximum number of iterations
    state: Iteration  # the last of them
    grid: Grid  # the planner's grid
    levels: Floats  # the field (R, C), as `field_levels`
    path: Floats  # the best path so far (N, 2) [m]


def planning_stages(rollout: Rollout, count: int) -> Iterator[PlanningStage]:
    """Yield `count` stages of a run's planning, from the first to the last iteration."""
    grid, total, states = plan_again(rollout)
    number, state = 1, next(states)
    for k in range(count):
        due = math.ceil((k + 1) * total / count)
        for later in itertools.islice(states, due - number):
            number, state = number + 1, later
        assert state.field is not None
        path = grid.xy(state.cells if state.waypoints is None else state.waypoints)
        yield PlanningStage(number, total, state, grid, field_levels(grid, state.field), path)
    if not np.array_equal(state.cells, rollout.cells):
        raise InputError("prelude: planning again gave another path; the log is from another version or machine")


def planning_frames(rollout: Rollout, setting: dict[str, Any], count: int) -> Iterator[Picture]:
    """Yield frames of a run's planning, from the first to the last iteration."""
    still = {**setting, "camera": still_camera(setting["camera"])}
    shot = Shot(rollout, **still, planning=True)
    for one in planning_stages(rollout, count):
        yield shot.planning_frame(_values(one.number, one.total, one.state), one.grid, one.levels, one.path)


def still_camera(camera: str) -> str:
    """Return the camera that shows planning before a drive shown by `camera`."""
    return "oblique" if camera == "follow" else camera


def field_levels(grid: Grid, field: Floats) -> Floats:
    """Scale a planner's field (R, C) to 0 to 1, NaN for blocked cells.

    The square root keeps weak trails visible beside strong ones.
    """
    values = np.where(grid.free, np.asarray(field, dtype=np.float64), np.nan)
    finite = values[np.isfinite(values)]
    if not len(finite):
        return values
    low, high = np.quantile(finite, (0.02, 0.998))
    return np.asarray(np.sqrt(np.clip((values - low) / max(high - low, 1e-300), 0.0, 1.0)))


def _values(number: int, total: int, state: Iteration) -> Values:
    """Format the band's numbers, named by `PLAN_FIELDS`."""

    def metres(value: float) -> str:
        return f"{value:.2f} m" if math.isfinite(value) else "—"

    return [
        (f"{number} / {total}", False),
        (metres(state.best), False),
        (metres(state.iteration_mean), False),
        (str(state.arrived), False),
    ]
