"""The record of a drive: everything a log holds beside its arrays, key by key.

The record is stored as JSON. It is validated in one place, `DriveRecord.from_json`, so that no reader meets a missing
key or an impossible value. `docs/reference/rollout-format.md` describes every key.
"""

from __future__ import annotations

import dataclasses
import inspect
import json
import math
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from typing import TYPE_CHECKING, Annotated, Any, NoReturn

import numpy as np
from pydantic import PlainValidator, TypeAdapter, ValidationError

from antdrive.base.document import MAX_DEPTH
from antdrive.base.errors import FieldError
from antdrive.base.types import Point
from antdrive.robots.spec import RobotSpec
from antdrive.sim.log.outcome import Outcome
from antdrive.worlds.files.world_file import task_from_dict, task_to_dict
from antdrive.worlds.limits import MAX_COORDINATE
from antdrive.worlds.world import Disc, Task, World

if TYPE_CHECKING:
    from pydantic_core import ErrorDetails

#: The version of the log's format.
SCHEMA = 2

#: The highest rate of physics or control that a log can have [Hz].
MAX_HZ = 10_000

#: The largest margin and inflation that a log can have [m].
MAX_MARGIN = 1000.0

MARGIN_ROUNDING = 1e-9  # [m]

#: What a robot may know of the world before it drives, and how it may know its pose.
MAPS = ("given", "none")
LOCALISATIONS = ("fixes", "odometry", "matching", "true")

#: The trigger of a replan by a planner that decides anew at every cell.
DECISION = "decision"

# pydantic reads this attribute: no guessing of types, no unknown keys, no NaN and no infinity, also in nested records.
_RULES = {"strict": True, "extra": "forbid", "allow_inf_nan": False}


@dataclass(frozen=True, kw_only=True)
class ComponentRecord:
    """A part of the scenario that has a name and settings.

    Attributes:
        name: the registered name of the planner, or the class of a planner or controller
        settings: every setting by its name, as it was in force; null stands for "no limit"
    """

    name: str
    settings: Mapping[str, Any]


@dataclass(frozen=True, kw_only=True)
class PlanRecord:
    """The plan's size beside the shortest paths that are possible.

    Attributes:
        cost_m: length of the planned cells, along the grid's eight directions [m]; null where the grid has no path and
            an any-angle planner found one beside it
        length_m: length of the planned line, of an any-angle planner's own line where it has one [m]
        grid_optimum_m: length of the shortest path on the same grid [m]; null if there is none
        euclidean_optimum_m: length of the shortest path among the inflated discs, without a grid [m]; null if there
            is none
        work: the planner's effort, in units of `work_unit`
        work_unit: what `work` counts, such as "cells expanded"
    """

    cost_m: float | None
    length_m: float
    grid_optimum_m: float | None
    euclidean_optimum_m: float | None
    work: int
    work_unit: str

    def __post_init__(self) -> None:
        _at_least(self, 0.0, *(() if self.cost_m is None else ("cost_m",)), "length_m", "work")


@dataclass(frozen=True, kw_only=True)
class SmoothingRecord:
    """How the planned cells became the route.

    Attributes:
        asked: the smoothing that was requested: none, taut or clearance
        made: the smoothing of the route that was driven; plans in space and time are not smoothed, and a smoothing
            that fails is given up
        note: why a smoothing was given up, in words; may be empty
    """

    asked: str
    made: str
    note: str


@dataclass(frozen=True, kw_only=True)
class PerceptionRecord:
    """What the robot knew of movers while it drove.

    Attributes:
        kind: positions, velocities, motions or lidar
        range_m: how far the robot perceived movers [m]; null if without limit
    """

    kind: str
    range_m: float | None


