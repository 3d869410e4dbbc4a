"""What is handed over about the failures that a search found: each repeated, shrunk, and in a suite."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from antdrive.runs.failures.failure import failure_of, without_numbers
from antdrive.runs.failures.handover import (
    Handover,
    fingerprint_of,
    run_elsewhere,
    run_if_planned,
    suite_elsewhere,
    write_suite,
)
from antdrive.runs.failures.hunt import Finding, Hunt
from antdrive.runs.failures.shrink import shrink
from antdrive.sim.pipeline import Run
from antdrive.sim.scenario import Scenario

SUITE = "failures.drive.yaml"


@dataclass(frozen=True, eq=False)
class Reported:
    """A failure as it is handed over."""

    name: str  # its name in the suite, and of its world
    finding: Finding  # the failure as it was found
    run: Run | Scenario  # the run of the small scenario; that scenario alone where the planner raised something
    # whether the found scenario, and the small one as it is read from its files, gave the same bits in another
    # process
    repeats: bool

    @property
    def scenario(self) -> Scenario:
        """The small scenario."""
        return self.run.scenario if isinstance(self.run, Run) else self.run

    def as_dict(self) -> dict[str, Any]:
        """Plain values, for JSON."""
        return {
            "name": self.name,
            "run": self.finding.number,
            **dataclasses.asdict(self.finding.failure),
            "repeats": self.repeats,
            "obstacles_found": len(self.finding.scenario.task.world.obstacles),
            "obstacles": len(self.scenario.task.world.obstacles),
        }


def report(
    hunt: Hunt, folder: Path, *, seconds: float = 20.0, progress: Callable[[float], None] | None = None
) -> list[Reported]:
    """Shrink the different failures of a search, write them, and run what was written again in another process.

    A suite and the worlds are written. Ctrl-C ends the shrinking; what is not shrunk by then is handed over as it was found.

    Raises:
        InputError: a file cannot be written.
    """
    small: list[Run | Scenario] = []
    for k, finding in enumerate(hunt.distinct):
        name, scenario = _name(k), finding.scenario
        if seconds > 0:
            try:
                scenario = shrink(scenario, seconds=seconds, journal=folder / "journals" / f"{name}.json").scenario
            except KeyboardInterrupt:
                seconds = 0.0
        named = _named(scenario, name)
        done = run_if_planned(named)
        small.append(named if isinstance(done, str) else done)
        if progress is not None:
            progress((k + 1) / (len(hunt.distinct) + 1))
    suite = _write(small, hunt.distinct, folder)
    found, written = run_elsewhere([finding.scenario for finding in hunt.distinct]), suite_elsewhere(suite)
    return [
        Reported(_name(k), finding, done, _repeats(finding, done, found[k], written[k]))
        for k, (finding, done) in enumerate(zip(hunt.distinct, small, strict=True))
    ]


def _name(index: int) -> str:
    return f"failure-{index + 1}"


def _repeats(finding: Finding, small: Run | Scenario, found_elsewhere: str, small_elsewhere: str) -> bool:
    """Whether a failure and its small scenario gave the same bits in another process, and fail in the same way."""
    if isinstance(small, Scenario):  # the planner raised something
        masked = {without_numbers(text) for text in (finding.fingerprint, found_elsewhere, small_elsewhere)}
        return masked == {finding.failure.cause}
    same = (found_elsewhere, small_elsewhere) == (finding.fingerprint, fingerprint_of(small))
    return same and failure_of(small) == finding.failure


def _write(small: Sequence[Run | Scenario], findings: Sequence[Finding], folder: Path) -> Path:
    """Write the suite and the worlds of failures; the suite's path."""
    pairs = enumerate(zip(small, findings, strict=True))
    handovers = [Handover(_name(k), done, note=finding.failure.sentence) for k, (done, finding) in pairs]
    return write_suite(folder / SUITE, handovers)


def _named(scenario: Scenario, name: str) -> Scenario:
    world = dataclasses.replace(scenario.task.world, name=name)
    return dataclasses.replace(scenario, task=dataclasses.replace(scenario.task, world=world))
