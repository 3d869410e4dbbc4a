"""Pipeline from a scenario to a certified rollout."""

from __future__ import annotations

import contextlib
import math
import time
from typing import TYPE_CHECKING

import numpy as np

from antdrive.base import Pose
from antdrive.base.errors import FieldError
from antdrive.base.guarded import error_text, one_line, value_text
from antdrive.base.progress import progress_bar
from antdrive.base.version import require_physics, versions
from antdrive.planners import PlanResult
from antdrive.robots import Observation, TrackedPath, Twist
from antdrive.robots.control.controller import within_reach
from antdrive.robots.control.observation import finite_twist
from antdrive.robots.control.pursuit import motion_limits
from antdrive.sim.compose import compose
from antdrive.sim.driving.body import Body
from antdrive.sim.driving.driver import Progress, ignore_progress
from antdrive.sim.driving.guide import Follow
from antdrive.sim.driving.parts import SILENT, Drive, Ending, Note, at_goal
from antdrive.sim.driving.plants import Bullet
from antdrive.sim.facts import ENDED_BY as ENDED_BY
from antdrive.sim.facts import Run as Run
from antdrive.sim.log.certificate import certify
from antdrive.sim.log.contacts import attributed
from antdrive.sim.log.outcome import Outcome
from antdrive.sim.log.record import (
    FROM_OUTSIDE,
    ComponentRecord,
    DriveRecord,
    SmoothingRecord,
    TimesRecord,
    settings_of,
)
from antdrive.sim.log.rollout import Rollout
from antdrive.sim.physics.engine import Engine
from antdrive.sim.recording import configuration_of, plan_record
from antdrive.sim.scenario import Scenario, usual_time_limit
from antdrive.worlds import Grid

if TYPE_CHECKING:
    from types import TracebackType


class Session:
    """Drive of a scenario that is observed and commanded from outside, for use in a `with` block.

    It plans first, as `run` does, and opens physics if there is a path. One that is left early logs the outcome `STOPPED`.

    >>> with Session(scenario) as drive:
    ...     while not drive.ended:
    ...         drive.step(*drive.mind.act(drive.observe()))
    >>> drive.run.certificate

    Attributes:
        mind: the scenario's own mind: `step(*mind.act(observe()))` drives as `run` does
        briefing: what the robot knows before the drive
        grid: the planning grid
        plan: the planner's answer
        path: the planned path; None if planning found none
        ended: how the drive ended; None while it goes on
        rollout: the log, once the `with` block is left; None without a path

    Args:
        s: the scenario
        planned: as in `run`

    Raises:
        PlannerError: the planner raised an exception, or its answer is not a `PlanResult`.
    """

    def __init__(self, s: Scenario, planned: tuple[Grid, PlanResult] | None = None) -> None:
        require_physics()
        self._scenario, (self._sensors, guide, self.mind) = s, compose(s)
        self._limits = motion_limits(s.robot)
        self.briefing = self.mind.briefing
        self.grid, self.plan = guide.first() if planned is None else guide.accept(*planned)
        self.path: TrackedPath | None = None
        self.ended: Ending | None = None
        self._open = contextlib.ExitStack()
        self._body: Body | None = None
        self.rollout: Rollout | None = None
        self._by_itself = True  # whether its mind has given every command
        if self.plan.solved:
            self._route, self.path = guide.route(self.grid, self.plan)
            self.mind.way = Follow(self.path)
        else:
            self.ended = Ending(ENDED_BY[self.plan.status.name], self.plan.reason)

    def __enter__(self) -> Session:
        s = self._scenario
        if self._body is not None:
            raise FieldError("session", "has been driven; create another")
        self._started = time.perf_counter()
        if self.path is not None:
            self._limit = s.time_limit or s.task.time_limit or usual_time_limit(self._route.length, s.robot, s.noise)
            physics = Engine(s.driven_world, s.robot, physics_hz=s.physics_hz, trajectories=s.trajectories)
            self._plant = Bullet(self._open.enter_context(physics), s.task.start, s.control_hz)
            self._body = Body(self._plant, *self._sensors, hz=s.control_hz, limit=self._limit, task=s.task)
            self.ended = self._body.ended
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        with self._open:
            if self._body is not None:
                left = Ending(
                    Outcome.STOPPED, one_line(error_text(error)) if error else "left by the loop that commanded it"
                )
                ending = self.mind.with_reason(self._body.ended or left, self._body.tick)
                self.rollout = self._logged(self._body, self._plant.finish(ending))

    @property
    def run(self) -> Run:
        """The result, with its log and certificate, once the `with` block is left.

        Raises:
            FieldError: it has not been left.
        """
        log = self.rollout
        if log is None and self.path is not None:
            raise FieldError("run", "leave the `with` block first")
        return Run(self._scenario, self.grid, self.plan, log, None if log is None else certify(log))

    @property
    def true_pose(self) -> Pose:
        """True pose of the axle's centre, for rewards and tests: a controller must not read it.

        Raises:
            FieldError: physics is not open.
        """
        if self._body is None:
            raise FieldError("true_pose", "there is no drive: use `with`")
        return self._plant.state.pose

    def observe(self) -> Observation:
        """Return what the robot observes in this control period.

        Raises:
            FieldError: there is no drive.
        """
        return self._driving("observe").observe()

    def step(self, command: Twist | None, note: Note = SILENT) -> None:
        """Drive for one control period; without a command, or at the goal, the drive ends where the robot stands.

        Args:
            command: speed [m/s] and yaw rate [rad/s]; the robot comes as close to them as its limits allow
            note: what the mind tells of its command

        Raises:
            FieldError: the command is not two finite numbers, or there is no drive.
        """
        body = self._driving("step")
        if note is SILENT or command is not self.mind.last[0]:
            command, note = self._own(command, note, body.observe())
        elif note is not self.mind.last[1]:
            raise FieldError("note", "is not the one of the mind's command")
        body.step(command, note)
        self.ended = body.ended

    def _own(self, command: Twist | None, note: Note, now: Observation) -> tuple[Twist | None, Note]:
        """Return a command from outside within the robot's limits, and a note on it."""
        if note is not SILENT:
            raise FieldError("note", "belongs to another command; leave it out")
        self._by_itself = False
        if command is None:
            there = at_goal(now, now.pose, self.briefing.goal, self.briefing.tolerance)
            return None, SILENT if there else Note(
                ending=Ending(Outcome.STOPPED, "stopped by the loop that commanded it")
            )
        if (wanted := finite_twist(command)) is None:
            problem = f"must be two finite numbers, a speed and a yaw rate, got {value_text(command, 60)}"
            raise FieldError("command", problem)
        return within_reach(wanted, now.command, self._limits, self.briefing.hz), note

    def _driving(self, call: str) -> Body:
        if self._body is None:
            raise FieldError(call, f"there is no path: {self.plan.reason}" if self.path is None else "use `with`")
        if self._body.ended is not None or self.rollout is not None:
            raise FieldError(call, "the drive has ended")
        return self._body

    def _logged(self, body: Body, log: Drive) -> Rollout:
        """Assemble the log."""
        s, mind, per_tick = self._scenario, self.mind, self._plant.per_tick
        guide, facts = mind.guide, configuration_of(s, self.grid, self.plan)
        if not self._by_itself:
            facts["controller"] = ComponentRecord(name=FROM_OUTSIDE, settings={})
        drive_wall_s = time.perf_counter() - self._started
        record = DriveRecord(
            **facts,
            plan=plan_record(s, guide.footprint_margin, self.grid, self.plan),
            smoothing=SmoothingRecord(asked=s.smoothing, made=self._route.kind, note=self._route.note),
            replans=tuple(guide.log),
            limiters=mind.limiters,
            margin_choice=s.chosen.record if s.chosen is not None else None,
            inflate=s.inflate,
            time_limit=self._limit,
            footprint_margin=guide.footprint_margin,
            outcome=log.outcome,
            reason=log.reason,
            physics=log.physics,
            written=settings_of(s.written.plain()),
            versions=versions(),
            times=TimesRecord(plan_s=self.plan.wall_s, drive_wall_s=drive_wall_s, replans_s=tuple(guide.walls)),
        )
        rows = {
            name: array for name, array in vars(log).items() if isinstance(array, np.ndarray) and name != "actuated"
        }
        rows |= {"route": self._route.xy, "cells": self.plan.cells}
        return attributed(Rollout(**rows | body.logged(log, per_tick) | mind.logged(log, per_tick), record=record))


