"""Run the papers' experiments again: a table of printed and measured values, and the papers' figures."""

from __future__ import annotations

import csv
import math
import statistics
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import joblib
import numpy as np

from antdrive.planners import PlanResult, load_planner
from antdrive.sim.papers import maps
from antdrive.sim.papers.experiments import PAPERS, Experiment
from antdrive.worlds.errors import InputError
from antdrive.worlds.files.atomic import written_whole

if TYPE_CHECKING:
    from antdrive.planners import History

PC, PM = (0.1, 0.25, 0.5, 0.75, 0.9), (0.05, 0.1, 0.2, 0.4, 0.6)  # crossover, mutation: han2007's sweep


@dataclass(frozen=True)
class ResultRow:
    """An experiment's result over its seeds. Lengths are in cells.

    Attributes:
        paper: the paper's short name
        map: the map in words
        recreated: the map is not the paper's own
        planner: the planner's name
        quantity: the value that is printed and measured: `length` or `steps`
        printed: the paper's value
        mean: of the seeds that found a path; nan if none did
        best: of the seeds that found a path; nan if none did
        arrived: how many seeds found a path
        seeds: how many seeds were tried
        optimum: length of the shortest path with the same moves, mean over the seeds' maps
        gap: mean of length / shortest - 1
        plan_s: median planning time [s]
    """

    paper: str
    map: str
    recreated: bool
    planner: str
    quantity: str
    printed: float
    mean: float
    best: float
    arrived: int
    seeds: int
    optimum: float
    gap: float
    plan_s: float


def reproduce(
    papers: Sequence[str],
    folder: Path,
    *,
    seeds: int,
    suffixes: Sequence[str],
    jobs: int = 1,
    progress: Callable[[float], None] | None = None,
) -> tuple[list[ResultRow], dict[str, str]]:
    """Run the experiments of papers again and write a table, a CSV file and figures.

    Args:
        papers: short names, from `PAPERS`
        folder: where the files go
        seeds: how many seeds each experiment gets: 0, 1, ...
        suffixes: the figures' formats, for example (".png", ".pdf")
        jobs: the number of processes
        progress: called with the fraction of experiments that is done

    Returns:
        A row per experiment, and the paths of the files by name.

    Raises:
        InputError: an unknown paper.
    """
    check_papers(papers)
    experiments = [experiment for paper in papers for experiment in PAPERS[paper]()]
    found: list[list[PlanResult]] = []
    rows = []
    for k, experiment in enumerate(experiments):
        queries = [experiment.query(seed) for seed in range(seeds)]
        work = (
            joblib.delayed(_solve)(experiment.planner, experiment.options, query, seed)
            for seed, query in enumerate(queries)
        )
        results = joblib.Parallel(n_jobs=jobs)(work)
        found.append(results)
        rows.append(_row(experiment, results, [maps.optimum(query) for query in queries]))
        if progress is not None:
            progress((k + 1) / len(experiments))
    files = {
        "table": str(_write_table(rows, folder / "table.md")),
        "csv": str(_write_csv(rows, folder / "table.csv")),
    }
    for paper in papers:
        chosen = [(e, r) for e, r in zip(experiments, found, strict=True) if e.paper == paper]
        files |= _figures(paper, chosen, folder, seeds, suffixes)
    return rows, files


def check_papers(papers: Sequence[str]) -> None:
    """Check the short names of papers.

    Raises:
        InputError: an unknown paper; the message lists the known ones.
    """
    for paper in papers:
        if paper not in PAPERS:
            raise InputError(f"reproduce: unknown paper {paper!r}; choose from {', '.join([*PAPERS, 'all'])}")


def _solve(planner: str, options: Any, query: Any, seed: int) -> PlanResult:
    return load_planner(planner, **options).plan(query, np.random.default_rng(seed))


def _measured(experiment: Experiment, result: PlanResult) -> float:
    if not result.solved:
        return math.nan
    return float(len(result.cells) - 1) if experiment.quantity == "steps" else result.line_length


