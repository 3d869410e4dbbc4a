"""Facts about planners for people: summary, shapes of plans and options."""

from __future__ import annotations

from typing import Any

from antdrive.base.registry import options_card
from antdrive.planners.plan import Planner, capabilities_of
from antdrive.planners.registry import describe


def facts_of(planner: Planner) -> dict[str, Any]:
    """Return a planner's summary, the shapes that its plans keep clear, and its options, as plain values.

    Planners of other packages may have no options.
    """
    can = capabilities_of(planner)
    footprint = "disc, footprint without movers" if can.cell_by_cell else "disc or footprint"
    about, options = describe(planner), options_card(planner)
    return {"about": about, "plans_for": footprint if can.turns else "disc", **options}
