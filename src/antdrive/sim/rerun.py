"""Rerun: the scenario of a log driven again, and compared with the log value by value.

It compares every array, and every key of the record that does not declare itself a claim. The machine and versions that
wrote a log reproduce it bit for bit; `ROUNDING` is the tolerance for others. A custom planner that does not repeat its own
plan is named before anything else is blamed.
"""

from __future__ import annotations

import dataclasses
import hashlib
import itertools
import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from antdrive.base.components import ComponentError
from antdrive.base.errors import FieldError
from antdrive.base.plane import wrap_angle
from antdrive.base.types import Floats
from antdrive.base.version import versions
from antdrive.planners import Planner, PlanResult, TimedPlan, is_built_in
from antdrive.robots import Controller
from antdrive.sim.log.outcome import Outcome
from antdrive.sim.log.record import PROOFS, Evidence, plain_value
from antdrive.sim.log.rollout import FORMS, NOISY, ROWS, Rollout
from antdrive.sim.pipeline import driven, plan
from antdrive.sim.recorded import rebuilt
from antdrive.sim.scenario import Scenario

ROUNDING = 1e-3  # tolerance of a rerun on another machine or version [m], [rad], [m/s], [rad/s]
SAME_NOISE = 1e-6  # the same of estimates and motor targets where the rerun repeats the motion bit for bit
LONGER = 1.0  # a rerun may outlast its log by this time [s]
LONGEST = 60  # characters of a value in a message
UNSTEADY = "own code gives another run for the same seed; draw random numbers from a planner's rng only"


@dataclass(frozen=True)
class ReplayCheck:
    """Differences between a rerun and its log."""

    exact: bool  # whether everything compared agrees bit for bit
    position: float  # largest distance between poses of both [m]; nan without a rerun, as the next two
    turn: float  # largest difference of headings [rad]
    twist: float  # largest difference of speeds [m/s] or yaw rates [rad/s]
    problems: tuple[str, ...]  # why the log cannot come from a drive, one sentence each
    rounded: tuple[str, ...] = ()  # arrays and keys of the record that agree within rounding only

    @property
    def sentence(self) -> str:
        """The result in words."""
        if self.exact:
            return "replayed bit for bit"
        if math.isnan(self.position):
            return "not replayed"
        same = "the replay differs" if self.problems else "replayed within rounding"
        same += f" ({', '.join(self.rounded)})" if self.rounded and not self.problems else ""
        if not any(off > 0 for off in (self.position, self.turn, self.twist)):  # the difference is elsewhere
            return same
        return f"{same}: at most {self.position:.3g} m, {self.turn:.3g} rad and {self.twist:.3g} m/s or rad/s off"

    def as_dict(self) -> dict[str, Any]:
        """Return the comparison as plain values, for JSON."""
        return {"exact": self.exact, "position_m": self.position, "turn_rad": self.turn, "twist": self.twist}


def offsets(rollout: Rollout, again: Rollout) -> tuple[float, float, float]:
    """Return the largest differences of positions [m], headings [rad] and speeds [m/s, rad/s] in rows that both logs have."""
    rows = min(len(rollout.t), len(again.t))
    moved, twist = again.pose[:rows] - rollout.pose[:rows], again.twist[:rows] - rollout.twist[:rows]
    offs: tuple[Floats, ...] = (np.hypot(moved[:, 0], moved[:, 1]), wrap_angle(moved[:, 2]), twist)
    position, turn, change = (float(np.abs(off).max()) for off in offs)
    return position, turn, change


@dataclass(frozen=True)
class Mismatch:
    """Value that differs between log and rerun."""

    name: str  # the array, or the dotted key of the record
    text: str  # the values of a key, or where an array differs first
    row: float = math.inf  # the first row of an array that differs; infinite for keys and for arrays without rows
    rounded: bool = False  # whether the difference is within `ROUNDING`


def fingerprint(s: Scenario) -> str:
    """Return a hash of a scenario's plan, and of its drive if the robot replans; of the message if the planner raises."""
    try:
        if _drives_count(s):
            _, answer, rollout = driven(s)
            return fingerprint_of(s, answer, rollout)
        return fingerprint_of(s, plan(s)[1], None)
    except ComponentError as error:
        return str(error)


def fingerprint_of(s: Scenario, answer: PlanResult, rollout: Rollout | None) -> str:
    """Return the `fingerprint` of a scenario that was run.

    Args:
        s: the scenario
        answer: its plan
        rollout: the log of its drive; None without one
    """
    times = (answer.arrive, answer.leave) if isinstance(answer, TimedPlan) else ()
    sha = hashlib.sha256(answer.status.name.encode())
    for array in (answer.line, *times):
        sha.update(array.tobytes())
    if rollout is not None and _drives_count(s):
        sha.update(rollout.drive_digest.encode())
    return sha.hexdigest()


