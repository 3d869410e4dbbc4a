"""The arrays and tuples that the whole package speaks in. Lengths are metres and angles are radians."""

from __future__ import annotations

from typing import TypeAlias

import numpy as np
import numpy.typing as npt

#: An array of float64; its shape and unit stand where it is described.
Floats: TypeAlias = npt.NDArray[np.float64]
#: x [m], y [m] and yaw [rad], counter-clockwise from +x.
Pose: TypeAlias = tuple[float, float, float]
#: x [m] and y [m].
Point: TypeAlias = tuple[float, float]
#: xmin, ymin, xmax, ymax [m].
Bounds: TypeAlias = tuple[float, float, float, float]
