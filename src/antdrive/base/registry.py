"""Registries of components and their options. Other packages add components through entry points."""

from __future__ import annotations

import dataclasses
import difflib
import functools
import importlib.metadata
import inspect
import math
import numbers
import types
import typing
import warnings
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from types import MappingProxyType
from typing import Any, Generic, Literal, TypeVar, Union

from antdrive.base.components import ComponentError
from antdrive.base.errors import FieldError, InputError, visible
from antdrive.base.guarded import OverLimit, UserCode, error_text, one_line, place
from antdrive.base.records import meanings_of
from antdrive.base.user_code import (
    DIGITS,
    LOADED,
    is_plan_file,
    is_user_code,
    module_hash,
    record_name,
    user_code_version,
    user_object,
    word_of,
)
from antdrive.base.version import __version__

DECORATOR = "@dataclass(frozen=True, kw_only=True)"
LONGEST_LIST = 250  # characters of a list of choices beside close ones
Component = TypeVar("Component")


@dataclasses.dataclass(frozen=True)
class Registry(Generic[Component]):
    """The components of a kind: built in, of other packages, and in users' files.

    Attributes:
        error: their errors, which name the kind
        group: the entry-point group of other packages: an object, or its class
        known: returns the built-in ones by name
        unfit: returns what an object lacks to be one, as "no method plan(query, rng); write one"; empty if it is one
        calls: the number of arguments of each method
        base: a class whose subclasses must make all their options fields
        reserved: names in records that no class may have
        of_file: the class of components that are a plan's file, with options `file` and `digest`
    """

    error: type[ComponentError]
    group: str
    known: Callable[[], Mapping[str, Component]]
    unfit: Callable[[Any], str]
    calls: Mapping[str, tuple[str, ...]]
    base: type = object
    reserved: tuple[str, ...] = ()
    of_file: Callable[[], Component] | None = None

    @property
    def kind(self) -> str:
        """The kind in words and keys, such as planner."""
        return self.error.kind

    def load(self, name: str, home: Path | None = None, /, **options: Any) -> Component:
        """Return the named component with options set.

        Args:
            name: a registered name, FILE.py:CLASS or MODULE:CLASS for user code, or a plan's file
            home: folder of user code and of plans; None: the working directory
            options: the component's options by name; values may be text, as from a command line

        Raises:
            InputError: the name or an option is unknown, or the value is invalid; lists the valid choices. Its key is the kind,
                or the kind and the option.
        """
        if is_user_code(name):
            made = self._instance(user_object(name, home, self.error), f"{self.kind} {name!r}")
            self._require_own_name(record_name(name), type(made).__module__)
        elif name in self.known():
            made = self.known()[name]
        elif (entry := self._plugins().get(name)) is not None:
            made = self._load(entry)
        elif self.of_file is not None and (is_plan_file(name) or ((home or Path()) / name).is_dir()):
            made, options = self.of_file(), {"file": str((home or Path()) / name), **options}
        else:
            raise _error(self.kind, _unknown(name, [*self.known(), *self._plugins()], self.kind))
        return self._with_options(name, made, options)

    def _require_own_name(self, name: str, module: str) -> None:
        """Refuse a class of user code whose name in records is that of something else."""
        known = self.known()
        if not module.startswith("antdrive.") and name in {
            *known,
            *self.reserved,
            *(type(one).__name__ for one in known.values()),
        }:
            raise _error(self.kind, f"{name!r} is the name of a built-in {self.kind}; rename the class")

    def recorded(self, name: str, /, **options: Any) -> Component:
        """Return the component with a name in a record: one of user code that this process has loaded, or a registered one."""
        if name not in self.known() and (self.kind, name) in LOADED:
            made = self._instance(LOADED[self.kind, name], f"{self.kind} {name!r}")
            return self._with_options(name, made, options)
        return self.load(self.registered_name(name), **options)

    def of_record(self, name: str, settings: Mapping[str, Any], given: Component | str | None) -> Component:
        """Return the component with a name and settings in a record.

        Args:
            name: its name in the record
            settings: its options
            given: the component, FILE.py:CLASS, MODULE:CLASS or a plan's file; None: by its name

        Raises:
            InputError: it cannot be found, or has another name.
        """
        if given is None:
            return self.load(self.registered_name(name), **settings)
        if not isinstance(given, str):
            return given
        if self.of_file is not None and is_plan_file(given):
            return self.load(given, **settings)
        if record_name(given) not in (given, name):
            raise InputError(f"{self.kind}: the log's {self.kind} is {name!r:.60}, not {record_name(given)!r:.60}")
        if not is_user_code(given):
            rest = f"got {given!r:.60}; omit it for registered {self.kind}s"
            raise InputError(f"{self.kind}: write FILE.py:CLASS or MODULE:CLASS, {rest}")
        return self.load(given, **settings)

    def registered_name(self, name: str) -> str:
        """Return the registered name of a record's component, which may be that of its class."""
        named = [key for key, one in self.all().items() if name in (key, type(one).__name__)]
        if not named:
            raise InputError(
                f"record.{self.kind}.name: {name!r:.60} is not registered, so the run cannot be rebuilt; name its class "
                f"(--{self.kind} FILE.py:CLASS), or register it under the entry point {self.group}"
            )
        return name if name in named else named[0]

    def word_of(self, component: Component) -> str:
        """Return the name that loads a component: registered, or FILE.py:CLASS for one made in Python."""
        kind = type(component)
        registered = (name for some in (self.known, self.all) for name, one in some().items() if type(one) is kind)
        return next(registered, None) or word_of(component) or f"FILE.py:{kind.__name__}"

    def version(self, name: str) -> str:
        """Return the distribution and version of the component with a name; with the hash of its file if it is third-party.

        Raises:
            InputError: the component is unknown.
        """
        if is_user_code(name):
            return user_code_version(name, self.error)
        if name in self.known():
            return f"antdrive {__version__}"
        made: Any = self.load(name)
        entry = self._plugins().get(name)
        if entry is None:
            return f"{record_name(name)} {made.digest[:DIGITS]}"
        version = entry.dist.version if entry.dist is not None else "without version"
        return f"{_maker(entry)} {version} {module_hash(entry.module)}".rstrip()

    def all(self) -> Mapping[str, Component]:
        """Return all components by name, those of other packages last.

        A component that fails to load is omitted with a warning.
        """
        found = dict(self.known())
        for name, entry in self._plugins().items():
            try:
                found[name] = self._load(entry)
            except InputError as broken:
                warnings.warn(str(broken), stacklevel=2)
        return MappingProxyType(found)

    def _with_options(self, name: str, made: Component, options: Mapping[str, Any]) -> Component:
        if not options:
            return made
        known = {f.name for f in _fields(made)}
        with self._loading(f"{self.kind} {name!r}", ""):
            hints = _hints(typing.cast(type, type(made))) if known else {}
        values: dict[str, Any] = {}
        for key, value in options.items():
            if key not in known:
                raise _error(f"{self.kind}.{key}", _unknown(key, known, f"option of {name}"))
            values[key] = parse(f"{self.kind}.{key}", hints[key], value)
        try:
            with self._loading(f"{self.kind} {name!r}", "", (ValueError,)):
                return typing.cast(Component, dataclasses.replace(typing.cast(Any, made), **values))
        except FieldError as error:
            raise error.under(self.kind).as_input() from None
        except ValueError as error:  # from a third-party component
            raise _error(self.kind, one_line(str(error))) from None

    def _plugins(self) -> dict[str, importlib.metadata.EntryPoint]:
        entries: dict[str, importlib.metadata.EntryPoint] = {}
        built_in = self.known()
        for entry in importlib.metadata.entry_points(group=self.group):
            if entry.name in built_in or (entry.name in entries and entries[entry.name].value != entry.value):
                taken = "antdrive" if entry.name in built_in else _maker(entries[entry.name])
                warnings.warn(
                    f"{self.kind} {entry.name!r} of {_maker(entry)} is omitted: {taken} already has that name",
                    stacklevel=3,
                )
                continue
            entries.setdefault(entry.name, entry)
        return entries

    def _load(self, entry: importlib.metadata.EntryPoint) -> Component:
        who = f"{self.kind} {entry.name!r} of {_maker(entry)}"
        with self._loading(who, f" ({entry.value})"):
            made = entry.load()
        return self._instance(made, who, f" ({entry.value})")

    def _instance(self, made: Any, who: str, source: str = "") -> Component:
        """Return a third-party object or class as a component; `who` and `source` are for messages."""
        with self._loading(who, source):
            if issubclass(type(made), type) and (lacking := _mismatch(made)):
                raise self._unfit(f"{who} cannot be created{source}: give all its options default values ({lacking})")
            if issubclass(type(made), type) and (problem := _undeclared_options(made, self.base)):
                raise self._unfit(f"{who} cannot be created{source}: {problem}")
            component = made() if issubclass(type(made), type) else made
            if lacks := self.unfit(component):
                raise self._unfit(f"{who} is not a {self.kind}{source}: it has {lacks}")
            for method, names in self.calls.items():
                if wrong := _mismatch(getattr(component, method), *names):
                    called = f"{method}({', '.join(names)})"
                    raise self._unfit(f"{who} is not a {self.kind}{source}: its method must be {called} ({wrong})")
        return typing.cast(Component, component)

    def _unfit(self, message: str) -> InputError:
        """Return the error of a third-party component that cannot be used; the message names it, the problem without the key."""
        return InputError(visible(message), self.kind, visible(message.removeprefix(f"{self.kind} ")))

    def _loading(self, who: str, source: str, passing: tuple[type[Exception], ...] = ()) -> UserCode:
        """Return a block for the user's code that makes a component; `who` and `source` are for messages."""

        def error_of(error: BaseException) -> Exception:
            problem = f"{error_text(error)} ({place(error, None)})"
            if issubclass(type(error), OverLimit):
                return self.error(who.removeprefix(f"{self.kind} "), problem)
            return self._unfit(f"{who} cannot be loaded{source}: {problem}")

        return UserCode(who, error_of, passing)


