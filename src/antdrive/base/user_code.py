"""Components in users' files and modules: FILE.py:CLASS, or MODULE:CLASS."""

from __future__ import annotations

import contextlib
import difflib
import functools
import hashlib
import importlib
import importlib.machinery
import importlib.util
import inspect
import os
import re
import sys
import traceback
from collections import Counter
from collections.abc import Collection, Iterator, Sequence
from pathlib import Path, PurePath
from types import CodeType, ModuleType
from typing import Any

from antdrive.base.components import ComponentError
from antdrive.base.document import MAX_BYTES
from antdrive.base.errors import FieldError, InputError
from antdrive.base.files import file_name, read_bytes
from antdrive.base.guarded import OverLimit, UserCode, error_text, place, value_text

FROZEN_BASE = "cannot inherit non-frozen dataclass"  # message of Python about a dataclass without frozen=True
DIGITS = 8  # hexadecimal digits of a file's hash
FROM_FILE = "_antdrive_user_"  # name prefix of modules loaded from files

#: Suffixes of files that hold plans.
PLAN_SUFFIXES = (".csv", ".txt", ".geojson", ".json", ".mcap", ".db3", ".bag")
#: Users' classes that this process has loaded, by their kinds and names in records; the latest of a name.
LOADED: dict[tuple[str, str], Any] = {}
#: The words that named users' code, by class: FILE.py:CLASS or MODULE:CLASS, seen from the working directory.
_WORDS: dict[type, str] = {}
#: The folder of each user module, by the module's name.
_OWNERS: dict[str, Path] = {}
#: Modules set aside while a module of the same name from another folder is in use.
_ASIDE: dict[Path, dict[str, ModuleType]] = {}


class _Unusable(FieldError):
    """A user's file or module is missing, fails to import, or lacks the class."""


def is_user_code(name: str) -> bool:
    """Return whether a component's name refers to a file or module instead of the registry."""
    return (":" in name or name.endswith(".py")) and not is_plan_file(name)


def file_and_topic(name: str) -> tuple[str, str]:
    """Return the file and the topic of FILE:/TOPIC; the topic is empty without one."""
    found = re.search(r":(/[\w/]+)$", name)
    return (name[: found.start()], found[1]) if found else (name, "")


def is_plan_file(name: str) -> bool:
    """Return whether a name refers to a plan's file: by its suffix, as FILE:/TOPIC, or as a folder, by its slash."""
    file, topic = file_and_topic(name)
    is_folder = "/" in file and ":" not in file and not file.endswith(".py")
    return bool(topic) or is_folder or PurePath(file).suffix.lower() in PLAN_SUFFIXES


def file_and_rest(name: str) -> tuple[str, str]:
    """Return the file of a component's name, and the rest that names a class or topic in it; no file for other names."""
    if not is_plan_file(name):
        source, mark, word = name.rpartition(":")
        return (source, f"{mark}{word}") if source.endswith(".py") else ("", name)
    file, topic = file_and_topic(name)
    return file.rstrip("/"), f":{topic}" if topic else "" if PurePath(file).suffix else "/"


def record_name(name: str) -> str:
    """Return a component's name in records and tables: the registered name, the class of user code, or a plan's file."""
    file, topic = file_and_topic(name)
    return PurePath(file.rpartition(":")[2]).name + topic.replace("/", "-")


def label_names(names: Sequence[str], taken: Collection[str] = ()) -> list[str]:
    """Return labels for tables and folders: `Greedy` for `mine.py:Greedy`, or `mine-Greedy` if another one is a Greedy.

    The names differ; labels in `taken` are in use.
    """
    short = [record_name(name) for name in names]
    used = Counter([*short, *taken])
    found: list[str] = []
    for name, label in zip(names, short, strict=True):
        if is_user_code(name) and used[label] > 1:
            source = "-".join(Path(name.rpartition(":")[0].removesuffix(".py")).parts[-2:])
            label = f"{file_name(source, '-_').strip('_-')}-{label}"
        unique, number = label, 2
        while unique in found or (unique != label and unique in used):
            unique, number = f"{label}-{number}", number + 1
        found.append(unique)
    return found


