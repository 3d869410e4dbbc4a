"""Errors of planners, which may raise anything."""

from __future__ import annotations

from antdrive.base.components import ComponentError
from antdrive.base.components import is_built_in as is_built_in


class PlannerError(ComponentError):
    """An exception raised by a planner, or a return value of an invalid type; the message is one line."""

    kind = "planner"
    methods = "plan", "search"


planner_errors, place_of = PlannerError.guard, PlannerError.place_of
