"""Runs the papers' experiments again: a table of printed against measured, and the papers' figures."""

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
from antdrive.sim.papers.experiments import PAPERS, Trial
from antdrive.worlds.errors import InputError
from antdrive.worlds.files.atomic import written_whole

if TYPE_CHECKING:
    from antdrive.planners import History

PC, PM = (0.1, 0.25, 0.5, 0.75, 0.9), (0.05, 0.1, 0.2, 0.4, 0.6)  # han2007's sweep


@dataclass(frozen=True)
class Row:
    """A trial's outcome over its seeds. Lengths in cells."""

    paper: str
    map: str
    recreated: bool
    planner: str
    what: str
    printed: float
    mean: float  # over the seeds that arrived, nan if none did
    best: float
    arrived: int
    seeds: int
    optimum: float  # mean of the maps' shortest paths on the same moves
    gap: float  # mean of length / shortest - 1
    plan_s: float  # median


def reproduce(
    papers: Sequence[str], folder: Path, *, seeds: int, suffixes: Sequence[str], jobs: int = 1,
    progress: Callable[[float], None] | None = None,
) -> tuple[list[Row], dict[str, str]]:  # fmt: skip
    """Measure papers again with some seeds each; the rows, and the files written into a folder, by name.

    Raises:
        InputError: no such paper.
    """
    check_papers(papers)
    trials = [trial for paper in papers for trial in PAPERS[paper]()]
    found: list[list[PlanResult]] = []
    rows = []
    for k, trial in enumerate(trials):
        queries = [trial.query(seed) for seed in range(seeds)]
        work = (joblib.delayed(_solve)(trial.planner, trial.options, query, seed) for seed, query in enumerate(queries))
        results = joblib.Parallel(n_jobs=jobs)(work)
        found.append(results)
        rows.append(_row(trial, results, [maps.optimum(query) for query in queries]))
        if progress is not None:
            progress((k + 1) / len(trials))
    files = {"table": str(_write_table(rows, folder / "table.md")), "csv": str(_write_csv(rows, folder / "table.csv"))}
    for paper in papers:
        chosen = [(t, r) for t, r in zip(trials, found, strict=True) if t.paper == paper]
        files |= _figures(paper, chosen, folder, seeds, suffixes)
    return rows, files


def check_papers(papers: Sequence[str]) -> None:
    """Refuse what is no paper.

    Raises:
        InputError: names the papers there are.
    """
    for paper in papers:
        if paper not in PAPERS:
            raise InputError(f"reproduce: unknown paper {paper!r}; choose from {', '.join([*PAPERS, 'all'])}")


def _solve(planner: str, options: Any, query: Any, seed: int) -> PlanResult:
    return load_planner(planner, **options).plan(query, np.random.default_rng(seed))


def _measured(trial: Trial, result: PlanResult) -> float:
    if not result.solved:
        return math.nan
    return float(len(result.cells) - 1) if trial.what == "steps" else result.line_length


def _row(trial: Trial, results: Sequence[PlanResult], optima: Sequence[float]) -> Row:
    values = [_measured(trial, result) for result in results]
    known = [value for value in values if math.isfinite(value)]
    gaps = [r.line_length / o - 1 for r, o in zip(results, optima, strict=True) if r.solved]
    return Row(
        trial.paper, trial.place, trial.recreated, trial.planner, trial.what, trial.printed,
        statistics.mean(known) if known else math.nan, min(known, default=math.nan), len(known), len(results),
        statistics.mean(optima), statistics.mean(gaps) if gaps else math.nan, statistics.median(r.wall_s for r in results),
    )  # fmt: skip


