"""The limits of a robot out of URDF: what the drive plugin and the joints say, what follows from it, and what is assumed.

A limit that is not used is named in the comment of the value that stands in its place.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import NamedTuple

from antdrive.robots.feasible import GRAVITY, yaw_inertia_of
from antdrive.robots.importing.model import UrdfModel
from antdrive.robots.importing.wheels import DrivenWheel
from antdrive.robots.outline import Footprint
from antdrive.robots.spec import ROBOT_RANGE

ACCELERATION, YAW_ACCELERATION = 1.0, 8.0  # that are assumed where the motors allow them [m/s^2], [rad/s^2]
SPEED, YAW_RATE = 0.5, 2.0  # that are assumed where the file has no limits [m/s], [rad/s]
MOST_YAW_RATE = 3.14  # that is taken where only the wheels limit it: half a turn a second [rad/s]
SPARE = 0.9  # the share of what the motors could do that is used
FRICTION = 1.5  # of wheels
NO_LIMIT = "assumed: the file has no limit"
LEAST_DRIVE = 0.05  # the least acceleration that makes an effort limit a motor's [m/s^2]

Found = dict[str, tuple[float, str]]  # values of a robot's file, and where they come from


class _Limit(NamedTuple):
    """A limit of a file, and where it stands; inf where there is none."""

    value: float
    where: str


def add_speeds(
    model: UrdfModel, wheels: tuple[DrivenWheel, DrivenWheel], found: Found, given: Mapping[str, float]
) -> None:
    """Add the limits of the speeds, and of the wheels' speed."""
    radius, track = found["wheel_radius"][0], found["track"][0]
    limit = min(_lowest(wheels, "velocity", "rad/s"), _lowest_commanded(wheels))
    turning = seven_digits(limit.value)
    reach = turning * radius
    for key, tags, most, assumed, unit in (
        ("max_speed", ("max_linear_velocity", "max_linear_speed"), reach, SPEED, "m/s"),
        ("max_yaw_rate", ("max_angular_velocity", "max_angular_speed"), 2 * reach / track, YAW_RATE, "rad/s"),
    ):
        tag, told = model.drive_number(*tags)
        if key in given:
            continue
        beside = ""
        if told and told > ROBOT_RANGE[key][1]:  # what is faster stands for no limit
            beside, told = f"<{tag}> of the drive plugin, {told:.7g} {unit}, is {_beyond(key, unit)}", None
        if told and told > most:
            found[key] = _five(most), f"computed: {limit.where}; <{tag}> of the drive plugin is {told:g}"
        elif told:
            found[key] = told, f"read: <{tag}> of the drive plugin"
        else:
            value, how = _of_joints(key, limit, reach, most, assumed)
            found[key] = (
                value,
                f"assumed: {beside}" if how == NO_LIMIT and beside else "; ".join(filter(None, (how, beside))),
            )
    if "max_wheel_speed" in given:
        return
    needs = 1.2 * max(found["max_speed"][0], found["max_yaw_rate"][0] * track / 2) / radius
    if turning <= ROBOT_RANGE["max_wheel_speed"][1]:
        found["max_wheel_speed"] = turning, f"read: {limit.where}"
    else:
        instead = f"; {limit.where} is {_beyond('max_wheel_speed', 'rad/s')}" if turning < math.inf else ""
        found["max_wheel_speed"] = needs, f"assumed: 1.2 times what the speeds need{instead}"


def _of_joints(key: str, limit: _Limit, reach: float, most: float, assumed: float) -> tuple[float, str]:
    """A limit of the speeds as it follows from the joints' alone, and how."""
    if reach == math.inf:
        return assumed, NO_LIMIT
    if reach > ROBOT_RANGE["max_speed"][1]:
        return assumed, f"assumed: {limit.where} would be {reach:.4g} m/s, {_beyond('max_speed', 'm/s')}"
    if key == "max_yaw_rate" and most > MOST_YAW_RATE:
        return MOST_YAW_RATE, f"assumed: half a turn a second; {limit.where} allows {most:.4g}"
    how = f"computed: {limit.where}, times the wheels' radius"
    return _five(most), how + (" over half the track" if key == "max_yaw_rate" else "")


