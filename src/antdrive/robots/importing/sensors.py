"""Import of a robot's lidar from the Gazebo sensors of a URDF file."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from xml.etree import ElementTree as ET

from antdrive.base.errors import FieldError
from antdrive.base.types import Floats
from antdrive.robots.lidar import Lidar
from antdrive.robots.outline import Footprint
from antdrive.robots.spec import require_on_robot
from antdrive.worlds.formats.xml import numbers_in, rotation_matrix

KINDS = ("ray", "gpu_ray", "lidar", "gpu_lidar")  # Gazebo's sensor types for lidars
LEVEL = 0.99  # minimum vertical component of a planar lidar's axis
RATE = 10.0  # default scan rate [Hz]
HALF_TURN = 3.141592  # pi in six digits, rounded down [rad]
ALL_AROUND = 2 * math.pi - 0.01  # minimum field of view that means a full circle [rad]


@dataclass(frozen=True, eq=False)
class UrdfSensor:
    """A lidar of a URDF file."""

    name: str  # for messages
    link: str  # its link
    place: Floats  # its link's frame in the root's frame (4, 4)
    element: ET.Element  # its <sensor>


def lidar_sensors(root: ET.Element, places: Mapping[str, Floats]) -> tuple[UrdfSensor, ...]:
    """Return the lidars that Gazebo simulates."""
    return tuple(
        UrdfSensor(f"sensor {sensor.get('name', 'without a name')} of link {link}", link, places[link], sensor)
        for gazebo in root.findall("gazebo")
        for sensor in gazebo.findall("sensor")
        if (link := gazebo.get("reference", "")) in places and sensor.get("type") in KINDS
    )


def import_lidar(
    sensors: tuple[UrdfSensor, ...], frame: Floats, floor: float, foot: Footprint
) -> tuple[Lidar | None, str, list[str]]:
    """Return the first lidar that a robot file can hold, or None, with a note on its source and notes on the others."""
    found: Lidar | None = None
    how, notes, unused = "", [], []
    for sensor in sensors:
        try:
            lidar, assumed = _lidar(sensor, frame, floor)
            require_on_robot(lidar, foot)
        except FieldError as error:
            unused.append((sensor.name, str(error)))
            continue
        if found is None:
            found, how = lidar, "; ".join([f"read: {sensor.name}", *assumed])
        else:
            view = f"looks {_towards(lidar)} with {math.degrees(lidar.field_of_view):.4g}° of view"
            notes.append(f"{sensor.name} is not used, because a robot file has one lidar; it {view}")
    if unused:
        more = f", nor are {len(unused) - 1} more" if len(unused) > 1 else ""
        notes.append(f"{unused[0][0]} is not used: {unused[0][1]}{more}")
    return found, how, notes


def _towards(lidar: Lidar) -> str:
    if lidar.full_circle:
        return "all around"
    angle = round(math.degrees(lidar.yaw))
    side = "left" if angle > 0 else "right"
    return {0: "ahead", 180: "backwards"}.get(abs(angle), f"{abs(angle)}° to the {side}")


def _lidar(sensor: UrdfSensor, frame: Floats, floor: float) -> tuple[Lidar, list[str]]:
    """Return a sensor's lidar and the assumptions made."""
    scan = sensor.element.find("ray")
    scan = sensor.element.find("lidar") if scan is None else scan
    if scan is None or scan.find("scan/horizontal/samples") is None:
        raise FieldError("scan", "has no horizontal samples")
    if _number(scan, "scan/vertical/samples", 1.0) > 1:
        raise FieldError("scan", "has several layers")
    x, y, z, *angles = _pose(sensor.element)
    turn = sensor.place[:3, :3] @ rotation_matrix(*angles)
    if abs(turn[2, 2]) < LEVEL:
        raise FieldError("pose", "its beams are not level")
    spot = sensor.place @ (x, y, z, 1.0)
    low, high = (_number(scan, f"scan/horizontal/{end}_angle", 0.0) for end in ("min", "max"))
    full = high - low >= ALL_AROUND
    middle = 0.0 if full else (low + high) / 2  # the first beam of a full circle is arbitrary
    ahead = turn @ (math.cos(middle), math.sin(middle), 0.0)
    (right, left), (away, aside) = frame[1:] @ ahead[:2], frame[1:] @ (spot[:2] - frame[0])
    rate = _number(sensor.element, "update_rate", 0.0)
    lidar = Lidar(
        beams=round(_number(scan, "scan/horizontal/samples", 0.0) * _number(scan, "scan/horizontal/resolution", 1.0)),
        field_of_view=round(2 * math.pi, 6) if full else high - low,
        min_range=_number(scan, "range/min", 0.0),
        max_range=_number(scan, "range/max", 0.0),
        rate=rate or RATE,
        resolution=_number(scan, "range/resolution", 0.0),
        sigma=_number(scan, "noise/stddev", 0.0),
        x=round(float(away), 5) + 0.0,
        y=round(float(aside), 5) + 0.0,
        yaw=min(max(round(math.atan2(left, right), 6), -HALF_TURN), HALF_TURN) + 0.0,
        height=round(float(spot[2]) - floor, 5),
    )
    return lidar, [] if rate else [f"rate of {RATE:g} Hz assumed"]


def decimal(value: float) -> str:
    """Format a number with a decimal point and without exponent, as YAML requires of floats."""
    digits = f"{value:.7f}".rstrip("0")
    return f"{digits}0" if digits.endswith(".") else digits


def _pose(sensor: ET.Element) -> Floats:
    """Return a sensor's pose on its link (6,): x, y, z [m], roll, pitch, yaw [rad]."""
    text = sensor.findtext("pose") or "0 0 0 0 0 0"
    pose = numbers_in(text, 6)
    if pose is None:
        raise FieldError("pose", f"must be 6 numbers, got {text.strip()[:40]!r}")
    return pose


def _number(element: ET.Element, path: str, default: float) -> float:
    text = element.findtext(path)
    if text is None or not text.strip():
        return default
    value = numbers_in(text, 1)
    if value is None:
        raise FieldError(path.rpartition("/")[2], f"must be a number, got {text.strip()[:40]!r}")
    return float(value[0])
