"""Baselines that belong to no test."""

from __future__ import annotations

import json
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from pathlib import Path

from antdrive.base.errors import InputError
from antdrive.runs.suites.names import select
from antdrive.runs.suites.suite import BASELINES, SUFFIX, SuiteCase, baseline_folder, load_suite, shown_path


def unused_beside(words: Sequence[str]) -> list[str]:
    """The baselines beside the suites that words name which belong to no test, as people name them."""
    suites = dict.fromkeys(case.suite for case in select(words))
    return sorted({shown_path(path) for suite in suites for path in unused_of_suite(suite, load_suite(suite))})


def unused_of_suite(suite: Path, cases: Iterable[SuiteCase]) -> Iterator[Path]:
    """The baselines in a suite's folder that belong to none of its tests, and those of suites and modules that are gone."""
    suite = suite.resolve()  # as the tests' own paths are
    used = {case.baseline_path for case in cases if case.entry.baseline}
    if not suite.with_name(
        suite.name.removesuffix(SUFFIX) + ".py"
    ).exists():  # else they share it: see unused_of_module
        yield from (path for path in _files(baseline_folder(suite)) if path not in used)
    for folder in sorted((suite.parent / BASELINES).glob("*/")):
        owners = (suite.parent / f"{folder.name}{SUFFIX}", suite.parent / f"{folder.name}.py")
        if not any(owner.exists() for owner in owners):
            yield from _files(folder)


def unused_of_module(module: Path, tests: Iterable[str]) -> Iterator[Path]:
    """The baselines in the folder of a module of tests that belong to none of its tests."""
    names = tuple(tests)
    for path, case in _of_module(module):
        if not any(_belongs(case, name) for name in names):
            yield path


def unused_drives_of_module(module: Path, drives: Mapping[str, Collection[str]]) -> Iterator[Path]:
    """The baselines in the folder of a module of tests that belong to drives which their tests no longer make."""
    for path, case in _of_module(module):
        owners = [name for name in drives if _belongs(case, name)]
        if owners and case not in drives[max(owners, key=len)]:
            yield path


def _belongs(case: str, test: str) -> bool:
    """Whether a baseline is that of a test's only drive, or of a drive that has a name."""
    return case == test or case.startswith(f"{test}-")


def _of_module(module: Path) -> Iterator[tuple[Path, str]]:
    """The baselines in a module's folder, each with the name that it holds; without those of a suite of the same name."""
    beside = module.resolve().with_suffix(SUFFIX)
    used: set[Path] = set()
    if beside.exists():
        try:
            used = {case.baseline_path for case in load_suite(beside)}
        except InputError:  # is told where the suite is collected
            return
    for path in _files(module.parent / BASELINES / module.stem):
        if path.resolve() in used:
            continue
        try:
            yield path, str(json.loads(path.read_text(encoding="utf-8"))["case"])
        except (OSError, ValueError, KeyError, TypeError):
            yield path, ""


def _files(folder: Path) -> list[Path]:
    return sorted(folder.glob("*.json"))
