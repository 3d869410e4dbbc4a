"""Messages serialised by columns equal those of rosbags' serialiser, byte for byte."""

from __future__ import annotations

import math
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from antdrive.robots.lidar import Lidar
from antdrive.views.export import samples
from antdrive.views.export.samples import DriveScans
from antdrive.views.export.topics import message_types

BODY = SimpleNamespace(scan="base_scan", scanner=np.eye(4))
STAMPS = np.array([0, 1, 999_999_999, 12_345_678_901], dtype=np.int64)


def of(kind, **values):
    return message_types().types[kind](**values)


def header(stamp, frame):
    time = of("builtin_interfaces/msg/Time", sec=stamp // 10**9, nanosec=stamp % 10**9)
    return of("std_msgs/msg/Header", stamp=time, frame_id=frame)


def vector(x, y, z):
    return of("geometry_msgs/msg/Vector3", x=x, y=y, z=z)


def turn(yaw):
    return of("geometry_msgs/msg/Quaternion", x=0.0, y=0.0, z=np.sin(yaw / 2), w=np.cos(yaw / 2))


def assert_equal(topic, expected):
    assert [bytes(p) for p in topic.payloads] == [bytes(message_types().serialize_cdr(m, topic.kind)) for m in expected]


@settings(max_examples=30, deadline=None)
@given(names=st.lists(st.tuples(st.text("abcé_0", max_size=9), st.text("xyz", max_size=9)), min_size=1, max_size=4))
def test_transforms(names):
    poses = np.random.default_rng(3).normal(size=(len(STAMPS), len(names), 3))

    def transform(stamp, parent, child, x, y, yaw):
        lies = of("geometry_msgs/msg/Transform", translation=vector(x, y, 0.0), rotation=turn(yaw))
        kind = "geometry_msgs/msg/TransformStamped"
        return of(kind, header=header(stamp, parent), child_frame_id=child, transform=lies)

    expected = [
        of(
            "tf2_msgs/msg/TFMessage",
            transforms=[transform(stamp, *pair, *pose) for pair, pose in zip(names, row, strict=True)],
        )
        for stamp, row in zip(STAMPS.tolist(), poses.tolist(), strict=True)
    ]
    laid = np.stack([samples._pose7(poses[:, i]) for i in range(len(names))], axis=1)
    assert_equal(samples.transforms("/tf", STAMPS, names, laid), expected)


def test_odometry_and_twists():
    rng = np.random.default_rng(4)
    pose, twist = rng.normal(size=(4, 3)), rng.normal(size=(4, 2))
    of_pose, of_twist = rng.normal(size=(4, 3, 3)), rng.normal(size=(4, 2, 2))
    twists = [of("geometry_msgs/msg/Twist", linear=vector(v, 0, 0), angular=vector(0, 0, w)) for v, w in twist.tolist()]
    expected = []
    for i, (stamp, (x, y, yaw), speeds) in enumerate(zip(STAMPS.tolist(), pose.tolist(), twists, strict=True)):
        at = of(
            "geometry_msgs/msg/Pose", position=of("geometry_msgs/msg/Point", x=x, y=y, z=0.0), orientation=turn(yaw)
        )
        squares = np.zeros((2, 6, 6))
        for row, p in enumerate((0, 1, 5)):
            squares[0, p, [0, 1, 5]] = of_pose[i, row]
        squares[1, 0, [0, 5]], squares[1, 5, [0, 5]] = of_twist[i]
        there = of("geometry_msgs/msg/PoseWithCovariance", pose=at, covariance=squares[0].reshape(-1))
        moves = of("geometry_msgs/msg/TwistWithCovariance", twist=speeds, covariance=squares[1].reshape(-1))
        kind, frame = "nav_msgs/msg/Odometry", header(stamp, "odom")
        expected.append(of(kind, header=frame, child_frame_id="base_footprint", pose=there, twist=moves))
    assert_equal(
        samples.odometry("/odom", ("odom", "base_footprint"), STAMPS, pose, twist, of_pose, of_twist), expected
    )
    assert_equal(samples.twists("/cmd_vel", STAMPS, twist), twists)


def log_with_scans(beams, field_of_view):
    """The part of a log that the export of scans reads."""
    lidar = Lidar(beams=beams, field_of_view=field_of_view, rate=50.0, min_range=0.1, max_range=5.0)
    scans = np.random.default_rng(5).integers(0, 5000, size=(2, beams)).astype(np.uint16)
    scans[0, :2] = 0, 1
    record = SimpleNamespace(robot=SimpleNamespace(lidar=lidar))
    return SimpleNamespace(t=np.arange(9) / 240, scans=scans, scan_rows=np.array([0, 5]), record=record)


@pytest.mark.parametrize(("beams", "around", "step"), [(3, math.pi, math.pi / 2), (4, 2 * math.pi, math.pi / 2)])
def test_scans(beams, around, step):
    log = log_with_scans(beams, around)
    (topic,) = samples.scan_topics(log, DriveScans.of(log), BODY)
    ranges = (log.scans * 1e-3).astype(np.float32)
    ranges[0, :2] = np.inf, -np.inf  # REP 117: nothing in range, too near to measure
    expected = [
        of(
            "sensor_msgs/msg/LaserScan", header=header(stamp, "base_scan"), angle_min=-around / 2,
            angle_max=-around / 2 + step * (beams - 1), angle_increment=step, time_increment=0.0, scan_time=0.02,
            range_min=0.1, range_max=5.0, ranges=row, intensities=np.empty(0, dtype=np.float32),
        )
        for stamp, row in zip([0, 20_833_333], ranges, strict=True)
    ]  # fmt: skip
    assert_equal(topic, expected)


def test_a_log_without_scans_has_no_topic_for_them():
    log = log_with_scans(3, math.pi)
    log.scans = np.empty((0, 0), dtype=np.uint16)
    assert samples.scan_topics(log, DriveScans.of(log, again=False), BODY) == []
    log.record.robot.lidar = None
    assert samples.scan_topics(log, DriveScans.of(log), BODY) == []
