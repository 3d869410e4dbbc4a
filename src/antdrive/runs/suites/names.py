"""Names in suites: tests, worlds, robots and planners. Loads no compiler."""

from __future__ import annotations

import fnmatch
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from antdrive.base.checks import resolve, show, suggest
from antdrive.base.errors import FieldError, InputError, input_error
from antdrive.planners.plan import Planner
from antdrive.planners.registry import PLANNERS, load_planner, make_planner
from antdrive.planners.user_code import UserCodeError, is_user_code, load_object, record_name
from antdrive.robots.robot_file import list_robots
from antdrive.runs.suites.suite import SUFFIX, SuiteCase, load_suite
from antdrive.sim.settings import tested_settings
from antdrive.worlds.files.world_file import list_worlds

#: Keys of a planner entry that give its source; other keys are options.
SOURCES = frozenset({"module", "file"})


def check_names(case: SuiteCase) -> None:
    """Check that everything a test names exists, without reading worlds and robots."""
    entry = case.entry
    if isinstance(entry.world, str):
        world_path(case, entry.world)
    robot_path(case)
    if not is_own_entry(entry.planner):
        planner_of(case)


def world_path(case: SuiteCase, name: str) -> Path:
    """Return the file of a test's world."""
    return _path(case, "world", name, list_worlds())


def robot_path(case: SuiteCase) -> Path:
    """Return the file of a test's robot."""
    return _path(case, "robot", case.entry.robot, list_robots())


def planner_of(case: SuiteCase) -> tuple[Planner, str]:
    """Return the planner of a test, and its name in records."""
    given = case.entry.planner
    options = {"name": given} if isinstance(given, str) else dict(given)
    name, sources = options.pop("name", None), {key: options.pop(key) for key in SOURCES if key in options}
    if not isinstance(name, str):
        raise case.error("planner.name", "missing; write the planner's name, or that of its class in a module or file")
    if len(sources) > 1:
        raise case.error("planner.file", "use either module or file")
    try:
        if not sources and not is_user_code(name):
            return load_planner(name, **options), name
        made = _own(case, name, sources)
        return make_planner(made, record_name(name), **options), record_name(name)
    except InputError as error:
        text = str(error)
        if text.startswith("planner.") and ": " in text:  # an option
            option, _, problem = text.partition(": ")
            raise case.error(option, problem) from None
        raise (
            error if text.startswith(case.document.source) else case.error("planner", text.removeprefix("planner: "))
        ) from None


def is_own_entry(planner: str | Mapping[str, Any]) -> bool:
    """Return whether a suite's entry names a planner in a file or module."""
    name = planner if isinstance(planner, str) else planner.get("name")
    sources = () if isinstance(planner, str) else (key for key in SOURCES if key in planner)
    return any(sources) or (isinstance(name, str) and is_user_code(name))


def case_settings(case: SuiteCase) -> dict[str, Any]:
    """Return the settings of a test by key."""
    planner = case.entry.planner
    name = planner if isinstance(planner, str) else planner.get("name")
    return tested_settings(case.given, custom=name not in PLANNERS or is_own_entry(planner))


def _path(case: SuiteCase, key: str, name: str, known: Mapping[str, Path]) -> Path:
    """Return a file of the catalogue, or one relative to the suite; the catalogue takes precedence."""
    try:
        return resolve(key, name, known, case.suite.parent)
    except FieldError as error:
        raise case.error(key, error.problem) from None


def _own(case: SuiteCase, name: str, sources: Mapping[str, Any]) -> Any:
    """Import custom code by name, from FILE.py:NAME, MODULE:NAME or a key of `SOURCES`."""
    if not sources:
        key, (source, _, word) = "planner", name.rpartition(":")
        is_file, of_word = source.endswith(".py"), key
    else:
        ((key, source),) = sources.items()
        key, word, is_file, of_word = f"planner.{key}", name, key == "file", "planner.name"
        if not isinstance(source, str):
            raise case.error(key, f"must be text, got {show(source)}")
        if is_user_code(name):
            raise case.error(of_word, f"must be only the class, as {key} gives its place, got {show(name)}")
    if is_file and not (case.suite.parent / source).is_file():
        raise case.error(key, f"{source}: no such file beside the suite")
    try:
        return load_object(source, word, case.suite.parent, is_file=is_file)
    except UserCodeError as error:
        raise case.error(of_word if error.of_class else key, error.problem) from error


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
        check_names(case)
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
