"""Reproduction of the papers' experiments: printed and measured values, and the claims with their verdicts.

Runs are kept in files, so an interrupted reproduction can resume.
"""

from __future__ import annotations

import csv
import dataclasses
import functools
import gzip
import hashlib
import json
import math
import re
import statistics
import zlib
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

import antdrive.planners
import antdrive.runs.papers
import antdrive.worlds
from antdrive.base.atomic import atomic_write, write_text
from antdrive.base.errors import InputError
from antdrive.base.files import open_regular
from antdrive.planners import History, PlanResult, PlanStatus
from antdrive.runs.papers.arms import HEADS as ARM_HEADS
from antdrive.runs.papers.arms import arm_facts, merged
from antdrive.runs.papers.claims import (
    CLAIMS,
    VERDICT_HEADS,
    Arm,
    Claim,
    Verdict,
    evaluate,
    runs_available,
    runs_needed,
    verdict_facts,
)
from antdrive.runs.papers.experiment import Experiment
from antdrive.runs.papers.experiments import PAPERS
from antdrive.runs.papers.paper_runs import PaperRun, drive_among, interleaved, solve
from antdrive.runs.pool import Pool, call_now, processes_for
from antdrive.runs.statistics.intervals import medians_by_world


def runs_key(experiment: Experiment, seeds: int) -> str:
    """Return the key of an experiment's runs, including the source code; files with another key are ignored.

    A group's key has a line for each of its experiments.
    """
    facts = {
        "map": experiment.map,
        "name": experiment.name,
        "planner": experiment.planner if experiment.made is None else repr(experiment.made),
        "options": dict(experiment.options),
        "worlds": experiment.worlds,
        "work": experiment.work,
        "movers": [experiment.movers, experiment.on_path, experiment.enter],
        "seeds": len(experiment.seeds(seeds)),
        "code": code_hash(),
    }
    return json.dumps(facts, sort_keys=True)


EVALUATING = ("claims", "arms")  # modules on which no run depends


@functools.cache
def code_hash() -> str:
    """Return the hash of the code of worlds, planners and experiments, without `EVALUATING`."""
    digest = hashlib.sha256()
    for package in (antdrive.worlds, antdrive.planners, antdrive.runs.papers):
        for folder in package.__path__:
            for path in sorted(Path(folder).rglob("*.py")):
                if package is not antdrive.runs.papers or path.stem not in EVALUATING:
                    digest.update(path.read_bytes())
    return digest.hexdigest()


KEPT = ("cells", "cost", "length", "waypoints", "work")  # of a plan; its field, options and planning time are lost


def save_runs(runs: Sequence[PaperRun], path: Path, key: str) -> None:
    """Write runs to a file."""
    kept = [
        {
            **vars(run),
            "result": {name: getattr(run.result, name) for name in KEPT},
            "status": run.result.status.name,
            "history": vars(run.result.history),
        }
        for run in runs
    ]
    with atomic_write(path) as temporary, gzip.open(temporary, "wt") as file:
        json.dump({"key": key, "runs": kept}, file, default=lambda array: array.tolist())


def load_runs(path: Path, key: str) -> list[PaperRun] | None:
    """Load the runs of a file; None if it is missing, unreadable or has another key."""
    try:
        with open_regular(path) as opened, gzip.open(opened, "rt") as file:
            found = json.load(file)
        return [_run_of(**facts) for facts in found["runs"]] if found["key"] == key else None
    except (OSError, ValueError, KeyError, TypeError, EOFError, zlib.error):
        return None


def _run_of(result: dict[str, Any], status: str, history: dict[str, Any], **facts: Any) -> PaperRun:
    cells, line = np.array(result["cells"], dtype=np.int32).reshape(-1, 2), result["waypoints"]
    arrived = np.array(history.pop("arrived"), dtype=np.int64)
    lengths = {name: np.array(values, dtype=np.float64) for name, values in history.items()}
    arrays = {"cells": cells, "waypoints": None if line is None else np.array(line)}
    plan = {**result, **arrays, "history": History(arrived=arrived, **lengths)}
    return PaperRun(result=PlanResult(status=PlanStatus[status], **plan), **facts)


T = TypeVar("T")
MOST_SEEDS = 1000  # enough to decide every claim
RUNS_FOLDER = "trials"  # subfolder of the runs in the results


Measurements = list[tuple[Experiment, list[PaperRun]]]


@dataclass(frozen=True)
class ResultRow:
    """Result of an experiment over its seeds. Lengths are in cells."""

    paper: str
    map: str
    recreated: bool  # whether a random map replaces the paper's
    comparable: bool  # whether the shortest path has the paper's length, so lengths are comparable with the printed one
    planner: str  # with its setting
    quantity: str  # the printed and measured value: `length`, `steps` or `total`
    printed: float | None  # the paper's value; None if it prints none
    mean: float  # over the seeds with a path; nan without any
    best: float
    arrived: int  # number of seeds with a path
    seeds: int
    optimum: float  # length of the shortest path with the same moves, mean over the seeds' maps
    gap: float  # median of length / shortest - 1 over the seeds with a path
    gap_low: float  # ends of its interval, bootstrapped over maps
    gap_high: float
    plan_s: float  # median processor time of planning [s]


