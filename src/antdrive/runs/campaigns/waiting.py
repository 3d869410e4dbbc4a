"""The runs that wait for a process: handed out in chunks, so that a process meets the same world again and again."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Iterable

from antdrive.runs.campaigns.job import Job

CHUNK_SECONDS = 2.0  # how long a chunk should take [s]
LONGEST_CHUNK = 256  # runs
WEIGHT = 0.1  # of the latest run in the mean time of a run


class Waiting:
    """Runs that wait, by world.

    A process goes on with the world of its last run, then takes one that no process has begun, and at last helps with the
    one of which most is left. Chunks take about two seconds by the mean time of recent runs, and less near the end.

    Attributes:
        processes: how many processes there are
    """

    def __init__(self, jobs: Iterable[Job], processes: int) -> None:
        self.processes = processes
        self._first: deque[Job] = deque()
        self._worlds: dict[str, deque[Job]] = {}
        self._length = 0
        for job in jobs:
            self._worlds.setdefault(job.case.world, deque()).append(job)
            self._length += 1
        self._fresh = deque(self._worlds)
        self._mean: float | None = None

    def __len__(self) -> int:
        return self._length

    def measured(self, seconds: float, runs: int = 1) -> None:
        """Take note of how long runs took."""
        weight = 1 - (1 - WEIGHT) ** runs
        each = seconds / runs
        self._mean = each if self._mean is None else (1 - weight) * self._mean + weight * each

    def put_back(self, jobs: Iterable[Job]) -> None:
        """Put runs in front of all others."""
        returned = list(jobs)
        self._first.extend(returned)
        self._length += len(returned)

    def chunk(self, world: str | None) -> list[Job]:
        """The next runs for a process; none if no run waits."""
        found: list[Job] = []
        most = self._chunk_length()
        while self._length and len(found) < most:
            if self._first:
                # One by one: where one of these kills its process, no other is in doubt.
                found, most = [self._first.popleft()], 1
                self._length -= 1
            else:
                world = self._next_world(found[-1].case.world if found else world)
                runs = self._worlds[world]
                taken = [runs.popleft() for _ in range(min(most - len(found), len(runs)))]
                found += taken
                self._length -= len(taken)
                if not runs:
                    del self._worlds[world]
        return found

    def _chunk_length(self) -> int:
        if self._mean is None:
            return 1
        by_time = CHUNK_SECONDS / max(self._mean, 1e-6)
        share = math.ceil(self._length / (2 * self.processes))
        return max(1, min(int(by_time), LONGEST_CHUNK, share))

    def _next_world(self, last: str | None) -> str:
        if last in self._worlds:
            return last
        while self._fresh:
            world = self._fresh.popleft()
            if world in self._worlds:
                return world
        return max(self._worlds, key=lambda world: len(self._worlds[world]))
