"""Planners in people's own files and modules: FILE.py:CLASS, or MODULE:CLASS."""

from __future__ import annotations

import contextlib
import difflib
import functools
import hashlib
import importlib
import importlib.machinery
import importlib.util
import inspect
import sys
from collections.abc import Iterator
from pathlib import Path
from types import CodeType, ModuleType
from typing import Any

from antdrive.base.errors import InputError, Terminated, input_error

DIGITS = 8  # hexadecimal digits of a file's hash
FROM_FILE = "_antdrive_user_"  # what the names of modules begin with that were loaded from a file

#: The folder that each module was imported for and lies in, by the module's name.
_OWNERS: dict[str, Path] = {}
#: Modules whose names another folder's modules have at present.
_ASIDE: dict[Path, dict[str, ModuleType]] = {}


def is_user_code(name: str) -> bool:
    """Whether a planner's name is that of a file or module, and not a registered one."""
    return ":" in name


def record_name(name: str) -> str:
    """What records and tables call a planner: the registered name, or that of the class in a file or module.

    Args:
        name: what `load_planner` takes
    """
    return name.rpartition(":")[2]


class UserCodeError(InputError):
    """A file or module of people's own is not there, cannot be imported, or lacks the class.

    Attributes:
        problem: what is wrong, on one line
        of_class: whether the file or module is there and lacks the class
    """

    def __init__(self, problem: str, of_class: bool = False) -> None:
        super().__init__(str(input_error(problem)), of_class)
        self.problem, self.of_class = str(self.args[0]), of_class

    def __str__(self) -> str:
        return f"planner: {self.problem}"


def user_object(name: str) -> Any:
    """What a file or module of people's own calls by the name behind the last colon."""
    source, _, word = name.rpartition(":")
    return load_object(source, word, is_file=source.endswith(".py"))


def load_object(source: str, word: str, folder: Path | None = None, *, is_file: bool) -> Any:
    """What a file or module of people's own calls by a name.

    A file is read again when its content has changed. Folders may have modules of the same name.
    """
    try:
        module = _from_file(source, folder) if is_file else _from_module(source, folder)
    except (InputError, Terminated):
        raise
    except SystemExit as error:
        problem = f"{source}: ends the program while it is imported (exit code {error.code}); guard what it runs"
        raise UserCodeError(f'{problem} with if __name__ == "__main__"') from error
    except Exception as error:  # people's own code may raise anything while it is imported
        raise UserCodeError(f"{source}: cannot be imported ({type(error).__name__}: {error})") from error
    if not word or not hasattr(module, word):
        raise UserCodeError(f"{source} has no {word!r}; {_choices(module, word)}", of_class=True)
    return getattr(module, word)


def is_importable_elsewhere(planner: object) -> bool:
    """Whether other processes can import a planner's class; those of files and modules beside a suite only this one can."""
    home = type(planner).__module__
    return not home.startswith(FROM_FILE) and home not in _OWNERS


def user_code_version(name: str) -> str:
    """What the code of a file or module is: its name and the beginning of its hash."""
    source = name.rpartition(":")[0]
    if source.endswith(".py"):
        return f"{Path(source).name} {_hash(_content(Path(source)))}"
    return f"{source} {module_hash(source)}".rstrip()


def module_hash(name: str) -> str:
    """The beginning of the hash of a module's file; empty where it has none."""
    file = getattr(sys.modules.get(name), "__file__", None)
    return _hash(Path(file).read_bytes()) if file is not None and Path(file).is_file() else ""


def _hash(content: bytes) -> str:
    return hashlib.sha256(content).hexdigest()[:DIGITS]


def _content(path: Path) -> bytes:
    try:
        return path.read_bytes()
    except FileNotFoundError:
        raise UserCodeError(f"{path}: no such file") from None
    except OSError as error:
        raise UserCodeError(f"{path}: cannot be read ({error.strerror})") from None


def _choices(module: ModuleType, word: str) -> str:
    """A hint at what could be meant by a name that a module lacks: its planners, or all that it has."""
    known = {name: value for name, value in vars(module).items() if not name.startswith("_")}
    planners = [name for name, value in known.items() if inspect.getattr_static(value, "plan", None) is not None]
    close = difflib.get_close_matches(word, planners or known, n=1)
    return f"did you mean {close[0]}?" if close else f"it has {', '.join(planners or known) or 'nothing'}"


def _from_module(name: str, folder: Path | None) -> ModuleType:
    """A module that can be imported, or one in the working directory or a folder."""
    if folder is None and str(Path.cwd()) not in sys.path and "" not in sys.path:
        sys.path.append(str(Path.cwd()))  # for good: other processes are given this path; a command's begins elsewhere
    home, top = (folder or Path()).resolve(), name.partition(".")[0]
    with _importing_for(home, owned=folder is not None):
        module = importlib.import_module(name)
    own, taken = _module_in(home, top), getattr(sys.modules.get(top), "__file__", None)
    if own is not None and taken is not None and Path(taken).resolve() != own:
        where = "beside the suite" if folder is not None else "in the working directory"
        problem = f"{top} is imported from {taken}, and there is one {where}"
        raise UserCodeError(f"{problem}; give it another name, or name its file")
    return module


def _from_file(source: str, folder: Path | None) -> ModuleType:
    path = (folder or Path()) / source
    return _loaded(path.resolve(), _hash(_content(path)))


class _Source(importlib.machinery.SourceFileLoader):
    """Compiles the file as it is: a cached compilation may be that of another text of the same second and length."""

    def get_code(self, fullname: str) -> CodeType:
        path = self.get_filename(fullname)
        return self.source_to_code(self.get_data(path), path)


def from_source(name: str, path: Path) -> ModuleType:
    """A new module that runs a file as it is now, and is known by its name meanwhile and afterwards."""
    spec = importlib.util.spec_from_loader(name, _Source(name, str(path)))
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module  # dataclasses look their module up
    try:
        spec.loader.exec_module(module)
    except BaseException:
        del sys.modules[name]
        raise
    return module


@functools.lru_cache(maxsize=64)
def _loaded(path: Path, content: str) -> ModuleType:
    """A file's module, loaded once per process and content of the file. It may import modules beside it."""
    name = f"{FROM_FILE}{path.stem}_{abs(hash((path, content))):x}"
    with _importing_for(path.parent, owned=True):
        return from_source(name, path)


@contextlib.contextmanager
def _importing_for(folder: Path, *, owned: bool) -> Iterator[None]:
    """A context in which modules are also looked for in the working directory and a folder, after all others.

    Modules of other folders are set aside where this folder has one of the same name.
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
        with _extended_path(Path.cwd(), folder):
            yield
    finally:
        for name in set(sys.modules) - before if owned else ():
            file = getattr(sys.modules[name], "__file__", None)
            if file is not None and not name.startswith(FROM_FILE) and Path(file).resolve().is_relative_to(folder):
                _OWNERS[name] = folder


def _module_in(folder: Path, name: str) -> Path | None:
    """The file of a module or package in a folder; None if there is none."""
    spec = importlib.machinery.PathFinder.find_spec(name, [str(folder)])
    return Path(spec.origin).resolve() if spec is not None and spec.origin is not None else None


@contextlib.contextmanager
def _extended_path(*folders: Path) -> Iterator[None]:
    """A context in which modules are also looked for in some folders, after all others."""
    added = [text for text in dict.fromkeys(map(str, folders)) if text not in sys.path]
    sys.path.extend(added)
    try:
        yield
    finally:
        for text in added:
            sys.path.remove(text)
