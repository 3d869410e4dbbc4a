"""Record of a drive: everything in a log beside its arrays, and its hashes.

The record is stored as JSON and validated in one place, `DriveRecord.from_json`. `docs/reference/rollout-format.md`
describes every key. Hashes of worlds and robots omit names, sources and the form of files: they cover the meaning.
"""

from __future__ import annotations

import dataclasses
import hashlib
import json
import math
import typing
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from enum import Enum
from functools import cache
from types import MappingProxyType
from typing import TYPE_CHECKING, Annotated, Any, NoReturn

import numpy as np
from pydantic import PlainValidator, TypeAdapter, ValidationError

from antdrive.base.document import MAX_DEPTH
from antdrive.base.errors import FieldError, InputError
from antdrive.base.files import json_value, parse_json
from antdrive.base.records import STRICT, attributes_of
from antdrive.base.types import Point
from antdrive.robots.spec import Odometry, RobotSpec
from antdrive.sim.log.outcome import Outcome
from antdrive.sim.policy import Perception
from antdrive.sim.settings import SETTINGS
from antdrive.worlds.files.world_file import task_from_dict, task_to_dict
from antdrive.worlds.limits import MAX_COORDINATE
from antdrive.worlds.route import LEAD, end_reach
from antdrive.worlds.world import Disc, Task, World

if TYPE_CHECKING:
    from pydantic_core import ErrorDetails

#: Version of the log's format.
SCHEMA = 2

#: Highest rate of physics or control in a log [Hz].
MAX_HZ = 10_000

#: Largest margin and inflation in a log [m].
MAX_MARGIN = 1000.0

MARGIN_ROUNDING = 1e-9  # [m]
#: Name of the controller of a drive that is commanded from outside, see `antdrive.Session`.
FROM_OUTSIDE = "Session"


class Evidence(Enum):
    """Check of a value in a log: the first level of `antdrive verify` that recomputes or compares it."""

    LOG = "verify"  # recomputed from the log alone
    WORLD = "--world"  # compared with a trusted file, or computed from it
    ROBOT = "--robot"  # compared with a trusted file
    REPLAY = "--replay"  # computed again by driving the record's scenario
    INPUT = "input"  # chosen for the drive: the replay drives with it, so another value must lead to the same log
    CLAIM = "claim"  # checked by nothing


#: Declarations of a field's check.
LOGGED, OF_WORLD, OF_ROBOT = {"proof": Evidence.LOG}, {"proof": Evidence.WORLD}, {"proof": Evidence.ROBOT}
REPLAYED = {"proof": Evidence.REPLAY}
CHOSEN, CLAIMED = {"proof": Evidence.INPUT}, {"proof": Evidence.CLAIM}


@dataclass(frozen=True, kw_only=True)
class ComponentRecord:
    """Named part of the scenario with its settings.

    Attributes:
        name: the registered name of the planner, or the class of a planner or controller
        settings: every effective setting by name; null means "no limit"
    """

    name: str = dataclasses.field(metadata=CHOSEN)
    settings: Mapping[str, Any] = dataclasses.field(metadata=CHOSEN)


@dataclass(frozen=True, kw_only=True)
class PlanRecord:
    """Length of the plan and of the shortest possible paths, with the planning effort.

    Attributes:
        cost_m: length of the planned cells along the grid's eight directions [m]; null where the grid has no path, but an
            any-angle planner found one
        length_m: length of the planned line, or of an any-angle planner's own line [m]
        grid_optimum_m: length of the shortest path on the same grid [m]; null if there is none
        euclidean_optimum_m: length of the shortest path among the inflated discs, without a grid [m]; null if there
            is none
        work: the planner's effort, in `work_unit`
        work_unit: what `work` counts, such as "cells expanded"
    """

    cost_m: float | None = dataclasses.field(metadata=REPLAYED)
    length_m: float = dataclasses.field(metadata=REPLAYED)
    grid_optimum_m: float | None = dataclasses.field(metadata=OF_WORLD)
    euclidean_optimum_m: float | None = dataclasses.field(metadata=OF_WORLD)
    work: int = dataclasses.field(metadata=REPLAYED)
    work_unit: str = dataclasses.field(metadata=REPLAYED)

    def __post_init__(self) -> None:
        _at_least(self, 0.0, *(() if self.cost_m is None else ("cost_m",)), "length_m", "work")


