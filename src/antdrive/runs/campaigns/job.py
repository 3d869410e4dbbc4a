"""Runs of a campaign: configuration, seed, key, and the command that repeats one alone."""

from __future__ import annotations

import dataclasses
import functools
import hashlib
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

from antdrive.base.document import Location
from antdrive.planners import PLANNERS, load_planner, record_name
from antdrive.robots import RobotSpec
from antdrive.runs.margins.choice import Calibration, with_chosen_margin, with_margin_of
from antdrive.sim.forms import columns_of
from antdrive.sim.policy import usual_perception
from antdrive.sim.scenario import Scenario, identity_text
from antdrive.worlds import Task

KEY_DIGITS = 32  # hexadecimal digits of a key; two of 10^9 runs collide with probability 1e-21


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


@dataclass(frozen=True, eq=False)
class NamedSettings:
    """One combination of smoothing, noise, margin and settings."""

    # fields of `Scenario` by name; the margin may be "auto", and perception None until the world is known
    fields: Mapping[str, Any]
    columns: Mapping[str, Any]  # values of the setting columns
    words: tuple[str, ...] | None  # words for `antdrive run`; None if it lacks an option for one of them
    place: Location  # location of the settings in the campaign

    def among(self, movers: bool) -> NamedSettings:
        """Return the settings with the default perception in a world with or without movers, so that keys include it."""
        if self.fields["perception"] is not None:
            return self
        fields = {**self.fields, "perception": usual_perception(self.fields["map"], movers)}
        return dataclasses.replace(self, fields=fields, columns=columns_of(fields))


@dataclass(frozen=True, eq=False, kw_only=True)
class SweepCase:
    """A configuration: a run's setup without its seed.

    Attributes:
        place: the world with start and goal
        world_hash: canonical hash of the task
        planner: the planner with its options
        robot: the robot
        settings: the settings of the drive
        words: the command that repeats a run, without its seed; None if no command can
        calibration: calibration of the margin "auto"; None: not calibrated yet, or the margin is a number
    """

    place: NamedTask
    world_hash: str
    planner: PlannerVariant
    robot: NamedRobot
    settings: NamedSettings
    words: str | None
    calibration: Calibration | None = None

    def scenario(self, seed: int, margin: float | None = None) -> Scenario:
        """Return the scenario of a run.

        Args:
            seed: the run's seed
            margin: overrides the campaign's margin [m]

        Raises:
            InputError: the planner or an option is unknown, for example because its package is not installed.
            FieldError: a setting is out of range, or the robot does not fit at the start.
        """
        fields, source = self.settings.fields, self.planner.source
        choose = fields["margin"] == "auto" and margin is None
        scenario = Scenario(
            task=self.place.task,
            planner=load_planner(source, **self.planner.given),
            planner_name=record_name(source),
            robot=self.robot.robot,
            seed=seed,
            **{**fields, "margin": 0.0 if choose else fields["margin"] if margin is None else margin},
        )
        if not choose:
            return scenario
        return with_margin_of(scenario, self.calibration) if self.calibration else with_chosen_margin(scenario)

    @property
    def identity(self) -> str:
        """The text behind a run's key: the configuration."""
        planner = self.planner
        # Custom planners change more often than antdrive.
        own = {} if planner.name in PLANNERS else {"planner_version": planner.version}
        fields = {**self.settings.fields, "margin": self.margin}
        return identity_text(self.world_hash, planner.name, planner.options, self.robot.content, fields, **own)

    @functools.cached_property
    def margin(self) -> float | str:
        """The margin as set, which may be auto, else the default [m]."""
        asked: float | str | None = self.settings.fields["margin"]
        return self.scenario(0).planned_margin if asked is None else asked


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


def run_key(identity: str, seed: int) -> str:
    """Return the key of a run: a SHA-256, cut to 32 hexadecimal digits."""
    return hashlib.sha256(f"{identity}\n{seed}".encode()).hexdigest()[:KEY_DIGITS]
