"""From the words of the command line to a scenario."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, get_args

from antdrive.base.errors import FieldError, InputError, input_error
from antdrive.cli.parse import pair

if TYPE_CHECKING:
    from antdrive.robots import PurePursuit
    from antdrive.sim.driving.perception import Perception
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


def make_scenario(world: str | Task, planner: str, settings: list[str] | None, robot: str, **rest: Any) -> Scenario:
    """The scenario that a command's options describe; `rest` are fields of `Scenario`.

    With the margin "auto" the robot is calibrated, if that was not done before.

    Raises:
        InputError: an unknown name, or a value out of range; the message names the option.
    """
    from antdrive.cli.calibrating import with_chosen_margin
    from antdrive.sim.scenario import Scenario

    chosen = grouped(settings)
    controller = make_controller(chosen["controller"])
    auto = rest.get("margin") == "auto"
    given = {**rest, "margin": 0.0} if auto else rest
    try:
        scenario = Scenario.of(world, planner, robot, options=chosen["planner"], controller=controller, **given)
        return with_chosen_margin(scenario) if auto else scenario
    except FieldError as error:
        if error.key == "start":  # the robot does not fit there
            raise input_error(world if isinstance(world, str) else world.world.name, str(error)) from None
        raise InputError(f"--{error.key.replace('_', '-')}: {error.problem}") from None


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


def make_controller(values: dict[str, str]) -> PurePursuit:
    """The controller with these values, given as text."""
    import dataclasses

    from antdrive.planners.registry import parse
    from antdrive.robots import PurePursuit

    known = [field.name for field in dataclasses.fields(PurePursuit)]
    for name in values:
        if name not in known:
            raise InputError(f"controller.{name}: unknown; choose from {', '.join(known)}")
    try:
        return PurePursuit(**{name: parse(f"controller.{name}", float, value) for name, value in values.items()})
    except InputError:
        raise
    except ValueError as error:
        raise InputError(f"controller.{error}") from None


def among_movers(avoid: bool, replan: bool, sees: str | None) -> dict[str, Any]:
    """The fields of a scenario that say how the robot drives among movers."""
    from antdrive.sim.driving.replanning import ReplanPolicy

    avoidance = {} if avoid else {"avoidance": None}  # the default is a record of weights
    return {
        "perception": make_perception(sees) if sees else None,
        "replanning": ReplanPolicy(around_movers=replan),
        **avoidance,
    }


def make_perception(text: str) -> Perception:
    """What the robot perceives of movers, from `--sees KIND[:METRES]`."""
    from antdrive.sim.driving.perception import Perception, PerceptionKind

    kind, mark, metres = text.partition(":")
    if kind not in get_args(PerceptionKind):
        raise InputError(f"--sees {text}: unknown kind {kind!r}; choose from {', '.join(get_args(PerceptionKind))}")
    try:
        distance = float(metres) if mark else math.inf
    except ValueError:
        distance = math.nan
    if not distance > 0:
        raise InputError(f"--sees {text}: write KIND or KIND:METRES with a range greater than 0, such as positions:3")
    return Perception(kind=kind, range=distance)  # type: ignore[arg-type]