@dataclass(frozen=True, kw_only=True)
class SmoothingRecord:
    """Smoothing of the planned cells into the route.

    Attributes:
        asked: the requested smoothing: none, taut or clearance
        made: the smoothing of the driven route; none for plans in space and time, and where the requested one failed
        note: why the smoothing failed; may be empty
    """

    asked: str = dataclasses.field(metadata=CHOSEN)
    made: str = dataclasses.field(metadata=REPLAYED)
    note: str = dataclasses.field(metadata=REPLAYED)

    def __post_init__(self) -> None:
        for key in ("asked", "made"):
            if getattr(self, key) not in (choices := SETTINGS["smoothing"].setting.choices):
                raise FieldError(key, f"must be one of {', '.join(choices)}, got {_shown(getattr(self, key))}")


@dataclass(frozen=True, kw_only=True)
class PerceptionRecord:
    """Perception of movers.

    Attributes:
        kind: positions, velocities, motions or lidar
        range_m: the range of perception [m]; null if unlimited
    """

    kind: str = dataclasses.field(metadata=CHOSEN)
    range_m: float | None = dataclasses.field(metadata=CHOSEN)

    def __post_init__(self) -> None:
        Perception(kind=self.kind)  # type: ignore[arg-type]
        if self.range_m is not None and not 0 < self.range_m < math.inf:
            raise FieldError("range_m", f"must be greater than 0, got {self.range_m:g}")


@dataclass(frozen=True, kw_only=True)
class ReplanRecord:
    """Search for a new route during the drive.

    Attributes:
        t: time of the search [s]
        trigger: its cause, in words
        solved: whether a route was found; else the robot kept the old one
        cost_m: length of the new plan's cells [m]; null without one
        work: the planner's effort, in units of `plan.work_unit`
        route: points (x, y) of the new route [m], rounded to 0.1 mm; empty without one
    """

    t: float = dataclasses.field(metadata=REPLAYED)
    trigger: str = dataclasses.field(metadata=REPLAYED)
    solved: bool = dataclasses.field(metadata=REPLAYED)
    cost_m: float | None = dataclasses.field(metadata=REPLAYED)
    work: int = dataclasses.field(metadata=REPLAYED)
    route: tuple[Point, ...] = dataclasses.field(metadata=REPLAYED)

    def __post_init__(self) -> None:
        _at_least(self, 0.0, "t")
        if self.solved != (len(self.route) > 1):
            raise FieldError("route", f"must have two points or more if solved, else none, got {len(self.route)}")


@dataclass(frozen=True, kw_only=True)
class SensingRecord:
    """Knowledge of the world and of the robot's pose.

    Attributes:
        map: given, or none (the robot maps with its lidar)
        localisation: fixes, odometry, matching or true
        odometry: factor on the odometry errors
    """

    map: str = dataclasses.field(metadata=CHOSEN)
    localisation: str = dataclasses.field(metadata=CHOSEN)
    odometry: float = dataclasses.field(metadata=CHOSEN)

    def __post_init__(self) -> None:
        for field in dataclasses.fields(self):
            SETTINGS[field.name].check(getattr(self, field.name))


