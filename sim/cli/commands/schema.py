"""`antdrive schema`."""

from typing import Annotated

import typer

from antdrive.sim.cli.console import print_json
from antdrive.sim.cli.exits import SUCCEEDED
from antdrive.worlds.errors import InputError


def schema(kind: Annotated[str, typer.Argument(metavar="KIND", help="Kind of file: world or robot.")] = "world") -> int:
    """Print the JSON Schema of world or robot files.

    An editor that knows it completes keys and marks mistakes.
    """
    from antdrive.robots import robot_schema
    from antdrive.worlds import task_schema

    schemas = {"world": task_schema, "robot": robot_schema}
    if kind not in schemas:
        raise InputError(f"schema: unknown kind {kind!r}; choose from {', '.join(schemas)}")
    print_json(schemas[kind]())
    return SUCCEEDED
