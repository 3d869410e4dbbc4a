"""`antdrive planners`."""

import dataclasses
from typing import Any

from antdrive.cli import options
from antdrive.cli.console import show
from antdrive.cli.output import plain


def planners(json: options.Json = False) -> None:
    """List the planners and their options."""
    from antdrive.planners import describe, list_planners

    known = {name: (describe(planner), _options(planner)) for name, planner in list_planners().items()}
    facts = {
        name: {"about": about, "options": {key: plain(value) for key, value in values.items()}}
        for name, (about, values) in known.items()
    }
    lines = []
    for name, (about, values) in known.items():
        lines.append(f"{name:14} {about}")
        if values:
            lines.append(f"{'':14}   {', '.join(f'{key}={value}' for key, value in values.items())}")
    show(json, facts, lines)


def _options(planner: Any) -> dict[str, Any]:
    """Return a planner's options with their values; planners of other packages may have none."""
    fields = dataclasses.fields(planner) if dataclasses.is_dataclass(planner) else ()
    return {field.name: getattr(planner, field.name) for field in fields}
