"""Conversion of URDF models to robot files, with a comment on the origin of each value.

Each comment also names the limits that its value overrides.
"""

from __future__ import annotations

import dataclasses
import json
import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType
from typing import NamedTuple

import numpy as np

from antdrive.base.checks import yaml_flow
from antdrive.base.errors import InputError, few, input_error
from antdrive.base.records import ranges_of
from antdrive.base.types import Floats
from antdrive.robots.importing.hull import footprint_around
from antdrive.robots.importing.model import CollisionPiece, UrdfModel, read_model, solid_tag
from antdrive.robots.importing.plausible import below_arms, implausible, plausible_speeds
from antdrive.robots.importing.sensors import decimal, import_lidar, lidar_sensors
from antdrive.robots.importing.wheels import RADII, Pair, driven_links, driven_wheels, notes_on_wheels
from antdrive.robots.outline import Footprint
from antdrive.robots.robot_file import footprint_to_dict, robot_from_text
from antdrive.robots.spec import GRAVITY, RobotSpec, yaw_inertia

ACCELERATION, YAW_ACCELERATION = 1.0, 8.0  # defaults, if the motors allow them [m/s^2], [rad/s^2]
SPEED, YAW_RATE = 0.5, 2.0  # defaults if the file has no limits [m/s], [rad/s]
DEFAULT_YAW_RATE = 3.14  # default if only the wheels limit it: half a turn a second [rad/s]
SPARE = 0.9  # used fraction of the motors' capability
FRICTION = 1.5  # of wheels
RANGES = ranges_of(RobotSpec)
MIN_MOTOR_ACCELERATION = 0.05  # an effort limit for less than this is not a motor's [m/s^2]

Origins = dict[str, tuple[float, str]]  # values of a robot file with their origins


class _Limit(NamedTuple):
    """A limit and its origin in the file; inf if unlimited."""

    value: float
    where: str


UNLIMITED = _Limit(math.inf, "")
LIMITS = {  # of joints: text and unit
    "velocity": ("the velocity limit of joint {}", "rad/s"),
    "commanded": ("the limit of joint {} in <ros2_control>", "rad/s"),
    "effort": ("the effort limit of joint {}", "N m"),
}


def add_speeds(model: UrdfModel, wheels: Pair, outline: Footprint, values: Origins, given: Mapping[str, float]) -> None:
    """Add the limits of speed, yaw rate and wheel speed.

    A limit of the wheels that gives an implausible speed is a placeholder, not used and named.
    """
    radius, track = values["wheel_radius"][0], values["track"][0]
    limits = [limit for key in ("velocity", "commanded") if (limit := _lowest(wheels, key)).value < math.inf]
    slow, fast = plausible_speeds(outline, RANGES["max_speed"][1])
    used = [limit for limit in limits if slow <= limit.value * radius <= fast]
    limit = min(used, default=UNLIMITED)
    reach = seven_digits(limit.value) * radius
    said = [
        f"{other.where}, would be {other.value * radius:.4g} m/s, implausible for its size, not used"
        for other in limits
        if other not in used
    ]
    for key, tags, most, usual, unit in (
        ("max_speed", ("max_linear_velocity", "max_linear_speed", "linear_velocity_limit"), reach, SPEED, "m/s"),
        ("max_yaw_rate", ("max_angular_velocity", "max_angular_speed"), 2 * reach / track, YAW_RATE, "rad/s"),
    ):
        if key in given:
            continue
        (tag, stated), beside = model.drive_number(*tags), list(said)
        plugin = f"<{tag}> of the drive plugin"
        if stated and stated > RANGES[key][1]:  # higher values mean no limit
            beside.append(f"{plugin}, {stated:.7g} {unit}, is {_beyond(key, unit)}")
            stated = None
        if stated and stated > most:
            value, how = _five(most), f"computed: {limit.where}; {plugin} is {stated:g}"
        elif stated:
            value, how = stated, f"read: {plugin}"
        elif most == math.inf:
            value, how = usual, f"assumed: {beside.pop(0) if beside else 'the file has no limit'}"
        elif key == "max_yaw_rate" and most > DEFAULT_YAW_RATE:
            value, how = DEFAULT_YAW_RATE, f"assumed: half a turn a second; {limit.where} allows {most:.4g}"
        else:
            over = " over half the track" if key == "max_yaw_rate" else ""
            value, how = _five(most), f"computed: {limit.where}, times the wheels' radius{over}"
        values[key] = value, "; ".join([how, *beside])
    if "max_wheel_speed" in given:
        return
    needs = 1.2 * max(values["max_speed"][0], values["max_yaw_rate"][0] * track / 2) / radius
    limit = min((limit for limit in limits if limit.value * radius >= slow), default=UNLIMITED)
    values["max_wheel_speed"] = seven_digits(limit.value), f"read: {limit.where}"
    if limit.value > RANGES["max_wheel_speed"][1]:
        instead = f"; {limit.where} is {_beyond('max_wheel_speed', 'rad/s')}" if limit != UNLIMITED else ""
        values["max_wheel_speed"] = needs, f"assumed: 1.2 times the speeds' requirement{instead}"


