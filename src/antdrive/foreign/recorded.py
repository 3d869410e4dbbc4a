"""Maps and footprints that a bag holds."""

from __future__ import annotations

import math
from collections import deque
from pathlib import Path

import numpy as np

from antdrive.base.bags import Bag, readable
from antdrive.base.errors import FieldError, input_error
from antdrive.base.plane import map_to_world, poses_at
from antdrive.foreign.frames import ROBOTS
from antdrive.foreign.log import read_log
from antdrive.robots.importing.hull import convex_hull
from antdrive.robots.outline import Footprint
from antdrive.worlds.formats.cellmap import CellMap
from antdrive.worlds.formats.map_server import ServedMap
from antdrive.worlds.limits import MAX_CELLS

FREE, OCCUPIED = 25, 65  # Nav2's limits of a cell's occupancy, below and above [%]
SPREAD = 0.02  # of a footprint's corners between messages [m]


def read_map(path: Path, *, unknown_is_free: bool = False) -> tuple[ServedMap, str]:
    """Return the last occupancy grid on /map, else on the only topic of such grids, and its frame.

    Raises:
        InputError: the bag is invalid, or has no such map.
    """
    with Bag(path) as bag, readable(path):
        topic = bag.topic_of("nav_msgs/msg/OccupancyGrid", "", "name a map with --map; it has", "/map")
        last = deque(bag.messages(topic), 1)
        if not last:
            raise input_error(str(path), f"no message on {topic}")
        info, data, above = last[0][2].info, np.asarray(last[0][2].data), last[0][2].header.frame_id.strip("/")
        place, q = info.origin.position, info.origin.orientation
        x, y, yaw = place.x, place.y, math.atan2(2 * (q.w * q.z + q.x * q.y), 1 - 2 * (q.y**2 + q.z**2))
        side, rows, cols = float(info.resolution), int(info.height), int(info.width)
    if not (0 < rows * cols == data.size <= MAX_CELLS and 0 < side < math.inf and math.isfinite(x + y + yaw)):
        about = f"{rows} x {cols} cells of {side:g} m at {x:g}, {y:g}, {yaw:g}"
        raise input_error(str(path), f"{topic} holds no map: {about}")
    value = data.reshape(rows, cols)
    free = (value >= 0) & (value < FREE)
    unknown = ~free & ~((value > OCCUPIED) & (value <= 100))
    frame, corner = ((x, y, yaw), (0.0, 0.0)) if yaw else ((0.0, 0.0, 0.0), (x, y))
    free |= unknown & unknown_is_free
    free.setflags(write=False)
    return ServedMap(CellMap(free, round(side, 7), corner, frame, unknown), int(unknown.sum()), (), None, frame), above


def read_footprint(path: Path, topic: str, *, pose: str | None = None, robot_frame: str | None = None) -> Footprint:
    """Return the convex hull of the polygon that a topic publishes; poses as of `read_log` lead to the robot's frame.

    Raises:
        InputError: the bag is invalid, or has no such polygon, or it changes by more than 2 cm.
    """
    with Bag(path) as bag, readable(path):
        bag.topic_of("geometry_msgs/msg/PolygonStamped", topic, "--footprint takes")
        messages = [message for _, _, message in bag.messages(topic)]
        alike = {(m.header.frame_id.strip("/"), len(m.polygon.points)) for m in messages}
        corners = np.array(
            [[(p.x, p.y) for p in m.polygon.points] for m in messages if len(alike) == 1], dtype=np.float64
        )
        stamps = np.array([m.header.stamp.sec + m.header.stamp.nanosec / 1e9 for m in messages])
    frame = min(alike, default=("", 0))[0]
    if len(corners) and frame != robot_frame and frame.rpartition("/")[2] not in ROBOTS:
        log = read_log(path, pose=pose, map_frame=frame, robot_frame=robot_frame)
        t = stamps - log.start
        known = (t >= 0) & (t <= log.t[-1])
        poses = poses_at(t[known], log.t, log.pose)
        corners = np.array([map_to_world(tuple(at), some) for at, some in zip(poses, corners[known], strict=True)])
    if not len(corners) or not np.isfinite(corners).all() or np.ptp(corners, axis=0).max(initial=0) > SPREAD:
        raise input_error(str(path), f"the polygon on {topic} is nowhere known or changes by more than {SPREAD:g} m")
    try:
        return Footprint.polygon(convex_hull(np.median(corners, axis=0).round(6).tolist()))
    except FieldError as error:
        raise input_error(str(path), f"{topic}: {error}") from None
