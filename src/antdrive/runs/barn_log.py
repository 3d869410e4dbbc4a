"""Scores of a log of the BARN challenge, as its `run.py` and ROS 2's `barn_runner.py` write it.

Formula and sources: `FORMULAS`. The organisers' scripts clip the time at two different bounds and start the reference path at
two different points; both are computed.
"""

from __future__ import annotations

import math
import re
import statistics
import sys
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from antdrive.base.errors import InputError, few, input_error
from antdrive.base.files import read_bytes
from antdrive.base.tables import table
from antdrive.runs.barn_challenge import (
    FORMULA,
    FORMULA_SOURCE,
    FORMULAS,
    OFFICIAL,
    PUBLISHED,
    Formula,
    published_lines,
)  # fmt: skip

MAX_LOG_BYTES = 10_000_000
PUBLIC = range(0, 300, 6)  # numbers of the public worlds
TRIALS = 10  # of each world
SHAPE = "WORLD SUCCESS COLLIDED TIMEOUT SECONDS SCORE, such as 0 1 0 0 48.5371 0.1400"
_LINE = re.compile(r"(\d{1,3}) +([01]) +([01]) +([01]) +(\d{1,9}(?:\.\d+)?)(?: +(\d{1,9}(?:\.\d+)?))?", re.ASCII)


@dataclass(frozen=True)
class Trial:
    """A line of a log."""

    line: int  # its number, from 1
    world: int  # number of the world, 0 to 299
    succeeded: bool
    collided: bool
    timed_out: bool
    seconds: float  # [s] by the challenge's clock
    logged: float  # the score in the log; NaN if it has none


@dataclass(frozen=True)
class LogScore:
    """The score of a log. Each mean is the mean over worlds of the mean over a world's trials, as in `report_test.py`."""

    trials: int  # number of lines
    worlds: int  # number of worlds
    scores: Mapping[str, float]  # mean score, by the formula's name
    success: float  # fraction of trials at the goal
    collided: float  # fraction of trials with a collision
    timed_out: float  # fraction of trials beyond the time limit
    seconds: float  # mean time of the trials at the goal [s]; NaN if there are none
    gaps: tuple[str, ...]  # what the log lacks of 50 worlds x 10 trials, or has beyond them
    notes: tuple[str, ...]  # lines that contradict the formula or repeat others

    def as_dict(self) -> dict[str, Any]:
        """Return the score, the formulas and published results as plain values."""
        known = {"formula": FORMULA, "formulas": [vars(one) for one in FORMULAS], "source": FORMULA_SOURCE}
        return {**vars(self), **known, "published": [vars(entry) for entry in PUBLISHED]}

    def lines(self, log: Path) -> Iterator[str]:
        """Yield the score of a log, what it lacks, and published results, as lines."""
        yield f"score {self.scores[OFFICIAL.name]:.4f}  {log}: {self.trials} trials, worlds: {self.worlds}"
        time = "" if math.isnan(self.seconds) else f", mean time {self.seconds:.4f} s"
        ends = {"succeeded": self.success, "collided": self.collided, "timed out": self.timed_out}
        yield f"  {', '.join(f'{100 * share:.1f} % {words}' for words, share in ends.items())}{time}"
        yield from (f"  incomplete: {gap}" for gap in self.gaps)
        yield from (f"  note: {note}" for note in self.notes)
        yield ""
        rows = ((one.name, f"{self.scores[one.name]:.4f}", f"{1 / one.least:.2f}", one.source) for one in FORMULAS)
        yield from table(("clip", "mean score", "at most", "used by"), rows)
        yield ""
        yield f"score: {FORMULA}"
        yield "means over worlds of the means over a world's trials"
        yield f"source: {FORMULA_SOURCE}"
        yield ""
        yield from published_lines()


def read_log(path: Path) -> list[Trial]:
    """Return the trials of a log; blank lines are skipped.

    Raises:
        InputError: the file is unreadable, empty, or has a malformed line, which is named.
    """
    text = read_bytes(path, MAX_LOG_BYTES, "a log of the challenge").decode("utf-8", "replace")
    trials = []
    for number, line in enumerate(text.split("\n"), 1):
        if words := line.strip(" \t\r"):
            try:
                trials.append(_trial(number, words.replace("\t", " ")))
            except ValueError as error:
                raise input_error(str(path), f"line {number}", str(error)) from None
    if not trials:
        raise input_error(str(path), f"holds no trial; each line is {SHAPE}")
    return trials