def add_forces(model: UrdfModel, wheels: Pair, outline: Footprint, values: Origins, given: Mapping[str, float]) -> None:
    """Add the motors' torque and the accelerations that motors and grip allow."""
    mass, radius, track = (values[key][0] for key in ("mass", "wheel_radius", "track"))
    if "wheel_torque" not in given:
        values["wheel_torque"] = _torque(model, wheels, mass, radius)
    inertia = yaw_inertia(mass, outline)
    force = min(values["wheel_torque"][0] / radius, given.get("wheel_friction", FRICTION) * mass * GRAVITY / 2)
    for key, tags, most, usual in (
        ("max_acceleration", ("max_linear_acceleration",), 2 * force / mass, ACCELERATION),
        ("max_yaw_acceleration", ("max_angular_acceleration",), force * track / inertia, YAW_ACCELERATION),
    ):
        if key in given:
            continue
        usable, (tag, stated) = SPARE * most, model.drive_number(*tags)
        wanted, how = (stated, f"read: <{tag}> of the drive plugin") if stated else (usual, "assumed")
        less = f"; <{tag}> of the drive plugin is {stated:g}" if stated else ""
        computed = usable, f"computed: 0.9 times the limit of motors and grip{less}"
        values[key] = (wanted, how) if wanted <= usable else computed
    if "max_lateral_acceleration" not in given:
        values["max_lateral_acceleration"] = ACCELERATION, "assumed"


def _torque(model: UrdfModel, wheels: Pair, mass: float, radius: float) -> tuple[float, str]:
    """Return the lowest plausible torque limit; its origin text names all others."""
    tag, stated = model.drive_number("max_wheel_torque", "wheelTorque", "torque")
    plugin = _Limit(stated or math.inf, f"<{tag}> of the drive plugin, {stated or 0:.7g} N m")
    weakest, strongest = mass * MIN_MOTOR_ACCELERATION * radius, RANGES["wheel_torque"][1]
    limits = sorted(limit for limit in (_lowest(wheels, "effort"), plugin) if limit.value < math.inf)
    used = next((limit for limit in limits if weakest < limit.value <= strongest), None)
    value, how = 2 * mass * ACCELERATION * radius, f"assumed: 4 times the torque for {ACCELERATION:g} m/s2"
    if used is not None:
        value, how = used.value, f"read: {used.where}"
    for limit in limits:
        if limit.value <= weakest:
            how += f"; {limit.where} would not move {mass:.4g} kg"
        elif limit.value > strongest:
            how += f"; {limit.where} is {_beyond('wheel_torque', 'N m')}"
        elif limit is not used:
            how += f"; {limit.where} is more"
    return value, how


