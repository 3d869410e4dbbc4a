"""Run a campaign into a folder: what is there is kept, what is missing is run."""

from __future__ import annotations

import contextlib
import os
import shutil
from collections.abc import Callable, Generator, Iterable
from pathlib import Path

from antdrive.sim.campaigns.campaign import Campaign, load_campaign, make_campaign
from antdrive.sim.campaigns.expanding import Expansion, expand
from antdrive.sim.campaigns.job import Job
from antdrive.sim.campaigns.results import SweepResults
from antdrive.sim.campaigns.rows import grid_table
from antdrive.sim.campaigns.running import Driving, Finished, Keep
from antdrive.sim.campaigns.store import Store, opened
from antdrive.sim.pipeline import versions
from antdrive.worlds import save_task


def sweep(
    campaign: Campaign | str | os.PathLike[str] | dict[str, object],
    folder: str | os.PathLike[str],
    *,
    jobs: int = 1,
    keep: Keep | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> SweepResults:
    """Make all runs of a campaign that its folder does not hold yet.

    Args:
        campaign: a campaign, its file, or plain data with the keys of such a file
        folder: where results are kept
        jobs: number of processes
        keep: which runs' logs are kept: none, failed or all; None: as the campaign says
        progress: is called after each run with the numbers of runs done and of all

    Raises:
        InputError: something in the campaign is wrong, or another process writes into the folder.
    """
    asked = campaign_of(campaign)
    expansion = expand(asked)
    with opened(folder) as store:
        begin(store, asked, expansion)
        done = store.done()
        todo = [job for job in expansion.jobs if job.key not in done]
        work = Driving(keep or asked.entry.rollouts, str(store.folder.resolve()))
        made, before = 0, len(expansion.jobs) - len(todo)
        with contextlib.closing(_here(todo, work)) as finished:
            for one in finished:
                store.add(one.row)
                made += 1
                if progress is not None:
                    progress(before + made, len(expansion.jobs))
        table = store.finish()
    return SweepResults(Path(folder), table, len(expansion.jobs), made)


def campaign_of(campaign: Campaign | str | os.PathLike[str] | dict[str, object]) -> Campaign:
    """A campaign from whatever stands for it.

    Args:
        campaign: a campaign, its file, or plain data
    """
    if isinstance(campaign, Campaign):
        return campaign
    return make_campaign(campaign) if isinstance(campaign, dict) else load_campaign(campaign)


def begin(store: Store, campaign: Campaign, expansion: Expansion) -> None:
    """Write what is to be run: the manifest, the grid, and the worlds and robots that commands name.

    Args:
        store: the campaign's folder
        campaign: the campaign
        expansion: its runs
    """
    import hashlib

    keys = "\n".join(sorted(job.key for job in expansion.jobs))
    manifest = {
        "schema": 1,
        "source": Path(campaign.source).name,
        "campaign": campaign.document.data,
        "size": len(expansion.jobs),
        "hash": hashlib.sha256(keys.encode()).hexdigest(),
        "counts": expansion.counts,
        "versions": versions(),
    }
    for path, task in expansion.worlds.items():
        if not (store.folder / path).exists():
            save_task(task, store.folder / path)
    for path, source in expansion.robots.items():
        (store.folder / path).parent.mkdir(parents=True, exist_ok=True)
        shutil.copyfile(source, store.folder / path)
    store.begin(manifest, grid_table(expansion.jobs))


def _here(jobs: Iterable[Job], work: Driving) -> Generator[Finished, None, None]:
    for job in jobs:
        yield work(job)
