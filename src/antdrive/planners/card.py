"""Facts about planners for people: summary, shapes of plans and options."""

from __future__ import annotations

import dataclasses
from typing import Any

from antdrive.base.records import meanings_of
from antdrive.planners.plan import Planner, capabilities_of, plain
from antdrive.planners.registry import describe


def facts_of(planner: Planner) -> dict[str, Any]:
    """Return a planner's summary, the shapes that its plans keep clear, and its options, as plain values.

    Planners of other packages may have no options.
    """
    can = capabilities_of(planner)
    footprint = "disc, footprint without movers" if can.cell_by_cell else "disc or footprint"
    names: list[str] = (
        [field.name for field in dataclasses.fields(planner)] if dataclasses.is_dataclass(planner) else []
    )
    return {
        "about": describe(planner),
        "plans_for": footprint if can.turns else "disc",
        "options": {name: plain(getattr(planner, name)) for name in names},
        "meanings": meanings_of(type(planner)),
    }