def user_object(name: str, home: Path | None, kind: type[ComponentError]) -> Any:
    """Return a named object of a user's file or module.

    A file is read again after its content changes. Different folders may contain modules of the same name.

    Args:
        name: FILE.py:NAME or MODULE:NAME
        home: folder of the file or the module; None: the working directory
        kind: the error of its kind of component

    Raises:
        InputError: the file or module is missing, fails to import, or lacks the name.
    """
    try:
        return _user_object(name, home, kind)
    except _Unusable as error:
        raise error.under(kind.kind).as_input() from error.__cause__


def _user_object(name: str, home: Path | None, kind: type[ComponentError]) -> Any:
    source, _, word = (f"{name}:" if name.endswith(".py") else name).rpartition(":")
    is_file = source.endswith(".py")
    if is_file and home is not None and not (home / source).is_file():
        raise _Unusable("", f"{source}: no such file beside the suite")
    with UserCode(f"{kind.kind} {source}:{word}", functools.partial(_import_error, source, kind), (_Unusable,)):
        module = _from_file(source, home) if is_file else _from_module(source, home)
    if not word:
        raise _Unusable("", f"{source} names no class; write {source}:CLASS; {_choices(module, word, kind)}")
    if not hasattr(module, word):
        raise _Unusable("", f"{source} has no {word!r}; {_choices(module, word, kind)}")
    made = LOADED[kind.kind, word] = getattr(module, word)
    path = (home or Path()) / (source if is_file else f"{source}.py")
    beside = home is not None and path.is_file()
    _WORDS[made if isinstance(made, type) else type(made)] = f"{os.path.relpath(path)}:{word}" if beside else name
    return made


def word_of(component: object) -> str | None:
    """Return the words that named a component of user code in this process, FILE.py:CLASS or MODULE:CLASS; None if none did."""
    return _WORDS.get(type(component))


def _import_error(source: str, kind: type[ComponentError], error: BaseException) -> Exception:
    """Return the error of a file or module that cannot be imported."""
    at = place(error, os.path.realpath(source))
    if issubclass(type(error), OverLimit):
        return kind(source, f"{error_text(error)} on import ({at})")
    if issubclass(type(error), SystemExit):
        problem = f"{source}: calls exit on import (exit code {value_text(error.args[0] if error.args else 0)}, {at})"
        return _Unusable("", f'{problem}; guard its script code with if __name__ == "__main__"')
    for frame, _ in traceback.walk_tb(error.__traceback__):
        declared = frame.f_locals.get("cls")
        if frame.f_code.co_name == "_process_class" and FROZEN_BASE in error_text(error):
            name = getattr(declared, "__name__", "the class")
            return _Unusable("", f"{source}: {name} needs @dataclass(frozen=True), as its base class has ({at})")
    return _Unusable("", f"{source}: cannot be imported ({', '.join(filter(None, (error_text(error), at)))})")


def is_importable_elsewhere(component: object) -> bool:
    """Return whether other processes can import a component's class; false for files and for modules beside a suite."""
    home = type(component).__module__
    return not home.startswith(FROM_FILE) and home not in _OWNERS


def user_code_version(name: str, kind: type[ComponentError]) -> str:
    """Return the name of a user's file or module with the beginning of its hash.

    Args:
        name: FILE.py:NAME or MODULE:NAME
        kind: the error of its kind of component

    Raises:
        InputError: it cannot be loaded.
    """
    user_object(name, None, kind)
    source = name.rpartition(":")[0]
    if source.endswith(".py"):
        return f"{Path(source).name} {_hash(_content(Path(source)))}"
    return f"{source} {module_hash(source)}".rstrip()


def module_hash(name: str) -> str:
    """Return the beginning of the hash of a module's file; empty without a file."""
    file = module_file(name)
    return _hash(_content(file)) if file.is_file() else ""