@dataclass(frozen=True, kw_only=True)
class MarginRecord:
    """Choice of the margin by `--margin auto`.

    Attributes:
        loss_m: predicted loss of margin in a drive [m], without movers
        reserve_m: least margin that was to remain after the predicted loss [m]
        probability: probability of a larger loss, for a drive along a course of the calibration
        drives: number of drives behind the prediction
    """

    loss_m: float = dataclasses.field(metadata=CLAIMED)
    reserve_m: float = dataclasses.field(metadata=CLAIMED)
    probability: float = dataclasses.field(metadata=CLAIMED)
    drives: int = dataclasses.field(metadata=CLAIMED)

    def __post_init__(self) -> None:
        _at_least(self, 0.0, "reserve_m", "probability", "drives")


@dataclass(frozen=True, kw_only=True)
class TimesRecord:
    """Wall-clock times, which the digest omits because they differ between repetitions.

    Attributes:
        plan_s: planning before the drive [s]
        drive_wall_s: driving, with physics and replanning [s]
        replans_s: each replan, in the order of `replans` [s]
    """

    plan_s: float = dataclasses.field(metadata=CLAIMED)
    drive_wall_s: float = dataclasses.field(metadata=CLAIMED)
    replans_s: tuple[float, ...] = dataclasses.field(metadata=CLAIMED)

    def __post_init__(self) -> None:
        _at_least(self, 0.0, "plan_s", "drive_wall_s")
        for i, seconds in enumerate(self.replans_s):
            if not 0.0 <= seconds < math.inf:
                raise FieldError(f"replans_s[{i}]", f"must be at least 0, got {seconds!r:.40}")


#: Fields added later are omitted at their default, so older logs and hashes stay valid.
LATER: dict[str, Any] = {"omit_if_default": True}


def _to_task(value: Any) -> Task:
    if not isinstance(value, Mapping):
        raise ValueError(f"must be an object as in a world file, got {_shown(value)}")
    return task_from_dict(value, "task")


def _to_outcome(value: Any) -> Outcome:
    return Outcome.from_key(value if isinstance(value, str) else _shown(value))


