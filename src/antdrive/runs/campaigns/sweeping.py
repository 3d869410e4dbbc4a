"""Run a campaign into a folder: keep existing results, make the missing runs."""

from __future__ import annotations

import contextlib
import dataclasses
import hashlib
import os
import shutil
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, get_args

from antdrive.base.atomic import atomic_write
from antdrive.base.errors import FieldError, InputError, input_error
from antdrive.base.optional import parquet_library
from antdrive.base.progress import progress_bar
from antdrive.base.version import require_physics, versions
from antdrive.runs.campaigns.campaign import Campaign, load_campaign, make_campaign
from antdrive.runs.campaigns.expanding import Expansion, expand
from antdrive.runs.campaigns.job import Job, SweepCase
from antdrive.runs.campaigns.results import SweepResults
from antdrive.runs.campaigns.rows import CRASHED, FAULTS, TOO_SLOW, grid_table
from antdrive.runs.campaigns.running import Driving, Finished, Keep, Work, finished_of
from antdrive.runs.campaigns.store import Store, former_grid, opened, read_manifest, results_in
from antdrive.runs.margins.choice import Calibration, choose_margin
from antdrive.runs.margins.loss import calibration_key
from antdrive.runs.pool import Done, Pool, cores
from antdrive.sim.log.outcome import Outcome
from antdrive.sim.scenario import unchosen
from antdrive.worlds import save_task

OUTCOMES = (*(one.key for one in Outcome), *FAULTS, CRASHED, TOO_SLOW)


@dataclass(frozen=True, eq=False)
class MissingRuns:
    """The runs to make."""

    jobs: tuple[Job, ...]  # runs to make, in the campaign's order
    discarded: frozenset[str]  # keys of those whose present results are discarded


def missing_runs(jobs: Sequence[Job], folder: Path, *, retry_crashed: bool, again: Sequence[str]) -> MissingRuns:
    """Return the runs that a folder lacks, and those to repeat."""
    planners = dict.fromkeys(name for job in jobs for name in (job.case.planner.label, job.case.planner.name))
    for word in again:
        if word not in planners and word not in OUTCOMES:
            raise InputError(
                f"--again {word}: no such planner or outcome; choose from {', '.join((*planners, *OUTCOMES))}"
            )
    outcomes, asked = results_in(folder, "outcome"), set(again)
    wanted, discarded = [], set()
    for job in jobs:
        outcome = outcomes.get(job.key)
        if outcome is not None and asked & {outcome, job.case.planner.label, job.case.planner.name}:
            discarded.add(job.key)
        elif outcome is not None and not (retry_crashed and outcome == CRASHED):
            continue
        wanted.append(job)
    return MissingRuns(tuple(wanted), frozenset(discarded))


def differences(campaign: Campaign, jobs: Sequence[Job], folder: Path) -> tuple[str, ...]:
    """Return a sentence for each way in which a folder's finished runs differ from those of a campaign.

    Raises:
        InputError: the folder holds another campaign, none of whose finished runs is in this one, or runs with another
            default of smoothing.
    """
    former = former_grid(folder)
    if former is None or "planner_version" not in former.column_names:
        return ()
    now = {job.case.planner.label: job.case.planner.version for job in jobs}
    keys, made = {job.key for job in jobs}, results_in(folder, "version.antdrive")
    columns = (former[name].to_pylist() for name in ("key", "planner", "planner_version"))
    finished = [row for row in zip(*columns, strict=True) if row[0] in made]
    gone = [(planner, version) for key, planner, version in finished if key not in keys]
    changed = Counter((planner, version) for planner, version in gone if now.get(planner, version) != version)
    left = len(gone) - changed.total()
    manifest: Mapping[str, Any] = {}
    with contextlib.suppress(InputError):  # a damaged one is replaced
        manifest = read_manifest(folder)
    none_kept = left and left == len(finished)
    if none_kept and campaign.compared_by_default and set(former["smoothing"].to_pylist()) == {"clearance"}:
        said = f"contains {_runs_of(left)} with smoothing clearance; several planners drive their own plans by default"
        raise input_error(str(folder), f"{said}; add smoothing: clearance to resume, or use another folder (--out)")
    if none_kept and manifest.get("campaign") != campaign.document.data:
        said = f"contains the {_runs_of(left)} of another campaign ({manifest.get('source')})"
        raise input_error(str(folder), f"{said}, none of which is in this one; use another folder (--out)")
    sentences = [
        f"{_runs_of(count)} of {planner} came from {version}; {now[planner]} repeats them"
        for (planner, version), count in changed.items()
    ]
    if left:
        sentences.append(
            f"{_runs_of(left)} of the previous campaign ({manifest.get('source')}) leave the table of {folder}: they are not "
            "in this one; the previous command restores them"
        )
    current = versions()["antdrive"]
    old = Counter(made[key] for key, *_ in finished if key in keys and made[key] not in (None, current))
    sentences += [
        f"{_runs_of(count)} came from antdrive {version}, new ones come from {current}; a new folder repeats all"
        for version, count in old.items()
    ]
    return tuple(sentences)


