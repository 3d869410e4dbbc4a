"""From a suite's words to a scenario, and to the command that runs it alone."""

from __future__ import annotations

import dataclasses
import functools
import math
import shlex
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, get_args

from antdrive.robots import Avoidance, PurePursuit, RobotSpec, list_robots, load_robot
from antdrive.sim.driving.perception import Perception, PerceptionKind
from antdrive.sim.driving.replanning import ReplanPolicy
from antdrive.sim.regression.names import SOURCES, planner_of, robot_path, world_path
from antdrive.sim.regression.suite import SuiteCase, shown_path
from antdrive.sim.scenario import Scenario
from antdrive.worlds import Disc, Task, generate, list_worlds, load_task
from antdrive.worlds.errors import FieldError, InputError
from antdrive.worlds.files.checks import show, suggest


def scenario_of(case: SuiteCase, choose: Callable[[Scenario], Scenario] = Scenario.with_chosen_margin) -> Scenario:
    """The scenario of a suite's test.

    Worlds and robots are read once per process.

    Args:
        case: the test
        choose: chooses the margin where the suite says auto

    Raises:
        InputError: something that the suite names is missing or wrong; the message has the suite's file, line and key.
    """
    entry, auto = case.entry, case.entry.margin == "auto"
    planner, name = planner_of(case)
    task = _with_ends(case, task_of(case))
    try:
        scenario = Scenario.of(
            task,
            planner,
            robot_of(case),
            margin=0.0 if auto else entry.margin,
            cell=entry.cell,
            smoothing=entry.smoothing,
            seed=case.seed,
            controller=_settings(case, "controller", PurePursuit(), entry.controller),
            noise=entry.noise,
            perception=_perception(case),
            avoidance=None if entry.avoid in (False, "none") else _settings(case, "avoid", Avoidance(), entry.avoid),
            replanning=_replanning(case),
            unseen=tuple(Disc(disc.x, disc.y, disc.radius, disc.height) for disc in entry.unseen),
            time_limit=entry.time_limit,
            physics_hz=entry.physics_hz,
            control_hz=entry.control_hz,
        )
        return dataclasses.replace(choose(scenario) if auto else scenario, planner_name=name)
    except FieldError as error:
        raise case.error(error.key, error.problem) from None


def task_of(case: SuiteCase) -> Task:
    """The world of a test, with the world's own start and goal.

    Raises:
        InputError: there is no such world, or something in its file is wrong.
    """
    world = case.entry.world
    if isinstance(world, str):
        path = world_path(case, world)
        return _read_task(str(path), path.stat().st_mtime_ns)
    options = dict(world)
    kind, seed = options.pop("generate", None), options.pop("seed", 0)
    if not isinstance(kind, str):
        raise case.error("world", "write a file, a name of the catalogue, or {generate: forest, seed: 7}")
    if type(seed) is not int or not 0 <= seed < 2**63:
        raise case.error("world.seed", f"must be a whole number of at least 0, got {show(seed)}")
    try:
        return _generated(kind, seed, tuple((key, _option_text(value)) for key, value in options.items()))
    except InputError as error:
        raise case.error("world", str(error)) from None


def robot_of(case: SuiteCase) -> RobotSpec:
    """The robot of a test.

    Raises:
        InputError: there is no such robot, or something in its file is wrong.
    """
    path = robot_path(case)
    return _read_robot(str(path), path.stat().st_mtime_ns)


def run_command(case: SuiteCase) -> str | None:
    """The `antdrive run` command that drives a test's scenario alone; None where only `antdrive check` can."""
    entry = case.entry
    plain = isinstance(entry.replan, bool) and not isinstance(entry.avoid, dict)
    planner = {"name": entry.planner} if isinstance(entry.planner, str) else dict(entry.planner)
    usual = entry.physics_hz == 240 and entry.control_hz == 60 and entry.start is None and entry.goal is None
    flat = all(disc.height == 1.0 for disc in entry.unseen)
    if not (plain and usual and flat) or any(key in planner for key in SOURCES):
        return None
    world, before = _world_words(case)
    words = ["antdrive", "run", world, "--planner", planner.pop("name")]
    for group, settings in (("planner", planner), ("controller", entry.controller)):
        words += [word for key, value in settings.items() for word in ("--set", f"{group}.{key}={_option_text(value)}")]
    words += ["--robot", _shown_name(case, entry.robot, list_robots()), "--seed", str(case.seed)]
    for key in ("margin", "smoothing", "noise", "cell", "time_limit", "sees"):
        if key in entry.model_fields_set and getattr(entry, key) is not None:
            words += [f"--{key.replace('_', '-')}", _option_text(getattr(entry, key))]
    words += [word for disc in entry.unseen for word in ("--unseen", f"{disc.x},{disc.y},{disc.radius}")]
    words += [f"--no-{key}" for key in ("avoid", "replan") if getattr(entry, key) in (False, "none")]
    return before + shlex.join(words)


