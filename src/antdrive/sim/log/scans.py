"""A lidar's ranges as a log keeps them: whole millimetres, with two numbers for what was not measured."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
import numpy.typing as npt

from antdrive.base.types import Floats

NOTHING, TOO_NEAR = 0, 1  # nothing was in range; something was nearer than the lidar measures


def millimetres(ranges: Floats) -> npt.NDArray[np.uint16]:
    """Ranges as the log keeps them: 0 where nothing was in range, 1 where something was too near to measure."""
    missing = np.where(ranges < 0, TOO_NEAR, NOTHING)
    kept = np.where(np.isfinite(ranges), np.clip(np.round(ranges * 1000.0), TOO_NEAR + 1, 65535), missing)
    return kept.astype(np.uint16)


def ranges_of(scans: npt.NDArray[np.uint16]) -> Floats:
    """Ranges [m] out of a log, as the scanner gave them but for the rounding."""
    ranges: Floats = np.where(scans == NOTHING, np.inf, np.where(scans == TOO_NEAR, -np.inf, scans / 1000.0))
    return ranges


def scans_logged(taken: Iterable[tuple[int, Floats]], per_tick: int, rows: int) -> dict[str, npt.NDArray[np.generic]]:
    """The arrays `scans` and `scan_rows` of a log."""
    kept = [(tick * per_tick, ranges) for tick, ranges in taken if tick * per_tick < rows]
    return {
        "scans": millimetres(np.array([ranges for _, ranges in kept]) if kept else np.empty((0, 0))),
        "scan_rows": np.array([row for row, _ in kept], dtype=np.int32),
    }
