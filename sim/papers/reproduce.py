"""Run the papers' experiments again: printed and measured values, the claims with their verdicts, the papers' figures."""

from __future__ import annotations

import csv
import dataclasses
import math
import statistics
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import joblib
import numpy as np

from antdrive.sim.papers import maps
from antdrive.sim.papers.claims import CLAIMS, Arm
from antdrive.sim.papers.experiments import PAPERS, Experiment
from antdrive.sim.papers.trials import Trial, solve
from antdrive.sim.papers.verdicts import VERDICT_HEADS, Verdict, judge, verdict_cells, verdict_facts
from antdrive.sim.statistics.bootstrap import medians_by_world
from antdrive.worlds.errors import InputError
from antdrive.worlds.files.atomic import written_whole

if TYPE_CHECKING:
    from antdrive.planners import History, PlanResult, Query

PAINTED = 3  # planners whose paths are drawn on one map
PC, PM = (0.1, 0.25, 0.5, 0.75, 0.9), (0.05, 0.1, 0.2, 0.4, 0.6)  # crossover, mutation: han2007's sweep


@dataclass(frozen=True)
class ResultRow:
    """An experiment's result over its seeds. Lengths are in cells.

    Attributes:
        paper: the paper's short name
        map: the map in words
        recreated: the map is not the paper's own
        comparable: the shortest path is as long as the paper says, so that lengths compare with the printed one
        planner: the planner's name, with its setting
        quantity: the value that is printed and measured: `length`, `steps` or `total`
        printed: the paper's value; None: it prints none
        mean: of the seeds that found a path; nan if none did
        best: of the seeds that found a path; nan if none did
        arrived: how many seeds found a path
        seeds: how many seeds were tried
        optimum: length of the shortest path with the same moves, mean over the seeds' maps
        gap: median of length / shortest - 1 of the seeds that found a path
        gap_low: the lower end of its interval, bootstrapped over maps
        gap_high: the upper end
        plan_s: median processor time of planning [s]
    """

    paper: str
    map: str
    recreated: bool
    comparable: bool
    planner: str
    quantity: str
    printed: float | None
    mean: float
    best: float
    arrived: int
    seeds: int
    optimum: float
    gap: float
    gap_low: float
    gap_high: float
    plan_s: float


@dataclass(frozen=True)
class Reproduction:
    """What `reproduce` found.

    Attributes:
        rows: a row for each experiment
        verdicts: a verdict for each claim whose experiments were run
        files: the paths of the files by name
    """

    rows: list[ResultRow]
    verdicts: list[Verdict]
    files: dict[str, str]


def reproduce(
    papers: Sequence[str],
    folder: Path,
    *,
    seeds: int,
    suffixes: Sequence[str],
    jobs: int = 1,
    quick: bool = False,
    films: bool = False,
    progress: Callable[[float], None] | None = None,
) -> Reproduction:
    """Run the experiments of papers again, judge the papers' claims, and write tables, CSV files and figures.

    Args:
        papers: short names, from `PAPERS`
        folder: where the files go
        seeds: how many seeds each experiment gets: 0, 1, ...
        suffixes: the figures' formats, for example (".png", ".pdf")
        jobs: the number of processes
        quick: a tenth of the ant steps where an experiment counts them, two candidates of each map, and no slow experiments
        films: whether to film a drive for each paper, the planning first
        progress: called with the fraction of experiments that is done

    Raises:
        InputError: an unknown paper.
    """
    check_papers(papers)
    experiments = [experiment for paper in papers for experiment in PAPERS[paper]()]
    if quick:
        experiments = [_hurried(experiment) for experiment in experiments if not experiment.slow]
    found: list[list[Trial]] = []
    rows = []
    with joblib.Parallel(n_jobs=jobs) as parallel:
        for k, experiment in enumerate(experiments):
            trials = _trials(experiment, seeds, parallel)
            found.append(trials)
            rows.append(_row(experiment, trials))
            if progress is not None:
                progress((k + 1) / len(experiments))
    verdicts = _verdicts(list(zip(experiments, found, strict=True)))
    files = {
        "table": str(_write_table(rows, folder / "table.md")),
        "csv": str(_write_csv([vars(row) for row in rows], folder / "table.csv")),
        "claims": str(_write_claims(verdicts, folder / "claims.md")),
        "claims csv": str(_write_csv([verdict_facts(verdict) for verdict in verdicts], folder / "claims.csv")),
    }
    for paper in papers:
        chosen = [(e, trials) for e, trials in zip(experiments, found, strict=True) if e.paper == paper]
        files |= _figures(paper, chosen, folder, 1 if quick else min(seeds, 10), suffixes)
        if films:
            files |= _filmed(paper, folder)
    return Reproduction(rows, verdicts, files)


