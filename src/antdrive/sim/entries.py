"""What people write about scenarios in files of several kinds: types of values, settings, and flags of commands."""

from __future__ import annotations

import re
from typing import Annotated, Any

from pydantic import BaseModel, ConfigDict, Field, PlainValidator, WithJsonSchema

from antdrive.base.checks import show
from antdrive.worlds.files.world_file import DiscEntry

MAX_SEEDS = 100_000  # of one range
RULES = ConfigDict(strict=True, extra="forbid", allow_inf_nan=False, frozen=True)

_SEEDS = re.compile(r"(\d{1,18})-(\d{1,18})")


def _text_or_mapping(value: Any) -> Any:
    if not isinstance(value, str | dict) or not value:
        raise ValueError(f"must be a name or a mapping, got {show(value)}")
    return value


def _margin(value: Any) -> Any:
    if value != "auto" and (isinstance(value, bool) or not isinstance(value, int | float)):
        raise ValueError(f"must be a number of metres, or auto, got {show(value)}")
    return value


def _switch(value: Any) -> Any:
    if not isinstance(value, bool | dict) and value != "none":
        raise ValueError(f"must be true, false, none or a mapping of settings, got {show(value)}")
    return value


def seed_list(value: Any) -> list[int]:
    """The seeds that people write as [0, 1, 2] or 0-9.

    Raises:
        ValueError: it is neither; the text says what would be right.
    """
    if isinstance(value, str) and (match := _SEEDS.fullmatch(value)):
        first, last = int(match[1]), int(match[2])
        if first <= last < first + MAX_SEEDS:
            return list(range(first, last + 1))
    seeds = value if isinstance(value, list) else []
    if not seeds or not all(type(seed) is int and 0 <= seed < 2**63 for seed in seeds):
        raise ValueError(
            f"must be whole numbers of at least 0, such as [0, 1, 2], or a range such as 0-9, got {show(value)}"
        )
    if len(set(seeds)) < len(seeds):
        raise ValueError(f"must be different numbers, got {show(value)}")
    return seeds


MAPPING: dict[str, Any] = {"type": "object"}
_NAME_OR_MAPPING: dict[str, Any] = {"anyOf": [{"type": "string"}, MAPPING]}
_SWITCH_SCHEMA: dict[str, Any] = {"anyOf": [{"type": "boolean"}, {"const": "none"}, MAPPING]}
SEEDS_SCHEMA: dict[str, Any] = {
    "anyOf": [
        {"type": "array", "items": {"type": "integer", "minimum": 0}, "minItems": 1, "uniqueItems": True},
        {"type": "string", "pattern": f"^{_SEEDS.pattern}$"},
    ]
}
MARGIN_SCHEMA: dict[str, Any] = {"anyOf": [{"type": "number", "minimum": 0}, {"const": "auto"}]}

TextOrMapping = Annotated[Any, PlainValidator(_text_or_mapping), WithJsonSchema(_NAME_OR_MAPPING)]
Switch = Annotated[Any, PlainValidator(_switch), WithJsonSchema(_SWITCH_SCHEMA)]
SeedList = Annotated[Any, PlainValidator(seed_list), WithJsonSchema(SEEDS_SCHEMA)]
MarginValue = Annotated[Any, PlainValidator(_margin), WithJsonSchema(MARGIN_SCHEMA)]


class SettingsEntry(BaseModel):
    """How a robot drives, beside its margin, noise, smoothing and seed."""

    model_config = RULES

    controller: dict[str, float] = Field({}, description="settings of the controller, such as {lookahead_time: 0.5}")
    cell: float | None = Field(None, gt=0, description="grid resolution [m]; by default the world's")
    unseen: list[DiscEntry] = Field(
        [], description="cylinders {x, y, radius} that neither planner nor controller knows of"
    )
    map: str = Field(
        "given", description="what the robot knows of the world: given, or none but for what its lidar sees"
    )
    localisation: str = Field("fixes", description="how the robot knows its pose: fixes, odometry, matching or true")
    odometry: float = Field(1.0, ge=0, description="the factor on the errors of odometry")
    sees: str | None = Field(
        None,
        description="what the robot perceives of movers: KIND or KIND:METRES; by default velocities, without a map lidar",
    )
    avoid: Switch = Field(
        True,
        description="how the robot avoids movers: true, false or none (not at all), or settings such as {horizon: 2.0}",
    )
    replan: Switch = Field(
        True,
        description="when the robot replans among movers: true, false (only after it has strayed from its route), none "
        "(never), or settings such as {patience: 10}",
    )
    time_limit: float | None = Field(None, gt=0, description="simulated time allowed [s]")
    physics_hz: int = Field(240, ge=1, description="physics steps per simulated second")
    control_hz: int = Field(60, ge=1, description="control periods per simulated second")


def has_flags(entry: SettingsEntry) -> bool:
    """Whether `antdrive run` has flags for all of an entry's settings."""
    plain = isinstance(entry.replan, bool) and not isinstance(entry.avoid, dict)
    return plain and (entry.physics_hz, entry.control_hz) == (240, 60) and all(d.height == 1.0 for d in entry.unseen)


def setting_words(entry: SettingsEntry) -> list[str]:
    """The words of `antdrive run` for the settings of an entry that are not the defaults."""
    words = [
        word for key, value in entry.controller.items() for word in ("--set", f"controller.{key}={option_text(value)}")
    ]
    for key in ("cell", "time_limit", "sees", "map", "localisation", "odometry"):
        if key in entry.model_fields_set and getattr(entry, key) is not None:
            words += [f"--{key.replace('_', '-')}", option_text(getattr(entry, key))]
    words += [word for disc in entry.unseen for word in ("--unseen", f"{disc.x},{disc.y},{disc.radius}")]
    return words + [f"--no-{key}" for key in ("avoid", "replan") if getattr(entry, key) in (False, "none")]


def option_text(value: Any) -> str:
    """A value as the command line takes it."""
    if isinstance(value, list):
        return ",".join(map(option_text, value))
    return str(value).lower() if isinstance(value, bool) else str(value)
