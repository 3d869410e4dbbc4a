"""Where the robot must be for its scan to lie on its map: drift of odometry is taken back while the map is in sight."""

from __future__ import annotations

import math

import numpy as np

from antdrive.robots.lidar import Lidar
from antdrive.sim.sensing import _kernels_matching
from antdrive.sim.sensing.mapping import OccupancyMap
from antdrive.worlds import Floats, Pose

BEAMS = 180  # of a scan that are matched, at most
FAR = 8.0  # hits farther away are not matched [m]
NEAR = 3  # how far partners are looked for, in grains of the map
FEWEST = 25  # pairs below which a scan is not matched
MOST = (0.02, 0.01)  # what one scan may correct; more is an error of the match [m], [rad]


class ScanMatcher:
    """Corrects a pose by laying a scan on the map.

    Args:
        lidar: whose scans are matched
    """

    def __init__(self, lidar: Lidar) -> None:
        self._lidar = lidar
        angles = lidar.angles - lidar.yaw
        self._beams = np.column_stack((np.cos(angles), np.sin(angles)))
        self._every = max(1, round(lidar.beams / BEAMS))

    def corrected(self, seen: OccupancyMap, pose: Pose, ranges: Floats) -> Pose:
        """The pose, corrected; the pose itself where too little of the scan is on the map, or the map says too much else.

        Args:
            seen: the map, without the scan
            pose: the estimated pose of the robot
            ranges: the scan (beams,) [m]
        """
        lidar = self._lidar
        eye = np.array(lidar.pose_on(pose))
        first = seen.scans // seen.share % self._every
        x, y, yaw, pairs = _kernels_matching.match(
            eye, self._beams, ranges, self._every, first, FAR, NEAR, FEWEST, seen.arrays
        )
        turn = math.remainder(yaw - float(eye[2]), 2 * math.pi)
        if pairs < FEWEST or math.hypot(x - eye[0], y - eye[1]) > MOST[0] or abs(turn) > MOST[1]:
            return pose
        heading = pose[2] + turn
        cos, sin = math.cos(heading), math.sin(heading)
        return x - cos * lidar.x + sin * lidar.y, y - sin * lidar.x - cos * lidar.y, heading
