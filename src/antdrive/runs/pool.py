"""Pool of worker processes on this machine for many runs.

A worker has one run at a time. If it dies, only that run is lost, and it is tried once more. Workers end when their parent
does.
`antdrive.runs.cluster` is the same pool on a dask cluster.
"""

from __future__ import annotations

import contextlib
import multiprocessing
import os
import signal
import time
import traceback
from collections import deque
from collections.abc import Callable, Generator, Iterable, Iterator
from dataclasses import dataclass
from multiprocessing.connection import Connection, wait
from typing import Any, Generic, NoReturn, TypeVar

from antdrive.base import kernel_cache, supervision, system
from antdrive.base.errors import InputError

Item = TypeVar("Item")
Result = TypeVar("Result")

ATTEMPTS = 2  # for a run that kills its process
STILLBORN = 3  # after this many consecutive workers that die before they are ready, the pool gives up
POLL_INTERVAL = 1.0  # longest wait for a result before other duties [s]
GRACE = 1.0  # time for workers to end by themselves [s]


@dataclass(eq=False)
class Ticket(Generic[Item]):
    """A run in the queue, with its index and the number of processes it has killed."""

    number: int
    item: Item
    attempts: int = 0


class WorkerDied(RuntimeError):
    """A run killed the process that executed it."""


@dataclass(frozen=True, eq=False)
class Done(Generic[Item, Result]):
    """The result of one item."""

    item: Item  # the item
    number: int  # its index among the items
    result: Result | None = None  # return value of the work; None if the process died
    died: str = ""  # how the process died, in words; empty if it did not
    slow: bool = False  # whether the process was killed because the run exceeded the limit
    fault: bool = (
        False  # whether user code ended the process, or was killed because it exceeded the limit on planning time
    )
    attempts: int = 1  # number of attempts

    @property
    def value(self) -> Result:
        """The result."""
        if self.died:
            raise WorkerDied(f"{self.item!r:.100}: {self.died}")
        return self.result  # type: ignore[return-value]  # may be None


def cores() -> int:
    """Return the number of processor cores of this container or host."""
    import joblib

    return int(joblib.cpu_count())


def processes_for(jobs: int | None) -> int:
    """Return the number of processes for `jobs` (None: one per core); 0 (this process) for one job or in a worker."""
    jobs = cores() if jobs is None else jobs
    return 0 if jobs == 1 or multiprocessing.parent_process() is not None else jobs


@dataclass(eq=False)
class _Worker:
    """A worker process, as seen by its parent."""

    process: Any
    pipe: Connection
    work: Callable[[Any], Any]
    ready: bool = False
    ticket: Ticket[Any] | None = None  # the current run
    since: float = 0.0  # start of the current run
    slow: bool = False  # whether it was killed because that run exceeded the limit
    fault: str = ""  # what user code did to the process


@dataclass(frozen=True)
class _Raised:
    """An exception of the work, returned by a worker."""

    error: Exception


@dataclass(frozen=True)
class _Compiles:
    """A message that a worker compiles a kernel."""

    kernel: str


@dataclass(frozen=True)
class _Fault:
    """A sentence about user code that ended a worker, from the worker's supervisor."""

    sentence: str


