"""Robot files: specifications read from YAML, and the catalogue of robots that the package contains."""

from __future__ import annotations

import dataclasses
import os
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any

from pydantic import BaseModel, ConfigDict, Field, model_validator

from antdrive.base.checks import OneLine, SchemaVersion, check, suggest
from antdrive.base.document import Document, parse_document, read_yaml
from antdrive.base.errors import FieldError, input_error
from antdrive.robots.feasible import require_feasible
from antdrive.robots.lidar import LIDAR_RANGE, Lidar
from antdrive.robots.outline import MOST_CORNERS
from antdrive.robots.spec import NOISE_RANGE, ROBOT_RANGE, Footprint, Noise, RobotSpec
from antdrive.worlds.reuse import reused

_CATALOG = Path(__file__).with_name("catalog")
_RULES = ConfigDict(strict=True, extra="forbid", allow_inf_nan=False, frozen=True)

_Size = Annotated[float, Field(gt=0)]
_Place = Annotated[list[float], Field(min_length=2, max_length=2)]


_FORMS = (
    "write {radius: 0.18} for a disc, {length: 0.5, width: 0.4} for a rectangle, either with centre: [0.1, 0] if its middle "
    "is not the axle's, or {polygon: [[0.3, -0.2], [0.3, 0.2], [-0.2, 0.2], [-0.2, -0.2]]}"
)


class FootprintEntry(BaseModel):
    """A disc, given by its radius, a rectangle, given by its length (along the heading) and width, or a convex polygon.

    Positions are in the robot's frame: x ahead and y to the left of the axle's centre.
    """

    model_config = _RULES

    radius: _Size | None = Field(None, description="radius of a round robot [m]")
    length: _Size | None = Field(None, description="length of a rectangular robot, along its heading [m]")
    width: _Size | None = Field(None, description="width of a rectangular robot [m]")
    centre: _Place | None = Field(
        None, description="middle of the disc or rectangle: x ahead, y to the left of the axle's centre [m]"
    )
    polygon: list[_Place] | None = Field(
        None,
        description="corners of a convex outline, in order: x ahead, y to the left of the axle's centre [m]; at most "
        f"{MOST_CORNERS}",
    )

    @model_validator(mode="after")
    def _one_kind(self) -> FootprintEntry:
        given = {key for key in ("radius", "length", "width", "polygon") if getattr(self, key) is not None}
        if given not in ({"radius"}, {"length", "width"}, {"polygon"}) or (self.centre and self.polygon):
            raise ValueError(_FORMS)
        return self

    def footprint(self) -> Footprint:
        """The footprint that this entry describes.

        Raises:
            FieldError: the polygon is not convex.
        """
        centre = (self.centre[0], self.centre[1]) if self.centre is not None else (0.0, 0.0)
        if self.polygon is not None:
            try:
                return Footprint.polygon(self.polygon)
            except FieldError as error:
                raise FieldError("footprint.polygon", error.problem) from None
        if self.radius is not None:
            return Footprint.disc(self.radius, centre)
        return Footprint.rectangle(self.length or 0.0, self.width or 0.0, centre)


def _level(key: str, description: str) -> Any:
    low, high = NOISE_RANGE[key]
    return Field(getattr(Noise(), key), ge=low, le=high, description=description)


def _number(key: str, description: str, default: Any = ...) -> Any:
    low, high = ROBOT_RANGE[key]
    return Field(default, ge=low, le=high, description=description)


class NoiseEntry(BaseModel):
    """How the real robot differs from a perfect one; a level that is left out is that of a perfect robot."""

    model_config = _RULES

    pose_xy: float = _level("pose_xy", "standard deviation of a pose fix in x and in y [m]")
    pose_yaw: float = _level("pose_yaw", "standard deviation of a pose fix's heading [rad]")
    pose_rate: float = _level("pose_rate", "rate of pose fixes; between two fixes the robot uses odometry [Hz]")
    encoder: float = _level("encoder", "standard deviation of each wheel's measured speed, as a fraction")
    slip: float = _level("slip", "standard deviation of each wheel's slip, as a fraction of its speed")
    delay: float = _level("delay", "time from a command to the motors [s]")


def _beam(key: str, description: str, default: Any = ...) -> Any:
    low, high = LIDAR_RANGE[key]
    return Field(default, ge=low, le=high, description=description)


class LidarEntry(BaseModel):
    """A planar lidar: evenly spaced beams at one height."""

    model_config = _RULES

    beams: int = _beam("beams", "number of beams in a scan")
    field_of_view: float = _beam("field_of_view", "angle from the first to the last beam [rad]; 6.2832: all around")
    min_range: float = _beam("min_range", "what is nearer is not measured [m]")
    max_range: float = _beam("max_range", "what is farther is not seen [m]")
    rate: float = _beam("rate", "scans in a second [Hz]")
    resolution: float = _beam("resolution", "ranges are multiples of it [m]; 0: exact", 0.0)
    sigma: float = _beam("sigma", "standard deviation of a range [m]", 0.0)
    x: float = _beam("x", "place ahead of the axle's centre [m]", 0.0)
    y: float = _beam("y", "place to the left of the axle's centre [m]", 0.0)
    yaw: float = _beam("yaw", "heading, counter-clockwise from the robot's [rad]", 0.0)
    height: float = _beam("height", "height above the floor [m]; lower cylinders are not seen", 0.2)


