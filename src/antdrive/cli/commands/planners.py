"""`antdrive planners`."""

import dataclasses
from typing import Any

from antdrive.cli import options
from antdrive.cli.console import print_json, print_line
from antdrive.cli.exits import SUCCEEDED
from antdrive.cli.output import plain


def planners(json: options.Json = False) -> int:
    """List the planners with their options."""
    from antdrive.planners import describe, list_planners

    known = list_planners()
    if json:
        print_json(
            {
                name: {
                    "about": describe(planner),
                    "options": {key: plain(value) for key, value in _options(planner).items()},
                }
                for name, planner in known.items()
            }
        )
        return SUCCEEDED
    for name, planner in known.items():
        print_line(f"{name:14} {describe(planner)}")
        values = [f"{key}={value}" for key, value in _options(planner).items()]
        if values:
            print_line(f"{'':14}   {', '.join(values)}")
    return SUCCEEDED


def _options(planner: Any) -> dict[str, Any]:
    """A planner's options with the values they have; another package's planner may have none."""
    fields = dataclasses.fields(planner) if dataclasses.is_dataclass(planner) else ()
    return {field.name: getattr(planner, field.name) for field in fields}
