"""How different two failures are: the distance between the lines that were driven.

The UAV testing competition (SBFT and ICST, since 2024) rewards failures that differ, and its baseline compares flights by
dynamic time warping. Here the distance is the mean distance between the places that dynamic time warping pairs, which does
not grow with the length of the drive. Two failures are different if it is more than the robot's radius, or if they are
not failures of the same kind.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from antdrive.base import Floats
from antdrive.sim.log.rollout import Rollout

POINTS = 60  # of a line, at equal distances along it


def driven_line(rollout: Rollout) -> Floats:
    """The line that was driven up to the first contact, as `POINTS` points (N, 2) at equal distances along it [m]."""
    end = int(rollout.contacts[0, 0]) + 1 if len(rollout.contacts) else len(rollout.t)
    xy = rollout.pose[:end, :2]
    along = np.concatenate(([0.0], np.hypot(*np.diff(xy, axis=0).T).cumsum()))
    at = np.linspace(0.0, along[-1], POINTS)
    return np.column_stack([np.interp(at, along, xy[:, k]) for k in (0, 1)])


def line_distance(one: Floats, other: Floats) -> float:
    """The mean distance between the points of two lines (N, 2) and (M, 2) that dynamic time warping pairs [m]."""
    apart = np.hypot(one[:, None, 0] - other[None, :, 0], one[:, None, 1] - other[None, :, 1])
    rows, columns = apart.shape
    cost = np.full((rows + 1, columns + 1), np.inf)
    pairs = np.zeros((rows + 1, columns + 1))
    cost[0, 0] = 0.0
    for i in range(1, rows + 1):
        for j in range(1, columns + 1):
            before = min((i - 1, j - 1), (i - 1, j), (i, j - 1), key=lambda cell: cost[cell])
            cost[i, j] = cost[before] + apart[i - 1, j - 1]
            pairs[i, j] = pairs[before] + 1
    return float(cost[-1, -1] / pairs[-1, -1])


def is_new(line: Floats, others: Sequence[Floats], least: float) -> bool:
    """Whether a line is farther than a distance from all others."""
    return all(line_distance(line, other) > least for other in others)
