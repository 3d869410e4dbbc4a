"""The pool in which many runs are made: worker processes of this machine, or this process.

A worker that dies costs the run that it was making, and that run is tried once more. A worker is handed a chunk of runs and
hands back each result as soon as it has it, so that it is always known which run it was making. Workers end by themselves
when their parent does, however that ends. `antdrive.runs.cluster` has the same pool on a dask cluster.
"""

from __future__ import annotations

import contextlib
import math
import multiprocessing
import operator
import os
import signal
import time
import traceback
from collections import deque
from collections.abc import Callable, Generator, Hashable, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from multiprocessing.connection import Connection, wait
from typing import Any, Generic, TypeVar

from antdrive.base.errors import InputError

Item = TypeVar("Item")
Result = TypeVar("Result")

ATTEMPTS = 2  # of a run that kills its process
STILLBORN = 3  # workers in a row that end before they are ready, after which none is started
POLL_INTERVAL = 1.0  # how long to wait for a result before something else is done [s]
GRACE = 1.0  # how long workers may take to end by themselves [s]
CHUNK_SECONDS = 2.0  # how long a chunk should take [s]
LONGEST_CHUNK = 256  # runs
WEIGHT = 0.1  # of the latest run in the mean time of a run


@dataclass(eq=False)
class Ticket(Generic[Item]):
    """A run in the queue: its place among the items, and how often a process has died of it."""

    number: int
    item: Item
    group: Hashable = None
    attempts: int = 0


class Waiting(Generic[Item]):
    """Runs that wait, by group.

    A process goes on with the group of its last run, then takes one that no process has begun, and at last helps with the
    one of which most is left. Chunks take about two seconds by the mean time of recent runs, and less near the end.

    Attributes:
        processes: how many processes there are
    """

    def __init__(
        self, items: Iterable[Item], processes: int, group: Callable[[Item], Hashable] = lambda item: None
    ) -> None:
        self.processes = processes
        self._first: deque[Ticket[Item]] = deque()
        self._groups: dict[Hashable, deque[Ticket[Item]]] = {}
        self._length = 0
        for number, item in enumerate(items):
            ticket = Ticket(number, item, group(item))
            self._groups.setdefault(ticket.group, deque()).append(ticket)
            self._length += 1
        self._fresh = deque(self._groups)
        self._mean: float | None = None

    def __len__(self) -> int:
        return self._length

    def measured(self, seconds: float, runs: int = 1) -> None:
        """Take note of how long runs took."""
        weight = 1 - (1 - WEIGHT) ** runs
        each = seconds / runs
        self._mean = each if self._mean is None else (1 - weight) * self._mean + weight * each

    def put_back(self, tickets: Iterable[Ticket[Item]]) -> None:
        """Put runs in front of all others."""
        returned = list(tickets)
        self._first.extend(returned)
        self._length += len(returned)

    def chunk(self, group: Hashable = None) -> list[Ticket[Item]]:
        """The next runs for a process; none if no run waits."""
        found: list[Ticket[Item]] = []
        most = self._chunk_length()
        while self._length and len(found) < most:
            if self._first:
                # One by one: where one of these kills its process, no other is in doubt.
                found, most = [self._first.popleft()], 1
                self._length -= 1
            else:
                group = self._next_group(found[-1].group if found else group)
                runs = self._groups[group]
                taken = [runs.popleft() for _ in range(min(most - len(found), len(runs)))]
                found += taken
                self._length -= len(taken)
                if not runs:
                    del self._groups[group]
        return found

    def _chunk_length(self) -> int:
        if self._mean is None:
            return 1
        by_time = CHUNK_SECONDS / max(self._mean, 1e-6)
        share = math.ceil(self._length / (2 * self.processes))
        return max(1, min(int(by_time), LONGEST_CHUNK, share))

    def _next_group(self, last: Hashable) -> Hashable:
        if last in self._groups:
            return last
        while self._fresh:
            group = self._fresh.popleft()
            if group in self._groups:
                return group
        return max(self._groups, key=lambda group: len(self._groups[group]))


class WorkerDied(RuntimeError):
    """A run killed the process that made it."""