@dataclass(frozen=True, kw_only=True)
class ReplanRecord:
    """One search for a new route while driving.

    Attributes:
        t: when the new route was looked for [s]
        trigger: what set off the search, in words
        solved: whether a new route was found; else the robot kept the old one
        cost_m: length of the new plan's cells [m]; null without one
        work: the planner's effort, in units of `plan.work_unit`
        route: points (x, y) of the new route [m], rounded to 0.1 mm; empty without one
    """

    t: float
    trigger: str
    solved: bool
    cost_m: float | None
    work: int
    route: tuple[Point, ...]

    def __post_init__(self) -> None:
        _at_least(self, 0.0, "t")
        if self.solved != (len(self.route) > 1):
            raise FieldError("route", f"must have two points or more if solved, else none, got {len(self.route)}")


@dataclass(frozen=True, kw_only=True)
class SensingRecord:
    """What the robot knew of the world and of its own pose.

    Attributes:
        map: given, or none: then it knew what its lidar had seen
        localisation: fixes, odometry, matching or true
        odometry: the factor on the errors of odometry
    """

    map: str
    localisation: str
    odometry: float

    def __post_init__(self) -> None:
        for key, known in (("map", MAPS), ("localisation", LOCALISATIONS)):
            if getattr(self, key) not in known:
                raise FieldError(key, f"must be one of {', '.join(known)}, got {getattr(self, key)!r:.40}")
        _at_least(self, 0.0, "odometry")


@dataclass(frozen=True, kw_only=True)
class MarginRecord:
    """How `--margin auto` chose the margin.

    Attributes:
        loss_m: how much of the margin a drive was predicted to use up [m]; no part of it are movers
        reserve_m: what the predicted loss was to leave of the margin, at least [m]
        probability: of a larger loss than predicted, for a drive along a course of the calibration
        drives: number of drives that the prediction rests on
    """

    loss_m: float
    reserve_m: float
    probability: float
    drives: int

    def __post_init__(self) -> None:
        _at_least(self, 0.0, "reserve_m", "probability", "drives")


@dataclass(frozen=True, kw_only=True)
class TimesRecord:
    """Wall-clock times. They differ between repetitions, so the digest does not cover them.

    Attributes:
        plan_s: planning before the drive [s]
        drive_wall_s: driving, with physics and replanning [s]
        replans_s: each replan, in the order of `replans` [s]
    """

    plan_s: float
    drive_wall_s: float
    replans_s: tuple[float, ...]


def _to_task(value: Any) -> Task:
    if not isinstance(value, Mapping):
        raise ValueError(f"must be an object as in a world file, got {_shown(value)}")
    return task_from_dict(value, "task")


def _to_outcome(value: Any) -> Outcome:
    return Outcome.from_key(value if isinstance(value, str) else _shown(value))


