"""`antdrive worlds import`."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from antdrive.base.errors import FieldError, InputError
from antdrive.cli import options
from antdrive.cli.console import bar, print_files, print_json, print_line
from antdrive.cli.exits import SUCCEEDED
from antdrive.cli.output import task_facts
from antdrive.cli.parse import numbers
from antdrive.cli.write import file_name

if TYPE_CHECKING:
    from antdrive.worlds import Task

MANY = 5000  # cylinders; from here on, planning takes seconds

Source = Annotated[
    Path,
    typer.Argument(
        metavar="FILE", help="Gazebo SDF (.sdf, .world), map_server (.yaml), MovingAI (.map) or DynaBARN (.json)."
    ),
]
Target = Annotated[
    Path | None,
    typer.Option(
        "--out",
        "-o",
        metavar="FILE",
        help="The world file to write; for DynaBARN's .json a folder of them.  [default: FILE's name, in this folder]",
    ),
]
Barn = Annotated[bool, typer.Option("--barn", help="SDF: use the start and goal of the BARN challenge.")]
Start = Annotated[
    str | None, typer.Option(metavar="X,Y,YAW", help="Start pose [m, m, rad]; maps have none of their own.")
]
Goal = Annotated[str | None, typer.Option(metavar="X,Y", help="Goal [m]; maps have none of their own.")]
Bounds = Annotated[
    str | None,
    typer.Option(
        metavar="XMIN,YMIN,XMAX,YMAX", help="SDF: where the walls stand [m].  [default: 1 m around the cylinders]"
    ),
]
SkipUnsupported = Annotated[
    bool, typer.Option("--skip-unsupported", help="SDF: skip whatever is not an upright cylinder.")
]
Unknown = Annotated[
    str | None,
    typer.Option(metavar="KIND", help="map_server: treat unknown cells as blocked or free.  [default: blocked]"),
]
Overhang = Annotated[
    float | None,
    typer.Option(
        min=0,
        max=1e6,
        metavar="METRES",
        help="Maps: how far cylinders may protrude from blocked cells [m].  [default: 0.207 cells]",
    ),
]
Resolution = Annotated[
    float | None, typer.Option(min=1e-6, max=1e6, metavar="METRES", help="MovingAI: side of a cell [m].  [default: 1]")
]
Problem = Annotated[
    int | None,
    typer.Option(
        min=0, metavar="NUMBER", help="MovingAI: take start and goal from this problem of FILE.scen, counted from 0."
    ),
]


def import_world(
    path: Source,
    out: Target = None,
    barn: Barn = False,
    start: Start = None,
    goal: Goal = None,
    bounds: Bounds = None,
    cell: options.CellSize = None,
    skip_unsupported: SkipUnsupported = False,
    unknown: Unknown = None,
    overhang: Overhang = None,
    resolution: Resolution = None,
    problem: Problem = None,
    json: options.Json = False,
) -> int:
    """Turn a world or map of another program into a world file.

    Worlds are made of upright cylinders. Those of an SDF file stay as they are. A map is converted: every blocked
    cell beside free ground that the start or the goal can reach is fully covered by cylinders, so that no passage is
    wider than on the map. The key `source` of the world file says how far cylinders protrude from blocked cells.
    """
    from antdrive.worlds import import_file
    from antdrive.worlds.formats.cellmap import watch_conversion
    from antdrive.worlds.formats.importing import IMPORTS, import_format

    try:
        file_format = import_format(path, barn=barn)
        with bar("converting") as progress, watch_conversion(progress):
            tasks = import_file(
                path,
                start=numbers("--start", start, 3, "X,Y,YAW"),
                goal=numbers("--goal", goal, 2, "X,Y"),
                bounds=numbers("--bounds", bounds, 4),
                cell=cell,
                barn=barn,
                skip_unsupported=skip_unsupported or None,
                unknown=unknown,
                overhang=overhang,
                resolution=resolution,
                problem=problem,
            )
    except FieldError as error:
        raise InputError(f"--{error.key.replace('_', '-')}: {error.problem}") from None
    is_set = file_format is IMPORTS["dynabarn"]
    files = _targets(path, out or Path(path.stem), tasks) if is_set else [_target(path, out)]
    _write(tasks, files, path if file_format is IMPORTS["map_server"] else None)
    if json:
        found = [{**task_facts(task), "files": {"world": str(file)}} for task, file in zip(tasks, files, strict=True)]
        print_json({"worlds": found} if is_set else found[0])
    else:
        _print(tasks, files, is_map=file_format.is_map)
    return SUCCEEDED


def _target(path: Path, out: Path | None) -> Path:
    """The file that an imported world is written to: never its source, and another existing file only if named."""
    target = out or Path(f"{path.stem}.yaml")
    if target.exists():
        if path.exists() and target.samefile(path):
            raise InputError(f"{target}: is the file to import; give another with --out")
        if out is None:
            raise InputError(f"{target}: exists; give --out to say where the world goes")
    return target


def _targets(path: Path, folder: Path, tasks: "Sequence[Task]") -> list[Path]:
    """A file in a folder for each world of a set."""
    files = [folder / f"{file_name(task.world.name)}.yaml" for task in tasks]
    twice = next((file for i, file in enumerate(files) if file in files[:i]), None)
    if twice is not None:
        raise InputError(f"{path}: two worlds would be written to {twice}; give them different names")
    return files


def _write(tasks: "Sequence[Task]", files: Sequence[Path], served: Path | None) -> None:
    """Write the worlds; that of a map that antdrive wrote with the other tasks that are in its file."""
    from antdrive.worlds import save_task
    from antdrive.worlds.formats.map_server import kept_tasks

    for task, file in zip(tasks, files, strict=True):
        save_task(task, file, kept_tasks(served, task) if served is not None else {})


def _print(tasks: "Sequence[Task]", files: Sequence[Path], *, is_map: bool) -> None:
    if len(tasks) == 1:
        world = tasks[0].world
        print_line(f"{world.name}: {len(world.obstacles)} obstacles, {world.source}")
        if is_map and len(world.obstacles) > MANY:
            print_line(f"  more than {MANY} make planning take seconds; a larger --overhang needs fewer of them")
    for file in files:
        print_files({"world": str(file)})
