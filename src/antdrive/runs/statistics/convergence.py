"""Path lengths by iteration of iterative planners, as a column of a campaign's table."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from antdrive.base.types import Floats

if TYPE_CHECKING:
    from antdrive.planners import PlanResult

HISTORY = "history"  # the column


class Convergence(NamedTuple):
    """Course of one plan."""

    best: Floats  # length of the best path so far by iteration (I,) [m]; infinite before the first path
    work: int  # of all iterations, such as ant steps


def packed(plan: PlanResult) -> str | None:
    """Return a plan's number of iterations, its work, and `iteration:length` of each better path; None without iterations."""
    best = plan.history.best
    if not len(best):
        return None
    better = np.flatnonzero(best < np.concatenate([[math.inf], best[:-1]]))
    return " ".join([str(len(best)), str(plan.work), *(f"{k}:{best[k]:.6g}" for k in better.tolist())])


def unpacked(text: str) -> Convergence:
    """Return the course of a plan that `packed` wrote."""
    count, work, *steps = text.split()
    best = np.full(int(count), math.inf)
    for step in steps:
        at, _, length = step.partition(":")
        best[int(at) :] = float(length)
    return Convergence(best, int(work))
