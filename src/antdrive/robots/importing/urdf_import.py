"""Robot files out of URDF: every value with a comment that says where it comes from.

A limit that is not used is named in the comment of the value that stands in its place.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType
from typing import NamedTuple

import numpy as np

from antdrive.base.errors import InputError, input_error
from antdrive.base.records import ranges_of
from antdrive.base.types import Floats
from antdrive.robots.importing.hull import footprint_around
from antdrive.robots.importing.model import UrdfModel, read_model
from antdrive.robots.importing.sensors import import_lidar, lidar_entry
from antdrive.robots.importing.wheels import DrivenWheel, driven_wheels
from antdrive.robots.lidar import Lidar
from antdrive.robots.outline import Footprint
from antdrive.robots.robot_file import footprint_to_dict, robot_from_text
from antdrive.robots.spec import GRAVITY, RobotSpec, yaw_inertia_of

ACCELERATION, YAW_ACCELERATION = 1.0, 8.0  # that are assumed where the motors allow them [m/s^2], [rad/s^2]
SPEED, YAW_RATE = 0.5, 2.0  # that are assumed where the file has no limits [m/s], [rad/s]
DEFAULT_YAW_RATE = 3.14  # that is taken where only the wheels limit it: half a turn a second [rad/s]
SPARE = 0.9  # the share of what the motors could do that is used
FRICTION = 1.5  # of wheels
RANGES = ranges_of(RobotSpec)
NO_LIMIT = "assumed: the file has no limit"
MIN_MOTOR_ACCELERATION = 0.05  # the least acceleration that makes an effort limit a motor's [m/s^2]

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
        if told and told > RANGES[key][1]:  # what is faster stands for no limit
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
    if turning <= RANGES["max_wheel_speed"][1]:
        found["max_wheel_speed"] = turning, f"read: {limit.where}"
    else:
        instead = f"; {limit.where} is {_beyond('max_wheel_speed', 'rad/s')}" if turning < math.inf else ""
        found["max_wheel_speed"] = needs, f"assumed: 1.2 times what the speeds need{instead}"


def _of_joints(key: str, limit: _Limit, reach: float, most: float, assumed: float) -> tuple[float, str]:
    """A limit of the speeds as it follows from the joints' alone, and how."""
    if reach == math.inf:
        return assumed, NO_LIMIT
    if reach > RANGES["max_speed"][1]:
        return assumed, f"assumed: {limit.where} would be {reach:.4g} m/s, {_beyond('max_speed', 'm/s')}"
    if key == "max_yaw_rate" and most > DEFAULT_YAW_RATE:
        return DEFAULT_YAW_RATE, f"assumed: half a turn a second; {limit.where} allows {most:.4g}"
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
    weakest, strongest = mass * MIN_MOTOR_ACCELERATION * radius, RANGES["wheel_torque"][1]
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
    return f"above the {RANGES[key][1]:g} {unit} that a robot's file may say, and is not used"


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


KINDS = ("auto", "disc", "rectangle", "polygon")
RADII = (("wheel_radius", 1.0), ("wheelRadius", 1.0), ("wheel_diameter", 0.5), ("wheelDiameter", 0.5))
TRACKS = (("wheel_separation", 1.0), ("wheelSeparation", 1.0))
DENSITY = 150.0  # of a robot whose file has no masses [kg/m^3]
DIFFERENT = 0.01  # a drive plugin contradicts the geometry from this share on
NOISE = "{pose_xy: 0.01, pose_yaw: 0.01, pose_rate: 20.0, encoder: 0.02, slip: 0.02, delay: 0.05}"  # as the catalogue assumes


class _Value(NamedTuple):
    """A value of the robot file, and where it comes from."""

    key: str
    value: float
    how: str


@dataclass(frozen=True, eq=False)
class ImportedRobot:
    """A robot out of a URDF file."""

    spec: RobotSpec
    text: str  # its file, with a comment for each value
    # the collision geometry below the height of the import, from above: points of each piece in the robot's
    # frame (N, 2) [m]
    pieces: tuple[Floats, ...]
    above: tuple[Floats, ...]  # the same of the pieces that lie above that height
    missing_meshes: tuple[str, ...]  # meshes that were not found


