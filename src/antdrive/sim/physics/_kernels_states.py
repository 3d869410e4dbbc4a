"""Compiled states of the axle's centre: arrays in, arrays out, no validation."""

from __future__ import annotations

import math

import numpy as np

from antdrive.worlds._kernels import Array, kernel


@kernel
def axle_states(motion: Array, com_drop: float) -> Array:
    """Return x, y, yaw, speed and yaw rate (N, 5) of the axle, `com_drop` above the centre of mass, for its motion (N, 13)."""
    states = np.empty((motion.shape[0], 5))
    for i in range(motion.shape[0]):
        qx, qy, qz, qw = motion[i, 3], motion[i, 4], motion[i, 5], motion[i, 6]
        yaw = math.atan2(2.0 * (qw * qz + qx * qy), 1.0 - 2.0 * (qy * qy + qz * qz))
        states[i, 0] = motion[i, 0] + 2.0 * (qx * qz + qw * qy) * com_drop
        states[i, 1] = motion[i, 1] + 2.0 * (qy * qz - qw * qx) * com_drop
        states[i, 2] = yaw
        states[i, 3] = motion[i, 7] * math.cos(yaw) + motion[i, 8] * math.sin(yaw)
        states[i, 4] = motion[i, 12]
    return states
