"""Resolve the worlds, planners and tasks that a campaign lists, each under its name in tables."""

from __future__ import annotations

import dataclasses
import glob
import itertools
import math
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from antdrive.base.checks import show, suggest
from antdrive.base.document import Location
from antdrive.base.errors import FieldError, InputError
from antdrive.base.files import relative
from antdrive.base.registry import Registry
from antdrive.base.user_code import file_and_rest, label_names
from antdrive.planners import PLANNERS, Query, capabilities_of, load_planner
from antdrive.planners.registry import REGISTRY
from antdrive.robots import PurePursuit, RobotSpec, outline_of, overlap_at
from antdrive.robots.default_margin import LEAST, default_margin
from antdrive.runs.campaigns.campaign import Campaign, RandomTasks, seeds_of
from antdrive.runs.campaigns.job import NamedTask, PlannerVariant, TaskOrigin
from antdrive.sim.driving.route_planner import FINE
from antdrive.sim.forms import option_text, seed_list
from antdrive.sim.log.record import canonical_hash, settings_of
from antdrive.sim.written import Written, placed
from antdrive.worlds import Disc, Grid, Task, World, list_worlds, load_task, load_tasks, rasterise
from antdrive.worlds.coverage import reached_cells, share_of
from antdrive.worlds.formats.importing import import_file, import_format

OWN = "own"  # name of a world's default task
SKIP = "with skip: true such problems are skipped"


def campaign_worlds(campaign: Campaign, skipped: list[str]) -> list[NamedTask]:
    """Return the worlds of a campaign with their default tasks, in its order; files of a pattern are sorted by name.

    Worlds with the same name get their path or options as part of the name, so names are unique. Several problems of
    one map are tasks of one world. Entries with `skip: true` add the errors of their problems to `skipped`.
    """
    tasks: list[tuple[NamedTask, str]] = []
    for i, entry in enumerate(campaign.entry.worlds):
        place: Location = ("worlds", i)
        if isinstance(entry, str):
            tasks += _named(campaign, place, entry)
        elif "generate" in entry:
            tasks += _random(campaign, place, dict(entry))
        elif "import" in entry:
            tasks += _imported(campaign, place, dict(entry), skipped)
        else:
            raise campaign.error(place, "write a name, a file, {generate: forest, seeds: 20} or {import: FILES}")
    return _distinct(tasks)


def _distinct(named: list[tuple[NamedTask, str]]) -> list[NamedTask]:
    """Return the tasks without repeats; rename worlds until names are unique."""
    geometries: dict[str, World] = {}
    tasks: dict[tuple[str, str], NamedTask] = {}
    for one, second in named:
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
    """Return whether two tasks are equal apart from the source of their worlds."""
    return dataclasses.replace(task, world=dataclasses.replace(task.world, source=other.world.source)) == other


def _named(campaign: Campaign, place: Location, name: str) -> Iterator[tuple[NamedTask, str]]:
    known = list_worlds()
    if name in known:
        yield NamedTask(name, OWN, load_task(known[name]), name, place, load_tasks(name)), name
        return
    for path in _files(campaign, place, name, f"and no world of the catalogue; {suggest(Path(name).stem, known)}"):
        task = load_task(path)
        yield (NamedTask(task.world.name, OWN, task, None, place, load_tasks(path)), relative(path, campaign.folder))


def _files(campaign: Campaign, place: Location, pattern: str, otherwise: str) -> list[Path]:
    """Return the files of a path or pattern, sorted by name."""
    paths = sorted(glob.glob(str(campaign.folder / pattern), recursive=True))
    if not paths:
        raise campaign.error(place, f"{pattern}: no such file{' here, ' + otherwise if otherwise else ''}")
    return [Path(path) for path in paths]


def _random(campaign: Campaign, place: Location, entry: dict[str, Any]) -> Iterator[tuple[NamedTask, str]]:
    if not isinstance(kind := entry["generate"], str):
        raise campaign.error((*place, "generate"), f"must be the name of a generator, got {show(kind)}")
    if "seed" in entry and "seeds" in entry:
        raise campaign.error((*place, "seed"), "use either seed or seeds")
    key = "seed" if "seed" in entry else "seeds"
    given = entry.pop(key, 1)
    try:
        seeds = seeds_of([given] if key == "seed" else given)
    except ValueError as error:
        raise campaign.error((*place, key), str(error)) from None
    suffix = "".join(f" {name}={option_text(value)}" for name, value in entry.items() if name != "generate")
    for seed in seeds:
        with placed(campaign.at(*place, skip=1)):
            task = Written(world={**entry, "seed": seed}).load_task()
        yield NamedTask(f"{kind}-{seed}{suffix}", OWN, task, None, place), f"{kind}-{seed}{suffix} ({place[1]})"