@dataclass(frozen=True)
class Reproduction:
    """The result of `reproduce`."""

    measured: Measurements
    rows: list[ResultRow]  # one for each experiment
    verdicts: list[Verdict]  # one for each claim whose experiments were run
    claims: list[dict[str, Any]]  # the verdicts as plain data, each with the settings of its arms
    files: dict[str, str]  # by name
    kept: int  # number of experiments loaded from an earlier, interrupted command

    def of(self, paper: str) -> Measurements:
        """Return the experiments of one paper with their runs."""
        return [(experiment, runs) for experiment, runs in self.measured if experiment.paper == paper]


def reproduce(
    papers: Sequence[str],
    folder: Path,
    *,
    seeds: int,
    jobs: int | None = 1,
    quick: bool = False,
    progress: Callable[[float], None] | None = None,
) -> Reproduction:
    """Reproduce the experiments of papers, evaluate their claims, and write tables and CSV files.

    The runs of each experiment are written as soon as it is done. A second call with the same folder and seeds loads them,
    unless the source code has changed.
    """
    experiments = _experiments(papers, quick)
    measured, kept = _all_runs(experiments, folder / RUNS_FOLDER, seeds, jobs, progress)
    rows = [_row(experiment, runs) for experiment, runs in measured]
    arms = {(e.paper, e.map, e.name): runs for e, runs in measured if e.name != "steps"}
    verdicts = [evaluate(claim, runs) for claim, runs in _measured_claims(arms)]
    settings = _settings(experiments)
    claims = [verdict_facts(one) | {"settings": _arms_of(one.claim, settings)} for one in verdicts]
    arm_rows = ([paper, arm, *merged(on).values()] for paper, own in settings.items() for arm, on in own.items())
    files = {
        "table": _write_table(HEADS, map(row_cells, rows), folder / "table.md", NOTE),
        "csv": _write_csv([vars(row) for row in rows], folder / "table.csv"),
        "claims": _write_table(
            VERDICT_HEADS, ([row[h] for h in VERDICT_HEADS] for row in claims), folder / "claims.md"
        ),
        "claims csv": _write_csv(
            [row | {"settings": json.dumps(row["settings"])} for row in claims], folder / "claims.csv"
        ),
        "arms": _write_table(("paper", "arm", *ARM_HEADS), arm_rows, folder / "arms.md"),
    }
    return Reproduction(measured, rows, verdicts, claims, files, kept)


ArmFacts = Mapping[str, Mapping[str, Mapping[str, Mapping[str, str]]]]  # by paper, arm and map


def _settings(experiments: Sequence[Experiment]) -> ArmFacts:
    settings: dict[str, dict[str, dict[str, dict[str, str]]]] = {}
    for one in experiments:
        settings.setdefault(one.paper, {}).setdefault(one.name, {})[one.map] = arm_facts(one)
    return settings


def _arms_of(claim: Claim, settings: ArmFacts) -> dict[str, dict[str, str]]:
    """Return the settings of a claim's arms on its maps, by the arms' names."""
    maps: dict[str, list[str]] = {}
    for case in claim.cases:
        for arm in case:
            maps.setdefault(arm.name, []).append(arm.map)
    return {
        name: merged({where: settings[claim.paper][name][where] for where in places}) for name, places in maps.items()
    }


def _experiments(papers: Sequence[str], quick: bool) -> list[Experiment]:
    """Return the experiments of papers; a quick run omits slow ones and uses fewer ant steps and maps."""
    for paper in papers:
        if paper not in PAPERS:
            raise InputError(f"reproduce: unknown paper {paper!r}; choose from {', '.join([*PAPERS, 'all'])}")
    every = [experiment for paper in papers for experiment in PAPERS[paper]()]
    if not quick:
        return every
    return [dataclasses.replace(e, work=e.work / 10, worlds=min(e.worlds, 2), rounds=1) for e in every if not e.slow]


def _all_runs(
    experiments: Sequence[Experiment],
    folder: Path,
    seeds: int,
    jobs: int | None,
    progress: Callable[[float], None] | None,
) -> tuple[Measurements, int]:
    """Run or load all experiments; return their runs, and the number of experiments loaded.

    The runs of a group are in one file, so that times of different calls are never compared.
    """
    total, done, kept = sum(len(experiment.seeds(seeds)) for experiment in experiments), 0, 0
    found: dict[tuple[str, str, str], list[PaperRun]] = {}
    with Pool(processes_for(jobs)) as pool:
        for group in _groups(experiments):
            first, count = group[0], len(group[0].seeds(seeds))
            words = f"{first.paper} {first.map} {first.group or first.name}"
            path = folder / f"{re.sub(r'[^A-Za-z0-9×*]+', '-', words)}.json.gz"
            key = "\n".join(runs_key(experiment, seeds) for experiment in group)
            runs = load_runs(path, key)
            if runs is None:
                rows = []
                for row in pool.results(call_now, _planned(group, seeds)):
                    rows.append([dataclasses.replace(run, world=first.world(run.seed)) for run in row])
                    if progress is not None:
                        progress((done + len(rows) * len(group)) / total)
                runs = [run for column in zip(*rows, strict=True) for run in column]
                save_runs(runs, path, key)
            else:
                kept += len(group)
            done += len(runs)
            for k, experiment in enumerate(group):
                found[experiment.paper, experiment.map, experiment.name] = runs[k * count : (k + 1) * count]
    if progress is not None:
        progress(1.0)
    return [(e, found[e.paper, e.map, e.name]) for e in experiments], kept