@dataclass(frozen=True, eq=False)
class Done(Generic[Item, Result]):
    """What came of one item."""

    item: Item  # the item
    number: int  # its place among the items
    result: Result | None = None  # what the work returned; None where its process died
    died: str = ""  # how its process ended, in words; empty where it did not die
    slow: bool = False  # whether the process was ended because the run took longer than the limit
    attempts: int = 1  # how often the run was tried

    @property
    def value(self) -> Result:
        """The result."""
        if self.died:
            raise WorkerDied(f"{self.item!r:.100}: {self.died}")
        return self.result  # type: ignore[return-value]  # may be None


def cores() -> int:
    """The number of processor cores: of a container, not of its host."""
    import joblib

    return int(joblib.cpu_count())


def processes_for(jobs: int | None) -> int:
    """The processes of a pool for `jobs` (None: one per core). 0, this process, for one, and in a worker of any pool."""
    jobs = cores() if jobs is None else jobs
    return 0 if jobs == 1 or multiprocessing.parent_process() is not None else jobs


@dataclass(eq=False)
class _Worker:
    """A worker process, as its parent sees it."""

    process: Any
    pipe: Connection
    work: Callable[[Any], Any]
    ready: bool = False
    handed: deque[Ticket[Any]] = field(default_factory=deque)  # the first is the one that is being made
    group: Hashable = None
    since: float = 0.0  # when the run began that is being made
    slow: bool = False  # whether it was ended because that run took too long


@dataclass(frozen=True)
class _Raised:
    """What a worker hands back where its work raised something."""

    error: Exception


class Pool:
    """Processes for many runs; they serve one call after the other until the pool is closed.

    Args:
        processes: their number; 0: this process, without protection from runs that kill it
        limit: wall-clock time after which a run is ended [s]
        tick: called once a second, at least, while results are waited for
    """

    def __init__(self, processes: int, *, limit: float | None = None, tick: Callable[[], None] = lambda: None) -> None:
        self._processes, self._limit, self._tick = processes, limit, tick
        self._workers: list[_Worker] = []

    def __enter__(self) -> Pool:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def each(
        self,
        work: Callable[[Item], Result],
        items: Iterable[Item],
        *,
        group: Callable[[Item], Hashable] = lambda item: None,
    ) -> Generator[Done[Item, Result], None, None]:
        """Do the work for each item; what comes of it, in order of arrival. A worker keeps to a group of items while it can."""
        if not self._processes:
            for number, item in enumerate(items):
                yield Done(item, number, work(item))
            return
        waiting = Waiting(items, self._processes, group)
        stillborn = 0
        try:
            while waiting or any(worker.handed for worker in self._workers):
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
                            problem = "worker processes end before they begin; is there memory for them?"
                            raise InputError(f"--jobs: {problem}") from None
                        yield from self._buried(worker, waiting)
                        continue
                    if isinstance(answer, _Raised):
                        raise answer.error
                    if worker.ready:
                        yield _credited(worker, answer, waiting)
                    worker.ready, stillborn = True, 0
        finally:
            if any(worker.handed or not worker.ready for worker in self._workers):
                self.close()

    def in_order(
        self, work: Callable[[Item], Result], items: Iterable[Item]
    ) -> Generator[Done[Item, Result], None, None]:
        """Do the work for each item; what comes of it in the order of the items, as soon as those before it are there."""
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
        """Do the work for each item; the results, in the order of the items or as they are made."""
        with contextlib.closing((self.in_order if in_order else self.each)(work, items)) as arriving:
            for done in arriving:
                yield done.value

    def close(self) -> None:
        """End the workers: those that wait for work at once, the others when they have had time for their present run."""
        for worker in self._workers:
            worker.pipe.close()
        deadline = time.monotonic() + GRACE
        while self._workers:
            process = self._workers.pop().process
            process.join(max(0.0, deadline - time.monotonic()))
            if process.is_alive():
                with contextlib.suppress(OSError):
                    os.kill(process.pid, signal.SIGKILL)  # loky's processes have no `kill`
                process.join()

    def _staff(self, work: Callable[[Any], Any], waiting: Waiting[Any]) -> None:
        """Hand chunks to idle workers, and start those that are missing."""
        for worker in self._workers:
            if worker.ready and not worker.handed:
                _hand(worker, work, waiting)
        idle = sum(not worker.handed for worker in self._workers)
        for _ in range(min(len(waiting) - idle, self._processes - len(self._workers))):
            self._workers.append(_start(work))

    def _patience(self) -> float:
        """How long to wait for a result: a second at most, and no longer than until a run takes too long [s]."""
        if self._limit is None:
            return POLL_INTERVAL
        now = time.monotonic()
        left = [one.since + self._limit - now for one in self._workers if one.ready and one.handed and not one.slow]
        return max(0.0, min([POLL_INTERVAL, *left]))

    def _end_slow(self) -> None:
        """End workers whose run takes too long; that they have ended shows when their pipe is read."""
        for worker in self._workers:
            at_work = worker.ready and worker.handed and not worker.pipe.poll()
            if self._limit is not None and at_work and time.monotonic() - worker.since > self._limit:
                worker.slow = True
                with contextlib.suppress(OSError):
                    os.kill(worker.process.pid, signal.SIGKILL)

    def _buried(self, worker: _Worker, waiting: Waiting[Any]) -> Iterator[Done[Any, Any]]:
        """Give back what a dead worker was handed; the run that it was making is a result if it was its last attempt."""
        self._workers.remove(worker)
        worker.pipe.close()
        worker.process.join()
        if not worker.handed:
            return
        ticket = worker.handed.popleft()
        ticket.attempts += 1
        if worker.slow or ticket.attempts == ATTEMPTS:
            died = f"the process that made it ended {_how(worker.process.exitcode)}"
            yield Done(ticket.item, ticket.number, died=died, slow=worker.slow, attempts=ticket.attempts)
        else:
            worker.handed.appendleft(ticket)
        waiting.put_back(worker.handed)