def _imported(
    campaign: Campaign, place: Location, entry: dict[str, Any], skipped: list[str]
) -> Iterator[tuple[NamedTask, str]]:
    pattern, barn, skip = entry.pop("import"), entry.pop("barn", False), entry.pop("skip", False)
    if not isinstance(pattern, str) or not isinstance(barn, bool) or not isinstance(skip, bool):
        raise campaign.error(place, "write {import: FILES, barn: true} with the options of antdrive worlds import")
    problems = _problems(campaign, place, entry)
    suffix = "".join(f" {key}={option_text(value)}" for key, value in entry.items())
    options = {key: tuple(value) if isinstance(value, list) else value for key, value in entry.items()}
    if isinstance(scen := entry.get("scen"), str):
        options["scen"] = campaign.folder / scen
    drawn = isinstance(campaign.tasks, RandomTasks) and problems == [None] and not {"start", "goal"} & set(entry)
    for path in _files(campaign, (*place, "import"), pattern, ""):
        for problem in problems:
            try:
                anywhere = (drawn and "anywhere" in import_format(path, barn=barn).options) or None
                tasks = import_file(path, barn=barn, problem=problem, anywhere=anywhere, **options)
            except FieldError as error:
                raise campaign.error((*place, error.key), error.problem) from None
            except TypeError:
                raise campaign.error(place, "an option has an invalid type") from None
            except InputError as error:
                if problem is None or not path.exists():
                    raise
                if not skip:
                    raise campaign.error(place, f"problem {problem}: {error}; {SKIP}") from None
                skipped.append(f"problem {problem}: {error}")
                continue
            for task in tasks:
                name = OWN if problem is None else f"problem-{problem}"
                second = f"{relative(path, campaign.folder)}#{task.world.name}{suffix}"
                yield NamedTask(task.world.name, name, task, None, place, skip=skip), second


def _problems(campaign: Campaign, place: Location, entry: dict[str, Any]) -> list[int] | list[None]:
    """Pop the problems of a map from an entry: 7, [3, 7] or 0-99."""
    given = entry.pop("problem", None)
    if given is None:
        return [None]
    try:
        return seed_list([given] if type(given) is int else given)
    except ValueError as error:
        raise campaign.error((*place, "problem"), str(error)) from None


MOST_VALUES = 10_000  # in one range


class NamedComponent(NamedTuple):
    """A planner or controller under its names."""

    name: str  # as in the campaign; for a file without its folder
    source: str  # what loads it
    word: str  # its name in commands run in the campaign's folder, which has a copy of its file
    file: Path | None  # its file; None if registered, in a module, or a folder
    version: str  # version of its code


def component_of(name: str, folder: Path, registry: Registry[Any]) -> NamedComponent:
    """Return a component that a campaign in a folder names.

    Raises:
        InputError: it cannot be loaded.
    """
    file, rest = file_and_rest(name)
    if not file:
        return NamedComponent(name, name, name, None, registry.version(name))
    path = (folder / file).absolute()
    source, name = f"{path}{rest}", f"{path.name}{rest}"
    version = registry.version(source)
    if path.is_dir():  # a bag
        return NamedComponent(name, source, source, None, version)
    return NamedComponent(name, source, f"{registry.kind}s/{version.rpartition(' ')[2]}/{name}", path, version)


def planner_variants(campaign: Campaign) -> list[PlannerVariant]:
    """Return the planners of a campaign, in its order; the last list of options varies fastest."""
    variants: dict[str, PlannerVariant] = {}
    for i, entry in enumerate(campaign.entry.planners):
        for variant in _variants(campaign, ("planners", i), {"name": entry} if isinstance(entry, str) else dict(entry)):
            taken = variants.setdefault(variant.label, variant)
            if taken.source != variant.source:  # the same class name in another file of the same name
                written = entry if isinstance(entry, str) else entry["name"]
                label = variant.label.replace(variant.name, written, 1)
                variants[label] = dataclasses.replace(variant, label=label, name=written)
    names = list(dict.fromkeys(variant.name for variant in variants.values()))
    short = dict(zip(names, label_names(names), strict=True))
    return [
        dataclasses.replace(one, label=one.label.replace(one.name, short[one.name], 1)) for one in variants.values()
    ]