def _groups(experiments: Sequence[Experiment]) -> list[list[Experiment]]:
    """Return the experiments that are timed together, most of them alone."""
    groups: dict[tuple[str, ...], list[Experiment]] = {}
    for e in experiments:
        groups.setdefault((e.paper, e.map, e.group, "" if e.group else e.name), []).append(e)
    return list(groups.values())


def _planned(group: Sequence[Experiment], seeds: int) -> Iterator[Callable[[], list[PaperRun]]]:
    """Yield, seed by seed, the calls that plan a group's experiments."""
    for seed in group[0].seeds(seeds):
        yield partial(interleaved, [_call(experiment, seed) for experiment in group])


def _call(experiment: Experiment, seed: int) -> Callable[[], PaperRun]:
    """Return the call that plans an experiment with one seed."""
    planner, query = experiment.made or experiment.planner, experiment.query(experiment.world(seed))
    if not experiment.movers:
        return partial(solve, planner, experiment.options, query, seed, experiment.work)
    where = {"on_path": experiment.on_path, "enter": experiment.enter}
    return partial(drive_among, planner, experiment.options, query, seed, experiment.movers, **where)


def _measured_claims(known: Mapping[tuple[str, str, str], T]) -> Iterator[tuple[Claim, dict[Arm, T]]]:
    """Yield the claims whose experiments are all known, with their data."""
    for claim in CLAIMS:
        places = {arm: (claim.paper, *arm) for arm in claim.arms}
        if known.keys() >= set(places.values()):
            yield claim, {arm: known[place] for arm, place in places.items()}


def too_few_seeds(papers: Sequence[str], seeds: int, *, quick: bool = False) -> str:
    """Return a warning with the number of claims that these seeds cannot decide; empty if they can decide all."""
    experiments = _experiments(papers, quick)

    def undecided(count: int) -> tuple[int, int]:
        claims = list(_measured_claims({(e.paper, e.map, e.name): len(e.seeds(count)) for e in experiments}))
        return sum(runs_available(claim, sizes) < runs_needed(claim) for claim, sizes in claims), len(claims)

    few, total = undecided(seeds)
    if not few:
        return ""
    enough = next(count for count in range(seeds, MOST_SEEDS) if not undecided(count)[0])
    return f"seeds: {seeds} are too few to decide {few} of {total} claims; use {enough}"


def _row(experiment: Experiment, runs: Sequence[PaperRun]) -> ResultRow:
    values = [float(getattr(run, experiment.quantity)) for run in runs]
    known = [value for value in values if math.isfinite(value)]
    solved = [run for run in runs if run.result.solved]
    gaps = np.array([run.gap / 100.0 for run in solved])
    worlds = np.array([run.world for run in solved], dtype=np.int64)
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
        seeds=len(runs),
        optimum=statistics.mean(run.optimum for run in runs),
        gap=float(np.median(gaps)) if solved else math.nan,
        gap_low=low,
        gap_high=high,
        plan_s=statistics.median(run.cpu_s for run in runs),
    )


#: Headings of the table; lengths are in cells.
HEADS = (
    *("paper", "map", "planner", "quantity"),
    *("printed", "mean", "best", "solved", "shortest", "gap", "planning"),
)


def row_cells(row: ResultRow) -> list[str]:
    """Return a row of the table, under `HEADS`."""

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


NOTE = (
    "Some papers only picture their maps. Recreated maps are random maps of the same size whose shortest path is as long\n"
    "as the paper's best; on another map only the gap to the shortest path (`shortest`) is comparable.\n"
    "All lengths are in cells; a gap is a median with its 95 % interval over maps.\n\n"
)


def _write_table(heads: Sequence[str], rows: Iterable[Sequence[str]], path: Path, note: str = "") -> str:
    lines = [heads, ["---"] * len(heads), *rows]
    write_text(path, note + "".join(f"| {' | '.join(line)} |\n" for line in lines))
    return str(path)


def _write_csv(rows: Sequence[Mapping[str, Any]], path: Path) -> str:
    with atomic_write(path) as temporary, temporary.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        if rows:
            writer.writerow(list(rows[0]))
        writer.writerows([list(row.values()) for row in rows])
    return str(path)
