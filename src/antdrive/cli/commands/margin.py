"""`antdrive margin`."""

import dataclasses
from typing import TYPE_CHECKING

from antdrive.cli import options
from antdrive.cli.console import show, table
from antdrive.cli.parse import log_at

if TYPE_CHECKING:
    from antdrive.sim.log.rollout import Rollout


def margin(rollout: options.Log, json: options.Json = False) -> None:
    """Break a drive's safety margin down by cause.

    Planning keeps the margin free around the robot. Reports how much of it the drive used up, where, and why:
    rounding, cutting corners, tracking, slip or localisation. For a margin that --margin auto chose, it also compares the
    loss that was predicted with that of this drive.

    "Used at most" is the most that a cause took of the margin anywhere in the drive, and where. "At the tightest place" is
    each cause's share of the margin less the least room left, which is their sum: positive where it brought the robot
    closer to the obstacle, negative where it took the robot away from it.
    """
    from antdrive.sim.log.margin import budget
    from antdrive.sim.log.rollout import Rollout

    log = Rollout.load(log_at(rollout))
    spent, prediction = budget(log), _prediction(log)
    place = f"({spent.x:.2f}, {spent.y:.2f}), t = {spent.t:.2f} s"
    rows = (
        (
            share.cause,
            f"{share.metres:.4f}",
            f"({share.x:.2f}, {share.y:.2f}), {share.t:.2f} s" if share.metres else "-",
            f"{share.at_tightest:+.4f}",
        )
        for share in spent.contributions
    )
    lines = [
        f"{rollout}: margin {spent.margin:.3f} m, least room left around the disc {spent.left:.4f} m at {place}",
        *table(("cause", "used at most m", "at", "at the tightest place m"), rows),
        f"the largest loss is due to {spent.largest.cause}"
        if spent.largest.metres
        else "nothing was used: the robot never came closer to an obstacle than the margin",
    ]
    if prediction is not None:
        loss = prediction["footprint_loss_m"]
        drive = "this drive had movers or unseen obstacles" if loss is None else f"the footprint lost {loss:.4f} m"
        lines.append(f"chosen by --margin auto for a predicted loss of {prediction['loss_m']:.4f} m; {drive}")
    show(json, {**spent.as_dict(), "prediction": prediction}, lines)


def _prediction(log: "Rollout") -> dict[str, float | None] | None:
    """What --margin auto predicted, beside what the footprint lost; None where the margin was given.

    The prediction is about the standing obstacles that the planner knew, and so must be the drive's own loss.
    """
    from antdrive.sim.log.certificate import certify

    record = log.record
    if record.margin_choice is None:
        return None
    loss = None if record.world.movers or record.unseen else record.margin - certify(log).bound
    return {**dataclasses.asdict(record.margin_choice), "footprint_loss_m": loss}
