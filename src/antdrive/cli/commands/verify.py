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
    task, spec = _expected(world, robot)
    checked: dict[str, dict[str, Any]] = {}
    for given in rollouts:
        path = str(given)
        try:
            path = str(log_at(given))
            checked[path] = _checked(given, task, spec, replay)
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


def _checked(path: Path, task: Task | None, robot: RobotSpec | None, again: bool) -> dict[str, Any]:
    """Everything that is found out about one log or folder of a run, ready for JSON."""
    from antdrive.sim.log.binding import differences, hashes_of
    from antdrive.sim.log.certificate import certify
    from antdrive.sim.log.claims import false_claims, read_result
    from antdrive.sim.log.rollout import Rollout

    rollout, result = Rollout.load(log_at(path)), path / "result.json"
    certificate = certify(rollout)
    found = certificate.as_dict()
    problems = [*certificate.problems, *differences(rollout.record, task=task, robot=robot)]
    if path.is_dir() and result.exists():
        problems += false_claims(read_result(result), rollout, rollout.digest)
    sentence = certificate.sentence
    if again:
        from antdrive.sim.driving.replay import replay

        try:
            check = replay(rollout)
        except ValueError as error:  # the record is of no drive
            problems.append(f"replay: {error}")
        else:
            found["replay"] = check.as_dict()
            problems += check.problems
            sentence += f"; {check.sentence}"
    if problems and certificate.certified:
        sentence = f"NOT verified; the log alone is {sentence}"
    return {
        **found,
        "readable": True,
        "certified": not problems,
        "problems": problems,
        "hashes": hashes_of(rollout.record),
        "sentence": sentence,
    }


def _sentences(found: dict[str, Any], world: str | None, robot: str | None) -> list[str]:
    about = [name for name in (world, robot) if name is not None]
    return [found["sentence"], *([f"about {' and '.join(about)}"] if about and found["certified"] else [])]