def module_file(name: str) -> Path:
    """Return the file of an imported module, its name if it has no file."""
    return Path(getattr(sys.modules.get(name), "__file__", None) or name)


def _hash(content: bytes) -> str:
    return hashlib.sha256(content).hexdigest()[:DIGITS]


def _content(path: Path) -> bytes:
    try:
        return read_bytes(path, MAX_BYTES, "a Python file")
    except InputError as error:
        raise _Unusable("", str(error)) from None


def _choices(module: ModuleType, word: str, kind: type[ComponentError]) -> str:
    """Return a hint for an unknown name: the closest match, the module's components of a kind, or all its names."""
    known = {name: value for name, value in vars(module).items() if not name.startswith("_")}
    own = {name: value for name, value in known.items() if getattr(value, "__module__", None) == module.__name__}
    fitting = [name for name, value in own.items() if inspect.getattr_static(value, kind.methods[0], None) is not None]
    close = difflib.get_close_matches(word, fitting or known, n=1)
    return f"did you mean {close[0]}?" if close else f"it has {', '.join(fitting or known) or 'nothing'}"


def _from_module(name: str, folder: Path | None) -> ModuleType:
    """Import a module from the import path, the working directory or a folder."""
    if folder is None and str(Path.cwd()) not in sys.path and "" not in sys.path:
        sys.path.append(str(Path.cwd()))  # permanently: worker processes inherit this path
    home, top = (folder or Path()).resolve(), name.partition(".")[0]
    with _importing_for(home, owned=folder is not None):
        module = importlib.import_module(name)
    own, taken = _module_in(home, top), getattr(sys.modules.get(top), "__file__", None)
    if own is not None and taken is not None and Path(taken).resolve() != own:
        where = "beside the suite" if folder is not None else "in the working directory"
        problem = f"{top} is imported from {taken}, but another one exists {where}"
        raise _Unusable("", f"{problem}; rename it, or name its file")
    return module


def _from_file(source: str, folder: Path | None) -> ModuleType:
    path = (folder or Path()) / source
    content = _hash(_content(path))
    return _loaded(path.resolve(), content)


class _Source(importlib.machinery.SourceFileLoader):
    """A loader that always compiles: cached bytecode may stem from a text of equal length saved in the same second."""

    def get_code(self, fullname: str) -> CodeType:
        path = self.get_filename(fullname)
        return self.source_to_code(self.get_data(path), path)


def from_source(name: str, path: Path) -> ModuleType:
    """Execute a file as a new module and register it under a name."""
    spec = importlib.util.spec_from_loader(name, _Source(name, str(path)))
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module  # dataclasses look up their module
    try:
        spec.loader.exec_module(module)
    except BaseException:
        del sys.modules[name]
        raise
    return module


@functools.lru_cache(maxsize=64)
def _loaded(path: Path, content: str) -> ModuleType:
    """Load a file as a module, once per process and file content. It may import modules beside it."""
    name = f"{FROM_FILE}{path.stem}_{abs(hash((path, content))):x}"
    with _importing_for(path.parent, owned=True):
        return from_source(name, path)


@contextlib.contextmanager
def _importing_for(folder: Path, *, owned: bool) -> Iterator[None]:
    """Search the working directory and a folder for modules within this block, after the import path.

    Modules of other folders that share a name with one in this folder are set aside.
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
    """Return the file of a module or package in a folder; None if there is none."""
    spec = importlib.machinery.PathFinder.find_spec(name, [str(folder)])
    return Path(spec.origin).resolve() if spec is not None and spec.origin is not None else None


@contextlib.contextmanager
def _extended_path(*folders: Path) -> Iterator[None]:
    """Append folders to the import path within this block."""
    added = [text for text in dict.fromkeys(map(str, folders)) if text not in sys.path]
    sys.path.extend(added)
    try:
        yield
    finally:
        for text in added:
            sys.path.remove(text)
