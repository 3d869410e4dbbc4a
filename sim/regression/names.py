"""What a suite names: worlds, robots and planners, of the catalogue or in files beside it. Loads no compiler."""

from __future__ import annotations

import contextlib
import functools
import importlib
import importlib.util
import sys
from collections.abc import Iterator, Mapping
from importlib.machinery import PathFinder
from pathlib import Path
from types import ModuleType
from typing import Any

from antdrive.planners.own_code import from_source
from antdrive.planners.plan import Planner
from antdrive.planners.registry import load_planner, make_planner
from antdrive.robots.files import list_robots
from antdrive.sim.regression.suite import SuiteCase
from antdrive.worlds.errors import InputError
from antdrive.worlds.files.checks import show, suggest
from antdrive.worlds.files.world_file import list_worlds

#: Where a planner comes from: a key of the mapping, beside its options.
SOURCES = ("module", "file")
#: What the names of modules begin with that were loaded from a file.
FROM_FILE = "_antdrive_suite_"

_OWNERS: dict[
    str, Path
] = {}  # the folder of suites that each module was imported for and lies in, by the module's name
_ASIDE: dict[Path, dict[str, ModuleType]] = {}  # modules whose names another folder's modules have at present


def check_names(case: SuiteCase) -> None:
    """Check what can be checked of a test without reading worlds and robots: that all it names exists.

    Raises:
        InputError: something is missing; the message has the suite's file, line and key.
    """
    entry = case.entry
    if isinstance(entry.world, str):
        world_path(case, entry.world)
    robot_path(case)
    if not (isinstance(entry.planner, dict) and any(key in entry.planner for key in SOURCES)):
        planner_of(case)


def world_path(case: SuiteCase, name: str) -> Path:
    """The file of a world that a test names.

    Args:
        case: the test
        name: a name of the catalogue, or a path relative to the suite

    Raises:
        InputError: there is no such world.
    """
    return _path(case, "world", name, list_worlds())


def robot_path(case: SuiteCase) -> Path:
    """The file of a test's robot.

    Raises:
        InputError: there is no such robot.
    """
    return _path(case, "robot", case.entry.robot, list_robots())


def planner_of(case: SuiteCase) -> tuple[Planner, str]:
    """The planner of a test, and its name in records.

    Raises:
        InputError: there is no such planner, module, file or option, or an option does not take the value.
    """
    given = case.entry.planner
    options = {"name": given} if isinstance(given, str) else dict(given)
    name, sources = options.pop("name", None), {key: options.pop(key) for key in SOURCES if key in options}
    if not isinstance(name, str):
        raise case.error("planner.name", "missing; write the planner's name, or that of its class in a module or file")
    if len(sources) > 1:
        raise case.error("planner.file", "a planner comes from a module or from a file; keep one")
    try:
        if not sources:
            return load_planner(name, **options), name
        ((key, source),) = sources.items()
        if not isinstance(source, str):
            raise case.error(f"planner.{key}", f"must be text, got {show(source)}")
        made = _attribute(case, key, source, name)
        return make_planner(made, name, **options), name
    except InputError as error:
        text = str(error)
        if text.startswith("planner.") and ": " in text:  # an option
            option, _, problem = text.partition(": ")
            raise case.error(option, problem) from None
        raise (error if text.startswith(case.document.source) else _at_planner(case, text)) from None


def is_importable_elsewhere(planner: Planner) -> bool:
    """Whether other processes can import a planner's class; those of files and modules beside a suite only this one can."""
    home = type(planner).__module__
    return not home.startswith(FROM_FILE) and home not in _OWNERS


def _path(case: SuiteCase, key: str, name: str, known: Mapping[str, Path]) -> Path:
    """A file of the catalogue, or one relative to the suite; the catalogue's names come first."""
    if name in known:
        return known[name]
    path = case.suite.parent / name
    if not path.is_file():
        hint = suggest(Path(name).stem, known)
        raise case.error(key, f"{name}: no such file beside the suite, nor in the catalogue; {hint}")
    return path


