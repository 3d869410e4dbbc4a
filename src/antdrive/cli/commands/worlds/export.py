"""`antdrive worlds export`."""

from pathlib import Path
from typing import Annotated

import typer

from antdrive.base.errors import InputError
from antdrive.cli import options
from antdrive.cli.console import print_files, print_json, print_line
from antdrive.cli.exits import SUCCEEDED


def export_world(
    world: options.World,
    out: Annotated[
        Path,
        typer.Option(
            "--out",
            "-o",
            metavar="FILE",
            help="Gazebo: .sdf or .world; map_server: .yaml (and .pgm); MovingAI: .map (and .scen).",
        ),
    ],
    resolution: Annotated[
        float | None,
        typer.Option(
            min=1e-6,
            max=1e6,
            metavar="METRES",
            help="Maps: side of a cell [m].  [default: the world's own cell size]",
        ),
    ] = None,
    force: Annotated[bool, typer.Option("--force", help="Replace files that exist, also those beside FILE.")] = False,
    json: options.Json = False,
) -> int:
    """Write a world for another program.

    FILE's suffix decides the format. SDF keeps the world, its start and its goal. In a map, every cell that a cylinder
    reaches into is blocked; importing the map again gives a similar world, not the same. A .yaml keeps the world's
    other tasks, too. A .map gets a .scen file beside it with the path from start to goal, if there is one on its cells.
    A world that was made from a map is written where it lies in that map, but for a .map, which has no coordinates.
    """
    from antdrive.views.export.worlds import SDF, SUFFIXES, file_beside, write_world
    from antdrive.worlds import load_task, load_tasks
    from antdrive.worlds.formats.checks import require_new

    suffix = out.suffix.lower()
    if suffix not in SUFFIXES:
        raise InputError(f"--out {out}: worlds are written as .sdf, .world, .yaml (map_server) or .map (MovingAI)")
    task, tasks = load_task(world), load_tasks(world)
    if out.exists() and Path(world).exists() and out.samefile(world):
        raise InputError(f"--out {out}: is the world itself; choose another name")
    if suffix in SDF and resolution is not None:
        raise InputError("--resolution: an SDF world has no cells")
    beside = file_beside(out)
    require_new((out, *([] if beside is None else [beside])), replace=force)
    facts, lost = write_world(task, tasks, out, resolution)
    if json:
        print_json({"world": task.world.name, **facts})
        return SUCCEEDED
    print_files(facts["files"])
    for what in lost:
        print_line(f"  without {what}")
    return SUCCEEDED
