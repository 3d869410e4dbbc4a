"""What a robot is: its footprint, its drive, its limits and how noisy it is."""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass

from antdrive.base.errors import FieldError
from antdrive.robots.lidar import Lidar
from antdrive.robots.outline import Footprint as Footprint

#: The lowest and highest value of each field of `Noise`.
NOISE_RANGE = {
    "pose_xy": (0.0, 1.0),
    "pose_yaw": (0.0, 1.0),
    "pose_rate": (1.0, 1000.0),
    "encoder": (0.0, 0.5),
    "slip": (0.0, 0.5),
    "delay": (0.0, 1.0),
}


@dataclass(frozen=True, kw_only=True)
class Noise:
    """How a real robot differs from a perfect one. Levels are standard deviations.

    Attributes:
        pose_xy: error of a pose fix in x and in y [m]
        pose_yaw: error of a pose fix in heading [rad]
        pose_rate: rate of pose fixes; between two fixes the robot uses odometry [Hz]
        encoder: error of each wheel's measured speed, as a fraction of the speed
        slip: slip of each wheel, as a fraction of its speed; it changes over about half a second
        delay: time from a command to the motors [s]

    Raises:
        ValueError: a value is outside its NOISE_RANGE.
    """

    pose_xy: float = 0.0
    pose_yaw: float = 0.0
    pose_rate: float = 20.0
    encoder: float = 0.0
    slip: float = 0.0
    delay: float = 0.0

    def __post_init__(self) -> None:
        for field in dataclasses.fields(self):
            value = getattr(self, field.name)
            low, high = NOISE_RANGE[field.name]
            if not low <= value <= high:
                raise FieldError(field.name, f"must be between {low:g} and {high:g}, got {value:g}")

    def scaled(self, factor: float) -> Noise:
        """The noise with all errors and the delay multiplied by `factor`."""
        levels = {f.name: getattr(self, f.name) * factor for f in dataclasses.fields(self) if f.name != "pose_rate"}
        return dataclasses.replace(self, **levels)

    @property
    def nonzero(self) -> bool:
        """Whether there is any error or delay."""
        return any(getattr(self, f.name) for f in dataclasses.fields(self) if f.name != "pose_rate")


#: The lowest and highest value of each number in a robot's file: the robots that antdrive is meant for.
ROBOT_RANGE = {
    "footprint": (0.02, 20.0),  # diameter, length, width
    "height": (0.01, 10.0),
    "mass": (0.01, 1e5),
    "wheel_radius": (0.005, 5.0),
    "track": (0.01, 20.0),
    "max_speed": (0.05, 10.0),  # slower ones would count as standing; faster ones wobble
    "max_yaw_rate": (0.05, 50.0),
    "max_acceleration": (0.01, 100.0),
    "max_yaw_acceleration": (0.01, 1000.0),
    "max_lateral_acceleration": (0.01, 100.0),
    "max_wheel_speed": (0.1, 1e4),
    "wheel_torque": (1e-6, 1e6),
    "wheel_friction": (0.1, 100.0),
}
WHEEL_ROOM = 0.05  # the least distance from a wheel's middle to the footprint's edge, in wheel radii