def _at_planner(case: SuiteCase, text: str) -> InputError:
    return case.error("planner", text.removeprefix("planner: "))


def _attribute(case: SuiteCase, key: str, source: str, name: str) -> Any:
    """What a module or a file of people's own calls `name`."""
    try:
        module = _from_file(case, source) if key == "file" else _from_module(case, source)
    except InputError:
        raise
    except SystemExit as error:
        problem = f"{source}: ends the program while it is imported (exit code {error.code}); guard what it runs"
        raise case.error(f"planner.{key}", f'{problem} with if __name__ == "__main__"') from error
    except Exception as error:  # people's own code may raise anything while it is imported
        raise case.error(f"planner.{key}", f"{source}: cannot be imported ({type(error).__name__}: {error})") from error
    if not hasattr(module, name):
        names = [word for word in vars(module) if not word.startswith("_")]
        raise case.error(
            "planner.name", f"{source} has no {name!r}; {suggest(name, names) if names else 'it is empty'}"
        )
    return getattr(module, name)


def _from_module(case: SuiteCase, source: str) -> ModuleType:
    """A module that can be imported, or one in the suite's folder."""
    folder, top = case.suite.parent, source.partition(".")[0]
    with _importing_for(folder):
        module = importlib.import_module(source)
    own, taken = _module_in(folder, top), getattr(sys.modules[top], "__file__", None)
    if own is not None and taken is not None and Path(taken).resolve() != own:
        problem = f"{top} is imported from {taken}, and there is one beside the suite"
        raise case.error("planner.module", f"{problem}; give it another name, or write file: and the path")
    return module


def _from_file(case: SuiteCase, source: str) -> ModuleType:
    """A file's module, loaded once per process and version of the file."""
    path = (case.suite.parent / source).resolve()
    if not path.is_file():
        raise case.error("planner.file", f"{source}: no such file beside the suite")
    return _loaded(path, path.stat().st_mtime_ns)


@functools.lru_cache(maxsize=64)
def _loaded(path: Path, mtime: int) -> ModuleType:
    name = f"{FROM_FILE}{path.stem}_{abs(hash(path)):x}"
    with _importing_for(path.parent):
        return from_source(name, path)


@contextlib.contextmanager
def _importing_for(folder: Path) -> Iterator[None]:
    """A context in which modules are also looked for in the working directory and a suite's folder, after all others.

    Modules of other suites' folders are set aside where this folder has one of the same name.
    """
    for name, owner in list(_OWNERS.items()):
        if owner != folder and _module_in(folder, name.partition(".")[0]) is not None:
            del _OWNERS[name]
            if name in sys.modules:
                _ASIDE.setdefault(owner, {})[name] = sys.modules.pop(name)
    for name, module in _ASIDE.pop(folder, {}).items():
        sys.modules[name], _OWNERS[name] = module, folder
    before = set(sys.modules)
    try:
        with _looking_in(Path.cwd(), folder):
            yield
    finally:
        for name in set(sys.modules) - before:
            file = getattr(sys.modules[name], "__file__", None)
            if file is not None and not name.startswith(FROM_FILE) and Path(file).resolve().is_relative_to(folder):
                _OWNERS[name] = folder


def _module_in(folder: Path, name: str) -> Path | None:
    """The file of a module or package in a folder; None if there is none."""
    found = PathFinder.find_spec(name, [str(folder)])
    return Path(found.origin).resolve() if found is not None and found.origin is not None else None


@contextlib.contextmanager
def _looking_in(*folders: Path) -> Iterator[None]:
    """A context in which modules are also looked for in some folders, after all others."""
    added = [str(folder) for folder in folders if str(folder) not in sys.path]
    sys.path.extend(added)
    try:
        yield
    finally:
        for folder in added:
            sys.path.remove(folder)
