"""`antdrive init`."""

import shlex
from contextlib import ExitStack
from pathlib import Path
from typing import Annotated

from antdrive.base.atomic import made_folder, write_text
from antdrive.base.errors import InputError
from antdrive.base.tables import file_lines
from antdrive.cli.console import print_line
from antdrive.cli.options import argument

TEMPLATE = Path(__file__).parents[2] / "template"
ROBOT = "turtlebot"
#: Files of the template by what they are; the robot's is the catalogue's.
FILES = {
    "suite": "my.drive.yaml",
    "robot": "robot.yaml",
    "world": "world.yaml",
    "test": "test_mine.py",
    "workflow": ".github/workflows/drives.yml",
    "baseline": "baselines/my/hall-0.json",
}


def init(folder: Annotated[Path, argument("FOLDER", "Folder for the files; may exist.")] = Path()) -> None:
    """Write a suite, robot, world, Python test and CI workflow.

    Never overwrites a file.
    """
    from antdrive.robots import list_robots

    sources = {name: list_robots()[ROBOT] if kind == "robot" else TEMPLATE / name for kind, name in FILES.items()}
    if existing := [name for name in FILES.values() if (folder / name).exists()]:
        raise InputError(
            f"{folder / existing[0]}: exists, and init overwrites nothing: move it, or name another folder"
        )
    with ExitStack() as undo:
        for name, source in sources.items():
            target = folder / name
            undo.enter_context(made_folder(target.parent))
            undo.callback(target.unlink, missing_ok=True)
            write_text(target, source.read_text(encoding="utf-8"))
        undo.pop_all()
    for line in file_lines({kind: folder / name for kind, name in FILES.items()}):
        print_line(line)
    print_line("run it, from the shell or with pytest (pip install pytest):")
    print_line(f"  antdrive check {shlex.quote(str(folder / FILES['suite']))}")
    print_line(f"  pytest {shlex.quote(str(folder))}")
