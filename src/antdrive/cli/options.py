"""The arguments and options that several commands share.

Each help text states the unit, and the default where typer cannot show it.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import Annotated, Any, Literal

import typer

MAX_MARGIN = 100.0  # [m]

World = Annotated[str, typer.Argument(metavar="WORLD", help="Name of a world in the catalogue, or a world file.")]
TaskName = Annotated[
    str | None,
    typer.Option("--task", metavar="NAME", help="One of the world file's tasks.  [default: its own start and goal]"),
]
Start = Annotated[
    str | None,
    typer.Option(
        metavar="X,Y,YAW", help="Another start, in the frame of the world file [m, m, rad].  [default: the task's]"
    ),
]
Goal = Annotated[
    str | None,
    typer.Option(metavar="X,Y", help="Another goal, in the frame of the world file [m].  [default: the task's]"),
]
Frame = Annotated[
    str,
    typer.Option(
        metavar="NAME",
        help="world, or map: --start and --goal are places in the map that the world was made from, as exports have them.",
    ),
]
Planner = Annotated[
    str,
    typer.Option(
        "--planner",
        "-p",
        metavar="NAME",
        help="Planner, or FILE.py:CLASS; `antdrive planners` lists names.",
    ),
]
Settings = Annotated[
    list[str] | None,
    typer.Option(
        "--set",
        "-s",
        metavar="GROUP.KEY=VALUE",
        help="Set an option of the planner or the controller, such as planner.ants=50 or "
        "controller.lookahead_time=0.5. May be repeated.",
    ),
]
Robot = Annotated[
    str, typer.Option("--robot", "-r", metavar="NAME", help="Name of a robot in the catalogue, or a robot file.")
]
Seed = Annotated[int, typer.Option(min=0, max=2**63 - 1, metavar="NUMBER", help="Random seed.")]


def parse_margin(text: str | float) -> float | Literal["auto"]:
    """The margin that an option's text means [m]."""
    if text == "auto":
        return "auto"
    try:
        margin = float(text)
    except ValueError:
        margin = math.nan
    if not 0 <= margin <= MAX_MARGIN:
        raise typer.BadParameter(f"write a number of metres from 0 to {MAX_MARGIN:g}, or auto; got {text}")
    return margin


Margin = Annotated[
    Any,
    typer.Option(
        parser=parse_margin,
        metavar="METRES|auto",
        help="Distance that the plan keeps from obstacles, beyond the robot's radius [m]. auto: the least that this robot, "
        "noise and smoothing are predicted to need, from 80 short drives for each margin that is tried, once.",
    ),
]
CellSize = Annotated[
    float | None,
    typer.Option(
        min=1e-6,
        max=1e6,
        metavar="METRES",
        help="Side of a grid cell [m].  [default: the world's own; without a map 0.05 at most]",
    ),
]
Smoothing = Annotated[
    str,
    typer.Option(
        metavar="KIND",
        help="How the planned cells become a route: none (drive the cells), taut (as short as possible) or "
        "clearance (short, and away from obstacles where there is room).",
    ),
]
Noise = Annotated[
    float,
    typer.Option(
        min=0.0,
        max=100.0,
        metavar="FACTOR",
        help="Multiple of the noise that the robot's file documents; 0 is a perfect robot.",
    ),
]
Out = Annotated[
    Path | None,
    typer.Option("--out", "-o", metavar="FOLDER", help="Folder for the results.  [default: a folder below out/]"),
]
Prelude = Annotated[
    float,
    typer.Option(
        "--prelude",
        min=0.0,
        max=60.0,
        metavar="SECONDS",
        help="Begin the film with this many seconds of planning [s]; needs a planner with iterations.",
    ),
]
Speed = Annotated[
    float,
    typer.Option(min=0.01, max=100, metavar="FACTOR", help="Speed of the film; 2 is twice as fast as real time."),
]
Vector = Annotated[bool, typer.Option("--vector", help="Write figures as PDF too.")]
Figures = Annotated[bool, typer.Option("--figures/--no-figures", help="Write figures.")]
Json = Annotated[bool, typer.Option("--json", help="Print one JSON object on stdout and nothing else.")]
