"""From the words of the command line to a scenario."""

import dataclasses
import sys
from collections.abc import Collection, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, Any

from antdrive.base.errors import FieldError, InputError, input_error
from antdrive.cli.compiling import compile_once
from antdrive.cli.console import bar, print_error
from antdrive.cli.options import Planner, Robot, option
from antdrive.cli.parse import numbers, pair

if TYPE_CHECKING:
    from antdrive.sim.scenario import Scenario
    from antdrive.worlds import Task

FRAMES = WORLD_FRAME, MAP_FRAME = "world", "map"  # of the places that people give
GROUPS = ("planner", "controller")  # what `--set GROUP.KEY=VALUE` can set
TYPICAL_MARGINS = 4  # margins that a calibration tries, as a rule


@dataclass(frozen=True)
class Ends:
    """The options that give a world another start and goal."""

    task: Annotated[
        str | None,
        option("NAME", "One of the world file's tasks.  [default: its own start and goal]", "--task", panel="World"),
    ] = None
    start: Annotated[
        str | None,
        option(
            "X,Y,YAW",
            "Another start, in the frame of the world file [m, m, rad].  [default: the task's]",
            panel="World",
        ),
    ] = None
    goal: Annotated[
        str | None,
        option("X,Y", "Another goal, in the frame of the world file [m].  [default: the task's]", panel="World"),
    ] = None
    frame: Annotated[
        str,
        option(
            "NAME",
            "world, or map: --start and --goal are places in the map that the world was made from, as exports have them.",
            panel="World",
        ),
    ] = WORLD_FRAME

    def of(self, world: str) -> "str | Task":
        """The world with this start and goal; its name where none are given."""
        if self.frame not in FRAMES:
            raise InputError(f"--frame {self.frame}: choose from {', '.join(FRAMES)}")
        if self.task is None and self.start is None and self.goal is None:
            return world
        from antdrive.base.plane import map_to_world
        from antdrive.worlds import load_task

        ends = {"start": numbers("--start", self.start, 3, "X,Y,YAW"), "goal": numbers("--goal", self.goal, 2, "X,Y")}
        given: dict[str, Any] = {key: value for key, value in ends.items() if value is not None}
        try:
            found = load_task(world, self.task)
            if self.frame == MAP_FRAME:
                given = {key: tuple(map_to_world(found.frame, [value])[0].tolist()) for key, value in given.items()}
            return dataclasses.replace(found, **given)
        except FieldError as error:
            there = " (places are in the world's frame)" if self.frame == MAP_FRAME and any(found.frame) else ""
            raise InputError(f"--{error.key}: {error.problem}{there}") from None

    @property
    def words(self) -> list[str]:
        """The words of a command that give the same start and goal."""
        given = {"--task": self.task, "--start": self.start, "--goal": self.goal}
        if self.frame != WORLD_FRAME and (self.start is not None or self.goal is not None):
            given["--frame"] = self.frame
        return [f"{option}={value}" for option, value in given.items() if value is not None]


@dataclass(frozen=True)
class Setup:
    """The options that give a scenario its planner and its robot."""

    planner: Planner = "ants"
    settings: Annotated[
        list[str] | None,
        option(
            "GROUP.KEY=VALUE",
            "Set an option of the planner or the controller, such as planner.ants=50 or "
            "controller.lookahead_time=0.5. May be repeated.",
            "--set",
            "-s",
            panel="Planner",
        ),
    ] = None
    robot: Robot = "turtlebot"

    def scenario(self, world: "str | Task", given: Mapping[str, Any]) -> "Scenario":
        """The scenario that a command's options describe; `given` are values of settings by key, as files write them.

        With the margin "auto" the robot is calibrated, if that was not done before.
        """
        from antdrive.planners.registry import parse
        from antdrive.sim.forms import scenario_fields
        from antdrive.sim.scenario import Scenario

        chosen: dict[str, dict[str, str]] = {group: {} for group in GROUPS}
        for text in self.settings or ():
            group, name, value = grouped(text, GROUPS)
            chosen[group][name] = value
        controller = {name: parse(f"controller.{name}", float, text) for name, text in chosen["controller"].items()}
        auto = given.get("margin") == "auto"
        asked = {**given, "controller": controller, **({"margin": 0.0} if auto else {})}
        try:
            fields = scenario_fields(asked)
            scenario = Scenario.of(world, self.planner, self.robot, options=chosen["planner"], **fields)
            return with_chosen_margin(scenario) if auto else scenario
        except FieldError as error:
            if error.key == "start":  # the robot does not fit there
                raise input_error(world if isinstance(world, str) else world.world.name, str(error)) from None
            option = error.key if error.key.startswith("controller") else f"--{error.key.replace('_', '-')}"
            raise InputError(f"{option}: {error.problem}") from None


def grouped(text: str, groups: Collection[str]) -> tuple[str, str, str]:
    """Group, key and value of a `--set GROUP.KEY=VALUE`."""
    key, value = pair(text)
    group, _, name = key.partition(".")
    if group not in groups or not name:
        raise InputError(f"--set {text}: write GROUP.KEY=VALUE with a group of {', '.join(groups)}")
    return group, name, value


def with_chosen_margin(scenario: "Scenario") -> "Scenario":
    """The scenario with a margin chosen by calibration, once for a robot and its settings.

    A bar shows it on a terminal, else a line.
    """
    from antdrive.runs.margins.choice import DRIVES, known_margin
    from antdrive.runs.margins.choice import with_chosen_margin as choose

    conditions = scenario.loss_factors
    if known_margin(conditions) is not None:
        return choose(scenario)
    compile_once()
    label = f"calibrating {conditions.robot.name}, noise {conditions.noise:g}, smoothing {conditions.smoothing}"
    if not sys.stderr.isatty():
        print_error(f"{label}: about {TYPICAL_MARGINS * DRIVES} short drives, once")
    with bar(f"{label}, once") as progress:
        return choose(scenario, lambda done, margin: progress(min(0.99, done / (TYPICAL_MARGINS * DRIVES))))


def random_world(unknown: str, kind: str, seed: int, values: Mapping[str, str], name: str) -> "Task":
    """A random world; `unknown` begins the error for a kind that there is not."""
    import numpy as np

    from antdrive.worlds import GENERATORS, generate

    if kind not in GENERATORS:
        raise InputError(f"{unknown}; choose from {', '.join(GENERATORS)}")
    return generate(kind, np.random.default_rng(seed), values, name=name, note=f"seed {seed}")
