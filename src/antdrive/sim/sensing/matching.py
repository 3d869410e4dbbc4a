"""Scan matching: corrects odometry drift against the occupancy map."""

from __future__ import annotations

import math

import numpy as np

from antdrive.base import Floats, Pose
from antdrive.robots.lidar import Lidar
from antdrive.sim.sensing import _kernels_matching
from antdrive.sim.sensing.mapping import OccupancyMap

BEAMS = 180  # maximum number of beams matched per scan
FAR = 8.0  # default range of matched hits [m]
NEAR = 3  # search radius for the map's nearest hit, in grains (half cells)
FEWEST = 25  # fewest matched pairs of hits
CHORD = 10  # beams between the two hits that define a surface's direction
LONGEST_STEP = 0.2  # hits of neighbouring beams farther apart belong to different surfaces [m]
HELD = 0.1  # a direction is constrained if at least this fraction of the surfaces faces it
MOST = (0.02, 0.01)  # largest correction by one scan; a larger one is a mismatch [m], [rad]


class ScanMatcher:
    """Scan matcher against an occupancy map."""

    def __init__(self, lidar: Lidar, far: float = FAR) -> None:
        self._lidar, self._far = lidar, far
        angles = lidar.angles - lidar.yaw
        self._beams = np.column_stack((np.cos(angles), np.sin(angles)))
        self._every = max(1, round(lidar.beams / BEAMS))

    def corrected(self, seen: OccupancyMap, pose: Pose, ranges: Floats) -> Pose:
        """Return the corrected pose, or the pose itself if too few points match or the correction is too large."""
        lidar = self._lidar
        eye = lidar.pose_on(pose)
        first = seen.scans // seen.share % self._every
        x, y, yaw, pairs = _kernels_matching.match(
            *eye, self._beams, ranges, self._every, first, self._far, NEAR, FEWEST, seen.plain
        )
        turn = math.remainder(yaw - eye[2], 2 * math.pi)
        if pairs < FEWEST or math.hypot(x - eye[0], y - eye[1]) > MOST[0] or abs(turn) > MOST[1]:
            return pose
        heading = pose[2] + turn
        cos, sin = math.cos(heading), math.sin(heading)
        return x - cos * lidar.x + sin * lidar.y, y - sin * lidar.x - cos * lidar.y, heading


def without_sliding(before: Pose, after: Pose, points: Floats) -> Pose:
    """Remove the part of a correction that the scan does not constrain, such as a shift along the only visible wall.

    Take the mean outer product of the hit surfaces' normals. The scan constrains the pose along its eigenvectors with
    eigenvalues of at least `HELD`.
    """
    along = points[CHORD:] - points[:-CHORD]
    length = np.hypot(along[:, 0], along[:, 1])
    step = np.hypot(*np.diff(points, axis=0).T)
    gaps = np.concatenate([[0], np.cumsum(~(step < LONGEST_STEP))])  # also at missing points
    flat = (gaps[CHORD:] == gaps[:-CHORD]) & (length > 0)
    tangents = along[flat] / length[flat, None]
    single = max(0, int(np.count_nonzero(np.isfinite(points[:, 0]))) - len(tangents) - CHORD)  # on small objects
    count = single + len(tangents)
    if not count:
        return after
    spread = (np.eye(2) * (single / 2 + len(tangents)) - tangents.T @ tangents) / count
    values, vectors = np.linalg.eigh(spread)
    held = vectors[:, values >= HELD]
    dx, dy = held @ held.T @ np.array([after[0] - before[0], after[1] - before[1]])
    return before[0] + float(dx), before[1] + float(dy), after[2]
