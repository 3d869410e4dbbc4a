"""`antdrive verify`."""

from pathlib import Path
from typing import Annotated, Any

from antdrive.base.errors import InputError
from antdrive.cli import options
from antdrive.cli.console import print_error, print_json, print_line
from antdrive.cli.exits import INVALID_INPUT
from antdrive.cli.options import argument, flag, option
from antdrive.cli.parse import log_at


def verify(
    rollouts: Annotated[list[Path], argument("ROLLOUT", "Logs of drives, or the folders of runs.")],
    world: Annotated[str | None, option("WORLD", "The logs must be about this world: a name or a file.")] = None,
    robot: Annotated[str | None, option("NAME", "The logs must be about this robot of the catalogue or file.")] = None,
    replay: Annotated[
        bool, flag("Drive the logged commands in physics again: they must give the log.", "--replay")
    ] = False,
    json: options.Json = False,
) -> bool | int:
    """Certify drives again, from their logs alone.

    With --world and --robot, a log must also be about these. In the folder of a run, result.json must agree with the log.
    Exit code 0: every log proves that the robot touched nothing.
    Exit code 2: one cannot be read; the others are certified all the same.
    """
    from antdrive.robots.robot_file import load_robot
    from antdrive.sim.verifying import verify_log
    from antdrive.worlds.files.world_file import load_task

    task = None if world is None else load_task(world)
    spec = None if robot is None else load_robot(robot)
    about = " and ".join(name for name in (world, robot) if name is not None)
    checked: dict[str, dict[str, Any]] = {}
    for given in rollouts:
        path = str(given)
        try:
            path = str(log_at(given))
            result = given / "result.json" if given.is_dir() else None
            found = checked[path] = verify_log(Path(path), task, spec, result, replay=replay)
        except InputError as error:
            print_error(str(error))
            checked[path] = {"certified": False, "problems": [str(error)], "readable": False}
            continue
        if not json:
            print_line(f"{path}: {found['sentence']}{f'; about {about}' if about and found['certified'] else ''}")
            for problem in found["problems"]:
                print_line(f"  {problem}")
    all_certified = all(found["certified"] for found in checked.values())
    readable = all(found["readable"] for found in checked.values())
    if json and (readable or len(checked) > 1):
        print_json({"certified": all_certified, "rollouts": checked})
    return all_certified if readable else INVALID_INPUT
