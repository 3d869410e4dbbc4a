"""Closest approach and first contact of a drive: the thing, the place, the time, and the cause of lost margin."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass

import numpy as np

from antdrive.base.plane import format_number, format_point
from antdrive.base.records import STRICT
from antdrive.foreign.playback import ForeignRollout
from antdrive.robots.clearance import footprint_distances
from antdrive.runs.suites.demands import CYLINDER, MOVER, UNSEEN, WALL
from antdrive.sim.log.contacts import touches_of
from antdrive.sim.log.margin import budget
from antdrive.sim.log.rollout import Rollout
from antdrive.worlds.world import Disc, obstacle_name

# Columns of `footprint_distances` and indices in a log's contacts order the walls differently.
_WALL_OF_CONTACT = (0, 2, 1, 3)  # left, right, lower, upper as columns after the obstacles


@dataclass(frozen=True)
class ClosestApproach:
    """The robot's closest approach to a thing."""

    __pydantic_config__ = STRICT

    thing: str  # an obstacle, a mover or a wall, as in messages
    t: float  # time [s]
    x: float  # robot's position [m]
    y: float  # robot's position [m]
    clearance: float  # distance between the robot's surface and the thing's [m]

    @property
    def place(self) -> str:
        """Place and time, in words."""
        return f"the robot was at {format_point((self.x, self.y), 2)} at t = {self.t:.2f} s"


def nearest_of(rollout: Rollout) -> ClosestApproach:
    """Return the closest approach of a drive."""
    row = int(rollout.clearance.argmin())
    if isinstance(rollout, ForeignRollout):
        return _encounter(rollout, row, rollout.certificate.nearest.rpartition(": ")[0])
    world = dataclasses.replace(rollout.record.world, movers=())
    static = footprint_distances(world, rollout.record.robot, [rollout.pose[row]])[0]
    index, least = int(static.argmin()), float(static.min())
    thing = obstacle_name(world, index, len(rollout.record.unseen))
    movers = _mover_gaps(rollout, row)
    if len(movers) and movers.min() < least:
        thing = _mover(rollout, int(movers.argmin()), row)
    return _encounter(rollout, row, thing)


def first_contact(rollout: Rollout) -> ClosestApproach | None:
    """Return the first contact; None without one."""
    touches = touches_of(rollout)
    if not touches:
        return None
    row, kind = touches[0].step, first_contact_kind(rollout)
    world = dataclasses.replace(rollout.record.world, movers=())
    discs, index = len(world.obstacles), touches[0].obstacle
    if kind == MOVER:
        return _encounter(rollout, row, _mover(rollout, index - discs, row))
    column = discs + _WALL_OF_CONTACT[index - discs - len(rollout.record.world.movers)] if kind == WALL else index
    return _encounter(rollout, row, obstacle_name(world, column, len(rollout.record.unseen)))


def _mover_gaps(rollout: Rollout, row: int) -> np.ndarray[tuple[int, ...], np.dtype[np.float64]]:
    """Return the distance from the robot to each mover at a row (M,) [m]."""
    record = rollout.record
    places = rollout.movers[row].tolist()
    discs = tuple(Disc(x, y, mover.radius) for (x, y), mover in zip(places, record.world.movers, strict=True))
    world = dataclasses.replace(record.world, obstacles=discs, movers=())
    return np.asarray(footprint_distances(world, record.robot, [rollout.pose[row]])[0, : len(discs)])


def _mover(rollout: Rollout, index: int, row: int) -> str:
    at, radius = rollout.movers[row, index].tolist(), rollout.record.world.movers[index].radius
    return f"movers[{index}] at {format_point(at, 2)} with radius {format_number(radius)}"


def _encounter(rollout: Rollout, row: int, thing: str) -> ClosestApproach:
    x, y = (round(value, 3) + 0.0 for value in rollout.pose[row, :2].tolist())
    clearance = round(float(rollout.clearance[row]), 6)
    return ClosestApproach(thing, round(float(rollout.t[row]), 3), x, y, clearance)


NOTHING = "nothing"  # touched in a drive without contact


def first_contact_kind(rollout: Rollout) -> str:
    """Return the kind of the first thing touched, or `NOTHING`."""
    touches = touches_of(rollout)
    if not touches:
        return NOTHING
    index, record = touches[0].obstacle, rollout.record
    known = len(record.task.world.obstacles)
    for kind, count in ((CYLINDER, known), (UNSEEN, len(record.unseen)), (MOVER, len(record.task.world.movers))):
        if index < count:
            return kind
        index -= count
    return WALL


def cause_of_contact(rollout: Rollout) -> str:
    """Return the largest cause of lost margin at the tightest place up to the first contact, a key of `CAUSES`.

    Empty for contacts that no margin could prevent, with movers or unseen cylinders, and without contact.
    """
    if first_contact_kind(rollout) not in (CYLINDER, WALL):
        return ""
    rows = rollout.first_contact + 1
    arrays = ("t", "pose", "twist", "command", "clearance", "limiter", "movers")
    cut = {name: getattr(rollout, name)[:rows] for name in arrays}
    cut |= {name: getattr(rollout, name)[:rows] for name in ("estimate", "actuated") if len(getattr(rollout, name))}
    spent = budget(dataclasses.replace(rollout, **cut))
    return max(spent.contributions, key=lambda part: part.at_tightest).cause