def _beyond(key: str, unit: str) -> str:
    """Return the remark on a limit above the range of robot files."""
    return f"above the {RANGES[key][1]:g} {unit} limit of robot files, not used"


def _lowest(wheels: Pair, key: str) -> _Limit:
    """Return the lower limit of the two joints, with its origin."""
    what, unit = LIMITS[key]
    value, wheel = min(((getattr(wheel.joint, key) or math.inf, wheel) for wheel in wheels), key=lambda pair: pair[0])
    together = f" together with {', '.join(wheel.joints[1:])}" if key == "effort" and wheel.joints else ""
    return _Limit(value, f"{what.format(wheel.joint.name + together)}, {value:.7g} {unit}")


def seven_digits(value: float) -> float:
    """Round a number to seven digits, as in the file, so that derived values match it exactly."""
    return float(f"{value:.7g}")


def _five(value: float) -> float:
    """Round a number down to five digits."""
    unit = 10.0 ** (math.floor(math.log10(value)) - 4)
    near = float(f"{value:.5g}")
    return near if near <= value else float(f"{near - unit:.5g}")


KINDS = ("auto", "disc", "rectangle", "polygon")
TRACKS = (("wheel_separation", 1.0), ("wheelSeparation", 1.0))
DENSITY = 150.0  # assumed without masses in the file [kg/m^3]
DIFFERENT = 0.01  # relative difference beyond which a drive plugin contradicts the geometry
DOUBTFUL, DOUBT = 0.05, "; check which is right"  # the same, beyond which it is noted
NOISE = "{pose_xy: 0.01, pose_yaw: 0.01, pose_rate: 20.0, encoder: 0.02, slip: 0.02, delay: 0.05}"  # the catalogue's assumption


class _Value(NamedTuple):
    """A value of the robot file and its origin."""

    key: str
    value: float
    how: str

    @property
    def assumed(self) -> bool:
        return self.how.startswith("assumed")

    @property
    def doubtful(self) -> bool:
        """Whether it is an assumed speed, or the drive plugin contradicts it."""
        return (self.key == "max_speed" and self.assumed) or self.how.endswith(DOUBT)


@dataclass(frozen=True, eq=False)
class ImportedRobot:
    """A robot imported from a URDF file."""

    spec: RobotSpec
    text: str  # the robot file, with a comment for each value
    # collision geometry below the import's height: each piece's points in the robot's frame, in top view (N, 2) [m]
    pieces: tuple[Floats, ...]
    above: tuple[Floats, ...]  # collision geometry above that height
    notes: tuple[str, ...]  # assumptions and implausible values, also in the text


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
    """Import a differential-drive robot from a URDF or xacro file."""
    given = _checked(given or {})
    if footprint not in KINDS:
        raise InputError(f"--footprint {footprint}: choose from {', '.join(KINDS)}")
    model = read_model(path, meshes=meshes, without_meshes=without_meshes, arguments=arguments, packages=packages)
    with model.missing.named():
        wheels = driven_wheels(model, left, right, given.get("wheel_radius"))
        frame, floor = planar_frame(wheels), floor_under(wheels)
        solid = solid_pieces(model, wheels)
        low = [piece for piece in solid if piece.bottom - floor <= below]
        high = [piece for piece in solid if piece.bottom - floor > below]
        if not {piece.link for piece in low} - driven_links(model, wheels):
            where = "" if math.isinf(below) else f" below {below:g} m"
            what = f"has no collision geometry{where} other than its wheels, so no footprint"
            raise input_error(str(path), f"{what}; give its body <collision>")
        points = [from_above(piece.points, frame) for piece in low]
        outline = footprint_around(with_wheels(points, wheels), footprint)
        names = sorted({piece.link for piece in low})
        kind = "disc" if outline.rounding else "rectangle" if outline.box else "outline"
        drawn = solid_tag(model.root) == "visual"
        what = f"{kind} around the {'drawn' if drawn else 'collision'} geometry of {few(names)} and the wheels"
        what += "" if math.isinf(below) else f", below {below:g} m"
        values = _values(model, wheels, outline, floor, given)
        lidar, seen, unused = import_lidar(lidar_sensors(model.root, model.places), frame, floor, outline)
        rows = [] if lidar is None else [(f"lidar: {yaml_flow(dataclasses.asdict(lidar), decimal)}", seen)]
        text = _text(model, outline, what, values, rows)
        spec = _robot_in(text, path, values)
        doubts = [f"{v.key} {v.value:.4g} is {v.how}; --set {v.key}=VALUE overrides" for v in values if v.doubtful]
        notes = [
            *notes_on_wheels(model, wheels),
            *doubts,
            *implausible(spec, wheels[0].span, {*given, *(value.key for value in values if value.assumed)}),
            *below_arms(model, low, frame, floor),
            *unused,
            *(["the file has no collision geometry: the drawn one counts"] if drawn else []),
            *model.missing.notes,
            *([f"omitted, because not found: {'; '.join(model.missing_meshes)}"] if model.missing_meshes else []),
        ]
        notes = [_printable(note) for note in notes]
        return ImportedRobot(
            spec,
            text + "".join(f"# note: {note}\n" for note in notes),
            tuple(points),
            tuple(from_above(piece.points, frame) for piece in high),
            tuple(notes),
        )


