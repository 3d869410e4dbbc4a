"""Figures of the papers, and a scenario on one of each paper's maps."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np

from antdrive.base import Pose
from antdrive.robots import load_robot
from antdrive.runs.papers import maps
from antdrive.runs.papers.claims import Arm
from antdrive.runs.papers.experiment import Experiment
from antdrive.runs.papers.experiments import PAPERS
from antdrive.runs.papers.maps import HAN_ANTS
from antdrive.runs.papers.paper_runs import PaperRun, solve
from antdrive.sim.scenario import Scenario
from antdrive.views.colours import LabelStyle, label_styles
from antdrive.views.figures.canvas import endings
from antdrive.views.figures.paper_figures import (
    ConvergenceCurve,
    ants_figure,
    convergence_figure,
    maps_figure,
    sweep_figure,
)
from antdrive.worlds import Disc, Task, World
from antdrive.worlds.formats.cellmap import CellMap, map_task

if TYPE_CHECKING:
    from antdrive.planners import PlanResult, Query

PAINTED = 3  # planners per map
CURVES = 3  # planners per panel of lengths by iteration
PC, PM = (0.1, 0.25, 0.5, 0.75, 0.9), (0.05, 0.1, 0.2, 0.4, 0.6)  # crossover, mutation: han2007's sweep
CELL = 0.8  # side of a cell of a paper's map [m]: a turtlebot passes between two blocked ones
HAN_UNIT = 0.7  # unit of han2007 [m]

Measured: TypeAlias = Sequence[tuple[Experiment, list[PaperRun]]]


def draw_figures(papers: Mapping[str, Measured], folder: Path, seeds: int, suffixes: Sequence[str]) -> dict[str, str]:
    """Draw the figures of papers and return their paths by name. A planner with its setting has one colour in all of them.

    There are two figures of length by iteration: `history` shows all seeds with intervals, `run` one run as in the papers.
    """
    drawn = {e.name: e.planner for found in papers.values() for e in [*_convergent(found), *_painted(found)]}
    styles = dict(zip(drawn, label_styles(list(drawn), list(drawn.values())), strict=True))
    files: dict[str, str] = {}
    for paper, found in papers.items():
        files |= _paper_figures(paper, found, folder, seeds, suffixes, styles)
    return files


def _paper_figures(
    paper: str, found: Measured, folder: Path, seeds: int, suffixes: Sequence[str], styles: Mapping[str, LabelStyle]
) -> dict[str, str]:
    files: dict[str, str] = {}
    curves = _curves(found, styles)
    for suffix, end in endings(suffixes):
        if curves:
            for name, single in (("history", False), ("run", True)):
                path = folder / f"{paper}-{name}{suffix}"
                convergence_figure(curves, path, single=single)
                files[f"{paper} {name}{end}"] = str(path)
        drawn_on = folder / f"{paper}-maps{suffix}"
        maps_figure(_drawn(found), drawn_on, styles=styles)
        files[f"{paper} maps{end}"] = str(drawn_on)
        if paper == "han2007":
            drawn = _han_figures(found, folder, seeds, suffix)
            files |= {f"{name}{end}": str(path) for name, path in drawn.items()}
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


def _han_figures(found: Measured, folder: Path, seeds: int, suffix: str) -> dict[str, Path]:
    """Draw han2007's path lengths by number of ants and by the genetic algorithm's parameters."""
    with_ants = [(e, trials) for e, trials in found if e.planner == "aco-han" and e.printed is not None]
    lengths = {int(e.options["ants"]): [t.length for t in trials if t.result.solved] for e, trials in with_ants}
    printed = {int(experiment.options["ants"]): experiment.printed or math.nan for experiment, _ in with_ants}
    ants, sweep = folder / f"han2007-ants{suffix}", folder / f"han2007-sweep{suffix}"
    shortest = maps.optimum(maps.cutting_corners(maps.han_ants()))
    ants_figure(lengths, ants, planner="aco-han", printed=printed, unit="cells", optimum=shortest)
    sweep_figure(PC, PM, _sweep(seeds), sweep)
    return {"han2007 ants": ants, "han2007 sweep": sweep}


def _sweep(seeds: int) -> dict[bool, Any]:
    """Return mean path lengths of the genetic algorithm by crossover and mutation, with and without elitism."""
    query = maps.han_genes()
    found = {}
    for elitism in (True, False):
        values = np.full((len(PC), len(PM)), np.nan)
        for (i, j), _ in np.ndenumerate(values):
            options = {"crossover": PC[i], "mutation": PM[j], "elitism": elitism}
            trials = [solve("ga-han", options, query, seed) for seed in range(seeds)]
            lengths = [trial.length if elitism else trial.last for trial in trials if trial.result.solved]
            values[i, j] = np.mean(lengths) if lengths else np.nan
        found[elitism] = values
    return found


#: Experiment whose first map becomes a scenario, by paper.
SCENES: Mapping[str, Arm] = MappingProxyType(
    {
        "han2007": Arm("14 obstacles", "100 ants"),
        "suganthi2019": Arm("20×20", "iaco"),
        "ibraheem2016": Arm("20×20", "maco"),
        "lee2008": Arm("2: 50×44", "pfaco"),
        "hasan": Arm("1a curved walls", "mmas-dstar"),
    }
)


def paper_scenario(paper: str) -> Scenario:
    """Return the scenario of a paper's film: its planner and parameters on its first map."""
    scene = SCENES[paper]
    experiment = next(e for e in PAPERS[paper]() if (e.map, e.name) == (scene.map, scene.name))
    if paper == "han2007":
        task = _han_task()
    else:
        query = experiment.query(0)
        (r0, c0), (r1, c1) = query.start, query.goal
        heading = math.atan2(r1 - r0, c1 - c0)
        start: Pose = ((c0 + 0.5) * CELL, (r0 + 0.5) * CELL, heading)
        goal = ((c1 + 0.5) * CELL, (r1 + 0.5) * CELL)
        task = map_task(CellMap(query.grid.free, CELL, (0.0, 0.0)), start, goal, name=f"{paper} {scene.map}")
    return Scenario.of(task, experiment.planner, options=experiment.options, seed=0)


def _han_task() -> Task:
    """Return the map of han2007's ants [m]. The thesis' robot is a point: discs shrink by the robot's radius and margin."""
    low, high = 0.0, 21.0 * HAN_UNIT
    radius = HAN_UNIT - load_robot("turtlebot").radius - 0.03
    discs = tuple(Disc(x * HAN_UNIT, y * HAN_UNIT, radius) for x, y in HAN_ANTS)
    world = World("han2007 ants", (low, low, high, high), discs)
    start: Pose = (HAN_UNIT, HAN_UNIT, math.pi / 4)
    return Task(world, start, (20 * HAN_UNIT, 20 * HAN_UNIT), cell=HAN_UNIT)
