"""Messages laid out by columns are those of rosbags' own serialiser, byte for byte."""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from antdrive.robots.lidar import Lidar
from antdrive.views.export import samples
from antdrive.views.export.cdr import CdrLayout
from antdrive.views.export.libraries import message_types
from antdrive.views.export.scans import Scans
from antdrive.views.export.topics import Topic

pytest.importorskip("rosbags", reason="rosbags is not installed")

STAMPS = np.array([0, 1, 999_999_999, 12_345_678_901], dtype=np.int64)


def of(kind: str, **values: Any) -> Any:
    return message_types().types[kind](**values)


def header(stamp: int, frame: str) -> Any:
    time = of("builtin_interfaces/msg/Time", sec=stamp // 10**9, nanosec=stamp % 10**9)
    return of("std_msgs/msg/Header", stamp=time, frame_id=frame)


def vector(x: float, y: float, z: float) -> Any:
    return of("geometry_msgs/msg/Vector3", x=x, y=y, z=z)


def turn(yaw: float) -> Any:
    return of("geometry_msgs/msg/Quaternion", x=0.0, y=0.0, z=np.sin(yaw / 2), w=np.cos(yaw / 2))


def assert_equal(topic: Topic, expected: list[Any]) -> None:
    assert [bytes(p) for p in topic.payloads] == [bytes(message_types().serialize_cdr(m, topic.kind)) for m in expected]


@settings(max_examples=30, deadline=None)
@given(names=st.lists(st.tuples(st.text("abcé_0", max_size=9), st.text("xyz", max_size=9)), min_size=1, max_size=4))
def test_transforms(names: list[tuple[str, str]]) -> None:
    poses = np.random.default_rng(3).normal(size=(len(STAMPS), len(names), 3))
    expected = [
        of(
            "tf2_msgs/msg/TFMessage",
            transforms=[
                of(
                    "geometry_msgs/msg/TransformStamped",
                    header=header(stamp, parent),
                    child_frame_id=child,
                    transform=of("geometry_msgs/msg/Transform", translation=vector(x, y, 0.25), rotation=turn(yaw)),
                )
                for (parent, child), (x, y, yaw) in zip(names, row.tolist(), strict=True)
            ],
        )
        for stamp, row in zip(STAMPS.tolist(), poses, strict=True)
    ]
    assert_equal(samples.transforms("/tf", STAMPS, names, poses, z=0.25), expected)


def test_odometry_and_twists() -> None:
    rng = np.random.default_rng(4)
    pose, twist = rng.normal(size=(4, 3)), rng.normal(size=(4, 2))
    twists = [of("geometry_msgs/msg/Twist", linear=vector(v, 0, 0), angular=vector(0, 0, w)) for v, w in twist.tolist()]
    expected = [
        of(
            "nav_msgs/msg/Odometry",
            header=header(stamp, "odom"),
            child_frame_id="base_link",
            pose=of(
                "geometry_msgs/msg/PoseWithCovariance",
                pose=of(
                    "geometry_msgs/msg/Pose",
                    position=of("geometry_msgs/msg/Point", x=x, y=y, z=0.0),
                    orientation=turn(yaw),
                ),
                covariance=np.zeros(36),
            ),
            twist=of("geometry_msgs/msg/TwistWithCovariance", twist=speeds, covariance=np.zeros(36)),
        )
        for stamp, (x, y, yaw), speeds in zip(STAMPS.tolist(), pose.tolist(), twists, strict=True)
    ]
    assert_equal(samples.odometry("/odom", "base_link", STAMPS, pose, twist), expected)
    assert_equal(samples.twists("/cmd_vel", STAMPS, twist), twists)


def test_numbers() -> None:
    values = np.array([0.5, -1.0, math.inf, 3.0])
    expected = [of("std_msgs/msg/Float64", data=value) for value in values.tolist()]
    assert_equal(samples.numbers("/clearance", "std_msgs/msg/Float64", "f8", STAMPS, values), expected)
    small = [of("std_msgs/msg/UInt8", data=value) for value in (0, 7, 255, 1)]
    assert_equal(samples.numbers("/limiter", "std_msgs/msg/UInt8", "u1", STAMPS, np.array([0, 7, 255, 1])), small)


def log_with_scans(beams: int, field_of_view: float) -> Any:
    """As much of a log with scans as the export of scans reads."""
    lidar = Lidar(beams=beams, field_of_view=field_of_view, rate=50.0, min_range=0.1, max_range=5.0)
    scans = np.random.default_rng(5).integers(0, 5000, size=(2, beams)).astype(np.uint16)
    scans[0, :2] = 0, 1
    record = SimpleNamespace(robot=SimpleNamespace(lidar=lidar))
    return SimpleNamespace(t=np.arange(9) / 240, scans=scans, scan_rows=np.array([0, 5]), record=record)


@pytest.mark.parametrize(("beams", "around", "step"), [(3, math.pi, math.pi / 2), (4, 2 * math.pi, math.pi / 2)])
def test_scans(beams: int, around: float, step: float) -> None:
    log = log_with_scans(beams, around)
    (topic,) = samples.scan_topics(log, Scans.of(log))
    ranges = (log.scans * 1e-3).astype(np.float32)
    ranges[0, :2] = np.inf, -np.inf  # REP 117: nothing in range, too near to measure
    expected = [
        of(
            "sensor_msgs/msg/LaserScan",
            header=header(stamp, "base_scan"),
            angle_min=-around / 2,
            angle_max=-around / 2 + step * (beams - 1),
            angle_increment=step,
            time_increment=0.0,
            scan_time=0.02,
            range_min=0.1,
            range_max=5.0,
            ranges=row,
            intensities=np.empty(0, dtype=np.float32),
        )
        for stamp, row in zip([0, 20_833_333], ranges, strict=True)
    ]
    assert_equal(topic, expected)


def test_a_log_without_scans_has_no_topic_for_them() -> None:
    log = log_with_scans(3, math.pi)
    log.scans = np.empty((0, 0), dtype=np.uint16)
    assert samples.scan_topics(log, Scans.of(log, again=False)) == []
    log.record.robot.lidar = None
    assert samples.scan_topics(log, Scans.of(log)) == []


def test_a_number_out_of_place_would_be_seen() -> None:
    layout = CdrLayout()
    layout.number("data", "f4")
    layout.number("more", "f8")
    wrong = Topic("/clearance", "std_msgs/msg/Float64", STAMPS[:1], layout.messages({"data": np.ones(1)}))
    with pytest.raises(AssertionError):
        assert_equal(wrong, [of("std_msgs/msg/Float64", data=1.0)])