def call_all(calls: Iterable[Callable[[], Result]], jobs: int | None = None) -> list[Result]:
    """What calls without arguments return, made in processes (None: one per core)."""
    with Pool(processes_for(jobs)) as pool:
        return list(pool.results(operator.call, calls))


def _credited(worker: _Worker, result: Any, waiting: Waiting[Any]) -> Done[Any, Any]:
    """The result of the run that a worker was making; the worker is making the next one now."""
    ticket, now = worker.handed.popleft(), time.monotonic()
    waiting.measured(now - worker.since)
    worker.group, worker.since, worker.slow = ticket.group, now, False
    return Done(ticket.item, ticket.number, result, attempts=ticket.attempts + 1)


def _hand(worker: _Worker, work: Callable[[Any], Any], waiting: Waiting[Any]) -> None:
    """Hand the next chunk to a worker that has nothing to do."""
    chunk = waiting.chunk(worker.group)
    if chunk:
        changed = None if worker.work is work else work
        worker.work, worker.since = work, time.monotonic()
        worker.handed.extend(chunk)
        with contextlib.suppress(OSError):  # it has died, which shows when its pipe is read
            worker.pipe.send_bytes(_packed((changed, [ticket.item for ticket in chunk])))


def _how(code: int) -> str:
    if code >= 0:
        return f"with exit code {code}"
    try:
        return f"by {signal.Signals(-code).name}"
    except ValueError:
        return f"by signal {-code}"


def _start(work: Callable[[Any], Any]) -> _Worker:
    # loky's processes, unlike those of multiprocessing, do not import the caller's script again.
    from joblib.externals.loky.backend import get_context

    context = get_context("loky")
    here, there = context.Pipe()
    process = context.Process(target=serve, args=(there, work), daemon=False)
    with _undisturbed():
        process.start()
    there.close()
    return _Worker(process, here, work)


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


def serve(pipe: Connection, work: Callable[[Any], Any]) -> None:
    """What a worker does: make the runs that it is handed until there is nobody to hand them."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # where it could not be blocked
    with contextlib.suppress(EOFError, OSError):  # the parent has closed the pipe, or is dead
        pipe.send(None)
        while True:
            changed, items = pipe.recv()
            work = changed or work
            for item in items:
                if pipe.poll():  # while it is at work, a worker is sent nothing: the pipe was closed
                    return
                pipe.send_bytes(_answer(work, item))


def _answer(work: Callable[[Any], Any], item: Any) -> bytes:
    """What came of an item, as bytes for the parent."""
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
    """A message as bytes; functions and classes of a script go by value."""
    from joblib.externals.loky.backend.reduction import dumps

    return bytes(dumps(message))