def plan(s: Scenario) -> tuple[Grid, PlanResult]:
    """Plan a scenario's first route; return the grid and the planner's checked answer.

    Movers are not on the grid; space-time planners get their motions. An invalid plan is returned without its path,
    with status `INVALID` and the error as reason. If the start is too narrow to follow the path, the answer is
    `NO_PATH` with the reason. Without a map, the plan uses the first scan.

    Raises:
        PlannerError: the planner raised an exception, or its answer is not a `PlanResult`.
    """
    return compose(s)[1].first()


def run(
    s: Scenario,
    *,
    planned: tuple[Grid, PlanResult] | None = None,
    progress: Progress | bool | None = None,
) -> Run:
    """Plan and drive one scenario.

    Args:
        s: the scenario
        planned: the result of `plan` for the scenario, or your own plan on its grid, which is checked; None: plan first
        progress: called with the completed fraction of the route; True: show a bar on stderr; False: show nothing; None:
            show a bar in a notebook

    Raises:
        PlannerError: the planner raised an exception, or its answer is not a `PlanResult`.
        ControllerError: the controller raised an exception, or its command is not a finite `Twist`.
    """
    with progress_bar(progress, f"{s.planner_label} in {s.task.world.name}") as update:
        grid, answer, rollout = driven(s, planned, update)
    return Run(s, grid, answer, rollout, None if rollout is None else certify(rollout))


def driven(
    s: Scenario,
    planned: tuple[Grid, PlanResult] | None = None,
    progress: Progress = ignore_progress,
    periods: float = math.inf,
) -> tuple[Grid, PlanResult, Rollout | None]:
    """Plan and drive as `run` does, for a number of control periods; return grid and plan, and the log if there is a path."""
    with Session(s, planned) as drive:
        drive.mind.progress = progress
        while not drive.ended and periods > 0:
            drive.step(*drive.mind.act(drive.observe()))
            periods -= 1
    return drive.grid, drive.plan, drive.rollout
