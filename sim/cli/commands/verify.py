"""`antdrive verify`."""

from pathlib import Path
from typing import Annotated

import typer

from antdrive.sim.cli import options
from antdrive.sim.cli.console import print_json, print_line
from antdrive.sim.cli.exits import FAILED, SUCCEEDED


def verify(
    rollouts: Annotated[list[Path], typer.Argument(metavar="ROLLOUT.npz", help="Logs of drives.")],
    json: options.Json = False,
) -> int:
    """Certify drives again, from their logs alone.

    Exit code 0: every log proves that the robot touched nothing.
    """
    from antdrive.sim.log.certificate import certify
    from antdrive.sim.log.rollout import Rollout

    checked = {str(path): certify(Rollout.load(path)) for path in rollouts}
    all_certified = all(certificate.certified for certificate in checked.values())
    if json:
        found = {path: certificate.as_dict() for path, certificate in checked.items()}
        print_json({"certified": all_certified, "rollouts": found})
    else:
        for path, certificate in checked.items():
            print_line(f"{path}: {certificate.sentence}")
            for problem in certificate.problems:
                print_line(f"  {problem}")
    return SUCCEEDED if all_certified else FAILED
