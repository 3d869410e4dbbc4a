"""Options that describe a scenario."""

import dataclasses
import functools
import sys
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, Any

from antdrive.base.checks import grouped
from antdrive.base.errors import FieldError, InputError, input_error
from antdrive.base.progress import bar
from antdrive.base.version import require_physics
from antdrive.cli.console import print_error
from antdrive.cli.options import Planner, Robot, option
from antdrive.cli.parse import numbers, pose

if TYPE_CHECKING:
    from antdrive.sim.scenario import Scenario
    from antdrive.sim.written import Written
    from antdrive.worlds import Task

FRAMES = WORLD_FRAME, MAP_FRAME = "world", "map"
GROUPS = ("planner", "controller")  # groups of `--set GROUP.KEY=VALUE`
TYPICAL_MARGINS = 4  # margins tried by a typical calibration


@dataclass(frozen=True)
class Ends:
    """Options that select a world's task, start and goal."""

    task: Annotated[
        str | None, option("NAME", "Task of the world file.  [default: the main task]", "--task", panel="World")
    ] = None
    start: Annotated[
        str | None, option("X,Y,YAW", "Start pose [m, m, rad or 90deg].  [default: the task's]", panel="World")
    ] = None
    goal: Annotated[str | None, option("X,Y", "Goal [m].  [default: the task's]", panel="World")] = None
    frame: Annotated[
        str,
        option(
            "world|map", "Frame of --start and --goal: world, or map (the frame of the imported map).", panel="World"
        ),
    ] = WORLD_FRAME

    def of(self, world: str) -> "Written":
        """Return a world with this task, start and goal in words; those in the frame of a map move to the world's."""
        from antdrive.sim.written import Written

        if self.frame not in FRAMES:
            raise InputError(f"--frame {self.frame}: unknown; choose from {', '.join(FRAMES)}")
        given = {"start": pose("--start", self.start), "goal": numbers("--goal", self.goal, 2, "X,Y")}
        ends = {key: list(value) for key, value in given.items() if value is not None}
        if ends and self.frame == MAP_FRAME:
            from antdrive.base.plane import map_to_world
            from antdrive.worlds import load_task

            frame = load_task(world, self.task).frame
            ends = {key: map_to_world(frame, [value])[0].tolist() for key, value in ends.items()}
        return Written(world=world, task=self.task, **ends)  # type: ignore[arg-type]

    def task_of(self, world: str) -> "Task":
        """Return the task of a world with this start and goal."""
        words = self.of(world)
        try:
            return words.load_task()
        except FieldError as error:
            raise at_option(words, error.key, error.problem) from None


def at_option(words: "Written", key: str, problem: str) -> InputError:
    """Return the error for a key of a scenario on the command line, with its option."""
    if key in ("world", "robot"):
        return InputError(problem)
    if key in ("start", "goal") and getattr(words, key) is None:
        return input_error(str(words.world), key, problem)
    return InputError(f"{key if key.startswith(GROUPS) else '--' + key.replace('_', '-')}: {problem}")


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

    def scenario(self, place: "Written", given: Mapping[str, Any]) -> "Scenario":
        """Build the scenario of a world from the options and from `given`, which maps keys to settings as in files.

        The margin "auto" calibrates the robot, unless a calibration exists.
        """
        chosen: dict[str, dict[str, str]] = {group: {} for group in GROUPS}
        for text in self.settings or ():
            group, name, value = grouped(text, GROUPS)
            chosen[group][name] = value
        settings = dict(given)
        if chosen["controller"]:
            named = {"name": settings["controller"]} if settings.get("controller") else {}
            settings["controller"] = {**named, **chosen["controller"]}
        seed = settings.pop("seed", place.seed)
        words = dataclasses.replace(
            place, planner=self.planner, options=chosen["planner"], robot=self.robot, settings=settings, seed=seed
        )
        from antdrive.sim.scenario import Scenario

        return Scenario.read(words, at=functools.partial(at_option, words), choose=with_calibrated_margin)


def with_calibrated_margin(scenario: "Scenario") -> "Scenario":
    """Return the scenario with a calibrated margin. Each robot and setting is calibrated once.

    Progress is shown as a bar on a terminal, otherwise as one line.
    """
    from antdrive.runs.margins.choice import DRIVES, known_margin, with_chosen_margin

    conditions = scenario.loss_factors
    if known_margin(conditions) is not None:
        return with_chosen_margin(scenario)
    require_physics()  # before a line says that it drives
    label = f"calibrating {conditions.robot.name}, noise {conditions.noise:g}, smoothing {conditions.smoothing}"
    if not sys.stderr.isatty():
        print_error(f"{label}: about {TYPICAL_MARGINS * DRIVES} short drives, result cached")
    with bar(label) as progress:
        return with_chosen_margin(scenario, lambda done, margin: progress(min(0.99, done / (TYPICAL_MARGINS * DRIVES))))
