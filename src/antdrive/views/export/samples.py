"""The topics with many messages: transforms, odometry, commands and numbers to plot for every row of a log, and scans."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from antdrive.sim.log.frames import frame_at
from antdrive.sim.log.rollout import Rollout
from antdrive.views.export.cdr import CdrLayout
from antdrive.views.export.frames import BASE, ESTIMATE, LIDAR, ODOM, ROBOT_MAP, mover_frame
from antdrive.views.export.scans import Scans
from antdrive.views.export.topics import Floats, Stamps, Topic, nanoseconds


def samples(rollout: Rollout, scans: Scans) -> list[Topic]:
    """The topics with a message for each row of a log or for each scan."""
    stamps = nanoseconds(rollout.t)
    frames = [(ODOM, BASE), *((ODOM, mover_frame(i)) for i in range(rollout.movers.shape[1]))]
    still = np.zeros((*rollout.movers.shape[:2], 1))
    placed = [rollout.pose[:, None], np.concatenate([rollout.movers, still], axis=2)]
    if rollout.record.exploring:
        frames.append((ODOM, ROBOT_MAP))
        placed.append(_own_maps(rollout)[:, None])
    poses = np.concatenate(placed, axis=1)
    topics = [
        transforms("/tf", stamps, frames, poses),
        odometry("/odom", BASE, stamps, rollout.pose, rollout.twist),
        twists("/cmd_vel", stamps, rollout.command),
        numbers("/clearance", "std_msgs/msg/Float64", "f8", stamps, rollout.clearance),
        numbers("/limiter", "std_msgs/msg/UInt8", "u1", stamps, rollout.limiter),
    ]
    if len(rollout.estimate):
        topics.append(odometry("/estimate", ESTIMATE, stamps, rollout.estimate, rollout.twist))
    return [*topics, *scan_topics(rollout, scans)]


def scan_topics(rollout: Rollout, scans: Scans) -> list[Topic]:
    """What the robot's lidar saw; empty where there are no scans.

    Ranges are as REP 117 has them: +inf where nothing was in range, -inf where something was too near to measure.
    """
    lidar = rollout.record.robot.lidar
    if lidar is None or not len(scans.rows):
        return []
    first = float(lidar.angles[0]) - lidar.yaw
    values = {
        "angle_min": first,
        "angle_max": first + lidar.spacing * (lidar.beams - 1),
        "angle_increment": lidar.spacing,
        "time_increment": 0.0,
        "scan_time": 1 / lidar.rate,
        "range_min": lidar.min_range,
        "range_max": lidar.max_range,
    }
    return [laser_scans("/scan", nanoseconds(rollout.t[scans.rows]), scans.ranges, values)]


def _own_maps(rollout: Rollout) -> Floats:
    """Where the robot's own map lies in each row, x, y [m] and yaw [rad] (N, 3): so that the robot is where it believes to be."""
    return frame_at(rollout.estimate, rollout.pose) if len(rollout.estimate) else np.zeros((len(rollout.t), 3))


def transforms(topic: str, stamps: Stamps, frames: Sequence[tuple[str, str]], poses: Floats, z: float = 0.0) -> Topic:
    """Messages that place frames within others."""
    layout = CdrLayout()
    layout.length(len(frames))
    values: dict[str, Any] = {}
    for i, (parent, child) in enumerate(frames):
        _header(layout, parent, str(i))
        layout.text(child)
        layout.number(f"pose{i}", "f8", 7)
        values |= _stamp_values(stamps, str(i)) | {f"pose{i}": _pose7(poses[:, i], z)}
    return Topic(topic, "tf2_msgs/msg/TFMessage", stamps, layout.messages(values))


def odometry(topic: str, child: str, stamps: Stamps, pose: Floats, twist: Floats) -> Topic:
    """Poses with speeds; covariances are 0, which ROS reads as unknown."""
    layout = CdrLayout()
    _header(layout, ODOM)
    layout.text(child)
    layout.number("pose", "f8", 7)
    layout.number("pose_covariance", "f8", 36)
    layout.number("twist", "f8", 6)
    layout.number("twist_covariance", "f8", 36)
    values = _stamp_values(stamps) | {"pose": _pose7(pose), "twist": _twist6(twist)}
    return Topic(topic, "nav_msgs/msg/Odometry", stamps, layout.messages(values))


def twists(topic: str, stamps: Stamps, twist: Floats) -> Topic:
    """Speeds."""
    layout = CdrLayout()
    layout.number("twist", "f8", 6)
    return Topic(topic, "geometry_msgs/msg/Twist", stamps, layout.messages({"twist": _twist6(twist)}))


def numbers(topic: str, kind: str, number: str, stamps: Stamps, values: Any) -> Topic:
    """Single numbers."""
    layout = CdrLayout()
    layout.number("data", number)
    return Topic(topic, kind, stamps, layout.messages({"data": values}))


def laser_scans(topic: str, stamps: Stamps, ranges: npt.NDArray[np.floating], values: dict[str, float]) -> Topic:
    """Scans of a planar lidar."""
    layout = CdrLayout()
    _header(layout, LIDAR)
    for name in values:
        layout.number(name, "f4")
    beams = ranges.shape[1]
    layout.length(beams)
    layout.number("ranges", "f4", beams)
    layout.length(0)
    columns: dict[str, Any] = {name: np.full(len(stamps), value) for name, value in values.items()}
    payloads = layout.messages(_stamp_values(stamps) | columns | {"ranges": ranges})
    return Topic(topic, "sensor_msgs/msg/LaserScan", stamps, payloads)


def _header(layout: CdrLayout, frame: str, mark: str = "") -> None:
    layout.number(f"sec{mark}", "i4")
    layout.number(f"nanosec{mark}", "u4")
    layout.text(frame)


def _stamp_values(stamps: Stamps, mark: str = "") -> dict[str, Any]:
    return {f"sec{mark}": stamps // 10**9, f"nanosec{mark}": stamps % 10**9}


def _pose7(pose: Floats, z: float = 0.0) -> Floats:
    """Position and quaternion (N, 7) of poses in the plane (N, 3)."""
    found = np.zeros((len(pose), 7))
    found[:, :2], found[:, 2] = pose[:, :2], z
    found[:, 5], found[:, 6] = np.sin(pose[:, 2] / 2), np.cos(pose[:, 2] / 2)
    return found


def _twist6(twist: Floats) -> Floats:
    found = np.zeros((len(twist), 6))
    found[:, 0], found[:, 5] = twist[:, 0], twist[:, 1]
    return found
