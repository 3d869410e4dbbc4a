"""Drives in Python tests: the fixture `drive`, and assertions on runs."""

from __future__ import annotations

import functools
import shlex
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from antdrive.base.components import ComponentError
from antdrive.base.errors import FieldError
from antdrive.planners import PLANNERS, Planner, is_built_in
from antdrive.robots import RobotSpec, list_robots
from antdrive.runs.suites.demands import Demands
from antdrive.runs.suites.nearest import first_contact, nearest_of
from antdrive.runs.suites.suite import BASELINES
from antdrive.sim.log.certificate import at_least, certify
from antdrive.sim.log.outcome import Outcome
from antdrive.sim.log.rollout import Rollout
from antdrive.sim.pipeline import Run
from antdrive.sim.pipeline import run as drive_scenario
from antdrive.sim.rerun import fingerprint
from antdrive.sim.scenario import Scenario
from antdrive.sim.settings import tested_settings
from antdrive.testing.evaluation import CheckResult, Criteria, Update
from antdrive.views.artefacts import Results, portable_name
from antdrive.worlds import Task, list_worlds


class DriveFailure(AssertionError):
    """Failure of a drive in its test; the message states the reasons.

    Attributes:
        result: the result of the test
    """

    def __init__(self, result: CheckResult) -> None:
        super().__init__(result.message)
        self.result = result

    def __reduce__(self) -> tuple[type[DriveFailure], tuple[CheckResult]]:
        return type(self), (self.result,)  # the default would pickle the message only


class DriveFixture:
    """Value of the fixture `drive`: call it to drive a scenario and compare it with its baseline.

    >>> def test_mine(drive):
    ...     drive("forest", planner=MyPlanner(), seed=1, expect={"min_clearance_m": ">= 0.05"})

    The baseline is `baselines/MODULE/TEST.json` next to the test's file. A test with several drives names each.

    Args:
        file: the test's file
        test: the test's name in the file, such as test_mine[3]
        address: pytest's node id of the test, relative to its rootdir
        repeat: the test's name in commands, if it differs from the address
        update: baselines to write
        results: destination of logs, pages and figures; None: write nothing
        report: called with the result of each drive
    """

    def __init__(
        self,
        *,
        file: Path,
        test: str,
        address: str,
        repeat: str = "",
        update: Update = "",
        results: Results | None = None,
        report: Callable[[CheckResult], None] = lambda result: None,
    ) -> None:
        self._file, self._test, self._address = file, test, address
        self._repeat = repeat or address
        self._update, self._results, self._report = update, results, report
        self._names: set[str] = set()

    def __call__(
        self,
        world: str | Path | Task | Scenario,
        planner: str | Planner | None = None,
        robot: str | Path | RobotSpec | None = None,
        *,
        name: str = "",
        expect: Mapping[str, Any] | None = None,
        tolerance: Mapping[str, Any] | None = None,
        trajectory: float | str | None = None,
        baseline: bool = True,
        **settings: Any,
    ) -> Run:
        """Drive a scenario and compare it with the demands and the baseline.

        Args:
            world: a scenario (then all settings are its own), a task, a world of the catalogue, or a world file relative to
                the test's file
            planner: a planner's name, or a planner; by default ants
            robot: a robot, a robot of the catalogue, or a robot file relative to the test's file; by default turtlebot
            name: name of the drive, if the test has several
            expect: outcome, certified, and bounds on metrics such as {"min_clearance_m": ">= 0.05"}
            tolerance: allowed degradation of metrics from the baseline
            trajectory: allowed distance from the baseline's trajectory [m], or "exact"
            baseline: whether to compare with a baseline
            settings: further settings of `Scenario.of`, such as seed, noise and margin; smoothing is none for a custom planner

        Raises:
            DriveFailure: the drive misses a demand or is worse than its baseline, or the planner raised an error.
            InputError: the world, the planner or the robot is invalid.
            FieldError: a setting is invalid, or two drives of a test have the same name.
        """
        __tracebackhide__ = True
        demands = Demands.of(expect or {}, tolerance or {}, trajectory)
        if not baseline:
            for key, value in (("tolerance", tolerance), ("trajectory", trajectory)):
                if value:
                    raise FieldError(key, "needs a baseline; omit it, or omit baseline=False")
        if name in self._names:
            raise FieldError("name", f"{name!r} is used twice in this test; give each drive its own name")
        self._names.add(name)
        scenario = self._scenario(world, planner, robot, settings)
        whole = f"{self._test}-{name}" if name else self._test
        criteria = Criteria(
            address=self._address,
            name=whole,
            demands=demands,
            baseline=self.baseline_path(whole) if baseline else None,
            commands=(shlex.join(["pytest", self._repeat]),),
            accept=shlex.join(["antdrive", "accept", self._repeat]),
            update=self._update,
            folder=self._results.of(self._file, whole) if self._results else None,
            results=self._results,
            again=functools.partial(fingerprint, scenario),
        )
        try:
            run = drive_scenario(scenario)
        except ComponentError as error:
            result = criteria.raised(scenario, error)
            self._report(result)
            raise DriveFailure(result) from error
        result = criteria.evaluate(run)
        self._report(result)
        if not result.passed:
            raise DriveFailure(result)
        return run

    def run(
        self,
        world: str | Path | Task | Scenario,
        planner: str | Planner | None = None,
        robot: str | Path | RobotSpec | None = None,
        **settings: Any,
    ) -> Run:
        """Drive a scenario without evaluating it.

        Args:
            world: a scenario (then all settings are its own), a task, a world of the catalogue, or a world file relative to
                the test's file
            planner: a planner's name, or a planner; by default ants
            robot: a robot, a robot of the catalogue, or a robot file relative to the test's file; by default turtlebot
            settings: further settings of `Scenario.of`, such as seed, noise and margin; smoothing is none for a custom planner

        Raises:
            InputError: the world, the planner or the robot is invalid.
            FieldError: a setting is invalid.
            PlannerError: the planner raised an error.
        """
        return drive_scenario(self._scenario(world, planner, robot, settings))

    def _scenario(
        self,
        world: str | Path | Task | Scenario,
        planner: str | Planner | None,
        robot: str | Path | RobotSpec | None,
        settings: Mapping[str, Any],
    ) -> Scenario:
        """Return the scenario of a call."""
        if isinstance(world, Scenario):
            beside = {"planner": planner, "robot": robot, **settings}
            given = [key for key, value in beside.items() if key in settings or value is not None]
            if given:
                raise FieldError(given[0], "is part of the scenario; change it with dataclasses.replace")
            return world
        planner = "ants" if planner is None else planner
        custom = planner not in PLANNERS if isinstance(planner, str) else not is_built_in(planner)
        robot = "turtlebot" if robot is None else robot
        place = world if isinstance(world, Task) else self._beside(world, list_worlds())
        body = robot if isinstance(robot, RobotSpec) else self._beside(robot, list_robots())
        return Scenario.of(place, planner, body, **tested_settings(settings, custom=custom))

    def baseline_path(self, name: str) -> Path:
        """Return the baseline file of a drive.

        Args:
            name: the test's name, with the drive's name if it has one
        """
        return self._file.parent / BASELINES / self._file.stem / f"{portable_name(name)}.json"

    def _beside(self, name: str | Path, known: Mapping[str, Path]) -> str | Path:
        """Return a catalogue name, or the path of a file next to the test's file if it exists."""
        beside = self._file.parent / name
        return beside if str(name) not in known and beside.exists() else name


