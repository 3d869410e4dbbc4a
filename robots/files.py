"""Robot files: specifications read from YAML, and the catalogue that comes with the package."""

from __future__ import annotations

import dataclasses
import os
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any

from pydantic import BaseModel, ConfigDict, Field, model_validator

from antdrive.robots.spec import NOISE_RANGE, Footprint, Noise, RobotSpec
from antdrive.worlds.errors import FieldError, input_error
from antdrive.worlds.files.checks import SchemaVersion, check, suggest
from antdrive.worlds.files.document import Document, read_document

_CATALOG = Path(__file__).with_name("catalog")
_RULES = ConfigDict(strict=True, extra="forbid", allow_inf_nan=False, frozen=True)

Positive = Annotated[float, Field(gt=0, le=1e6)]


class FootprintEntry(BaseModel):
    """A disc by its radius, or a rectangle by length (along the robot) and width."""

    model_config = _RULES

    radius: Positive | None = Field(None, description="radius of a round robot [m]")
    length: Positive | None = Field(None, description="length of a rectangular robot, along its heading [m]")
    width: Positive | None = Field(None, description="width of a rectangular robot [m]")

    @model_validator(mode="after")
    def _one_kind(self) -> FootprintEntry:
        given = {key for key in ("radius", "length", "width") if getattr(self, key) is not None}
        if given not in ({"radius"}, {"length", "width"}):
            raise ValueError("write {radius: 0.18} for a disc or {length: 0.5, width: 0.4} for a rectangle")
        return self

    def footprint(self) -> Footprint:
        """The footprint it tells of."""
        if self.radius is not None:
            return Footprint.disc(self.radius)
        return Footprint.rectangle(self.length or 0.0, self.width or 0.0)


def _level(key: str, told: str) -> Any:
    low, high = NOISE_RANGE[key]
    return Field(getattr(Noise(), key), ge=low, le=high, description=told)


class NoiseEntry(BaseModel):
    """How far the real robot is from a perfect one; what is left out is perfect."""

    model_config = _RULES

    pose_xy: float = _level("pose_xy", "standard deviation of a pose fix in x and in y [m]")
    pose_yaw: float = _level("pose_yaw", "standard deviation of a pose fix's heading [rad]")
    pose_rate: float = _level("pose_rate", "pose fixes a second; in between the robot reckons by its encoders [Hz]")
    encoder: float = _level("encoder", "standard deviation of each wheel's measured speed, as a fraction of it")
    slip: float = _level("slip", "standard deviation of each wheel's slip, as a fraction of its speed")
    delay: float = _level("delay", "from a command to the motors [s]")


class RobotFile(BaseModel):
    """A differential-drive robot, as written in a file: two driven wheels on one axle through the centre, two casters."""

    model_config = _RULES

    schema_: SchemaVersion = Field(alias="schema", description="write schema: 1")
    name: str = Field(min_length=1, max_length=200, description="what the robot is called, by default the file's name")
    source: str | None = Field(None, description="where the figures come from, free text")
    footprint: FootprintEntry = Field(
        description="write {radius: 0.18} for a disc or {length: 0.5, width: 0.4} for a rectangle [m]"
    )
    height: Positive = Field(description="height of the body [m]")
    mass: Positive = Field(description="mass of the whole robot [kg]")
    wheel_radius: Positive = Field(description="radius of the driven wheels [m]")
    track: Positive = Field(description="distance between the driven wheels [m]")
    max_speed: Positive = Field(description="forward speed limit [m/s]")
    max_yaw_rate: Positive = Field(description="yaw rate limit [rad/s]")
    max_acceleration: Positive = Field(description="limit on speeding up and braking [m/s^2]")
    max_yaw_acceleration: Positive = Field(description="limit on the change of the yaw rate [rad/s^2]")
    max_lateral_acceleration: Positive = Field(description="limit on speed times yaw rate in curves [m/s^2]")
    max_wheel_speed: Positive = Field(description="speed limit of each wheel [rad/s]")
    wheel_torque: Positive = Field(description="the most that one wheel's motor gives [N m]")
    wheel_friction: Positive = Field(1.5, description="Coulomb coefficient of the wheels on the floor")
    noise: NoiseEntry = Field(
        NoiseEntry(), description="what `--noise` scales: errors of pose, encoders and wheels, and delay"
    )


def list_robots() -> Mapping[str, Path]:
    """The robots that come with the package, by name."""
    return {path.stem: path for path in sorted(_CATALOG.glob("*.yaml"))}


def load_robot(robot: str | os.PathLike[str]) -> RobotSpec:
    """The robot in a file, or in the catalogue under a name.

    Raises:
        InputError: there is no such robot or something in the file is wrong.
    """
    known = list_robots()
    path = known[robot] if isinstance(robot, str) and robot in known else Path(robot)
    if not os.path.lexists(path):
        hint = suggest(path.stem, known)
        raise input_error(os.fspath(robot), f"no such file, nor a robot of the catalogue; {hint}")
    document = read_document(path)
    if isinstance(document.data, dict):
        document.data.setdefault("name", path.stem)
    entry = check(RobotFile, document)
    return _to_spec(entry, document)


def robot_schema() -> dict[str, Any]:
    """The JSON Schema of a robot file, for editors."""
    schema = RobotFile.model_json_schema(by_alias=True)
    schema["required"] = [key for key in schema["required"] if key != "name"]
    return {"$schema": "https://json-schema.org/draft/2020-12/schema", **schema, "title": "antdrive robot"}


def _to_spec(entry: RobotFile, document: Document) -> RobotSpec:
    values = {name: getattr(entry, name) for name in RobotFile.model_fields if name != "schema_"}
    values["footprint"] = entry.footprint.footprint()
    values["noise"] = Noise(**dict(entry.noise))
    try:
        return RobotSpec(**values)
    except FieldError as error:
        raise document.field_error(error) from None


def robot_to_dict(robot: RobotSpec) -> dict[str, Any]:
    """A robot as plain data, for records."""
    return dataclasses.asdict(robot)
