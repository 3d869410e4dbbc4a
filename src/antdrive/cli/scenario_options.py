"""Options that describe a scenario."""

import dataclasses
import sys
from collections.abc import Collection, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, Any

from antdrive.base.errors import FieldError, InputError, input_error
from antdrive.base.version import require_physics
from antdrive.cli.console import bar, print_error
from antdrive.cli.options import Planner, Robot, option
from antdrive.cli.parse import numbers, pair, pose

if TYPE_CHECKING:
    from antdrive.sim.scenario import Scenario
    from antdrive.worlds import Task

FRAMES = WORLD_FRAME, MAP_FRAME = "world", "map"
GROUPS = ("planner", "controller")  # groups of `--set GROUP.KEY=VALUE`
TYPICAL_MARGINS = 4  # margins tried by a typical calibration


@dataclass(frozen=True)
class Ends:
    """Options that select a world's task, start and goal."""

    task: Annotated[
        str | None,
        option("NAME", "Task of the world file.  [default: the main task]", "--task", panel="World"),
    ] = None
    start: Annotated[
        str | None,
        option(
            "X,Y,YAW",
            "Start pose [m, m, rad or 90deg].  [default: the task's]",
            panel="World",
        ),
    ] = None
    goal: Annotated[
        str | None,
        option("X,Y", "Goal [m].  [default: the task's]", panel="World"),
    ] = None
    frame: Annotated[
        str,
        option(
            "world|map",
            "Frame of --start and --goal: world, or map (the frame of the imported map).",
            panel="World",
        ),
    ] = WORLD_FRAME

    def of(self, world: str) -> "str | Task":
        """Return the task of a world with this start and goal, or the world's name if no option is given."""
        if self.frame not in FRAMES:
            raise InputError(f"--frame {self.frame}: unknown; choose from {', '.join(FRAMES)}")
        if self.task is None and self.start is None and self.goal is None:
            return world
        from antdrive.base.plane import map_to_world
        from antdrive.worlds import load_task

        ends = {"start": pose("--start", self.start), "goal": numbers("--goal", self.goal, 2, "X,Y")}
        given: dict[str, Any] = {key: value for key, value in ends.items() if value is not None}
        task = load_task(world, self.task)
        try:
            if self.frame == MAP_FRAME:
                given = {key: tuple(map_to_world(task.frame, [value])[0].tolist()) for key, value in given.items()}
            return dataclasses.replace(task, **given)
        except FieldError as error:
            frame = " (in the world frame)" if self.frame == MAP_FRAME and any(task.frame) else ""
            raise InputError(f"--{error.key}: {error.problem}{frame}") from None

    @property
    def words(self) -> list[str]:
        """Command-line arguments that give the same start and goal."""
        given = {"--task": self.task, "--start": self.start, "--goal": self.goal}
        if self.frame != WORLD_FRAME and (self.start is not None or self.goal is not None):
            given["--frame"] = self.frame
        return [f"{option}={value}" for option, value in given.items() if value is not None]


@dataclass(frozen=True)
class Setup:
    """Options that select planner, controller settings and robot."""

    planner: Planner = "ants"
    settings: Annotated[
        list[str] | None,
        option(
            "GROUP.KEY=VALUE",
            "Planner or controller option: planner.ants=50, controller.lookahead_time=0.5. Repeatable.",
            "--set",
            "-s",
            panel="Planner",
        ),
    ] = None
    robot: Robot = "turtlebot"

    def scenario(self, world: "str | Task", given: Mapping[str, Any]) -> "Scenario":
        """Build the scenario from the options and from `given`, which maps keys to settings as in files.

        The margin "auto" calibrates the robot, unless a calibration exists.
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
        values = {**given, "controller": controller, **({"margin": 0.0} if auto else {})}
        try:
            fields = scenario_fields(values)
            scenario = Scenario.of(world, self.planner, self.robot, options=chosen["planner"], **fields)
            return with_chosen_margin(scenario) if auto else scenario
        except FieldError as error:
            if error.key == "start":  # the robot overlaps an obstacle
                raise input_error(world if isinstance(world, str) else world.world.name, str(error)) from None
            option = error.key if error.key.startswith("controller") else f"--{error.key.replace('_', '-')}"
            raise InputError(f"{option}: {error.problem}") from None


def grouped(text: str, groups: Collection[str]) -> tuple[str, str, str]:
    """Parse GROUP.KEY=VALUE of `--set`."""
    key, value = pair(text)
    group, _, name = key.partition(".")
    if group not in groups or not name:
        raise InputError(f"--set {text}: must be GROUP.KEY=VALUE; groups are {', '.join(groups)}")
    return group, name, value


def with_chosen_margin(scenario: "Scenario") -> "Scenario":
    """Return the scenario with a calibrated margin. Each robot and setting is calibrated once.

    Progress is shown as a bar on a terminal, otherwise as one line.
    """
    from antdrive.runs.margins.choice import DRIVES, known_margin
    from antdrive.runs.margins.choice import with_chosen_margin as choose

    conditions = scenario.loss_factors
    if known_margin(conditions) is not None:
        return choose(scenario)
    require_physics()  # before a line says that it drives
    label = f"calibrating {conditions.robot.name}, noise {conditions.noise:g}, smoothing {conditions.smoothing}"
    if not sys.stderr.isatty():
        print_error(f"{label}: about {TYPICAL_MARGINS * DRIVES} short drives, result cached")
    with bar(label) as progress:
        return choose(scenario, lambda done, margin: progress(min(0.99, done / (TYPICAL_MARGINS * DRIVES))))


def random_world(unknown: str, kind: str, seed: int, values: Mapping[str, str], name: str) -> "Task":
    """Generate a random world. `unknown` starts the error message about an unknown kind."""
    import numpy as np

    from antdrive.worlds import GENERATORS, generate

    if kind not in GENERATORS:
        raise InputError(f"{unknown}; choose from {', '.join(GENERATORS)}")
    return generate(kind, np.random.default_rng(seed), values, name=name, note=f"seed {seed}")
