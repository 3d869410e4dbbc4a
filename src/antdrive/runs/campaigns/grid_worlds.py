"""The worlds of a campaign: of the catalogue, in files, imported, generated; and the tasks in each of them."""

from __future__ import annotations

import dataclasses
import glob
import itertools
import os
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from antdrive.base.checks import show, suggest
from antdrive.base.document import Location
from antdrive.base.errors import FieldError, InputError
from antdrive.runs.campaigns.campaign import Campaign, seeds_of
from antdrive.sim.forms import option_text, seed_list
from antdrive.sim.resolving import generated
from antdrive.worlds import Task, World, list_worlds, load_task, load_tasks
from antdrive.worlds.formats.importing import import_file

OWN = "own"  # the name of the task that a world brings


@dataclass(frozen=True, eq=False)
class NamedTask:
    """A world with start and goal, as a campaign calls it."""

    world: str  # what the campaign calls the world
    name: str  # what the campaign calls start and goal
    task: Task  # the task
    catalogue: str | None  # the world's name in the catalogue, if the task is the one of the catalogue
    place: Location  # where the campaign names the world
    others: Mapping[str, Task] = field(default_factory=dict)  # the other tasks that the world's file lists, by name


def campaign_worlds(campaign: Campaign) -> list[NamedTask]:
    """The worlds of a campaign with their own tasks, in its order; files of a pattern by name.

    Worlds that share a name have their path or options in what the campaign calls them, so that no two are called the same.
    Several problems of one map are tasks of one world.

    Raises:
        InputError: there is no such world, or a file is wrong.
    """
    found: list[tuple[NamedTask, str]] = []
    for i, entry in enumerate(campaign.entry.worlds):
        place: Location = ("worlds", i)
        if isinstance(entry, str):
            found += _named(campaign, place, entry)
        elif "generate" in entry:
            found += _random(campaign, place, dict(entry))
        elif "import" in entry:
            found += _imported(campaign, place, dict(entry))
        else:
            raise campaign.error(place, "write a name, a file, {generate: forest, seeds: 20} or {import: FILES}")
    return _distinct(found)


def _distinct(found: list[tuple[NamedTask, str]]) -> list[NamedTask]:
    """The tasks, each once; no two of them, and no two worlds, are called the same."""
    geometries: dict[str, World] = {}
    tasks: dict[tuple[str, str], NamedTask] = {}
    for one, second in found:
        geometry = dataclasses.replace(one.task.world, source=None)
        for world in itertools.chain((one.world, second), (f"{second} ({n})" for n in itertools.count(2))):
            there = tasks.get((world, one.name))
            if there is None and geometries.setdefault(world, geometry) == geometry:
                tasks[world, one.name] = dataclasses.replace(one, world=world)
                break
            if there is not None and _same(there.task, one.task):
                break
    return list(tasks.values())


def _same(task: Task, other: Task) -> bool:
    """Whether two tasks differ in nothing but what is said of where their worlds come from."""
    return dataclasses.replace(task, world=dataclasses.replace(task.world, source=other.world.source)) == other


def _named(campaign: Campaign, place: Location, name: str) -> Iterator[tuple[NamedTask, str]]:
    known = list_worlds()
    if name in known:
        yield NamedTask(name, OWN, load_task(known[name]), name, place, load_tasks(name)), name
        return
    for path in _files(campaign, place, name, f"nor a world of the catalogue; {suggest(Path(name).stem, known)}"):
        task = load_task(path)
        yield (
            NamedTask(task.world.name, OWN, task, None, place, load_tasks(path)),
            os.path.relpath(path, campaign.folder),
        )


def _files(campaign: Campaign, place: Location, pattern: str, otherwise: str) -> list[Path]:
    """The files that a pattern or a path names, in the order of their names."""
    paths = sorted(glob.glob(str(campaign.folder / pattern), recursive=True))
    if not paths:
        raise campaign.error(place, f"{pattern}: no such file{' here, ' + otherwise if otherwise else ''}")
    return [Path(path) for path in paths]


def _random(campaign: Campaign, place: Location, entry: dict[str, Any]) -> Iterator[tuple[NamedTask, str]]:
    kind = entry.pop("generate")
    if not isinstance(kind, str):
        raise campaign.error((*place, "generate"), f"must be the name of a generator, got {show(kind)}")
    if "seed" in entry and "seeds" in entry:
        raise campaign.error((*place, "seed"), "keep one of seed and seeds")
    key = "seed" if "seed" in entry else "seeds"
    given = entry.pop(key, 1)
    try:
        seeds = seeds_of([given] if key == "seed" else given)
    except ValueError as error:
        raise campaign.error((*place, key), str(error)) from None
    options = tuple((name, option_text(value)) for name, value in entry.items())
    suffix = "".join(f" {name}={text}" for name, text in options)
    for seed in seeds:
        try:
            task = generated(kind, seed, options)
        except InputError as error:
            raise campaign.error(place, str(error)) from None
        yield NamedTask(f"{kind}-{seed}{suffix}", OWN, task, None, place), f"{kind}-{seed}{suffix} ({place[1]})"


def _imported(campaign: Campaign, place: Location, entry: dict[str, Any]) -> Iterator[tuple[NamedTask, str]]:
    pattern, barn = entry.pop("import"), entry.pop("barn", False)
    if not isinstance(pattern, str) or not isinstance(barn, bool):
        raise campaign.error(place, "write {import: FILES, barn: true} with the options of antdrive worlds import")
    problems = _problems(campaign, place, entry)
    suffix = "".join(f" {key}={option_text(value)}" for key, value in entry.items())
    options = {key: tuple(value) if isinstance(value, list) else value for key, value in entry.items()}
    for path in _files(campaign, (*place, "import"), pattern, ""):
        for problem in problems:
            try:
                tasks = import_file(path, barn=barn, problem=problem, **options)
            except FieldError as error:
                raise campaign.error((*place, error.key), error.problem) from None
            except TypeError:
                raise campaign.error(place, "an option has a value of the wrong type") from None
            for task in tasks:
                name = OWN if problem is None else f"problem-{problem}"
                second = f"{os.path.relpath(path, campaign.folder)}#{task.world.name}{suffix}"
                yield NamedTask(task.world.name, name, task, None, place), second


def _problems(campaign: Campaign, place: Location, entry: dict[str, Any]) -> list[int] | list[None]:
    """The problems of a map that an entry lists as 7, [3, 7] or 0-99; it is left without them."""
    given = entry.pop("problem", None)
    if given is None:
        return [None]
    try:
        return seed_list([given] if type(given) is int else given)
    except ValueError as error:
        raise campaign.error((*place, "problem"), str(error)) from None
