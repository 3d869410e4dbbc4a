"""Topics with a message per row or scan: transforms, odometry, commands, numbers and scans."""

from __future__ import annotations

import math
import struct
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from antdrive.base.plane import relative_frame, world_to_map
from antdrive.base.types import Floats, Ints
from antdrive.sim.driving.odometry import LoggedOdometry, odometry_of
from antdrive.sim.log.rollout import Rollout, estimates_of, ranges_of
from antdrive.views.export.robot_frames import RobotFrames
from antdrive.views.export.topics import MAP, ODOM, TRUTH, Topic, mover_frame, nanoseconds

HEADER = b"\x00\x01\x00\x00"  # CDR, little endian


class CdrLayout:
    """Layout of messages with equal texts and lengths, serialised together.

    CDR (OMG DDS-XTypes, encoding version 1, little endian) aligns each number to its own size, counted from the end of a
    four-byte header. Every number has the same offset in all messages, so numpy fills one column at a time.

    The methods add the message's values in order.
    """

    def __init__(self) -> None:
        self._constant = bytearray(HEADER)
        self._numbers: dict[str, tuple[int, np.dtype[np.generic], tuple[int, ...]]] = {}

    def number(self, name: str, kind: str, count: int | None = None) -> None:
        """Add a number or `count` consecutive numbers, whose values `messages` sets; the default is 0."""
        dtype = np.dtype(f"<{kind}")
        self._align(dtype.itemsize if count != 0 else 1)
        self._numbers[name] = (len(self._constant), dtype, () if count is None else (count,))
        self._constant += bytes(dtype.itemsize * (1 if count is None else count))

    def length(self, count: int) -> None:
        """Add the length of the sequence that follows."""
        self._align(4)
        self._constant += struct.pack("<I", count)

    def text(self, value: str) -> None:
        """Add a text common to all messages."""
        content = value.encode() + b"\0"
        self.length(len(content))
        self._constant += content

    def messages(self, values: dict[str, npt.NDArray[np.generic]]) -> list[memoryview]:
        """Return the serialised messages."""
        many = len(next(iter(values.values())))
        size = len(self._constant)
        buffer = np.tile(np.frombuffer(bytes(self._constant), dtype=np.uint8), (many, 1))
        for name, column in values.items():
            offset, dtype, shape = self._numbers[name]
            strides = (size, *([dtype.itemsize] * len(shape)))
            place = np.ndarray((many, *shape), dtype, buffer=buffer.data, offset=offset, strides=strides)
            place[...] = column
        content = memoryview(buffer.tobytes())
        return [content[start : start + size] for start in range(0, many * size, size)]

    def _align(self, size: int) -> None:
        self._constant += bytes(-(len(self._constant) - len(HEADER)) % size)


def samples(rollout: Rollout, scans: DriveScans, body: RobotFrames) -> list[Topic]:
    """Return the topics with a message per row of a log or per scan."""
    stamps, frame, measured = nanoseconds(rollout.t), rollout.record.task.frame, odometry_of(rollout)
    truth, believed = world_to_map(frame, rollout.pose), world_to_map(frame, estimates_of(rollout))
    odom, true = body.frame(ODOM), body.frame(TRUTH)
    frames = [(odom, body.base), (MAP, odom), (MAP, true)]
    frames += [(MAP, body.frame(mover_frame(i))) for i in range(rollout.movers.shape[1])]
    still = np.zeros((*rollout.movers.shape[:2], 1))
    movers = world_to_map(frame, np.concatenate([rollout.movers, still], axis=2))
    robot = np.stack([measured.pose, relative_frame(measured.pose, believed), truth], axis=1)
    moving = np.concatenate([robot, movers], axis=1)
    none = np.zeros((len(stamps), 3, 3))
    topics = [
        transforms("/tf", stamps, frames, _pose7(moving.reshape(-1, 3)).reshape(*moving.shape[:2], 7)),
        odometry(
            "/odom",
            (odom, body.base),
            stamps,
            measured.pose,
            measured.twist,
            measured.pose_covariance,
            measured.twist_covariance,
        ),
        odometry("/ground_truth/odom", (MAP, true), stamps, truth, rollout.twist, none, none[:, :2, :2]),
        joint_states("/joint_states", stamps, rollout, measured, body),
        twists("/cmd_vel", stamps, rollout.command),
        numbers("/clearance", "std_msgs/msg/Float64", "f8", stamps, rollout.clearance),
        numbers("/limiter", "std_msgs/msg/UInt8", "u1", stamps, rollout.limiter),
    ]
    if len(rollout.estimate):
        turn = _turn2(frame[2])
        covariance = turn @ measured.estimate_covariance @ turn.T
        topics.append(
            odometry(
                "/estimate", (MAP, body.base), stamps, believed, measured.twist, covariance, measured.twist_covariance
            )
        )
    return [*topics, *scan_topics(rollout, scans, body)]