def import_urdf(
    path: Path,
    *,
    left: str | None = None,
    right: str | None = None,
    below: float = math.inf,
    footprint: str = "auto",
    meshes: Path | None = None,
    without_meshes: bool = False,
    given: Mapping[str, float] | None = None,
    arguments: Mapping[str, str] = MappingProxyType({}),
    packages: Mapping[str, Path] = MappingProxyType({}),
) -> ImportedRobot:
    """A differential-drive robot out of a URDF or xacro file."""
    given = _checked(given or {})
    if footprint not in KINDS:
        raise InputError(f"--footprint {footprint}: choose from {', '.join(KINDS)}")
    model = read_model(path, meshes=meshes, without_meshes=without_meshes, arguments=arguments, packages=packages)
    wheels = driven_wheels(model, left, right, given.get("wheel_radius"))
    frame = _frame(wheels)
    floor = min(wheel.centre[2] - wheel.radius for wheel in wheels)
    low = [piece for piece in model.pieces if piece.points[:, 2].min() - floor <= below]
    high = [piece for piece in model.pieces if piece.points[:, 2].min() - floor > below]
    if not {piece.link for piece in low} - {wheel.joint.child for wheel in wheels}:
        where = "" if math.isinf(below) else f" below {below:g} m"
        raise input_error(
            str(path), f"has no collision geometry{where} beside its wheels, from which a footprint could follow"
        )
    points = [_from_above(piece.points, frame) for piece in low]
    outline = footprint_around(_with_wheels(points, wheels), footprint)
    names = sorted({piece.link for piece in low})
    kind = "disc" if outline.rounding else "rectangle" if outline.box else "outline"
    what = f"{kind} around the collision geometry of {_few(names)}, and around the wheels"
    what += "" if math.isinf(below) else f", below {below:g} m"
    values = _values(model, wheels, outline, floor, given)
    text = _text(model, path, outline, what, values, import_lidar(model.lidars, frame, floor, outline))
    return ImportedRobot(
        _robot_in(text, path, values),
        text,
        tuple(points),
        tuple(_from_above(piece.points, frame) for piece in high),
        model.missing_meshes,
    )


def _checked(given: Mapping[str, float]) -> dict[str, float]:
    keys = list(ranges_of(RobotSpec))
    for key in given:
        if key not in keys:
            raise InputError(f"--set {key}: no such number in a robot file; choose from {', '.join(keys)}")
    for key in (
        "mass",
        "wheel_radius",
        "track",
        "wheel_torque",
        "wheel_friction",
    ):  # limits are computed from these before the file is checked
        value = given.get(key, 1.0)
        if not 0 < value < math.inf:
            raise InputError(f"{key}: must be a number greater than 0, got {value:g}")
    return dict(given)


def _frame(wheels: tuple[DrivenWheel, DrivenWheel]) -> Floats:
    """The robot's origin and axes, seen from above, in the root's frame: origin, x and y as rows (3, 2)."""
    left, right = wheels
    across = (left.centre - right.centre)[:2]
    y = across / np.linalg.norm(across)
    return np.array([(left.centre[:2] + right.centre[:2]) / 2, (y[1], -y[0]), y])


def _from_above(points: Floats, frame: Floats) -> Floats:
    return np.asarray((points[:, :2] - frame[0]) @ frame[1:].T)


def _with_wheels(points: list[Floats], wheels: tuple[DrivenWheel, DrivenWheel]) -> list[tuple[float, float]]:
    """All points of the pieces, and the corners of both wheels, seen from above."""
    half = float(np.linalg.norm(wheels[0].centre - wheels[1].centre)) / 2
    found = [(float(x), float(y)) for piece in points for x, y in piece]
    for side, wheel in zip((1, -1), wheels, strict=True):
        for x in (-wheel.radius, wheel.radius):
            found += [(x, side * half - wheel.width / 2), (x, side * half + wheel.width / 2)]
    return found


def _values(
    model: UrdfModel,
    wheels: tuple[DrivenWheel, DrivenWheel],
    outline: Footprint,
    floor: float,
    given: Mapping[str, float],
) -> list[_Value]:
    left, right = wheels
    track = seven_digits(float(np.linalg.norm(left.centre - right.centre)))
    radius = seven_digits((left.radius + right.radius) / 2)
    top = max((float(piece.points[:, 2].max()) for piece in model.pieces), default=0.0) - floor
    xmin, ymin, xmax, ymax = outline.bounds
    apart = f"computed: between the middles of {left.joint.child} and {right.joint.child}"
    size = f"read: {left.read_from}" + ("" if left.given else _contradiction(model, radius, *RADII))
    found: Found = {
        "height": (max(top, 2 * radius), "computed: top of the collision geometry above the floor"),
        "wheel_radius": (radius, size),
        "track": (track, apart + _contradiction(model, track, *TRACKS)),
        "mass": _mass(model, (xmax - xmin) * (ymax - ymin) * max(top, 2 * radius)),
    }
    for key, value in given.items():
        found[key] = value, "given"
    add_speeds(model, wheels, found, given)
    add_forces(model, wheels, outline, found, given)
    return [_Value(key, *found[key]) for key in ranges_of(RobotSpec) if key in found]


