"""`antdrive margin`."""

import dataclasses
from typing import TYPE_CHECKING

from antdrive.base.tables import table
from antdrive.cli import options
from antdrive.cli.console import show

if TYPE_CHECKING:
    from antdrive.sim.log.rollout import Rollout


def margin(rollout: options.Log, json: options.Json = False) -> None:
    """Break down a drive's safety margin by cause.

    Plans keep the margin free around the robot's disc, or its footprint. Only standing obstacles that they know count. The
    table shows how much of it the drive used, where, and why: rounding, corner cutting, tracking, heading, slip or
    localisation. For a margin of --margin auto, it also compares
    the predicted loss with the actual loss; a margin that is the default is called so.

    "Used at most" is the maximum that a cause used anywhere in the drive. "At the tightest place" splits the loss at the
    smallest remaining clearance by cause: positive towards the obstacle, negative away from it.
    """
    from antdrive.base.plane import format_point
    from antdrive.sim.log.margin import budget, has_default
    from antdrive.sim.log.metrics import measure
    from antdrive.sim.log.rollout import Rollout, log_at

    log = Rollout.load(log_at(rollout))
    spent, prediction = budget(log), _prediction(log)
    place = f"{format_point((spent.x, spent.y), 2)}, t = {spent.t:.2f} s"
    rows = (
        (
            share.cause,
            f"{share.metres:.4f}",
            f"{format_point((share.x, share.y), 2)}, {share.t:.2f} s" if share.metres else "-",
            f"{share.at_tightest:+.4f}",
        )
        for share in spent.contributions
    )
    record, shape = log.record, log.record.shape
    own = measure(log)["min_clearance_m"]
    others = [name for name, there in (("movers", record.world.movers), ("unseen obstacles", record.unseen)) if there]
    lines = [
        f"{rollout}: margin {spent.margin:.3f} m, smallest clearance of the robot's {shape} {spent.left:.4f} m at {place}"
        + ("" if others or shape == "footprint" else f" (of its footprint {own:.4f} m)"),
        *table(("cause", "used at most m", "at", "at the tightest place m"), rows),
        f"largest loss: {spent.largest.cause}"
        if spent.largest.metres
        else "no loss: the robot never came closer to an obstacle than the margin",
    ]
    if others:
        lines.append(f"standing obstacles of the map alone: {' and '.join(others)} do not count")
    if has_default(record):
        lines.append(f"the margin is the default for noise {record.noise:g}, smoothing {record.smoothing.asked}")
    if prediction is not None:
        loss = prediction["footprint_loss_m"]
        drive = "not measured (movers or unseen obstacles)" if loss is None else f"{loss:.4f} m for the footprint"
        lines.append(f"--margin auto: predicted loss {prediction['loss_m']:.4f} m, actual loss {drive}")
    show(json, {**spent.as_dict(), "prediction": prediction}, lines)


def _prediction(log: "Rollout") -> dict[str, float | None] | None:
    """Return the loss predicted by --margin auto and the footprint's actual loss; None for a fixed margin.

    The prediction covers only static obstacles known to the planner. With movers or unseen obstacles the actual loss is None.
    """
    from antdrive.sim.log.certificate import certify

    record = log.record
    if record.margin_choice is None:
        return None
    loss = None if record.world.movers or record.unseen else record.kept_margin - certify(log).bound
    return {**dataclasses.asdict(record.margin_choice), "footprint_loss_m": loss}