def _world_words(case: SuiteCase) -> tuple[str, str]:
    """What a command calls the world of a test, and the command that must write a random one before."""
    world = case.entry.world
    if isinstance(world, str):
        return _shown_name(case, world, list_worlds()), ""
    options = dict(world)
    kind, seed = options.pop("generate"), options.pop("seed", 0)
    name = f"{kind}-{seed}.yaml"
    words = ["antdrive", "worlds", "generate", kind, "--seed", str(seed), "--out", name]
    words += [word for key, value in options.items() for word in ("--set", f"{key}={_option_text(value)}")]
    return name, f"{shlex.join(words)} && "


def _shown_name(case: SuiteCase, name: str, known: Mapping[str, Path]) -> str:
    return name if name in known else shown_path((case.suite.parent / name).resolve())


@functools.lru_cache(maxsize=1024)
def _read_task(path: str, mtime: int) -> Task:
    return load_task(Path(path))


@functools.lru_cache(maxsize=1024)
def _read_robot(path: str, mtime: int) -> RobotSpec:
    return load_robot(Path(path))


@functools.lru_cache(maxsize=1024)
def _generated(kind: str, seed: int, options: tuple[tuple[str, str], ...]) -> Task:
    import numpy as np

    return generate(kind, np.random.default_rng(seed), dict(options), name=f"{kind}-{seed}", note=f"seed {seed}")


def _option_text(value: Any) -> str:
    """A value as the command line takes it."""
    if isinstance(value, list):
        return ",".join(map(_option_text, value))
    return str(value).lower() if isinstance(value, bool) else str(value)


def _with_ends(case: SuiteCase, task: Task) -> Task:
    """The task with the test's own start and goal."""
    start, goal = case.entry.start, case.entry.goal
    try:
        if start is not None:
            task = dataclasses.replace(task, start=(start[0], start[1], start[2]))
        if goal is not None:
            task = dataclasses.replace(task, goal=(goal[0], goal[1]))
    except FieldError as error:
        raise case.error(error.key, error.problem) from None
    return task


def _settings(case: SuiteCase, key: str, default: Any, values: Any) -> Any:
    """A record of settings with some of them replaced."""
    if not isinstance(values, dict):
        return default
    known = [field.name for field in dataclasses.fields(default)]
    for name in values:
        if name not in known:
            raise case.error(f"{key}.{name}", f"unknown setting; {suggest(name, known)}")
    try:
        return dataclasses.replace(default, **values)
    except FieldError as error:
        raise case.error(f"{key}.{error.key}", error.problem) from None
    except TypeError:
        wrong = next((name for name, value in values.items() if not isinstance(value, int | float)), "")
        raise case.error(f"{key}.{wrong}" if wrong else key, "must be a number") from None


def _replanning(case: SuiteCase) -> ReplanPolicy | None:
    replan = case.entry.replan
    if replan == "none":
        return None
    policy: ReplanPolicy = _settings(case, "replan", ReplanPolicy(), replan)
    return dataclasses.replace(policy, around_movers=False) if replan is False else policy


def _perception(case: SuiteCase) -> Perception:
    kind, mark, metres = case.entry.sees.partition(":")
    if kind not in get_args(PerceptionKind):
        raise case.error("sees", f"unknown kind {kind!r}; choose from {', '.join(get_args(PerceptionKind))}")
    try:
        reach = float(metres) if mark else math.inf
    except ValueError:
        reach = math.nan
    if not reach > 0:
        raise case.error("sees", "write KIND or KIND:METRES with a range greater than 0, such as positions:3")
    return Perception(kind=kind, range=reach)  # type: ignore[arg-type]
