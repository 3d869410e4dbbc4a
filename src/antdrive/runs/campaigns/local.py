"""Worker processes on this machine. One that dies costs the run that it was making, and that run is tried once more.

A worker is handed a chunk of runs and hands back each result as soon as it has it, so that it is always known which run it
was making. Workers end by themselves when their parent does, however that ends.
"""

from __future__ import annotations

import contextlib
import os
import signal
import time
from collections import Counter, deque
from collections.abc import Callable, Generator, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from multiprocessing.connection import Connection, wait
from typing import Any

from antdrive.base.errors import InputError
from antdrive.runs.campaigns.job import Job
from antdrive.runs.campaigns.rows import CRASHED, fault_row, slow_row
from antdrive.runs.campaigns.running import Finished, Work, again
from antdrive.runs.campaigns.waiting import Waiting

ATTEMPTS = 2  # of a run that kills its process
STILLBORN = 3  # workers in a row that end before they are ready, after which none is started
LOOK = 1.0  # how long to wait for a result before something else is done [s]
GRACE = 1.0  # how long workers may take to end by themselves [s]


@dataclass(eq=False)
class _Worker:
    """A worker process, as its parent sees it."""

    process: Any
    pipe: Connection
    ready: bool = False
    handed: deque[Job] = field(default_factory=deque)  # the first is the one that is being made
    world: str | None = None
    since: float = 0.0  # when the run began that is being made
    slow: bool = False  # whether it was ended because that run took too long


def run_here(jobs: Iterable[Job], work: Work) -> Generator[Finished, None, None]:
    """Make runs in this process, without protection from runs that kill it."""
    for job in jobs:
        yield work(job)


@dataclass(frozen=True)
class Refusal:
    """What a worker hands back where the campaign cannot go on.

    Attributes:
        problem: what is wrong, in one line
    """

    problem: str


def run_locally(
    jobs: Iterable[Job],
    work: Work,
    processes: int,
    *,
    limit: float | None = None,
    tick: Callable[[], None] = lambda: None,
) -> Generator[Finished, None, None]:
    """Make runs in worker processes; the results come in any order.

    Raises:
        InputError: no worker can be started, or a run finds that the campaign cannot go on.
    """
    waiting = Waiting(jobs, processes)
    workers: list[_Worker] = []
    attempts: Counter[str] = Counter()
    stillborn = 0
    try:
        while waiting or any(worker.handed for worker in workers):
            while waiting and len(workers) < processes:
                workers.append(_start(work))
            ended = wait([worker.pipe for worker in workers], _patience(workers, limit))
            if not ended:
                tick()
            _end_slow(workers, limit)
            for pipe in ended:
                worker = next(worker for worker in workers if worker.pipe is pipe)
                try:
                    finished = worker.pipe.recv()
                except (EOFError, OSError):
                    workers.remove(worker)
                    stillborn = 0 if worker.ready else stillborn + 1
                    if stillborn >= STILLBORN:
                        raise InputError(
                            "--jobs: worker processes end before they begin; is there memory for them?"
                        ) from None
                    yield from _buried(worker, waiting, attempts, limit)
                    continue
                if isinstance(finished, Refusal):
                    raise InputError(finished.problem)
                if finished is not None:
                    yield _credited(worker, finished, waiting, attempts)
                worker.ready, stillborn = True, 0
                if not worker.handed:
                    _hand(worker, waiting)
    finally:
        _stop(workers)


def _patience(workers: Iterable[_Worker], limit: float | None) -> float:
    """How long to wait for a result: a second at most, and no longer than until a run takes too long [s]."""
    if limit is None:
        return LOOK
    now = time.monotonic()
    left = [worker.since + limit - now for worker in workers if worker.ready and worker.handed and not worker.slow]
    return max(0.0, min([LOOK, *left]))