def _row(experiment: Experiment, results: Sequence[PlanResult], optima: Sequence[float]) -> ResultRow:
    values = [_measured(experiment, result) for result in results]
    known = [value for value in values if math.isfinite(value)]
    gaps = [r.line_length / o - 1 for r, o in zip(results, optima, strict=True) if r.solved]
    return ResultRow(
        paper=experiment.paper,
        map=experiment.map,
        recreated=experiment.recreated,
        planner=experiment.planner,
        quantity=experiment.quantity,
        printed=experiment.printed,
        mean=statistics.mean(known) if known else math.nan,
        best=min(known, default=math.nan),
        arrived=len(known),
        seeds=len(results),
        optimum=statistics.mean(optima),
        gap=statistics.mean(gaps) if gaps else math.nan,
        plan_s=statistics.median(r.wall_s for r in results),
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
        return f"{value:.{0 if row.quantity == 'steps' else 3}f}" if math.isfinite(value) else "–"

    return [
        row.paper,
        row.map + (" (recreated)" if row.recreated else ""),
        row.planner,
        row.quantity,
        f"{row.printed:g}",
        number(row.mean),
        number(row.best),
        f"{row.arrived}/{row.seeds}",
        f"{row.optimum:.3f}",
        f"{100 * row.gap:.1f} %" if row.arrived else "–",
        f"{row.plan_s:.3f} s",
    ]


def _write_table(rows: Sequence[ResultRow], path: Path) -> Path:
    lines = [HEADS, ["---"] * len(HEADS), *map(row_cells, rows)]
    note = (
        "Some papers show their maps as pictures only. Recreated maps have the same size and kind, but their lengths\n"
        "cannot be compared with the printed ones, only with the shortest path on the same map (`shortest`, `gap`).\n"
        "All lengths are in cells.\n\n"
    )
    with written_whole(path) as temporary:
        temporary.write_text(note + "".join(f"| {' | '.join(line)} |\n" for line in lines), encoding="utf-8")
    return path


def _write_csv(rows: Sequence[ResultRow], path: Path) -> Path:
    with written_whole(path) as temporary, temporary.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        names = list(ResultRow.__dataclass_fields__)
        writer.writerow(names)
        writer.writerows([getattr(row, name) for name in names] for row in rows)
    return path


def _figures(
    paper: str,
    found: Sequence[tuple[Experiment, list[PlanResult]]],
    folder: Path,
    seeds: int,
    suffixes: Sequence[str],
) -> dict[str, str]:
    """Draw length by iteration on the paper's second map and, for han2007, by ants and by Pc and Pm."""
    from antdrive.sim.view.figures.paper_figures import history_figure

    files: dict[str, str] = {}
    names = list(dict.fromkeys(experiment.map for experiment, _ in found))
    chosen = names[min(1, len(names) - 1)]
    histories: dict[str, Sequence[History]] = {
        experiment.planner: [result.history for result in results]
        for experiment, results in found
        if experiment.map == chosen and all(len(result.history) for result in results)
    }
    for suffix in suffixes:
        end = "" if suffix == suffixes[0] else f" {suffix[1:]}"
        if histories:
            path = folder / f"{paper}-history{suffix}"
            history_figure(histories, path, unit="cells")
            files[f"{paper} history{end}"] = str(path)
        if paper == "han2007":
            drawn = _han_figures(found, folder, seeds, suffix)
            files |= {f"{name}{end}": str(path) for name, path in drawn.items()}
    return files


def _han_figures(
    found: Sequence[tuple[Experiment, list[PlanResult]]], folder: Path, seeds: int, suffix: str
) -> dict[str, Path]:
    """Draw han2007's figures: path length by number of ants, and by the parameters of the genetic algorithm."""
    from antdrive.sim.view.figures.paper_figures import ants_figure, sweep_figure

    with_ants = [(experiment, results) for experiment, results in found if experiment.planner == "aco-han"]
    lengths = {int(e.options["ants"]): [r.cost for r in results if r.solved] for e, results in with_ants}
    ants, sweep = folder / f"han2007-ants{suffix}", folder / f"han2007-sweep{suffix}"
    ants_figure(
        lengths,
        ants,
        planner="aco-han",
        printed={int(experiment.options["ants"]): experiment.printed for experiment, _ in with_ants},
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
            results = [_solve("ga-han", options, query, seed) for seed in range(seeds)]
            lengths = [_last_length(result, elitism) for result in results if result.solved]
            values[i, j] = np.mean(lengths) if lengths else np.nan
        found[elitism] = values
    return found


def _last_length(result: PlanResult, elitism: bool) -> float:
    """The best length in the last generation; without elitism, an earlier one may have been shorter."""
    return result.line_length if elitism else float(result.history.iteration_best[-1])
