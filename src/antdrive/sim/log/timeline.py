"""Timeline of a log: its rows at any time, for films, figures, baselines and maps."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from antdrive.base.plane import wrap_angle
from antdrive.base.types import Floats
from antdrive.sim.log.rollout import Rollout


def speeds(t: Floats, pose: Floats) -> Floats:
    """Return the forward speed and the yaw rate that lead to each pose (T, 3) from the one before (T, 2) [m/s, rad/s]."""
    moved, steps = np.diff(pose, axis=0, prepend=pose[:1]), np.diff(t, prepend=t[0] - 1.0)
    twist = np.column_stack([np.hypot(moved[:, 0], moved[:, 1]), wrap_angle(moved[:, 2])])
    return np.asarray(twist / np.maximum(steps, 1e-9)[:, None])


class Timeline:
    """Log as functions of time [s]; the robot rests before its first row and after its last.

    Attributes:
        t: times of the rows (T,) [s]
    """

    def __init__(self, rollout: Rollout) -> None:
        self.t, self._hz = rollout.t, rollout.record.physics_hz
        turned = np.column_stack([rollout.pose[:, :2], np.unwrap(rollout.pose[:, 2])])
        self._columns = np.ascontiguousarray(turned.T)

    @property
    def duration(self) -> float:
        """Duration of the drive [s]."""
        return float(self.t[-1] - self.t[0])

    def poses(self, moments: Floats | float) -> Floats:
        """Return interpolated poses with unwrapped headings at times (N,) or one, shape (..., 3) [m, m, rad]."""
        return np.stack([np.interp(moments, self.t, column) for column in self._columns], axis=-1)

    def row(self, at: float) -> int:
        """Return the last row at or before a time."""
        return min(max(int(np.searchsorted(self.t, at + 1e-9, side="right")) - 1, 0), len(self.t) - 1)

    def between(self, at: float) -> tuple[int, float]:
        """Return the last row at or before a time, and the elapsed fraction of the interval to the next row."""
        row = self.row(at)
        if row + 1 >= len(self.t) or at <= self.t[row]:
            return row, 0.0
        return row, float((at - self.t[row]) / (self.t[row + 1] - self.t[row]))

    def nearest(self, moments: Floats | float) -> npt.NDArray[np.int64]:
        """Return the rows nearest to times."""
        rows = np.round(np.asarray(moments) * self._hz).astype(np.int64)
        return np.asarray(np.clip(rows, 0, len(self.t) - 1))