@dataclass(frozen=True, kw_only=True)
class DriveRecord:
    """What a log says beside its arrays: the scenario, the plan, and how the drive ended.

    Attributes:
        schema: the version of the format, 2
        task: the world, start and goal that planner and controller knew, in the form of a world file
        unseen: cylinders {x, y, radius, height} [m] that also stood in the world, unknown to planner and controller
        seed: the seed that all of the run's random numbers follow from
        planner: the planner and its settings
        plan: the plan's size beside the shortest paths that are possible
        robot: the robot's specification, with the keys of `RobotSpec`: footprint, drive, limits and noise; `footprint.corners`
            only where it is a polygon or beside the axle
        controller: the controller and its settings
        smoothing: how the planned cells became the route
        perception: what the robot knew of movers; null in a world without movers, unless its lidar looked for them
        avoidance: the settings of `Avoidance` as they were in force; null if the robot did not avoid movers
        replanning: the settings of `ReplanPolicy`; null without movers, or if the robot was never to replan
        replans: every search for a new route while driving, in the order of time
        limiters: names of the rules that can limit the robot's speed; the array `limiter` holds indices into them
        noise: the factor on the robot's documented noise; 0 is a perfect robot
        margin: clearance that was planned with on top of the robot's radius [m]
        margin_choice: how the margin was chosen; the key is left out where it was given as a number
        inflate: the robot's radius plus the margin: how far planners keep the robot's centre from every surface [m]
        cell: grid resolution of the plan [m]
        physics_hz: rate of the physics and of the log's rows [Hz]
        control_hz: rate of control [Hz]
        time_limit: simulated time that was allowed [s]
        outcome: how the drive ended, such as succeeded, collided or timed_out
        reason: details of the outcome, in words; may be empty
        versions: versions of antdrive, Python and the packages that computed the drive
        sensing: what the robot knew of the world and of its pose; the key is left out where that is the map and pose fixes
        times: wall-clock times, not covered by the digest
        digest: the SHA-256 over arrays and record, see `Rollout.digest`; null until the log is saved

    Raises:
        FieldError: a value that no drive can have.
    """

    __pydantic_config__ = _RULES

    schema: int = SCHEMA
    task: Annotated[Task, PlainValidator(_to_task)]
    unseen: tuple[Disc, ...]
    seed: int
    planner: ComponentRecord
    plan: PlanRecord
    robot: RobotSpec
    controller: ComponentRecord
    smoothing: SmoothingRecord
    perception: PerceptionRecord | None
    avoidance: Mapping[str, Any] | None
    replanning: Mapping[str, Any] | None
    replans: tuple[ReplanRecord, ...]
    limiters: tuple[str, ...]
    noise: float
    margin: float
    inflate: float
    cell: float
    physics_hz: int
    control_hz: int
    time_limit: float
    outcome: Annotated[Outcome, PlainValidator(_to_outcome)]
    reason: str
    versions: Mapping[str, str]
    times: TimesRecord
    margin_choice: MarginRecord | None = None
    sensing: SensingRecord | None = None
    digest: str | None = None

    def __post_init__(self) -> None:
        _at_least(self, 0, "seed", "noise", "margin", "inflate")
        for key in ("physics_hz", "control_hz"):
            if not 1 <= getattr(self, key) <= MAX_HZ:
                raise FieldError(key, f"must be between 1 and {MAX_HZ}, got {getattr(self, key)!r:.40}")
        for i, disc in enumerate(self.unseen):
            if not 0 < disc.height <= MAX_COORDINATE:
                raise FieldError(f"unseen[{i}].height", f"must be greater than 0, got {disc.height!r:.40}")
        for key, most in (("margin", MAX_MARGIN), ("inflate", MAX_MARGIN), ("cell", MAX_COORDINATE)):
            if not getattr(self, key) <= most:
                raise FieldError(key, f"must be at most {most:g} m, got {getattr(self, key)!r:.40}")
        for key in ("cell", "time_limit"):
            if not getattr(self, key) > 0:
                raise FieldError(key, f"must be greater than 0, got {getattr(self, key)!r:.40}")
        choice = self.margin_choice
        if choice is not None and not choice.loss_m + choice.reserve_m <= self.margin + MARGIN_ROUNDING:
            raise FieldError("margin_choice", f"loss_m and reserve_m must not exceed the margin of {self.margin:g} m")
        foot = self.robot.footprint
        for key in ("half_length", "half_width", "rounding"):
            if not 0 <= getattr(foot, key) < math.inf:
                raise FieldError(f"robot.footprint.{key}", f"must be at least 0, got {getattr(foot, key)!r:.40}")
        for i, (before, after) in enumerate(zip(self.replans, self.replans[1:], strict=False), 1):
            if after.t < before.t:
                raise FieldError(f"replans[{i}].t", f"must not be before {before.t:g} s, got {after.t:g}")

    @property
    def world(self) -> World:
        """The world as it was driven in: the task's, with the unseen cylinders after the known ones."""
        world = self.task.world
        return dataclasses.replace(world, obstacles=world.obstacles + self.unseen) if self.unseen else world

    @property
    def exploring(self) -> bool:
        """Whether the robot had no map."""
        return self.sensing is not None and self.sensing.map == "none"

    @property
    def localisation(self) -> str:
        """How the robot knew its pose: fixes, odometry, matching or true."""
        return "fixes" if self.sensing is None else self.sensing.localisation

    def as_dict(self) -> dict[str, Any]:
        """The record as plain values, for JSON."""
        values = {field.name: plain_value(getattr(self, field.name)) for field in dataclasses.fields(self)}
        for key in ("margin_choice", "sensing"):  # logs without them are as they were before there were such things
            if values[key] is None:
                del values[key]
        return values

    def to_json(self, *, without: Sequence[str] = ()) -> str:
        """The record as JSON text, the keys sorted.

        Args:
            without: keys to leave out

        Raises:
            ValueError: a number that is not finite.
        """
        values = {key: value for key, value in self.as_dict().items() if key not in without}
        return json.dumps(values, sort_keys=True, allow_nan=False)

    @classmethod
    def from_json(cls, text: str) -> DriveRecord:
        """The record in a JSON text.

        Args:
            text: what `to_json` wrote

        Raises:
            FieldError: a key is missing or unknown, or a value is impossible.
        """
        try:
            found = json.loads(text, parse_constant=_refuse_constant)
            _require_shallow(found)
        except (RecursionError, ValueError) as error:
            problem = "nested too deeply" if isinstance(error, RecursionError) else str(error)
            raise FieldError("record", f"not JSON: {problem}") from None
        if not isinstance(found, dict) or found.get("schema") != SCHEMA:
            schema = found.get("schema") if isinstance(found, dict) else found
            raise FieldError("record.schema", f"this version reads schema {SCHEMA}, found {_shown(schema)}")
        try:
            record = _adapter().validate_json(text)
            record.to_json()  # settings of any kind hold nothing that JSON cannot
        except ValidationError as error:
            raise _field_error(error.errors(include_url=False)[0]) from None
        except (RecursionError, OverflowError, ValueError) as error:
            raise FieldError("record", str(error)) from None
        lacking = _missing_key(record.as_dict(), found)
        if lacking:
            raise FieldError(f"record{lacking}", "missing; a log that antdrive wrote has it")
        return record


