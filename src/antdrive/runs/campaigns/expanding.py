"""Expand a campaign to its runs: every combination in a fixed order, each with its key."""

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
from antdrive.runs.campaigns.resolving import OWN, SKIP, campaign_tasks, campaign_worlds, planner_variants
from antdrive.sim.effects import idle_notes
from antdrive.sim.forms import columns_of, option_text, scenario_fields, setting_words
from antdrive.sim.log.record import canonical_hash
from antdrive.sim.scenario import Scenario
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
    planners: dict[str, Path]  # files of custom planners, likewise
    remarks: tuple[str, ...]  # sentences about skipped problems, maps' unknown cells and the floor of random tasks

    def idle_notes(self) -> list[str]:
        """Return a sentence for every setting without effect in some of the configurations."""
        cases, seeds = {id(job.case): job.case for job in self.jobs}, {job.seed for job in self.jobs}
        alike: dict[tuple[object, ...], Scenario] = {}  # whatever the task
        scenarios: list[Scenario] = []
        for case in cases.values():
            movers = frozenset((type(one), getattr(one, "seed", None)) for one in case.place.task.world.movers)
            key = movers, case.robot.content, str(case.settings.columns), case.planner.label
            if key not in alike:
                alike[key] = case.scenario(min(seeds), 0.0 if case.settings.fields["margin"] == "auto" else None)
            scenarios.append(alike[key])
        return idle_notes(scenarios, {"seed"} if len(seeds) > 1 else ())


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
        try:
            path = resolve("robot", name, known, campaign.folder)
        except FieldError as error:
            raise campaign.error(("robots", i), error.problem) from None
        robot = load_robot(path)
        content = canonical_hash(robot)
        word = name if name in known else f"{ROBOTS}/{content[:8]}/{path.name}"
        if content not in robots:
            taken = {one.name for one in robots.values()}
            called = next(one for one in (robot.name, name, f"{name} {content[:8]}") if one not in taken)
            robots[content] = NamedRobot(robot, called, content, word, None if name in known else path)
    return list(robots.values())


def _settings(campaign: Campaign) -> list[NamedSettings]:
    """Return every combination of the campaign's axes and settings."""
    for name, one in AXES.items():
        for i, value in enumerate(campaign.values(name)):
            if one.setting.choices and value not in one.setting.choices:
                raise campaign.error((one.key, i), f"unknown {value!r}; {suggest(value, one.setting.choices)}")
    listed = list(zip(campaign.settings, campaign.places, strict=True))
    combinations = []
    for *values, (settings, place) in itertools.product(*map(campaign.values, AXES), listed):
        given = {**settings, **dict(zip((one.key for one in AXES.values()), values, strict=True))}
        try:
            fields = scenario_fields(given)
        except FieldError as error:
            raise campaign.error((*place, *error.key.split(".")), error.problem) from None
        del fields["seed"]
        words = setting_words(given)
        combinations.append(NamedSettings(fields, columns_of(fields), None if words is None else tuple(words), place))
    return combinations


#: Locations in a campaign of a scenario's fields, where the names differ.
_PLACES = {"start": ("tasks",), "seed": ("seeds",)} | {one.key: (one.key,) for one in AXES.values()}


def _fitting(
    campaign: Campaign,
    tasks: Sequence[NamedTask],
    robots: Sequence[NamedRobot],
    settings: Sequence[NamedSettings],
    planner: PlannerVariant,
    skipped: list[str],
) -> list[NamedTask]:
    """Reject, before any work, invalid settings and starts without room for the robot; skip those of `skip: true`."""
    unfit: dict[int, str] = {}
    obstructed = list({one.fields["unseen"]: one for one in reversed(settings)}.values())
    moving = [n for n, task in enumerate(tasks) if task.task.world.movers]
    whole = {0, *moving[:1]}  # perception depends on whether there are movers
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
                    name = task.world if task.name == OWN else f"{task.world}, {task.name.replace('-', ' ')}"
                    problem = f"{name} with {robot.name}: {error.problem}"
                    if error.key != "start" or not task.name.startswith("problem-"):
                        raise campaign.error(where, problem) from None
                    if not task.skip:
                        raise campaign.error(where, f"{problem}; {SKIP}") from None
                    unfit[n] = problem
    skipped += unfit.values()
    return [task for n, task in enumerate(tasks) if n not in unfit]


def _cases(
    tasks: Sequence[NamedTask],
    robots: Sequence[NamedRobot],
    settings: Sequence[NamedSettings],
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
        known = [one.among(bool(task.task.world.movers)) for one in settings]
        for robot, one, planner in itertools.product(robots, known, planners):
            words = None if one.words is None else _words(word, robot.word, one.words, planner)
            yield SweepCase(place=place, world_hash=content, planner=planner, robot=robot, settings=one, words=words)


def _words(world: str, robot: str, settings: Sequence[str], planner: PlannerVariant) -> str:
    """Return the command that repeats a run from the campaign's folder, without its seed."""
    words = ["antdrive", "run", world, "--planner", planner.word]
    words += [word for key, value in planner.given.items() for word in ("--set", f"planner.{key}={option_text(value)}")]
    return shlex.join([*words, "--robot", robot, *settings])


def _file_name(task: NamedTask) -> str:
    name = task.world if task.name == "own" else f"{task.world}-{task.name}"
    return file_name(name, "-_.=", ascii_only=True)[:100]