@dataclass(frozen=True, kw_only=True)
class RobotSpec:
    """A differential-drive robot: two driven wheels on one axle, whose centre is the robot's origin, and two casters.

    The footprint may reach farther ahead than behind; the mass counts as centred on the axle.

    Attributes:
        name: what the robot is called
        footprint: its outline from above
        height: height of its body [m]
        mass: mass of the whole robot [kg]
        wheel_radius: radius of the driven wheels [m]
        track: distance between the driven wheels [m]
        max_speed: limit of the forward speed [m/s]
        max_yaw_rate: limit of the yaw rate [rad/s]
        max_acceleration: limit of acceleration and deceleration [m/s^2]
        max_yaw_acceleration: limit of the change of the yaw rate [rad/s^2]
        max_lateral_acceleration: limit of speed times yaw rate [m/s^2]
        max_wheel_speed: limit of each wheel's speed [rad/s]
        wheel_torque: highest torque of each wheel's motor [N m]
        wheel_friction: Coulomb friction coefficient of the wheels on the floor
        noise: the robot's noise at a scenario's noise level of 1
        source: where these values come from
        lidar: what the robot sees with; None: it has no lidar

    Raises:
        FieldError: a value is not positive or outside its ROBOT_RANGE, or the wheels stand
            outside the footprint.
    """

    name: str
    footprint: Footprint
    height: float
    mass: float
    wheel_radius: float
    track: float
    max_speed: float
    max_yaw_rate: float
    max_acceleration: float
    max_yaw_acceleration: float
    max_lateral_acceleration: float
    max_wheel_speed: float
    wheel_torque: float
    wheel_friction: float = 1.5
    noise: Noise = Noise()
    source: str | None = None
    lidar: Lidar | None = dataclasses.field(default=None, metadata={"left_out_if_default": True})

    def __post_init__(self) -> None:
        for field in dataclasses.fields(self):
            value = getattr(self, field.name)
            if isinstance(value, float | int) and not (math.isfinite(value) and value > 0):
                raise FieldError(field.name, f"must be greater than 0, got {value:g}")
        for key in (key for key in ROBOT_RANGE if key != "footprint"):
            _require_range(key, getattr(self, key))
        foot = self.footprint
        for key in ("half_length", "half_width", "rounding"):
            if not getattr(foot, key) >= 0:
                raise FieldError(f"footprint.{key}", f"must be at least 0, got {getattr(foot, key):g}")
        try:
            foot.require_convex()
        except FieldError as error:
            raise error.under("footprint") from None
        xmin, ymin, xmax, ymax = foot.bounds
        for size in (xmax - xmin, ymax - ymin):
            _require_range("footprint", size)
        self._require_wheels_inside()

    def _require_wheels_inside(self) -> None:
        # Only the chassis detects contacts, so no part of a wheel may stand outside it.
        foot, half_track = self.footprint, self.track / 2
        if foot.corners:
            self._require_wheels_in_polygon()
        elif foot.is_disc and math.hypot(half_track, self.wheel_radius) > foot.rounding:
            raise FieldError(
                "track", f"wheels of {self.wheel_radius:g} m, {self.track:g} m apart, stand outside the footprint"
            )
        elif not foot.is_disc and half_track > foot.half_width + foot.rounding:
            raise FieldError("track", f"wheels {self.track:g} m apart stand outside the footprint")
        elif not foot.is_disc and self.wheel_radius > foot.half_length + foot.rounding:
            raise FieldError("wheel_radius", f"wheels of {self.wheel_radius:g} m stand outside the footprint")
        if self.wheel_room < WHEEL_ROOM * self.wheel_radius:
            raise FieldError(
                "track",
                f"wheels {self.track:g} m apart have their middles {self.wheel_room:g} m from the footprint's edge; "
                f"their own width needs {WHEEL_ROOM * self.wheel_radius:g} m",
            )

    def _require_wheels_in_polygon(self) -> None:
        r, half_track = self.wheel_radius, self.track / 2
        ends = [(x, y) for x in (-r, r) for y in (-half_track, half_track)]
        x, y = min(ends, key=lambda end: self.footprint.depth(*end))
        if self.footprint.depth(x, y) < 0:
            raise FieldError(
                "footprint",
                f"wheels of {r:g} m, {self.track:g} m apart, stand outside it at ({x:g}, {y:g}); the origin of the footprint "
                "is the axle's centre",
            )

    @property
    def radius(self) -> float:
        """Radius of the footprint's circumscribed circle, by which planners inflate obstacles [m]."""
        return self.footprint.radius

    @property
    def wheel_room(self) -> float:
        """Distance from the middle of a wheel to the footprint's edge, seen from above [m]."""
        return min(self.footprint.depth(0.0, side * self.track / 2) for side in (1, -1))

    def _repr_html_(self) -> str:
        """The robot as notebooks show it."""
        from antdrive.robots.drawing import robot_card

        return robot_card(self)


def _require_range(key: str, value: float) -> None:
    low, high = ROBOT_RANGE[key]
    if not low <= value <= high:
        raise FieldError(key, f"must be between {low:g} and {high:g}, got {value:g}")
