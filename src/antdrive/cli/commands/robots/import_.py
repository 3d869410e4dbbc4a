"""`antdrive robots import`."""

import math
from pathlib import Path
from typing import Annotated

import typer

from antdrive.base.errors import InputError
from antdrive.cli import options
from antdrive.cli.console import print_files, print_json, print_line
from antdrive.cli.exits import SUCCEEDED
from antdrive.cli.parse import numbers, pair

Source = Annotated[Path, typer.Argument(metavar="FILE", help="A robot's .urdf or .xacro.")]
Target = Annotated[
    Path | None,
    typer.Option(
        "--out", "-o", metavar="FILE", help="The robot file to write.  [default: FILE's name, in this folder]"
    ),
]
Picture = Annotated[
    Path | None,
    typer.Option(metavar="FILE", help="Draw the footprint over the collision geometry: .png, .svg or .pdf."),
]
Left = Annotated[str | None, typer.Option(metavar="NAME", help="Joint or link of the left driven wheel.")]
Right = Annotated[str | None, typer.Option(metavar="NAME", help="Joint or link of the right driven wheel.")]
Below = Annotated[
    float | None,
    typer.Option(
        min=0.0,
        metavar="METRES",
        help="Leave collision geometry that lies higher above the floor out of the footprint [m].  [default: none is left out]",
    ),
]
Arguments = Annotated[
    list[str] | None,
    typer.Option("--arg", metavar="NAME=VALUE", help="Value of an argument of a .xacro. May be repeated."),
]
Packages = Annotated[
    list[str] | None,
    typer.Option(
        "--package",
        metavar="NAME=FOLDER",
        help="Where a ROS package is.  [default: a folder of its name beside FILE or above it] May be repeated.",
    ),
]
Kind = Annotated[str, typer.Option(metavar="KIND", help="disc, rectangle, polygon, or auto: the first that fits.")]
WheelRadius = Annotated[float | None, typer.Option(min=0.0, metavar="METRES", help="Radius of the driven wheels [m].")]
Given = Annotated[
    list[str] | None,
    typer.Option(
        "--set", "-s", metavar="KEY=VALUE", help="A value of the robot file, such as mass=12. May be repeated."
    ),
]
Meshes = Annotated[Path | None, typer.Option(metavar="FOLDER", help="Where the file's meshes are.")]
WithoutMeshes = Annotated[bool, typer.Option("--without-meshes", help="Leave out meshes that are not found.")]


def import_robot(
    path: Source,
    out: Target = None,
    figure: Picture = None,
    left: Left = None,
    right: Right = None,
    below: Below = None,
    footprint: Kind = "auto",
    wheel_radius: WheelRadius = None,
    given: Given = None,
    meshes: Meshes = None,
    without_meshes: WithoutMeshes = False,
    arguments: Arguments = None,
    packages: Packages = None,
    json: options.Json = False,
) -> int:
    """Write the robot file of a differential-drive robot in URDF; a comment says where each value comes from."""
    from antdrive.base.atomic import written_whole
    from antdrive.robots.importing.expanding import checked_packages
    from antdrive.robots.importing.urdf import import_urdf, require_writable

    values = {"wheel_radius": wheel_radius} if wheel_radius is not None else {}
    for word in given or ():
        key, text = pair(word)
        read = numbers(f"--set {key}", text, 1)
        assert read is not None
        values[key] = read[0]
    target = out or Path(f"{path.name.removesuffix('.xacro').removesuffix('.urdf')}.yaml")
    require_writable(target, path)
    if out is None and target.exists():
        raise InputError(f"{target}: exists; give --out to say where the robot goes")
    found = import_urdf(
        path,
        left=left,
        right=right,
        below=math.inf if below is None else below,
        footprint=footprint,
        meshes=meshes,
        without_meshes=without_meshes,
        given=values,
        arguments=dict(pair(word, "--arg") for word in arguments or ()),
        packages=checked_packages(dict(pair(word, "--package") for word in packages or ())),
    )
    files = {"robot": str(target)}
    if figure is not None:
        from antdrive.views.figures.robot_figure import robot_figure

        robot_figure(found.robot, figure, pieces=found.pieces, above=found.above)
        files["figure"] = str(figure)
    with written_whole(target) as temporary:
        temporary.write_text(found.text, encoding="utf-8")
    if json:
        from antdrive.robots import robot_to_dict

        print_json({**robot_to_dict(found.robot), "files": files, "left_out": list(found.left_out)})
        return SUCCEEDED
    print_line(found.text.rstrip())
    print_files(files)
    return SUCCEEDED
