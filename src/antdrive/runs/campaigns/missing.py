"""Which runs of a campaign its folder lacks, and which of those it has are to be made again."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from antdrive.base.errors import InputError
from antdrive.runs.campaigns.job import Job
from antdrive.runs.campaigns.rows import CRASHED, PLANNER_FAULT, TOO_SLOW
from antdrive.runs.campaigns.store import former_grid, outcomes_in
from antdrive.sim.log.outcome import Outcome

OUTCOMES = (*(one.key for one in Outcome), PLANNER_FAULT, CRASHED, TOO_SLOW)


@dataclass(frozen=True, eq=False)
class MissingRuns:
    """What is to be done."""

    jobs: tuple[Job, ...]  # the runs to make, in the campaign's order
    forgotten: frozenset[str]  # the keys of those among them whose present results are to be forgotten


def missing_runs(jobs: Sequence[Job], folder: Path, *, retry_crashed: bool, again: Sequence[str]) -> MissingRuns:
    """The runs that a folder lacks, and those that are asked for again.

    Raises:
        InputError: a word of `again` is neither a planner of the campaign nor an outcome.
    """
    planners = dict.fromkeys(name for job in jobs for name in (job.case.planner, job.case.planner_name))
    for word in again:
        if word not in planners and word not in OUTCOMES:
            raise InputError(
                f"--again {word}: no such planner or outcome; choose from {', '.join((*planners, *OUTCOMES))}"
            )
    outcomes, asked = outcomes_in(folder), set(again)
    wanted, forgotten = [], set()
    for job in jobs:
        outcome = outcomes.get(job.key)
        if outcome is not None and asked & {outcome, job.case.planner, job.case.planner_name}:
            forgotten.add(job.key)
        elif outcome is not None and not (retry_crashed and outcome == CRASHED):
            continue
        wanted.append(job)
    return MissingRuns(tuple(wanted), frozenset(forgotten))


def changed_planners(jobs: Sequence[Job], folder: Path) -> Iterator[str]:
    """A sentence for each planner whose earlier runs were made with another version of it, and do not count any more."""
    former = former_grid(folder)
    if former is None or "planner_version" not in former.column_names:
        return
    now = {job.case.planner: job.case.planner_version for job in jobs}
    keys, made = {job.key for job in jobs}, outcomes_in(folder)
    columns = (former[name].to_pylist() for name in ("key", "planner", "planner_version"))
    old = Counter(
        (planner, version)
        for key, planner, version in zip(*columns, strict=True)
        if key in made and key not in keys and now.get(planner, version) != version
    )
    for (planner, version), count in old.items():
        runs = "1 run" if count == 1 else f"{count} runs"
        yield f"{runs} of {planner} came from {version}; {now[planner]} is here now, and makes them anew"