class Pool:
    """Processes for many runs; they serve successive calls until the pool is closed.

    Args:
        processes: number of processes; 0: this process, without protection from runs that kill it
        limit: wall-clock limit of a run [s]
        tick: called at least once a second while waiting for results
    """

    def __init__(self, processes: int, *, limit: float | None = None, tick: Callable[[], None] = lambda: None) -> None:
        self._processes, self._limit, self._tick = min(processes, system.MOST_WORKERS), limit, tick
        self._workers: list[_Worker] = []

    def __enter__(self) -> Pool:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def each(self, work: Callable[[Item], Result], items: Iterable[Item]) -> Generator[Done[Item, Result], None, None]:
        """Run the work for each item; yield results in order of arrival."""
        if not self._processes:
            for number, item in enumerate(items):
                yield Done(item, number, work(item))
            return
        waiting = deque(Ticket(number, item) for number, item in enumerate(items))
        stillborn = 0
        try:
            while waiting or any(worker.ticket for worker in self._workers):
                self._staff(work, waiting)
                ended = wait([worker.pipe for worker in self._workers], self._patience())
                if not ended:
                    self._tick()
                self._end_slow()
                for worker in [worker for worker in self._workers if worker.pipe in ended]:
                    try:
                        answer = worker.pipe.recv()
                    except (EOFError, OSError):
                        stillborn = 0 if worker.ready else stillborn + 1
                        if stillborn >= STILLBORN:
                            problem = "worker processes die while starting; check the free memory"
                            raise InputError(f"--jobs: {problem}") from None
                        yield from self._reap(worker, waiting)
                        continue
                    if isinstance(answer, _Fault):
                        worker.fault = answer.sentence
                        continue
                    if isinstance(answer, _Compiles):
                        kernel_cache.on_compile(answer.kernel)
                        continue
                    if isinstance(answer, _Raised):
                        raise answer.error
                    if worker.ticket is not None:
                        yield _take_result(worker, worker.ticket, answer)
                    worker.ready, stillborn = True, 0
        finally:
            if any(worker.ticket or not worker.ready for worker in self._workers):
                self.close()

    def in_order(
        self, work: Callable[[Item], Result], items: Iterable[Item]
    ) -> Generator[Done[Item, Result], None, None]:
        """Run the work for each item; yield results in the order of the items."""
        early: dict[int, Done[Item, Result]] = {}
        following = 0
        with contextlib.closing(self.each(work, items)) as arriving:
            for done in arriving:
                early[done.number] = done
                while following in early:
                    yield early.pop(following)
                    following += 1

    def results(
        self, work: Callable[[Item], Result], items: Iterable[Item], *, in_order: bool = True
    ) -> Generator[Result, None, None]:
        """Run the work for each item; yield the results, in the order of the items or of arrival."""
        with contextlib.closing((self.in_order if in_order else self.each)(work, items)) as arriving:
            for done in arriving:
                yield done.value

    def close(self) -> None:
        """End the workers: idle ones at once, busy ones after a grace period."""
        for worker in self._workers:
            worker.pipe.close()
        deadline = time.monotonic() + GRACE
        while self._workers:
            process = self._workers.pop().process
            process.join(max(0.0, deadline - time.monotonic()))
            if process.is_alive():
                with contextlib.suppress(OSError):
                    system.kill(process.pid)  # loky's processes have no `kill`
                process.join()

    def _staff(self, work: Callable[[Any], Any], waiting: deque[Ticket[Any]]) -> None:
        """Hand runs to idle workers and start missing ones."""
        for worker in self._workers:
            if worker.ready and worker.ticket is None and waiting:
                _hand(worker, work, waiting.popleft())
        idle = sum(worker.ticket is None for worker in self._workers)
        for _ in range(min(len(waiting) - idle, self._processes - len(self._workers))):
            self._workers.append(_start(work))

    def _patience(self) -> float:
        """Return how long to wait for a result: until a run exceeds the limit, at most a second [s]."""
        if self._limit is None:
            return POLL_INTERVAL
        now = time.monotonic()
        left = [one.since + self._limit - now for one in self._workers if one.ticket and not one.slow]
        return max(0.0, min([POLL_INTERVAL, *left]))

    def _end_slow(self) -> None:
        """Kill workers whose run exceeds the limit; their closed pipe reports it."""
        for worker in self._workers:
            at_work = worker.ticket and not worker.pipe.poll()
            if self._limit is not None and at_work and time.monotonic() - worker.since > self._limit:
                worker.slow = True
                with contextlib.suppress(OSError):
                    system.kill(worker.process.pid)

    def _reap(self, worker: _Worker, waiting: deque[Ticket[Any]]) -> Iterator[Done[Any, Any]]:
        """Return a dead worker's run to the queue, or yield it if that was the last attempt."""
        self._workers.remove(worker)
        worker.pipe.close()
        worker.process.join()
        ticket = worker.ticket
        if ticket is None:
            return
        ticket.attempts += 1
        if worker.slow or worker.fault or ticket.attempts == ATTEMPTS:
            died = worker.fault or f"its process ended {_how(worker.process.exitcode)}"
            tries, fault = ticket.attempts, bool(worker.fault)
            yield Done(ticket.item, ticket.number, died=died, slow=worker.slow, fault=fault, attempts=tries)
        else:
            waiting.appendleft(ticket)


