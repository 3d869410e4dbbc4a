"""The record of a drive: everything a log holds beside its arrays, key by key, and what it is about, as hashes.

The record is stored as JSON. It is validated in one place, `DriveRecord.from_json`, so that no reader meets a missing
key or an impossible value. `docs/reference/rollout-format.md` describes every key. Names and sources do not count in
hashes of worlds and robots, and neither does the form of a file: what is compared is what the file means.
"""

from __future__ import annotations

import dataclasses
import hashlib
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
from antdrive.base.records import STRICT, attributes_of
from antdrive.base.types import Point
from antdrive.robots.spec import RobotSpec
from antdrive.sim.log.outcome import Outcome
from antdrive.sim.settings import SETTINGS
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

#: The trigger of a replan by a planner that decides anew at every cell.
DECISION = "decision"


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
        for field in dataclasses.fields(self):
            SETTINGS[field.name].check(getattr(self, field.name))


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


#: A key that came later is left out where it says nothing, so that older logs and hashes stay as they are.
LATER = {"omit_if_default": True}


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
        settings: settings that no other key holds, by name; the key is left out where all have their defaults
        times: wall-clock times, not covered by the digest
        digest: the SHA-256 over arrays and record, see `Rollout.digest`; null until the log is saved

    Raises:
        FieldError: a value that no drive can have.
    """

    __pydantic_config__ = STRICT

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
    margin_choice: MarginRecord | None = dataclasses.field(default=None, metadata=LATER)
    sensing: SensingRecord | None = dataclasses.field(default=None, metadata=LATER)
    settings: Mapping[str, Any] | None = dataclasses.field(default=None, metadata=LATER)
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
        for key, value in (self.settings or {}).items():
            if key not in SETTINGS or self.held(key):
                raise FieldError(f"settings.{key}", "unknown key; a later version of antdrive may have written it")
            SETTINGS[key].check(value)
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

    @classmethod
    def held(cls, setting: str) -> bool:
        """Whether a key of the record's own holds a setting."""
        return any(setting in {field.name for field in dataclasses.fields(kind)} for kind in (cls, SensingRecord))

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
        values: dict[str, Any] = plain_value(self)
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
    return bool(field.metadata.get("omit_if_default")) and value == field.default


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


def changes(values: Any, usual: Any) -> dict[str, Any]:
    """The fields of a record that differ from those of another one of its class."""
    names = (field.name for field in dataclasses.fields(values) if field.init)
    return {name: getattr(values, name) for name in names if getattr(values, name) != getattr(usual, name)}


def finite_or_none(value: float) -> float | None:
    """The number, or None where it is infinite or not a number."""
    return value if math.isfinite(value) else None


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
        described = attributes_of(DriveRecord.__doc__).get(name, "a log that antdrive wrote has it")
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


#: The keys of a record that say how the drive was planned and driven.
DRIVEN_WITH = (
    *("seed", "planner", "controller", "perception", "avoidance", "replanning"),
    *("noise", "margin", "cell", "physics_hz", "control_hz", "time_limit"),
)
LABELS = ("name", "source")


def hashes_of(record: DriveRecord) -> dict[str, str]:
    """The SHA-256 of the world with start and goal, of the robot, and of the settings that a record holds.

    Each is that of JSON with sorted keys and Python's default separators; `docs/explanation/certificate.md` describes them.
    """
    values = record.as_dict()
    parts = {
        "world": _meaning(record.task),
        "robot": _meaning(record.robot),
        "settings": {
            **{key: values[key] for key in DRIVEN_WITH},
            "smoothing": record.smoothing.asked,
            **(record.settings or {}),
        },
    }
    return {name: _sha256(part) for name, part in parts.items()}


def canonical_hash(value: Task | RobotSpec) -> str:
    """The SHA-256 of a world with start and goal, or of a robot: the one that `hashes_of` finds in the log of its drives."""
    return _sha256(_meaning(value))


def differences(record: DriveRecord, *, task: Task | None = None, robot: RobotSpec | None = None) -> Iterator[str]:
    """What in a record is not as in the given world and robot, a sentence each."""
    for name, found, wanted in (("world", record.task, task), ("robot", record.robot, robot)):
        if wanted is None:
            continue
        logged, given = _meaning(found), _meaning(wanted)
        keys = [key for key in sorted({*logged, *given}) if logged.get(key) != given.get(key)]
        if keys:
            yield f"{name}: the log is about another one; its {', '.join(keys)} {'differ' if keys[1:] else 'differs'}"


def _sha256(value: Mapping[str, Any]) -> str:
    return hashlib.sha256(json.dumps(value, sort_keys=True).encode()).hexdigest()


def _meaning(value: Task | RobotSpec) -> Mapping[str, Any]:
    return {key: inner for key, inner in plain_value(value).items() if key not in LABELS}
