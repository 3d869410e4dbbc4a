"""Calls that joblib makes in its worker processes."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar

R = TypeVar("R")


def delayed(function: Callable[..., R]) -> Callable[..., Any]:
    """A function that turns arguments into a call for `joblib.Parallel`, as `joblib.delayed` does. Its worker goes on afterwards.

    Where psutil is installed, joblib takes workers that have grown by 300 MB for leaking, ends them and warns of it in a
    thread. Ours grow by as much when they compile kernels, or load them and films, and a program whose warnings are errors,
    as tests often have it, would wait for that thread for ever.
    """
    import joblib

    def call(*arguments: Any, **named: Any) -> Any:
        return joblib.delayed(_call)(function, *arguments, **named)

    return call


def _call(function: Callable[..., R], /, *arguments: Any, **named: Any) -> R:
    from joblib.externals.loky import process_executor

    process_executor._USE_PSUTIL = False  # as where psutil is missing
    return function(*arguments, **named)
