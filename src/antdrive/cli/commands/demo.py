"""`antdrive demo`."""

import shlex
import sys
from pathlib import Path
from typing import Annotated

import typer

from antdrive.cli.console import print_line
from antdrive.cli.exits import SUCCEEDED
from antdrive.cli.options import option

WORDS = "compare forest --planner mmas --planner astar --prelude 5 --speed 2"
OPENERS = {"darwin": "open", "win32": 'start ""'}  # elsewhere xdg-open


def demo(
    *, context: typer.Context, out: Annotated[Path, option("FOLDER", "Output folder.")] = Path("out") / "demo"
) -> int:
    """Film ants and A* in one picture, planning and driving.

    The last line of the output is the command that opens the film.
    """
    film = out / "film.mp4"
    words = [*WORDS.split(), "--out", str(out), "--film", str(film)]
    code: int = context.find_root().command.main(words, context.find_root().info_name, standalone_mode=False)
    if code == SUCCEEDED:
        print_line(f"{OPENERS.get(sys.platform, 'xdg-open')} {shlex.quote(str(film))}")
    return code
