"""Worlds in which a set-up fails, looked for within a budget of runs."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from antdrive.base import Floats
from antdrive.base.errors import FieldError
from antdrive.planners import PlannerError
from antdrive.runs.failures.diversity import driven_line, is_new
from antdrive.runs.failures.failure import Failure, failure_of, failure_of_planner
from antdrive.runs.failures.handover import fingerprint_of
from antdrive.runs.failures.search import METHODS
from antdrive.runs.failures.space import WorldSpace, feasible
from antdrive.sim.log.outcome import Outcome
from antdrive.sim.pipeline import Run, run
from antdrive.sim.scenario import Scenario

TRIES = 1000  # worlds that are drawn for one run; those without a path are not driven


@dataclass(frozen=True, eq=False)
class Finding:
    """A world in which the set-up fails.

    Attributes:
        scenario: the set-up in that world
        failure: how it fails
        line: the line that was driven until then (N, 2) [m]; (0, 2) if nothing was driven
        number: which run of the search found it, counted from 1
        is_new: whether it differs from all that were found before; `antdrive.runs.failures.diversity` defines it
        fingerprint: the run in one text, which is the same wherever the run is the same bit for bit; what the planner raised,
            if it did
    """

    scenario: Scenario
    failure: Failure
    line: Floats
    number: int
    is_new: bool
    fingerprint: str


@dataclass(frozen=True, eq=False)
class Hunt:
    """The result of a search for failures.

    Attributes:
        findings: the failures in the order in which they were found
        runs: how many runs were made
        driven: in how many of them the robot drove; in the others the planner found no path, or raised something
        interrupted: whether Ctrl-C ended the search
    """

    findings: tuple[Finding, ...]
    runs: int
    driven: int = 0
    interrupted: bool = False

    @property
    def distinct(self) -> tuple[Finding, ...]:
        """The failures that differ from all that were found before them."""
        return tuple(finding for finding in self.findings if finding.is_new)


def find_failures(
    setup: Scenario,
    *,
    budget: int = 100,
    seed: int = 0,
    method: str = "guided",
    obstacles: int = 10,
    progress: Callable[[int, int], None] | None = None,
) -> Hunt:
    """Look for worlds of a few cylinders in which a set-up fails although a path exists.

    Only worlds are tried in which the exact shortest path keeps the clearance that the set-up claims: the robot's radius and
    the margin. A run that finds no path on its grid counts as a failure only if a path exists with a cell's side more
    clearance than that. A planner that raises something has failed, too.

    Args:
        setup: planner, robot and settings; its own world does not matter
        budget: the number of runs
        seed: the seed of the search; the seed of each run is its number
        method: guided or random
        obstacles: cylinders in each world
        progress: is called after each run with the numbers of runs and of different failures so far

    Raises:
        FieldError: an unknown method, or a number of cylinders or runs that is out of range.
    """
    if method not in METHODS:
        raise FieldError("method", f"unknown {method!r:.40}; choose from {', '.join(METHODS)}")
    if budget < 1:
        raise FieldError("budget", f"must be at least 1, got {budget}")
    space, rng = WorldSpace(obstacles, setup.robot.radius), np.random.default_rng([seed, obstacles])
    findings: list[Finding] = []
    number = driven = 0
    try:
        for number in range(1, budget + 1):
            numbered = dataclasses.replace(setup, seed=number)
            tried = _next_world(space, rng, method, numbered, f"falsify-{seed}-{number}")
            try:
                done = run(tried)
            except PlannerError as error:
                findings.append(_undriven(tried, failure_of_planner(error), number, findings, str(error)))
            else:
                driven += done.rollout is not None
                failure = _failure(done)
                if failure is not None:
                    findings.append(_finding(done, failure, number, findings))
            if progress is not None:
                progress(number, sum(finding.is_new for finding in findings))
    except KeyboardInterrupt:
        return Hunt(tuple(findings), number - 1, driven, interrupted=True)
    return Hunt(tuple(findings), number, driven)


def _next_world(space: WorldSpace, rng: np.random.Generator, method: str, setup: Scenario, name: str) -> Scenario:
    """The set-up in the next world, which has a path with the clearance that the set-up claims."""

    def draw() -> Scenario | None:
        task = space.task(rng.random(space.dimensions), name)
        if not feasible(task, setup.inflate):
            return None
        try:
            return dataclasses.replace(setup, task=task)
        except FieldError:  # the footprint does not fit at the start
            return None

    for _ in range(TRIES):
        scenario = METHODS[method](draw)
        if scenario is not None:
            return scenario
    raise FieldError(
        "obstacles", f"no world of {space.count} cylinders with a path was found in {TRIES} draws; use fewer"
    )


def _failure(done: Run) -> Failure | None:
    """How a run failed; None if it did not, or if the world leaves it no room."""
    failure = failure_of(done)
    if failure is None or done.outcome is not Outcome.NO_PATH:
        return failure
    scenario = done.scenario
    cell = scenario.cell or scenario.task.cell
    return failure if feasible(scenario.task, scenario.inflate + cell) else None


def _undriven(scenario: Scenario, failure: Failure, number: int, known: list[Finding], fingerprint: str) -> Finding:
    is_known = any(finding.failure == failure for finding in known)
    return Finding(scenario, failure, np.empty((0, 2)), number, not is_known, fingerprint)


def _finding(done: Run, failure: Failure, number: int, known: list[Finding]) -> Finding:
    line = np.empty((0, 2)) if done.rollout is None else driven_line(done.rollout)
    if not len(line):
        return _undriven(done.scenario, failure, number, known, fingerprint_of(done))
    alike = [finding.line for finding in known if finding.failure == failure]
    new = is_new(line, alike, done.scenario.robot.radius)
    return Finding(done.scenario, failure, line, number, new, fingerprint_of(done))
