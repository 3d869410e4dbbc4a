"""Campaign files: the grid of worlds, tasks, planners, robots, settings and seeds that `antdrive sweep` runs."""

from __future__ import annotations

import itertools
import os
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Annotated, Any, Literal

from pydantic import BaseModel, BeforeValidator, Field, PlainValidator, TypeAdapter, WithJsonSchema, create_model

from antdrive.base.checks import SchemaVersion, check, schema_of, show
from antdrive.base.document import Document, Location, read_document
from antdrive.base.errors import InputError
from antdrive.base.records import STRICT
from antdrive.sim.forms import (
    SEEDS_SCHEMA,
    TextOrMapping,
    file_fields,
    given_settings,
    seed_list,
    written_default,
    written_kind,
)
from antdrive.sim.settings import COMPARED_SMOOTHING, SETTINGS
from antdrive.sim.written import ErrorAt

MOST_SEEDS = 1_000_000  # as a count


def _listed(value: Any) -> Any:
    """Wrap a single value in a list."""
    return value if isinstance(value, list) else [value]


def seeds_of(value: Any) -> list[int]:
    """Parse seeds written as a count, as [3, 7] or as 0-9."""
    if type(value) is int:
        if not 1 <= value <= MOST_SEEDS:
            raise ValueError(f"must be from 1 to {MOST_SEEDS} seeds, or a list such as [{value}], got {value}")
        return list(range(value))
    try:
        return seed_list(value)
    except ValueError as error:
        raise ValueError(f"{error}; a number such as 20 means the seeds 0 to 19") from None


_COUNT_OR_SEEDS: dict[str, Any] = {"anyOf": [{"type": "integer", "minimum": 1}, *SEEDS_SCHEMA["anyOf"]]}
Seeds = Annotated[Any, PlainValidator(seeds_of), WithJsonSchema(_COUNT_OR_SEEDS)]


def _of(item: dict[str, Any]) -> dict[str, Any]:
    return {"anyOf": [item, {"type": "array", "items": item, "minItems": 1}]}


Names = Annotated[list[str], Field(min_length=1), BeforeValidator(_listed), WithJsonSchema(_of({"type": "string"}))]
NamesOrMappings = Annotated[list[TextOrMapping], Field(min_length=1), BeforeValidator(_listed)]

#: The settings with their own keys in a campaign; the others go under `settings`.
AXES = MappingProxyType({name: one for name, one in SETTINGS.items() if one.setting.axis and name != "seed"})
SettingsEntry = create_model(
    "SettingsEntry",
    __config__=STRICT,
    __doc__="Settings without a key of their own in a campaign.",
    **file_fields(one for one in SETTINGS.values() if not one.setting.axis),
)


def _axes() -> dict[str, Any]:
    """Return the fields of a campaign file that list values of a setting."""
    fields = {}
    for one in AXES.values():
        kind, usual = written_kind(one), written_default(one)
        listed = Annotated[list[kind], Field(min_length=1), BeforeValidator(_listed)]  # type: ignore[valid-type]
        schema = WithJsonSchema(_of(TypeAdapter(kind).json_schema()))
        more = f"; for several planners by default {COMPARED_SMOOTHING}" if one.name == "smoothing" else ""
        fields[one.key] = (Annotated[listed, schema], Field([usual.default], description=f"{usual.description}{more}"))
    return fields


class TaskEntry(BaseModel):
    """A start and a goal, used in every world of the campaign."""

    model_config = STRICT

    name: str | None = Field(None, min_length=1, max_length=100, description="the task's name in tables")
    start: list[float] = Field(min_length=3, max_length=3, description="write [x, y, yaw] in metres and radians")
    goal: list[float] = Field(min_length=2, max_length=2, description="write [x, y] in metres")


class RandomTasks(BaseModel):
    """Random starts and goals in each world: free cells for the largest robot, connected by a path of its planning shape."""

    model_config = STRICT

    random: int = Field(ge=1, le=100_000, description="number of tasks in each world")
    seed: int = Field(0, ge=0, lt=2**63, description="random seed")
    min_distance: float = Field(0.0, ge=0, description="least straight-line distance from start to goal [m]")


def _tasks(value: Any) -> Any:
    listed = isinstance(value, list) and value and all(isinstance(one, dict) for one in value)
    if value not in ("own", "named") and not isinstance(value, dict) and not listed:
        raise ValueError(
            f"must be own, named, {{random: 30, min_distance: 5}} or a list of {{start, goal}}, got {show(value)}"
        )
    return value


_TASKS_SCHEMA: dict[str, Any] = {
    "anyOf": [
        {"enum": ["own", "named"]},
        RandomTasks.model_json_schema(),
        {"type": "array", "items": TaskEntry.model_json_schema()},
    ]
}


def _settings_given(value: Any) -> Any:
    listed = isinstance(value, list) and value and all(isinstance(one, dict) for one in value)
    if not isinstance(value, dict) and not listed:
        raise ValueError(f"must be a mapping such as {{cell: 0.1}}, or a list of mappings, got {show(value)}")
    return value


