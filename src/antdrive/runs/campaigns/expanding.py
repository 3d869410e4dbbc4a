"""From a campaign to its runs: every combination of what it lists, in a fixed order, each with its key."""

from __future__ import annotations

import dataclasses
import itertools
import shlex
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from antdrive.base.checks import resolve, suggest
from antdrive.base.errors import FieldError
from antdrive.base.files import file_name
from antdrive.robots import list_robots, load_robot
from antdrive.runs.campaigns.campaign import AXES, Campaign
from antdrive.runs.campaigns.job import Job, NamedRobot, NamedSettings, NamedTask, PlannerVariant, SweepCase, run_key
from antdrive.runs.campaigns.resolving import campaign_tasks, campaign_worlds, planner_variants
from antdrive.sim.forms import columns_of, option_text, scenario_fields, setting_words
from antdrive.sim.log.record import canonical_hash
from antdrive.worlds import Task

WORLDS, ROBOTS = "worlds", "robots"  # folders in a campaign's folder with what its commands name


@dataclass(frozen=True, eq=False)
class Expansion:
    """The runs of a campaign."""

    # the runs in the campaign's order: by world, task, robot, smoothing, noise, margin, planner and seed
    jobs: tuple[Job, ...]
    duplicates: int  # how many combinations were left out because they mean the same as an earlier one
    counts: dict[str, int]  # how many there are of worlds, tasks in each, robots, and so on, by name
    worlds: dict[str, Task]  # the world files that the runs' commands name, by path relative to the campaign's folder
    robots: dict[str, Path]  # likewise the files of robots
    planners: dict[str, Path]  # likewise the files of people's own planners


def expand(campaign: Campaign) -> Expansion:
    """The runs of a campaign.

    Raises:
        InputError: something that the campaign names does not exist or has a value that it cannot have; file, line, key.
    """
    planners, robots = planner_variants(campaign), _robots(campaign)
    worlds = campaign_worlds(campaign)
    tasks = list(campaign_tasks(campaign, worlds, [one.robot for one in robots]))
    settings = _settings(campaign)
    _check(campaign, tasks, robots, settings, planners[0])
    jobs: dict[str, Job] = {}
    files: dict[str, Task] = {}
    for case in _cases(tasks, robots, settings, planners, files):
        identity = case.identity
        for seed in campaign.entry.seeds:
            key = run_key(identity, seed)
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
    codes = {one.word.rpartition(":")[0]: one.file for one in planners if one.file is not None}
    return Expansion(tuple(jobs.values()), wanted - len(jobs), counts, files, own, codes)


def _count_tasks(tasks: Sequence[NamedTask]) -> dict[str, int]:
    """How many worlds there are, and tasks in each; where these differ, how many tasks in all worlds."""
    each = Counter(one.world for one in tasks)
    if len(set(each.values())) == 1:
        return {"worlds": len(each), "tasks": len(tasks) // len(each)}
    return {f"tasks in {len(each)} worlds": len(tasks)}


def _robots(campaign: Campaign) -> list[NamedRobot]:
    """The robots of a campaign, each once."""
    known, found = list_robots(), dict[str, NamedRobot]()
    for i, name in enumerate(campaign.entry.robots):
        try:
            path = resolve("robot", name, known, campaign.folder)
        except FieldError as error:
            raise campaign.error(("robots", i), error.problem) from None
        robot = load_robot(path)
        content = canonical_hash(robot)
        word = name if name in known else f"{ROBOTS}/{content[:8]}/{path.name}"
        if content not in found:
            taken = {one.name for one in found.values()}
            called = next(one for one in (robot.name, name, f"{name} {content[:8]}") if one not in taken)
            found[content] = NamedRobot(robot, called, content, word, None if name in known else path)
    return list(found.values())


def _settings(campaign: Campaign) -> list[NamedSettings]:
    """Every combination of the values that the campaign lists and of its settings."""
    for name, one in AXES.items():
        for i, value in enumerate(campaign.values(name)):
            if one.setting.choices and value not in one.setting.choices:
                raise campaign.error((one.key, i), f"unknown {value!r}; {suggest(value, one.setting.choices)}")
    listed = list(zip(campaign.settings, campaign.places, strict=True))
    found = []
    for *values, (settings, place) in itertools.product(*map(campaign.values, AXES), listed):
        given = {**settings, **dict(zip((one.key for one in AXES.values()), values, strict=True))}
        try:
            fields = scenario_fields(given)
        except FieldError as error:
            raise campaign.error((*place, *error.key.split(".")), error.problem) from None
        del fields["seed"]
        words = setting_words(given)
        found.append(NamedSettings(fields, columns_of(fields), None if words is None else tuple(words), place))
    return found


#: Where a campaign writes what a scenario calls by another name.
_PLACES = {"start": ("tasks",), "seed": ("seeds",)} | {one.key: (one.key,) for one in AXES.values()}


def _check(
    campaign: Campaign,
    tasks: Sequence[NamedTask],
    robots: Sequence[NamedRobot],
    settings: Sequence[NamedSettings],
    planner: PlannerVariant,
) -> None:
    """Refuse, before any work, settings that a robot cannot have and starts where one has no room."""
    obstructed = list({one.fields["unseen"]: one for one in reversed(settings)}.values())
    moving = [n for n, task in enumerate(tasks) if task.task.world.movers]
    whole = {0, *moving[:1]}  # what robots may perceive depends on whether there are movers
    for robot in robots:
        for n, task in enumerate(tasks):
            for one in settings if n in whole else obstructed:
                margin = 0.0 if one.fields["margin"] == "auto" else None
                try:
                    SweepCase(
                        place=task,
                        world_hash="",
                        planner=planner,
                        robot=robot,
                        settings=one.among(n in moving),
                        words=None,
                    ).scenario(0, margin)
                except FieldError as error:
                    place = _PLACES.get(error.key, (*one.place, error.key))
                    where = task.place if error.key == "start" and not campaign.tasks else place
                    raise campaign.error(where, f"{task.world} with {robot.name}: {error.problem}") from None


def _cases(
    tasks: Sequence[NamedTask],
    robots: Sequence[NamedRobot],
    settings: Sequence[NamedSettings],
    planners: Sequence[PlannerVariant],
    files: dict[str, Task],
) -> Iterator[SweepCase]:
    """Every combination but for the seeds; `files` is filled with the worlds that commands name."""
    for task in tasks:
        content = canonical_hash(task.task)
        word = task.catalogue or f"{WORLDS}/{_file_name(task)}-{content[:8]}.yaml"
        if task.catalogue is None:
            files[word] = task.task
        place = dataclasses.replace(task, others={})
        known = [one.among(bool(task.task.world.movers)) for one in settings]
        for robot, one, planner in itertools.product(robots, known, planners):
            words = None if one.words is None else _words(word, robot.word, one.words, planner)
            yield SweepCase(place=place, world_hash=content, planner=planner, robot=robot, settings=one, words=words)


def _words(world: str, robot: str, settings: Sequence[str], planner: PlannerVariant) -> str:
    """The command that repeats a run, from within the campaign's folder, without its seed."""
    words = ["antdrive", "run", world, "--planner", planner.word]
    words += [word for key, value in planner.given.items() for word in ("--set", f"planner.{key}={option_text(value)}")]
    return shlex.join([*words, "--robot", robot, *settings])


def _file_name(task: NamedTask) -> str:
    name = task.world if task.name == "own" else f"{task.world}-{task.name}"
    return file_name(name, "-_.=", ascii_only=True)[:100]
