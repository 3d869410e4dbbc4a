"""Runs of a campaign: configuration, seed, key, and the command that repeats one alone."""

from __future__ import annotations

import dataclasses
import functools
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

from antdrive.base.document import Location
from antdrive.planners import PLANNERS, load_planner
from antdrive.robots import RobotSpec
from antdrive.runs.margins.choice import Calibration, with_chosen_margin, with_margin_of
from antdrive.sim.forms import columns_of
from antdrive.sim.scenario import Scenario, unchosen
from antdrive.sim.settings import SETTINGS
from antdrive.sim.written import Written
from antdrive.worlds import Task


class TaskOrigin(NamedTuple):
    """The part of a floor from which random tasks were drawn."""

    share: float  # fraction of the connected floor
    outlined: tuple[str, ...]  # names of the robots that reach it by their footprint; the others by their disc


@dataclass(frozen=True, eq=False)
class NamedTask:
    """A world with start and goal, under the campaign's names."""

    world: str  # the world's name in the campaign
    name: str  # the task's name in the campaign
    task: Task  # the task
    catalogue: str | None  # the world's name in the catalogue, if the task is the catalogue's
    place: Location  # location of the world in the campaign
    others: Mapping[str, Task] = field(default_factory=dict)  # the world file's other tasks, by name
    skip: bool = False  # whether to skip the task if the robot does not fit at its start
    origin: TaskOrigin | None = None  # origin of a random task


@dataclass(frozen=True, eq=False)
class PlannerVariant:
    """A planner with options."""

    label: str  # its name in tables, such as "aco-han ants=50"
    name: str  # its registered name; for custom code the name of the file or module and that of the class
    source: str  # argument of `load_planner`
    word: str  # its name in commands run in the campaign's folder
    file: Path | None  # its file; None if registered or in a module
    version: str  # version of its code
    given: Mapping[str, Any]  # options that the campaign sets
    options: Mapping[str, Any]  # all options as plain values


@dataclass(frozen=True, eq=False)
class NamedRobot:
    """A robot under its names in the campaign and its commands."""

    robot: RobotSpec  # the robot
    name: str  # its name in tables: its own, or its file if another robot has the same name
    content: str  # its canonical hash
    word: str  # its name in commands
    file: Path | None  # its file; None: a robot of the catalogue


class Resolved(NamedTuple):
    """What follows from a configuration."""

    identity: str  # the text behind a run's key
    columns: Mapping[str, Any]  # values of the setting columns; the margin as asked
    margin: float | str  # the margin as set, which may be auto, else the default [m]


@dataclass(frozen=True, eq=False, kw_only=True)
class SweepCase:
    """A configuration: a run's setup without its seed.

    Attributes:
        place: the world with start and goal
        world_hash: canonical hash of the task
        planner: the planner with its options
        robot: the robot
        written: the configuration in the words of a command run in the campaign's folder
        settings: its settings, with the controller's file where the campaign has it
        calibration: calibration of the margin "auto"; None: not calibrated yet, or the margin is a number
    """

    place: NamedTask
    world_hash: str
    planner: PlannerVariant
    robot: NamedRobot
    written: Written
    settings: Mapping[str, Any]
    calibration: Calibration | None = None

    def scenario(self, seed: int, choose: Callable[[Scenario], Scenario] | None = None) -> Scenario:
        """Return the scenario of a run.

        Args:
            seed: the run's seed
            choose: chooses the margin "auto"; None: by calibration

        Raises:
            InputError: the planner or an option is unknown, for example because its package is not installed.
            FieldError: a setting is out of range, or the robot does not fit at the start.
        """
        if choose is None:
            choose = (
                functools.partial(with_margin_of, calibration=self.calibration)
                if self.calibration
                else with_chosen_margin
            )
        planner = load_planner(self.planner.source, **self.planner.given)
        words = dataclasses.replace(self.written, settings=self.settings, seed=seed)
        return Scenario.read(words, choose=choose, task=self.place.task, planner=planner, robot=self.robot.robot)

    @functools.cached_property
    def resolved(self) -> Resolved:
        """What follows from the configuration, made once."""
        s, planner = self.scenario(0, unchosen), self.planner
        asked: float | str | None = self.written.settings.get("margin")
        margin = s.planned_margin if asked is None else asked
        fields = {name: getattr(s, name) for name in SETTINGS if name != "seed"}
        columns = columns_of({**fields, "margin": asked, "perception": s.known_perception})
        # Custom planners change more often than antdrive.
        own = {} if planner.name in PLANNERS else {"planner_version": planner.version}
        known = {"task": self.world_hash, "robot": self.robot.content, "planner": planner.name, "margin": margin}
        return Resolved(s.identity(**known, **own), columns, margin)


class Job(NamedTuple):
    """One run of a campaign.

    Attributes:
        key: the run's name, a hash of its configuration and seed
        case: its configuration
        seed: seed of all its random numbers
    """

    key: str
    case: SweepCase
    seed: int