def describe(component: object) -> str:
    """Return a one-line summary of a component, with the options that differ from its class defaults."""
    summary = (type(component).__doc__ or "No description.").strip().splitlines()[0]
    changed = [
        f"{f.name} {getattr(component, f.name)}"
        for f in _fields(component)
        if f.default is not dataclasses.MISSING and getattr(component, f.name) != f.default
    ]
    return f"{summary} With {', '.join(changed)}." if changed else summary


def options_card(component: object) -> dict[str, Any]:
    """Return the options of a component and their meanings, as plain values."""
    kind, names = type(component), [field.name for field in _fields(component)]
    options = {name: getattr(component, name) for name in names}
    plain = {
        name: one if isinstance(one, bool | int | float | str | None) else str(one) for name, one in options.items()
    }
    return {"options": plain, "meanings": meanings_of(kind)}


def parse(key: str, kind: Any, value: Any) -> Any:
    """Convert the value of an option to its type."""
    origin, members = typing.get_origin(kind), typing.get_args(kind)
    if origin in (Union, types.UnionType) and type(None) in members:
        if value is None or (isinstance(value, str) and value.strip().lower() in ("none", "null", "")):
            return None
        inner = tuple(m for m in members if m is not type(None))
        return parse(key, Union[inner], value)  # noqa: UP007 - the members are known only at run time
    if origin is Literal:
        for member in members:
            if value == member or (isinstance(value, str) and value == str(member)):
                return member
        raise _error(key, f"must be one of {', '.join(map(str, members))}; got {value!r}")
    if kind in _READERS:
        wanted, read = _READERS[kind]
        try:
            return read(value)
        except (ValueError, KeyError, OverflowError):
            raise _error(key, f"must be {wanted}, got {value!r}") from None
    if isinstance(value, str):
        raise _error(key, "cannot be given as text; set it from Python")
    return value


