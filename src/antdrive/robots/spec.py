"""Robot specifications: footprint, drive, limits and noise, and their feasibility."""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass
from typing import Annotated

from annotated_types import Interval

from antdrive.base.errors import FieldError, require
from antdrive.base.plane import format_point
from antdrive.base.records import require_ranges
from antdrive.robots.lidar import Lidar
from antdrive.robots.outline import Footprint as Footprint

#: The sampling rate for which `Odometry` gives noise per sample [Hz].
SAMPLE_RATE = 50.0


@dataclass(frozen=True, kw_only=True)
class Odometry:
    """Errors of odometry. Levels are standard deviations.

    Scales and bias are drawn once for each drive, noise for each sample. At rates other than 50 Hz noise is scaled to
    give the same drift of the pose.

    Attributes:
        speed_scale: constant error of the speed, as a fraction of it, from wheel size or slip
        yaw_scale: constant error of the yaw rate, as a fraction of it
        gyro_bias: constant error of the yaw rate [rad/s]
        speed_noise: noise of the speed in a sample at 50 Hz, as a fraction of the speed
        gyro_noise: noise of the yaw rate in a sample at 50 Hz [rad/s]

    Raises:
        FieldError: a value is outside its range.
    """

    speed_scale: Annotated[float, Interval(ge=0.0, le=0.5)] = 0.01
    yaw_scale: Annotated[float, Interval(ge=0.0, le=0.5)] = 0.005
    gyro_bias: Annotated[float, Interval(ge=0.0, le=1.0)] = 0.005
    speed_noise: Annotated[float, Interval(ge=0.0, le=0.5)] = 0.02
    gyro_noise: Annotated[float, Interval(ge=0.0, le=1.0)] = 0.005

    def __post_init__(self) -> None:
        require_ranges(self)

    def scaled(self, factor: float) -> Odometry:
        """Return the errors multiplied by a `factor`; 0 is perfect odometry."""
        return Odometry(**{field.name: getattr(self, field.name) * factor for field in dataclasses.fields(self)})


@dataclass(frozen=True, kw_only=True)
class Noise:
    """Noise levels of a robot. Levels are standard deviations.

    Attributes:
        pose_xy: error of a pose fix in x and in y [m]
        pose_yaw: error of a pose fix in heading [rad]
        pose_rate: rate of pose fixes; between two fixes the robot uses odometry [Hz]
        encoder: error of each wheel's measured speed, as a fraction of the speed
        slip: slip of each wheel, as a fraction of its speed; its correlation time is 0.5 s
        delay: time from a command to the motors [s]

    Raises:
        ValueError: a value is outside its range.
    """

    pose_xy: Annotated[float, Interval(ge=0.0, le=1.0)] = 0.0
    pose_yaw: Annotated[float, Interval(ge=0.0, le=1.0)] = 0.0
    pose_rate: Annotated[float, Interval(ge=1.0, le=1000.0)] = 20.0
    encoder: Annotated[float, Interval(ge=0.0, le=0.5)] = 0.0
    slip: Annotated[float, Interval(ge=0.0, le=0.5)] = 0.0
    delay: Annotated[float, Interval(ge=0.0, le=1.0)] = 0.0

    def __post_init__(self) -> None:
        require_ranges(self)

    def scaled(self, factor: float) -> Noise:
        """Return the noise with all errors and the delay multiplied by `factor`."""
        levels = {f.name: getattr(self, f.name) * factor for f in dataclasses.fields(self) if f.name != "pose_rate"}
        return dataclasses.replace(self, **levels)

    @property
    def nonzero(self) -> bool:
        """Whether there is any error or delay."""
        return any(getattr(self, f.name) for f in dataclasses.fields(self) if f.name != "pose_rate")


FOOTPRINT_RANGE = (0.02, 20.0)  # of the diameter, or of length and width [m]
WHEEL_ASPECT = 0.4  # drawn thickness of a wheel as a fraction of its diameter
WHEEL_ROOM = 0.05  # minimum distance from a wheel's centre to the footprint's edge [wheel radii]


