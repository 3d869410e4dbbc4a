"""Compiled passes of the speed profile: arrays in, arrays out."""

from __future__ import annotations

import math

from antdrive.worlds._kernels import Array, inline, leaf


@inline
def allowed_gain(v2: float, curvature: float, change: float, acceleration: float, yaw_acceleration: float) -> float:
    """Return the acceleration a at speed v that also keeps the yaw acceleration, `change v^2 + curvature a`."""
    k = abs(curvature)
    if k * acceleration <= 1e-12:
        return acceleration
    return min(acceleration, max(0.0, yaw_acceleration - math.copysign(1.0, curvature) * change * v2) / k)


@leaf
def limit_speed(
    curvature: Array, change: Array, max_speed: float, lateral_acceleration: float, yaw_rate: float,
    yaw_acceleration: float, half_track: float, rim_speed: float, out: Array,
) -> None:  # fmt: skip
    """Fill out[i] with the highest constant speed at curvature[i] with derivative change[i]."""
    for i in range(len(curvature)):
        k, dk = abs(curvature[i]), abs(change[i])
        v = min(max_speed, rim_speed / (1.0 + k * half_track))
        if k > 1e-12:
            v = min(v, min(math.sqrt(lateral_acceleration / k), yaw_rate / k))
        if dk > 1e-12:
            v = min(v, math.sqrt(yaw_acceleration / dk))
        out[i] = v


@leaf
def limit_braking(
    arc: Array, curvature: Array, change: Array, deceleration: float, yaw_acceleration: float, speed: Array
) -> None:
    """Lower each speed so that braking reaches the next (backward pass)."""
    for i in range(len(arc) - 2, -1, -1):
        v2 = speed[i + 1] * speed[i + 1]
        a = min(
            allowed_gain(v2, curvature[i + 1], -change[i + 1], deceleration, yaw_acceleration),
            allowed_gain(v2, curvature[i], -change[i], deceleration, yaw_acceleration),
        )
        speed[i] = min(speed[i], math.sqrt(v2 + 2.0 * a * (arc[i + 1] - arc[i])))


@leaf
def limit_acceleration(
    arc: Array, curvature: Array, change: Array, acceleration: float, yaw_acceleration: float, speed: Array
) -> None:
    """Lower each speed so that acceleration from the previous reaches it (forward pass)."""
    for i in range(1, len(arc)):
        v2 = speed[i - 1] * speed[i - 1]
        a = min(
            allowed_gain(v2, curvature[i - 1], change[i - 1], acceleration, yaw_acceleration),
            allowed_gain(v2, curvature[i], change[i], acceleration, yaw_acceleration),
        )
        speed[i] = min(speed[i], math.sqrt(v2 + 2.0 * a * (arc[i] - arc[i - 1])))
