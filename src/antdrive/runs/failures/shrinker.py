"""Shrink a failing scenario to a minimal reproducer."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from antdrive.base.errors import InputError
from antdrive.runs.failures.candidates import (
    CandidateRunner,
    OutOfTimeError,
    failure_in,
    identity_of,
    room_in,
)
from antdrive.runs.failures.failure import Attempt, Failure
from antdrive.runs.failures.passes import PASSES
from antdrive.runs.suites.demands import Bound
from antdrive.sim.scenario import Scenario

ROUNDS = 20  # a safe limit: passes undo nothing, so rounds end by themselves


@dataclass(frozen=True)
class Shrunk:
    """A failing scenario and its minimal reproducer.

    Attributes:
        original: the given scenario
        scenario: the smallest known scenario that fails in the same way
        failure: how both fail
        complete: whether every pass finished; else the time ran out, and resuming may shrink further
        runs: number of candidates run in this session
        recalled: number of answers from the journal of an earlier session
    """

    original: Scenario
    scenario: Scenario
    failure: Failure
    complete: bool
    runs: int
    recalled: int

    @property
    def smaller(self) -> bool:
        """Whether anything was changed."""
        return self.original.key != self.scenario.key

    @property
    def summary(self) -> str:
        """The reductions, in words."""
        before, after = self.original, self.scenario
        parts = []
        for name, old, new in (
            ("obstacles", len(before.task.world.obstacles), len(after.task.world.obstacles)),
            ("movers", len(before.task.world.movers), len(after.task.world.movers)),
            ("unseen", len(before.unseen), len(after.unseen)),
            ("noise", before.noise, after.noise),
            ("seed", before.seed, after.seed),
        ):
            if old != new or name == "obstacles":
                parts.append(f"{name} {old:g} -> {new:g}")
        return ", ".join(parts)

    def as_dict(self) -> dict[str, Any]:
        """Return failure, reductions and numbers of runs as plain values."""
        return {
            "failure": dataclasses.asdict(self.failure),
            "summary": self.summary,
            "complete": self.complete,
            "trials": self.runs,
            "recalled": self.recalled,
        }

    def lines(self, repeats: bool) -> Iterator[str]:
        """Yield the failure and its reductions as lines.

        Args:
            repeats: whether the minimal scenario fails in the same way in another process
        """
        yield f"{self.original.task.world.name}: {self.failure.sentence}"
        yield f"{'smaller' if self.smaller else 'no smaller'} after {self.runs} runs: {self.summary}"
        if not self.complete:
            yield "time limit reached: repeat the command to continue, or raise --seconds"
        if not repeats:
            yield "the reproducer did not fail in the same way in another process: the scenario is not deterministic"


def shrink(
    scenario: Scenario,
    *,
    bound: Bound | None = None,
    seconds: float = 60.0,
    journal: Path | None = None,
    jobs: int = 1,
    progress: Callable[[str, int], None] | None = None,
) -> Shrunk:
    """Shrink a failing scenario: fewer obstacles and movers, less noise, a nearer start, fewer digits.

    Every accepted step fails in the same way: same outcome, same kind of thing touched, same cause. If the given
    world has a path with the claimed clearance, so has every accepted world; an exact shortest-path search
    checks this. On completion,
    removing any single obstacle, mover or unseen obstacle makes the failure vanish. The result depends on the scenario
    alone, unless the time runs out.

    Args:
        scenario: a scenario that fails
        bound: the condition that counts as failure; None: anything but a certified success
        seconds: time after which no further candidate is run [s]
        journal: a file with the candidates' results, so that a later call resumes
        jobs: number of processes; the result does not depend on it
        progress: called with the name of the pass and the number of candidates run so far

    Raises:
        InputError: the scenario does not fail.
        PlannerError: the planner raised an error, and a bound is given.
    """
    first = Attempt.of(scenario)
    if first.error is not None and bound is not None:
        raise first.error
    failure = first.failure(bound)
    if failure is None:
        counts = "a failure is anything but a certified success" if bound is None else f"the bound is {bound}"
        raise InputError(f"{scenario.task.world.name}: this run does not fail, so there is nothing to shrink; {counts}")
    runner = CandidateRunner(
        failure, bound, room=room_in(scenario, failure), seconds=seconds, journal=journal,
        identity=identity_of(scenario), jobs=jobs, progress=progress,
    )  # fmt: skip
    try:
        small, complete = _smallest(scenario, runner)
        if runner.recalled and failure_in(small, bound) != failure:  # the planner's code has changed since
            runner.forget()
            small, complete = _smallest(scenario, runner)
    finally:
        runner.close()
    return Shrunk(scenario, small, failure, complete, runner.made, len(runner.recalled))


def _smallest(scenario: Scenario, runner: CandidateRunner) -> tuple[Scenario, bool]:
    """Repeat all passes until none changes anything; return the scenario and whether they finished."""
    small = scenario
    try:
        for _ in range(ROUNDS):
            before = small.key
            for name, shrinking in PASSES:
                runner.stage = name
                small = shrinking(small, runner)
            if small.key == before:
                return small, True
    except OutOfTimeError:
        pass
    return small, False
