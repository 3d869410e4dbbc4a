"""`antdrive robots`: list, print, show and import."""

import math
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from antdrive.base.checks import pair
from antdrive.base.errors import InputError
from antdrive.base.files import summary_of
from antdrive.base.tables import file_lines
from antdrive.cli import options
from antdrive.cli.console import show
from antdrive.cli.listings import Row, robot_lines
from antdrive.cli.options import argument, flag, option
from antdrive.cli.parse import import_target, numbers, xacro

if TYPE_CHECKING:
    from antdrive.robots import RobotSpec


def list_all(json: options.Json = False) -> None:
    """List the robots in the catalogue."""
    from antdrive.robots import robot_to_dict

    facts = {spec.name: {**robot_to_dict(spec), "about": about} for spec, about in _catalogue()}
    show(json, facts, robot_lines(robot_rows()))


def robot_rows() -> Iterator[Row]:
    """Yield the rows of the list of robots."""
    for spec, about in _catalogue():
        yield spec.name, f"{spec.radius:.3f}", f"{spec.max_speed:g}", f"{spec.max_acceleration:g}", about


def _catalogue() -> Iterator[tuple["RobotSpec", str]]:
    """Yield the robots of the catalogue with their summaries."""
    from antdrive.robots import list_robots, load_robot

    return ((load_robot(name), summary_of(path)) for name, path in list_robots().items())


def print_robot(name: Annotated[str, argument("NAME", "Catalogue robot.")], json: options.Json = False) -> None:
    """Print the file of a catalogue robot, as a template."""
    from antdrive.robots import list_robots, load_robot, robot_to_dict

    known = list_robots()
    if name not in known:
        raise InputError(f"{name}: unknown robot; choose from {', '.join(known)}")
    show(json, robot_to_dict(load_robot(name)), [known[name].read_text(encoding="utf-8").rstrip()])


def show_robot(
    robot: Annotated[str, argument("ROBOT", "Robot name or file.")],
    out: Annotated[Path | None, option("FILE", "Drawing: .png, .svg or .pdf.")] = None,
    json: options.Json = False,
) -> None:
    """Describe a robot and draw it from above."""
    from antdrive.robots import load_robot, robot_to_dict

    spec = load_robot(robot)
    if out is not None:
        from antdrive.views.figures.robot_figure import robot_figure

        robot_figure(spec, out)
    said = {"robot": spec.name, **spec.facts, "radius": f"{spec.radius:.4g} m around the axle"}
    lines = [f"{key:14} {value}" for key, value in said.items()]
    lines += [] if out is None else file_lines({"figure": out})
    show(json, {**robot_to_dict(spec), "radius": spec.radius}, lines)


def import_robot(
    path: Annotated[Path, argument("FILE", "Robot description: .urdf or .xacro.")],
    out: Annotated[Path | None, option("FILE", "Robot file to write.  [default: FILE's name]")] = None,
    figure: Annotated[Path | None, option("FILE", "Drawing of the footprint: .png, .svg or .pdf.")] = None,
    left: Annotated[str | None, option("NAME", "Joint or link of the left driven wheel.")] = None,
    right: Annotated[str | None, option("NAME", "Joint or link of the right driven wheel.")] = None,
    below: Annotated[
        float | None, option("METRES", "Omit collision geometry above this height from the footprint [m].", min=0.0)
    ] = None,
    footprint: Annotated[
        str, option("KIND", "disc, rectangle, polygon or auto (the first of these that fits).")
    ] = "auto",
    wheel_radius: Annotated[float | None, option("METRES", "Radius of the driven wheels [m].", min=0.0)] = None,
    given: Annotated[
        list[str] | None, option("KEY=VALUE", "Value of the robot file, such as mass=12. Repeatable.", "--set", "-s")
    ] = None,
    meshes: Annotated[Path | None, option("FOLDER", "Folder of the meshes.")] = None,
    without_meshes: Annotated[bool, flag("Omit missing meshes.", "--without-meshes")] = False,
    arguments: options.XacroArguments = None,
    packages: options.RosPackages = None,
    json: options.Json = False,
) -> None:
    """Create a robot file from a differential-drive robot's URDF.

    Comments in the robot file state the source of each value.
    """
    from antdrive.base.atomic import write_text
    from antdrive.robots import robot_to_dict
    from antdrive.robots.importing.urdf_import import import_urdf

    values = {"wheel_radius": wheel_radius} if wheel_radius is not None else {}
    for key, text in map(pair, given or ()):
        read = numbers(f"--set {key}", text, 1)
        assert read is not None
        values[key] = read[0]
    usual = Path(f"{path.name.removesuffix('.xacro').removesuffix('.urdf')}.yaml")
    target = import_target(path, out, usual, "robot")
    imported = import_urdf(
        path,
        left=left,
        right=right,
        below=math.inf if below is None else below,
        footprint=footprint,
        meshes=meshes,
        without_meshes=without_meshes,
        given=values,
        **xacro(arguments, packages),
    )
    files = {"robot": str(target)}
    if figure is not None:
        from antdrive.views.figures.robot_figure import robot_figure

        robot_figure(imported.spec, figure, pieces=imported.pieces, above=imported.above)
        files["figure"] = str(figure)
    write_text(target, imported.text)
    facts = {**robot_to_dict(imported.spec), "files": files, "notes": list(imported.notes)}
    show(json, facts, [imported.text.rstrip(), *file_lines(files)])
