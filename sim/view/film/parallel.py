"""Frames of a moving camera, which must be rendered whole: several processes share them, a few frames each at a time."""

from __future__ import annotations

import uuid
from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

import joblib
import numpy as np
import numpy.typing as npt

from antdrive.sim.log.rollout import Rollout

if TYPE_CHECKING:
    from antdrive.sim.view.film.video import Shot

Picture = npt.NDArray[np.uint8]  # (H, W, 3)
Floats = npt.NDArray[np.float64]

CHUNK = 16  # frames a process renders before it hands them over
WORTH = 300  # frames; starting processes takes as long as rendering fewer
MOST = 8  # processes; each takes some 150 MB


def processes() -> int:
    """How many processes render at once, one for each core of this machine that may be used."""
    return int(min(MOST, joblib.cpu_count()))


def pictures(rollout: Rollout, setting: dict[str, Any], times: Floats, jobs: int) -> Iterator[Picture]:
    """The frames (H, W, 3) at `times`, in order and the same for any number of `jobs`.

    `setting` are the arguments of `Shot`. At most `jobs` x `CHUNK` frames are held at once.
    """
    chunks = [(first, min(first + CHUNK, len(times))) for first in range(0, len(times), CHUNK)]
    film = uuid.uuid4().hex
    with joblib.Parallel(n_jobs=jobs) as pool:
        for k in range(0, len(chunks), jobs):
            work = [joblib.delayed(_render)(film, rollout, setting, times, *chunk) for chunk in chunks[k : k + jobs]]
            for rendered in pool(work):
                yield from rendered


_open: dict[str, Shot] = {}  # the shot that this process has open, by its film; the next film's first frame closes it


def _render(film: str, rollout: Rollout, setting: dict[str, Any], times: Floats, first: int, end: int) -> list[Picture]:
    from antdrive.sim.view.film.video import Shot

    shot = _open.get(film)
    if shot is None:
        while _open:
            _open.popitem()[1].__exit__(None, None, None)
        shot = _open[film] = Shot(rollout, **setting).__enter__()
    for at in times[:first][times[:first] > shot.shown]:
        shot.drive(at)
    return [shot.picture(at) for at in times[first:end]]