def scan_topics(rollout: Rollout, scans: DriveScans, body: RobotFrames) -> list[Topic]:
    """Return the topic of the lidar's scans; empty without scans.

    Ranges follow REP 117: +inf for nothing in range, -inf for objects too near to measure.
    """
    lidar = rollout.record.robot.lidar
    if lidar is None or not len(scans.rows):
        return []
    heading, upright = math.atan2(body.scanner[1, 0], body.scanner[0, 0]), body.scanner[2, 2] > 0
    angles = (lidar.angles - heading) if upright else (heading - lidar.angles)[::-1]
    middle = float(angles[0] + angles[-1]) / 2
    first = float(angles[0]) - 2 * math.pi * round(middle / (2 * math.pi))
    numbers = {
        "angle_min": first,
        "angle_max": first + lidar.spacing * (lidar.beams - 1),
        "angle_increment": lidar.spacing,
        "time_increment": 0.0,
        "scan_time": 1 / lidar.rate,
        "range_min": lidar.min_range,
        "range_max": lidar.max_range,
    }
    layout, stamps = CdrLayout(), nanoseconds(rollout.t[scans.rows])
    _header(layout, body.scan)
    for name in numbers:
        layout.number(name, "f4")
    layout.length(lidar.beams)
    layout.number("ranges", "f4", lidar.beams)
    layout.length(0)
    values: dict[str, Any] = {name: np.full(len(stamps), number) for name, number in numbers.items()}
    values["ranges"] = scans.ranges if upright else scans.ranges[:, ::-1]
    return [Topic("/scan", "sensor_msgs/msg/LaserScan", stamps, layout.messages(_stamp_values(stamps) | values))]


def joint_states(topic: str, stamps: Ints, rollout: Rollout, measured: LoggedOdometry, body: RobotFrames) -> Topic:
    """Return angles [rad] and speeds [rad/s] of the wheels as their encoders measured them."""
    layout = CdrLayout()
    _header(layout, "")
    layout.length(2)
    for joint in body.joints:
        layout.text(joint)
    for name in ("position", "velocity"):
        layout.length(2)
        layout.number(name, "f8", 2)
    layout.length(0)
    speeds = measured.wheels / rollout.record.robot.wheel_radius * body.signs
    steps = np.diff(rollout.t, prepend=rollout.t[:1])[:, None]
    values = {"position": np.cumsum(speeds * steps, axis=0), "velocity": speeds}
    return Topic(topic, "sensor_msgs/msg/JointState", stamps, layout.messages(_stamp_values(stamps) | values))


def transforms(topic: str, stamps: Ints, frames: Sequence[tuple[str, str]], poses: Floats) -> Topic:
    """Return messages of transforms (N, F, 7) between frames: positions [m] and quaternions."""
    layout = CdrLayout()
    layout.length(len(frames))
    values: dict[str, Any] = {}
    for i, (parent, child) in enumerate(frames):
        _header(layout, parent, str(i))
        layout.text(child)
        layout.number(f"pose{i}", "f8", 7)
        values |= _stamp_values(stamps, str(i)) | {f"pose{i}": poses[:, i]}
    return Topic(topic, "tf2_msgs/msg/TFMessage", stamps, layout.messages(values))


def odometry(
    topic: str,
    frames: tuple[str, str],
    stamps: Ints,
    pose: Floats,
    twist: Floats,
    pose_covariance: Floats,
    twist_covariance: Floats,
) -> Topic:
    """Return odometry messages with covariances of x, y and yaw (N, 3, 3), of speed and yaw rate (N, 2, 2)."""
    layout = CdrLayout()
    _header(layout, frames[0])
    layout.text(frames[1])
    layout.number("pose", "f8", 7)
    layout.number("pose_covariance", "f8", 36)
    layout.number("twist", "f8", 6)
    layout.number("twist_covariance", "f8", 36)
    values = _stamp_values(stamps) | {"pose": _pose7(pose), "twist": _twist6(twist)}
    values |= {"pose_covariance": _square6(pose_covariance, (0, 1, 5))}
    values |= {"twist_covariance": _square6(twist_covariance, (0, 5))}
    return Topic(topic, "nav_msgs/msg/Odometry", stamps, layout.messages(values))


