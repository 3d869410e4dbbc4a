"""The frames of an exported drive.

`map` is the frame of the map that the world came from, `odom` that of the world, in which the robot drives, and `base_link`
the robot's: on the floor, under the axle's centre, x forward. `map` and `odom` are the same, unless the world file says how
the world lies in its map. A mover i has the frame `mover_i`. The map that a robot makes itself has the frame `robot_map`, which
lies in `odom` so that the robot is where it believes to be: with errors of its odometry, it moves.
"""

from __future__ import annotations

MAP, ODOM, BASE, ESTIMATE, LIDAR, ROBOT_MAP = "map", "odom", "base_link", "estimate", "base_scan", "robot_map"

IDENTITY = (0.0, 0.0, 0.0)  # the pose of a frame in itself


def mover_frame(index: int) -> str:
    """The frame of a mover."""
    return f"mover_{index}"
