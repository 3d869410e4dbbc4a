"""`antdrive robots NAME`, or `antdrive robots print NAME`."""

from typing import Annotated

import typer

from antdrive.base.errors import InputError
from antdrive.cli import options
from antdrive.cli.console import print_json, print_line
from antdrive.cli.exits import SUCCEEDED


def print_robot(
    name: Annotated[str, typer.Argument(metavar="NAME", help="A robot of the catalogue.")],
    json: options.Json = False,
) -> int:
    """Print the file of a robot in the catalogue, to start another from."""
    from antdrive.robots import list_robots, load_robot, robot_to_dict

    known = list_robots()
    if name not in known:
        raise InputError(f"{name}: no robot of the catalogue; choose from {', '.join(known)}")
    if json:
        print_json(robot_to_dict(load_robot(name)))
    else:
        print_line(known[name].read_text(encoding="utf-8").rstrip())
    return SUCCEEDED
