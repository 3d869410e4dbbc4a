"""Whether a robot can do what its file promises. Closed forms, with the numbers in the message."""

from __future__ import annotations

from antdrive.base.errors import FieldError
from antdrive.robots.lidar import Lidar
from antdrive.robots.spec import Footprint, RobotSpec

GRAVITY = 9.81  # [m/s^2]
ROUNDED = 1e-3  # a lidar on the footprint's edge may be this far outside: files round places [m]


def require_feasible(robot: RobotSpec) -> None:
    """Refuse a robot whose wheels and motors cannot reach its own limits.

    Raises:
        FieldError: the wheels are higher than the body, turn too slowly, or cannot push as hard as promised, or the
            lidar is not on the robot.
    """
    if 2 * robot.wheel_radius > robot.height:
        raise FieldError(
            "wheel_radius",
            f"wheels of {robot.wheel_radius:g} m are higher than the body of {robot.height:g} m; "
            f"at most {robot.height / 2:.3g} m fits",
        )
    if robot.lidar is not None:
        require_on_robot(robot.lidar, robot.footprint)
    rim = robot.max_wheel_speed * robot.wheel_radius
    _require_reached("max_wheel_speed", f"{robot.max_wheel_speed:g} rad/s", robot, "max_speed", rim, "m/s")
    turn = 2 * rim / robot.track
    _require_reached("max_wheel_speed", f"{robot.max_wheel_speed:g} rad/s", robot, "max_yaw_rate", turn, "rad/s")
    motor = robot.wheel_torque / robot.wheel_radius
    grip = robot.wheel_friction * robot.mass * GRAVITY / 2
    for key, what, force in (
        ("wheel_torque", f"motors of {robot.wheel_torque:g} N m", motor),
        ("wheel_friction", f"a friction of {robot.wheel_friction:g}", grip),
    ):
        _require_reached(key, what, robot, "max_acceleration", 2 * force / robot.mass, "m/s2")
        _require_reached(key, what, robot, "max_yaw_acceleration", force * robot.track / yaw_inertia(robot), "rad/s2")
    held = robot.wheel_friction * GRAVITY
    what = f"a friction of {robot.wheel_friction:g}"
    _require_reached("wheel_friction", what, robot, "max_lateral_acceleration", held, "m/s2")


def require_on_robot(lidar: Lidar, foot: Footprint) -> None:
    """Refuse a lidar beside the robot: nothing would notice what it strikes, and it would look through what it stands in.

    Raises:
        FieldError: the lidar is outside; the key is the coordinate that is farther from the axle's centre.
    """
    outside = -foot.depth(lidar.x, lidar.y)
    if outside > ROUNDED:
        key = "x" if abs(lidar.x) >= abs(lidar.y) else "y"
        raise FieldError(
            f"lidar.{key}",
            f"the lidar at ({lidar.x:g}, {lidar.y:g}) is {outside:.3g} m outside the footprint; it must be on the robot",
        )


def yaw_inertia(robot: RobotSpec) -> float:
    """Moment of inertia of a robot's body about the vertical axis through its axle's centre, mass spread evenly [kg m^2]."""
    return yaw_inertia_of(robot.mass, robot.footprint)


def yaw_inertia_of(mass: float, foot: Footprint) -> float:
    """The same of a mass [kg] that is spread evenly over a footprint."""
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


def _require_reached(key: str, what: str, robot: RobotSpec, limit: str, reached: float, unit: str) -> None:
    promised = getattr(robot, limit)
    if reached < promised:
        raise FieldError(
            key,
            f"{what} on a robot of {robot.mass:g} kg with wheels of {robot.wheel_radius:g} m, {robot.track:g} m apart, "
            f"reach {reached:.3g} {unit} at most, but {limit} is {promised:g}; raise {key} or lower {limit}",
        )
