"""The frames of an exported drive.

`map` is the frame of the map that the world came from, `odom` that of the world, in which the robot drives, and `base_link`
the robot's: on the floor, under the axle's centre, x forward. `map` and `odom` are the same, unless the world file says how
the world lies in its map. A mover i has the frame `mover_i`.
"""

from __future__ import annotations

MAP, ODOM, BASE, ESTIMATE, LIDAR = "map", "odom", "base_link", "estimate", "base_scan"


def mover_frame(index: int) -> str:
    """The frame of a mover.

    Args:
        index: the mover's, counted from 0
    """
    return f"mover_{index}"