def _settings_schema() -> dict[str, Any]:
    """Return the JSON Schema of settings: each value may be a list, and so may the mapping."""
    schema = dict(schema_of(SettingsEntry))
    discs = {"type": "array", "items": schema.pop("$defs")["Disc"]}
    keys = {key: discs if key == "unseen" else one for key, one in schema["properties"].items()}
    about = {key: one["description"] for key, one in schema["properties"].items()}
    several = {
        key: {"description": about[key], "anyOf": [one, {"type": "array", "items": one, "minItems": 1}]}
        for key, one in keys.items()
    }
    return _of({**schema, "properties": several})


class GridEntry(BaseModel):
    """The keys of a campaign besides those that list a setting."""

    model_config = STRICT

    schema_: SchemaVersion = Field(alias="schema", description="write schema: 1")
    note: str | None = Field(None, description="purpose of the campaign, free text")
    worlds: NamesOrMappings = Field(
        description="a list of files or patterns such as worlds/*.yaml, names of the catalogue, "
        "{generate: forest, seeds: 20} with the generator's options, or {import: barn/*.world, barn: true}"
    )
    planners: NamesOrMappings = Field(
        description="a list of names, or {name: aco-han, ants: [10, 50]}; several values are a list or "
        "{from: 10, to: 50, step: 10}"
    )
    robots: Names = Field(["turtlebot"], description="names of the catalogue, or files")
    seeds: Seeds = Field([0], description="a number of seeds, a list such as [3, 7], or a range such as 0-9")
    tasks: Annotated[Any, PlainValidator(_tasks), WithJsonSchema(_TASKS_SCHEMA)] = Field(
        "own",
        description="own: the worlds' own start and goal; named: all tasks of the world files; {random: 30, seed: 1, "
        "min_distance: 5}; or a list of "
        "{start: [x, y, yaw], goal: [x, y]}",
    )
    settings: Annotated[Any, PlainValidator(_settings_given), WithJsonSchema(_settings_schema())] = Field(
        {},
        description="settings of the drives, such as {cell: 0.1, time_limit: 60}; a list of values, or of such mappings, "
        "gives several settings",
    )
    run_limit: float | None = Field(
        None, gt=0, description="wall-clock limit of a run; its process is killed after it [s]; by default none"
    )
    rollouts: Literal["none", "failed", "all"] = Field("none", description="the runs whose logs are kept")


if TYPE_CHECKING:
    CampaignFile = GridEntry
else:
    CampaignFile = create_model(
        "CampaignFile",
        __base__=GridEntry,
        __doc__="A campaign file: each combination of its lists is a run.",
        **_axes(),
    )


@dataclass(frozen=True, eq=False)
class Campaign:
    """A parsed campaign.

    Attributes:
        source: its file, or its name in messages
        folder: base of relative paths
        document: its data, with the line of each value
        entry: its validated data
        tasks: tasks in each world; empty: the worlds' own
        settings: every combination of the listed settings, as files write them, by key; at least one
        places: location of each of them in the file
    """

    source: str
    folder: Path
    document: Document
    entry: CampaignFile
    tasks: RandomTasks | tuple[TaskEntry, ...]
    settings: tuple[Mapping[str, Any], ...]
    places: tuple[Location, ...]

    def values(self, name: str) -> list[Any]:
        """Return the values of a setting with its own key; compared planners drive their own plans by default."""
        if name == "smoothing" and self.compared_by_default:
            return [COMPARED_SMOOTHING]
        return list(getattr(self.entry, AXES[name].key))

    @property
    def compared_by_default(self) -> bool:
        """Whether the campaign lists several planners, or several values of a planner's option, and no smoothing."""
        entries = self.entry.planners
        several = len(entries) > 1 or any(
            isinstance(value, dict) or (isinstance(value, list) and len(value) > 1)
            for entry in entries
            if isinstance(entry, dict)
            for value in entry.values()
        )
        return several and AXES["smoothing"].key not in self.entry.model_fields_set

    def error(self, location: Location, problem: str) -> InputError:
        """Return the error for a value: file, line, key and problem.

        Args:
            location: path to the value
            problem: the error and the fix
        """
        return self.document.error(location, problem)

    def at(self, *location: str | int, skip: int = 0) -> ErrorAt:
        """Return what gives the errors of a value their places.

        Args:
            location: path to the value
            skip: number of leading parts of their keys that the location has already
        """
        return lambda key, problem: self.error((*location, *key.split(".")[skip:]), problem)


def load_campaign(path: str | os.PathLike[str]) -> Campaign:
    """Load a campaign file.

    Raises:
        InputError: the file is missing or invalid.
    """
    return _validated(read_document(path), Path(path).parent)


