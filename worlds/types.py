"""The arrays and tuples that the whole package speaks in. Lengths are metres and angles are radians."""

from __future__ import annotations

from typing import TypeAlias

import numpy as np
import numpy.typing as npt

Floats: TypeAlias = npt.NDArray[np.float64]
Pose: TypeAlias = tuple[float, float, float]  # x [m], y [m], yaw [rad, counter-clockwise from +x]
Point: TypeAlias = tuple[float, float]  # x [m], y [m]
Bounds: TypeAlias = tuple[float, float, float, float]  # xmin, ymin, xmax, ymax [m]
