"""Planar lidar of a robot."""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass
from typing import Annotated

import numpy as np
from annotated_types import Interval

from antdrive.base.errors import FieldError
from antdrive.base.records import clamp_angle, require_ranges
from antdrive.base.types import Floats, Pose

MOST_SEEN = 2 * math.pi + 1e-6  # largest field of view; larger rounded values become this one [rad]
FULL_CIRCLE = 2 * math.pi - 1e-4  # minimum field of view that counts as a full circle [rad]


@dataclass(frozen=True, kw_only=True)
class Lidar:
    """A planar lidar.

    The beams are evenly spaced. The first and the last lie on the edges of the field of view. In a full circle the first
    beam points backwards.

    Attributes:
        beams: number of beams in a scan
        field_of_view: angle between the first and the last beam, symmetric about the lidar's heading [rad]; 6.2832:
            full circle
        min_range: nearer surfaces are detected, but not measured [m]
        max_range: farther surfaces are not detected [m]
        rate: scan rate [Hz]
        resolution: measured ranges are multiples of it [m]; 0: exact
        sigma: standard deviation of a measured range [m]
        x: position ahead of the axle's centre [m]
        y: position to the left of the axle's centre [m]
        yaw: the lidar's heading, counter-clockwise from the robot's [rad]
        height: of the beams above the floor [m]; lower cylinders are not detected

    Raises:
        FieldError: a value is outside its range, or min_range is not below max_range.
    """

    beams: Annotated[int, Interval(ge=3, le=10_000)]
    field_of_view: Annotated[float, Interval(ge=0.01, le=6.284)]
    min_range: Annotated[float, Interval(ge=0.0, le=10.0)]
    max_range: Annotated[float, Interval(ge=0.1, le=300.0)]
    rate: Annotated[float, Interval(ge=1.0, le=1000.0)]
    resolution: Annotated[float, Interval(ge=0.0, le=0.5)] = 0.0
    sigma: Annotated[float, Interval(ge=0.0, le=0.5)] = 0.0
    x: Annotated[float, Interval(ge=-20.0, le=20.0)] = 0.0
    y: Annotated[float, Interval(ge=-20.0, le=20.0)] = 0.0
    yaw: Annotated[float, Interval(ge=-3.142, le=3.142)] = 0.0
    height: Annotated[float, Interval(ge=0.01, le=10.0)] = 0.2

    def __post_init__(self) -> None:
        clamp_angle(self, "field_of_view", MOST_SEEN)
        clamp_angle(self, "yaw", math.pi)
        require_ranges(self)
        if not self.min_range < self.max_range:
            raise FieldError("min_range", f"must be below max_range, {self.max_range:g}, got {self.min_range:g}")

    @property
    def spacing(self) -> float:
        """Angle between neighbouring beams [rad]."""
        return 2 * math.pi / self.beams if self.full_circle else self.field_of_view / (self.beams - 1)

    @property
    def full_circle(self) -> bool:
        """Whether the field of view is a full circle."""
        return self.field_of_view >= FULL_CIRCLE

    @property
    def angles(self) -> Floats:
        """Direction of each beam, counter-clockwise from the robot's heading (beams,) [rad]."""
        first = -math.pi if self.full_circle else -self.field_of_view / 2
        return np.asarray(self.yaw + first + self.spacing * np.arange(self.beams), dtype=np.float64)

    def at(self, hz: int) -> Lidar:
        """Return the lidar with at most one scan per control period, of which there are `hz` a second."""
        return self if self.rate <= hz else dataclasses.replace(self, rate=float(hz))

    def pose_on(self, pose: Pose) -> Pose:
        """Return the lidar's pose in the world on a robot at a pose: x, y [m] and yaw [rad]."""
        x, y, yaw = pose
        cos, sin = math.cos(yaw), math.sin(yaw)
        return x + cos * self.x - sin * self.y, y + sin * self.x + cos * self.y, yaw + self.yaw

    def due(self, tick: int, hz: int) -> bool:
        """Return whether a scan is due in the control period with index `tick`, of `hz` a second."""
        per_tick = self.rate / hz
        return tick == 0 or math.floor(tick * per_tick) != math.floor((tick - 1) * per_tick)
