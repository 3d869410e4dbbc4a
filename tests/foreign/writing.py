"""Bags and tables as other programs write them."""

import functools
import math
from pathlib import Path
from typing import NamedTuple

import numpy as np
from rosbags import rosbag1, rosbag2
from rosbags.typesys import Stores, get_typestore

START = 1_700_000_000.0  # the first stamp [s]
TREE = "tf2_msgs/msg/TFMessage"
STORAGES = ("sqlite3", "mcap", "ros1")


class Sent(NamedTuple):
    """A message before it is serialised: `fields` are nested dictionaries and lists."""

    topic: str
    kind: str
    received: int  # [ns]
    fields: dict


def stamp(t):
    ns = round(t * 1e9)
    return {"sec": ns // 10**9, "nanosec": ns % 10**9}


def ns(t):
    return round(t * 1e9)


def header(t, frame):
    return {"seq": 0, "stamp": stamp(t), "frame_id": frame}


def xyz(x=0.0, y=0.0, z=0.0):
    return {"x": float(x), "y": float(y), "z": float(z)}


def turned(yaw=0.0, pitch=0.0, roll=0.0):
    cy, sy, cp, sp, cr, sr = (f(a / 2) for a in (yaw, pitch, roll) for f in (math.cos, math.sin))
    quaternion = (
        sr * cp * cy - cr * sp * sy,
        cr * sp * cy + sr * cp * sy,
        cr * cp * sy - sr * sp * cy,
        cr * cp * cy + sr * sp * sy,
    )
    return dict(zip("xyzw", quaternion, strict=True))


def transforms(t, parent, child, poses, *, received=None, topic="/tf", z=0.0):
    """Messages with a transform each: poses (N, 3) of a frame in its parent at times (N,) [s]."""
    for at, seen, (x, y, yaw) in zip(t, t if received is None else received, np.asarray(poses).tolist(), strict=True):
        step = {"translation": xyz(x, y, z), "rotation": turned(yaw)}
        one = {"header": header(at, parent), "child_frame_id": child, "transform": step}
        yield Sent(topic, TREE, ns(seen), {"transforms": [one]})


def odometry(t, poses, *, topic="/odom", frame="odom", received=None, variance=0.0):
    covariance = np.diag([variance] * 6).ravel()
    for at, seen, (x, y, yaw) in zip(t, t if received is None else received, np.asarray(poses).tolist(), strict=True):
        pose = {"pose": {"position": xyz(x, y), "orientation": turned(yaw)}, "covariance": covariance}
        twist = {"twist": {"linear": xyz(), "angular": xyz()}, "covariance": 0 * covariance}
        fields = {"header": header(at, frame), "child_frame_id": "base_link", "pose": pose, "twist": twist}
        yield Sent(topic, "nav_msgs/msg/Odometry", ns(seen), fields)


def stamped(t, poses, *, topic="/pose", frame="map"):
    for at, (x, y, yaw) in zip(t, np.asarray(poses).tolist(), strict=True):
        pose = {"position": xyz(x, y), "orientation": turned(yaw)}
        yield Sent(topic, "geometry_msgs/msg/PoseStamped", ns(at), {"header": header(at, frame), "pose": pose})


def grid(t, cells, resolution=0.05, origin=(0.0, 0.0, 0.0), topic="/map"):
    """A map: cells (R, C) of -1 and 0 to 100, the lowest row first."""
    x, y, yaw = origin
    info = {"map_load_time": stamp(0), "resolution": resolution, "width": cells.shape[1], "height": cells.shape[0]}
    info["origin"] = {"position": xyz(x, y), "orientation": turned(yaw)}
    fields = {"header": header(t, "map"), "info": info, "data": cells.astype(np.int8).ravel()}
    return Sent(topic, "nav_msgs/msg/OccupancyGrid", ns(t), fields)


def polygon(t, points, frame="odom", topic="/local_costmap/published_footprint"):
    fields = {"header": header(t, frame), "polygon": {"points": [xyz(*p) for p in np.asarray(points).tolist()]}}
    return Sent(topic, "geometry_msgs/msg/PolygonStamped", ns(t), fields)


def scans(t, topic="/scan", beams=720, frame="lidar"):
    ranges = np.linspace(0.1, 12.0, beams, dtype=np.float32)
    for at in t:
        limits = {
            "angle_min": -3.14,
            "angle_max": 3.14,
            "angle_increment": 0.01,
            "time_increment": 0.0,
            "scan_time": 0.1,
        }
        fields = {
            "header": header(at, frame),
            **limits,
            "range_min": 0.1,
            "range_max": 12.0,
            "ranges": ranges,
            "intensities": ranges,
        }
        yield Sent(topic, "sensor_msgs/msg/LaserScan", ns(at), fields)


def write(path, sent, storage="mcap", compressed=False):
    """Write messages to a rosbag2 folder or a ROS 1 file, by their receipt; return its path."""
    path = Path(path)
    store = get_typestore(Stores.ROS1_NOETIC if storage == "ros1" else Stores.ROS2_JAZZY)
    store.register({TREE: get_typestore(Stores.ROS2_JAZZY).fielddefs[TREE]})
    if storage == "ros1":
        writer, encode = rosbag1.Writer(path.with_suffix(".bag")), store.serialize_ros1
        if compressed:
            writer.set_compression(rosbag1.Writer.CompressionFormat.LZ4)
    else:
        writer = rosbag2.Writer(path, version=9, storage_plugin=rosbag2.StoragePlugin[storage.upper()])
        encode = store.serialize_cdr
        if compressed:
            name = "MESSAGE" if compressed == "message" else "STORAGE" if storage == "mcap" else "FILE"
            mode = rosbag2.CompressionMode[name]
            writer.set_compression(mode, rosbag2.CompressionFormat.ZSTD)
    with writer:
        connections = {}
        for topic, kind, received, fields in sorted(sent, key=lambda one: one.received):
            if topic not in connections:
                connections[topic] = writer.add_connection(topic, kind, typestore=store)
            writer.write(connections[topic], received, encode(_message(store, kind, fields), kind))
    return writer.path


def _message(store, kind, fields):
    """Return a message of a store's types; fields that they do not have are left out."""
    values = []
    for name, (node, about) in _fields(store, kind):
        value = fields[name]
        if node == "name":
            value = _message(store, about, value)
        elif node == "names":
            value = [_message(store, about, one) for one in value]
        values.append(value)
    return store.types[kind](*values)


@functools.cache
def _fields(store, kind):
    found = []
    for name, (node, about) in store.fielddefs[kind][1]:
        if node.name == "NAME":
            found.append((name, ("name", about)))
        elif node.name in ("ARRAY", "SEQUENCE") and about[0][0].name == "NAME":
            found.append((name, ("names", about[0][1])))
        else:
            found.append((name, ("plain", about)))
    return found


def inverse(pose):
    x, y, yaw = np.asarray(pose, dtype=float).T
    cos, sin = np.cos(yaw), np.sin(yaw)
    return np.column_stack([-x * cos - y * sin, x * sin - y * cos, -yaw])


def joined(a, b):
    """Poses (N, 3) of frames b in a's parent, where b is given in a."""
    (ax, ay, at), (bx, by, bt) = np.asarray(a, dtype=float).T, np.asarray(b, dtype=float).T
    return np.column_stack([ax + bx * np.cos(at) - by * np.sin(at), ay + bx * np.sin(at) + by * np.cos(at), at + bt])


def write_bag(
    path, t, pose, *, storage="mcap", stamps=None, received=None, corrected=(), late=False, cells=None, resolution=0.05,
    origin=(0.0, 0.0, 0.0), scan_rate=0.0, footprint=None, compressed=False,
):  # fmt: skip
    """Write a drive as Nav2's bags have it and return the bag's path.

    Args:
        path: the folder, or for storage ros1 the file, of the bag
        t: true times of the rows (T,) [s], from 0
        pose: poses of base_footprint in the map (T, 3)
        storage: sqlite3, mcap or ros1
        stamps: stamps of the rows [s], if a clock has faults; by default `t`
        received: times of receipt of the rows [s]; by default 5 ms after `t`
        corrected: pairs of a time [s] and the pose of odom in the map from then on; published at 20 Hz
        late: whether the static transforms come at the end
        cells: a map (R, C) of -1 and 0 to 100
        resolution: its cells' side [m]
        origin: its lower left corner's pose
        scan_rate: scans per second of two lidars [Hz]
        footprint: corners (K, 2), published in odom at 5 Hz
        compressed: whether the storage compresses; message: whether each message is
    """
    t, pose = np.asarray(t, dtype=float), np.asarray(pose, dtype=float)
    stamps = t if stamps is None else np.asarray(stamps)
    received = t + 0.005 if received is None else np.asarray(received)
    steps = [(-math.inf, (0.0, 0.0, 0.0)), *corrected]

    def odom(at):
        k = np.searchsorted([when for when, _ in steps], at, side="right") - 1
        return np.array([steps[i][1] for i in k], dtype=float)

    slow = np.arange(math.floor(20 * t[0]) - 1, math.ceil(20 * t[-1]) + 2) / 20
    clock = np.interp(slow, t, stamps - t) + slow  # stamps of the same clock
    base = joined(inverse(odom(t)), pose)
    end = START + (t[-1] if late else t[0])
    sent = [
        *transforms(START + clock, "map", "odom", odom(slow), received=START + slow + 0.005),
        *transforms(START + stamps, "odom", "base_footprint", base, received=START + received),
    ]
    for child, place in (("base_link", (0, 0, 0)), ("front_lidar", (0.2, 0, 0)), ("rear_lidar", (-0.2, 0, math.pi))):
        parent = "base_footprint" if child == "base_link" else "base_link"
        sent += transforms([end], parent, child, [place], topic="/tf_static", z=0.1)
    if cells is not None:
        sent.append(grid(START + t[0], cells, resolution, origin))
    for name in ("front", "rear") if scan_rate else ():
        sent += scans(START + np.arange(t[0], t[-1], 1 / scan_rate), f"/{name}/scan", frame=f"{name}_lidar")
    for k in range(0, len(t), max(1, len(t) // max(1, round(5 * (t[-1] - t[0]))))) if footprint is not None else ():
        corners = joined(np.tile(base[k], (len(footprint), 1)), np.column_stack([footprint, np.zeros(len(footprint))]))
        sent.append(polygon(START + stamps[k], corners[:, :2]))
    return write(path, sent, storage, compressed)