@dataclass(frozen=True, kw_only=True)
class DriveRecord:
    """Record of a log: the scenario, the plan, and how the drive ended.

    Attributes:
        schema: version of the format, 2
        task: the world, start and goal known to planner and controller, in the form of a world file
        unseen: cylinders {x, y, radius, height} [m] in the driven world, unknown to planner and controller
        seed: the seed of all random numbers
        planner: the planner and its settings
        plan: lengths of the plan and of the shortest possible paths
        robot: the robot's specification, with the keys of `RobotSpec`: footprint, drive, limits and noise;
            `footprint.corners` only for a polygon or a footprint off the axle
        controller: the controller and its settings
        smoothing: how the planned cells became the route
        perception: perception of movers; null in a world without movers, unless the lidar searched for them
        avoidance: effective settings of `Avoidance`; null without avoidance
        replanning: the settings of `ReplanPolicy`; null without movers or without replanning
        replans: the searches for a new route during the drive, in temporal order
        limiters: names of the rules that can limit the speed; the array `limiter` holds indices into them
        noise: the factor on the robot's documented noise; 0 is a perfect robot
        margin: planned clearance on top of the robot's radius [m]
        margin_choice: choice of the margin; omitted where it was given as a number
        inflate: radius plus margin: the distance that plans keep between the robot's centre and every surface [m]
        cell: grid resolution of the plan [m]
        physics_hz: rate of the physics and of the log's rows [Hz]
        control_hz: rate of control [Hz]
        time_limit: allowed simulated time [s]
        outcome: how the drive ended, such as succeeded, collided or timed_out
        reason: details of the outcome; may be empty
        versions: versions of antdrive, Python and the packages that computed the drive
        sensing: knowledge of the world and of the pose; omitted for a given map and pose fixes
        settings: settings without another key, by name; omitted where all have their defaults
        times: wall-clock times, not covered by the digest
        footprint_margin: clearance of plans that keep the robot's footprint clear [m]; omitted where all plans keep the disc
            around the robot clear
        asked_cell: side of the cells that were asked for [m]; omitted where plans use these
        physics: which body of physics was not in the place of its obstacle, so that its contacts are no evidence; omitted
            where all were
        written: the scenario in the keys of a suite, for commands; not covered by the digest, `verify` compares it; omitted in
            older logs
        digest: SHA-256 over arrays and record, see `Rollout.digest`; null until the log is saved

    Raises:
        FieldError: a value is invalid.
    """

    __pydantic_config__ = STRICT

    schema: int = dataclasses.field(default=SCHEMA, metadata=LOGGED)
    task: Annotated[Task, PlainValidator(_to_task)] = dataclasses.field(metadata=OF_WORLD)
    unseen: tuple[Disc, ...] = dataclasses.field(metadata=CHOSEN)
    seed: int = dataclasses.field(metadata=CHOSEN)
    planner: ComponentRecord
    plan: PlanRecord
    robot: RobotSpec = dataclasses.field(metadata=OF_ROBOT)
    controller: ComponentRecord
    smoothing: SmoothingRecord
    perception: PerceptionRecord | None
    avoidance: Mapping[str, Any] | None = dataclasses.field(metadata=CHOSEN)
    replanning: Mapping[str, Any] | None = dataclasses.field(metadata=CHOSEN)
    replans: tuple[ReplanRecord, ...]
    limiters: tuple[str, ...] = dataclasses.field(metadata=REPLAYED)
    noise: float = dataclasses.field(metadata=CHOSEN)
    margin: float = dataclasses.field(metadata=CHOSEN)
    inflate: float = dataclasses.field(metadata=LOGGED)
    cell: float = dataclasses.field(metadata=CHOSEN)
    physics_hz: int = dataclasses.field(metadata=CHOSEN)
    control_hz: int = dataclasses.field(metadata=CHOSEN)
    time_limit: float = dataclasses.field(metadata=CHOSEN)
    outcome: Annotated[Outcome, PlainValidator(_to_outcome)] = dataclasses.field(metadata=REPLAYED)
    reason: str = dataclasses.field(metadata=REPLAYED)
    versions: Mapping[str, str] = dataclasses.field(metadata=CLAIMED)
    times: TimesRecord
    margin_choice: MarginRecord | None = dataclasses.field(default=None, metadata=LATER)
    sensing: SensingRecord | None = dataclasses.field(default=None, metadata=LATER)
    settings: Mapping[str, Any] | None = dataclasses.field(default=None, metadata=LATER | CHOSEN)
    footprint_margin: float | None = dataclasses.field(default=None, metadata=LATER | REPLAYED)
    asked_cell: float | None = dataclasses.field(default=None, metadata=LATER | CHOSEN)
    physics: str = dataclasses.field(default="", metadata=LATER | REPLAYED)
    written: Mapping[str, Any] | None = dataclasses.field(default=None, metadata=LATER | CLAIMED)
    digest: str | None = dataclasses.field(default=None, metadata=LOGGED)

    def __post_init__(self) -> None:
        for key in ("noise", "margin", "inflate", "cell", "time_limit"):  # whole numbers have another text, and digest
            if type(getattr(self, key)) is int:
                object.__setattr__(self, key, float(getattr(self, key)))
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
        if self.asked_cell is not None and not self.cell < self.asked_cell <= MAX_COORDINATE:
            raise FieldError("asked_cell", f"must be greater than cell, got {self.asked_cell!r:.40}")
        if self.footprint_margin is not None and not 0 <= self.footprint_margin <= MAX_MARGIN:
            raise FieldError(
                "footprint_margin", f"must be at least 0 and at most {MAX_MARGIN:g}, got {self.footprint_margin}"
            )
        for key, value in (self.settings or {}).items():
            if key not in SETTINGS or self.held(key):
                raise FieldError(f"settings.{key}", "unknown key; a later version of antdrive may have written it")
            SETTINGS[key].check(value)
        require_factors(self.robot, self.noise, 1.0 if self.sensing is None else self.sensing.odometry)
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
        """Driven world: the task's, with the unseen cylinders after the known ones."""
        world = self.task.world
        return dataclasses.replace(world, obstacles=world.obstacles + self.unseen) if self.unseen else world

    @property
    def shape(self) -> str:
        """The shape that plans kept clear: footprint if any did, else disc."""
        return "disc" if self.footprint_margin is None else "footprint"

    @property
    def kept_margin(self) -> float:
        """Clearance that plans keep from the footprint if any did, else from the disc [m]."""
        return self.margin if self.footprint_margin is None else self.footprint_margin

    @property
    def reach(self) -> tuple[float, float]:
        """Largest distances of the first planned cell from the start, and of the last from the goal [m]."""
        near = end_reach(self.inflate, self.cell)
        if self.footprint_margin is None:
            return near, near
        return max(near, LEAD), max(near, self.task.goal_tolerance)

    @classmethod
    def held(cls, setting: str) -> bool:
        """Return whether a key of the record holds a setting."""
        return any(setting in {field.name for field in dataclasses.fields(kind)} for kind in (cls, SensingRecord))

    @property
    def rows_per_period(self) -> int:
        """Number of rows in a control period."""
        return max(1, self.physics_hz // self.control_hz)

    @property
    def mapless(self) -> bool:
        """Whether the robot had no map."""
        return self.sensing is not None and self.sensing.map == "none"

    @property
    def localisation(self) -> str:
        """Localisation: fixes, odometry, matching or true."""
        return "fixes" if self.sensing is None else self.sensing.localisation

    def as_dict(self) -> dict[str, Any]:
        """Return the record as plain values, for JSON."""
        values: dict[str, Any] = plain_value(self)
        return values

    def to_json(self, *, without: Sequence[str] = ()) -> str:
        """Return the record as JSON text with sorted keys.

        Args:
            without: keys to omit

        Raises:
            ValueError: a number that is not finite.
        """
        values = {key: value for key, value in self.as_dict().items() if key not in without}
        return json.dumps(values, sort_keys=True, allow_nan=False)

    @classmethod
    def from_json(cls, text: str) -> DriveRecord:
        """Read the record from a JSON text.

        Args:
            text: the text of `to_json`

        Raises:
            FieldError: a key is missing or unknown, or a value is invalid.
        """
        try:
            content = parse_json(text, parse_constant=_refuse_constant)
            _require_shallow(content)
        except FieldError as error:
            raise error.under("record") from None
        except (RecursionError, ValueError) as error:
            problem = "nested too deeply" if isinstance(error, RecursionError) else str(error)
            raise FieldError("record", f"not JSON: {problem}") from None
        if not isinstance(content, dict) or content.get("schema") != SCHEMA:
            schema = content.get("schema") if isinstance(content, dict) else content
            raise FieldError("record.schema", f"this version reads schema {SCHEMA}, found {_shown(schema)}")
        try:
            record = _adapter().validate_json(text)
            record.to_json()  # refuses settings that JSON cannot hold
        except ValidationError as error:
            raise _field_error(error.errors(include_url=False)[0]) from None
        except (RecursionError, OverflowError, ValueError) as error:
            raise FieldError("record", str(error)) from None
        lacking = _missing_key(record.as_dict(), content)
        if lacking:
            raise FieldError(f"record{lacking}", "missing; a log that antdrive wrote has it")
        return record


def _require_shallow(value: Any) -> None:
    """Refuse values nested deeper than those of any file, which would exhaust the stack of readers."""
    layer: list[Any] = [[value]]
    for _ in range(MAX_DEPTH):
        values = (value for outer in layer for value in (outer.values() if isinstance(outer, dict) else outer))
        layer = [value for value in values if isinstance(value, dict | list)]
        if not layer:
            return
    raise ValueError(f"nested deeper than {MAX_DEPTH} levels")


def _missing_key(written: Any, found: Any) -> str:
    """Return the path of the first key in `written` that `found` lacks; empty if there is none.

    Keys with a default are required as well: a log is complete.
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
    """Convert a value for JSON: records become mappings, arrays and tuples lists, other objects text."""
    if isinstance(value, Outcome):
        return value.key
    if isinstance(value, Task):
        return task_to_dict(value)
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        fields = [(field, getattr(value, field.name)) for field in dataclasses.fields(value)]
        said = ((field, v) for field, v in fields if not (field.metadata.get("omit_if_default") and v == field.default))
        return {field.name: plain_value(v) for field, v in said}
    if isinstance(value, Mapping):
        return {str(key): plain_value(inner) for key, inner in value.items()}
    if isinstance(value, list | tuple):
        return [plain_value(inner) for inner in value]
    if isinstance(value, np.generic):
        return value.item()
    return value if isinstance(value, bool | int | float | str | None) else str(value)


def settings_of(values: Any) -> dict[str, Any]:
    """Convert settings to plain values, with null for an infinite number, which means "no limit"."""
    plain = json_value(plain_value(values))
    assert isinstance(plain, dict)
    return plain


def options_of(component: Any) -> dict[str, Any]:
    """Return the options of a planner or controller as plain values, without those of places; none if it is no record."""
    options = settings_of(component) if dataclasses.is_dataclass(component) else {}
    return {key: value for key, value in options.items() if key not in getattr(component, "places", ())}


def changes(values: Any, usual: Any) -> dict[str, Any]:
    """Return the fields of a record that differ from another record of its class."""
    names = (field.name for field in dataclasses.fields(values) if field.init)
    return {name: getattr(values, name) for name in names if getattr(values, name) != getattr(usual, name)}


def finite_or_none(value: float) -> float | None:
    """Return the number, or None if it is infinite or nan."""
    return value if math.isfinite(value) else None


@cache
def _adapter() -> TypeAdapter[DriveRecord]:
    return TypeAdapter(DriveRecord)


def _at_least(record: Any, least: float, *keys: str) -> None:
    for key in keys:
        if not least <= getattr(record, key) < math.inf:
            raise FieldError(key, f"must be at least {least:g}, got {getattr(record, key)!r:.40}")


def require_factors(robot: RobotSpec, noise: float, odometry: float) -> None:
    """Raise FieldError if a factor lifts the noise of a robot, or the errors of odometry, out of range."""
    try:
        robot.noise.scaled(noise)
    except FieldError as error:
        raise FieldError("noise", f"{noise:g} times the robot's own is too much: {error}") from None
    try:
        Odometry().scaled(odometry)
    except FieldError as error:
        raise FieldError("odometry", f"{odometry:g} times the documented errors is too much: {error}") from None


def _refuse_constant(name: str) -> NoReturn:
    raise ValueError(f"{name} is no number of JSON")


def _field_error(fault: ErrorDetails) -> FieldError:
    """Convert an error of pydantic to its key and a sentence with the valid values."""
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
    if isinstance(error, InputError):  # of a world
        return FieldError(error.within, error.problem).under(key)
    return FieldError(key, str(error))


def _shown(value: Any) -> str:
    """Return a JSON value cut to fit a line."""
    try:
        return json.dumps(value)[:40]
    except (ValueError, RecursionError):
        return "a number too long"


def proofs_of(kind: type[Any], prefix: str = "") -> Iterator[tuple[str, Evidence]]:
    """Yield the check of every value that a record declares, by its dotted key.

    Raises:
        TypeError: a field declares none.
    """
    hints = typing.get_type_hints(kind)
    for field in dataclasses.fields(kind):
        key, hint = f"{prefix}{field.name}", hints[field.name]
        inner = [one for one in (hint, *typing.get_args(hint)) if getattr(one, "__module__", "") == __name__]
        if inner:
            yield from proofs_of(inner[0], f"{key}[]." if typing.get_origin(hint) is tuple else f"{key}.")
        elif "proof" not in field.metadata:
            raise TypeError(f"{kind.__name__}.{field.name} declares no proof")
        else:
            yield key, field.metadata["proof"]
            if typing.get_origin(hint) is None and isinstance(hint, type) and issubclass(hint, Task | RobotSpec):
                yield from ((f"{key}.{label}", Evidence.CLAIM) for label in LABELS)


#: Keys of the record that describe how the drive was planned and driven.
DRIVEN_WITH = (
    *("seed", "planner", "controller", "perception", "avoidance", "replanning"),
    *("noise", "margin", "cell", "physics_hz", "control_hz", "time_limit"),
)
LABELS = ("name", "source")  # of worlds and robots, which no comparison reads
#: Check of every value of the record, by its dotted key; `antdrive.sim.log.rollout.FORMS` has those of the arrays.
PROOFS: Mapping[str, Evidence] = MappingProxyType(dict(proofs_of(DriveRecord)))


def hashes_of(record: DriveRecord) -> dict[str, str]:
    """Return the SHA-256 of the record's world with start and goal, of its robot, and of its settings.

    Each covers JSON with sorted keys and Python's default separators; `docs/explanation/certificate.md` describes them.
    """
    return hashes_of_configuration({**vars(record), "smoothing": record.smoothing.asked})


def hashes_of_configuration(fields: Mapping[str, Any]) -> dict[str, str]:
    """Return the hashes of `hashes_of` from a record's fields that are known before the drive; smoothing as asked."""
    values = plain_value({key: fields[key] for key in (*DRIVEN_WITH, "smoothing", "sensing", "unseen")})
    parts = {
        "world": _meaning(fields["task"]),
        "robot": _meaning(fields["robot"]),
        "settings": {key: value for key, value in values.items() if value or key not in ("sensing", "unseen")}
        | (fields["settings"] or {}),
    }
    return {name: _sha256(part) for name, part in parts.items()}


def canonical_hash(value: Task | RobotSpec) -> str:
    """Return the SHA-256 of a world with start and goal, or of a robot, as `hashes_of` computes it for logs."""
    return _sha256(_meaning(value))


def free_radius(robot: RobotSpec, margin: float, footprint_margin: float | None) -> float:
    """Return the radius of the largest disc around the axle that plans keep clear [m].

    Args:
        robot: the robot
        margin: clearance of plans on top of the robot's radius [m]
        footprint_margin: clearance of plans that keep the footprint clear [m]; None for those of the disc
    """
    if footprint_margin is None:
        return robot.radius + margin
    return robot.footprint.inner_radius + footprint_margin


def differences(record: DriveRecord, *, task: Task | None = None, robot: RobotSpec | None = None) -> Iterator[str]:
    """Yield a sentence for a record's differences from a given world and robot.

    Unseen cylinders make a drive harder and may be more, but not where wanderers keep away from them.
    """
    for name, recorded, wanted in (("world", record.task, task), ("robot", record.robot, robot)):
        if wanted is None:
            continue
        logged, given = _meaning(recorded), _meaning(wanted)
        keys = [key for key in sorted({*logged, *given}) if logged.get(key) != given.get(key)]
        if keys:
            yield f"{name}: the log is about another one; its {', '.join(keys)} {'differ' if keys[1:] else 'differs'}"
    if task is not None and record.unseen and record.task.world.movers:
        yield f"world: the log has {len(record.unseen)} unseen cylinders more, which movers avoid"


def _sha256(value: Mapping[str, Any]) -> str:
    return hashlib.sha256(json.dumps(value, sort_keys=True).encode()).hexdigest()


def _meaning(value: Task | RobotSpec) -> Mapping[str, Any]:
    return {key: inner for key, inner in plain_value(value).items() if key not in LABELS}
