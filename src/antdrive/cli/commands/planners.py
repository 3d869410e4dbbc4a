"""`antdrive planners`."""

import dataclasses
from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Annotated, Any

from antdrive.base.checks import suggest
from antdrive.base.errors import InputError
from antdrive.base.records import meanings_of
from antdrive.base.tables import table
from antdrive.cli import options
from antdrive.cli.console import show
from antdrive.cli.listings import Row, planner_lines
from antdrive.cli.options import argument
from antdrive.cli.output import plain

if TYPE_CHECKING:
    from antdrive.planners.plan import Capabilities


def planners(
    names: Annotated[list[str] | None, argument("NAME", "Planners to describe with their options.")] = None,
    json: options.Json = False,
) -> None:
    """List the planners, or describe some with their options."""
    from antdrive.planners import list_planners

    known = list_planners()
    for name in names or ():
        if name not in known:
            raise InputError(f"{name}: unknown planner; {suggest(name, known)}")
    facts = _facts({name: known[name] for name in names or known})
    show(json, facts, _details(facts) if names else planner_lines(rows_of(facts)))


def planner_rows() -> Iterator[Row]:
    """Yield the rows of the list of built-in planners."""
    from antdrive.planners import PLANNERS

    return rows_of(_facts(PLANNERS))


def rows_of(facts: Mapping[str, Any]) -> Iterator[Row]:
    """Yield the rows of a list."""
    return ((name, one["about"], one["plans_for"]) for name, one in facts.items())


def _facts(planners: Mapping[str, Any]) -> dict[str, Any]:
    """Describe planners with their options as plain values."""
    from antdrive.planners import capabilities_of, describe

    return {
        name: {
            "about": describe(planner),
            "plans_for": _shape(capabilities_of(planner)),
            "options": {key: plain(value) for key, value in _options(planner).items()},
            "meanings": meanings_of(type(planner)),
        }
        for name, planner in planners.items()
    }


def _shape(can: "Capabilities") -> str:
    """Return the shapes that plans of a planner keep clear."""
    if can.turns and can.cell_by_cell:
        return "disc, footprint without movers"
    return "disc or footprint" if can.turns else "disc"


def _details(facts: Mapping[str, Any]) -> Iterator[str]:
    for name, one in facts.items():
        yield f"{name}: {one['about']}"
        yield f"  plans for: {one['plans_for']}"
        rows = [(key, str(value), one["meanings"].get(key, "")) for key, value in one["options"].items()]
        yield from table(("option", "default", "meaning"), rows) if rows else ("  no options",)


def _options(planner: Any) -> dict[str, Any]:
    """Return a planner's options with their values; planners of other packages may have none."""
    fields = dataclasses.fields(planner) if dataclasses.is_dataclass(planner) else ()
    return {field.name: getattr(planner, field.name) for field in fields}
