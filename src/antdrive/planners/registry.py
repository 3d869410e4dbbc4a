"""Registry of planners and their options. Other packages add planners through entry points."""

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
from collections.abc import Iterable, Mapping
from pathlib import Path
from types import MappingProxyType
from typing import Any, Literal, Union

from antdrive.base import FieldError, InputError
from antdrive.base.errors import visible
from antdrive.base.guarded import OverLimit, UserCode, error_text, one_line, place
from antdrive.base.optional import PLANNER_GROUP
from antdrive.base.version import __version__
from antdrive.planners.anyangle.ga_han import GaHan
from antdrive.planners.anyangle.hybrid import Hybrid
from antdrive.planners.anyangle.tangent import Tangent
from antdrive.planners.colonies.catalog import ANT_PLANNERS
from antdrive.planners.errors import PlannerError
from antdrive.planners.graph.apf import PotentialField
from antdrive.planners.graph.incremental import DStar, DStarLite
from antdrive.planners.graph.search import AStar, Dijkstra
from antdrive.planners.graph.sipp import SafeIntervals
from antdrive.planners.plan import GridPlanner, Planner
from antdrive.planners.user_code import LOADED, is_user_code, module_hash, user_code_version, user_object

#: The built-in planners.
PLANNERS: Mapping[str, Planner] = MappingProxyType(
    {
        "dijkstra": Dijkstra(),
        "astar": AStar(),
        "dstar": DStar(),
        "dstar-lite": DStarLite(),
        "sipp": SafeIntervals(),
        "apf": PotentialField(),
        **ANT_PLANNERS,
        "ga-han": GaHan(),
        "hybrid": Hybrid(),
        "tangent": Tangent(),
    }
)

DECORATOR = "@dataclass(frozen=True, kw_only=True)"


def load_planner(name: str, home: Path | None = None, /, **options: Any) -> Planner:
    """Return the named planner with options set.

    Args:
        name: one of `list_planners()`, or FILE.py:CLASS or MODULE:CLASS for user code
        home: folder of user code; None: the working directory
        options: the planner's options by name; values may be text, as from a command line

    Raises:
        InputError: the planner or option is unknown, or the value is invalid; lists the valid choices. Its key is `planner`,
            or `planner.` and the option.
    """
    if is_user_code(name):
        planner = _instance(user_object(name, home), f"planner {name!r}")
    elif name in PLANNERS:
        planner = PLANNERS[name]
    elif (entry := _plugins().get(name)) is not None:
        planner = _load(entry)
    else:
        raise _error("planner", _unknown(name, [*PLANNERS, *_plugins()]))
    return _with_options(name, planner, options)


def recorded_planner(name: str, /, **options: Any) -> Planner:
    """Return the planner with a name in a record: one of user code that this process has loaded, or a registered one."""
    if name not in PLANNERS and name in LOADED:
        return _with_options(name, _instance(LOADED[name], f"planner {name!r}"), options)
    return load_planner(registered_name(name), **options)


def registered_name(name: str) -> str:
    """Return the registered name of a record's planner, which may be that of its class."""
    known = list_planners()
    named = [key for key, planner in known.items() if name in (key, type(planner).__name__)]
    if not named:
        raise InputError(
            f"record.planner.name: {name!r:.60} is not registered, so the run cannot be rebuilt; name its class "
            f"(--planner FILE.py:CLASS), or register it under the entry point antdrive.planners"
        )
    return name if name in named else named[0]


def planner_version(name: str) -> str:
    """Return the distribution and version of the planner with a name, with the hash of its file for third-party planners.

    Raises:
        InputError: the planner is unknown.
    """
    if is_user_code(name):
        user_object(name)
        return user_code_version(name)
    if name in PLANNERS:
        return f"antdrive {__version__}"
    load_planner(name)
    entry = _plugins()[name]
    version = entry.dist.version if entry.dist is not None else "without version"
    return f"{_maker(entry)} {version} {module_hash(entry.module)}".rstrip()


def list_planners() -> Mapping[str, Planner]:
    """Return all planners by name, those of other packages last.

    A planner that fails to load is omitted with a warning.
    """
    planners = dict(PLANNERS)
    for name, entry in _plugins().items():
        try:
            planners[name] = _load(entry)
        except InputError as broken:
            warnings.warn(str(broken), stacklevel=2)
    return MappingProxyType(planners)


def describe(planner: Planner) -> str:
    """Return a one-line summary of a planner, with the options that differ from its class defaults."""
    summary = (type(planner).__doc__ or "No description.").strip().splitlines()[0]
    changed = [
        f"{f.name} {getattr(planner, f.name)}"
        for f in _fields(planner)
        if f.default is not dataclasses.MISSING and getattr(planner, f.name) != f.default
    ]
    return f"{summary} With {', '.join(changed)}." if changed else summary


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


def _unfit(message: str) -> InputError:
    """Return the error of a third-party planner that cannot be used; the message names it, the problem without the key."""
    return InputError(visible(message), "planner", visible(message.removeprefix("planner ")))


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