def _require_shallow(value: Any) -> None:
    """Refuse values that are nested deeper than those of any file; readers that follow them would run out of stack."""
    layer = [value]
    for _ in range(MAX_DEPTH):
        layer = [v for outer in layer for v in _inner(outer) if isinstance(v, dict | list)]
        if not layer:
            return
    raise ValueError(f"nested deeper than {MAX_DEPTH} levels")


def _inner(value: Any) -> Iterable[Any]:
    return value.values() if isinstance(value, dict) else value if isinstance(value, list) else ()


def _missing_key(written: Any, found: Any) -> str:
    """The first key that `written` has and `found` lacks, as a path; empty if there is none.

    A key that a record could do without, because it has a default, is missed like any other: a log says everything.
    """
    if isinstance(written, dict) and isinstance(found, dict):
        for key, value in written.items():
            deeper = _missing_key(value, found[key]) if key in found else ""
            if key not in found or deeper:
                return f".{key}{deeper}"
    elif isinstance(written, list) and isinstance(found, list):
        for i, (value, other) in enumerate(zip(written, found, strict=False)):
            if deeper := _missing_key(value, other):
                return f"[{i}]{deeper}"
    return ""


def plain_value(value: Any) -> Any:
    """A value as JSON can hold it: records become mappings, arrays and tuples lists, other objects text."""
    if isinstance(value, Outcome):
        return value.key
    if isinstance(value, Task):
        return task_to_dict(value)
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        # A field that came later is left out where it says nothing, so that older logs and hashes stay as they are.
        fields = [field for field in dataclasses.fields(value) if not _says_nothing(field, getattr(value, field.name))]
        return {field.name: plain_value(getattr(value, field.name)) for field in fields}
    if isinstance(value, Mapping):
        return {str(key): plain_value(inner) for key, inner in value.items()}
    if isinstance(value, list | tuple):
        return [plain_value(inner) for inner in value]
    if isinstance(value, np.generic):
        return value.item()
    return value if isinstance(value, bool | int | float | str | None) else str(value)


def _says_nothing(field: dataclasses.Field[Any], value: Any) -> bool:
    return bool(field.metadata.get("left_out_if_default")) and value == field.default


def settings_of(values: Any) -> dict[str, Any]:
    """Settings as the record keeps them: plain values, with null for an infinite number, which is "no limit"."""

    def finite(value: Any) -> Any:
        if isinstance(value, dict):
            return {key: finite(inner) for key, inner in value.items()}
        if isinstance(value, list):
            return [finite(inner) for inner in value]
        return None if isinstance(value, float) and not math.isfinite(value) else value

    found = finite(plain_value(values))
    assert isinstance(found, dict)
    return found


