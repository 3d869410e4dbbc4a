"""From the words of the command line to a scenario."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from antdrive.base.errors import FieldError, InputError, input_error
from antdrive.cli.parse import pair

if TYPE_CHECKING:
    from antdrive.sim.scenario import Scenario
    from antdrive.worlds import Task

FRAMES = WORLD_FRAME, MAP_FRAME = "world", "map"  # of the places that people give
GROUPS = ("planner", "controller")  # what `--set GROUP.KEY=VALUE` can set


def chosen_task(
    world: str, task: str | None, start: str | None, goal: str | None, frame: str = WORLD_FRAME
) -> str | Task:
    """The world with the start and goal that options give; its name where they give none.

    Raises:
        InputError: there is no such task, or the place is not in free ground; the message names the option.
    """
    if frame not in FRAMES:
        raise InputError(f"--frame {frame}: choose from {', '.join(FRAMES)}")
    if task is None and start is None and goal is None:
        return world
    import dataclasses

    from antdrive.base.plane import out_of_map
    from antdrive.cli.parse import numbers
    from antdrive.worlds import load_task

    ends = {"start": numbers("--start", start, 3, "X,Y,YAW"), "goal": numbers("--goal", goal, 2, "X,Y")}
    given: dict[str, Any] = {key: value for key, value in ends.items() if value is not None}
    try:
        found = load_task(world, task)
        if frame == MAP_FRAME:
            given = {key: tuple(out_of_map(found.frame, [value])[0].tolist()) for key, value in given.items()}
        return dataclasses.replace(found, **given)
    except FieldError as error:
        there = " (places are in the world's frame)" if frame == MAP_FRAME and any(found.frame) else ""
        raise InputError(f"--{error.key}: {error.problem}{there}") from None


def ends_words(task: str | None, start: str | None, goal: str | None, frame: str = WORLD_FRAME) -> list[str]:
    """The words of a command that give the same start and goal."""
    given = {"--task": task, "--start": start, "--goal": goal}
    if frame != WORLD_FRAME and (start is not None or goal is not None):
        given["--frame"] = frame
    return [f"{option}={value}" for option, value in given.items() if value is not None]


def make_scenario(
    world: str | Task, planner: str, settings: list[str] | None, robot: str, given: Mapping[str, Any]
) -> Scenario:
    """The scenario that a command's options describe; `given` are values of settings by key, as files write them.

    With the margin "auto" the robot is calibrated, if that was not done before.

    Raises:
        InputError: an unknown name, or a value out of range; the message names the option.
    """
    from antdrive.cli.calibrating import with_chosen_margin
    from antdrive.sim.forms import scenario_fields
    from antdrive.sim.scenario import Scenario

    chosen = grouped(settings)
    auto = given.get("margin") == "auto"
    asked = {**given, "controller": _numbers(chosen["controller"]), **({"margin": 0.0} if auto else {})}
    try:
        scenario = Scenario.of(world, planner, robot, options=chosen["planner"], **scenario_fields(asked))
        return with_chosen_margin(scenario) if auto else scenario
    except FieldError as error:
        if error.key == "start":  # the robot does not fit there
            raise input_error(world if isinstance(world, str) else world.world.name, str(error)) from None
        option = "" if error.key.startswith("controller") else "--"
        raise InputError(f"{option}{error.key.replace('_', '-') if option else error.key}: {error.problem}") from None


def grouped(settings: list[str] | None) -> dict[str, dict[str, str]]:
    """The values of every `--set GROUP.KEY=VALUE`, as text, by group and key."""
    groups: dict[str, dict[str, str]] = {group: {} for group in GROUPS}
    for text in settings or ():
        key, value = pair(text)
        group, _, name = key.partition(".")
        if group not in groups or not name:
            raise InputError(f"--set {text}: write GROUP.KEY=VALUE with a group of {', '.join(GROUPS)}")
        groups[group][name] = value
    return groups


def _numbers(values: dict[str, str]) -> dict[str, float]:
    """The settings of the controller, given as text."""
    from antdrive.planners.registry import parse

    return {name: parse(f"controller.{name}", float, value) for name, value in values.items()}