def _filmed(paper: str, folder: Path) -> dict[str, str]:
    from antdrive.sim.papers.films import film_paper

    film = film_paper(paper, folder)
    return {} if film is None else {f"{paper} film": str(film)}


def _hurried(experiment: Experiment) -> Experiment:
    return dataclasses.replace(experiment, work=experiment.work / 10, worlds=min(experiment.worlds, 2))


def _trials(experiment: Experiment, seeds: int, parallel: joblib.Parallel) -> list[Trial]:
    chosen = range(min(seeds, experiment.most_seeds))
    planner = experiment.made or experiment.planner
    trials: list[Trial] = parallel(
        joblib.delayed(solve)(
            planner, experiment.options, experiment.query(experiment.world(seed)), seed, experiment.work
        )
        for seed in chosen
    )
    return [dataclasses.replace(trial, world=experiment.world(trial.seed)) for trial in trials]


def _verdicts(found: Sequence[tuple[Experiment, list[Trial]]]) -> list[Verdict]:
    """The verdicts on all claims whose experiments are among these."""
    verdicts = []
    for claim in CLAIMS:
        known = {Arm(e.map, e.name): trials for e, trials in found if e.paper == claim.paper and e.name != "steps"}
        if claim.arms <= known.keys():
            verdicts.append(judge(claim, known))
    return verdicts


def check_papers(papers: Sequence[str]) -> None:
    """Check the short names of papers.

    Raises:
        InputError: an unknown paper; the message lists the known ones.
    """
    for paper in papers:
        if paper not in PAPERS:
            raise InputError(f"reproduce: unknown paper {paper!r}; choose from {', '.join([*PAPERS, 'all'])}")


def _row(experiment: Experiment, trials: Sequence[Trial]) -> ResultRow:
    values = [float(getattr(trial, experiment.quantity)) for trial in trials]
    known = [value for value in values if math.isfinite(value)]
    solved = [trial for trial in trials if trial.result.solved]
    gaps = np.array([trial.gap / 100.0 for trial in solved])
    worlds = np.array([trial.world for trial in solved], dtype=np.int64)
    alone = np.arange(len(worlds)) if len(set(worlds.tolist())) == 1 else worlds
    low, high = medians_by_world(gaps[:, None], alone)[0] if solved else (math.nan, math.nan)
    return ResultRow(
        paper=experiment.paper,
        map=experiment.map,
        recreated=experiment.recreated,
        comparable=experiment.comparable or not experiment.recreated,
        planner=experiment.name,
        quantity=experiment.quantity,
        printed=experiment.printed,
        mean=statistics.mean(known) if known else math.nan,
        best=min(known, default=math.nan),
        arrived=len(known),
        seeds=len(trials),
        optimum=statistics.mean(trial.optimum for trial in trials),
        gap=float(np.median(gaps)) if solved else math.nan,
        gap_low=low,
        gap_high=high,
        plan_s=statistics.median(trial.cpu_s for trial in trials),
    )


#: The headings of the table; lengths are in cells.
HEADS = (
    "paper",
    "map",
    "planner",
    "quantity",
    "printed",
    "mean",
    "best",
    "solved",
    "shortest",
    "gap",
    "planning",
)


def row_cells(row: ResultRow) -> list[str]:
    """A row of the table as text, under `HEADS`."""

    def number(value: float) -> str:
        return f"{value:.{3 if row.quantity == 'length' else 0}f}" if math.isfinite(value) else "–"

    return [
        row.paper,
        row.map + ("" if not row.recreated else " (recreated)" if row.comparable else " (another map)"),
        row.planner,
        row.quantity,
        "–" if row.printed is None else f"{row.printed:g}",
        number(row.mean),
        number(row.best),
        f"{row.arrived}/{row.seeds}",
        f"{row.optimum:.3f}",
        f"{100 * row.gap:.1f} % [{100 * row.gap_low:.1f}, {100 * row.gap_high:.1f}]" if row.arrived else "–",
        f"{row.plan_s:.3f} s",
    ]


