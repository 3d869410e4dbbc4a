"""`antdrive robots`."""

from typing import Annotated

import typer

from antdrive.sim.cli import options
from antdrive.sim.cli.console import print_json, print_line, print_table
from antdrive.sim.cli.exits import SUCCEEDED
from antdrive.worlds.errors import InputError


def robots(
    name: Annotated[
        str | None, typer.Argument(metavar="[NAME]", help="A robot of the catalogue, whose file is printed.")
    ] = None,
    json: options.Json = False,
) -> int:
    """List the robots in the catalogue, or print one's file."""
    from antdrive.robots import list_robots, load_robot, robot_to_dict

    if name is not None:
        known = list_robots()
        if name not in known:
            raise InputError(f"{name}: no robot of the catalogue; choose from {', '.join(known)}")
        if json:
            print_json(robot_to_dict(load_robot(name)))
        else:
            print_line(known[name].read_text(encoding="utf-8").rstrip())
        return SUCCEEDED
    specs = [load_robot(name) for name in list_robots()]
    if json:
        print_json({spec.name: robot_to_dict(spec) for spec in specs})
        return SUCCEEDED
    print_table(
        ("robot", "radius m", "m/s", "m/s2", "about"),
        (
            (spec.name, f"{spec.radius:.3f}", f"{spec.max_speed:g}", f"{spec.max_acceleration:g}", spec.source or "")
            for spec in specs
        ),
    )
    return SUCCEEDED