def add_forces(
    model: UrdfModel,
    wheels: tuple[DrivenWheel, DrivenWheel],
    outline: Footprint,
    found: Found,
    given: Mapping[str, float],
) -> None:
    """Add the motors' torque, and the accelerations that they and the wheels' grip allow."""
    mass, radius, track = (found[key][0] for key in ("mass", "wheel_radius", "track"))
    if "wheel_torque" not in given:
        found["wheel_torque"] = _torque(model, wheels, mass, radius)
    inertia = yaw_inertia_of(mass, outline)
    force = min(found["wheel_torque"][0] / radius, given.get("wheel_friction", FRICTION) * mass * GRAVITY / 2)
    for key, tags, most, usual in (
        ("max_acceleration", ("max_linear_acceleration",), 2 * force / mass, ACCELERATION),
        ("max_yaw_acceleration", ("max_angular_acceleration",), force * track / inertia, YAW_ACCELERATION),
    ):
        if key in given:
            continue
        usable, (tag, told) = SPARE * most, model.drive_number(*tags)
        wanted, how = (told, f"read: <{tag}> of the drive plugin") if told else (usual, "assumed")
        less = f"; <{tag}> of the drive plugin is {told:g}" if told else ""
        found[key] = (
            (wanted, how)
            if wanted <= usable
            else (usable, f"computed: nine tenths of what motors and grip reach{less}")
        )
    if "max_lateral_acceleration" not in given:
        found["max_lateral_acceleration"] = ACCELERATION, "assumed"


def _torque(model: UrdfModel, wheels: tuple[DrivenWheel, DrivenWheel], mass: float, radius: float) -> tuple[float, str]:
    """The lowest limit that moves the robot and that its file may hold, beside all others by name."""
    limits = [_lowest(wheels, "effort", "N m")]
    tag, told = model.drive_number("max_wheel_torque", "wheelTorque", "torque")
    if told:
        limits.append(_Limit(told, f"<{tag}> of the drive plugin, {told:.7g} N m"))
    weakest, strongest = mass * LEAST_DRIVE * radius, ROBOT_RANGE["wheel_torque"][1]
    limits = sorted(limit for limit in limits if limit.value < math.inf)
    used = next((limit for limit in limits if weakest < limit.value <= strongest), None)
    beside = ""
    for limit in limits:
        if limit.value <= weakest:
            beside += f"; {limit.where} would not move {mass:.4g} kg"
        elif limit.value > strongest:
            beside += f"; {limit.where} is {_beyond('wheel_torque', 'N m')}"
        elif limit is not used:
            beside += f"; {limit.where} is more"
    if used is not None:
        return used.value, f"read: {used.where}{beside}"
    return 2 * mass * ACCELERATION * radius, f"assumed: 4 times what {ACCELERATION:g} m/s2 need{beside}"


def _beyond(key: str, unit: str) -> str:
    """What is said of a limit that no robot's file could hold."""
    return f"above the {ROBOT_RANGE[key][1]:g} {unit} that a robot's file may say, and is not used"


def _lowest(wheels: tuple[DrivenWheel, DrivenWheel], key: str, unit: str) -> _Limit:
    """The lower of a limit of the two joints, and what it is called."""
    value, name = min((getattr(wheel.joint, key) or math.inf, wheel.joint.name) for wheel in wheels)
    return _Limit(value, f"the {key} limit of joint {name}, {value:.7g} {unit}")


def _lowest_commanded(wheels: tuple[DrivenWheel, DrivenWheel]) -> _Limit:
    """The lower limit of what <ros2_control> lets the two joints be given."""
    value, name = min((wheel.joint.commanded or math.inf, wheel.joint.name) for wheel in wheels)
    return _Limit(value, f"the limit of joint {name} in <ros2_control>, {value:.7g} rad/s")


def seven_digits(value: float) -> float:
    """A number as the file will have it, in seven digits, so that what follows from it is exactly reached."""
    return float(f"{value:.7g}")


def _five(value: float) -> float:
    """The largest number of five digits that is not above a value."""
    unit = 10.0 ** (math.floor(math.log10(value)) - 4)
    near = float(f"{value:.5g}")
    return near if near <= value else float(f"{near - unit:.5g}")
