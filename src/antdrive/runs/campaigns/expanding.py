"""Expand a campaign to its runs: every combination in a fixed order, each with its key."""

from __future__ import annotations

import dataclasses
import itertools
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from antdrive.base.checks import resolve, suggest
from antdrive.base.document import Location
from antdrive.base.errors import FieldError, amount
from antdrive.base.files import file_name
from antdrive.base.user_code import file_and_rest
from antdrive.robots import list_robots, load_robot
from antdrive.robots.controllers.registry import REGISTRY
from antdrive.runs.campaigns.campaign import AXES, Campaign
from antdrive.runs.campaigns.job import Job, NamedRobot, NamedTask, PlannerVariant, SweepCase
from antdrive.runs.campaigns.resolving import OWN, SKIP, campaign_tasks, campaign_worlds, component_of, planner_variants
from antdrive.sim.forms import name_and_options, scenario_fields
from antdrive.sim.idle_settings import idle_notes
from antdrive.sim.log.record import canonical_hash
from antdrive.sim.scenario import Scenario, key_of, unchosen
from antdrive.sim.written import Written, placed, with_controller
from antdrive.worlds import Task
from antdrive.worlds.formats.map_server import OF_SHADE

WORLDS, ROBOTS = "worlds", "robots"  # subfolders with the files that commands name


@dataclass(frozen=True, eq=False)
class Expansion:
    """The runs of a campaign."""

    # runs in the campaign's order: by world, task, robot, smoothing, noise, margin, planner and seed
    jobs: tuple[Job, ...]
    duplicates: int  # number of combinations omitted as equal to an earlier one
    counts: dict[str, int]  # numbers of worlds, tasks in each world, robots and other axes, by name
    worlds: dict[str, Task]  # world files named by the runs' commands, by path relative to the campaign's folder
    robots: dict[str, Path]  # robot files, likewise
    codes: dict[str, Path]  # files of custom planners and controllers, likewise
    remarks: tuple[str, ...]  # sentences about skipped problems, maps' unknown cells and the floor of random tasks

    def idle_notes(self) -> list[str]:
        """Return a sentence for every setting without effect in some of the configurations."""
        cases, seeds = {id(job.case): job.case for job in self.jobs}, {job.seed for job in self.jobs}
        alike: dict[tuple[object, ...], Scenario] = {}  # whatever the task
        scenarios: list[Scenario] = []
        for case in cases.values():
            movers = frozenset((type(one), getattr(one, "seed", None)) for one in case.place.task.world.movers)
            key = movers, case.robot.content, str(case.written.settings), case.planner.label
            if key not in alike:
                alike[key] = case.scenario(min(seeds), unchosen)
            scenarios.append(alike[key])
        return idle_notes(scenarios, {"seed"} if len(seeds) > 1 else ())

    def lines(self, missing: int) -> Iterator[str]:
        """Yield the size of the campaign as lines.

        Args:
            missing: number of runs that are not done
        """
        smoothings = dict.fromkeys(str(job.case.resolved.columns["smoothing"]) for job in self.jobs)
        parts = {name: _counted(name, count) for name, count in self.counts.items()}
        yield " x ".join((parts | {"smoothing": f"smoothing {', '.join(smoothings)}"}).values())
        omitted = f"; {self.duplicates} duplicate combinations omitted" if self.duplicates else ""
        yield f"{amount(len(self.jobs), 'run')}, {missing} missing{omitted}"


def _counted(name: str, count: int) -> str:
    plural = count != 1 or " " in name or name == "settings"
    return f"{count} {name if plural else name.removesuffix('s')}"