def _variants(campaign: Campaign, place: Location, options: dict[str, Any]) -> Iterator[PlannerVariant]:
    given_name = options.pop("name", None)
    if not isinstance(given_name, str):
        raise campaign.error((*place, "name"), "missing; write the planner's name, such as {name: aco-han, ants: 50}")
    at = campaign.at(*place, skip=1)
    with placed(at):
        name, source, word, path, version = component_of(given_name, campaign.folder, REGISTRY)
    lists = [values_of(campaign, (*place, key), value) for key, value in options.items()]
    for values in itertools.product(*lists):
        given = dict(zip(options, values, strict=True))
        with placed(at):
            planner = load_planner(source, **given)
        resolved = settings_of(planner) if dataclasses.is_dataclass(planner) else settings_of(given)
        label = " ".join([name, *(f"{key}={option_text(value)}" for key, value in given.items())])
        yield PlannerVariant(label, name, source, word, path, version, given, resolved)


def values_of(campaign: Campaign, place: Location, value: Any) -> list[Any]:
    """Return the values of an option: those of a list or of a range {from, to, step}, or one."""
    if isinstance(value, list):
        if not value or any(isinstance(one, list | dict) for one in value):
            raise campaign.error(place, f"must be a list of values, got {show(value)}")
        return value
    if not isinstance(value, dict):
        return [value]
    numbers = [value.get(key, "") for key in ("from", "to", "step")]
    if len(value) != 3 or any(isinstance(number, bool) or not isinstance(number, int | float) for number in numbers):
        raise campaign.error(place, "a range is written {from: 10, to: 50, step: 10}")
    first, last, step = numbers
    if not (all(map(math.isfinite, numbers)) and step > 0 and last >= first and (last - first) / step < MOST_VALUES):
        raise campaign.error(place, f"must ascend in positive steps, at most {MOST_VALUES} of them")
    count = int((last - first) / step + 1e-9) + 1
    whole = all(isinstance(n, int) for n in numbers)
    return [first + k * step if whole else round(first + k * step, 12) for k in range(count)]


NAMED = "named"  # value of the key tasks: those of the world files
TRIES = 1000  # most random pairs of start and goal drawn for one task


def campaign_tasks(
    campaign: Campaign, worlds: Sequence[NamedTask], robots: Sequence[RobotSpec], planners: Sequence[PlannerVariant]
) -> Iterator[NamedTask]:
    """Yield the tasks of a campaign: each world with each of its starts and goals."""
    if isinstance(campaign.tasks, RandomTasks):
        for world in _each_once(worlds):
            outlined = _outlined(campaign, world.task.world, robots, planners)
            yield from _drawn(campaign, campaign.tasks, world, robots, outlined)
    elif campaign.entry.tasks == NAMED:
        for world in worlds:
            if not world.others:
                raise campaign.error(
                    ("tasks",), f"the file of world {world.world} lists no tasks; add them there, or write own"
                )
            for name, task in world.others.items():
                yield dataclasses.replace(world, name=name, task=task, catalogue=None)
    elif campaign.tasks:
        for world in _each_once(worlds):
            yield from _listed(campaign, world)
    else:
        yield from worlds


def _outlined(
    campaign: Campaign, world: World, robots: Sequence[RobotSpec], planners: Sequence[PlannerVariant]
) -> tuple[RobotSpec, ...]:
    """Return the robots that plan for their footprint in a world with every planner and setting of a campaign."""
    able = [capabilities_of(load_planner(one.source, **one.given)) for one in planners]
    outlined = all(entry.get("footprint") != "disc" for entry in campaign.settings)
    outlined = outlined and all(can.turns and not (can.cell_by_cell and world.movers) for can in able)
    return tuple(robot for robot in robots if outlined and not robot.footprint.is_disc)


def _reach(
    campaign: Campaign, world: World, cell: float, robots: Sequence[RobotSpec], outlined: Sequence[RobotSpec]
) -> list[Grid]:
    """Return the grids on which a task must have a path: each outlined robot's, and the largest other robot's disc."""
    discs = [robot for robot in robots if robot not in outlined]
    margin = max(_margins(campaign, robots))
    grids = [rasterise(world, cell, max(robot.radius for robot in discs) + margin)] if discs else []
    for robot in outlined:
        outline = outline_of(robot.footprint, margin)
        grids.append(rasterise(world, min(cell, FINE), robot.radius + margin, outline))
    return grids


