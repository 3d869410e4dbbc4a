"""Candidate scenarios for a minimal reproducer: each runs at most once, within a time budget; a journal keeps answers."""

from __future__ import annotations

import functools
import itertools
import json
import time
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path

from antdrive.base.atomic import write_text
from antdrive.base.components import ComponentError
from antdrive.base.errors import FieldError, InputError
from antdrive.base.files import MAX_JSON_BYTES, parse_json, read_bytes
from antdrive.base.user_code import is_importable_elsewhere
from antdrive.base.version import versions
from antdrive.runs.failures.failure import Attempt, Failure, failure_of, failure_of_error
from antdrive.runs.pool import Pool
from antdrive.runs.suites.demands import Bound
from antdrive.sim.log.outcome import Outcome
from antdrive.sim.log.rollout import Rollout
from antdrive.sim.pipeline import ENDED_BY, Run, plan, run
from antdrive.sim.scenario import Scenario
from antdrive.worlds.passage import feasible

JOURNAL_EVERY = 2.0  # shortest interval between writes of the journal, except the last [s]


class OutOfTimeError(Exception):
    """The time budget is spent."""


def failure_in(scenario: Scenario, bound: Bound | None = None, *, drive: bool = True) -> Failure | None:
    """Run a scenario and return its failure; None if it does not fail or cannot be run."""
    try:
        if drive:
            return failure_of(run(scenario), bound)
        grid, answer = plan(scenario)
        return None if answer.solved else failure_of(Run(scenario, grid, answer), bound)
    except ComponentError as error:
        return None if bound is not None else failure_of_error(error)
    except (FieldError, InputError):  # such as a wanderer without a free cell in a smaller world
        return None


def room_in(scenario: Scenario, failure: Failure) -> float | None:
    """Return the clearance with which a path exists in the world of a failing scenario [m]; None if none exists.

    This is the clearance that the scenario claims. If the planner found no path, one cell is added where a path with that
    exists, so that the grid cannot explain the failure.
    """
    task, claimed = scenario.task, scenario.inflate
    more = [claimed + (scenario.cell or task.cell)] if failure.outcome == Outcome.NO_PATH.key else []
    return next((clearance for clearance in (*more, claimed) if feasible(task, clearance)), None)


class CandidateRunner:
    """Runner that finds the candidates that fail in one given way, in worlds with as much room.

    The answers depend on the candidates alone, not on time, processes or the journal.

    Attributes:
        stage: name of the current pass, for the progress
        made: number of candidates run so far
        recalled: candidates whose answers came from an earlier session's journal
    """

    def __init__(
        self,
        wanted: Failure,
        bound: Bound | None = None,
        *,
        room: float | None = None,
        seconds: float = float("inf"),
        journal: Path | None = None,
        identity: str = "",
        jobs: int = 1,
        progress: Callable[[str, int], None] | None = None,
    ) -> None:
        self.stage, self.made, self.recalled = "", 0, set[str]()
        self._room, self._pool = room, Pool(max(1, jobs))
        self._wanted, self._bound, self._jobs, self._progress = wanted, bound, max(1, jobs), progress
        self._deadline = time.monotonic() + seconds
        self._journal, self._written = journal, time.monotonic()
        header = {
            "failure": (wanted.outcome, wanted.touched, wanted.cause),
            "bound": str(bound),
            "room": room,
            "versions": versions(),
            "of": identity,
        }
        self._header = json.dumps(header, sort_keys=True)
        self._answers = _read(journal, self._header)
        self._known = frozenset(self._answers)
        self._latest: tuple[str, Rollout | None] | None = None

    def first(self, candidates: Iterable[Scenario | None]) -> Scenario | None:
        """Return the first candidate that fails in the wanted way, or None; skip candidates that are None."""
        waiting = (candidate for candidate in candidates if candidate is not None)
        while batch := list(itertools.islice(waiting, self._jobs)):
            keys = [candidate.key for candidate in batch]
            self._try([(key, candidate) for key, candidate in zip(keys, batch, strict=True)])
            for key, candidate in zip(keys, batch, strict=True):
                if self._answers[key]:
                    return candidate
        return None

    def rollout(self, scenario: Scenario) -> Rollout | None:
        """Return the drive of a scenario known to fail; None if it fails before driving."""
        key = scenario.key
        if self._latest is None or self._latest[0] != key:
            self._latest = key, Attempt.of(scenario).rollout
        return self._latest[1]

    def forget(self) -> None:
        """Drop all answers, including the journal's."""
        self._answers.clear()
        self._known, self._latest = frozenset(), None
        self.save()

    def close(self) -> None:
        """End the processes and write the journal."""
        self._pool.close()
        self.save()

    def save(self) -> None:
        """Write the journal, if there is one."""
        self._written = time.monotonic()
        if self._journal is not None:
            text = json.dumps({"header": self._header, "answers": self._answers}, indent=0, sort_keys=True)
            write_text(self._journal, text + "\n")

    def _try(self, batch: list[tuple[str, Scenario]]) -> None:
        self.recalled |= {key for key, _ in batch} & self._known
        fresh = {key: candidate for key, candidate in batch if key not in self._answers}
        if not fresh:
            return
        if time.monotonic() > self._deadline:
            raise OutOfTimeError
        self._answers.update(zip(fresh, self._run(list(fresh.values())), strict=True))
        self.made += len(fresh)
        if self._progress is not None:
            self._progress(self.stage, self.made)
        if time.monotonic() - self._written > JOURNAL_EVERY:
            self.save()

    def _run(self, candidates: list[Scenario]) -> Iterator[bool]:
        drive = self._wanted.outcome not in {outcome.key for outcome in ENDED_BY.values()}
        tried = functools.partial(failure_in, bound=self._bound, drive=drive)
        own = candidates[0].planner, candidates[0].controller
        if len(candidates) == 1 or not all(map(is_importable_elsewhere, own)):
            failures = [tried(candidate) for candidate in candidates]
        else:
            failures = list(self._pool.results(tried, candidates))
        return (
            failure == self._wanted and (self._room is None or feasible(candidate.task, self._room))
            for candidate, failure in zip(candidates, failures, strict=True)
        )


def identity_of(scenario: Scenario) -> str:
    """Return a text that is equal for equal scenarios, also with planners and controllers that are no records."""
    return f"{scenario.key} {_text_of(scenario.planner)} {_text_of(scenario.controller)}"


def _text_of(component: object) -> str:
    """Return a component as text, by class and attributes if its `repr` is the default, whose address differs per process."""
    kind = type(component)
    if kind.__repr__ is not object.__repr__:
        return repr(component)
    return f"{kind.__module__}.{kind.__qualname__}({sorted(getattr(component, '__dict__', {}).items())})"


def _read(journal: Path | None, header: str) -> dict[str, bool]:
    """Read an earlier session's answers about the same failure; empty without such a session."""
    try:
        data = parse_json(read_bytes(journal, MAX_JSON_BYTES)) if journal is not None else {}
        answers = data["answers"] if data.get("header") == header else {}
    except (ValueError, AttributeError, KeyError, RecursionError):
        return {}
    return {str(key): value is True for key, value in answers.items()} if isinstance(answers, dict) else {}