def expand(campaign: Campaign) -> Expansion:
    """Return the runs of a campaign.

    Raises:
        InputError: a named item is missing or has an invalid value; the message has file, line and key.
    """
    planners, robots = planner_variants(campaign), _robots(campaign)
    skipped: list[str] = []
    worlds = campaign_worlds(campaign, skipped)
    tasks = list(campaign_tasks(campaign, worlds, [one.robot for one in robots], planners))
    settings = _settings(campaign)
    tasks = _fitting(campaign, tasks, robots, settings, planners[0], skipped)
    if not tasks:
        raise campaign.error(("worlds",), f"every problem is skipped; the first: {skipped[0]}")
    jobs: dict[str, Job] = {}
    files: dict[str, Task] = {}
    for case in _cases(tasks, robots, settings, planners, files):
        identity = case.resolved.identity
        for seed in campaign.entry.seeds:
            key = key_of(identity, seed)
            jobs.setdefault(key, Job(key, case, seed))
    counts = {
        **_count_tasks(tasks),
        "robots": len(robots),
        **{one.key: len(campaign.values(name)) for name, one in AXES.items()},
        "settings": len(campaign.settings),
        "planners": len(planners),
        "seeds": len(campaign.entry.seeds),
    }
    wanted = len(tasks) * len(robots) * len(settings) * len(planners) * len(campaign.entry.seeds)
    own = {one.word: one.file for one in robots if one.file is not None}
    names = dict.fromkeys(name_and_options(given.get("controller"))[0] for given, _ in settings)
    controllers = [component_of(name, campaign.folder, REGISTRY) for name in names]
    files_of_code = [(one.word, one.file) for one in planners] + [(one.word, one.file) for one in controllers]
    codes = {file_and_rest(word)[0]: file for word, file in files_of_code if file is not None}
    return Expansion(
        tuple(jobs.values()), wanted - len(jobs), counts, files, own, codes, tuple(_remarks(tasks, skipped))
    )


def _remarks(tasks: Sequence[NamedTask], skipped: Sequence[str]) -> Iterator[str]:
    """Yield sentences about skipped problems, doubtful cells of maps, and the floor that random tasks were drawn from."""
    if skipped:
        yield f"{len(skipped)} {'problem' if len(skipped) == 1 else 'problems'} skipped; {skipped[0]}"
    for world, source in {one.world: one.task.world.source or "" for one in tasks}.items():
        yield from (f"world {world}: {part}" for part in source.split("; ") if OF_SHADE in part)
    origins = {one.world: one.origin for one in tasks if one.origin}
    floors = {world: origin.share for world, origin in origins.items()}
    if floors:
        least, most = min(floors, key=floors.__getitem__), max(floors.values())
        share = f"{floors[least]:.0%}" if len(floors) == 1 else f"{floors[least]:.0%} (world {least}) to {most:.0%}"
        shapes = dict.fromkeys(", ".join(origin.outlined) for origin in origins.values())
        how = " or ".join(f"by footprint ({outlined})" if outlined else "by its disc" for outlined in shapes)
        yield f"random tasks are drawn from {share} of the connected floor: where the largest robot gets with its margin, {how}"