def _runs_of(count: int) -> str:
    return "1 run" if count == 1 else f"{count} runs"


def sweep(
    campaign: Campaign | str | os.PathLike[str] | Mapping[str, Any],
    folder: str | os.PathLike[str],
    *,
    expansion: Expansion | None = None,
    jobs: int | None = None,
    dask: str | None = None,
    keep: Keep | None = None,
    retry_crashed: bool = False,
    again: Sequence[str] = (),
    progress: Callable[[int, int], None] | bool | None = None,
    notify: Callable[[str], None] | None = None,
    work: Work | None = None,
) -> SweepResults:
    """Make all missing runs of a campaign. After an interruption, the same call resumes it.

    Args:
        campaign: a campaign, its file, or plain data with the keys of such a file
        folder: the folder of results
        expansion: the campaign's runs, if known
        jobs: number of processes; None: one per core; 0: this process; a run that crashes ends it
        dask: a cluster to run on: "local:N", or the address of a scheduler, "tcp://HOST:PORT"
        keep: which runs' logs are kept: none, failed or all; None: the campaign's choice
        retry_crashed: whether to repeat crashed runs
        again: planners, by label or name, and outcomes whose runs are repeated; their present results are discarded
        progress: called at the start and after each run with the numbers of finished and of all runs; True: show a bar on
            stderr; False: show nothing; None: show a bar in a notebook
        notify: called before the first run with a sentence for each way in which earlier runs differ from the campaign's, and
            for each setting without effect, for skipped problems and for the floor of random tasks
        work: the work on each run; None: drive it

    Raises:
        InputError: the campaign is invalid, the folder holds another one, another process writes into it, or the
            scheduler is gone.
    """
    campaign = campaign_of(campaign)
    _validate(campaign, jobs, dask, keep)
    expansion = expansion or expand(campaign)
    parquet_library()
    with progress_bar(progress, "campaign") as report, opened(folder) as store:
        missing = missing_runs(expansion.jobs, store.folder, retry_crashed=retry_crashed, again=again)
        if missing.jobs and work is None:
            require_physics()
        notes = differences(campaign, expansion.jobs, store.folder)
        if notify is not None:
            for note in (*notes, *expansion.remarks, *expansion.idle_notes()):
                notify(note)
        store.claim(_manifest(campaign, expansion))
        if missing.discarded:
            store.drop(missing.discarded)
        all_jobs, wanted = calibrated(expansion.jobs), {job.key for job in missing.jobs}
        _begin(store, expansion, all_jobs)
        todo = [job for job in all_jobs if job.key in wanted]
        made, before, size = 0, len(all_jobs) - len(todo), len(all_jobs)
        report(before, size)
        # Workers on other machines return logs; local ones write them.
        shared = None if dask is not None and not dask.startswith("local:") else str(store.folder.resolve())
        driving = Driving(keep or campaign.entry.rollouts, shared)
        try:
            limit = campaign.entry.run_limit
            with _runs(todo, work or driving, jobs, dask, limit=limit, tick=store.tick) as runs:
                for done in runs:
                    finished = finished_of(done, limit)
                    store.add(finished.row, finished.log)
                    made += 1
                    report(before + made, size)
        finally:
            table = store.finish()
    return SweepResults(Path(folder), table, size, made)