def _with_options(name: str, planner: Planner, options: Mapping[str, Any]) -> Planner:
    if not options:
        return planner
    known = {f.name for f in _fields(planner)}
    with _loading(f"planner {name!r}", ""):
        hints = _hints(type(planner)) if known else {}
    values: dict[str, Any] = {}
    for key, value in options.items():
        if key not in known:
            raise _error(f"planner.{key}", _unknown(key, known, f"option of {name}"))
        values[key] = parse(f"planner.{key}", hints[key], value)
    try:
        with _loading(f"planner {name!r}", "", (ValueError,)):
            return typing.cast(Planner, dataclasses.replace(typing.cast(Any, planner), **values))
    except FieldError as error:
        raise error.under("planner").as_input() from None
    except ValueError as error:  # from a third-party planner
        raise _error("planner", one_line(str(error))) from None


@functools.cache
def _hints(kind: type) -> Mapping[str, Any]:
    """Return the types of a class's fields; reading them compiles their text."""
    return typing.get_type_hints(kind)


def _fields(planner: Planner) -> tuple[dataclasses.Field[Any], ...]:
    kind = type(planner)
    return tuple(f for f in dataclasses.fields(kind) if f.init) if dataclasses.is_dataclass(kind) else ()


def _unknown(name: str, choices: Iterable[str], what: str = "planner") -> str:
    choices = sorted(choices)
    if not choices:
        return f"no {what} is called {name!r}; it has none"
    close = difflib.get_close_matches(name, choices, n=3)
    hint = f"did you mean {' or '.join(close)}? " if close else ""
    return f"no {what} is called {name!r}; {hint}choose from {', '.join(choices)}"


def _plugins() -> dict[str, importlib.metadata.EntryPoint]:
    entries: dict[str, importlib.metadata.EntryPoint] = {}
    for entry in importlib.metadata.entry_points(group=PLANNER_GROUP):
        if entry.name in PLANNERS or (entry.name in entries and entries[entry.name].value != entry.value):
            taken = "antdrive" if entry.name in PLANNERS else _maker(entries[entry.name])
            warnings.warn(
                f"planner {entry.name!r} of {_maker(entry)} is omitted: {taken} already has that name", stacklevel=3
            )
            continue
        entries.setdefault(entry.name, entry)
    return entries


def _load(entry: importlib.metadata.EntryPoint) -> Planner:
    who = f"planner {entry.name!r} of {_maker(entry)}"
    with _loading(who, f" ({entry.value})"):
        made = entry.load()
    return _instance(made, who, f" ({entry.value})")


def _instance(made: Any, who: str, source: str = "") -> Planner:
    """Return a third-party object or class as a planner; `who` and `source` are for messages."""
    with _loading(who, source):
        if issubclass(type(made), type) and (lacking := _mismatch(made)):
            raise _unfit(f"{who} cannot be created{source}: give all its options default values ({lacking})")
        if issubclass(type(made), type) and (problem := _undeclared_options(made)):
            raise _unfit(f"{who} cannot be created{source}: {problem}")
        planner = made() if issubclass(type(made), type) else made
        if not isinstance(planner, Planner) or not callable(planner.plan):
            raise _unfit(
                f"{who} is not a planner{source}: it has no method plan(query, rng); write one, "
                "or inherit antdrive.planners.GridPlanner and write search(query, rng)"
            )
        if wrong := _mismatch(planner.plan, None, None):
            raise _unfit(f"{who} is not a planner{source}: its method must be plan(query, rng) ({wrong})")
    return planner


def _undeclared_options(kind: type) -> str:
    """Return how to declare options that a subclass of `GridPlanner` fails to make fields; empty if it makes all fields."""
    known: set[str] = set()
    for base in reversed(kind.__mro__):
        typed = {name for name, hint in vars(base).get("__annotations__", {}).items() if "ClassVar" not in str(hint)}
        is_record = "__dataclass_fields__" in vars(base)
        lost = sorted(name for name in typed if not (is_record or name.startswith("_")))
        untyped = sorted(known & set(vars(base)) - typed)
        if issubclass(base, GridPlanner) and lost:
            return f"the options of {base.__name__} ({', '.join(lost)}) need {DECORATOR} above the class"
        if untyped:
            value, name = vars(base)[untyped[0]], untyped[0]
            typed_line = f"{name}: {type(value).__name__} = {value!r:.20}"
            return f"{base.__name__} sets {name} without a type; write `{typed_line}`, and {DECORATOR} above the class"
        known |= typed if is_record else set()
    return ""


def _loading(who: str, source: str, passing: tuple[type[Exception], ...] = ()) -> UserCode:
    """Return a block for the user's code that makes a planner; `who` and `source` are for messages."""

    def error_of(error: BaseException) -> Exception:
        problem = f"{error_text(error)} ({place(error, None)})"
        if issubclass(type(error), OverLimit):
            return PlannerError(who.removeprefix("planner "), problem)
        return _unfit(f"{who} cannot be loaded{source}: {problem}")

    return UserCode(who, error_of, passing)


def _mismatch(function: Any, *arguments: Any) -> str:
    """Return why a function cannot be called with these arguments; empty if it can, or if its signature is unknown."""
    try:
        signature = inspect.signature(function)
    except ValueError:  # compiled
        return ""
    try:
        signature.bind(*arguments)
    except TypeError as error:
        return str(error)
    return ""


def _maker(entry: importlib.metadata.EntryPoint) -> str:
    return entry.dist.name if entry.dist is not None else "an unnamed distribution"