def _error(key: str, problem: str) -> InputError:
    return FieldError(key, problem).as_input()


def _whole(value: Any) -> int:
    if isinstance(value, bool) or not isinstance(value, str | numbers.Integral):
        raise ValueError
    return int(value)


def _real(value: Any) -> float:
    if isinstance(value, bool) or not isinstance(value, str | numbers.Real):
        raise ValueError
    number = float(value)
    if not math.isfinite(number):
        raise ValueError
    return number


def _truth(value: Any) -> bool:
    if isinstance(value, bool):
        return value
    if not isinstance(value, str):
        raise ValueError
    return {"true": True, "yes": True, "on": True, "1": True, "false": False, "no": False, "off": False, "0": False}[
        value.strip().lower()
    ]


def _text(value: Any) -> str:
    if not isinstance(value, str):
        raise ValueError
    return value


_READERS: Mapping[Any, tuple[str, typing.Callable[[Any], Any]]] = {
    int: ("a whole number", _whole),
    float: ("a finite number", _real),
    bool: ("true or false", _truth),
    str: ("text", _text),
}


@functools.cache
def _hints(kind: type) -> Mapping[str, Any]:
    """Return the types of a class's fields; reading them compiles their text."""
    return typing.get_type_hints(kind)


def _fields(component: object) -> tuple[dataclasses.Field[Any], ...]:
    kind = type(component)
    return tuple(f for f in dataclasses.fields(kind) if f.init) if dataclasses.is_dataclass(kind) else ()


