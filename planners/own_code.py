"""Planners in people's own files and modules: FILE.py:CLASS, or MODULE:CLASS."""

from __future__ import annotations

import functools
import hashlib
import importlib
import importlib.util
import sys
from pathlib import Path
from types import ModuleType
from typing import Any

from antdrive.worlds import InputError

DIGITS = 8  # hexadecimal digits of a file's hash


def is_own(name: str) -> bool:
    """Whether a planner's name is that of a file or module, and not a registered one.

    Args:
        name: what people call the planner
    """
    return ":" in name


def record_name(name: str) -> str:
    """What records and tables call a planner: the registered name, or that of the class in a file or module.

    Args:
        name: what `load_planner` takes
    """
    return name.rpartition(":")[2]


def own_object(name: str) -> Any:
    """What a file or module of people's own calls by the name behind the last colon.

    Args:
        name: FILE.py:CLASS or MODULE:CLASS

    Raises:
        InputError: there is no such file, module or class, or it cannot be imported.
    """
    source, _, word = name.rpartition(":")
    try:
        module = _from_file(Path(source)) if source.endswith(".py") else _from_module(source)
    except InputError:
        raise
    except SystemExit as error:
        raise InputError(
            f"planner: {source}: ends the program while it is imported (exit code {error.code}); guard what it runs "
            'with if __name__ == "__main__"'
        ) from error
    except Exception as error:  # people's own code may raise anything while it is imported
        problem = f"cannot be imported ({type(error).__name__}: {error})"
        raise InputError(f"planner: {source}: {problem}") from error
    if not word or not hasattr(module, word):
        names = ", ".join(one for one in vars(module) if not one.startswith("_")) or "nothing"
        raise InputError(f"planner: {source} has no {word!r}; it has {names}")
    return getattr(module, word)


def own_version(name: str) -> str:
    """What the code of a file or module is: its name and the beginning of its hash.

    Args:
        name: FILE.py:CLASS or MODULE:CLASS

    Raises:
        InputError: the file cannot be read.
    """
    source = name.rpartition(":")[0]
    if source.endswith(".py"):
        return f"{Path(source).name} {_hash(_content(Path(source)))}"
    return f"{source} {module_hash(source)}".rstrip()


def module_hash(name: str) -> str:
    """The beginning of the hash of a module's file; empty where it has none.

    Args:
        name: of a module that is imported
    """
    file = getattr(sys.modules.get(name), "__file__", None)
    return _hash(Path(file).read_bytes()) if file is not None and Path(file).is_file() else ""


def _hash(content: bytes) -> str:
    return hashlib.sha256(content).hexdigest()[:DIGITS]


def _content(path: Path) -> bytes:
    try:
        return path.read_bytes()
    except FileNotFoundError:
        raise InputError(f"planner: {path}: no such file") from None
    except OSError as error:
        raise InputError(f"planner: {path}: cannot be read ({error.strerror})") from None


def _from_module(name: str) -> ModuleType:
    if str(Path.cwd()) not in sys.path and "" not in sys.path:  # a command's path begins with its own folder
        sys.path.append(str(Path.cwd()))
    return importlib.import_module(name)


def _from_file(path: Path) -> ModuleType:
    return _loaded(path.resolve(), _hash(_content(path)))


@functools.lru_cache(maxsize=64)
def _loaded(path: Path, content: str) -> ModuleType:
    """A file's module, loaded once per process and content of the file. It may import modules beside it."""
    name = f"_antdrive_own_{path.stem}_{abs(hash((path, content))):x}"
    spec = importlib.util.spec_from_file_location(name, path)
    if spec is None or spec.loader is None:
        raise ImportError("is not a Python file")
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module  # dataclasses look their module up
    beside = str(path.parent)
    added = beside not in sys.path
    if added:
        sys.path.append(beside)
    try:
        spec.loader.exec_module(module)
    except BaseException:
        del sys.modules[name]
        raise
    finally:
        if added:
            sys.path.remove(beside)
    return module