def _drives_count(s: Scenario) -> bool:
    """Return whether a drive can differ for equal plans: the robot replans, or follows by user code."""
    return s.moving or s.mapless or not is_built_in(s.controller)


def is_unsteady(s: Scenario, first: str, elsewhere: Callable[[], str | None] = lambda: None) -> bool:
    """Return whether a custom planner or controller gives another run for the same seed, here or in a new process.

    Args:
        s: the scenario
        first: `fingerprint_of` its run
        elsewhere: returns `fingerprint(s)` of a new process; None if that is unknown
    """
    custom = not (is_built_in(s.planner) and is_built_in(s.controller))
    return custom and (fingerprint(s) != first or elsewhere() not in (None, first))


def replayed(
    rollout: Rollout,
    planner: Planner | str | None = None,
    elsewhere: Callable[[], str | None] = lambda: None,
    controller: Controller | str | None = None,
) -> ReplayCheck:
    """Drive a log's scenario again, and compare every value.

    Args:
        rollout: the log
        planner: the planner; FILE.py:CLASS or MODULE:CLASS: custom code with the record's settings; None: the registered
            planner of the record's name
        elsewhere: returns `rerun_fingerprint` of the log in a new process; None if that is unknown
        controller: the controller, likewise
    """
    try:
        s = rerun_scenario(rollout, planner, controller)
        answer, again = _driven(s, rollout)
    except (ComponentError, ValueError) as error:
        return ReplayCheck(False, math.nan, math.nan, math.nan, (f"replay: {error}",))
    found = sorted(mismatches(rollout, again), key=lambda one: one.row)
    wrong = [one for one in found if not one.rounded]
    problems = [*_sentences(wrong)]
    if wrong and is_unsteady(s, fingerprint_of(s, answer, again), elsewhere):
        problems.append(f"replay: {UNSTEADY}")
    elif any(one.name == "cells" for one in wrong):  # `run` does not record that it was given a plan
        problems.append("replay: another planner, or another version of it, made the log's plan")
    other = {name: version for name, version in versions().items() if rollout.record.versions.get(name) != version}
    if problems and other:
        logged = ", ".join(f"{name} {rollout.record.versions.get(name, 'of no version')}" for name in other)
        problems.append(f"replay: the log says {logged}, here {_words(other)}; other versions may drive differently")
    rounded = tuple(one.name for one in found if one.rounded)
    return ReplayCheck(not found, *offsets(rollout, again), tuple(problems), rounded)


def rerun_fingerprint(
    log: Path, planner: Planner | str | None = None, controller: Controller | str | None = None
) -> str:
    """Return the `fingerprint` of a log's scenario.

    Args:
        log: the log's file
        planner: as in `rebuilt`
        controller: as in `rebuilt`
    """
    return fingerprint(rerun_scenario(Rollout.load(log), planner, controller))


def rerun(
    rollout: Rollout, planner: Planner | str | None = None, controller: Controller | str | None = None
) -> Rollout:
    """Drive the scenario of a log again, for little longer than the log.

    Args:
        rollout: the log
        planner: as in `rebuilt`
        controller: as in `rebuilt`

    Raises:
        InputError: the planner or the controller cannot be found by its name.
        FieldError: the record is no scenario, or its plan fails.
        PlannerError: the planner raised an exception, or its answer is not a `PlanResult`.
        ControllerError: the controller raised an exception, or its command is not a finite `Twist`.
    """
    return _driven(rerun_scenario(rollout, planner, controller), rollout)[1]


def rerun_scenario(
    rollout: Rollout, planner: Planner | str | None = None, controller: Controller | str | None = None
) -> Scenario:
    """Return the scenario of a log for a drive that lasts little longer than the log.

    Args:
        rollout: the log
        planner: as in `rebuilt`
        controller: as in `rebuilt`
    """
    record = rollout.record
    limit = min(record.time_limit, float(rollout.t[-1]) + LONGER)
    return dataclasses.replace(rebuilt(record, planner, controller), planner_name=record.planner.name, time_limit=limit)


def _driven(s: Scenario, rollout: Rollout) -> tuple[PlanResult, Rollout]:
    """Return the plan and the drive of a log's scenario."""
    record = rollout.record
    stopped = rollout.outcome is Outcome.STOPPED  # by a loop that left its session early, for reasons of its own
    periods = (len(rollout.t) - 1) * record.control_hz // record.physics_hz if stopped else math.inf
    _, answer, again = driven(s, periods=periods)
    if again is None:
        raise FieldError("cells", f"planning again ends with {answer.status.name.lower()}: {answer.reason}")
    # The digest covers claims as well, and the shorter time limit is not the record's.
    kept = dataclasses.replace(again.record, digest=record.digest, time_limit=record.time_limit)
    if stopped:
        kept = dataclasses.replace(kept, reason=record.reason)
    return answer, dataclasses.replace(again, record=kept)


