"""Build a test's scenario, and the command that runs it alone."""

from __future__ import annotations

import dataclasses
import shlex
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from antdrive.base.checks import show
from antdrive.base.errors import FieldError, InputError
from antdrive.robots import list_robots, load_robot
from antdrive.runs.margins.choice import with_chosen_margin
from antdrive.runs.suites.names import case_settings, is_own_entry, planner_of, robot_path, world_path
from antdrive.runs.suites.suite import SuiteCase, shown_path
from antdrive.sim.forms import option_text, scenario_fields, setting_words
from antdrive.sim.scenario import Scenario
from antdrive.worlds import Task, list_worlds, load_task
from antdrive.worlds.generators.generate import generated


def scenario_of(case: SuiteCase, choose: Callable[[Scenario], Scenario] = with_chosen_margin) -> Scenario:
    """Return the scenario of a suite's test.

    Recently read files of worlds and robots are cached by their text.

    Args:
        case: the test
        choose: chooses the margin if the suite says auto

    Raises:
        InputError: an item of the suite is missing or invalid; the message has the suite's file, line and key.
    """
    given = case_settings(case)
    auto = given.get("margin") == "auto"
    planner, name = planner_of(case)
    task = _with_ends(case, task_of(case))
    try:
        fields = {**scenario_fields(given), "seed": case.seed, **({"margin": 0.0} if auto else {})}
        scenario = Scenario(task=task, planner=planner, planner_name=name, robot=load_robot(robot_path(case)), **fields)
        return choose(scenario) if auto else scenario
    except FieldError as error:
        raise case.error(error.key, error.problem) from None


def task_of(case: SuiteCase) -> Task:
    """Return the task of a test, without the test's own start and goal."""
    world, name = case.entry.world, case.entry.task
    if isinstance(world, str):
        return load_task(world_path(case, world), name)
    if name is not None:
        raise case.error("task", "a random world has no named tasks")
    options = dict(world)
    kind, seed = options.pop("generate", None), options.pop("seed", 0)
    if not isinstance(kind, str):
        raise case.error("world", "write a file, a name of the catalogue, or {generate: forest, seed: 7}")
    if type(seed) is not int or not 0 <= seed < 2**63:
        raise case.error("world.seed", f"must be a whole number of at least 0, got {show(seed)}")
    try:
        return generated(kind, seed, tuple((key, option_text(value)) for key, value in options.items()))
    except InputError as error:
        raise case.error("world", str(error)) from None


def run_command(case: SuiteCase, *, anywhere: bool = False) -> str | None:
    """Return the `antdrive run` command of a test's scenario; None if only `antdrive check` can run it."""
    entry = case.entry
    planner = {"name": entry.planner} if isinstance(entry.planner, str) else dict(entry.planner)
    word, settings = _planner_word(case, planner, anywhere), setting_words(case_settings(case))
    if settings is None or word is None:
        return None
    world, before = _world_words(case, anywhere)
    words = ["antdrive", "run", world, "--planner", word]
    words += [word for key, value in planner.items() for word in ("--set", f"planner.{key}={option_text(value)}")]
    words += ["--robot", _shown_name(case, entry.robot, list_robots(), anywhere), "--seed", str(case.seed)]
    words += [] if entry.task is None else ["--task", entry.task]
    ends = {"--start": entry.start, "--goal": entry.goal}
    words += [word for key, at in ends.items() if at is not None for word in (key, ",".join(map(str, at)))]
    return before + shlex.join([*words, *settings])


def _planner_word(case: SuiteCase, planner: dict[str, Any], anywhere: bool) -> str | None:
    """Pop a planner's name and source; return it as commands write it, None for a package that they do not find."""
    name = planner.pop("name")
    if not is_own_entry({"name": name, **planner}):
        return str(name)
    file, module = planner.pop("file", ""), planner.pop("module", "")
    source, word = (file or module, name) if file or module else name.rpartition(":")[::2]
    if not (file or source.endswith(".py")):
        if not _is_beside(case, source) or (case.suite.parent == Path.cwd() and not anywhere):
            return f"{source}:{word}"
        source = f"{source}.py"
    if not source.endswith(".py") or not (case.suite.parent / source).is_file():
        return None
    return f"{_shown_name(case, source, {}, anywhere)}:{word}"


def _is_beside(case: SuiteCase, module: str) -> bool:
    """Return whether a module's file or package lies beside the suite."""
    top = case.suite.parent / module.partition(".")[0]
    return top.is_dir() or top.with_suffix(".py").is_file()


def _world_words(case: SuiteCase, anywhere: bool) -> tuple[str, str]:
    """Return a world's name in commands, and the command that generates a random one first."""
    world = case.entry.world
    if isinstance(world, str):
        return _shown_name(case, world, list_worlds(), anywhere), ""
    options = dict(world)
    kind, seed = options.pop("generate"), options.pop("seed", 0)
    name = f"{kind}-{seed}.yaml"
    words = ["antdrive", "worlds", "generate", kind, "--seed", str(seed), "--out", name]
    words += [word for key, value in options.items() for word in ("--set", f"{key}={option_text(value)}")]
    return name, f"{shlex.join(words)} && "


def _shown_name(case: SuiteCase, name: str, known: Mapping[str, Path], anywhere: bool) -> str:
    if name in known:
        return name
    path = (case.suite.parent / name).resolve()
    return str(path) if anywhere else shown_path(path)


def _with_ends(case: SuiteCase, task: Task) -> Task:
    """Return the task with the test's own start and goal."""
    start, goal = case.entry.start, case.entry.goal
    try:
        if start is not None:
            task = dataclasses.replace(task, start=(start[0], start[1], start[2]))
        if goal is not None:
            task = dataclasses.replace(task, goal=(goal[0], goal[1]))
    except FieldError as error:
        raise case.error(error.key, error.problem) from None
    return task
