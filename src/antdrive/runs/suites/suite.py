"""Suites: `*.drive.yaml` files of scenarios, each driven with one or more seeds and compared with its baseline."""

from __future__ import annotations

import dataclasses
import functools
import os
import re
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Annotated, Any, get_type_hints

from pydantic import BaseModel, BeforeValidator, Field, PlainValidator, WithJsonSchema, create_model

from antdrive.base.checks import SchemaVersion, check
from antdrive.base.document import Document, Location, read_document
from antdrive.base.errors import FieldError, InputError
from antdrive.base.files import unreadable
from antdrive.base.records import STRICT, attributes_of
from antdrive.foreign.setup import ForeignSetup
from antdrive.planners.registry import PLANNERS
from antdrive.runs.suites.demands import END, KINDS, Demands, causes
from antdrive.sim.forms import SeedList, TextOrMapping, file_fields, given_settings
from antdrive.sim.log.metrics import METRICS
from antdrive.sim.log.outcome import Outcome
from antdrive.sim.settings import SETTINGS, tested_settings
from antdrive.sim.written import Written, placed

if TYPE_CHECKING:
    from antdrive.sim.facts import Run

SUFFIX = ".drive.yaml"
MAX_CASES = 100_000  # most tests (scenarios times seeds) in one suite
BASELINES = "baselines"  # subfolder beside a suite

#: Python names and likely misnomers of some keys.
_SYNONYMS = MappingProxyType(
    {"avoidance": "avoid", "replanning": "replan", "perception": "sees", "seed": "seeds", "options": "planner"}
    | dict.fromkeys(("file", "pose", "map_frame", "robot_frame", "others", "pose_error", "unknown"), "log")
)
_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9_.-]{0,99}")


def _anything(value: Any) -> Any:
    return value


_TRAJECTORY_SCHEMA: dict[str, Any] = {"anyOf": [{"type": "number", "minimum": 0.002}, {"const": "exact"}]}

TrajectoryValue = Annotated[Any, PlainValidator(_anything), WithJsonSchema(_TRAJECTORY_SCHEMA)]


_HINTS, _TEXTS = get_type_hints(ForeignSetup), attributes_of(ForeignSetup.__doc__)
_USUAL = {one.name: one.default for one in dataclasses.fields(ForeignSetup)} | {"others": {}}
_KEYS: Any = {
    name: (_HINTS[name], Field(usual, description=_TEXTS[name]))
    for name, usual in _USUAL.items()
    if name not in ("log", "world", "robot")
}
_FILE = (str, Field(description=_TEXTS["log"]))
LogEntry: Any = create_model("LogEntry", __config__=STRICT, __doc__="Another program's log.", file=_FILE, **_KEYS)


def _named_log(value: Any) -> Any:
    return {"file": value} if isinstance(value, str) else value


class CaseEntry(BaseModel):
    """The keys of a scenario besides its settings."""

    model_config = STRICT

    note: str | None = Field(None, description="purpose of the scenario, free text")
    world: TextOrMapping = Field(
        None,
        description="a world file relative to the suite, a world of the catalogue, or {generate: forest, seed: 7} with the "
        "generator's options",
    )
    task: str | None = Field(None, description="one of the world's tasks; by default its own start and goal")
    start: list[float] | None = Field(
        None, min_length=3, max_length=3, description="write [x, y, yaw] in metres and radians; by default the task's"
    )
    goal: list[float] | None = Field(
        None, min_length=2, max_length=2, description="write [x, y] in metres; by default the task's"
    )
    robot: str = Field("turtlebot", description="a robot file relative to the suite, or a robot of the catalogue")
    planner: TextOrMapping = Field(
        "ants",
        description="a planner's name, mine.py:Mine, my_package.planners:Mine, plan.csv; with options {name: ants, ants: 200}",
    )
    log: Annotated[LogEntry | None, BeforeValidator(_named_log)] = Field(
        None,
        description="instead of planner and seeds another program's log relative to the suite, or {file: drive.mcap, pose: "
        "/amcl_pose} with options of `antdrive certify`; world and robot are its map and robot",
    )
    seeds: SeedList = Field([0], description="one test for each: [0, 1, 2], or a range such as 0-9")
    expect: dict[str, Any] = Field(
        {}, description='demands: {outcome: succeeded, certified: true, min_clearance_m: ">= 0.05"}'
    )
    tolerance: dict[str, Any] = Field(
        {}, description="how much worse than the baseline's a metric may be: {duration_s: 0.5, jerk_rms: any}"
    )
    trajectory: TrajectoryValue = Field(
        None, description="largest distance from the baseline's line at any time [m], or exact"
    )
    baseline: bool = Field(True, description="whether to compare with a baseline; false: only expect counts")


if TYPE_CHECKING:
    ScenarioEntry = CaseEntry
