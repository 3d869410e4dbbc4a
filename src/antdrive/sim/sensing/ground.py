"""What stands still, as far as a robot knows, and which points of a scan it explains: a given map, or one of its own."""

from __future__ import annotations

import dataclasses
import math
from typing import NamedTuple, Protocol

import numpy as np
import numpy.typing as npt

from antdrive.base import Floats, Pose
from antdrive.robots.lidar import Lidar
from antdrive.sim.sensing.mapping import OccupancyMap
from antdrive.worlds import World, point_clearance

SLACK = 0.02  # points so near to a known surface lie on it, without any error [m]
SIGMAS = 3.0  # errors up to so many standard deviations are allowed for


class Hits(NamedTuple):
    """Where the beams of a scan ended."""

    beams: npt.NDArray[np.intp]  # the numbers of the beams that met something near enough (N,)
    points: Floats  # where they ended, in the frame of the estimated pose (N, 2) [m]
    explained: npt.NDArray[np.bool_]  # whether what stands still explains them (N,)


class Ground(Protocol):
    """Tells which hits of a scan are no news."""

    @property
    def complete(self) -> bool:
        """Whether all that is known to stand still is on it from the beginning."""

    def hits(self, pose: Pose, ranges: Floats) -> Hits:
        """The hits of a scan."""


class KnownGround:
    """The cylinders and walls of a given map. Whatever they do not explain is a mover or an unknown obstacle.

    Attributes:
        complete: true

    Args:
        lidar: the robot's lidar; cylinders below its beams do not count
        world: the map; its movers do not count
        reach: hits farther than this from the lidar are left out [m]
        pose_xy: standard deviation of the estimated position [m]
        pose_yaw: and of the heading [rad]
    """

    complete = True

    def __init__(
        self, lidar: Lidar, world: World, reach: float = math.inf, pose_xy: float = 0.0, pose_yaw: float = 0.0
    ) -> None:
        tall = tuple(disc for disc in world.obstacles if disc.height >= lidar.height)
        self._lidar, self._world = lidar, dataclasses.replace(world, obstacles=tall, movers=())
        self._reach = min(reach, lidar.max_range)
        self._pose_xy, self._pose_yaw = pose_xy, pose_yaw

    def hits(self, pose: Pose, ranges: Floats) -> Hits:
        """The hits of a scan.

        Args:
            pose: the robot's estimated pose
            ranges: the scan (beams,) [m]
        """
        beams = np.flatnonzero(np.isfinite(ranges) & (ranges <= self._reach))
        away, points = ranges[beams], ends(self._lidar, pose, ranges, beams)
        error = np.sqrt(self._lidar.sigma**2 + self._pose_xy**2 + (away * self._pose_yaw) ** 2)
        slack = SLACK + self._lidar.resolution / 2 + SIGMAS * error
        return Hits(beams, points, point_clearance(self._world, points) <= slack)


class MappedGround:
    """The map that a robot makes of its scans. It explains what has long been there, and what lies on ground not yet seen.

    Attributes:
        complete: false

    Args:
        seen: the map of the earlier scans
        settle: after how many scans what has come counts as standing
    """

    complete = False

    def __init__(self, seen: OccupancyMap, settle: int) -> None:
        self._seen, self._settle = seen, settle

    def hits(self, pose: Pose, ranges: Floats) -> Hits:
        """The hits of a scan.

        Args:
            pose: the robot's estimated pose
            ranges: the scan (beams,) [m]
        """
        beams = np.flatnonzero(np.isfinite(ranges) & (ranges <= self._seen.horizon))
        points = np.ascontiguousarray(self._seen.endpoints(pose, ranges)[beams])
        return Hits(beams, points, self._seen.explained(points, self._settle))


def ends(lidar: Lidar, pose: Pose, ranges: Floats, beams: npt.NDArray[np.intp]) -> Floats:
    """Where some beams of a scan end (N, 2) [m]."""
    x, y, yaw = lidar.pose_on(pose)
    angles = lidar.angles[beams] - lidar.yaw + yaw
    return np.column_stack((x + ranges[beams] * np.cos(angles), y + ranges[beams] * np.sin(angles)))
