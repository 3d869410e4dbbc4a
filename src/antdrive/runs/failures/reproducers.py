"""Minimal reproducers of failures: shrunk, written as a suite, and repeated in another process."""

from __future__ import annotations

import dataclasses
import shlex
import tempfile
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from antdrive.base.errors import amount
from antdrive.base.tables import table
from antdrive.runs.failures.failure import Attempt
from antdrive.runs.failures.handover import renamed, run_elsewhere, write_suite
from antdrive.runs.failures.hunt import Finding, Hunt
from antdrive.runs.failures.shrinker import Shrunk, shrink
from antdrive.runs.suites.demands import Bound

SUITE = "failures.drive.yaml"


@dataclass(frozen=True, eq=False)
class Reproducer:
    """A minimal reproducer of a failure."""

    name: str  # its name in the suite, and of its world
    finding: Finding  # the original failure
    small: Attempt  # run of the minimal scenario
    # whether the original and the minimal scenario, the latter read from its files, repeat bitwise in another process
    repeats: bool

    @property
    def cells(self) -> tuple[str, ...]:
        """The row of the table of failures."""
        before, after = (len(s.task.world.obstacles) for s in (self.finding.scenario, self.small.scenario))
        repeats, failure = "yes" if self.repeats else "NO", self.finding.failure.sentence
        return self.name, str(self.finding.number), repeats, f"{before} -> {after}", failure

    def as_dict(self) -> dict[str, Any]:
        """Return plain values, for JSON."""
        return {
            "name": self.name,
            "run": self.finding.number,
            **dataclasses.asdict(self.finding.failure),
            "repeats": self.repeats,
            "obstacles_found": len(self.finding.scenario.task.world.obstacles),
            "obstacles": len(self.small.scenario.task.world.obstacles),
        }


def write_reproducers(
    hunt: Hunt,
    folder: Path,
    *,
    seconds: float = 20.0,
    progress: Callable[[float], None] | None = None,
) -> list[Reproducer]:
    """Shrink the distinct failures of a search, write them as a suite with worlds, and repeat them in another process.

    Ctrl-C ends the shrinking; the remaining failures are written unshrunk.

    Args:
        hunt: the search
        folder: of the suite
        seconds: time limit for shrinking each failure [s]
        progress: called with the completed fraction
    """
    if not hunt.findings:
        (folder / SUITE).unlink(missing_ok=True)
        return []
    small: list[Attempt] = []
    for k, finding in enumerate(hunt.distinct):
        name, scenario = _name(k), finding.scenario
        if seconds > 0:
            try:
                scenario = shrink(scenario, seconds=seconds, journal=folder / "journals" / f"{name}.json").scenario
            except KeyboardInterrupt:
                seconds = 0.0
        small.append(Attempt.of(renamed(scenario, name)))
        if progress is not None:
            progress((k + 1) / (len(hunt.distinct) + 1))
    notes = [(done.failure() or one.failure).sentence for done, one in zip(small, hunt.distinct, strict=True)]
    suite = write_suite(folder / SUITE, small, notes)
    with tempfile.TemporaryDirectory(prefix="antdrive-falsify-") as place:
        found = [Attempt(finding.scenario, None) for finding in hunt.distinct]
        originals = write_suite(Path(place) / SUITE, found)
        elsewhere = run_elsewhere(originals, suite)
    pairs = zip(elsewhere[: len(found)], elsewhere[len(found) :], strict=True)
    made = []
    for k, (finding, done, pair) in enumerate(zip(hunt.distinct, small, pairs, strict=True)):
        same = pair == (finding.fingerprint, done.fingerprint) and done.failure() == finding.failure
        made.append(Reproducer(_name(k), finding, done, same))
    return made


def failure_lines(hunt: Hunt, reported: Sequence[Reproducer], folder: Path) -> Iterator[str]:
    """Yield the result of a search as lines: its failures, and the commands that repeat and report them.

    Args:
        hunt: the search
        reported: its reproducers
        folder: of their suite
    """
    ended = "interrupted after" if hunt.interrupted else "after"
    runs = f"{amount(hunt.runs, 'run')} (the robot drove in {hunt.driven})"
    yield f"{ended} {runs}: {amount(len(hunt.findings), 'failure')}, {len(hunt.distinct)} distinct"
    if reported:
        yield from table(("name", "run", "repeats", "obstacles", "failure"), (one.cells for one in reported))
        yield f"suite of the failures, with worlds, logs and pages: {folder}"
        yield f"repeat: {shlex.join(['antdrive', 'check', str(folder / SUITE)])}"
        yield f"report: {shlex.join(['antdrive', 'report', str(folder), '-o', str(folder / 'report.html')])}"


def _name(index: int) -> str:
    return f"failure-{index + 1}"


def write_reproducer(shrunk: Shrunk, name: str, folder: Path, *, bound: Bound | None) -> tuple[Attempt, Path, bool]:
    """Write the suite of one minimal scenario; return its run, the suite, and whether it repeats in another process."""
    note = f"shrunk from {shrunk.original.task.world.name}: {shrunk.summary}"
    small = Attempt.of(renamed(shrunk.scenario, name, note))
    failure = small.failure(bound)
    sentence = (failure or shrunk.failure).sentence
    suite = write_suite(folder / f"{name}.drive.yaml", [small], [sentence], bound)
    repeats = run_elsewhere(suite) == [small.fingerprint] and failure == shrunk.failure
    return small, suite, repeats
