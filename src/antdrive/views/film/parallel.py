"""Render the frames of a moving camera in several processes. They cost most: each needs a backdrop of its own."""

from __future__ import annotations

import functools
import uuid
from collections.abc import Iterator
from typing import Any

import numpy as np
import numpy.typing as npt

from antdrive.runs.pool import Pool, cores
from antdrive.sim.log.rollout import Rollout
from antdrive.views.film.shot import Shot

Picture = npt.NDArray[np.uint8]  # (H, W, 3)
Floats = npt.NDArray[np.float64]

CHUNK = 16  # frames that a process renders before it hands them over
MIN_FRAMES = 300  # starting processes takes as long as rendering this many frames
MAX_PROCESSES = 8  # each takes some 150 MB


def process_count() -> int:
    """How many processes render at once by default: one per available core, at most `MAX_PROCESSES`."""
    return min(MAX_PROCESSES, cores())


def render_frames(rollout: Rollout, setting: dict[str, Any], times: Floats, jobs: int) -> Iterator[Picture]:
    """The frames (H, W, 3) in order, the same for any number of processes; `jobs` x `CHUNK` are held at once."""
    chunks = [(first, min(first + CHUNK, len(times))) for first in range(0, len(times), CHUNK)]
    render = functools.partial(_render, uuid.uuid4().hex, rollout, setting, times)
    with Pool(0 if jobs == 1 else jobs) as pool:
        for k in range(0, len(chunks), jobs):
            for rendered in pool.results(render, chunks[k : k + jobs]):
                yield from rendered


#: The shot of the film that a worker process renders, under the film's id.
_shots: dict[str, Shot] = {}


def _render(
    film: str, rollout: Rollout, setting: dict[str, Any], times: Floats, chunk: tuple[int, int]
) -> list[Picture]:
    first, end = chunk
    shot = _shots.get(film)
    if shot is None:
        _shots.clear()
        shot = _shots[film] = Shot(rollout, **setting)
    for at in times[:first][times[:first] > shot.shown]:
        shot.extend_trail(at)
    return [shot.frame(at) for at in times[first:end]]
