"""Intervals of free headings: the complement of the kernel's blocked ones."""

import math

import numpy as np

from antdrive.worlds.headings._kernels_headings import blocked_headings

TURN = 2 * math.pi


def free_headings(x, y, outline, discs, bounds):
    """Intervals of heading at which the outline touches nothing (N, 2), by start in [0, 2π); ends may exceed 2π."""
    blocked = blocked_headings(x, y, *outline, discs, np.asarray(bounds, dtype=np.float64))
    if not len(blocked):
        return np.array([[0.0, TURN]])
    starts, ends = blocked[np.argsort(blocked[:, 0])].T
    ends = np.maximum.accumulate(ends)
    lows = np.maximum(np.append(-TURN, ends[:-1]), ends[-1] - TURN)  # the last blocked interval may reach beyond 2π
    gaps = np.stack([lows, starts], axis=1)[lows < starts]
    gaps[gaps[:, 0] < 0] += TURN
    return gaps[np.argsort(gaps[:, 0])]
