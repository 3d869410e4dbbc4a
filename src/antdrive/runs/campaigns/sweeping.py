"""Run a campaign into a folder: what is there is kept, what is missing is run."""

from __future__ import annotations

import contextlib
import dataclasses
import hashlib
import os
import shutil
from collections.abc import Callable, Generator, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any, get_args

from antdrive.base.atomic import written_whole
from antdrive.base.errors import FieldError
from antdrive.runs.campaigns.campaign import Campaign, load_campaign, make_campaign
from antdrive.runs.campaigns.expanding import Expansion, expand
from antdrive.runs.campaigns.extras import parquet_library
from antdrive.runs.campaigns.job import Job, SweepCase
from antdrive.runs.campaigns.local import run_here, run_locally
from antdrive.runs.campaigns.missing import changed_planners, missing_runs
from antdrive.runs.campaigns.results import SweepResults
from antdrive.runs.campaigns.rows import grid_table
from antdrive.runs.campaigns.running import Driving, Finished, Keep, Work
from antdrive.runs.campaigns.store import Store, opened
from antdrive.runs.margins.choice import choose_margin
from antdrive.runs.margins.prediction import Calibration
from antdrive.sim.pipeline import versions
from antdrive.worlds import save_task


def sweep(
    campaign: Campaign | str | os.PathLike[str] | Mapping[str, Any],
    folder: str | os.PathLike[str],
    *,
    jobs: int | None = None,
    dask: str | None = None,
    keep: Keep | None = None,
    retry_crashed: bool = False,
    again: Sequence[str] = (),
    progress: Callable[[int, int], None] | None = None,
) -> SweepResults:
    """Make all runs of a campaign that its folder does not hold yet. Whatever ends it, the same call goes on later.

    Args:
        campaign: a campaign, its file, or plain data with the keys of such a file
        folder: where results are kept
        jobs: number of processes; None: one per core; 0: this process, which a run that crashes then ends
        dask: the cluster that makes the runs instead: "local:N", or the address of a scheduler, "tcp://HOST:PORT"
        keep: which runs' logs are kept: none, failed or all; None: as the campaign says
        retry_crashed: whether runs are made again that crashed
        again: planners, by label or name, and outcomes whose runs are made again; their present results are forgotten
        progress: is called at first and after each run with the numbers of runs that are done and of all

    Raises:
        InputError: something in the campaign is wrong, another process writes into the folder, or the scheduler is gone.
    """
    asked = campaign_of(campaign)
    return run_expansion(
        asked,
        expand(asked),
        folder,
        jobs=jobs,
        dask=dask,
        keep=keep,
        retry_crashed=retry_crashed,
        again=again,
        progress=progress,
    )


def run_expansion(
    campaign: Campaign,
    expansion: Expansion,
    folder: str | os.PathLike[str],
    *,
    jobs: int | None = None,
    dask: str | None = None,
    keep: Keep | None = None,
    retry_crashed: bool = False,
    again: Sequence[str] = (),
    progress: Callable[[int, int], None] | None = None,
    work: Work | None = None,
) -> SweepResults:
    """Make those runs of an expanded campaign that its folder does not hold yet.

    Raises:
        InputError: another process writes into the folder, or the scheduler is gone.
    """
    _check(campaign, jobs, dask, keep)
    parquet_library()
    report = progress or (lambda done, size: None)
    with opened(folder) as store:
        all_jobs = calibrated(expansion.jobs)
        missing = missing_runs(all_jobs, store.folder, retry_crashed=retry_crashed, again=again)
        notes = tuple(changed_planners(all_jobs, store.folder))
        if missing.forgotten:
            store.drop(missing.forgotten)
        _begin(store, campaign, expansion, all_jobs)
        made, before, size = 0, len(all_jobs) - len(missing.jobs), len(all_jobs)
        report(before, size)
        # Workers of another machine hand logs back; those of this one write them.
        shared = None if dask is not None and not dask.startswith("local:") else str(store.folder.resolve())
        driving = Driving(keep or campaign.entry.rollouts, shared)
        try:
            engine = _engine(missing.jobs, work or driving, jobs, dask, limit=campaign.entry.run_limit, tick=store.tick)
            with contextlib.closing(engine) as finished:
                for one in finished:
                    store.add(one.row, one.log)
                    made += 1
                    report(before + made, size)
        finally:
            table = store.finish()
    return SweepResults(Path(folder), table, size, made, notes)


def _check(campaign: Campaign, jobs: int | None, dask: str | None, keep: str | None) -> None:
    """Refuse, before any work, what a caller cannot mean."""
    if jobs is not None and (not isinstance(jobs, int) or jobs < 0):
        raise FieldError("jobs", f"must be a number of processes, or 0 for this process, got {jobs!r}")
    if keep is not None and keep not in get_args(Keep):
        raise FieldError("keep", f"unknown {keep!r}; choose from {', '.join(get_args(Keep))}")
    if jobs == 0 and dask is None and campaign.entry.run_limit is not None:
        raise FieldError("jobs", "must be at least 1 with a run_limit: this process cannot end itself")


def _engine(
    todo: Sequence[Job], work: Work, jobs: int | None, dask: str | None, **watched: Any
) -> Generator[Finished, None, None]:
    if dask is not None:
        from antdrive.runs.campaigns.cluster import run_on_cluster

        return run_on_cluster(todo, work, dask, **watched)
    if jobs == 0:
        return run_here(todo, work)
    import joblib

    cores = int(joblib.cpu_count())  # of a container, not of its host
    return run_locally(todo, work, min(jobs or cores, max(1, len(todo))), **watched)


def calibrated(jobs: Iterable[Job]) -> list[Job]:
    """The runs, with a margin for those that leave it to be chosen; each robot and its settings are calibrated once.

    Raises:
        FieldError: no margin leaves the reserve.
    """
    chosen: dict[str, Calibration] = {}
    cases: dict[int, SweepCase] = {}
    for job in jobs:
        if job.case.fields["margin"] == "auto" and id(job.case) not in cases:
            conditions = dataclasses.replace(job.case, calibration=None).scenario(job.seed, margin=0.0).conditions
            if conditions.key not in chosen:
                chosen[conditions.key] = choose_margin(conditions)
            cases[id(job.case)] = dataclasses.replace(job.case, calibration=chosen[conditions.key])
    return [job._replace(case=cases[id(job.case)]) if id(job.case) in cases else job for job in jobs]


def campaign_of(campaign: Campaign | str | os.PathLike[str] | Mapping[str, Any]) -> Campaign:
    """A campaign from whatever stands for it."""
    if isinstance(campaign, Campaign):
        return campaign
    return make_campaign(campaign) if isinstance(campaign, Mapping) else load_campaign(campaign)


def _begin(store: Store, campaign: Campaign, expansion: Expansion, jobs: Sequence[Job]) -> None:
    """Write what is to be run: the manifest, the grid, and the worlds and robots that commands name."""
    keys = "\n".join(sorted(job.key for job in jobs))
    manifest = {
        "schema": 1,
        "source": Path(campaign.source).name,
        "campaign": campaign.document.data,
        "size": len(jobs),
        "hash": hashlib.sha256(keys.encode()).hexdigest(),
        "counts": expansion.counts,
        "duplicates": expansion.duplicates,
        "versions": versions(),
    }
    for path, task in expansion.worlds.items():
        if not (store.folder / path).exists():
            save_task(task, store.folder / path)
    for path, source in {**expansion.robots, **expansion.planners}.items():
        with written_whole(store.folder / path) as part:
            shutil.copyfile(source, part)
    store.begin(manifest, grid_table(jobs))