@dataclass(frozen=True, kw_only=True)
class RobotSpec:
    """A differential-drive robot: two driven wheels on one axle, whose centre is the origin, and two casters.

    The footprint need not be centred on the axle; the mass is modelled as centred on it.

    Attributes:
        name: the robot's name
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
        near_speed: highest speed near movers ahead, see `Avoidance.near_distance`, and near hidden ground [m/s]
        noise: the robot's noise at noise level 1
        source: origin of these values
        lidar: the robot's lidar; None: no lidar

    Raises:
        FieldError: a value is not positive or outside its range, or the wheels protrude from the footprint.
    """

    name: str
    footprint: Footprint
    height: Annotated[float, Interval(ge=0.01, le=10.0)]
    mass: Annotated[float, Interval(ge=0.01, le=1e5)]
    wheel_radius: Annotated[float, Interval(ge=0.005, le=5.0)]
    track: Annotated[float, Interval(ge=0.01, le=20.0)]
    max_speed: Annotated[float, Interval(ge=0.05, le=10.0)]  # slower robots count as standing; faster ones oscillate
    max_yaw_rate: Annotated[float, Interval(ge=0.05, le=50.0)]
    max_acceleration: Annotated[float, Interval(ge=0.01, le=100.0)]
    max_yaw_acceleration: Annotated[float, Interval(ge=0.01, le=1000.0)]
    max_lateral_acceleration: Annotated[float, Interval(ge=0.01, le=100.0)]
    max_wheel_speed: Annotated[float, Interval(ge=0.1, le=1e4)]
    wheel_torque: Annotated[float, Interval(ge=1e-6, le=1e6)]
    wheel_friction: Annotated[float, Interval(ge=0.1, le=100.0)] = 1.5
    near_speed: Annotated[float, Interval(ge=0.05, le=10.0)] = dataclasses.field(
        default=0.8, metadata={"omit_if_default": True}
    )
    noise: Noise = Noise()
    source: str | None = None
    lidar: Lidar | None = dataclasses.field(default=None, metadata={"omit_if_default": True})

    def __post_init__(self) -> None:
        for field in dataclasses.fields(self):
            value = getattr(self, field.name)
            if isinstance(value, float | int):
                require(field.name, value, above=0)
        require_ranges(self)
        foot = self.footprint
        for key in ("half_length", "half_width", "rounding"):
            require(f"footprint.{key}", getattr(foot, key), at_least=0)
        try:
            foot.require_convex()
        except FieldError as error:
            raise error.under("footprint") from None
        xmin, ymin, xmax, ymax = foot.bounds
        low, high = FOOTPRINT_RANGE
        for size in (xmax - xmin, ymax - ymin):
            if not low <= size <= high:
                raise FieldError("footprint", f"must be between {low:g} and {high:g}, got {size:g}")
        self._require_wheels_inside()

    def _require_wheels_inside(self) -> None:
        # Only the chassis detects contacts, so wheels must not protrude.
        foot, half_track = self.footprint, self.track / 2
        if foot.corners:
            self._require_wheels_in_polygon()
        elif foot.is_disc and math.hypot(half_track, self.wheel_radius) > foot.rounding:
            raise FieldError(
                "track", f"wheels of {self.wheel_radius:g} m, {self.track:g} m apart, protrude from the footprint"
            )
        elif not foot.is_disc and half_track > foot.half_width + foot.rounding:
            raise FieldError("track", f"wheels {self.track:g} m apart protrude from the footprint")
        elif not foot.is_disc and self.wheel_radius > foot.half_length + foot.rounding:
            raise FieldError("wheel_radius", f"wheels of {self.wheel_radius:g} m protrude from the footprint")
        if self.wheel_room < WHEEL_ROOM * self.wheel_radius:
            raise FieldError(
                "track",
                f"wheels {self.track:g} m apart are {self.wheel_room:g} m from the footprint's edge; "
                f"their width needs {WHEEL_ROOM * self.wheel_radius:g} m",
            )

    def _require_wheels_in_polygon(self) -> None:
        r, half_track = self.wheel_radius, self.track / 2
        ends = [(x, y) for x in (-r, r) for y in (-half_track, half_track)]
        x, y = min(ends, key=lambda end: self.footprint.depth(*end))
        if self.footprint.depth(x, y) < 0:
            raise FieldError(
                "footprint",
                f"wheels of {r:g} m, {self.track:g} m apart, protrude from it at {format_point((x, y))}; its origin is the "
                "axle's centre",
            )

    @property
    def radius(self) -> float:
        """Radius of the footprint's circumscribed circle, by which planners inflate obstacles [m]."""
        return self.footprint.radius

    @property
    def wheel_room(self) -> float:
        """Least horizontal distance from a wheel's centre to the footprint's edge [m]."""
        return min(self.footprint.depth(0.0, side * self.track / 2) for side in (1, -1))

    @property
    def wheel_thickness(self) -> float:
        """Drawn thickness of the wheels, which robot files do not give, limited to the footprint [m]."""
        foot, room = self.footprint, 2 * self.wheel_room
        if not foot.corners:
            beyond = max(self.wheel_radius - foot.half_length, 0)
            edge = foot.half_width + math.sqrt(max(foot.rounding**2 - beyond**2, 0))
            room = 2 * (edge - self.track / 2)
        return max(min(2 * self.wheel_radius * WHEEL_ASPECT, room), 0.02 * self.track)

    @property
    def facts(self) -> dict[str, str]:
        """The main values as text."""
        from antdrive.robots.card import footprint_text, lidar_text

        noise = self.noise
        noisy = (
            f"pose ±{noise.pose_xy:g} m, ±{noise.pose_yaw:g} rad; encoders ±{100 * noise.encoder:g} %; "
            f"slip ±{100 * noise.slip:g} %; delay {noise.delay:g} s"
        )
        near = f"; {self.near_speed:g} m/s near movers ahead" if self.near_speed < self.max_speed else ""
        return {
            "footprint": footprint_text(self.footprint),
            "body": f"{self.height:g} m high, {self.mass:g} kg",
            "wheels": f"radius {self.wheel_radius:g} m, {self.track:g} m apart",
            "speed": f"up to {self.max_speed:g} m/s, {self.max_yaw_rate:g} rad/s{near}",
            "acceleration": f"up to {self.max_acceleration:g} m/s², {self.max_yaw_acceleration:g} rad/s²; "
            f"lateral {self.max_lateral_acceleration:g} m/s²",
            **({} if self.lidar is None else {"lidar": lidar_text(self.lidar)}),
            "noise": noisy if noise.nonzero else "none",
        }

    def _repr_html_(self) -> str:
        from antdrive.robots.card import robot_svg
        from antdrive.worlds.svg import card

        drawing = robot_svg(self.footprint, self.wheel_radius, self.track, self.wheel_thickness)
        return card(drawing, self.name, self.facts)


