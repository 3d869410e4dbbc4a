"""How far a robot sees free ground on the way that it is commanded to take."""

from __future__ import annotations

import functools

from antdrive.base import Floats, Pose
from antdrive.robots.footprint import shape_of
from antdrive.robots.spec import Footprint
from antdrive.sim.sensing import _kernels_sight
from antdrive.sim.sensing.mapping import OccupancyMap


def clear_distance(
    seen: OccupancyMap,
    pose: Pose,
    speed: float,
    yaw_rate: float,
    footprint: Footprint,
    limit: float,
    *,
    daring: bool = False,
) -> float:
    """How far the footprint, swept along the arc of a twist, stays on ground that was seen free, at most `limit` [m].

    Ground counts as not seen by whole cells, and what was hit by its discs. It is a lower bound, to 1 mm. What the
    footprint overlaps already does not stop a robot that leaves it or drives along it, only one that would come nearer.

    Args:
        seen: the map
        pose: the robot's estimated pose
        speed: forward speed [m/s], not 0; negative: backwards
        yaw_rate: counter-clockwise [rad/s]
        footprint: the robot's footprint
        limit: how far is far enough [m]
        daring: whether ground that was not seen counts as free, so that only hits end the way
    """
    if speed == 0.0:
        return 0.0 if yaw_rate else limit
    return _clear(seen, pose, speed, yaw_rate, footprint, limit, daring)


def clear_turn(
    seen: OccupancyMap, pose: Pose, yaw_rate: float, footprint: Footprint, limit: float, *, daring: bool = False
) -> float:
    """How far the robot can turn on the spot over ground that was seen free, at most `limit` [rad]; as `clear_distance`.

    Args:
        seen: the map
        pose: the robot's estimated pose
        yaw_rate: counter-clockwise [rad/s]; only its sign counts
        footprint: the robot's footprint
        limit: how far is far enough [rad]
        daring: whether ground that was not seen counts as free
    """
    return _clear(seen, pose, 0.0, yaw_rate, footprint, limit, daring)


def _clear(
    seen: OccupancyMap, pose: Pose, speed: float, yaw_rate: float, footprint: Footprint, limit: float, daring: bool
) -> float:
    shape = footprint.half_length, footprint.half_width, footprint.rounding
    arrays = tuple(seen.arrays._replace(free=~seen.occupied)) if daring else seen.plain
    return float(_kernels_sight.clear_way(*pose, speed, yaw_rate, *shape, _corners(footprint), limit, arrays))


@functools.lru_cache(maxsize=16)
def _corners(footprint: Footprint) -> Floats:
    return shape_of(footprint)[1]
