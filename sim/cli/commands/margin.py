"""`antdrive margin`."""

from pathlib import Path
from typing import Annotated

import typer

from antdrive.sim.cli import options
from antdrive.sim.cli.console import print_json, print_line, print_table
from antdrive.sim.cli.exits import SUCCEEDED
from antdrive.sim.cli.parse import log_at


def margin(
    rollout: Annotated[Path, typer.Argument(metavar="ROLLOUT", help="Log of a drive, or the folder of a run.")],
    json: options.Json = False,
) -> int:
    """Break a drive's safety margin down by cause.

    Planning keeps the margin free around the robot. Reports how much of it the drive used up, where, and why:
    rounding, cutting corners, tracking, slip or localisation.
    """
    from antdrive.sim.log.margin import budget
    from antdrive.sim.log.rollout import Rollout

    spent = budget(Rollout.load(log_at(rollout)))
    if json:
        print_json(spent.as_dict())
        return SUCCEEDED
    place = f"({spent.x:.2f}, {spent.y:.2f}), t = {spent.t:.2f} s"
    print_line(f"{rollout}: margin {spent.margin:.3f} m, least room left around the disc {spent.left:.4f} m at {place}")
    print_table(
        ("cause", "used at most m", "at", "used at the tightest place m"),
        (
            (
                share.cause,
                f"{share.metres:.4f}",
                f"({share.x:.2f}, {share.y:.2f}), {share.t:.2f} s" if share.metres else "-",
                f"{share.at_tightest:+.4f}",
            )
            for share in spent.contributions
        ),
    )
    if spent.largest.metres:
        print_line(f"the largest loss is due to {spent.largest.cause}")
    return SUCCEEDED