def solid_pieces(model: UrdfModel, wheels: Pair) -> list[CollisionPiece]:
    """Return the collision geometry without driven wheels' spheres, which are wider than the wheels."""
    links = driven_links(model, wheels)
    return [piece for piece in model.pieces if piece.kind != "sphere" or piece.link not in links]


def _checked(given: Mapping[str, float]) -> dict[str, float]:
    for key in given:
        if key not in RANGES:
            raise InputError(f"--set {key}: no such number in a robot file; choose from {', '.join(RANGES)}")
    # limits are computed from these before the file is checked
    for key in ("mass", "wheel_radius", "track", "wheel_torque", "wheel_friction"):
        if not 0 < (value := given.get(key, 1.0)) < math.inf:
            raise InputError(f"{key}: must be a number greater than 0, got {value:g}")
    return dict(given)


def planar_frame(wheels: Pair) -> Floats:
    """Return the robot's planar frame in the root's frame: origin, x and y as rows (3, 2)."""
    left, right = wheels
    across = (left.centre - right.centre)[:2]
    y = across / np.linalg.norm(across)
    return np.array([(left.centre[:2] + right.centre[:2]) / 2, (y[1], -y[0]), y])


def floor_under(wheels: Pair) -> float:
    """Return the floor's height in the root's frame [m]."""
    return float(min(wheel.centre[2] - wheel.radius for wheel in wheels))


def from_above(points: Floats, frame: Floats) -> Floats:
    """Return points (N, 3) of the root's frame in top view, in the robot's frame (N, 2)."""
    return np.asarray((points[:, :2] - frame[0]) @ frame[1:].T)


def with_wheels(points: list[Floats], wheels: Pair) -> list[tuple[float, float]]:
    """Return the points of all pieces and the corners of both wheels in top view."""
    half = float(np.linalg.norm(wheels[0].centre - wheels[1].centre)) / 2
    corners = [(float(x), float(y)) for piece in points for x, y in piece]
    for side, wheel in zip((1, -1), wheels, strict=True):
        for x in (-wheel.radius - wheel.span / 2, wheel.radius + wheel.span / 2):
            corners += [(x, side * half - wheel.width / 2), (x, side * half + wheel.width / 2)]
    return corners


