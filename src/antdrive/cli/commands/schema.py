"""`antdrive schema`."""

from typing import Annotated

from antdrive.base.errors import InputError
from antdrive.cli.console import print_json
from antdrive.cli.options import argument


def schema(kind: Annotated[str, argument("KIND", "File type: world, robot, suite or campaign.")] = "world") -> None:
    """Print the JSON Schema of a file type.

    Editors use it to complete keys and mark errors.
    """
    from antdrive.robots import robot_schema
    from antdrive.runs.campaigns import campaign_schema
    from antdrive.runs.suites import suite_schema
    from antdrive.worlds import task_schema

    schemas = {"world": task_schema, "robot": robot_schema, "suite": suite_schema, "campaign": campaign_schema}
    if kind not in schemas:
        raise InputError(f"schema: unknown kind {kind!r}; choose from {', '.join(schemas)}")
    print_json(schemas[kind]())
