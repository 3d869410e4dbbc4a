"""Compiled passes of the speed profile: arrays in, arrays out."""

from __future__ import annotations

import math

from antdrive.worlds._kernels import Array, inline, kernel


@inline
def most_gain(v2: float, bend: float, change: float, acceleration: float, yaw_acceleration: float) -> float:
    """The acceleration that the robot and its yaw acceleration `change v^2 + bend a` allow."""
    k = abs(bend)
    if k * acceleration <= 1e-12:
        return acceleration
    return min(acceleration, max(0.0, yaw_acceleration - math.copysign(1.0, bend) * change * v2) / k)


@kernel
def limit_speed(
    curvature: Array, change: Array, top: float, lateral: float, yaw_rate: float, yaw_acceleration: float,
    half_track: float, rim: float, out: Array,
) -> None:  # fmt: skip
    """out[i] = the speed that every limit but the acceleration allows at curvature[i], which grows by change[i] a metre."""
    for i in range(len(curvature)):
        k, dk = abs(curvature[i]), abs(change[i])
        v = min(top, rim / (1.0 + k * half_track))
        if k > 1e-12:
            v = min(v, min(math.sqrt(lateral / k), yaw_rate / k))
        if dk > 1e-12:
            v = min(v, math.sqrt(yaw_acceleration / dk))
        out[i] = v


@kernel
def brake_ahead(
    arc: Array, curvature: Array, change: Array, loss: float, yaw_acceleration: float, speed: Array
) -> None:
    """Lower each speed to one from which the next can be reached by braking with `loss`."""
    for i in range(len(arc) - 2, -1, -1):
        v2 = speed[i + 1] * speed[i + 1]
        a = min(
            most_gain(v2, curvature[i + 1], -change[i + 1], loss, yaw_acceleration),
            most_gain(v2, curvature[i], -change[i], loss, yaw_acceleration),
        )
        speed[i] = min(speed[i], math.sqrt(v2 + 2.0 * a * (arc[i + 1] - arc[i])))


@kernel
def speed_up(arc: Array, curvature: Array, change: Array, gain: float, yaw_acceleration: float, speed: Array) -> None:
    """Lower each speed to one that can be reached from the one before with `gain`."""
    for i in range(1, len(arc)):
        v2 = speed[i - 1] * speed[i - 1]
        a = min(
            most_gain(v2, curvature[i - 1], change[i - 1], gain, yaw_acceleration),
            most_gain(v2, curvature[i], change[i], gain, yaw_acceleration),
        )
        speed[i] = min(speed[i], math.sqrt(v2 + 2.0 * a * (arc[i] - arc[i - 1])))
