"""One run of a campaign: what it depends on, the key that names it, and the command that repeats it alone."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

from antdrive.planners import PLANNERS, load_planner, record_name
from antdrive.robots import RobotSpec
from antdrive.runs.margins.prediction import Calibration
from antdrive.sim.log.record import settings_of
from antdrive.sim.scenario import Scenario
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
        chosen = self.calibration.margin if self.calibration else 0.0
        scenario = Scenario(
            task=self.task,
            planner=load_planner(self.planner_source, **self.given),
            planner_name=record_name(self.planner_source),
            robot=self.robot,
            seed=seed,
            calibration=self.calibration,
            **{**self.fields, "margin": chosen if choose else self.fields["margin"] if margin is None else margin},
        )
        return scenario.with_chosen_margin() if choose and self.calibration is None else scenario

    @property
    def identity(self) -> str:
        """The text that keys are made from: everything that the runs depend on but the seed."""
        parts = {
            "task": self.world_hash,
            "planner": self.planner_name,
            "options": self.options,
            "robot": self.robot_hash,
            "settings": settings_of(self.fields),
        }
        if self.planner_name not in PLANNERS:  # people's own planners change more often than antdrive
            parts["planner_version"] = self.planner_version
        return json.dumps(parts, sort_keys=True)


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
