"""The smallest scenario that still fails in the same way."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from antdrive.base.errors import InputError
from antdrive.runs.failures.candidates import (
    CandidateRunner,
    OutOfTimeError,
    changeable,
    failure_in,
    identity_of,
    room_in,
)
from antdrive.runs.failures.failure import Attempt, Failure
from antdrive.runs.failures.passes import PASSES
from antdrive.runs.suites.demands import Bound
from antdrive.sim.scenario import Scenario

ROUNDS = 20  # far more than were ever needed; a pass can undo nothing, so rounds end by themselves


@dataclass(frozen=True)
class Shrunk:
    """A failing scenario, made small.

    Attributes:
        original: the scenario as it was given
        scenario: the smallest one that was found to fail in the same way
        failure: how both fail
        complete: whether every pass came to its end; else the time was over, and going on may make it smaller
        runs: number of candidates run in this session
        recalled: how many answers came from the journal of an earlier session
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
        return changeable(self.original) != changeable(self.scenario)

    @property
    def summary(self) -> str:
        """What became smaller, in words."""
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


def shrink(
    scenario: Scenario,
    *,
    bound: Bound | None = None,
    seconds: float = 60.0,
    journal: Path | None = None,
    jobs: int = 1,
    progress: Callable[[str, int], None] | None = None,
) -> Shrunk:
    """Make a failing scenario small: fewer obstacles and movers, less noise, a nearer start, fewer digits.

    After every accepted step the run fails as it did at first: same outcome, same kind of thing touched, same cause. If at
    first a path with the claimed clearance existed, the exact shortest one says so of every accepted world, too. When
    it has come to its end, the failure vanishes with any single obstacle, mover or unseen obstacle that is left. The
    result depends on the scenario alone, unless the time is over before.

    Args:
        scenario: a scenario that fails
        bound: what counts as failure; None: everything but a certified success
        seconds: time after which no further candidate is run [s]
        journal: a file that remembers which candidates failed, so that a later call goes on where this one stopped
        jobs: processes; the result does not depend on it
        progress: is called with the name of the pass and the number of candidates that were run so far

    Raises:
        InputError: the scenario does not fail.
        PlannerError: the planner raised something, and a bound is what counts.
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
        if runner.recalled and failure_in(small, bound) != failure:  # the journal is older than the planner's code
            runner.forget()
            small, complete = _smallest(scenario, runner)
    finally:
        runner.close()
    return Shrunk(scenario, small, failure, complete, runner.made, len(runner.recalled))


def _smallest(scenario: Scenario, runner: CandidateRunner) -> tuple[Scenario, bool]:
    """What all passes make of a scenario, again and again until none changes anything; whether they came that far."""
    small = scenario
    try:
        for _ in range(ROUNDS):
            before = changeable(small)
            for name, shrinking in PASSES:
                runner.stage = name
                small = shrinking(small, runner)
            if changeable(small) == before:
                return small, True
    except OutOfTimeError:
        pass
    return small, False
