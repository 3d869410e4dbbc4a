"""What workers do in tests instead of driving: nothing, or something terrible."""

import os
import signal
import time
from dataclasses import dataclass
from pathlib import Path

from antdrive.runs.campaigns.rows import failed_row
from antdrive.runs.campaigns.running import Finished


@dataclass(frozen=True)
class Deadly:
    """A run whose seed is among `seeds` kills its process; with `marks`, a folder, only the first time."""

    seeds: tuple[int, ...] = ()
    marks: str = ""
    seconds: float = 0.0

    def __call__(self, job):
        time.sleep(self.seconds)
        mark = Path(self.marks) / job.key
        if job.seed in self.seeds and not (self.marks and mark.exists()):
            if self.marks:
                mark.touch()
            os.kill(os.getpid(), signal.SIGKILL)
        return Finished(failed_row(job.key, "succeeded", f"seed {job.seed}"))


@dataclass(frozen=True)
class Endless:
    """A run whose seed is among `seeds` does not end."""

    seeds: tuple[int, ...]

    def __call__(self, job):
        while job.seed in self.seeds:
            time.sleep(0.1)
        return Finished(failed_row(job.key, "succeeded", f"seed {job.seed}"))
