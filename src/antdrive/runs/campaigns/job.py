"""One run of a campaign: what it depends on, the key that names it, and the command that repeats it alone."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

from antdrive.planners import PLANNERS, load_planner, record_name
from antdrive.robots import RobotSpec
from antdrive.runs.margins.choice import with_chosen_margin, with_margin_of
from antdrive.runs.margins.prediction import Calibration
from antdrive.sim.scenario import Scenario, identity_text
from antdrive.worlds import Task

KEY_DIGITS = 32  # hexadecimal digits of a key: two runs of a billion have the same one with probability 1e-21


@dataclass(frozen=True, eq=False, kw_only=True)
class SweepCase:
    """All that the runs of a campaign depend on which differ in their seeds alone.

    Attributes:
        task: the world, the start and the goal
        world: what the campaign calls the world
        world_hash: the canonical hash of the task
        task_name: what the campaign calls start and goal; "own": they are the world's own
        planner: what the campaign calls the planner with its options, such as "aco-han ants=50"
        planner_name: the planner's registered name
        planner_source: what `load_planner` takes for it
        planner_version: what the planner's code is, such as "antdrive 0.2.0" or "mine 1.0 5f3a09c2"
        given: the options that the campaign sets, by name
        options: all of the planner's options by name, as plain values
        robot: the robot
        robot_name: what the campaign calls the robot
        robot_hash: the canonical hash of the robot
        fields: fields of `Scenario` by name; the margin may be "auto"
        columns: what tables say of these fields, by column
        words: the words of the command that repeats a run, without its seed; None where no command can
        calibration: what the margin "auto" was chosen by; None: not chosen yet, or the margin is a number
    """

    task: Task
    world: str
    world_hash: str
    task_name: str
    planner: str
    planner_name: str
    planner_source: str
    planner_version: str
    given: Mapping[str, Any]
    options: Mapping[str, Any]
    robot: RobotSpec
    robot_name: str
    robot_hash: str
    fields: Mapping[str, Any]
    columns: Mapping[str, Any]
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
        choose = self.fields["margin"] == "auto" and margin is None
        scenario = Scenario(
            task=self.task,
            planner=load_planner(self.planner_source, **self.given),
            planner_name=record_name(self.planner_source),
            robot=self.robot,
            seed=seed,
            **{**self.fields, "margin": 0.0 if choose else self.fields["margin"] if margin is None else margin},
        )
        if not choose:
            return scenario
        return with_margin_of(scenario, self.calibration) if self.calibration else with_chosen_margin(scenario)

    @property
    def identity(self) -> str:
        """The text that keys are made from: everything that the runs depend on but the seed."""
        # People's own planners change more often than antdrive.
        own = {} if self.planner_name in PLANNERS else {"planner_version": self.planner_version}
        return identity_text(self.world_hash, self.planner_name, self.options, self.robot_hash, self.fields, **own)


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


def key_of(identity: str, seed: int) -> str:
    """The key of a run: a SHA-256, cut to 32 hexadecimal digits."""
    return hashlib.sha256(f"{identity}\n{seed}".encode()).hexdigest()[:KEY_DIGITS]
