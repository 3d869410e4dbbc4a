"""The frames of an exported drive.

`map` is the frame of the map that the world came from, `odom` that of the world, in which the robot drives, and `base_link`
the robot's: on the floor, under the axle's centre, x forward. `map` and `odom` are the same, unless the world file says how
the world lies in its map. A mover i has the frame `mover_i`.
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from antdrive.worlds.types import Floats, Pose

MAP, ODOM, BASE, ESTIMATE, LIDAR = "map", "odom", "base_link", "estimate", "base_scan"


def mover_frame(index: int) -> str:
    """The frame of a mover.

    Args:
        index: the mover's, counted from 0
    """
    return f"mover_{index}"


def in_map(frame: Pose, points: npt.ArrayLike) -> Floats:
    """Points (N, 2) or poses (N, 3) of the world in the frame of its map; the same numbers, bit for bit, where the two agree.

    Args:
        frame: the world's pose in its map: x, y [m] and yaw [rad]
        points: x, y [m] and, for poses, yaw [rad]
    """
    found = np.array(points, dtype=np.float64)
    x, y, yaw = frame
    if (x, y, yaw) == (0.0, 0.0, 0.0):
        return found
    cosine, sine = math.cos(yaw), math.sin(yaw)
    turned = found @ np.array([[cosine, sine], [-sine, cosine]]) if found.shape[-1] == 2 else found.copy()
    if found.shape[-1] > 2:
        turned[..., :2] = found[..., :2] @ np.array([[cosine, sine], [-sine, cosine]])
        turned[..., 2] = (found[..., 2] + yaw + math.pi) % (2 * math.pi) - math.pi
    turned[..., :2] += (x, y)
    return turned
