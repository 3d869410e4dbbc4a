"""Render the frames of a moving camera in several processes. They cost most: each needs a backdrop of its own."""

from __future__ import annotations

import uuid
from collections.abc import Iterator
from typing import Any

import joblib
import numpy as np
import numpy.typing as npt

from antdrive.base.processes import delayed
from antdrive.sim.log.rollout import Rollout
from antdrive.views.film.shot import Shot

Picture = npt.NDArray[np.uint8]  # (H, W, 3)
Floats = npt.NDArray[np.float64]

CHUNK = 16  # frames that a process renders before it hands them over
MIN_FRAMES = 300  # starting processes takes as long as rendering this many frames
MAX_PROCESSES = 8  # each takes some 150 MB


def process_count() -> int:
    """How many processes render at once by default: one per available core, at most `MAX_PROCESSES`."""
    return int(min(MAX_PROCESSES, joblib.cpu_count()))


def render_frames(rollout: Rollout, setting: dict[str, Any], times: Floats, jobs: int) -> Iterator[Picture]:
    """The frames (H, W, 3) in order, the same for any number of processes; `jobs` x `CHUNK` are held at once."""
    chunks = [(first, min(first + CHUNK, len(times))) for first in range(0, len(times), CHUNK)]
    film = uuid.uuid4().hex
    with joblib.Parallel(n_jobs=jobs) as pool:
        for k in range(0, len(chunks), jobs):
            work = [delayed(_render)(film, rollout, setting, times, *chunk) for chunk in chunks[k : k + jobs]]
            for rendered in pool(work):
                yield from rendered


#: The shot that a worker process has open, under the id of its film. It is closed when the next film begins.
_open: dict[str, Shot] = {}


def _render(film: str, rollout: Rollout, setting: dict[str, Any], times: Floats, first: int, end: int) -> list[Picture]:
    shot = _open.get(film)
    if shot is None:
        while _open:
            _open.popitem()[1].__exit__(None, None, None)
        shot = _open[film] = Shot(rollout, **setting).__enter__()
    for at in times[:first][times[:first] > shot.shown]:
        shot.extend_trail(at)
    return [shot.frame(at) for at in times[first:end]]
