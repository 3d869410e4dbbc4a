"""Tests of suites by name, their scenarios, and the commands that run them alone."""

from __future__ import annotations

import fnmatch
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from antdrive.base.checks import suggest
from antdrive.base.errors import input_error
from antdrive.runs.suites.suite import SUFFIX, SuiteCase, load_suite

if TYPE_CHECKING:
    from antdrive.sim.scenario import Scenario


def scenario_of(case: SuiteCase, choose: Callable[[Scenario], Scenario] | None = None) -> Scenario:
    """Return the scenario of a suite's test.

    Recently read files of worlds and robots are cached by their text.

    Args:
        case: the test
        choose: chooses the margin if the suite says auto; None: by calibration

    Raises:
        InputError: an item of the suite is missing or invalid; the message has the suite's file, line and key.
    """
    from antdrive.runs.margins.choice import with_chosen_margin
    from antdrive.sim.scenario import Scenario

    return Scenario.read(case.written, case.suite.parent, case.error, choose=choose or with_chosen_margin)


def run_command(case: SuiteCase, *, anywhere: bool = False) -> str | None:
    """Return the `antdrive run` command of a test's scenario; None if only `antdrive check` can run it."""
    home = case.suite.parent
    words = case.written.seen_from_here(home, anywhere=anywhere)
    package = home / words.planner.partition(":")[0].partition(".")[0]
    elsewhere = anywhere or home != Path.cwd()
    return None if elsewhere and package.is_dir() else words.command()


def select(words: Sequence[str], only: str | None = None) -> list[SuiteCase]:
    """Return the selected tests, each once, in order.

    Args:
        words: suites, folders with suites, SUITE::scenario or SUITE::scenario[seed]
        only: a pattern with * and ? for the scenario's name

    Raises:
        InputError: a suite or test is missing or invalid.
    """
    selected: dict[tuple[Path, str], SuiteCase] = {}
    for word in words:
        for case in _named(word):
            if only is None or fnmatch.fnmatchcase(case.name, only) or case.id == only:
                selected.setdefault((case.suite, case.id), case)
    for case in selected.values():
        case.check_names()
        case.written.check_settings(case.error)
    if not selected:
        raise input_error("--only", f"no test of {' '.join(words)} matches {only!r}")
    return list(selected.values())


def _named(word: str) -> Iterator[SuiteCase]:
    """Yield the tests named by one word."""
    place, mark, wanted = word.partition("::")
    if mark and not wanted:
        raise input_error(word, f"names no test; write {place} for all, or {place}::SCENARIO")
    path = Path(place)
    if path.is_dir() and not wanted:
        suites = sorted(path.rglob(f"*{SUFFIX}"))
        if not suites:
            raise input_error(word, f"contains no suites; their names end in {SUFFIX}")
        for suite in suites:
            yield from load_suite(suite)
        return
    if path.is_file() and not path.name.endswith(SUFFIX):
        raise input_error(word, f"not a suite; its name must end in {SUFFIX}")
    cases = load_suite(path)
    chosen = [case for case in cases if wanted in ("", case.name, case.id)]
    if not chosen:
        raise input_error(place, f"no test {wanted!r}; {suggest(wanted, [case.id for case in cases])}")
    yield from chosen
