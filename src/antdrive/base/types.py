"""Array and tuple types of the package. Lengths are metres, angles radians."""

from __future__ import annotations

from typing import TypeAlias

import numpy as np
import numpy.typing as npt

#: An array of float64; each use states shape and unit.
Floats: TypeAlias = npt.NDArray[np.float64]
#: An array of booleans.
Flags: TypeAlias = npt.NDArray[np.bool_]
#: An array of int64, such as indices.
Ints: TypeAlias = npt.NDArray[np.int64]
#: x [m], y [m] and yaw [rad], counter-clockwise from +x.
Pose: TypeAlias = tuple[float, float, float]
#: x [m] and y [m].
Point: TypeAlias = tuple[float, float]
#: xmin, ymin, xmax, ymax [m].
Bounds: TypeAlias = tuple[float, float, float, float]
