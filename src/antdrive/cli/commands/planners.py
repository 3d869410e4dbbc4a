"""`antdrive planners`."""

from collections.abc import Iterator, Mapping
from typing import Annotated, Any

from antdrive.base.tables import table
from antdrive.cli import options
from antdrive.cli.console import show
from antdrive.cli.listings import Row, planner_lines
from antdrive.cli.options import argument


def planners(
    names: Annotated[
        list[str] | None, argument("NAME", "Planners to describe with their options: names or FILE.py:CLASS.")
    ] = None,
    json: options.Json = False,
) -> None:
    """List the planners, or describe some with their options."""
    from antdrive.planners import list_planners, load_planner
    from antdrive.planners.card import facts_of

    known = {name: load_planner(name) for name in names} if names else list_planners()
    facts = {name: facts_of(planner) for name, planner in known.items()}
    show(json, facts, details(facts) if names else planner_lines(_rows(facts)))


def planner_rows() -> Iterator[Row]:
    """Yield the rows of the list of built-in planners."""
    from antdrive.planners import PLANNERS
    from antdrive.planners.card import facts_of

    return _rows({name: facts_of(planner) for name, planner in PLANNERS.items()})


def _rows(facts: Mapping[str, Any]) -> Iterator[Row]:
    return ((name, one["about"], one["plans_for"]) for name, one in facts.items())


def details(facts: Mapping[str, Any]) -> Iterator[str]:
    """Yield the summary and the options of planners or controllers, by name."""
    for name, one in facts.items():
        yield f"{name}: {one['about']}"
        if "plans_for" in one:
            yield f"  plans for: {one['plans_for']}"
        rows = [(key, str(value), one["meanings"].get(key, "")) for key, value in one["options"].items()]
        yield from table(("option", "default", "meaning"), rows) if rows else ("  no options",)