def _unknown(name: str, choices: Iterable[str], what: str) -> str:
    choices = sorted(choices)
    if not choices:
        return f"no {what} is called {name!r}; it has none"
    close = difflib.get_close_matches(name, choices, n=3)
    hint = f"did you mean {' or '.join(close)}? " if close else ""
    listed = ", ".join(choices)
    if close and len(listed) > LONGEST_LIST:
        return f"no {what} is called {name!r}; {hint.rstrip()}"
    return f"no {what} is called {name!r}; {hint}choose from {listed}"


def _undeclared_options(kind: type, options_base: type) -> str:
    """Return how to declare options that a subclass of a base fails to make fields; empty if it makes all fields."""
    known: set[str] = set()
    for base in reversed(kind.__mro__):
        typed = {name for name, hint in vars(base).get("__annotations__", {}).items() if "ClassVar" not in str(hint)}
        is_record = "__dataclass_fields__" in vars(base)
        lost = sorted(name for name in typed if not (is_record or name.startswith("_")))
        untyped = sorted(known & set(vars(base)) - typed)
        if options_base is not object and issubclass(base, options_base) and lost:
            return f"the options of {base.__name__} ({', '.join(lost)}) need {DECORATOR} above the class"
        if untyped:
            value, name = vars(base)[untyped[0]], untyped[0]
            typed_line = f"{name}: {type(value).__name__} = {value!r:.20}"
            return f"{base.__name__} sets {name} without a type; write `{typed_line}`, and {DECORATOR} above the class"
        known |= typed if is_record else set()
    return ""


def _mismatch(function: Any, *arguments: Any) -> str:
    """Return why a function cannot be called with these arguments; empty if it can, or if its signature is unknown."""
    if (
        inspect.iscoroutinefunction(function)
        or inspect.isgeneratorfunction(function)
        or inspect.isasyncgenfunction(function)
    ):
        return "it is asynchronous, or yields"
    try:
        signature = inspect.signature(function)
    except ValueError as error:
        return str(error) if isinstance(function, types.MethodType) else ""  # compiled
    try:
        signature.bind(*arguments)
    except TypeError as error:
        return str(error)
    return ""


def _maker(entry: importlib.metadata.EntryPoint) -> str:
    return entry.dist.name if entry.dist is not None else "an unnamed distribution"