def call_now(call: Callable[[], Result]) -> Result:
    """Return the result of a call; `operator.call` needs Python 3.11."""
    return call()


def in_new_process(call: Callable[[], Result]) -> Result | None:
    """Return a call's result from a new process, where sets of texts have another order; None if it fails there."""
    with contextlib.suppress(Exception), Pool(1) as pool:
        return next(pool.results(call_now, [call]))
    return None


def _take_result(worker: _Worker, ticket: Ticket[Any], result: Any) -> Done[Any, Any]:
    """Return the result of a worker's run; the worker is idle."""
    worker.ticket, worker.slow = None, False
    return Done(ticket.item, ticket.number, result, attempts=ticket.attempts + 1)


def _hand(worker: _Worker, work: Callable[[Any], Any], ticket: Ticket[Any]) -> None:
    """Hand a run to an idle worker."""
    changed = None if worker.work is work else work
    worker.work, worker.since, worker.ticket = work, time.monotonic(), ticket
    with contextlib.suppress(OSError):  # dead; its pipe will show it
        worker.pipe.send_bytes(_packed((changed, ticket.item)))


def _how(code: int) -> str:
    if code >= 0:
        return f"with exit code {code}"
    try:
        return f"by {signal.Signals(-code).name}"
    except ValueError:
        return f"by signal {-code}"


def _start(work: Callable[[Any], Any]) -> _Worker:
    # Unlike those of multiprocessing, loky's processes do not import the caller's script again.
    from joblib.externals.loky.backend import get_context

    context = get_context("loky")
    here, there = context.Pipe()
    process = context.Process(target=serve, args=(there, work), daemon=False)
    # A terminal sends Ctrl-C to every process, but the parent decides when its workers end.
    with system.blocked(signal.SIGINT):
        process.start()
    there.close()
    return _Worker(process, here, work)


def serve(pipe: Connection, work: Callable[[Any], Any]) -> None:
    """Execute the runs received through a pipe until the parent closes it."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # in case it could not be blocked

    def report(sentence: str) -> NoReturn:
        with contextlib.suppress(OSError):
            pipe.send_bytes(_packed(_Fault(sentence)))
        os._exit(1)

    def compiles(kernel: str) -> None:
        with contextlib.suppress(OSError):
            pipe.send_bytes(_packed(_Compiles(kernel)))

    supervision.arm(report)
    kernel_cache.on_compile = compiles
    with contextlib.suppress(EOFError, OSError):  # the parent closed the pipe, or died
        pipe.send(None)
        while True:
            changed, item = pipe.recv()
            work = changed or work
            pipe.send_bytes(_answer(work, item))
    supervision.finish()


def _answer(work: Callable[[Any], Any], item: Any) -> bytes:
    """Return an item's result as bytes for the parent."""
    try:
        return _packed(work(item))
    except Exception as error:
        if not isinstance(error, InputError):
            error.add_note(traceback.format_exc())
        try:
            return _packed(_Raised(error))
        except Exception:
            return _packed(_Raised(RuntimeError(f"{type(error).__name__}: {error}")))


def _packed(message: Any) -> bytes:
    """Pickle a message; functions and classes of a script are pickled by value."""
    from joblib.externals.loky.backend.reduction import dumps

    return bytes(dumps(message))