def _count_tasks(tasks: Sequence[NamedTask]) -> dict[str, int]:
    """Count the worlds and the tasks in each; if these differ, the tasks in all worlds."""
    each = Counter(one.world for one in tasks)
    if len(set(each.values())) == 1:
        return {"worlds": len(each), "tasks": len(tasks) // len(each)}
    return {f"tasks in {len(each)} worlds": len(tasks)}


def _robots(campaign: Campaign) -> list[NamedRobot]:
    """Return the robots of a campaign, each once."""
    known, robots = list_robots(), dict[str, NamedRobot]()
    for i, name in enumerate(campaign.entry.robots):
        with placed(campaign.at("robots", i, skip=1)):
            path = resolve("robot", name, known, campaign.folder)
        robot = load_robot(path)
        content = canonical_hash(robot)
        word = name if name in known else f"{ROBOTS}/{content[:8]}/{path.name}"
        if content not in robots:
            taken = {one.name for one in robots.values()}
            called = next(one for one in (robot.name, name, f"{name} {content[:8]}") if one not in taken)
            robots[content] = NamedRobot(robot, called, content, word, None if name in known else path)
    return list(robots.values())


def _settings(campaign: Campaign) -> list[tuple[dict[str, Any], Location]]:
    """Return every combination of the campaign's axes and settings, and the location of each."""
    for name, one in AXES.items():
        for i, value in enumerate(campaign.values(name)):
            if one.setting.choices and value not in one.setting.choices:
                raise campaign.error((one.key, i), f"unknown {value!r}; {suggest(value, one.setting.choices)}")
    listed = list(zip(campaign.settings, campaign.places, strict=True))
    keys = [one.key for one in AXES.values()]
    combinations = []
    for *values, (settings, place) in itertools.product(*map(campaign.values, AXES), listed):
        given = {**settings, **dict(zip(keys, values, strict=True))}
        with placed(campaign.at(*place)):
            given = dict(with_controller(given, lambda name: component_of(name, campaign.folder, REGISTRY).source))
            scenario_fields(given)
        combinations.append((given, place))
    return combinations


#: Locations in a campaign of a scenario's fields, where the names differ.
_PLACES = {"start": ("tasks",), "seed": ("seeds",)} | {one.key: (one.key,) for one in AXES.values()}


def _fitting(
    campaign: Campaign,
    tasks: Sequence[NamedTask],
    robots: Sequence[NamedRobot],
    settings: Sequence[tuple[dict[str, Any], Location]],
    planner: PlannerVariant,
    skipped: list[str],
) -> list[NamedTask]:
    """Reject, before any work, invalid settings and starts without room for the robot; skip those of `skip: true`."""
    unfit: dict[int, str] = {}
    obstructed = list({str(one.get("unseen")): (one, place) for one, place in reversed(settings)}.values())
    moving = [n for n, task in enumerate(tasks) if task.task.world.movers]
    whole = {0, *moving[:1]}  # perception depends on whether there are movers
    for robot in robots:
        for n, task in enumerate(tasks):
            for given, place in settings if n in whole else obstructed:
                try:
                    _case(task, "", "", robot, given, planner).scenario(0, unchosen)
                except FieldError as error:
                    where = _PLACES.get(error.key, (*place, error.key))
                    where = task.place if error.key == "start" and not campaign.tasks else where
                    name = task.world if task.name == OWN else f"{task.world}, {task.name.replace('-', ' ')}"
                    problem = f"{name} with {robot.name}: {error.problem}"
                    if error.key != "start" or not task.name.startswith("problem-"):
                        raise campaign.error(where, problem) from None
                    if not task.skip:
                        raise campaign.error(where, f"{problem}; {SKIP}") from None
                    unfit[n] = problem
    skipped += unfit.values()
    return [task for n, task in enumerate(tasks) if n not in unfit]


def _case(
    task: NamedTask, content: str, world: str, robot: NamedRobot, given: dict[str, Any], planner: PlannerVariant
) -> SweepCase:
    """Return a configuration, with the canonical hash of its task and the world's name in commands."""
    words = with_controller(given, lambda name: component_of(name, Path(), REGISTRY).word)
    written = Written(world=world, planner=planner.word, options=planner.given, robot=robot.word, settings=words)
    return SweepCase(place=task, world_hash=content, planner=planner, robot=robot, written=written, settings=given)


def _cases(
    tasks: Sequence[NamedTask],
    robots: Sequence[NamedRobot],
    settings: Sequence[tuple[dict[str, Any], Location]],
    planners: Sequence[PlannerVariant],
    files: dict[str, Task],
) -> Iterator[SweepCase]:
    """Yield every combination except seeds; collect the worlds named by commands in `files`."""
    for task in tasks:
        content = canonical_hash(task.task)
        word = task.catalogue or f"{WORLDS}/{_file_name(task)}-{content[:8]}.yaml"
        if task.catalogue is None:
            files[word] = task.task
        place = dataclasses.replace(task, others={})
        for robot, (given, _), planner in itertools.product(robots, settings, planners):
            yield _case(place, content, word, robot, given, planner)


def _file_name(task: NamedTask) -> str:
    name = task.world if task.name == "own" else f"{task.world}-{task.name}"
    return file_name(name, "-_.=", ascii_only=True)[:100]