else:
    ScenarioEntry = create_model(
        "ScenarioEntry",
        __base__=CaseEntry,
        __doc__="A scenario of a suite, or the defaults of all scenarios.",
        **file_fields(one for one in SETTINGS.values() if one.name != "seed"),
    )


class SuiteFile(BaseModel):
    """A suite file, `*.drive.yaml`."""

    model_config = STRICT

    schema_: SchemaVersion = Field(alias="schema", description="write schema: 1")
    defaults: ScenarioEntry = Field(
        default_factory=ScenarioEntry.model_construct, description="default keys of all scenarios"
    )
    scenarios: dict[str, ScenarioEntry] = Field(
        description="the scenarios by name", json_schema_extra={"minProperties": 1}
    )


@dataclass(frozen=True, eq=False)
class SuiteCase:
    """One test: a scenario of a suite with one seed.

    Attributes:
        suite: the suite's file
        name: the scenario's name
        seed: the seed of all random numbers
        entry: the scenario, with the suite's defaults
        demands: demands on the drive
        document: the suite as read, for errors
        own: keys set by the scenario itself, not by the defaults
    """

    suite: Path
    name: str
    seed: int
    entry: ScenarioEntry
    demands: Demands
    document: Document
    own: frozenset[str]

    @property
    def written(self) -> Written:
        """The scenario as written, with files relative to the suite; a custom planner drives its own plan by default."""
        entry, settings = self.entry, given_settings(self.entry)
        places = {key: getattr(entry, key) for key in ("world", "task", "start", "goal", "robot", "planner")}
        try:
            written = Written.read(
                {**{key: at for key, at in places.items() if at is not None}, **settings, "seed": self.seed}
            )
        except FieldError as error:
            raise self.error(error.key, error.problem) from None
        return dataclasses.replace(written, settings=tested_settings(settings, custom=written.planner not in PLANNERS))

    @property
    def id(self) -> str:
        """The test's name in its suite, such as aisle[0]."""
        return f"{self.name}[{self.seed}]"

    @property
    def address(self) -> str:
        """The test's name in commands, SUITE::aisle[0], with the suite relative to the working directory if possible."""
        return f"{shown_path(self.suite)}::{self.id}"

    @property
    def baseline_path(self) -> Path:
        """The path of the baseline."""
        return baseline_folder(self.suite) / f"{self.name}-{self.seed}.json"

    def check_names(self) -> None:
        """Check that everything named exists; raise InputError otherwise."""
        self.written.check_names(self.suite.parent, self.error)

    def error(self, key: str, problem: str) -> InputError:
        """Return the error for a key of the scenario: file, line, key and problem.

        Args:
            key: the key, such as "planner.ants"; empty for the whole scenario
            problem: what is invalid, and what is valid
        """
        location = _place(self.document, self.name, key, self.own)
        return self.document.error(location, problem)


class LogCase(SuiteCase):
    """One test: another program's log."""

    def check_names(self) -> None:
        """Check that there is a log, with nothing of drives beside it; raise InputError otherwise."""
        for key in sorted(self.own & {"planner", "seeds", "task", "start", *(one.key for one in SETTINGS.values())}):
            raise self.error(key, "is for drives; omit it beside log")
        if not isinstance(self.entry.world, str | None):
            raise self.error("world", "must be a file or a world of the catalogue")
        log: Any = self.entry.log
        if not (self.suite.parent / log.file).exists():
            raise self.error("log", f"{log.file} does not exist")

    def run(self) -> Run:
        """Read the log, and return it as a run."""
        from antdrive.foreign.playback import foreign_run

        entry: Any = self.entry
        words = dict(entry.log)
        setup = ForeignSetup(log=words.pop("file"), world=entry.world, robot=entry.robot, **words)
        goal = entry.goal and tuple(entry.goal)
        with placed(lambda key, problem: self.error(key if key in ("world", "robot") else f"log.{key}", problem)):
            return foreign_run(setup.certificate(self.suite.parent), setup, goal)


def baseline_folder(suite: Path) -> Path:
    """Return the folder with the baselines of a suite, beside it."""
    return suite.parent / BASELINES / suite.name.removesuffix(SUFFIX)


def shown_path(path: Path) -> str:
    """Return a path as messages show it: relative to the working directory if it lies below."""
    try:
        return str(path.relative_to(Path.cwd()))
    except (ValueError, OSError):
        return str(path)


def load_suite(path: str | os.PathLike[str]) -> tuple[SuiteCase, ...]:
    """Load the tests of a suite, in the order of the file. A suite is cached until its file changes.

    Raises:
        InputError: the file is missing or invalid.
    """
    target = Path(path)
    try:
        state = target.stat()
    except OSError as error:
        raise unreadable(path, error) from None
    return _load(target.resolve(), os.fspath(path), state.st_mtime_ns, state.st_size)


