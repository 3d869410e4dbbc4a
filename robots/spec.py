"""What a robot is: its footprint, its drive and its limits."""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass

from antdrive.worlds.errors import FieldError


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


NOISE_RANGE = {
    "pose_xy": (0.0, 1.0), "pose_yaw": (0.0, 1.0), "pose_rate": (1.0, 1000.0), "encoder": (0.0, 0.5), "slip": (0.0, 0.5),
    "delay": (0.0, 1.0),
}  # fmt: skip


@dataclass(frozen=True, kw_only=True)
class Noise:
    """How far a real robot is from a perfect one: standard deviations, the rate of pose fixes and the delay of commands.

    Raises:
        ValueError: a level that is negative, not finite, or beyond any robot.
    """

    pose_xy: float = 0.0  # of a pose fix, in x and in y [m]
    pose_yaw: float = 0.0  # of a pose fix [rad]
    pose_rate: float = 20.0  # pose fixes a second; in between the robot dead-reckons [Hz]
    encoder: float = 0.0  # of each wheel's measured speed, as a fraction of it
    slip: float = 0.0  # of each wheel's true speed, as a fraction; wanders over half a second
    delay: float = 0.0  # from a command to the motors [s]

    def __post_init__(self) -> None:
        for field in dataclasses.fields(self):
            value = getattr(self, field.name)
            low, high = NOISE_RANGE[field.name]
            if not low <= value <= high:
                raise FieldError(field.name, f"must be between {low:g} and {high:g}, got {value:g}")

    def scaled(self, factor: float) -> Noise:
        """The same robot with all errors and the delay `factor` times as large."""
        levels = {f.name: getattr(self, f.name) * factor for f in dataclasses.fields(self) if f.name != "pose_rate"}
        return dataclasses.replace(self, **levels)

    @property
    def loud(self) -> bool:
        """Whether there is any."""
        return any(getattr(self, f.name) for f in dataclasses.fields(self) if f.name != "pose_rate")


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
    noise: Noise = Noise()  # as documented; a drive scales it
    source: str | None = None

    def __post_init__(self) -> None:
        for field in dataclasses.fields(self):
            value = getattr(self, field.name)
            if isinstance(value, float | int) and not (math.isfinite(value) and value > 0):
                raise FieldError(field.name, f"must be greater than 0, got {value:g}")
        if not self.footprint.radius > 0:
            raise FieldError("footprint", "must have an extent")
        # Contacts are felt by the chassis alone, so no part of the wheels may stand outside it.
        foot, half_track = self.footprint, self.track / 2
        if foot.is_disc and math.hypot(half_track, self.wheel_radius) > foot.rounding:
            raise FieldError(
                "track", f"wheels of {self.wheel_radius:g} m, {self.track:g} m apart, stand outside the footprint"
            )
        if not foot.is_disc and half_track > foot.half_width + foot.rounding:
            raise FieldError("track", f"wheels {self.track:g} m apart stand outside the footprint")
        if not foot.is_disc and self.wheel_radius > foot.half_length + foot.rounding:
            raise FieldError("wheel_radius", f"wheels of {self.wheel_radius:g} m stand outside the footprint")

    @property
    def radius(self) -> float:
        """The radius planners inflate by: the footprint's circumscribed circle [m]."""
        return self.footprint.radius
