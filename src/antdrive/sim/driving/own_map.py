"""The map that a robot makes itself: its sizes, and when a logged drive made it anew. No compiled code is loaded for it."""

from __future__ import annotations

from collections.abc import Iterator

from antdrive.sim.driving.replan_causes import LOOKED
from antdrive.sim.log.record import DriveRecord, ReplanRecord

MAP_CELL = 0.05  # side of the map's cells [m]
HORIZON, HORIZON_AMONG_MOVERS = 10.0, 16.0  # hits farther away are not entered in the map [m]
RECENT = 1.0  # scans of this time are kept where the map is made anew [s]
PAD = 0.01  # the robot keeps this from what was hit and from what was not seen: rounding of ranges, and of cells [m]
PATIENCE = 3  # plans in a row that find no path before the robot no longer believes what it saw long ago


def horizon_of(*, watching: bool) -> float:
    """How far away a hit may be that is entered in a robot's map [m]."""
    return HORIZON_AMONG_MOVERS if watching else HORIZON


def turning_room(radius: float) -> float:
    """How far around a robot ground is to be free, so that it may turn on the spot in its own sight [m].

    Half a cell is more than the circle around a cell, by which ground that was not seen counts, stands out of it.
    """
    return radius + PAD + 0.5 * MAP_CELL


def forgetting_ticks(record: DriveRecord) -> Iterator[int]:
    """The control periods in which a robot without a map forgot what it had seen: after some plans in a row found no path."""
    failures = 0
    for replan in record.replans:
        if failures >= PATIENCE and replan.trigger != LOOKED:
            failures = 0
            yield _tick(record, replan)
        failures = 0 if replan.solved else failures + 1


def _tick(record: DriveRecord, replan: ReplanRecord) -> int:
    return round(replan.t * record.control_hz)
