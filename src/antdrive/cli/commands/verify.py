"""`antdrive verify`."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from antdrive.base.errors import InputError
from antdrive.cli import options
from antdrive.cli.console import print_error, print_json, print_line
from antdrive.cli.exits import FAILED, SUCCEEDED, WRONG_INPUT
from antdrive.cli.parse import log_at

if TYPE_CHECKING:
    from antdrive.robots.spec import RobotSpec
    from antdrive.worlds.world import Task

RobotFile = Annotated[
    str | None,
    typer.Option("--robot", "-r", metavar="NAME", help="The logs must be about this robot of the catalogue or file."),
]


def verify(
    rollouts: Annotated[list[Path], typer.Argument(metavar="ROLLOUT", help="Logs of drives, or the folders of runs.")],
    world: Annotated[
        str | None,
        typer.Option("--world", "-w", metavar="WORLD", help="The logs must be about this world: a name or a file."),
    ] = None,
    robot: RobotFile = None,
    replay: Annotated[
        bool, typer.Option("--replay", help="Drive the logged commands in physics again: they must give the log.")
    ] = False,
    json: options.Json = False,
) -> int:
    """Certify drives again, from their logs alone.

    With --world and --robot, a log must also be about these. In the folder of a run, result.json must agree with the log.
    Exit code 0: every log proves that the robot touched nothing.
    Exit code 2: one cannot be read; the others are certified all the same.
    """
    from antdrive.sim.verifying import verified

    task, spec = _expected(world, robot)
    checked: dict[str, dict[str, Any]] = {}
    for given in rollouts:
        path = str(given)
        try:
            path = str(log_at(given))
            checked[path] = verified(
                Path(path), task, spec, given / "result.json" if given.is_dir() else None, replay=replay
            )
        except InputError as error:
            print_error(str(error))
            checked[path] = {"certified": False, "problems": [str(error)], "readable": False}
        else:
            if not json:
                print_line(f"{path}: {'; '.join(_sentences(checked[path], world, robot))}")
                for problem in checked[path]["problems"]:
                    print_line(f"  {problem}")
    all_certified = all(found["certified"] for found in checked.values())
    readable = all(found["readable"] for found in checked.values())
    if json and (readable or len(checked) > 1):
        print_json({"certified": all_certified, "rollouts": checked})
    return WRONG_INPUT if not readable else SUCCEEDED if all_certified else FAILED


def _expected(world: str | None, robot: str | None) -> tuple[Task | None, RobotSpec | None]:
    from antdrive.robots.files import load_robot
    from antdrive.worlds.files.world_file import load_task

    return (
        None if world is None else load_task(world),
        None if robot is None else load_robot(robot),
    )


def _sentences(found: dict[str, Any], world: str | None, robot: str | None) -> list[str]:
    about = [name for name in (world, robot) if name is not None]
    return [found["sentence"], *([f"about {' and '.join(about)}"] if about and found["certified"] else [])]