def make_campaign(
    data: Mapping[str, Any],
    folder: str | os.PathLike[str] = ".",
    source: str = "campaign",
    options: Mapping[str, str] = MappingProxyType({}),
) -> Campaign:
    """Create a campaign from plain data with the keys of a campaign file; `schema` is optional.

    Args:
        data: mappings, lists, numbers and texts; also tuples, ranges, paths, and numbers and arrays of numpy
        folder: base of relative paths
        source: name of the data in messages
        options: command-line options by the key they set, also within settings; messages name the option

    Raises:
        InputError: the data is invalid.
    """
    plain = {"schema": 1, **{key: _plain(value) for key, value in data.items()}}
    return _validated(_CommandData(source, plain, options=options), Path(folder))


def _plain(value: Any) -> Any:
    """Convert Python values to those of a file: numpy's numbers and arrays, tuples, ranges and paths."""
    if isinstance(value, Mapping):
        return {key: _plain(one) for key, one in value.items()}
    if isinstance(value, list | tuple | range):
        return [_plain(one) for one in value]
    if isinstance(value, os.PathLike):
        return os.fspath(value)
    return value.tolist() if hasattr(value, "tolist") else value


def _validated(document: Document, folder: Path) -> Campaign:
    for key in SettingsEntry.model_fields.keys() & (document.data if isinstance(document.data, dict) else ()):
        raise document.error((key,), "unknown key; write it under settings")
    entry = check(CampaignFile, document)
    settings, places = zip(*_settings(document, entry.settings), strict=True)
    if isinstance(entry.tasks, dict):
        random = check(RandomTasks, _part(document, "tasks"))
        return Campaign(document.source, folder, document, entry, random, settings, places)
    tasks = entry.tasks if isinstance(entry.tasks, list) else []
    checked = tuple(check(TaskEntry, _part(document, "tasks", i)) for i in range(len(tasks)))
    names = [task.name or str(i) for i, task in enumerate(checked)]
    for i, name in enumerate(names):
        if name in names[:i]:
            raise document.error(("tasks", i, "name"), f"{name!r} names another task already; rename one")
    return Campaign(document.source, folder, document, entry, checked, settings, places)


def _settings(
    document: Document, given: dict[str, Any] | list[dict[str, Any]]
) -> Iterator[tuple[Mapping[str, Any], Location]]:
    """Yield every combination of the listed settings and its location; the last list varies fastest."""
    if isinstance(given, dict):
        yield from _combinations(document, given, ("settings",))
    else:
        for i, one in enumerate(given):
            yield from _combinations(document, one, ("settings", i))


def _combinations(
    document: Document, given: dict[str, Any], place: Location
) -> Iterator[tuple[Mapping[str, Any], Location]]:
    """Yield every combination of the settings in one mapping."""
    lists = [_alternatives(document, key, value, place) for key, value in given.items()]
    for values in itertools.product(*lists):
        data = dict(zip(given, values, strict=True))
        yield given_settings(check(SettingsEntry, _Part(document.source, data, whole=document, place=place))), place


def _alternatives(document: Document, key: str, value: Any, place: Location) -> list[Any]:
    """Return the values of a setting: those of a list, and every combination of the lists in a mapping."""
    if isinstance(value, dict):
        inner = [one if isinstance(one, list) else [one] for one in value.values()]
        choices: list[Any] = [dict(zip(value, values, strict=True)) for values in itertools.product(*inner)]
    elif key == "unseen":  # a single value is itself a list
        choices = value if isinstance(value, list) and value and isinstance(value[0], list) else [value]
    else:
        choices = value if isinstance(value, list) else [value]
    if not choices:
        raise document.error((*place, key), "must have at least one value, got an empty list")
    return choices


@dataclass(frozen=True, eq=False)
class _CommandData(Document):
    """Data partly from command-line options; errors name the option."""

    options: Mapping[str, str] = field(default_factory=dict)

    def error(self, location: Location, problem: str) -> InputError:
        key = next((step for step in location if isinstance(step, str) and step != "settings"), None)
        option = self.options.get(key) if key else None
        if option and key == "planners" and isinstance(location[-1], str) and location[-1] not in ("planners", "name"):
            option = f"--set planner.{location[-1]}"
        return InputError(f"{option}: {problem}") if option else super().error(location, problem)


@dataclass(frozen=True, eq=False)
class _Part(Document):
    """A part of a document; its errors are those of the whole."""

    whole: Document | None = None
    place: Location = ()

    def error(self, location: Location, problem: str) -> InputError:
        assert self.whole is not None
        return self.whole.error((*self.place, *location), problem)


def _part(document: Document, *place: str | int) -> Document:
    """Return the part of a document at a location."""
    data = document.data
    for step in place:
        data = data[step]
    return _Part(document.source, data, whole=document, place=place)


def campaign_schema() -> dict[str, Any]:
    """Return the JSON Schema of campaign files, for editors."""
    schema = CampaignFile.model_json_schema(by_alias=True)
    return {"$schema": "https://json-schema.org/draft/2020-12/schema", **schema, "title": "antdrive campaign"}