def row_cells(row: Row) -> list[str]:
    """The row as a table shows it."""

    def number(value: float) -> str:
        return f"{value:.{0 if row.what == 'steps' else 3}f}" if math.isfinite(value) else "–"

    place = row.map + (" (recreated)" if row.recreated else "")
    return [
        row.paper, place, row.planner, row.what, f"{row.printed:g}", number(row.mean), number(row.best),
        f"{row.arrived}/{row.seeds}", f"{row.optimum:.3f}",
        f"{100 * row.gap:.1f} %" if row.arrived else "–", f"{row.plan_s:.3f} s",
    ]  # fmt: skip


HEADS = ("paper", "map", "planner", "what", "printed", "mean", "best", "arrived", "shortest", "gap", "time")


def _write_table(rows: Sequence[Row], path: Path) -> Path:
    lines = [HEADS, ["---"] * len(HEADS), *map(row_cells, rows)]
    note = (
        "Recreated maps have the size and kind of the paper's, which is known as a picture only: their figures do not compare\n"
        "with the printed ones, only with the shortest path on the same map (`shortest`, `gap`). Lengths in cells.\n\n"
    )
    with written_whole(path) as temporary:
        temporary.write_text(note + "".join(f"| {' | '.join(line)} |\n" for line in lines), encoding="utf-8")
    return path


def _write_csv(rows: Sequence[Row], path: Path) -> Path:
    with written_whole(path) as temporary, temporary.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(Row.__dataclass_fields__)
        writer.writerows([getattr(row, name) for name in Row.__dataclass_fields__] for row in rows)
    return path


def _figures(
    paper: str, found: Sequence[tuple[Trial, list[PlanResult]]], folder: Path, seeds: int, suffixes: Sequence[str]
) -> dict[str, str]:
    """What the paper draws: length by iteration on its second map, and, for han2007, ants and Pc / Pm."""
    from antdrive.sim.view.figures.paper_figures import ants_figure, history_figure, sweep_figure

    files: dict[str, str] = {}
    places = list(dict.fromkeys(trial.place for trial, _ in found))
    chosen = places[min(1, len(places) - 1)]
    histories: dict[str, Sequence[History]] = {
        trial.planner: [result.history for result in results]
        for trial, results in found
        if trial.place == chosen and all(len(result.history) for result in results)
    }
    for suffix in suffixes:
        end = "" if suffix == suffixes[0] else f" {suffix[1:]}"
        if histories:
            path = history_figure(histories, folder / f"{paper}-history{suffix}", unit="cells")
            files[f"{paper} history{end}"] = str(path)
        if paper != "han2007":
            continue
        walked = [(trial, results) for trial, results in found if trial.planner == "aco-han"]
        lengths = {int(trial.options["ants"]): [r.cost for r in results if r.solved] for trial, results in walked}
        printed = {int(trial.options["ants"]): trial.printed for trial, _ in walked}
        path = ants_figure(lengths, folder / f"han2007-ants{suffix}", planner="aco-han", printed=printed, unit="cells",
                           optimum=maps.optimum(maps.han_ants()))  # fmt: skip
        files[f"han2007 ants{end}"] = str(path)
        path = sweep_figure(PC, PM, _sweep(seeds), folder / f"han2007-sweep{suffix}")
        files[f"han2007 sweep{end}"] = str(path)
    return files


def _sweep(seeds: int) -> dict[bool, Any]:
    """Mean length of the genetic algorithm's paths over crossover and mutation, with and without elitism."""
    query = maps.han_genes()
    found = {}
    for elitism in (True, False):
        values = np.full((len(PC), len(PM)), np.nan)
        for (i, j), _ in np.ndenumerate(values):
            options = {"crossover": PC[i], "mutation": PM[j], "elitism": elitism}
            results = [_solve("ga-han", options, query, seed) for seed in range(seeds)]
            lengths = [_last(result, elitism) for result in results if result.solved]
            values[i, j] = np.mean(lengths) if lengths else np.nan
        found[elitism] = values
    return found


def _last(result: PlanResult, elitism: bool) -> float:
    """What the last generation holds: without elitism it may have lost the best path."""
    return result.line_length if elitism else float(result.history.iteration_best[-1])
