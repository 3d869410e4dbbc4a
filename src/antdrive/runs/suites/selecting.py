"""Which tests people mean by what they write: files, folders, SUITE::scenario, SUITE::scenario[seed], patterns."""

from __future__ import annotations

import fnmatch
from collections.abc import Iterator, Sequence
from pathlib import Path

from antdrive.base.checks import suggest
from antdrive.base.errors import input_error
from antdrive.runs.suites.names import check_names
from antdrive.runs.suites.suite import SUFFIX, SuiteCase, load_suite


def select(words: Sequence[str], only: str | None = None) -> list[SuiteCase]:
    """The tests that words name, each once, in their order.

    Args:
        words: suites, folders with suites, SUITE::scenario or SUITE::scenario[seed]
        only: a pattern with * and ? that a scenario's name must match

    Raises:
        InputError: there is no such suite or test, or something in a suite is wrong.
    """
    found: dict[tuple[Path, str], SuiteCase] = {}
    for word in words:
        for case in _named(word):
            if only is None or fnmatch.fnmatchcase(case.name, only) or case.id == only:
                found.setdefault((case.suite, case.id), case)
    for case in found.values():
        check_names(case)
    if not found:
        raise input_error("--only", f"no test of {' '.join(words)} matches {only!r}")
    return list(found.values())


def _named(word: str) -> Iterator[SuiteCase]:
    """The tests that one word names."""
    place, mark, wanted = word.partition("::")
    if mark and not wanted:
        raise input_error(word, f"names no test; write {place} for all, or {place}::SCENARIO")
    path = Path(place)
    if path.is_dir() and not wanted:
        suites = sorted(path.rglob(f"*{SUFFIX}"))
        if not suites:
            raise input_error(word, f"holds no suites; their names end in {SUFFIX}")
        for suite in suites:
            yield from load_suite(suite)
        return
    if path.is_file() and not path.name.endswith(SUFFIX):
        raise input_error(word, f"is no suite; the name of a suite ends in {SUFFIX}")
    cases = load_suite(path)
    chosen = [case for case in cases if wanted in ("", case.name, case.id)]
    if not chosen:
        raise input_error(place, f"no test {wanted!r}; {suggest(wanted, [case.id for case in cases])}")
    yield from chosen