def _robot_in(text: str, path: Path, values: list[_Value]) -> RobotSpec:
    """The robot; a value that no robot may have is refused with where it came from."""
    try:
        return robot_from_text(text, f"{path}, as imported", path.stem)
    except InputError as error:
        how = next((f" ({value.how})" for value in values if f": {value.key}: " in str(error)), "")
        raise InputError(f"{error}{how}") from None


def _contradiction(model: UrdfModel, value: float, *tags: tuple[str, float]) -> str:
    """What to add where the drive plugin says otherwise: the tags that it may use, and how often the value they have."""
    for tag, share in tags:
        _, told = model.drive_number(tag)
        if told and abs(told * share - value) > DIFFERENT * value:
            return f"; <{tag}> of the drive plugin is {told:g}"
    return ""


def _mass(model: UrdfModel, box: float) -> tuple[float, str]:
    """The mass, of the links that have one, or of a box of a usual density [m^3]."""
    heavy = [name for name, mass in model.masses.items() if mass > 0]
    if not heavy:
        return DENSITY * box, f"assumed: {DENSITY:g} kg/m3, as the file has no masses"
    light = sorted({piece.link for piece in model.pieces} - set(heavy))
    without = f"; {_few(light)} {'have' if len(light) > 1 else 'has'} none" if light else ""
    return sum(model.masses.values()), f"computed: sum of the masses of {_few(heavy)}{without}"


def _text(
    model: UrdfModel, path: Path, outline: Footprint, what: str, values: list[_Value], sight: tuple[Lidar | None, str]
) -> str:
    """The robot's file."""
    lidar, seen = sight
    name = "".join(c for c in model.name if c.isprintable()).strip() or path.stem
    rows = [("schema: 1", ""), (f"name: {_quoted(name[:200])}", "read: the robot's name")]
    rows.append((f"source: {_quoted(f'imported from {path.name}')}", ""))
    foot = footprint_to_dict(outline)
    if outline.box is not None and outline.corners:
        length, width, centre = outline.box
        foot = {"length": round(length, 9), "width": round(width, 9), "centre": [round(v, 9) for v in centre]}
    rows.append((f"footprint: {_flow(foot)}", f"computed: {what}"))
    rows += [(f"{value.key}: {_rounded(value)}", value.how) for value in values]
    if lidar is not None:
        rows.append((f"lidar: {_flow(lidar_entry(lidar))}", seen))
    rows.append((f"noise: {NOISE}", "assumed: as in the catalogue; measure the robot's own"))
    lines = []
    for text, how in rows:
        comment = "".join(c if c.isprintable() else "?" for c in how)
        if not comment:
            lines.append(text)
        elif len(text) > 40:
            lines += [f"# {comment}", text]
        else:
            lines.append(f"{text:30}  # {comment}")
    if lidar is None and seen:
        lines.append(f"# no lidar: {''.join(c if c.isprintable() else '?' for c in seen)}")
    if model.missing_meshes:
        left = "; ".join("".join(c if c.isprintable() else "?" for c in mesh) for mesh in model.missing_meshes)
        lines.append(f"# left out, because they were not found: {left}")
    return "\n".join(lines) + "\n"


def _rounded(value: _Value) -> str:
    """A value in seven digits, with a point, as YAML's floats are written."""
    digits = value.value if value.how == "given" else seven_digits(value.value)
    return f"{digits:.10f}".rstrip("0").rstrip(".") if digits < 1e9 else repr(digits)


def _flow(entry: Mapping[str, object]) -> str:
    return "{" + ", ".join(f"{key}: {value}" for key, value in entry.items()) + "}"


def _quoted(text: str) -> str:
    escaped = text.replace("\\", "\\\\").replace('"', '\\"')
    return f'"{escaped}"'


def _few(names: list[str]) -> str:
    return ", ".join(names[:4]) + (f" and {len(names) - 4} more" if len(names) > 4 else "")