def mismatches(rollout: Rollout, again: Rollout) -> Iterator[Mismatch]:
    """Yield every array and every key of the record that differs, claims excepted."""
    same = all(np.array_equal(getattr(rollout, name), getattr(again, name)) for name in ("pose", "twist"))
    allowed = {name: SAME_NOISE if same and form.shape[0] == NOISY else ROUNDING for name, form in FORMS.items()}
    arrays = [one for name in FORMS for one in _of_array(name, rollout, again, allowed[name])]
    yield from arrays
    logged, computed = plain_value(rollout.record), plain_value(again.record)
    for key, proof in PROOFS.items():
        if proof is not Evidence.CLAIM:
            yield from _of_key(key, logged, computed, exact=not arrays)


def _sentences(wrong: Sequence[Mismatch]) -> Iterator[str]:
    """Yield a sentence for the arrays that first differ in one place, and for each key."""
    for text, some in itertools.groupby(wrong, key=lambda one: one.text):
        names = ", ".join(one.name for one in some)
        yield (
            f"replay: {names}: {text}" if names.startswith("record.") else f"replay: the rerun differs in {names}{text}"
        )


def _of_array(name: str, rollout: Rollout, again: Rollout, rounding: float) -> Iterator[Mismatch]:
    """Yield the difference of an array, with the time of its first row beyond rounding."""
    logged, computed = getattr(rollout, name), getattr(again, name)
    if logged.shape == computed.shape and logged.tobytes() == computed.tobytes():
        return
    both = min(len(logged), len(computed))
    if logged.shape[1:] != computed.shape[1:]:
        yield Mismatch(name, f": {_shape(computed)} in place of {_shape(logged)}")
        return
    off = np.abs(logged[:both].astype(np.float64) - computed[:both])
    if name in ("pose", "estimate"):
        off[:, 2] = np.abs(wrap_angle(off[:, 2]))
    allowed = rounding if logged.dtype.kind == "f" else 0.0
    wrong = (off > allowed).any(axis=tuple(range(1, off.ndim)))
    first = int(wrong.argmax()) if wrong.any() else both
    if first == len(logged) == len(computed):
        yield Mismatch(name, "", rounded=True)
    elif name == "cells":
        yield Mismatch(name, f", from cell {first + 1}")
    elif name == "route":
        yield Mismatch(name, f", from point {first + 1}")
    else:
        row = _row(name, first, rollout if first < len(logged) else again)
        yield Mismatch(name, f", from t = {row / rollout.record.physics_hz:.3f} s", row)


def _row(name: str, entry: int, rollout: Rollout) -> int:
    """Return the row of an array's entry."""
    if FORMS[name].shape[0] in (ROWS, NOISY):
        return entry
    return int(rollout.scan_rows[entry] if name.startswith("scan") else getattr(rollout, name)[entry, 0])


def _shape(array: npt.NDArray[Any]) -> str:
    return " × ".join(map(str, array.shape))


def _of_key(key: str, logged: Any, computed: Any, *, exact: bool) -> Iterator[Mismatch]:
    """Yield the difference of a key of the record; equal arrays excuse no rounding."""
    first, second = (_at(value, key) for value in (logged, computed))
    if first == second:
        return
    text = f"{_short(first)} in the log, {_short(second)} in the rerun"
    yield Mismatch(f"record.{key}", text, rounded=not exact and _within_rounding(first, second))


def _at(value: Any, key: str) -> Any:
    """Return the value at a dotted key, a list for `[]`; None if there is none."""
    name, _, rest = key.partition(".")
    inner = value.get(name.removesuffix("[]")) if isinstance(value, dict) else None
    if not rest:
        return inner
    return [_at(one, rest) for one in inner or ()] if name.endswith("[]") else _at(inner, rest)


def _within_rounding(a: Any, b: Any) -> bool:
    """Return whether two plain values differ by rounding alone."""
    if isinstance(a, dict) and isinstance(b, dict):
        return a.keys() == b.keys() and all(_within_rounding(a[key], b[key]) for key in a)
    if isinstance(a, list) and isinstance(b, list):
        return len(a) == len(b) and all(map(_within_rounding, a, b))
    if isinstance(a, float) and isinstance(b, float):
        return math.isclose(a, b, rel_tol=0.0, abs_tol=ROUNDING)
    return type(a) is type(b) and bool(a == b)


def _short(value: Any) -> str:
    text = " ".join(repr(value).split())
    return text if len(text) <= LONGEST else f"{text[:LONGEST]}…"


def _words(named: dict[str, str]) -> str:
    return ", ".join(f"{name} {version}" for name, version in named.items())
