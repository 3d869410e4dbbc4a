"""Robot files (specifications in YAML) and the package's catalogue of robots."""

from __future__ import annotations

import dataclasses
import os
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, TypeAlias, get_type_hints

from pydantic import BaseModel, Field, create_model, model_validator

from antdrive.base.caches import cached
from antdrive.base.checks import OneLine, SchemaVersion, check, file_schema, resolve
from antdrive.base.document import parse_document, read_yaml
from antdrive.base.errors import FieldError, InputError, input_error, visible
from antdrive.base.records import STRICT
from antdrive.robots.outline import MAX_CORNERS
from antdrive.robots.spec import Footprint, RobotSpec, require_feasible

_CATALOG = Path(__file__).with_name("catalog")

_Size = Annotated[float, Field(gt=0)]
_Place: TypeAlias = tuple[float, float]


_FOOTPRINT_HELP = (
    "write {radius: 0.18} for a disc, {length: 0.5, width: 0.4} for a rectangle, both with centre: [0.1, 0] if offset "
    "from the axle, or {polygon: [[0.3, -0.2], [0.3, 0.2], [-0.2, 0.2], [-0.2, -0.2]]}"
)


class FootprintEntry(BaseModel):
    """A footprint in a robot file: a disc by radius, a rectangle by length and width, or a convex polygon.

    Positions are in the robot's frame: x ahead and y to the left of the axle's centre.
    """

    model_config = STRICT

    radius: _Size | None = Field(None, description="radius of a round robot [m]")
    length: _Size | None = Field(None, description="length of a rectangular robot, along its heading [m]")
    width: _Size | None = Field(None, description="width of a rectangular robot [m]")
    centre: _Place | None = Field(
        None, description="middle of the disc or rectangle: x ahead, y to the left of the axle's centre [m]"
    )
    polygon: list[_Place] | None = Field(
        None,
        description="corners of a convex outline, in order: x ahead, y to the left of the axle's centre [m]; at most "
        f"{MAX_CORNERS}",
    )

    @model_validator(mode="after")
    def _one_kind(self) -> FootprintEntry:
        given = {key for key in ("radius", "length", "width", "polygon") if getattr(self, key) is not None}
        if given not in ({"radius"}, {"length", "width"}, {"polygon"}) or (self.centre and self.polygon):
            raise ValueError(_FOOTPRINT_HELP)
        return self

    def footprint(self) -> Footprint:
        """Return the footprint of this entry."""
        centre = self.centre or (0.0, 0.0)
        if self.polygon is not None:
            try:
                return Footprint.polygon(self.polygon)
            except FieldError as error:
                raise FieldError("footprint.polygon", error.problem) from None
        if self.radius is not None:
            return Footprint.disc(self.radius, centre)
        return Footprint.rectangle(self.length or 0.0, self.width or 0.0, centre)


def _robot_file() -> Any:
    hints = get_type_hints(RobotSpec, include_extras=True)
    values: dict[str, Any] = {
        field.name: (hints[field.name], ... if field.default is dataclasses.MISSING else field.default)
        for field in dataclasses.fields(RobotSpec)
    }
    values |= {
        "schema_": (SchemaVersion, Field(alias="schema", description="write schema: 1")),
        "name": (
            OneLine,
            Field(min_length=1, max_length=200, description="the robot's name; by default the file's name"),
        ),
        "footprint": (FootprintEntry, Field(description=f"{_FOOTPRINT_HELP} [m]")),
    }
    return create_model("RobotFile", __config__=STRICT, __doc__=RobotSpec.__doc__, **values)


#: A robot file: a specification with its own form of the footprint and an optional name.
RobotFile = _robot_file()


def list_robots() -> Mapping[str, Path]:
    """Return the files of the package's robots by name."""
    return {path.stem: path for path in sorted(_CATALOG.glob("*.yaml"))}


def load_robot(robot: str | os.PathLike[str], home: Path | None = None) -> RobotSpec:
    """Load a robot's specification.

    Args:
        robot: a file's path, or a name from `list_robots`
        home: base of relative paths; None: the working directory

    Raises:
        InputError: the file does not exist or is invalid.
    """
    try:
        path = resolve("robot", robot, list_robots(), home)
    except FieldError as error:
        raise InputError(visible(error.problem), error.key) from None
    if path.suffix.lower() in (".urdf", ".xacro"):
        raise input_error(str(path), f"not a robot file; convert it with: antdrive robots import {path}")
    return robot_from_text(read_yaml(path), os.fspath(path), path.stem)


@cached(16)
def robot_from_text(text: str, source: str, stem: str) -> RobotSpec:
    """Parse the text of a robot file."""
    document = parse_document(text, source)
    if isinstance(document.data, dict):
        document.data.setdefault("name", "".join(filter(str.isprintable, stem))[:200] or "robot")
    entry: Any = check(RobotFile, document)
    values = {field.name: getattr(entry, field.name) for field in dataclasses.fields(RobotSpec)}
    try:
        spec = RobotSpec(**{**values, "footprint": entry.footprint.footprint()})
        require_feasible(spec)
    except FieldError as error:
        raise document.field_error(error) from None
    return spec


def robot_schema() -> dict[str, Any]:
    """Return the JSON Schema of robot files, for editors."""
    return file_schema(RobotFile, "antdrive robot")


def robot_to_dict(spec: RobotSpec) -> dict[str, Any]:
    """Return a robot as plain data, as in a rollout's record."""
    omitted = {
        field.name
        for field in dataclasses.fields(spec)
        if field.metadata.get("omit_if_default") and getattr(spec, field.name) == field.default
    }
    data = {key: value for key, value in dataclasses.asdict(spec).items() if key not in omitted}
    if not spec.footprint.corners:
        del data["footprint"]["corners"]
    return data


def footprint_to_dict(footprint: Footprint) -> dict[str, Any]:
    """Return a footprint as plain data, as in a robot file."""
    corners = footprint.corners
    if footprint.is_disc or len(corners) == 1:
        return {"radius": footprint.rounding, **({"centre": list(corners[0])} if corners else {})}
    if corners:
        return {"polygon": [list(corner) for corner in corners]}
    return {"length": 2 * footprint.half_length, "width": 2 * footprint.half_width}
