"""Run the papers' experiments again: printed and measured values, the claims with their verdicts, the papers' figures."""

from __future__ import annotations

import csv
import dataclasses
import functools
import math
import re
import statistics
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from antdrive.base.atomic import written_whole
from antdrive.base.errors import InputError
from antdrive.planners import Planner, Query
from antdrive.runs.papers.claims import CLAIMS
from antdrive.runs.papers.experiments import PAPERS, Experiment
from antdrive.runs.papers.keeping import keep_trials, kept_trials, trials_key
from antdrive.runs.papers.kinds import Arm, Claim
from antdrive.runs.papers.movers import drive_among
from antdrive.runs.papers.trials import Trial, solve
from antdrive.runs.papers.verdicts import (
    VERDICT_HEADS,
    Verdict,
    judge,
    trials_at_hand,
    trials_needed,
    verdict_cells,
    verdict_facts,
)
from antdrive.runs.pool import Pool, processes_for
from antdrive.runs.statistics.bootstrap import medians_by_world

MOST_SEEDS = 1000  # every claim can be decided with fewer
TRIALS = "trials"  # the folder of the trials within that of the results


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
        kept: how many experiments were taken from the files of an earlier, interrupted command
    """

    rows: list[ResultRow]
    verdicts: list[Verdict]
    files: dict[str, str]
    kept: int


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

    The trials of an experiment are written as soon as it is done. A second call with the same folder and seeds takes them
    from there, unless the source code has changed in between.

    Raises:
        InputError: an unknown paper.
    """
    check_papers(papers)
    experiments = [experiment for paper in papers for experiment in PAPERS[paper]()]
    if quick:
        experiments = [_hurried(experiment) for experiment in experiments if not experiment.slow]
    found, kept = _all_trials(experiments, folder / TRIALS, seeds, jobs, progress)
    rows = [_row(experiment, trials) for experiment, trials in zip(experiments, found, strict=True)]
    verdicts = _verdicts(list(zip(experiments, found, strict=True)))
    files = {
        "table": str(_write_table(rows, folder / "table.md")),
        "csv": str(_write_csv([vars(row) for row in rows], folder / "table.csv")),
        "claims": str(_write_claims(verdicts, folder / "claims.md")),
        "claims csv": str(_write_csv([verdict_facts(verdict) for verdict in verdicts], folder / "claims.csv")),
    }
    from antdrive.views.papers.drawing import draw_figures

    for paper in papers:
        chosen = [(e, trials) for e, trials in zip(experiments, found, strict=True) if e.paper == paper]
        files |= draw_figures(paper, chosen, folder, 1 if quick else min(seeds, 10), suffixes)
        if films:
            files |= _filmed(paper, folder)
    return Reproduction(rows, verdicts, files, kept)


def _filmed(paper: str, folder: Path) -> dict[str, str]:
    from antdrive.views.papers.films import film_paper

    film = film_paper(paper, folder)
    return {} if film is None else {f"{paper} film": str(film)}


def _hurried(experiment: Experiment) -> Experiment:
    return dataclasses.replace(experiment, work=experiment.work / 10, worlds=min(experiment.worlds, 2), rounds=1)


def _all_trials(
    experiments: Sequence[Experiment],
    folder: Path,
    seeds: int,
    jobs: int,
    progress: Callable[[float], None] | None,
) -> tuple[list[list[Trial]], int]:
    """The trials of each experiment, and how many experiments were in the folder already."""
    total, done, kept = sum(len(experiment.seeds(seeds)) for experiment in experiments), 0, 0
    found: list[list[Trial]] = []
    with Pool(processes_for(jobs)) as pool:
        for experiment in experiments:
            words = f"{experiment.paper} {experiment.map} {experiment.name}"
            path, key = folder / f"{re.sub(r'[^A-Za-z0-9×*]+', '-', words)}.npz", trials_key(experiment, seeds)
            trials = kept_trials(path, key)
            if trials is None:
                trials = []
                for trial in pool.results(*_planned(experiment, seeds)):
                    trials.append(dataclasses.replace(trial, world=experiment.world(trial.seed)))
                    if progress is not None:
                        progress((done + len(trials)) / total)
                keep_trials(trials, path, key)
            else:
                kept += 1
            done += len(trials)
            found.append(trials)
    if progress is not None:
        progress(1.0)
    return found, kept


def _planned(
    experiment: Experiment, seeds: int
) -> tuple[Callable[[tuple[Query, int]], Trial], list[tuple[Query, int]]]:
    """What plans an experiment once, and the queries that it is given with their seeds."""
    asked = [(experiment.query(experiment.world(seed)), seed) for seed in experiment.seeds(seeds)]
    return functools.partial(
        _trial, experiment.made or experiment.planner, experiment.options, experiment.movers, experiment.work
    ), asked


def _trial(
    planner: str | Planner, options: Mapping[str, Any], movers: Any, work: float, asked: tuple[Query, int]
) -> Trial:
    query, seed = asked
    return drive_among(planner, options, query, seed, movers) if movers else solve(planner, options, query, seed, work)


def _verdicts(found: Sequence[tuple[Experiment, list[Trial]]]) -> list[Verdict]:
    """The verdicts on all claims whose experiments are among these."""
    known: dict[str, dict[Arm, list[Trial]]] = {}
    for experiment, trials in found:
        if experiment.name != "steps":
            known.setdefault(experiment.paper, {})[Arm(experiment.map, experiment.name)] = trials
    return [judge(claim, arms) for claim, arms in _judgeable(known)]


def _judgeable(known: Mapping[str, dict[Arm, Any]]) -> Iterator[tuple[Claim, dict[Arm, Any]]]:
    """The claims all of whose experiments are among these, with what is known of their paper's."""
    for claim in CLAIMS:
        arms = known.get(claim.paper, {})
        if claim.arms <= arms.keys():
            yield claim, arms


def too_few_seeds(papers: Sequence[str], seeds: int, *, quick: bool = False) -> str:
    """One line on how many claims so few seeds cannot decide, and how many can; empty if they can decide all."""
    experiments = [_hurried(e) if quick else e for paper in papers for e in PAPERS[paper]() if not (quick and e.slow)]

    def undecided(count: int) -> tuple[int, int]:
        known: dict[str, dict[Arm, int]] = {}
        for e in experiments:
            known.setdefault(e.paper, {})[Arm(e.map, e.name)] = len(e.seeds(count))
        claims = list(_judgeable(known))
        few = sum(trials_at_hand(claim.test, arms) < trials_needed(claim.test) for claim, arms in claims)
        return few, len(claims)

    few, total = undecided(seeds)
    if not few:
        return ""
    enough = next(count for count in range(seeds, MOST_SEEDS) if not undecided(count)[0])
    return f"seeds: {seeds} are too few to decide {few} of {total} claims, whatever they give; {enough} suffice"


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
