"""Failing scenarios as files: worlds, robots and a suite that expects each to fail in the same way."""

from __future__ import annotations

import dataclasses
import itertools
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import yaml

from antdrive.base.atomic import write_text
from antdrive.base.errors import InputError
from antdrive.base.files import file_name, relative
from antdrive.robots import RobotSpec, list_robots, load_robot
from antdrive.robots.robot_file import footprint_to_dict
from antdrive.runs.failures.failure import Attempt
from antdrive.runs.pool import Pool
from antdrive.runs.suites.demands import Bound
from antdrive.runs.suites.nearest import cause_of_contact, first_contact_kind
from antdrive.runs.suites.scenarios import scenario_of
from antdrive.runs.suites.suite import load_suite
from antdrive.sim.log.outcome import Outcome
from antdrive.sim.pipeline import Run
from antdrive.sim.scenario import Scenario
from antdrive.sim.written import Written
from antdrive.worlds import save_task

#: Settings written even at their defaults, so that the test survives a change of defaults.
PINNED = ("smoothing", "noise")


def write_suite(path: Path, failures: Sequence[Attempt], notes: Sequence[str] = (), bound: Bound | None = None) -> Path:
    """Write a suite, its worlds, and the robots that are not in the catalogue.

    The suite has no baselines: it passes as long as the scenarios fail in the same way. A scenario whose planner raises an
    error is expected to succeed, as no outcome covers errors; its test fails until the planner is fixed.

    Args:
        path: the suite's file; its name ends in .drive.yaml
        failures: the failing runs; their worlds' names differ, and name the scenarios
        notes: a remark on each for readers, which may be empty; none by default
        bound: the metric's bound that they cross, if that is their failure

    Returns:
        The suite's path.

    Raises:
        InputError: a file cannot be written.
    """
    entries: dict[str, Any] = {}
    robots: dict[str, RobotSpec] = {}
    for failed, note in zip(failures, notes or [""] * len(failures), strict=True):
        name = failed.scenario.task.world.name
        world = Path("worlds") / f"{name}.yaml"
        save_task(failed.scenario.task, path.parent / world)
        entry = _written(failed.scenario, str(world), path.parent, robots).plain()
        entries[name] = {
            **({"note": note} if note else {}),
            **{key: value for key, value in entry.items() if key != "seed"},
            "seeds": [entry["seed"]],
            **({"expect": expectation(failed.run, bound)} if failed.run is not None else {}),
            "baseline": False,
        }
    text = yaml.safe_dump({"schema": 1, "scenarios": entries}, sort_keys=False, allow_unicode=True, width=110)
    write_text(path, text)
    return path


def _written(scenario: Scenario, world: str, folder: Path, robots: dict[str, RobotSpec]) -> Written:
    """Return a scenario in words for a suite in a folder, with its world in a file."""
    words = scenario.written.moved(lambda name: relative(Path.cwd() / name, folder.absolute()))
    pinned = {key: getattr(scenario, key) for key in PINNED}
    settings = {**pinned, **words.settings, "margin": scenario.planned_margin}
    robot = _robot(scenario.robot, folder, robots)
    return dataclasses.replace(words, world=world, task=None, start=None, goal=None, robot=robot, settings=settings)


def expectation(failed: Run, bound: Bound | None = None) -> dict[str, Any]:
    """Return the suite's expectation for a scenario that fails as it did."""
    expected: dict[str, Any] = {"outcome": failed.outcome.key}
    if failed.outcome is Outcome.SUCCEEDED:
        expected["certified"] = failed.succeeded
    if failed.rollout is not None and failed.outcome.with_contact:
        expected["touched"] = first_contact_kind(failed.rollout)
        if bound is None and (cause := cause_of_contact(failed.rollout)):
            expected["cause"] = cause
    if bound is not None:
        expected[bound.metric] = f"{bound.sign} {bound.value!r}"
    return expected


def run_elsewhere(*suites: Path) -> list[str]:
    """Return the fingerprints of all scenarios of suites, run in other processes; a message for an invalid or dead one."""
    places = [(suite.resolve(), index) for suite in suites for index in range(len(load_suite(suite)))]
    with Pool(2) as pool:
        return [done.died or done.value for done in pool.in_order(_fingerprint_from, places)]


def _fingerprint_from(place: tuple[Path, int]) -> str:
    suite, index = place
    try:
        return Attempt.of(scenario_of(load_suite(suite)[index])).fingerprint
    except InputError as error:
        return str(error)


def renamed(scenario: Scenario, name: str, note: str = "") -> Scenario:
    """Return the scenario as suites have it: its world renamed, a note added to the world's source, its margin a number."""
    task = scenario.task
    source = "; ".join(part for part in (task.world.source, note) if part) if note else task.world.source
    world = dataclasses.replace(task.world, name=name, source=source)
    return dataclasses.replace(scenario, task=dataclasses.replace(task, world=world), margin_choice=None)


def scenario_name(text: str) -> str:
    """Turn a text into a valid name of a scenario."""
    return file_name(text, ascii_only=True).lstrip("_.-")[:90] or "failure"


def _robot(robot: RobotSpec, folder: Path, robots: dict[str, RobotSpec]) -> str:
    """Return a robot's name in the catalogue; write any other beside the suite and return its path."""
    if robot.name in list_robots() and load_robot(robot.name) == robot:
        return robot.name
    plain = file_name(robot.name)
    names = (plain if k == 1 else f"{plain}-{k}" for k in itertools.count(1))
    name = next(name for name in names if robots.get(name, robot) == robot)
    if name not in robots:
        robots[name] = robot
        _write_robot(robot, folder / "robots" / f"{name}.yaml")
    return f"robots/{name}.yaml"


def _write_robot(robot: RobotSpec, target: Path) -> None:
    data = {"schema": 1, **dataclasses.asdict(robot)}
    data["footprint"] = footprint_to_dict(robot.footprint)
    text = yaml.safe_dump({key: value for key, value in data.items() if value is not None}, sort_keys=False)
    write_text(target, text)
