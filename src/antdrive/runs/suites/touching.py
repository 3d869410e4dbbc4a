"""What kind of thing a drive touched first, and what took the margin that should have prevented it."""

from __future__ import annotations

import dataclasses

from antdrive.runs.suites.demands import CYLINDER, MOVER, UNSEEN, WALL
from antdrive.sim.log.contacts import touches_of
from antdrive.sim.log.margin import budget
from antdrive.sim.log.rollout import Rollout

NOTHING = "nothing"  # is what a drive without a contact touched


def touched_first(rollout: Rollout) -> str:
    """The kind of thing that a drive touched first, or `NOTHING`."""
    found = touches_of(rollout)
    if not found:
        return NOTHING
    index, record = found[0].obstacle, rollout.record
    known = len(record.task.world.obstacles)
    for kind, count in ((CYLINDER, known), (UNSEEN, len(record.unseen)), (MOVER, len(record.task.world.movers))):
        if index < count:
            return kind
        index -= count
    return WALL


def cause_of_contact(rollout: Rollout) -> str:
    """What took most of the margin at the tightest place up to the first contact, a key of `antdrive.sim.log.margin.CAUSES`.

    It is empty for what no margin could prevent: contacts with movers, with cylinders that the planner did not know of, and none.
    """
    if touched_first(rollout) not in (CYLINDER, WALL):
        return ""
    rows = int(rollout.contacts[0, 0]) + 1
    arrays = ("t", "pose", "twist", "command", "clearance", "limiter", "movers")
    cut = {name: getattr(rollout, name)[:rows] for name in arrays}
    cut |= {name: getattr(rollout, name)[:rows] for name in ("estimate", "actuated") if len(getattr(rollout, name))}
    spent = budget(dataclasses.replace(rollout, **cut))
    return max(spent.contributions, key=lambda part: part.at_tightest).cause
