"""Detection of unused baselines."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from pathlib import Path

from antdrive.base.errors import InputError
from antdrive.base.files import MAX_JSON_BYTES, parse_json, read_bytes
from antdrive.runs.suites.scenarios import select
from antdrive.runs.suites.suite import BASELINES, SUFFIX, SuiteCase, baseline_folder, load_suite, shown_path


def unused_beside(words: Sequence[str]) -> list[str]:
    """Return the unused baselines of the named suites."""
    suites = dict.fromkeys(case.suite for case in select(words))
    return sorted({shown_path(path) for suite in suites for path in unused_of_suite(suite, load_suite(suite))})


def unused_of_suite(suite: Path, cases: Iterable[SuiteCase]) -> Iterator[Path]:
    """Yield a suite's unused baselines, and baselines of removed suites and modules."""
    suite = suite.resolve()  # like the tests' paths
    used = {case.baseline_path for case in cases if case.entry.baseline}
    if not suite.with_name(
        suite.name.removesuffix(SUFFIX) + ".py"
    ).exists():  # otherwise they share the folder: see unused_of_module
        yield from (path for path in _files(baseline_folder(suite)) if path not in used)
    for folder in sorted((suite.parent / BASELINES).glob("*/")):
        owners = (suite.parent / f"{folder.name}{SUFFIX}", suite.parent / f"{folder.name}.py")
        if not any(owner.exists() for owner in owners):
            yield from _files(folder)


def unused_of_module(module: Path, tests: Iterable[str]) -> Iterator[Path]:
    """Yield the unused baselines of a test module."""
    names = tuple(tests)
    for path, case in _of_module(module):
        if not any(_belongs(case, name) for name in names):
            yield path


def unused_drives_of_module(module: Path, drives: Mapping[str, Collection[str]]) -> Iterator[Path]:
    """Yield a test module's baselines of removed drives."""
    for path, case in _of_module(module):
        owners = [name for name in drives if _belongs(case, name)]
        if owners and case not in drives[max(owners, key=len)]:
            yield path


def _belongs(case: str, test: str) -> bool:
    """Return whether a baseline belongs to a test, to its only drive or a named one."""
    return case == test or case.startswith(f"{test}-")


def _of_module(module: Path) -> Iterator[tuple[Path, str]]:
    """Yield the baselines of a test module with the names they hold, except those of a suite of the same name."""
    beside = module.resolve().with_suffix(SUFFIX)
    used: set[Path] = set()
    if beside.exists():
        try:
            used = {case.baseline_path for case in load_suite(beside)}
        except InputError:  # reported when the suite is collected
            return
    for path in _files(module.parent / BASELINES / module.stem):
        if path.resolve() in used:
            continue
        try:
            yield path, str(parse_json(read_bytes(path, MAX_JSON_BYTES))["case"])
        except (ValueError, KeyError, TypeError, RecursionError):
            yield path, ""


def _files(folder: Path) -> list[Path]:
    return sorted(folder.glob("*.json"))
