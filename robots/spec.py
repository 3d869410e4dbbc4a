"""What a robot is: its footprint, its drive and its limits."""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass


@dataclass(frozen=True)
class Footprint:
    """The robot seen from above: a rectangle whose edge is moved outwards by `rounding`, centred on the axle.

    A disc is a rectangle without extent; so one distance formula serves both.
    """

    half_length: float = 0.0  # along +x of the robot [m]
    half_width: float = 0.0  # along +y of the robot [m]
    rounding: float = 0.0  # [m]

    @classmethod
    def disc(cls, radius: float) -> Footprint:
        """A round robot."""
        return cls(rounding=radius)

    @classmethod
    def rectangle(cls, length: float, width: float) -> Footprint:
        """A rectangular robot."""
        return cls(half_length=length / 2, half_width=width / 2)

    @property
    def is_disc(self) -> bool:
        """Whether the footprint is the same in every direction."""
        return self.half_length == 0 and self.half_width == 0

    @property
    def radius(self) -> float:
        """The radius of the smallest disc around it, centred on the axle [m]."""
        return math.hypot(self.half_length, self.half_width) + self.rounding


@dataclass(frozen=True, kw_only=True)
class RobotSpec:
    """A differential-drive robot: two driven wheels on one axle through the centre, and two casters.

    Raises:
        ValueError: a value that no robot can have.
    """

    name: str
    footprint: Footprint
    height: float  # [m]
    mass: float  # [kg]
    wheel_radius: float  # [m]
    track: float  # between the wheels' contact points [m]
    max_speed: float  # [m/s]
    max_yaw_rate: float  # [rad/s]
    max_acceleration: float  # [m/s^2]
    max_yaw_acceleration: float  # [rad/s^2]
    max_lateral_acceleration: float  # [m/s^2]
    max_wheel_speed: float  # [rad/s]
    wheel_torque: float  # the most one wheel's motor gives [N m]
    wheel_friction: float = 1.5  # Coulomb coefficient against the floor
    source: str | None = None

    def __post_init__(self) -> None:
        for field in dataclasses.fields(self):
            value = getattr(self, field.name)
            if isinstance(value, float | int) and not (math.isfinite(value) and value > 0):
                raise ValueError(f"{field.name}: must be greater than 0, got {value:g}")
        if not self.footprint.radius > 0:
            raise ValueError("footprint: must have an extent")
        # Contacts are felt by the chassis alone, so no part of the wheels may stand outside it.
        foot, half_track = self.footprint, self.track / 2
        if foot.is_disc and math.hypot(half_track, self.wheel_radius) > foot.rounding:
            raise ValueError(
                f"track: wheels of {self.wheel_radius:g} m, {self.track:g} m apart, stand outside the footprint"
            )
        if not foot.is_disc and half_track > foot.half_width + foot.rounding:
            raise ValueError(f"track: wheels {self.track:g} m apart stand outside the footprint")
        if not foot.is_disc and self.wheel_radius > foot.half_length + foot.rounding:
            raise ValueError(f"wheel_radius: wheels of {self.wheel_radius:g} m stand outside the footprint")

    @property
    def radius(self) -> float:
        """The radius planners inflate by: the footprint's circumscribed circle [m]."""
        return self.footprint.radius