def assert_collision_free(run: Run | Rollout, clearance: float = 0.0) -> None:
    """Assert that a drive is certified collision-free with a clearance.

    Args:
        run: a run, or the log of one
        clearance: minimum distance to obstacles to prove, including between the log's rows [m]

    Raises:
        AssertionError: it is not certified; the message names the obstacle, place and time.
    """
    __tracebackhide__ = True
    rollout = run.rollout if isinstance(run, Run) else run
    if rollout is None:
        assert isinstance(run, Run)
        raise AssertionError(f"the robot did not drive: {run.outcome.key}{f' ({run.reason})' if run.reason else ''}")
    certificate = certify(rollout)
    touched = first_contact(rollout) if rollout.outcome.with_contact else None
    if touched is not None:
        raise AssertionError(f"{rollout.outcome.key}: touched {touched.thing}; {touched.place}")
    if not certificate.certified:
        raise AssertionError(f"not certified collision-free: {'; '.join(certificate.problems)}")
    if certificate.bound < clearance:
        nearest = nearest_of(rollout)
        raise AssertionError(
            f"clearance: {at_least(certificate.bound)} is proved, expected {clearance:g} m; nearest to {nearest.thing}, "
            f"{nearest.place}"
        )


def assert_reached_goal(run: Run) -> None:
    """Assert that the robot stopped at the goal and its drive is certified collision-free.

    Args:
        run: the run

    Raises:
        AssertionError: a condition is not met; the message states the outcome.
    """
    __tracebackhide__ = True
    if run.outcome is not Outcome.SUCCEEDED and not run.outcome.with_contact:
        raise AssertionError(f"{run.outcome.key}: {run.outcome.value}{f' ({run.reason})' if run.reason else ''}")
    assert_collision_free(run)
