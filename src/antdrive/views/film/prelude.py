"""Introduction of a film: planning with the planner's field and best path so far.

A log holds no field. Planning again from the log's seed repeats the same iterations.
"""

from __future__ import annotations

import itertools
import math
import zlib
from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple

import numpy as np

from antdrive.base import InputError
from antdrive.base.types import Floats
from antdrive.planners import Iteration, Query, as_iterative
from antdrive.planners.iterative import without_iterations
from antdrive.planners.registry import recorded_planner
from antdrive.sim.log.rollout import Rollout
from antdrive.views.colours import INK, shown_field
from antdrive.views.film.camera import Picture
from antdrive.views.film.film_options import FilmOptions
from antdrive.views.film.overlay import DriveRow
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
    found: int  # iteration of the best path so far
    state: Iteration  # the last of them
    grid: Grid  # the planner's grid
    levels: Floats  # the field (R, C), as `field_levels`
    path: Floats  # the best path so far (N, 2) [m]

    @property
    def best(self) -> str:
        """Length of the best path so far as text."""
        return f"{self.state.best:.2f} m" if math.isfinite(self.state.best) else "—"


def planning_stages(rollout: Rollout, count: int) -> Iterator[PlanningStage]:
    """Yield `count` stages of a run's planning, from the first to the last iteration."""
    grid, total, states = plan_again(rollout)
    number, state, found = 1, next(states), 1
    for k in range(count):
        due = math.ceil((k + 1) * total / count)
        for later in itertools.islice(states, due - number):
            number, found = number + 1, number + 1 if later.best < state.best else found
            state = later
        assert state.field is not None
        path = grid.xy(state.cells if state.waypoints is None else state.waypoints)
        yield PlanningStage(number, total, found, state, grid, field_levels(grid, state.field), path)
    if not np.array_equal(state.cells, rollout.cells):
        raise InputError("prelude: planning again gave another path; the log is from another version or machine")


def planning_frames(
    rollouts: Rollout | Mapping[str, Rollout], setting: Mapping[str, Any], count: int
) -> Iterator[Picture]:
    """Yield frames of planning, from the first to the last iteration; of several runs, the field of the first that has one."""
    several = not isinstance(rollouts, Rollout)
    camera = FilmOptions(**setting).checked(several=several).camera
    shot = Shot(rollouts, **{**setting, "camera": "oblique" if camera == "follow" else camera}, planning=True)
    drives = shot.drives
    shown = {k: next(filter(has_field, drive.logs), None) for k, drive in enumerate(drives)}
    at_work = {k: planning_stages(log, count) for k, log in shown.items() if log is not None}
    for stages in zip(*at_work.values(), strict=True):
        stage_of, first = dict(zip(at_work, stages, strict=True)), stages[0]
        paths = [stage_of[k].path if k in stage_of else drive.rollout.route for k, drive in enumerate(drives)]
        found = "—" if first.best == "—" else str(first.found)
        values = f"{first.number} / {first.total}", first.best, found, str(first.state.arrived)
        rows = [
            DriveRow(drive.names, drive.colour or INK, _facts(stage_of.get(k), drive.planned))
            for k, drive in enumerate(drives)
        ]
        if several:
            yield shot.planning_frame([], first.grid, first.levels, paths, rows)
        else:
            yield shot.planning_frame([(value, False) for value in values], first.grid, first.levels, paths)


def _facts(stage: PlanningStage | None, planned: str) -> tuple[str, ...]:
    """Return the facts of a planner's row."""
    if stage is None:
        return (f"planned {planned} m",)
    return f"iteration {stage.number} of {stage.total}", f"best {stage.best}, found at {stage.found}"


def field_levels(grid: Grid, field: Floats) -> Floats:
    """Scale a planner's field (R, C) to 0 to 1, NaN for blocked cells.

    The square root keeps weak trails visible beside strong ones.
    """
    found = shown_field(grid, field)
    if found is None:
        return np.where(grid.free, 0.0, np.nan)
    values, low, high = found
    return np.asarray(np.sqrt(np.clip((values - low) / (high - low), 0.0, 1.0)))
