"""From a campaign to its runs: every combination of what it lists, in a fixed order, each with its key."""

from __future__ import annotations

import itertools
import shlex
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from antdrive.planners import SMOOTHINGS
from antdrive.robots import RobotSpec, list_robots, load_robot
from antdrive.sim.campaigns.campaign import Campaign
from antdrive.sim.campaigns.grid_planners import PlannerVariant, planner_variants
from antdrive.sim.campaigns.grid_tasks import campaign_tasks
from antdrive.sim.campaigns.grid_worlds import NamedTask, campaign_worlds
from antdrive.sim.campaigns.job import Job, SweepCase, key_of
from antdrive.sim.entries import has_flags, option_text, setting_words
from antdrive.sim.log.binding import canonical_hash
from antdrive.sim.settings import scenario_fields
from antdrive.worlds import Task
from antdrive.worlds.errors import FieldError, InputError
from antdrive.worlds.files.checks import suggest

WORLDS, ROBOTS = "worlds", "robots"  # folders in a campaign's folder with what its commands name


@dataclass(frozen=True, eq=False)
class NamedRobot:
    """A robot as a campaign and its commands call it.

    Attributes:
        robot: the robot
        content: its canonical hash
        word: what commands call it
        file: its file; None: it is of the catalogue
    """

    robot: RobotSpec
    content: str
    word: str
    file: Path | None


@dataclass(frozen=True, eq=False)
class Expansion:
    """The runs of a campaign.

    Attributes:
        jobs: the runs in the campaign's order: by world, task, robot, route, noise, margin, planner and seed
        duplicates: how many combinations were left out because they mean the same as an earlier one
        counts: how many there are of worlds, tasks in each, robots, and so on, by name
        worlds: the world files that the runs' commands name, by path relative to the campaign's folder
        robots: likewise the files of robots
    """

    jobs: tuple[Job, ...]
    duplicates: int
    counts: dict[str, int]
    worlds: dict[str, Task]
    robots: dict[str, Path]


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
    for case in _cases(campaign, tasks, robots, settings, planners, files):
        identity = case.identity
        for seed in campaign.entry.seeds:
            key = key_of(identity, seed)
            jobs.setdefault(key, Job(key, case, seed))
    counts = {
        "worlds": len(worlds),
        "tasks": len(tasks) // len(worlds),
        "robots": len(robots),
        "routes": len(campaign.entry.routes),
        "noise": len(campaign.entry.noise),
        "margin": len(campaign.entry.margin),
        "planners": len(planners),
        "seeds": len(campaign.entry.seeds),
    }
    wanted = len(tasks) * len(robots) * len(settings) * len(planners) * len(campaign.entry.seeds)
    own = {one.word: one.file for one in robots if one.file is not None}
    return Expansion(tuple(jobs.values()), wanted - len(jobs), counts, files, own)


def _robots(campaign: Campaign) -> list[NamedRobot]:
    """The robots of a campaign, each once."""
    known, found = list_robots(), dict[str, NamedRobot]()
    for i, name in enumerate(campaign.entry.robots):
        path = known.get(name, campaign.folder / name)
        if not path.is_file():
            raise campaign.error(
                ("robots", i), f"{name}: no such file, nor a robot of the catalogue; {suggest(name, known)}"
            )
        robot = load_robot(path)
        content = canonical_hash(robot)
        word = name if name in known else f"{ROBOTS}/{content[:8]}/{path.name}"
        found.setdefault(content, NamedRobot(robot, content, word, None if name in known else path))
    return list(found.values())


def _settings(campaign: Campaign) -> list[dict[str, Any]]:
    """The fields of scenarios for every combination of route, noise and margin."""
    entry = campaign.entry

    def fail(key: str, problem: str) -> InputError:
        return campaign.error(("settings", *key.split(".")), problem)

    shared = scenario_fields(entry.settings, fail)
    for i, route in enumerate(entry.routes):
        if route not in SMOOTHINGS:
            raise campaign.error(("routes", i), f"unknown {route!r}; {suggest(route, SMOOTHINGS)}")
    return [
        {**shared, "smoothing": route, "noise": noise, "margin": margin}
        for route, noise, margin in itertools.product(entry.routes, entry.noise, entry.margin)
    ]


#: Where a campaign writes what a scenario calls by another name.
_PLACES = {
    "smoothing": ("routes",),
    "noise": ("noise",),
    "margin": ("margin",),
    "start": ("tasks",),
    "seed": ("seeds",),
}


def _check(
    campaign: Campaign,
    tasks: Sequence[NamedTask],
    robots: Sequence[NamedRobot],
    settings: Sequence[dict[str, Any]],
    planner: PlannerVariant,
) -> None:
    """Refuse, before any work, settings that a robot cannot have and starts where one has no room."""
    for robot in robots:
        for n, task in enumerate(tasks):
            for fields in settings if n == 0 else settings[:1]:
                margin = 0.0 if fields["margin"] == "auto" else None
                try:
                    _case(task, robot, fields, planner, None).scenario(0, margin)
                except FieldError as error:
                    place = _PLACES.get(error.key, ("settings", error.key))
                    where = task.place if error.key == "start" and not campaign.tasks else place
                    raise campaign.error(where, f"{task.world} with {robot.robot.name}: {error.problem}") from None


def _cases(
    campaign: Campaign,
    tasks: Sequence[NamedTask],
    robots: Sequence[NamedRobot],
    settings: Sequence[dict[str, Any]],
    planners: Sequence[PlannerVariant],
    files: dict[str, Task],
) -> Iterator[SweepCase]:
    """Every combination but for the seeds; `files` is filled with the worlds that commands name."""
    flags = has_flags(campaign.entry.settings)
    further = setting_words(campaign.entry.settings) if flags else []
    for task in tasks:
        content = canonical_hash(task.task)
        word = task.catalogue or f"{WORLDS}/{_file_name(task)}-{content[:8]}.yaml"
        if task.catalogue is None:
            files[word] = task.task
        for robot, fields, planner in itertools.product(robots, settings, planners):
            words = _words(word, robot.word, fields, planner, further) if flags else None
            yield _case(task, robot, fields, planner, words, content)


def _case(
    task: NamedTask,
    robot: NamedRobot,
    fields: dict[str, Any],
    planner: PlannerVariant,
    words: str | None,
    content: str = "",
) -> SweepCase:
    return SweepCase(
        task=task.task,
        world=task.world,
        world_hash=content,
        task_name=task.name,
        planner=planner.label,
        planner_name=planner.name,
        given=planner.given,
        options=planner.options,
        robot=robot.robot,
        robot_hash=robot.content,
        fields=fields,
        words=words,
    )


def _words(world: str, robot: str, fields: dict[str, Any], planner: PlannerVariant, further: Sequence[str]) -> str:
    """The command that repeats a run, from within the campaign's folder, without its seed."""
    words = ["antdrive", "run", world, "--planner", planner.name]
    words += [word for key, value in planner.given.items() for word in ("--set", f"planner.{key}={option_text(value)}")]
    words += ["--robot", robot, "--margin", option_text(fields["margin"]), "--smoothing", fields["smoothing"]]
    return shlex.join([*words, "--noise", option_text(fields["noise"]), *further])


def _file_name(task: NamedTask) -> str:
    name = task.world if task.name == "own" else f"{task.world}-{task.name}"
    return "".join(c if c.isascii() and (c.isalnum() or c in "-_.=") else "_" for c in name)[:100]
