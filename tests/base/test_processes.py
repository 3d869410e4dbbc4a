"""Workers of joblib that have grown go on."""

from __future__ import annotations

import re
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

import joblib
import pytest
from joblib.externals.loky import get_reusable_executor, process_executor

from antdrive.base import processes
from antdrive.base.kernel_cache import PACKAGES

pytest.importorskip("psutil", reason="joblib looks at the memory of workers with psutil")


def seems_to_grow(number: int) -> int:
    """In a worker that from now on takes any amount of memory for a leak, and looks after every call."""
    process_executor._MAX_MEMORY_LEAK_SIZE, process_executor._MEMORY_LEAK_CHECK_DELAY = -(10**15), -1.0
    return number


def workers_are_ended(delayed: Callable[..., Any]) -> bool:
    """Whether joblib says so while two workers make twenty calls, all of which wait from the beginning."""
    get_reusable_executor().shutdown(wait=True)  # workers of tests before this one may look no more
    with warnings.catch_warnings(record=True) as found:
        warnings.simplefilter("always")
        calls = [delayed(seems_to_grow)(number) for number in range(20)]
        assert joblib.Parallel(2, batch_size=1, pre_dispatch="all")(calls) == list(range(20))
        get_reusable_executor().shutdown(wait=True)
    return any("A worker stopped" in str(warning.message) for warning in found)


def test_workers_that_have_grown_go_on() -> None:
    assert workers_are_ended(joblib.delayed), "joblib does not look any more"
    assert not workers_are_ended(processes.delayed)


def test_every_call_in_a_worker_is_made_so() -> None:
    root = Path(processes.__file__).parents[1]
    files = [path for package in PACKAGES for path in (root / package).rglob("*.py")]
    own = re.compile(r"joblib\.delayed|from joblib import .*delayed")
    assert [path for path in files if own.search(path.read_text())] == [Path(processes.__file__)]