def _write_table(rows: Sequence[ResultRow], path: Path) -> Path:
    lines = [HEADS, ["---"] * len(HEADS), *map(row_cells, rows)]
    note = (
        "Some papers show their maps as pictures only. Recreated maps are random maps of the same size on which the shortest\n"
        "path is as long as the best that the paper prints; on another map only the gap to the shortest path (`shortest`)\n"
        "means anything. All lengths are in cells; a gap is a median with its 95 % interval over maps.\n\n"
    )
    with written_whole(path) as temporary:
        temporary.write_text(note + "".join(f"| {' | '.join(line)} |\n" for line in lines), encoding="utf-8")
    return path


def _write_claims(verdicts: Sequence[Verdict], path: Path) -> Path:
    lines = [VERDICT_HEADS, ["---"] * len(VERDICT_HEADS), *map(verdict_cells, verdicts)]
    with written_whole(path) as temporary:
        temporary.write_text("".join(f"| {' | '.join(line)} |\n" for line in lines), encoding="utf-8")
    return path


def _write_csv(rows: Sequence[Mapping[str, Any]], path: Path) -> Path:
    with written_whole(path) as temporary, temporary.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        if rows:
            writer.writerow(list(rows[0]))
        writer.writerows([list(row.values()) for row in rows])
    return path


def _figures(
    paper: str,
    found: Sequence[tuple[Experiment, list[Trial]]],
    folder: Path,
    seeds: int,
    suffixes: Sequence[str],
) -> dict[str, str]:
    """Draw length by iteration on the paper's second map, paths on all maps and, for han2007, length by ants and by Pc and Pm.

    `seeds` are those of the sweep over Pc and Pm.
    """
    from antdrive.sim.view.figures.paper_figures import history_figure, maps_figure

    files: dict[str, str] = {}
    names = list(dict.fromkeys(experiment.map for experiment, _ in found))
    chosen = names[min(1, len(names) - 1)]
    histories: dict[str, Sequence[History]] = {
        experiment.name: [trial.result.history for trial in trials]
        for experiment, trials in found
        if experiment.map == chosen and all(len(trial.result.history) for trial in trials)
    }
    for suffix in suffixes:
        end = "" if suffix == suffixes[0] else f" {suffix[1:]}"
        if histories:
            path = folder / f"{paper}-history{suffix}"
            history_figure(histories, path, unit="cells")
            files[f"{paper} history{end}"] = str(path)
        drawn_on = folder / f"{paper}-maps{suffix}"
        maps_figure(_drawn(found), drawn_on)
        files[f"{paper} maps{end}"] = str(drawn_on)
        if paper == "han2007":
            drawn = _han_figures(found, folder, seeds, suffix)
            files |= {f"{name}{end}": str(path) for name, path in drawn.items()}
    return files


def _drawn(
    found: Sequence[tuple[Experiment, list[Trial]]],
) -> dict[str, tuple[Query, dict[str, PlanResult]]]:
    """The first map of each experiment with the path of its median seed, for `PAINTED` planners of a map."""
    maps_drawn: dict[str, tuple[Query, dict[str, PlanResult]]] = {}
    for experiment, trials in found:
        if experiment.name == "steps":  # the same plans as those of the total costs
            continue
        query = experiment.query(experiment.world(trials[0].seed))
        plans = maps_drawn.setdefault(experiment.map, (query, {}))[1]
        on_it = sorted((t for t in trials if t.world == trials[0].world), key=lambda trial: trial.length)
        if len(plans) < PAINTED:
            plans[experiment.name] = on_it[(len(on_it) - 1) // 2].result
    return maps_drawn


def _han_figures(
    found: Sequence[tuple[Experiment, list[Trial]]], folder: Path, seeds: int, suffix: str
) -> dict[str, Path]:
    """Draw han2007's figures: path length by number of ants, and by the parameters of the genetic algorithm."""
    from antdrive.sim.view.figures.paper_figures import ants_figure, sweep_figure

    with_ants = [(e, trials) for e, trials in found if e.planner == "aco-han" and e.printed is not None]
    lengths = {int(e.options["ants"]): [t.length for t in trials if t.result.solved] for e, trials in with_ants}
    printed = {int(experiment.options["ants"]): experiment.printed or math.nan for experiment, _ in with_ants}
    ants, sweep = folder / f"han2007-ants{suffix}", folder / f"han2007-sweep{suffix}"
    ants_figure(
        lengths,
        ants,
        planner="aco-han",
        printed=printed,
        unit="cells",
        optimum=maps.optimum(maps.han_ants()),
    )
    sweep_figure(PC, PM, _sweep(seeds), sweep)
    return {"han2007 ants": ants, "han2007 sweep": sweep}


def _sweep(seeds: int) -> dict[bool, Any]:
    """Mean length of the genetic algorithm's paths by crossover and mutation, with and without elitism."""
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
