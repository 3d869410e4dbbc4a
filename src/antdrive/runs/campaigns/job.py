"""The runs of a campaign: what each depends on, as the campaign calls it, its key, and the command that repeats it alone."""

from __future__ import annotations

import dataclasses
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

KEY_DIGITS = 32  # hexadecimal digits of a key: two runs of a billion have the same one with probability 1e-21


@dataclass(frozen=True, eq=False)
class NamedTask:
    """A world with start and goal, as a campaign calls it."""

    world: str  # what the campaign calls the world
    name: str  # what the campaign calls start and goal
    task: Task  # the task
    catalogue: str | None  # the world's name in the catalogue, if the task is the one of the catalogue
    place: Location  # where the campaign names the world
    others: Mapping[str, Task] = field(default_factory=dict)  # the other tasks that the world's file lists, by name


@dataclass(frozen=True, eq=False)
class PlannerVariant:
    """A planner with options."""

    label: str  # what tables call it, such as "aco-han ants=50"
    name: str  # its registered name; for people's own code the file's or module's name and that of the class
    source: str  # what `load_planner` takes for it
    word: str  # what commands within the campaign's folder call it
    file: Path | None  # its file; None: it is registered or in a module
    version: str  # what its code is
    given: Mapping[str, Any]  # the options that the campaign sets
    options: Mapping[str, Any]  # all its options as plain values


@dataclass(frozen=True, eq=False)
class NamedRobot:
    """A robot as a campaign and its commands call it."""

    robot: RobotSpec  # the robot
    name: str  # what tables call it: its own name, or its file where another robot of the campaign has that name, too
    content: str  # its canonical hash
    word: str  # what commands call it
    file: Path | None  # its file; None: it is of the catalogue


@dataclass(frozen=True, eq=False)
class NamedSettings:
    """One combination of smoothing, noise, margin and settings."""

    # fields of `Scenario` by name; the margin may be "auto", and perception None until the world is known
    fields: Mapping[str, Any]
    columns: Mapping[str, Any]  # what tables say of them, by column
    words: tuple[str, ...] | None  # the words of `antdrive run` for them; None where it has no flags for all
    place: Location  # where in the campaign the settings are written

    def among(self, movers: bool) -> NamedSettings:
        """The settings with what robots perceive in a world with movers, or without; so keys name what is driven."""
        if self.fields["perception"] is not None:
            return self
        fields = {**self.fields, "perception": usual_perception(self.fields["map"], movers)}
        return dataclasses.replace(self, fields=fields, columns=columns_of(fields))


@dataclass(frozen=True, eq=False, kw_only=True)
class SweepCase:
    """A configuration: all that the runs of a campaign depend on which differ in their seeds alone.

    Attributes:
        place: the world with start and goal
        world_hash: the canonical hash of the task
        planner: the planner with its options
        robot: the robot
        settings: how it drives
        words: the words of the command that repeats a run, without its seed; None where no command can
        calibration: what the margin "auto" was chosen by; None: not chosen yet, or the margin is a number
    """

    place: NamedTask
    world_hash: str
    planner: PlannerVariant
    robot: NamedRobot
    settings: NamedSettings
    words: str | None
    calibration: Calibration | None = None

    def scenario(self, seed: int, margin: float | None = None) -> Scenario:
        """The scenario of a run.

        Args:
            seed: the run's seed
            margin: a margin instead of the campaign's [m]

        Raises:
            InputError: there is no such planner or option here, such as one of a package that is not installed.
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
        """The text that keys are made from: everything that the runs depend on but the seed."""
        planner = self.planner
        # People's own planners change more often than antdrive.
        own = {} if planner.name in PLANNERS else {"planner_version": planner.version}
        return identity_text(
            self.world_hash, planner.name, planner.options, self.robot.content, self.settings.fields, **own
        )


class Job(NamedTuple):
    """One run of a campaign.

    Attributes:
        key: the run's name: a hash of everything that it depends on
        case: everything that it depends on but the seed
        seed: the seed of all its random numbers
    """

    key: str
    case: SweepCase
    seed: int


def run_key(identity: str, seed: int) -> str:
    """The key of a run: a SHA-256, cut to 32 hexadecimal digits."""
    return hashlib.sha256(f"{identity}\n{seed}".encode()).hexdigest()[:KEY_DIGITS]