def twists(topic: str, stamps: Ints, twist: Floats) -> Topic:
    """Return messages of commanded velocities."""
    layout = CdrLayout()
    layout.number("twist", "f8", 6)
    return Topic(topic, "geometry_msgs/msg/Twist", stamps, layout.messages({"twist": _twist6(twist)}))


def numbers(topic: str, kind: str, number: str, stamps: Ints, values: Any) -> Topic:
    """Return messages of single numbers."""
    layout = CdrLayout()
    layout.number("data", number)
    return Topic(topic, kind, stamps, layout.messages({"data": values}))


def _header(layout: CdrLayout, frame: str, mark: str = "") -> None:
    layout.number(f"sec{mark}", "i4")
    layout.number(f"nanosec{mark}", "u4")
    layout.text(frame)


def _stamp_values(stamps: Ints, mark: str = "") -> dict[str, Any]:
    return {f"sec{mark}": stamps // 10**9, f"nanosec{mark}": stamps % 10**9}


def _pose7(pose: Floats) -> Floats:
    """Convert poses in the plane (N, 3) to position and quaternion (N, 7)."""
    poses = np.zeros((len(pose), 7))
    poses[:, :2] = pose[:, :2]
    poses[:, 5], poses[:, 6] = np.sin(pose[:, 2] / 2), np.cos(pose[:, 2] / 2)
    return poses


def _twist6(twist: Floats) -> Floats:
    twists = np.zeros((len(twist), 6))
    twists[:, 0], twists[:, 5] = twist[:, 0], twist[:, 1]
    return twists


def _square6(covariance: Floats, places: tuple[int, ...]) -> Floats:
    """Return covariances of x, y, z and rotations about them (N, 36) from those of some of the six."""
    squares = np.zeros((len(covariance), 6, 6))
    squares[np.ix_(range(len(covariance)), places, places)] = covariance
    return squares.reshape(-1, 36)


def _turn2(yaw: float) -> Floats:
    """Return the matrix (3, 3) that turns x and y by a yaw [rad]."""
    cos, sin = np.cos(yaw), np.sin(yaw)
    return np.array([[cos, -sin, 0.0], [sin, cos, 0.0], [0.0, 0.0, 1.0]])


LOGGED = "taken by the drive"
SIMULATED = "simulated at export, without noise, from the logged poses; the log holds no scans"
OMITTED = "omitted"
NONE = "none; the robot has no lidar"


class DriveScans(NamedTuple):
    """Scans of a drive."""

    source: str  # origin, in words
    rows: Ints  # rows of the log (S,)
    # measured ranges (S, beams) [m]; +inf for nothing in range, -inf for objects too near
    ranges: npt.NDArray[np.floating]

    @classmethod
    def of(cls, rollout: Rollout, *, again: bool = True) -> DriveScans:
        """Return the scans of a drive: logged, simulated if `again`, or none."""
        if len(rollout.scans):
            return cls(LOGGED, rollout.scan_rows.astype(np.int64), ranges_of(rollout.scans))
        if rollout.record.robot.lidar is not None and again:
            return cls(SIMULATED, *_simulated(rollout))
        source = NONE if rollout.record.robot.lidar is None else OMITTED
        return cls(source, np.empty(0, dtype=np.int64), np.empty((0, 0)))


def _simulated(rollout: Rollout) -> tuple[Ints, npt.NDArray[np.float32]]:
    """Return the rows of scans (S,) and noise-free ranges from the logged poses (S, beams) [m]."""
    from antdrive.sim.sensing import Scanner

    record, lidar = rollout.record, rollout.record.robot.lidar
    assert lidar is not None
    per_tick = max(1, record.physics_hz // record.control_hz)
    ticks = range(-(-len(rollout.t) // per_tick))
    rows = np.array([tick * per_tick for tick in ticks if lidar.due(tick, record.control_hz)], dtype=np.int64)
    scanner, radii = Scanner.of(lidar, record.world), np.array([mover.radius for mover in record.world.movers])
    poses = rollout.pose[rows].tolist()
    scans = [scanner.scan((x, y, yaw), rollout.movers[k], radii) for k, (x, y, yaw) in zip(rows, poses, strict=True)]
    return rows, np.array(scans, dtype=np.float32).reshape(len(rows), lidar.beams)
