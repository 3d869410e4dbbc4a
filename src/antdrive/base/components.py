"""Errors of components, such as planners and controllers, which may raise anything."""

from __future__ import annotations

import contextlib
import inspect
import sys
from pathlib import Path
from typing import Any, ClassVar, TypeVar, cast

from antdrive.base.errors import input_error
from antdrive.base.guarded import OverLimit, UserCode, error_text, place, value_text

Declared = TypeVar("Declared")


class ComponentError(RuntimeError):
    """An exception raised by a component, or a return value of an invalid type; the message is one line.

    Attributes:
        kind: the kind of component, such as planner
        methods: the methods that users write
        name: the component's name
        problem: the exception or the value, and its place
    """

    kind: ClassVar[str] = "component"
    methods: ClassVar[tuple[str, ...]] = ()

    def __init__(self, name: str, problem: str) -> None:
        super().__init__(str(input_error(f"{self.kind} {name} {problem}")))
        self.name, self.problem = name, problem

    def __reduce__(self) -> tuple[type[ComponentError], tuple[str, str]]:
        """Return the parts from which another process rebuilds the error."""
        return type(self), (self.name, self.problem)

    @property
    def outcome(self) -> str:
        """The outcome of a run that it ends, such as `planner_fault`."""
        return f"{self.kind}_fault"

    @classmethod
    def guard(cls, component: object, name: str = "") -> contextlib.AbstractContextManager[None]:
        """Return a block for a component's code that turns exceptions into this class, except `InputError`, Ctrl-C and SIGTERM.

        Errors have the component's name; without one, its class.
        """
        called = name or type(component).__name__

        def error_of(error: BaseException) -> ComponentError:
            raised = "" if issubclass(type(error), OverLimit) else "raised "
            return cls(called, f"{raised}{error_text(error)} ({cls.place_of(component, error)})")

        own = is_built_in(component)
        who = f"{cls.kind} {called}" if own else f"{cls.kind} {called} ({cls.place_of(component)})"
        return UserCode(who, error_of, (ComponentError,), own)

    @classmethod
    def declared(cls, component: Any, usual: Declared) -> Declared:
        """Return the `capabilities` that a component declares; the usual ones if it declares none.

        Raises:
            ComponentError: they have another type, or raise an exception.
        """
        with cls.guard(component):
            try:
                capabilities = component.capabilities
            except AttributeError:
                if inspect.getattr_static(component, "capabilities", None) is not None:
                    raise
                capabilities = usual
        if not issubclass(type(capabilities), type(usual)):
            problem = f"declares {value_text(capabilities)} instead of {type(usual).__name__}"
            raise cls(type(component).__name__, problem)
        return cast(Declared, capabilities)

    @classmethod
    def place_of(cls, component: object, error: BaseException | None = None) -> str:
        """Return the file and line of the component's module that raised the error; without an error, of its first method."""
        kind = type(component)
        home = getattr(sys.modules.get(kind.__module__), "__file__", None)
        codes = [getattr(getattr(kind, name, None), "__code__", None) for name in cls.methods]
        code = next((code for code in codes if code and code.co_filename == home), None)
        own = f"{Path(home).name}:{code.co_firstlineno}" if home and code else kind.__module__
        return (place(error, home) if error is not None else "") or own


def is_built_in(component: object) -> bool:
    """Return whether a component's class is antdrive's."""
    return type(component).__module__.startswith("antdrive.")
