"""Workers on this or other machines through dask's `distributed`, in chunks of runs that may safely be made twice."""

from __future__ import annotations

import contextlib
import functools
import logging
import math
import os
import re
import signal
import threading
import time
from collections.abc import Callable, Generator, Iterable, Iterator, Sequence
from contextlib import contextmanager
from typing import Any

from antdrive.base.errors import input_error
from antdrive.runs.campaigns.extras import cluster_library
from antdrive.runs.campaigns.job import Job
from antdrive.runs.campaigns.local import ATTEMPTS
from antdrive.runs.campaigns.rows import CRASHED, fault_row, slow_row
from antdrive.runs.campaigns.running import Finished, Work, again
from antdrive.runs.campaigns.waiting import Waiting

CHUNKS_EACH = 3  # chunks that are at a worker or on their way to it
PATIENCE = 10.0  # how long a scheduler may be away before the campaign ends [s]
WORKERS_EVERY = 2.0  # how often the number of workers is asked for [s]
TICK = 0.005  # between looks at the tasks [s]
_LOCAL = re.compile(r"local:([1-9]\d{0,3})")


def run_on_cluster(
    jobs: Iterable[Job],
    work: Work,
    address: str,
    *,
    limit: float | None = None,
    tick: Callable[[], None] = lambda: None,
) -> Generator[Finished, None, None]:
    """Make runs on a cluster; the results come in any order.

    Raises:
        InputError: the address is wrong, the scheduler cannot be reached or is gone, or a run finds that the campaign cannot
            go on.
    """
    distributed = cluster_library()
    with _client(distributed, address) as client:
        waiting, at_work, asked = Waiting(jobs, 1), dict[Any, list[Job]](), -math.inf
        suspects: list[Job] = []
        tried: Job | None = None
        since = math.inf  # when the run began that is tried alone
        while waiting or at_work or suspects:
            if time.monotonic() - asked > WORKERS_EVERY:
                waiting.processes, asked = _workers(client, address), time.monotonic()
            while waiting and len(at_work) < CHUNKS_EACH * waiting.processes:
                _submit(client, work, waiting.chunk(None), at_work, limit)
            # Workers that die are held against all runs that they were handed: each is tried with nothing beside it.
            if not at_work:
                tried, since = suspects.pop(), time.monotonic()
                _submit(client, work, [tried], at_work, limit)
            tick()
            ended = [future for future in at_work if future.done()]
            if not ended:
                time.sleep(TICK)
            if any(future.cancelled() for future in ended):
                _require_scheduler(client, address)
            for future in ended:
                chunk = at_work.pop(future)
                if _killed(future) and chunk != [tried]:
                    suspects += chunk
                else:
                    slow = limit is not None and time.monotonic() - since >= limit
                    yield from _received(future, chunk, waiting, limit if slow else None)


def _submit(client: Any, work: Work, chunk: list[Job], at_work: dict[Any, list[Job]], limit: float | None) -> None:
    # As part of the function the runs are not searched for results of other tasks, which takes long.
    at_work[client.submit(functools.partial(run_chunk, work, chunk, limit), pure=False)] = chunk


def run_chunk(work: Work, jobs: Sequence[Job], limit: float | None = None) -> tuple[list[Finished], float]:
    """Make runs one after the other; their results, and the time that they took [s]."""
    started, finished = time.monotonic(), []
    for job in jobs:
        with _ended_after(limit):
            finished.append(work(job))
    return finished, time.monotonic() - started


@contextmanager
def _ended_after(limit: float | None) -> Iterator[None]:
    """A context that ends this process if it lasts too long: no other end reaches whatever a planner does."""
    if limit is None:
        yield
        return
    watch = threading.Timer(limit, os.kill, (os.getpid(), signal.SIGKILL))
    watch.daemon = True
    watch.start()
    try:
        yield
    finally:
        watch.cancel()


def _received(future: Any, chunk: list[Job], waiting: Waiting, limit: float | None) -> Generator[Finished, None, None]:
    """The results of a chunk; those of a chunk that killed its workers while it was alone, for the `limit` if there is one."""
    if future.status == "finished":
        finished, seconds = future.result()
        waiting.measured(seconds, len(chunk))
        yield from finished
    elif _killed(future):
        for job in chunk:
            crash = fault_row(job.key, CRASHED, "the processes that made it ended")
            yield again(Finished(crash if limit is None else slow_row(job.key, limit)), ATTEMPTS)
    elif future.status == "error":
        raise future.exception()
    else:  # cancelled: the connection was lost for a while
        waiting.put_back(chunk)


def _killed(future: Any) -> bool:
    """Whether a task ended because the workers died that it was handed to."""
    return future.status == "error" and type(future.exception()).__name__ == "KilledWorker"


@contextmanager
def _client(distributed: Any, address: str) -> Iterator[Any]:
    """A context with a client of the cluster at an address."""
    match = _LOCAL.fullmatch(address)
    if match is None and not re.match(r"(tcp|tls|ucx|ws|wss)://.", address):
        raise input_error(
            "--dask", address, "write local:N with a number of processes above 0, or tcp://HOST:PORT of a scheduler"
        )
    with contextlib.ExitStack() as stack:
        target: Any = address
        if match:
            import dask

            stack.enter_context(dask.config.set({"distributed.scheduler.allowed-failures": 1}))
            target = stack.enter_context(
                distributed.LocalCluster(
                    n_workers=int(match[1]),
                    threads_per_worker=1,
                    memory_limit=0,
                    dashboard_address="127.0.0.1:0",
                    silence_logs=logging.CRITICAL,
                )
            )
        try:
            client = stack.enter_context(distributed.Client(target, timeout=PATIENCE))
        except OSError as error:
            raise input_error("--dask", address, f"no scheduler answers ({error})") from None
        yield client


def _workers(client: Any, address: str) -> int:
    """How many workers a cluster has; 1 if it has none yet."""
    _require_scheduler(client, address)
    try:
        return max(1, len(client.scheduler_info(n_workers=-1)["workers"]))
    except (OSError, RuntimeError):
        _require_scheduler(client, address)
        return 1


def _require_scheduler(client: Any, address: str) -> None:
    """Wait for a connection that was lost.

    Raises:
        InputError: it does not come back.
    """
    deadline = time.monotonic() + PATIENCE
    while client.status == "connecting" and time.monotonic() < deadline:
        time.sleep(TICK)
    if client.status != "running":
        raise input_error("--dask", address, "the scheduler is gone; the same command goes on with what is missing")
