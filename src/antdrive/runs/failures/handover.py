"""Failing scenarios as files: worlds, robots and a suite that expects each to fail in the same way."""

from __future__ import annotations

import dataclasses
import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import yaml

from antdrive.base.atomic import write_text
from antdrive.base.errors import InputError
from antdrive.base.files import file_name, relative
from antdrive.planners import list_planners, load_planner
from antdrive.robots import RobotSpec, list_robots, load_robot
from antdrive.robots.robot_file import footprint_to_dict
from antdrive.runs.failures.failure import Attempt
from antdrive.runs.pool import Pool
from antdrive.runs.suites.demands import Bound
from antdrive.runs.suites.names import is_own_entry
from antdrive.runs.suites.nearest import cause_of_contact, first_contact_kind
from antdrive.runs.suites.scenarios import scenario_of
from antdrive.runs.suites.suite import SuiteCase, load_suite
from antdrive.sim.forms import written
from antdrive.sim.log.outcome import Outcome
from antdrive.sim.log.record import changes
from antdrive.sim.pipeline import Run
from antdrive.sim.scenario import Scenario
from antdrive.worlds import save_task

#: Settings written even at their defaults, so that the test survives a change of defaults.
PINNED = ("smoothing", "noise")


@dataclass(frozen=True, eq=False)
class Handover:
    """A failing run under a name.

    Attributes:
        name: name of the scenario in the suite, and of its world file
        failed: the attempt that failed
        bound: the metric's bound that it crosses, if that is its failure
        note: remark for readers; may be empty
        planner: the planner as the suite writes it, such as {file: ../mine.py, name: Mine}; None: by its name
    """

    name: str
    failed: Attempt
    bound: Bound | None = None
    note: str = ""
    planner: str | Mapping[str, Any] | None = None


def write_suite(path: Path, handovers: Sequence[Handover]) -> Path:
    """Write a suite, its worlds, and the robots that are not in the catalogue.

    The suite has no baselines: it passes as long as the scenarios fail in the same way. A scenario whose planner raises an
    error is expected to succeed, as no outcome covers errors; its test fails until the planner is fixed.

    Args:
        path: the suite's file; its name ends in .drive.yaml
        handovers: the failures, with different names

    Returns:
        The suite's path.

    Raises:
        InputError: a file cannot be written.
    """
    entries: dict[str, Any] = {}
    robots: dict[str, RobotSpec] = {}
    for handover in handovers:
        failed = handover.failed
        scenario = failed.scenario
        world = Path("worlds") / f"{handover.name}.yaml"
        save_task(scenario.task, path.parent / world)
        entries[handover.name] = {
            **({"note": handover.note} if handover.note else {}),
            "world": str(world),
            **suite_entry(scenario, _robot(scenario.robot, path.parent, robots)),
            **({"planner": handover.planner} if handover.planner else {}),
            **({"expect": expectation(failed.run, handover.bound)} if failed.run is not None else {}),
            "baseline": False,
        }
    text = yaml.safe_dump({"schema": 1, "scenarios": entries}, sort_keys=False, allow_unicode=True, width=110)
    write_text(path, text)
    return path


def suite_entry(scenario: Scenario, robot: str) -> dict[str, Any]:
    """Return a scenario as plain data with the keys of a suite, without its world and expectations."""
    return {
        "robot": robot,
        "planner": planner_words(scenario),
        **{key: getattr(scenario, key) for key in PINNED},
        "margin": scenario.planned_margin,
        **{key: value for key, value in written(lambda name: getattr(scenario, name)).items() if key != "seed"},
        "seeds": [int(scenario.seed)],
    }


def planner_beside(
    case: SuiteCase | None, own: str | None, scenario: Scenario, folder: Path
) -> str | dict[str, Any] | None:
    """Return the planner of a test or a log as a suite in `folder` writes it; None if it is registered."""
    if case is not None:
        return _planner_moved(case.entry.planner, case.suite.parent, folder)
    return None if own is None else _planner_moved(planner_words(scenario, own), Path.cwd(), folder.absolute())


def _planner_moved(given: str | Mapping[str, Any], home: Path, folder: Path) -> str | dict[str, Any] | None:
    """Rewrite a suite's entry of a custom planner for a suite in another folder; None for a registered planner."""
    if not is_own_entry(given):
        return None
    words = {"name": given} if isinstance(given, str) else dict(given)
    file, mark, word = words["name"].rpartition(":")
    if "file" in words:
        words["file"] = relative(home / words["file"], folder)
    elif mark and file.endswith(".py"):
        words["name"] = f"{relative(home / file, folder)}:{word}"
    return words if len(words) > 1 else str(words["name"])


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


def planner_words(scenario: Scenario, own: str | None = None) -> str | dict[str, Any]:
    """Return a planner as a suite writes it: its name, with the options that differ from its defaults."""
    name = own or scenario.planner_label
    planner: Any = scenario.planner
    usual: Any = load_planner(own) if own else list_planners().get(name)
    options = changes(planner, usual) if dataclasses.is_dataclass(planner) and type(planner) is type(usual) else {}
    return {"name": name, **options} if options else name


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
