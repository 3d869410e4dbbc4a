"""Workers on this or other machines through dask's `distributed`. Runs are safe to repeat."""

from __future__ import annotations

import contextlib
import functools
import logging
import math
import os
import re
import threading
import time
from collections import deque
from collections.abc import Callable, Generator, Iterable, Iterator
from contextlib import contextmanager
from typing import Any

from antdrive.base import system
from antdrive.base.errors import input_error
from antdrive.base.optional import optional
from antdrive.runs.pool import ATTEMPTS, Done, Item, Result, Ticket

RUNS_EACH = 3  # runs per worker, in progress or queued
PATIENCE = 10.0  # longest absence of the scheduler before the campaign ends [s]
WORKERS_EVERY = 2.0  # period of the query for the number of workers [s]
TICK = 0.005  # polling period of the tasks [s]
_LOCAL = re.compile(r"local:([1-9]\d{0,3})")


def run_on_cluster(
    work: Callable[[Item], Result],
    items: Iterable[Item],
    address: str,
    *,
    limit: float | None = None,
    tick: Callable[[], None] = lambda: None,
) -> Generator[Done[Item, Result], None, None]:
    """Run the work for each item on a cluster; yield the results in order of arrival."""
    distributed = optional("distributed", "cluster", "--dask spreads runs over machines")
    with _client(distributed, address) as client:
        waiting = deque(Ticket(number, item) for number, item in enumerate(items))
        at_work, workers, counted = dict[Any, Ticket[Item]](), 1, -math.inf

        def submit(ticket: Ticket[Item]) -> None:
            # dask searches arguments for results of other tasks, which is slow; it does not search a partial's arguments.
            at_work[client.submit(functools.partial(_made, work, ticket.item, limit), pure=False)] = ticket

        suspects: list[Ticket[Item]] = []
        tried: Ticket[Item] | None = None
        since = math.inf  # start of the run that is retried alone
        while waiting or at_work or suspects:
            if time.monotonic() - counted > WORKERS_EVERY:
                workers, counted = _workers(client, address), time.monotonic()
            while waiting and len(at_work) < RUNS_EACH * workers:
                submit(waiting.popleft())
            # Any run queued at a dead worker may have killed it, so each is retried alone.
            if not at_work:
                tried, since = suspects.pop(), time.monotonic()
                submit(tried)
            tick()
            ended = [future for future in at_work if future.done()]
            if not ended:
                time.sleep(TICK)
            if any(future.cancelled() for future in ended):
                _require_scheduler(client, address)
            for future in ended:
                ticket = at_work.pop(future)
                if _killed(future) and ticket is not tried:
                    suspects.append(ticket)
                else:
                    slow = limit is not None and time.monotonic() - since >= limit
                    yield from _received(future, ticket, waiting, slow)


def _made(work: Callable[[Item], Result], item: Item, limit: float | None) -> Result:
    """Return the result of a run within a limit."""
    with _ended_after(limit):
        return work(item)


@contextmanager
def _ended_after(limit: float | None) -> Iterator[None]:
    """Kill this process after `limit` seconds, since nothing else stops a planner."""
    if limit is None:
        yield
        return
    timer = threading.Timer(limit, system.kill, (os.getpid(),))
    timer.daemon = True
    timer.start()
    try:
        yield
    finally:
        timer.cancel()


def _received(future: Any, ticket: Ticket[Item], waiting: deque[Ticket[Item]], slow: bool) -> Iterator[Done[Item, Any]]:
    """Yield the result of a run. One that killed its workers while alone may have been too slow."""
    if future.status == "finished":
        try:
            yield Done(ticket.item, ticket.number, future.result())
        except OSError:  # the connection was lost before the result came
            waiting.appendleft(ticket)
    elif _killed(future):
        died = "its worker processes died"
        yield Done(ticket.item, ticket.number, died=died, slow=slow, attempts=ATTEMPTS)
    elif future.status == "error":
        raise future.exception()
    else:  # cancelled: the connection was lost temporarily
        waiting.appendleft(ticket)


def _killed(future: Any) -> bool:
    """Return whether a task ended because its workers died."""
    return future.status == "error" and type(future.exception()).__name__ == "KilledWorker"


def validate_address(address: str) -> None:
    """Raise `InputError` unless a text is an address of a cluster."""
    if not _LOCAL.fullmatch(address) and not re.match(r"(tcp|tls|ucx|ws|wss)://.", address):
        raise input_error(
            "--dask", address, "write local:N with N processes, at least 1, or tcp://HOST:PORT of a scheduler"
        )


@contextmanager
def _client(distributed: Any, address: str) -> Iterator[Any]:
    """Open a client of the cluster at an address."""
    validate_address(address)
    match = _LOCAL.fullmatch(address)
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
    """Return the number of workers, at least 1."""
    _require_scheduler(client, address)
    try:
        return max(1, len(client.scheduler_info(n_workers=-1)["workers"]))
    except (OSError, RuntimeError):
        _require_scheduler(client, address)
        return 1


def _require_scheduler(client: Any, address: str) -> None:
    """Wait for a lost connection to return, else raise."""
    deadline = time.monotonic() + PATIENCE
    while client.status == "connecting" and time.monotonic() < deadline:
        time.sleep(TICK)
    if client.status != "running":
        raise input_error("--dask", address, "the scheduler is gone; repeat the command to resume")
