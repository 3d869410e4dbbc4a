"""The queue of a pool: runs handed out in chunks, so that a process meets the same group (a world) again and again."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable, Hashable, Iterable
from dataclasses import dataclass
from typing import Generic, TypeVar

Item = TypeVar("Item")

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
