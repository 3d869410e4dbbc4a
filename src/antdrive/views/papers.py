"""Figures of the papers, and scenarios on their maps."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, TypeAlias

import numpy as np

from antdrive.base import Pose
from antdrive.runs.papers.experiment import Experiment
from antdrive.runs.papers.paper_runs import PaperRun
from antdrive.sim.scenario import Scenario
from antdrive.views.colours import LabelStyle, label_styles
from antdrive.views.figures.canvas import written
from antdrive.views.figures.paper_figures import ConvergenceCurve, convergence_figure, maps_figure
from antdrive.worlds.formats.cellmap import CellMap, map_task

if TYPE_CHECKING:
    from antdrive.planners import PlanResult, Query

PAINTED = 3  # planners per map
CURVES = 3  # planners per panel of lengths by iteration
CELL = 0.8  # side of a cell of a paper's map [m]: a turtlebot passes between two blocked ones

Measured: TypeAlias = Sequence[tuple[Experiment, list[PaperRun]]]


def draw_figures(papers: Mapping[str, Measured], folder: Path, suffixes: Sequence[str]) -> dict[str, str]:
    """Draw the maps and histories of papers and return the figures' paths by name.

    A planner with its setting has one colour in all of them.
    """
    drawn = {e.name: e.planner for found in papers.values() for e in [*_convergent(found), *_painted(found)]}
    styles = dict(zip(drawn, label_styles(list(drawn), list(drawn.values())), strict=True))
    files: dict[str, str] = {}
    for paper, found in papers.items():
        if curves := _curves(found, styles):
            history = partial(convergence_figure, curves)
            files |= written(f"{paper} history", folder / f"{paper}-history", suffixes, history)
        maps = partial(maps_figure, _drawn(found), styles=styles)
        files |= written(f"{paper} maps", folder / f"{paper}-maps", suffixes, maps)
    return files


def _curves(found: Measured, styles: Mapping[str, LabelStyle]) -> dict[str, list[ConvergenceCurve]]:
    """Return the histories of the first `CURVES` planners with a history, by map."""
    runs = {(e.map, e.name): trials for e, trials in found}
    curves: dict[str, list[ConvergenceCurve]] = {}
    for experiment in _convergent(found):
        trials, counted = runs[experiment.map, experiment.name], math.isfinite(experiment.work)
        curves.setdefault(experiment.map, []).append(
            ConvergenceCurve(
                name=experiment.name,
                style=styles[experiment.name],
                best=[trial.result.history.best for trial in trials],
                maps=np.array([trial.world for trial in trials], dtype=np.int64),
                spent=1e-6 * np.array([trial.work for trial in trials]) if counted else None,
                optimum=float(np.median([trial.optimum for trial in trials])),
                printed=experiment.printed,
                x="million ant steps" if counted else "iteration",
            )
        )
    return curves


def _convergent(found: Measured) -> list[Experiment]:
    """Return the first `CURVES` experiments of each map whose histories show a path."""
    told = [e for e, trials in _printed_first(found) if any(trial.result.history.arrived.any() for trial in trials)]
    return _first_of_each_map(told, CURVES)


def _painted(found: Measured) -> list[Experiment]:
    """Return the first `PAINTED` experiments of each map."""
    # `steps` are the same plans as those of the total costs.
    return _first_of_each_map([e for e, _ in _printed_first(found) if e.name != "steps"], PAINTED)


def _first_of_each_map(experiments: Sequence[Experiment], most: int) -> list[Experiment]:
    return [e for k, e in enumerate(experiments) if sum(e.map == one.map for one in experiments[:k]) < most]


def _printed_first(found: Measured) -> Measured:
    """Return experiments with printed values and, on maps with at most one of them, all experiments."""
    printed = [(e.map, e.name) for e, _ in found if e.printed is not None]
    several = {place for place, _ in printed if sum(place == other for other, _ in printed) > 1}
    return [(e, trials) for e, trials in found if e.printed is not None or e.map not in several]


def _drawn(found: Measured) -> dict[str, tuple[Query, dict[str, PlanResult]]]:
    """Return each experiment's first map with the paths of the median seeds of `PAINTED` planners."""
    runs = {(e.map, e.name): trials for e, trials in found}
    maps_drawn: dict[str, tuple[Query, dict[str, PlanResult]]] = {}
    for experiment in _painted(found):
        trials = runs[experiment.map, experiment.name]
        query = experiment.query(experiment.world(trials[0].seed))
        plans = maps_drawn.setdefault(experiment.map, (query, {}))[1]
        on_it = sorted((t for t in trials if t.world == trials[0].world), key=lambda trial: trial.length)
        plans[experiment.name] = on_it[(len(on_it) - 1) // 2].result
    return maps_drawn


def experiment_scenario(experiment: Experiment) -> Scenario:
    """Return the scenario of an experiment on cells: a drive on its first map, planned by its planner and options."""
    query = experiment.query(0)
    (r0, c0), (r1, c1) = query.start, query.goal
    start: Pose = ((c0 + 0.5) * CELL, (r0 + 0.5) * CELL, math.atan2(r1 - r0, c1 - c0))
    goal = ((c1 + 0.5) * CELL, (r1 + 0.5) * CELL)
    task = map_task(CellMap(query.grid.free, CELL, (0.0, 0.0)), start, goal, name=experiment.map)
    return Scenario.of(task, experiment.planner, options=experiment.options, seed=0)
