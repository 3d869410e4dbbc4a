"""`antdrive robots show`."""

from pathlib import Path
from typing import Annotated

import typer

from antdrive.cli import options
from antdrive.cli.console import print_files, print_json, print_line
from antdrive.cli.exits import SUCCEEDED


def show_robot(
    robot: Annotated[str, typer.Argument(metavar="ROBOT", help="Name of a robot in the catalogue, or a robot file.")],
    out: Annotated[
        Path | None, typer.Option("--out", "-o", metavar="FILE", help="Draw the robot: .png, .svg or .pdf.")
    ] = None,
    json: options.Json = False,
) -> int:
    """Describe a robot, and draw it from above."""
    from antdrive.robots import load_robot, robot_to_dict
    from antdrive.robots.drawing import facts_of

    spec = load_robot(robot)
    if out is not None:
        from antdrive.views.figures.robot_figure import robot_figure

        robot_figure(spec, out)
    if json:
        print_json({**robot_to_dict(spec), "radius": spec.radius})
        return SUCCEEDED
    for key, value in {"robot": spec.name, **facts_of(spec), "radius": f"{spec.radius:.4g} m around the axle"}.items():
        print_line(f"{key:14} {value}")
    print_files({} if out is None else {"figure": str(out)})
    return SUCCEEDED
