"""Poses in ROS bags: of transforms between frames, and of topics."""

from __future__ import annotations

import math
from array import array
from collections import defaultdict
from collections.abc import Callable, Mapping, Sequence
from itertools import pairwise
from operator import attrgetter
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np

from antdrive.base.bags import Bag, readable
from antdrive.base.errors import few, input_error
from antdrive.foreign.frames import ROBOTS, Edge, Link, Recording, chains_to

TREES = ("tf2_msgs/msg/TFMessage", "tf/msg/tfMessage")
_SURE = attrgetter("pose.pose.position", "pose.pose.orientation", "pose.covariance")
#: Place, turn and, if stated, covariance of a message of each type of poses.
POSES: Mapping[str, Callable[[Any], Sequence[Any]]] = MappingProxyType(
    {
        "geometry_msgs/msg/PoseStamped": attrgetter("pose.position", "pose.orientation"),
        "geometry_msgs/msg/TransformStamped": attrgetter("transform.translation", "transform.rotation"),
        "geometry_msgs/msg/PoseWithCovarianceStamped": _SURE,
        "nav_msgs/msg/Odometry": _SURE,
    }
)


def read_bag(path: Path, pose: str | None, map_frame: str | None, robot_frame: str | None) -> Recording:
    """Return what a bag says of a robot's poses: on a topic, else by its transforms, else on its only topic of poses."""
    with Bag(path) as bag, readable(path):
        trees, topics = ([name for name in sorted(bag.topics) if bag.topics[name] in kinds] for kinds in (TREES, POSES))
        if pose and pose not in trees + topics:
            raise input_error(str(path), f"no poses on {pose}; --pose takes {few(trees + topics, 12) or 'none'}")
        spaces = {name.rpartition("/")[0] for name in trees}
        space = next((own for own in ((pose or "").rpartition("/")[0], "", *sorted(spaces)) if own in spaces), "")
        if space and not pose and len(spaces) > 1:
            raise input_error(str(path), f"several trees of frames; name one: --pose {few(trees, 12)}")
        used = [name for name in trees if name.rpartition("/")[0] == space]
        topic = pose if pose in topics else None
        edges, spread = _transforms(bag, used, topic)
    frames = sorted({frame for link in edges for frame in link})
    for key, frame in (("--map-frame", map_frame), ("--robot-frame", robot_frame)):
        if frame and frame not in frames:
            raise input_error(str(path), f"no frame {frame}; {key} takes {few(frames, 20)}")
    last = topic or robot_frame or _usual_robot(path, frames)
    chains, children = chains_to(last, edges), {child for _, child in edges}
    maps = [frame for frame in chains if frame.rpartition("/")[2] == "map"]
    first = map_frame or min(maps, default=next((frame for frame in chains if frame not in children), last))
    chain = chains.get(first, [])
    links = [(link, link not in edges) for link in pairwise(chain)]
    route = [(" > ".join(link), edges[link[::-1] if up else link], up) for link, up in links]
    if not any(len(edge.stamps) for _, edge, _ in route):
        if len(topics) == 1 and not (pose or map_frame or robot_frame):
            return read_bag(path, topics[0], None, None)
        choices = f"name its poses: --pose {few(topics, 12)}" if topics else "and it has no topic of poses"
        missing = f"no moving transforms lead from {first or 'a map'} to {last or 'a robot'}"
        raise input_error(str(path), f"{missing}; {choices}")
    notes = [] if first.rpartition("/")[2] == "map" else [f"the poses are in {first}, not in map"]
    if spread:
        notes.append(f"{topic} states standard deviations of x and y up to {spread:.3f} m")
    source = {"poses": f"{'' if topic else 'tf: '}{' > '.join(chain)}", "map_frame": first, "robot_frame": last}
    return Recording(route, source, notes)


def _transforms(bag: Bag, trees: Sequence[str], topic: str | None) -> tuple[dict[Link, Edge], float]:
    """Return all transforms, a topic of poses as a frame of its name, and the largest standard deviation it states [m]."""
    rows: dict[Link, tuple[array[int], array[int], array[float]]] = {}
    rows = defaultdict(lambda: (array("q"), array("q"), array("d")))
    variance, static = 0.0, set()
    for name, received, message in bag.messages(*trees, *([topic] if topic else [])):
        kind = bag.topics[name] if name == topic else "geometry_msgs/msg/TransformStamped"
        for one in [message] if name == topic else message.transforms:
            p, q, *covariances = POSES[kind](one)
            link = (one.header.frame_id.strip("/") or "map", name if name == topic else one.child_frame_id.strip("/"))
            stamps, receipts, values = rows[link]
            stamps.append(one.header.stamp.sec * 10**9 + one.header.stamp.nanosec)
            receipts.append(received)
            values.extend((p.x, p.y, p.z, q.x, q.y, q.z, q.w))
            variance = max([variance, *(each for some in covariances for each in some[:8:7])])  # of x and y
            if name.endswith("static"):
                static.add(link)
    edges = {
        link: Edge(
            np.array([] if link in static else one, dtype=np.int64), np.array(two), np.array(values).reshape(-1, 7)
        )
        for link, (one, two, values) in rows.items()
    }
    return edges, math.sqrt(variance)


def _usual_robot(path: Path, frames: Sequence[str]) -> str:
    """Return the frame with the first of a robot's usual names, after any namespace; empty if there is none."""
    same = [[frame for frame in frames if frame.rpartition("/")[2] == name] for name in ROBOTS]
    found = next(filter(None, same), [""])
    if len(found) > 1:
        raise input_error(str(path), f"several frames of robots; --robot-frame takes {few(found, 12)}")
    return found[0]
