"""The options that say what a robot knows of the world and of its pose."""

from __future__ import annotations

from typing import Annotated

import typer

_POSE = (
    "How the robot knows its pose: fixes (with the noise of its file), odometry (wheels and gyro, which drift), matching "
    "(odometry, corrected by laying scans on the map that it makes) or true (without error)."
)
_ERRORS = "Multiple of the documented errors of odometry."

Map = Annotated[
    str,
    typer.Option(
        metavar="given|none",
        help="What the robot knows of the world before it drives: all of it, or nothing but what its lidar sees on the way.",
    ),
]
Localisation = Annotated[str, typer.Option(metavar="KIND", help=_POSE)]
Odometry = Annotated[float, typer.Option("--odometry", min=0.0, max=100.0, metavar="FACTOR", help=_ERRORS)]

Maps = Annotated[
    list[str] | None,
    typer.Option("--map", metavar="given|none", help="What robots know of the world. May be repeated."),
]
Localisations = Annotated[
    list[str] | None,
    typer.Option("--localisation", metavar="KIND", help="fixes, odometry, matching or true. May be repeated."),
]
Odometries = Annotated[
    list[float] | None,
    typer.Option("--odometry", min=0.0, max=100.0, metavar="FACTOR", help=f"{_ERRORS} May be repeated."),
]
