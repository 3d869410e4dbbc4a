"""`antdrive verify`."""

import functools
from pathlib import Path
from typing import Annotated, Any

from antdrive.base.errors import InputError
from antdrive.base.tables import marked
from antdrive.base.version import require_physics
from antdrive.cli import options
from antdrive.cli.console import print_error, print_json, print_line
from antdrive.cli.exits import INVALID_INPUT
from antdrive.cli.options import argument, flag, option


def verify(
    rollouts: Annotated[list[Path], argument("ROLLOUT", "Logs of drives, or folders of runs.")],
    world: Annotated[str | None, option("WORLD", "Require this world (name or file) in the logs.")] = None,
    robot: Annotated[str | None, option("NAME", "Require this robot (name or file) in the logs.")] = None,
    replay: Annotated[bool, flag("Drive the logs again and compare every value.", "--replay")] = False,
    planner: Annotated[
        str | None,
        option("FILE.py:CLASS", "Class of the logs' planner, if not registered, or its plan's file; with --replay."),
    ] = None,
    controller: Annotated[
        str | None, option("FILE.py:CLASS", "Class of the logs' controller, if not registered; with --replay.")
    ] = None,
    json: options.Json = False,
) -> bool | int:
    """Re-certify drives from their logs alone.

    In a run's folder, result.json must agree with the log. Exit code 0: every log proves its drive collision-free.
    Exit code 2: a log cannot be read; the others are still certified.
    """
    from antdrive.robots.robot_file import load_robot
    from antdrive.sim.log.rollout import log_at
    from antdrive.sim.verifying import verify_log
    from antdrive.worlds.files.world_file import load_task

    for option_of, given_class, does in (("--planner", planner, "plans"), ("--controller", controller, "drives")):
        if given_class is not None and not replay:
            raise InputError(f"{option_of}: only the replay {does}; add --replay")
    if replay:
        require_physics()
    task = None if world is None else load_task(world)
    spec = None if robot is None else load_robot(robot)
    about = " and ".join(name for name in (world, robot) if name is not None)
    checked: dict[str, dict[str, Any]] = {}
    for given in rollouts:
        path = str(given)
        try:
            path = str(log_at(given))
            result = given / "result.json" if given.is_dir() else None
            elsewhere = functools.partial(_fingerprint_elsewhere, Path(path), planner, controller)
            report = checked[path] = verify_log(
                Path(path),
                task,
                spec,
                result,
                replay=replay,
                planner=planner,
                controller=controller,
                elsewhere=elsewhere,
            )
        except InputError as error:
            print_error(str(error))
            checked[path] = {"certified": False, "problems": [str(error)], "readable": False}
            continue
        if not json:
            certified = report["certified"]
            suffix = f"; about {about}" if about and certified else ""
            print_line(marked(certified, f"{path}: {report['sentence']}{suffix}"))
            for problem in report["problems"]:
                print_line(f"  {problem}")
    all_certified = all(report["certified"] for report in checked.values())
    readable = all(report["readable"] for report in checked.values())
    if json and (readable or len(checked) > 1):
        print_json({"certified": all_certified, "rollouts": checked})
    return all_certified if readable else INVALID_INPUT


def _fingerprint_elsewhere(log: Path, planner: str | None, controller: str | None) -> str | None:
    """Return the fingerprint of a log's drive in a new process; None if that is unknown."""
    from antdrive.runs.pool import in_new_process
    from antdrive.sim.rerun import rerun_fingerprint

    return in_new_process(functools.partial(rerun_fingerprint, log, planner, controller))