def finite_or_none(value: float) -> float | None:
    """The number, or None where it is infinite or not a number."""
    return value if math.isfinite(value) else None


_NESTED: Mapping[str, type[Any]] = {
    "planner": ComponentRecord,
    "plan": PlanRecord,
    "controller": ComponentRecord,
    "smoothing": SmoothingRecord,
    "perception": PerceptionRecord,
    "replans": ReplanRecord,
    "margin_choice": MarginRecord,
    "sensing": SensingRecord,
    "times": TimesRecord,
}


def record_keys() -> Iterator[tuple[str, str, str]]:
    """Every key of a record with its type and description; keys of nested records are dotted."""
    for field in dataclasses.fields(DriveRecord):
        yield field.name, _json_type(str(field.type)), attributes_of(DriveRecord)[field.name]
        if inner := _NESTED.get(field.name):
            prefix = f"{field.name}[]" if field.name == "replans" else field.name
            for part in dataclasses.fields(inner):
                yield f"{prefix}.{part.name}", _json_type(str(part.type)), attributes_of(inner)[part.name]


def attributes_of(kind: type[Any]) -> dict[str, str]:
    """The descriptions of a record's fields, from the Attributes section of its docstring."""
    _, _, section = (inspect.getdoc(kind) or "").partition("Attributes:\n")
    section = section.split("\n\n")[0]
    entries = re.split(r"^    (\w+): ", section, flags=re.MULTILINE)[1:]
    return {name: " ".join(text.split()) for name, text in zip(entries[::2], entries[1::2], strict=True)}


def _json_type(annotation: str) -> str:
    """What JSON calls the type of a field."""
    kind = annotation.removesuffix(" | None")
    words = {"str": "text", "float": "number", "int": "whole number", "bool": "true or false"}
    if kind in words:
        word = words[kind]
    elif kind.startswith("tuple"):
        word = "list"
    elif "Outcome" in kind:
        word = "text"
    else:
        word = "object"
    return f"{word} or null" if annotation.endswith(" | None") else word


@cache
def _adapter() -> TypeAdapter[DriveRecord]:
    return TypeAdapter(DriveRecord)


def _at_least(record: Any, least: float, *keys: str) -> None:
    for key in keys:
        if not least <= getattr(record, key) < math.inf:
            raise FieldError(key, f"must be at least {least:g}, got {getattr(record, key)!r:.40}")


def _refuse_constant(name: str) -> NoReturn:
    raise ValueError(f"{name} is no number of JSON")


def _field_error(fault: ErrorDetails) -> FieldError:
    """The key and the problem of a fault that pydantic found, with what would be right."""
    key = "record" + "".join(f"[{part}]" if isinstance(part, int) else f".{part}" for part in fault["loc"])
    if fault["type"] == "missing":
        name = str(fault["loc"][-1])
        described = attributes_of(DriveRecord).get(name, "a log that antdrive wrote has it")
        return FieldError(key, f"missing; {described}")
    if fault["type"] == "unexpected_keyword_argument":
        return FieldError(key, "unknown key; a later version of antdrive may have written it")
    if fault["type"] != "value_error":
        problem = fault["msg"].replace("Input should be", "must be")
        return FieldError(key, f"{problem}, got {_shown(fault['input'])}")
    error = fault["ctx"]["error"]
    if isinstance(error, FieldError):
        return error.under(key)
    # A world file's error is text: the name of the file, here the key itself, then often a key within the file.
    text = str(error).removeprefix("task: ")
    inner = re.match(r"(\w[\w.\[\]]*): (.*)", text)
    return FieldError(f"{key}.{inner[1]}", inner[2]) if inner else FieldError(key, text)


def _shown(value: Any) -> str:
    """A value of JSON, cut to a length that fits a line."""
    try:
        return json.dumps(value)[:40]
    except (ValueError, RecursionError):
        return "a number too long"