def _margins(campaign: Campaign, robots: Sequence[RobotSpec]) -> Iterator[float]:
    """Yield the margins of a campaign [m]: `LEAST` for auto, and for the default those of the usual controller."""
    for margin in campaign.values("margin"):
        if margin is not None:
            yield LEAST if margin == "auto" else float(margin)
            continue
        for robot, noise, kind in itertools.product(robots, campaign.values("noise"), campaign.values("smoothing")):
            yield default_margin(robot, PurePursuit(), noise, kind)


def _each_once(worlds: Sequence[NamedTask]) -> Iterable[NamedTask]:
    """Return each world once, with its first task, which is replaced later."""
    first: dict[str, NamedTask] = {}
    for one in worlds:
        first.setdefault(one.world, one)
    return first.values()


def _listed(campaign: Campaign, world: NamedTask) -> Iterator[NamedTask]:
    assert isinstance(campaign.tasks, tuple)
    for i, entry in enumerate(campaign.tasks):
        x, y, yaw = entry.start
        try:
            task = dataclasses.replace(world.task, start=(x, y, yaw), goal=(entry.goal[0], entry.goal[1]))
        except FieldError as error:
            raise campaign.error(("tasks", i, error.key), f"in world {world.world}: {error.problem}") from None
        yield dataclasses.replace(world, name=entry.name or str(i), task=task, catalogue=None)


def _drawn(
    campaign: Campaign,
    request: RandomTasks,
    world: NamedTask,
    robots: Sequence[RobotSpec],
    outlined: Sequence[RobotSpec],
) -> Iterator[NamedTask]:
    """Yield random tasks in one world. They depend on the world, the seed and the sizes of robots and unseen obstacles."""
    unseen = tuple(
        dict.fromkeys(Disc(d.x, d.y, d.radius, d.height) for one in campaign.settings for d in one.get("unseen", ()))
    )
    content = int(canonical_hash(world.task)[:16], 16)
    rng = np.random.default_rng([request.seed, content])
    cell = max(entry.get("cell") or world.task.cell for entry in campaign.settings)
    grids = _reach(campaign, world.task.world, cell, robots, outlined)
    floors = [_floor(world.task, grid.cell) for grid in grids]
    free = np.argwhere((grids[0].moves > 0) & floors[0])
    tasks: list[Task] = []
    for _ in range(request.random):
        task = _draw(rng, grids, free, request.min_distance, world.task, robots, unseen) if len(free) else None
        if task is None:
            largest = max(grids, key=lambda grid: grid.inflate)
            shape = "the footprint" if largest.turns else "a robot"
            problem = (
                f"no start and goal {request.min_distance:g} m apart with a path between them in {TRIES} draws in world "
                f"{world.world} for {shape} of radius {largest.inflate:.3g} m with its margin; use a smaller min_distance"
            )
            raise campaign.error(("tasks",), problem)
        tasks.append(task)
    starts = [task.start[:2] for task in tasks]
    share = min(share_of(reached_cells(grid, starts), floor) for grid, floor in zip(grids, floors, strict=True))
    origin = TaskOrigin(share, tuple(robot.name for robot in outlined))
    for number, task in enumerate(tasks):
        name = f"random-{request.seed}-{number}"
        yield dataclasses.replace(world, name=name, task=task, catalogue=None, origin=origin)


def _floor(task: Task, cell: float) -> npt.NDArray[np.bool_]:
    """Return the cells (R, C) of a world's floor: where a point gets."""
    bare = rasterise(task.world, cell)
    inside = reached_cells(bare, (task.start[:2], task.goal))
    return inside if inside.any() else bare.moves > 0  # a converted map is hollow where it is blocked


def _draw(
    rng: np.random.Generator,
    grids: Sequence[Grid],
    free: np.ndarray,
    distance: float,
    own: Task,
    robots: Sequence[RobotSpec],
    unseen: tuple[Disc, ...],
) -> Task | None:
    """Draw a task with start and goal in free cells of the first grid and a path on all, the robot facing the goal.

    None after too many draws.
    """
    for _ in range(TRIES):
        (x, y), (goal_x, goal_y) = grids[0].xy(free[rng.integers(len(free), size=2)]).tolist()
        if math.hypot(goal_x - x, goal_y - y) < max(distance, own.goal_tolerance):
            continue
        start = x, y, math.atan2(goal_y - y, goal_x - x)
        try:
            task = dataclasses.replace(own, start=start, goal=(goal_x, goal_y))
        except FieldError:
            continue
        if any(overlap_at(task.world, robot, start, unseen) for robot in robots):
            continue
        if all(PLANNERS["astar"].plan(Query.between(grid, task), rng).solved for grid in grids):
            return task
    return None