def _end_slow(workers: Iterable[_Worker], limit: float | None) -> None:
    """End workers whose run takes too long; that they have ended shows when their pipe is read."""
    for worker in workers:
        at_work = worker.ready and worker.handed and not worker.pipe.poll()
        if limit is not None and at_work and time.monotonic() - worker.since > limit:
            worker.slow = True
            with contextlib.suppress(OSError):
                os.kill(worker.process.pid, signal.SIGKILL)


def _credited(worker: _Worker, finished: Finished, waiting: Waiting, attempts: Counter[str]) -> Finished:
    """The result of the run that a worker was making; the worker is making the next one now."""
    job, now = worker.handed.popleft(), time.monotonic()
    waiting.measured(now - worker.since)
    worker.world, worker.since, worker.slow = job.case.world, now, False
    return again(finished, attempts[job.key] + 1) if attempts[job.key] else finished


def _hand(worker: _Worker, waiting: Waiting) -> None:
    """Hand the next chunk to a worker that has nothing to do."""
    chunk = waiting.chunk(worker.world)
    if chunk:
        worker.handed.extend(chunk)
        worker.since = time.monotonic()
        with contextlib.suppress(OSError):  # it has died, which shows when its pipe is read
            worker.pipe.send(chunk)


def _buried(
    worker: _Worker, waiting: Waiting, attempts: Counter[str], limit: float | None
) -> Generator[Finished, None, None]:
    """Give back what a dead worker was handed; the run that it was making is a result if it was its last attempt."""
    worker.pipe.close()
    worker.process.join()
    if not worker.handed:
        return
    job = worker.handed.popleft()
    attempts[job.key] += 1
    if worker.slow and limit is not None:
        yield again(Finished(slow_row(job.key, limit)), attempts[job.key])
    elif attempts[job.key] < ATTEMPTS:
        worker.handed.appendleft(job)
    else:
        row = fault_row(job.key, CRASHED, f"the process that made it ended {_how(worker.process.exitcode)}")
        yield again(Finished(row), attempts[job.key])
    waiting.put_back(worker.handed)


def _how(code: int) -> str:
    if code >= 0:
        return f"with exit code {code}"
    try:
        return f"by {signal.Signals(-code).name}"
    except ValueError:
        return f"by signal {-code}"


def _start(work: Work) -> _Worker:
    # loky's processes, unlike those of multiprocessing, do not import the caller's script again.
    from joblib.externals.loky.backend import get_context

    context = get_context("loky")
    here, there = context.Pipe()
    process = context.Process(target=serve, args=(there, work), daemon=False)
    with _undisturbed():
        process.start()
    there.close()
    return _Worker(process, here)


@contextmanager
def _undisturbed() -> Iterator[None]:
    """A context in which processes start that Ctrl-C does not reach; for this process it is only put off.

    A terminal sends Ctrl-C to every process. What becomes of the workers is for the parent to decide.
    """
    if not hasattr(signal, "pthread_sigmask"):
        yield
        return
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _stop(workers: Iterable[_Worker]) -> None:
    """End workers: those that wait for work at once, the others when they have had time for the run that they are making."""
    for worker in workers:
        worker.pipe.close()
    deadline = time.monotonic() + GRACE
    for worker in workers:
        worker.process.join(max(0.0, deadline - time.monotonic()))
        if worker.process.is_alive():
            with contextlib.suppress(OSError):
                os.kill(worker.process.pid, signal.SIGKILL)  # loky's processes have no `kill`
            worker.process.join()


def serve(pipe: Connection, work: Work) -> None:
    """What a worker does: make the runs that it is handed until there is nobody to hand them."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # where it could not be blocked
    with contextlib.suppress(EOFError, OSError):  # the parent has closed the pipe, or is dead
        pipe.send(None)
        while True:
            for job in pipe.recv():
                if pipe.poll():  # while it is at work, a worker is sent nothing: the pipe was closed
                    return
                pipe.send(_result(work, job))


def _result(work: Work, job: Job) -> Finished | Refusal:
    try:
        return work(job)
    except InputError as error:
        return Refusal(str(error))