def _values(
    model: UrdfModel, wheels: Pair, outline: Footprint, floor: float, given: Mapping[str, float]
) -> list[_Value]:
    left, right = wheels
    track = seven_digits(float(np.linalg.norm(left.centre - right.centre)))
    radius = seven_digits((left.radius + right.radius) / 2)
    top = max((float(piece.points[:, 2].max()) for piece in model.pieces), default=0.0) - floor
    xmin, ymin, xmax, ymax = outline.bounds
    apart = f"computed: distance between {left.joint.child} and {right.joint.child}"
    size = f"read: {left.read_from}" + ("" if left.given else _contradiction(model, radius, *RADII))
    values: Origins = {
        "height": (max(top, 2 * radius), "computed: top of the collision geometry above the floor"),
        "wheel_radius": (radius, size),
        "track": (track, apart + _contradiction(model, track, *TRACKS)),
        "mass": _mass(model, (xmax - xmin) * (ymax - ymin) * max(top, 2 * radius)),
    }
    values |= {key: (value, "given") for key, value in given.items()}
    add_speeds(model, wheels, outline, values, given)
    add_forces(model, wheels, outline, values, given)
    return [_Value(key, *values[key]) for key in RANGES if key in values]


def _robot_in(text: str, path: Path, values: list[_Value]) -> RobotSpec:
    """Parse the robot file; errors name the origin of the value."""
    try:
        return robot_from_text(text, f"{path}, as imported", path.stem)
    except InputError as error:
        how = next((f" ({value.how})" for value in values if f": {value.key}: " in str(error)), "")
        raise InputError(f"{error}{how}") from None


def _contradiction(model: UrdfModel, value: float, *tags: tuple[str, float]) -> str:
    """Return a remark if the drive plugin contradicts a value; tags come with their scale."""
    for tag, scale in tags:
        _, stated = model.drive_number(tag)
        if stated and abs(stated * scale - value) > DIFFERENT * value:
            far = abs(stated * scale - value) > DOUBTFUL * value
            return f"; <{tag}> of the drive plugin is {stated:g}" + (DOUBT if far else "")
    return ""


def _mass(model: UrdfModel, box: float) -> tuple[float, str]:
    """Return the sum of the links' masses, or the mass of a box of this volume [m^3] at typical density."""
    heavy = [name for name, mass in model.masses.items() if mass > 0]
    if not heavy:
        return DENSITY * box, f"assumed: {DENSITY:g} kg/m3, as the file has no masses"
    light = sorted({piece.link for piece in model.pieces} - set(heavy))
    without = f"; {few(light)} {'have' if len(light) > 1 else 'has'} none" if light else ""
    return sum(model.masses.values()), f"computed: sum of the masses of {few(heavy)}{without}"


def _text(model: UrdfModel, outline: Footprint, what: str, values: list[_Value], lidar: list[tuple[str, str]]) -> str:
    """Return the text of the robot file."""
    name = "".join(c for c in model.name if c.isprintable()).strip() or model.source.stem
    name, source = (json.dumps(text, ensure_ascii=False) for text in (name[:200], f"imported from {model.source.name}"))
    rows = [("schema: 1", ""), (f"name: {name}", "read: the robot's name"), (f"source: {source}", "")]
    foot = footprint_to_dict(outline)
    if outline.box is not None and outline.corners:
        length, width, centre = outline.box
        foot = {"length": round(length, 9), "width": round(width, 9), "centre": [round(v, 9) for v in centre]}
    rows.append((f"footprint: {yaml_flow(foot, decimal)}", f"computed: {what}"))
    rows += [(f"{value.key}: {_rounded(value)}", value.how) for value in values]
    rows += lidar
    rows.append((f"noise: {NOISE}", "assumed: as in the catalogue; measure the robot's own"))
    lines = []
    for text, how in rows:
        if how and len(text) > 40:
            lines += [f"# {_printable(how)}", text]
        else:
            lines.append(f"{text:30}  # {_printable(how)}" if how else text)
    return "\n".join(lines) + "\n"


def _rounded(value: _Value) -> str:
    """Format a value in seven digits, without exponent."""
    digits = value.value if value.how == "given" else seven_digits(value.value)
    return f"{digits:.10f}".rstrip("0").rstrip(".") if digits < 1e9 else repr(digits)


def _printable(text: str) -> str:
    return "".join(c if c.isprintable() else "?" for c in text)
