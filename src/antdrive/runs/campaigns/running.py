"""One run of a campaign in a worker process: drive, measure, keep the log if wanted."""

from __future__ import annotations

import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal, TypeAlias

from antdrive.base.components import ComponentError
from antdrive.base.errors import InputError
from antdrive.base.files import MAX_BYTES, read_bytes
from antdrive.runs.campaigns.job import Job
from antdrive.runs.campaigns.rows import CRASHED, failed_row, run_row, too_slow_row
from antdrive.runs.pool import Done
from antdrive.sim.log.rollout import Rollout
from antdrive.sim.pipeline import Run, run

Keep: TypeAlias = Literal["none", "failed", "all"]
LOGS = "rollouts"  # folder of the kept logs


@dataclass(frozen=True, eq=False)
class Finished:
    """A worker's result of a run."""

    row: dict[str, Any]  # the result columns
    # the log as bytes, if it is kept and the worker does not share the campaign's folder
    log: bytes | None = None


#: The work on a run; errors end up in its row.
Work: TypeAlias = Callable[[Job], Finished]


@dataclass(frozen=True)
class Driving:
    """Plan, drive and certify a run."""

    keep: Keep = "none"  # which runs' logs are kept
    folder: str | None = None  # the campaign's folder for the logs; None: they are returned

    def __call__(self, job: Job) -> Finished:
        """Make the run. An error of the planner or of antdrive is the run's result and does not end the campaign."""
        try:
            done = run(job.case.scenario(job.seed), progress=False)
        except InputError:
            raise
        except ComponentError as error:
            return Finished(failed_row(job.key, error.outcome, str(error)))
        except Exception as error:
            return Finished(failed_row(job.key, CRASHED, f"{type(error).__name__}: {error}"))
        return self._kept(job, done)

    def _kept(self, job: Job, done: Run) -> Finished:
        log = done.rollout
        if log is None or self.keep == "none" or (self.keep == "failed" and done.succeeded):
            return Finished(run_row(job.key, done, None))
        row = run_row(job.key, done, log_path(job.key))
        try:
            if self.folder is None:
                return Finished(row, _bytes_of(log))
            log.save(Path(self.folder) / log_path(job.key))
        except OSError as error:
            raise InputError(f"{log_path(job.key)}: cannot be written ({error.strerror or error})") from None
        return Finished(row)


def log_path(key: str) -> str:
    """Return the path of a run's log, relative to the campaign's folder."""
    return f"{LOGS}/{key[:2]}/{key}.npz"


def _bytes_of(log: Rollout) -> bytes:
    with tempfile.TemporaryDirectory() as folder:
        return read_bytes(log.save(Path(folder) / "log.npz"), MAX_BYTES)


def finished_of(done: Done[Job, Finished], limit: float | None) -> Finished:
    """Return a pool's result as a row, even if the process died or was killed after `limit` [s]."""
    if not done.died:
        assert done.result is not None
        row, log = done.result.row, done.result.log
    elif done.slow and limit is not None:
        row, log = too_slow_row(done.item.key, limit), None
    else:
        row, log = (
            failed_row(done.item.key, f"{done.died.partition(' ')[0]}_fault" if done.fault else CRASHED, done.died),
            None,
        )
    return Finished({**row, "attempts": done.attempts}, log)
