"""Errors of planners, which may raise anything."""

from __future__ import annotations

import contextlib
import sys
from pathlib import Path

from antdrive.base.errors import input_error
from antdrive.base.guarded import OverLimit, UserCode, error_text, place


class PlannerError(RuntimeError):
    """An exception raised by a planner, or a return value of an invalid type; the message is one line.

    Attributes:
        planner: the planner's name
        problem: the exception or the value, and its place
    """

    def __init__(self, planner: str, problem: str) -> None:
        super().__init__(str(input_error(f"planner {planner} {problem}")))
        self.planner, self.problem = planner, problem

    def __reduce__(self) -> tuple[type[PlannerError], tuple[str, str]]:
        """Return the parts from which another process rebuilds the error."""
        return type(self), (self.planner, self.problem)


def planner_errors(planner: object, name: str = "") -> contextlib.AbstractContextManager[None]:
    """Return a block for a planner's code that turns exceptions into `PlannerError`, except `InputError`, Ctrl-C and SIGTERM.

    Errors have the planner's name; without one, its class.
    """

    called = name or type(planner).__name__

    def error_of(error: BaseException) -> PlannerError:
        raised = "" if issubclass(type(error), OverLimit) else "raised "
        return PlannerError(called, f"{raised}{error_text(error)} ({place_of(planner, error)})")

    own = is_built_in(planner)
    who = f"planner {called}" if own else f"planner {called} ({place_of(planner)})"
    return UserCode(who, error_of, (PlannerError,), own)


def is_built_in(planner: object) -> bool:
    """Return whether a planner's class is antdrive's."""
    return type(planner).__module__.startswith("antdrive.")


def place_of(planner: object, error: BaseException | None = None) -> str:
    """Return the file and line of the planner's module that raised the error; without an error, of its `plan`."""
    kind = type(planner)
    home = getattr(sys.modules.get(kind.__module__), "__file__", None)
    codes = [getattr(getattr(kind, name, None), "__code__", None) for name in ("plan", "search")]
    code = next((code for code in codes if code and code.co_filename == home), None)
    own = f"{Path(home).name}:{code.co_firstlineno}" if home and code else kind.__module__
    return (place(error, home) if error is not None else "") or own