@functools.lru_cache(maxsize=64)
def _load(path: Path, source: str, mtime: int, size: int) -> tuple[SuiteCase, ...]:
    document = read_document(source)
    _refuse_synonyms(document)
    suite = check(SuiteFile, document)
    if not suite.scenarios:
        raise document.error(("scenarios",), "must not be empty; write at least one, such as one: {world: empty}")
    cases: list[SuiteCase] = []
    for name, entry in suite.scenarios.items():
        if not _NAME.fullmatch(name):
            raise document.error(
                ("scenarios", name), "a name has letters, digits, '-', '_' and '.' only, at most 100 of them"
            )
        cases += _cases(path, document, name, suite.defaults, entry)
        if len(cases) > MAX_CASES:
            raise document.error(("scenarios", name), f"scenarios times seeds must be at most {MAX_CASES}")
    return tuple(cases)


def _refuse_synonyms(document: Document) -> None:
    """Reject names that keys have elsewhere; spelling alone would not suggest the right key."""
    for location in document.lines:
        scenario = location[:1] == ("defaults",) and len(location) == 2
        if (scenario or (location[:1] == ("scenarios",) and len(location) == 3)) and location[-1] in _SYNONYMS:
            key = _SYNONYMS[str(location[-1])]
            hint = ScenarioEntry.model_fields[key].description
            raise document.error(location, f"unknown key; write {key}: {hint}")


def _cases(path: Path, document: Document, name: str, defaults: ScenarioEntry, entry: ScenarioEntry) -> list[SuiteCase]:
    """Return the tests of one scenario, one for each seed."""
    own = frozenset(entry.model_fields_set)
    values = {key: getattr(defaults, key) for key in defaults.model_fields_set}
    values |= {key: getattr(entry, key) for key in own}
    for key in ("expect", "tolerance"):
        values[key] = {**getattr(defaults, key), **getattr(entry, key)}
    merged = ScenarioEntry.model_construct(**values)
    if merged.world is None and merged.log is None:
        hint = ScenarioEntry.model_fields["world"].description
        raise document.error(("scenarios", name, "world"), f"missing; write {hint}")
    try:
        demands = Demands.of(merged.expect, merged.tolerance, merged.trajectory)
    except FieldError as error:
        raise document.error(_place(document, name, error.key, own), error.problem) from None
    for key in ("tolerance", "trajectory"):
        if not merged.baseline and key in own and getattr(entry, key):
            problem = "needs a baseline; omit it, or baseline: false"
            raise document.error(_place(document, name, key, own), problem)
    if merged.log is not None:
        return [LogCase(path, name, 0, merged, demands, document, own)]
    return [SuiteCase(path, name, seed, merged, demands, document, own) for seed in merged.seeds]


def _place(document: Document, name: str, key: str, own: frozenset[str]) -> Location:
    """Return the location of a scenario's key: in the scenario, or in the defaults."""
    parts = tuple(key.split(".")) if key else ()
    here: Location = ("scenarios", name, *parts)
    there: Location = ("defaults", *parts)
    if here in document.lines or not parts:
        return here
    return (
        there if there in document.lines or (parts[0] not in own and ("defaults", parts[0]) in document.lines) else here
    )


def suite_schema() -> dict[str, Any]:
    """Return the JSON Schema of suites, for editors."""
    schema = SuiteFile.model_json_schema(by_alias=True)
    entry = schema["$defs"]["ScenarioEntry"]["properties"]
    bound = {"anyOf": [{"type": "number"}, {"type": "string", "pattern": "^\\s*(>=|<=|>|<|==)"}]}
    allowed = {"anyOf": [{"type": "number", "minimum": 0}, {"type": "string", "pattern": "^(any|.*%)\\s*$"}]}
    entry["expect"] |= {
        "properties": {
            "outcome": {"enum": [outcome.key for outcome in Outcome]},
            "certified": {"type": "boolean"},
            "touched": {"enum": list(KINDS), "description": "required kind of the first thing touched"},
            "cause": {
                "enum": list(causes()),
                "description": "required largest cause of the lost margin until the contact",
            },
            **{name: {**bound, "description": metric.definition} for name, metric in METRICS.items()},
        },
        "additionalProperties": False,
    }
    entry["log"]["anyOf"].append({"type": "string"})
    compared = {name: metric.definition for name, metric in METRICS.items() if metric.better != "neither"}
    compared[END] = "Distance between the ends of the two drives."
    entry["tolerance"] |= {
        "properties": {name: {**allowed, "description": text} for name, text in compared.items()},
        "additionalProperties": False,
    }
    return {"$schema": "https://json-schema.org/draft/2020-12/schema", **schema, "title": "antdrive suite"}