def _validate(campaign: Campaign, jobs: int | None, dask: str | None, keep: str | None) -> None:
    """Reject invalid arguments before any work."""
    if jobs is not None and (not isinstance(jobs, int) or jobs < 0):
        raise FieldError("jobs", f"must be a number of processes, or 0 for this process, got {jobs!r}")
    if dask is not None:
        from antdrive.runs.cluster import validate_address

        validate_address(dask)
    if keep is not None and keep not in get_args(Keep):
        raise FieldError("keep", f"unknown {keep!r}; choose from {', '.join(get_args(Keep))}")
    if jobs == 0 and dask is None and campaign.entry.run_limit is not None:
        raise FieldError("jobs", "must be at least 1 with a run_limit: this process cannot end itself")


@contextlib.contextmanager
def _runs(
    todo: Sequence[Job], work: Work, jobs: int | None, dask: str | None, **watched: Any
) -> Iterator[Iterator[Done[Job, Finished]]]:
    """Run the work on this machine or on a cluster."""
    if dask is not None:
        from antdrive.runs.cluster import run_on_cluster

        with contextlib.closing(run_on_cluster(work, todo, dask, **watched)) as runs:
            yield runs
    else:
        with Pool(cores() if jobs is None else jobs, **watched) as pool:
            yield pool.each(work, todo)


def calibrated(jobs: Iterable[Job]) -> list[Job]:
    """Return the runs with calibrated margins in place of "auto"; each robot and its settings are calibrated once."""
    chosen: dict[str, Calibration] = {}
    cases: dict[int, SweepCase] = {}
    for job in jobs:
        if job.case.resolved.margin == "auto" and id(job.case) not in cases:
            conditions = job.case.scenario(job.seed, unchosen).loss_factors
            key = calibration_key(conditions)
            if key not in chosen:
                chosen[key] = choose_margin(conditions)
            cases[id(job.case)] = dataclasses.replace(job.case, calibration=chosen[key])
    return [job._replace(case=cases[id(job.case)]) if id(job.case) in cases else job for job in jobs]


def campaign_of(campaign: Campaign | str | os.PathLike[str] | Mapping[str, Any]) -> Campaign:
    """Return a campaign from any of its forms."""
    if isinstance(campaign, Campaign):
        return campaign
    return make_campaign(campaign) if isinstance(campaign, Mapping) else load_campaign(campaign)


def _manifest(campaign: Campaign, expansion: Expansion) -> dict[str, Any]:
    """Return the manifest of a campaign's folder."""
    keys = "\n".join(sorted(job.key for job in expansion.jobs))
    return {
        "schema": 1,
        "source": Path(campaign.source).name,
        "campaign": campaign.document.data,
        "size": len(expansion.jobs),
        "hash": hashlib.sha256(keys.encode()).hexdigest(),
        "counts": expansion.counts,
        "duplicates": expansion.duplicates,
        "remarks": list(expansion.remarks),
        "versions": versions(),
    }


def _begin(store: Store, expansion: Expansion, jobs: Sequence[Job]) -> None:
    """Write the files of worlds, robots, planners and controllers that the runs' commands name, and the grid."""
    for path, task in expansion.worlds.items():
        if not (store.folder / path).exists():
            save_task(task, store.folder / path)
    for path, source in {**expansion.robots, **expansion.codes}.items():
        with atomic_write(store.folder / path) as part:
            shutil.copyfile(source, part)
    store.begin(grid_table(jobs))
