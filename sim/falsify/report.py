"""What is handed over about the failures that a search found: each repeated, shrunk, and in a suite."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from antdrive.sim.falsify.failure import failure_of
from antdrive.sim.falsify.handover import Handover, fingerprint_of, run_elsewhere, write_suite
from antdrive.sim.falsify.hunt import Finding, Hunt
from antdrive.sim.falsify.shrink import shrink
from antdrive.sim.pipeline import Run, run
from antdrive.sim.scenario import Scenario


@dataclass(frozen=True, eq=False)
class Reported:
    """A failure as it is handed over.

    Attributes:
        name: its name in the suite, and of its world
        finding: the failure as it was found
        run: the run of the small scenario
        repeats: whether the found and the small scenario gave the same bits in another process
    """

    name: str
    finding: Finding
    run: Run
    repeats: bool

    def as_dict(self) -> dict[str, Any]:
        """Plain values, for JSON."""
        return {
            "name": self.name,
            "run": self.finding.number,
            **dataclasses.asdict(self.finding.failure),
            "repeats": self.repeats,
            "obstacles_found": len(self.finding.scenario.task.world.obstacles),
            "obstacles": len(self.run.scenario.task.world.obstacles),
        }


def report(
    hunt: Hunt, folder: Path, *, seconds: float = 20.0, progress: Callable[[float], None] | None = None
) -> list[Reported]:
    """Shrink the different failures of a search, and run them again in another process.

    Args:
        hunt: the search
        folder: where journals go, so that a failure is not shrunk twice
        seconds: time to shrink each failure [s]; 0: they are left as they are
        progress: is called with the fraction that is done
    """
    reported: list[Reported] = []
    for k, finding in enumerate(hunt.distinct):
        name, small = f"failure-{k + 1}", finding.scenario
        if seconds > 0:
            small = shrink(small, seconds=seconds, journal=folder / "journals" / f"{name}.json").scenario
        done = run(_named(small, name))
        same = run_elsewhere([finding.scenario, done.scenario]) == [
            fingerprint_of(run(finding.scenario)),
            fingerprint_of(done),
        ]
        reported.append(Reported(name, finding, done, same and failure_of(done) == finding.failure))
        if progress is not None:
            progress((k + 1) / len(hunt.distinct))
    return reported


def write_report(reported: Sequence[Reported], folder: Path) -> Path:
    """Write the suite, the worlds and the logs of failures; the suite's path.

    Args:
        reported: the failures
        folder: where to write

    Raises:
        InputError: a file cannot be written.
    """
    for one in reported:
        if one.run.rollout is not None:
            one.run.rollout.save(folder / f"{one.name}.npz")
    handovers = [Handover(one.name, one.run, note=one.finding.failure.sentence) for one in reported]
    return write_suite(folder / "failures.drive.yaml", handovers)


def _named(scenario: Scenario, name: str) -> Scenario:
    world = dataclasses.replace(scenario.task.world, name=name)
    return dataclasses.replace(scenario, task=dataclasses.replace(scenario.task, world=world))