GRAVITY = 9.81  # [m/s^2]
ROUNDED = 1e-3  # tolerance for a lidar on the footprint's edge: files round positions [m]


def require_feasible(spec: RobotSpec) -> None:
    """Raise FieldError if wheels and motors cannot reach the robot's own limits."""
    if 2 * spec.wheel_radius > spec.height:
        raise FieldError(
            "wheel_radius",
            f"wheels of {spec.wheel_radius:g} m are taller than the body of {spec.height:g} m; "
            f"the largest radius is {spec.height / 2:.3g} m",
        )
    if spec.lidar is not None:
        require_on_robot(spec.lidar, spec.footprint)
    rim = spec.max_wheel_speed * spec.wheel_radius
    _require_reached("max_wheel_speed", f"{spec.max_wheel_speed:g} rad/s", spec, "max_speed", rim, "m/s")
    turn = 2 * rim / spec.track
    _require_reached("max_wheel_speed", f"{spec.max_wheel_speed:g} rad/s", spec, "max_yaw_rate", turn, "rad/s")
    motor = spec.wheel_torque / spec.wheel_radius
    grip, inertia = spec.wheel_friction * spec.mass * GRAVITY / 2, yaw_inertia(spec.mass, spec.footprint)
    for key, what, force in (
        ("wheel_torque", f"motors of {spec.wheel_torque:g} N m", motor),
        ("wheel_friction", f"a friction of {spec.wheel_friction:g}", grip),
    ):
        _require_reached(key, what, spec, "max_acceleration", 2 * force / spec.mass, "m/s2")
        _require_reached(key, what, spec, "max_yaw_acceleration", force * spec.track / inertia, "rad/s2")
    held = spec.wheel_friction * GRAVITY
    what = f"a friction of {spec.wheel_friction:g}"
    _require_reached("wheel_friction", what, spec, "max_lateral_acceleration", held, "m/s2")


def require_on_robot(lidar: Lidar, foot: Footprint) -> None:
    """Raise FieldError for a lidar outside the footprint, where contacts are not detected."""
    outside = -foot.depth(lidar.x, lidar.y)
    if outside > ROUNDED:
        key = "x" if abs(lidar.x) >= abs(lidar.y) else "y"
        raise FieldError(
            f"lidar.{key}",
            f"the lidar at {format_point((lidar.x, lidar.y))} is {outside:.3g} m outside the footprint; it must be on the robot",
        )


def yaw_inertia(mass: float, foot: Footprint) -> float:
    """Return the moment of inertia of a mass [kg] spread evenly over a footprint, about the axle's centre [kg m^2]."""
    if len(foot.corners) == 1:
        (x, y), r = foot.corners[0], foot.rounding
        return mass * (r**2 / 2 + x**2 + y**2)
    if foot.corners:
        area = moment = 0.0  # triangles between the origin and each edge
        for (ax, ay), (bx, by) in zip(foot.corners, (*foot.corners[1:], foot.corners[0]), strict=True):
            triangle = (ax * by - ay * bx) / 2
            area += triangle
            moment += triangle * (ax**2 + ax * bx + bx**2 + ay**2 + ay * by + by**2) / 6
        return mass * moment / area
    if foot.is_disc:
        return mass * foot.rounding**2 / 2
    half_length, half_width = foot.half_length + foot.rounding, foot.half_width + foot.rounding
    return mass * (half_length**2 + half_width**2) / 3


def _require_reached(key: str, what: str, spec: RobotSpec, limit: str, reached: float, unit: str) -> None:
    promised = getattr(spec, limit)
    if reached < promised:
        raise FieldError(
            key,
            f"{what} on a robot of {spec.mass:g} kg with wheels of {spec.wheel_radius:g} m, {spec.track:g} m apart, "
            f"reach at most {reached:.3g} {unit}, but {limit} is {promised:g}; raise {key} or lower {limit}",
        )