def _trial(number: int, line: str) -> Trial:
    match = _LINE.fullmatch(line)
    if match is None:
        raise ValueError(f"must be {SHAPE}; got {line[:60]!r}")
    world, *flags, seconds, logged = match.groups()
    succeeded, collided, timed_out = (flag == "1" for flag in flags)
    if int(world) >= 300:
        raise ValueError(
            f"world {world} is none of BARN's 0 to 299; only those have a reference path, so remove the line"
        )
    if succeeded == (collided or timed_out):
        raise ValueError("a trial must either succeed, or collide or time out; check the three flags")
    score = math.nan if logged is None else float(logged)
    return Trial(number, int(world), succeeded, collided, timed_out, float(seconds), score)


def score_log(trials: Sequence[Trial], formulas: Mapping[Formula, Mapping[str, float]]) -> LogScore:
    """Return the score of a log.

    Args:
        trials: the log's trials
        formulas: by formula, the time of each world's reference path [s], by the world's name; the first is compared with the
            scores in the log

    Raises:
        InputError: a world of the log has no reference path.
    """
    worlds: dict[int, list[Trial]] = {}
    for trial in trials:
        worlds.setdefault(trial.world, []).append(trial)
    known = set.intersection(*(set(times) for times in formulas.values()))
    if unknown := [world for world in sorted(worlds) if f"world_{world}" not in known]:
        raise InputError(
            f"no path_{unknown[0]}.npy for a world of the log; name a folder with the challenge's path_files"
        )

    def mean(value: Callable[[Trial], float]) -> float:
        return statistics.fmean(statistics.fmean(map(value, one)) for one in worlds.values())

    def scored(formula: Formula) -> Callable[[Trial], float]:
        times = formulas[formula]
        return lambda one: formula.score(one.succeeded, one.seconds, times[f"world_{one.world}"])

    means = [statistics.fmean(times) for one in worlds.values() if (times := [t.seconds for t in one if t.succeeded])]
    return LogScore(
        trials=len(trials),
        worlds=len(worlds),
        scores={formula.name: mean(scored(formula)) for formula in formulas},
        success=mean(lambda one: one.succeeded),
        collided=mean(lambda one: one.collided),
        timed_out=mean(lambda one: one.timed_out),
        seconds=statistics.fmean(means) if means else math.nan,
        gaps=tuple(_gaps({world: len(one) for world, one in worlds.items()})),
        notes=tuple(_notes(trials, scored(next(iter(formulas))))),
    )


def _gaps(counts: Mapping[int, int]) -> Iterator[str]:
    """Yield how the numbers of trials differ from the challenge's 50 public worlds with 10 trials each."""
    if missing := sorted(set(PUBLIC) - set(counts)):
        yield f"{len(PUBLIC) - len(missing)} of the {len(PUBLIC)} public worlds; missing: {few(missing, 10)}"
    if other := sorted(set(counts) - set(PUBLIC)):
        yield f"worlds that are not among the {len(PUBLIC)} public ones: {few(other, 10)}"
    for words, kept in (("fewer", range(TRIALS)), ("more", range(TRIALS + 1, sys.maxsize))):
        if found := [f"{world} ({counts[world]})" for world in sorted(counts) if counts[world] in kept]:
            yield f"worlds with {words} than {TRIALS} trials: {few(found, 10)}"


def _notes(trials: Sequence[Trial], scored: Callable[[Trial], float]) -> Iterator[str]:
    """Yield the lines whose logged score differs from the formula's, and successful trials that are there twice."""
    wrong = [one for one in trials if abs(one.logged - scored(one)) > 1e-4]  # NaN: no score, no difference
    if wrong:
        first = wrong[0]
        facts = f"line {first.line} has {first.logged:.4f} for {scored(first):.4f}"
        yield f"{len(wrong)} of {len(trials)} lines log another score; {facts}; logged scores are not used"
    counts = Counter((one.world, one.seconds) for one in trials if one.succeeded)
    if twice := [f"{world} ({seconds:.4f} s)" for (world, seconds), count in counts.items() if count > 1]:
        yield f"successful trials with the same world and time: {few(twice, 10)}"
