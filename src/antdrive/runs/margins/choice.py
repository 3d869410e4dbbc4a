"""The margin for a robot: calibrated once, and kept in the cache folder.

A calibration drives the same courses with the same seeds wherever it runs, so its result does not depend on whether it was
found in the cache or on the number of processes.
"""

from __future__ import annotations

import functools
from collections.abc import Callable
from pathlib import Path

from pydantic import TypeAdapter

from antdrive.base.atomic import written_whole
from antdrive.base.errors import InputError
from antdrive.base.kernel_cache import cache_folder
from antdrive.base.processes import delayed
from antdrive.runs.margins.prediction import Calibration, least_margin
from antdrive.runs.margins.trial import Conditions, Loss, loss_on_course

DRIVES = 80  # courses that each margin is tried on
JOBS = 2  # processes at most


def choose_margin(
    conditions: Conditions, *, jobs: int = JOBS, progress: Callable[[int, float], None] | None = None
) -> Calibration:
    """The least margin whose predicted loss leaves the reserve: from the cache, or calibrated now and cached.

    Movers are no part of the prediction.

    Raises:
        FieldError: no margin leaves the reserve.
    """
    found = known_margin(conditions)
    if found is None:
        found = least_margin(_driving(conditions, jobs, progress), conditions.key, conditions.robot.radius)
        _keep(found)
    return found


def known_margin(conditions: Conditions) -> Calibration | None:
    """The calibration in the cache; None where there is none, or only a damaged one."""
    path = _path(conditions.key)
    if path is None:
        return None
    try:
        found = _adapter().validate_json(path.read_bytes())
    except (OSError, ValueError):
        return None
    return found if found.key == conditions.key else None


def _driving(
    conditions: Conditions, jobs: int, progress: Callable[[int, float], None] | None
) -> Callable[[float], list[Loss]]:
    """A function that drives every course with a margin and returns the losses."""
    from joblib import Parallel
    from joblib.parallel import get_active_backend

    # Within a process of somebody else's pool joblib would start threads, and one process of PyBullet is one thread.
    jobs, done = (1 if get_active_backend()[0].nesting_level else jobs), 0

    def losses_with(margin: float) -> list[Loss]:
        nonlocal done
        losses = []
        drives = (delayed(loss_on_course)(conditions, margin, seed) for seed in range(DRIVES))
        for loss in Parallel(jobs, return_as="generator")(drives):
            losses.append(loss)
            done += 1
            if progress is not None:
                progress(done, margin)
        return losses

    return losses_with


def _keep(found: Calibration) -> None:
    path = _path(found.key)
    if path is None:
        return
    try:
        with written_whole(path) as temporary:
            temporary.write_bytes(_adapter().dump_json(found, indent=1))
    except (InputError, OSError):
        return  # a full disk costs the next run a calibration, nothing else


def _path(key: str) -> Path | None:
    folder = cache_folder()
    return None if folder is None else folder / f"antdrive-margin-{key[:16]}.json"


@functools.cache
def _adapter() -> TypeAdapter[Calibration]:
    return TypeAdapter(Calibration)