class RobotFile(BaseModel):
    """A differential-drive robot: two driven wheels on one axle, whose centre is the robot's origin, and two casters."""

    model_config = _RULES

    schema_: SchemaVersion = Field(alias="schema", description="write schema: 1")
    name: OneLine = Field(min_length=1, max_length=200, description="name of the robot, by default that of the file")
    source: str | None = Field(None, description="where these values come from, free text")
    footprint: FootprintEntry = Field(description=f"{_FORMS} [m]")
    height: float = _number("height", "height of the body [m]")
    mass: float = _number("mass", "mass of the whole robot [kg]")
    wheel_radius: float = _number("wheel_radius", "radius of the driven wheels [m]")
    track: float = _number("track", "distance between the driven wheels [m]")
    max_speed: float = _number("max_speed", "limit of the forward speed [m/s]")
    max_yaw_rate: float = _number("max_yaw_rate", "limit of the yaw rate [rad/s]")
    max_acceleration: float = _number("max_acceleration", "limit of acceleration and deceleration [m/s^2]")
    max_yaw_acceleration: float = _number("max_yaw_acceleration", "limit of the change of the yaw rate [rad/s^2]")
    max_lateral_acceleration: float = _number("max_lateral_acceleration", "limit of speed times yaw rate [m/s^2]")
    max_wheel_speed: float = _number("max_wheel_speed", "limit of each wheel's speed [rad/s]")
    wheel_torque: float = _number("wheel_torque", "highest torque of each wheel's motor [N m]")
    wheel_friction: float = _number("wheel_friction", "Coulomb friction coefficient of the wheels on the floor", 1.5)
    noise: NoiseEntry = Field(
        NoiseEntry(), description="errors of pose, encoders and wheels, and delay; `--noise` multiplies them"
    )
    lidar: LidarEntry | None = Field(None, description="what the robot sees with, for worlds that it has no map of")


def list_robots() -> Mapping[str, Path]:
    """The files of the robots in the package's catalogue, by name."""
    return {path.stem: path for path in sorted(_CATALOG.glob("*.yaml"))}


def load_robot(robot: str | os.PathLike[str]) -> RobotSpec:
    """The robot that a file describes.

    Args:
        robot: the file's path, or a name from `list_robots`

    Raises:
        InputError: the file does not exist, or something in it is wrong.
    """
    known = list_robots()
    path = known[robot] if isinstance(robot, str) and robot in known else Path(robot)
    if not os.path.lexists(path):
        hint = suggest(path.stem, known)
        raise input_error(os.fspath(robot), f"no such file and no such robot in the catalogue; {hint}")
    if path.suffix.lower() in (".urdf", ".xacro"):
        raise input_error(str(path), f"is no robot file; make one of it with antdrive robots import {path}")
    return _robot_in(read_yaml(path), os.fspath(path), path.stem)


def robot_from_text(text: str, source: str, stem: str) -> RobotSpec:
    """The robot in the text of a robot file.

    Raises:
        InputError: something in it is wrong.
    """
    return _robot_in(text, source, stem)


@reused(16)
def _robot_in(text: str, source: str, stem: str) -> RobotSpec:
    """The robot in the text of a robot file."""
    document = parse_document(text, source)
    if isinstance(document.data, dict):
        document.data.setdefault("name", "".join(filter(str.isprintable, stem))[:200] or "robot")
    entry = check(RobotFile, document)
    return _to_spec(entry, document)


def robot_schema() -> dict[str, Any]:
    """The JSON Schema of robot files, for editors."""
    schema = RobotFile.model_json_schema(by_alias=True)
    schema["required"] = [key for key in schema["required"] if key != "name"]
    return {"$schema": "https://json-schema.org/draft/2020-12/schema", **schema, "title": "antdrive robot"}


def _to_spec(entry: RobotFile, document: Document) -> RobotSpec:
    values = {name: getattr(entry, name) for name in RobotFile.model_fields if name != "schema_"}
    values["noise"] = Noise(**dict(entry.noise))
    try:
        values["lidar"] = _lidar(entry.lidar)
        values["footprint"] = entry.footprint.footprint()
        robot = RobotSpec(**values)
        require_feasible(robot)
    except FieldError as error:
        raise document.field_error(error) from None
    return robot


def _lidar(entry: LidarEntry | None) -> Lidar | None:
    try:
        return None if entry is None else Lidar(**dict(entry))
    except FieldError as error:
        raise error.under("lidar") from None


def robot_to_dict(robot: RobotSpec) -> dict[str, Any]:
    """A robot as plain data, as it stands in a rollout's record."""
    left_out = {
        field.name
        for field in dataclasses.fields(robot)
        if field.metadata.get("left_out_if_default") and getattr(robot, field.name) == field.default
    }
    data = {key: value for key, value in dataclasses.asdict(robot).items() if key not in left_out}
    if not robot.footprint.corners:
        del data["footprint"]["corners"]
    return data


def footprint_to_dict(footprint: Footprint) -> dict[str, Any]:
    """A footprint as it stands in a robot's file."""
    corners = footprint.corners
    if footprint.is_disc or len(corners) == 1:
        return {"radius": footprint.rounding, **({"centre": list(corners[0])} if corners else {})}
    if corners:
        return {"polygon": [list(corner) for corner in corners]}
    return {"length": 2 * footprint.half_length, "width": 2 * footprint.half_width}
