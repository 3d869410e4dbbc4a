"""Exported bags, read back by two independent libraries."""

from __future__ import annotations

import hashlib
import json
import math
import re
import xml.etree.ElementTree as ElementTree
from dataclasses import replace
from typing import Any, NamedTuple

import mcap.reader as mcap_reader
import mcap_ros2.decoder as mcap_ros2
import numpy as np
import pytest
import yaml
from rosbags import rosbag2

from antdrive.robots import load_robot
from antdrive.sim.log.record import ReplanRecord
from antdrive.sim.sensing import Scanner
from antdrive.views.export.exporting import LAYOUT, export
from antdrive.views.export.robot_frames import frames_of_spec
from antdrive.views.export.samples import OMITTED, SIMULATED
from antdrive.views.export.topics import message_types
from antdrive.worlds.files.world_file import load_task
from antdrive.worlds.grid import rasterise
from antdrive.worlds.world import Disc

FRAME = (10.0, -4.0, 0.3)


class Said(NamedTuple):
    """Message from a reader."""

    topic: str
    at: int
    message: Any


@pytest.fixture(scope="module")
def log(made_up_drive):
    """A drive of 1 s with movers, noise, a replan, an unseen cylinder and a contact, in a world rotated in its map."""
    plain = made_up_drive(obstacles=6, collide=True, movers=2)
    hidden = Disc(3.5, 0.4, 0.1)
    task = replace(plain.record.task, frame=FRAME)
    replan = ReplanRecord(
        t=0.25, trigger="obstructed", solved=True, cost_m=1.0, work=3, route=((1.0, 1.5), (2.0, 1.5), (2.0, 2.0))
    )
    record = replace(plain.record, task=task, unseen=(hidden,), replans=(replan,), reason="a cylinder")
    contacts = plain.contacts + [0, 0, 0, 0]
    noise = np.random.default_rng(1).normal(scale=0.01, size=plain.pose.shape)
    return replace(plain, record=record, contacts=contacts, estimate=plain.pose + noise)


@pytest.fixture(scope="module")
def folder(log, tmp_path_factory):
    place = tmp_path_factory.mktemp("bags")
    log.save(place / "rollout.npz")
    export(place / "rollout.npz", "mcap", place / "drive.mcap")
    export(place / "rollout.npz", "rosbag2", place / "bag")
    return place


def by_rosbags(path):
    with rosbag2.Reader(path) as reader:
        for connection, at, raw in reader.messages():
            yield Said(connection.topic, at, message_types().deserialize_cdr(raw, connection.msgtype))


def by_mcap(path):
    with path.open("rb") as file:
        reader = mcap_reader.make_reader(file, decoder_factories=[mcap_ros2.DecoderFactory()])
        for _, channel, raw, message in reader.iter_decoded_messages():
            yield Said(channel.topic, raw.log_time, message)


@pytest.fixture(scope="module", params=["rosbags of the folder", "rosbags of the file", "mcap"])
def said(request, folder):
    readers = {
        "rosbags of the folder": lambda: by_rosbags(folder / "bag"),
        "rosbags of the file": lambda: by_rosbags(folder / "drive.mcap"),
        "mcap": lambda: by_mcap(folder / "drive.mcap"),
    }
    return list(readers[request.param]())


def of(said, topic):
    return [entry for entry in said if entry.topic == topic]


def nanoseconds(stamp):
    return int(stamp.sec * 10**9 + stamp.nanosec)


def heading(q):
    return math.atan2(2 * (q.w * q.z + q.x * q.y), 1 - 2 * (q.y**2 + q.z**2))


def to_map(points):
    """Transform points of the world to the map, as complex numbers."""
    z = np.asarray(points, dtype=np.float64)
    turned = (z[..., 0] + 1j * z[..., 1]) * np.exp(1j * FRAME[2]) + complex(FRAME[0], FRAME[1])
    return np.stack([turned.real, turned.imag], axis=-1)


def test_every_row_is_there_with_its_pose(said, log):
    moving = of(said, "/tf")[1:]
    assert [entry.at for entry in moving] == [round(t * 1e9) for t in log.t.tolist()]
    for entry, pose, movers in zip(moving, log.pose.tolist(), to_map(log.movers), strict=True):
        base, _, truth, *others = entry.message.transforms
        assert (truth.header.frame_id, truth.child_frame_id) == ("map", "ground_truth")
        assert {t.header.frame_id for t in others} == {"map"}
        assert nanoseconds(base.header.stamp) == entry.at
        found = base.transform.translation
        assert math.hypot(found.x - pose[0], found.y - pose[1]) < 1e-6
        assert abs(math.remainder(heading(base.transform.rotation) - pose[2], 2 * math.pi)) < 1e-9
        places = [(t.transform.translation.x, t.transform.translation.y) for t in others]
        assert np.abs(np.array(places) - movers).max() < 1e-6


def placed(transform):
    """Return a transform's position and heading as complex numbers."""
    q = transform.rotation
    return complex(transform.translation.x, transform.translation.y), complex(q.w, q.z) ** 2


def test_map_to_odom_to_base_is_the_estimate(said, log):
    for entry, (x, y, yaw) in zip(of(said, "/tf")[1:], log.estimate.tolist(), strict=True):
        base, correction = entry.message.transforms[:2]
        assert (correction.header.frame_id, correction.child_frame_id) == ("map", base.header.frame_id)
        (at, turn), (corner, turned) = placed(base.transform), placed(correction.transform)
        assert abs(corner + turned * at - complex(*to_map((x, y)))) < 1e-9
        assert abs(turned * turn - np.exp(1j * (yaw + FRAME[2]))) < 1e-9


def test_wheels_turn_as_odometry_moves(said, log):
    states, robot = [entry.message for entry in of(said, "/joint_states")], log.record.robot
    assert {tuple(state.name) for state in states} == {("left_wheel_joint", "right_wheel_joint")}
    left, right = np.array([state.velocity for state in states]).T * robot.wheel_radius
    twists = np.array([(m.message.twist.twist.linear.x, m.message.twist.twist.angular.z) for m in of(said, "/odom")])
    assert np.allclose(np.column_stack([(left + right) / 2, (right - left) / robot.track]), twists, atol=1e-12)
    angles = np.array([state.position for state in states])
    assert np.allclose(np.diff(angles, axis=0), np.array([s.velocity for s in states])[1:] / 240, atol=1e-9)


def test_odometry_commands_and_numbers_are_those_of_the_log(said, log):
    odometry = [entry.message for entry in of(said, "/odom")]
    assert [(m.header.frame_id, m.child_frame_id) for m in odometry] == [("odom", "base_footprint")] * len(log.t)
    poses = [(m.pose.pose.position.x, m.pose.pose.position.y, heading(m.pose.pose.orientation)) for m in odometry]
    assert np.abs(np.array(poses) - log.pose).max() < 1e-9
    twists = [(m.twist.twist.linear.x, m.twist.twist.angular.z) for m in odometry]
    assert np.array_equal(twists, log.twist)
    commands = [(e.message.linear.x, e.message.angular.z) for e in of(said, "/cmd_vel")]
    assert np.array_equal(commands, log.command)
    assert [entry.message.data for entry in of(said, "/clearance")] == log.clearance.tolist()
    assert [entry.message.data for entry in of(said, "/limiter")] == log.limiter.tolist()
    for topic, poses in (("/estimate", log.estimate), ("/ground_truth/odom", log.pose)):
        places = [entry.message.pose.pose.position for entry in of(said, topic)]
        assert np.abs(np.array([(at.x, at.y) for at in places]) - to_map(poses)).max() < 1e-9
        assert {entry.message.header.frame_id for entry in of(said, topic)} == {"map"}


def test_stamps_are_in_order_and_have_a_transform_at_or_before_them(said, log):
    assert [entry.at for entry in said] == sorted(entry.at for entry in said)
    known = set()
    for entry in said:
        transforms = getattr(entry.message, "transforms", [])
        known |= {transform.child_frame_id for transform in transforms}
        header = getattr(entry.message, "header", None)
        if entry.topic == "/joint_states":
            continue
        frames = [header.frame_id] if header else [m.header.frame_id for m in getattr(entry.message, "markers", [])]
        assert set(frames) <= known | {"map"}
        for stamp in [header.stamp] if header else [t.header.stamp for t in transforms]:
            assert nanoseconds(stamp) == entry.at
    robot = {"base_footprint", "base_link", "base_scan", "left_wheel", "right_wheel"}
    assert known == robot | {"odom", "ground_truth", "mover_0", "mover_1"}


def test_fixed_transforms_are_sent_twice(said):
    (static,), first = of(said, "/tf_static"), of(said, "/tf")[0]
    assert static.at == first.at == 0
    for entry in (static, first):
        placed = {t.child_frame_id: (t.header.frame_id, t.transform) for t in entry.message.transforms}
        parent, lies = placed["base_link"]
        assert (parent, lies.translation.x, lies.translation.y) == ("base_footprint", 0.0, 0.0)


def test_the_map_holds_the_obstacles_themselves(said, log):
    grid = of(said, "/map")[0].message
    (x0, y0, *_), cell = log.record.world.bounds, grid.info.resolution
    cells = np.array(grid.data).reshape(grid.info.height, grid.info.width)
    assert (cells[[0, -1]] == 100).all()
    assert (cells[:, [0, -1]] == 100).all()
    rows, cols = np.indices(cells.shape) - 0.5
    points = x0 + cols * cell + 1j * (y0 + rows * cell)
    away = np.min([np.abs(points - complex(d.x, d.y)) - d.radius for d in log.record.world.obstacles], axis=0)
    inside = np.s_[1:-1, 1:-1]
    assert np.array_equal(cells[inside] == 100, away[inside] <= 0)


def test_the_costmap_is_the_grid_that_was_planned_on(said, log):
    (entry,) = of(said, "/global_costmap/costmap")
    info, record = entry.message.info, log.record
    grid = rasterise(record.task.world, record.cell, record.inflate)
    assert (info.height, info.width, info.resolution) == (*grid.shape, pytest.approx(grid.cell))
    assert [info.origin.position.x, info.origin.position.y] == pytest.approx(to_map(record.world.bounds[:2]).tolist())
    assert heading(info.origin.orientation) == pytest.approx(FRAME[2])
    assert np.array_equal(np.array(entry.message.data).reshape(grid.shape) == 0, grid.free)


def test_each_route_is_sent_at_its_start_time(said, log):
    first, second = of(said, "/plan")
    assert (first.at, second.at) == (0, 250_000_000)
    for entry, route in ((first, log.route), (second, log.record.replans[0].route)):
        points = [(p.pose.position.x, p.pose.position.y) for p in entry.message.poses]
        assert np.abs(np.array(points) - to_map(route)).max() < 1e-9
    headings = [heading(p.pose.orientation) - FRAME[2] for p in second.message.poses]
    assert headings == pytest.approx([0.0, math.pi / 2, math.pi / 2])


def test_markers_show_cylinders_movers_and_contacts(said, log):
    groups = {}
    for marker in of(said, "/obstacles")[0].message.markers:
        groups.setdefault(marker.ns, []).append(marker)
    standing = groups["cylinders"] + groups["unseen"]
    discs = log.record.world.obstacles
    assert len(groups["unseen"]) == 1
    places = [(m.pose.position.x, m.pose.position.y) for m in standing]
    assert np.abs(np.array(places) - to_map([(d.x, d.y) for d in discs])).max() < 1e-9
    assert [(m.scale.x, m.scale.z, m.pose.position.z) for m in standing] == [
        (2 * d.radius, d.height, d.height / 2) for d in discs
    ]
    assert len(groups["walls"][0].points) == 5
    movers = of(said, "/movers")[0].message.markers
    assert [(m.header.frame_id, m.frame_locked) for m in movers] == [("mover_0", True), ("mover_1", True)]
    (touch,) = of(said, "/contacts")
    row, thing = log.contacts[0, :2].astype(int).tolist()
    assert touch.at == round(log.t[row] * 1e9)
    place, disc = touch.message.markers[0].pose.position, discs[thing]
    (centre,) = to_map([(disc.x, disc.y)])
    assert math.hypot(place.x - centre[0], place.y - centre[1]) == pytest.approx(disc.radius)


def test_words_say_what_limits_the_speed_and_what_happened(said, log):
    names = {entry.at: entry.message.data for entry in of(said, "/limiter_name")}
    now = ""
    for t, limiter in zip(log.t.tolist(), log.limiter.tolist(), strict=True):
        now = names.get(round(t * 1e9), now)
        assert now == log.record.limiters[limiter]
    replanned, ended = of(said, "/events")
    assert (replanned.at, replanned.message.data) == (250_000_000, "replan: obstructed: new route")
    assert ended.message.data == "collided: touched an obstacle: a cylinder"


def test_the_robot_is_described_with_its_footprint(said, log):
    robot = ElementTree.fromstring(of(said, "/robot_description")[0].message.data)
    body = robot.find("link[@name='base_link']/visual/geometry/cylinder")
    assert float(body.get("radius", "")) == log.record.robot.footprint.rounding
    children = {joint.find("child").get("link") for joint in robot.iter("joint")}
    assert children == {"base_link", "left_wheel", "right_wheel"}


def test_a_lidar_that_the_drive_did_not_use_measures_at_export(folder, said, log):
    lidar, record = log.record.robot.lidar, log.record
    scans, rows = of(said, "/scan"), range(0, len(log.t), round(record.physics_hz / lidar.rate))
    assert [entry.at for entry in scans] == [round(log.t[row] * 1e9) for row in rows]
    scanner, radii = Scanner.of(lidar, record.world), np.array([mover.radius for mover in record.world.movers])
    for entry, row in zip(scans, rows, strict=True):
        expected = scanner.scan(tuple(log.pose[row].tolist()), log.movers[row], radii)
        assert np.allclose(entry.message.ranges, expected, rtol=1e-6)
    with (folder / "drive.mcap").open("rb") as file:
        (note,) = mcap_reader.make_reader(file).iter_metadata()
    assert (note.name, note.metadata) == ("antdrive", {"scans": SIMULATED})
    about = yaml.safe_load((folder / "bag" / "metadata.yaml").read_text())["rosbag2_bagfile_information"]
    assert about["custom_data"] == {"antdrive_scans": SIMULATED}


def test_scans_are_taken_at_export_only_if_asked_for(folder):
    export(folder / "rollout.npz", "mcap", folder / "none.mcap", scans=False)
    assert "/scan" not in {entry.topic for entry in by_mcap(folder / "none.mcap")}
    with (folder / "none.mcap").open("rb") as file:
        assert [note.metadata for note in mcap_reader.make_reader(file).iter_metadata()] == [{"scans": OMITTED}]


def test_late_subscribers_get_latched_messages(folder):
    once = {"/tf_static", "/map", "/global_costmap/costmap", "/robot_description", "/obstacles", "/movers", "/plan"}
    for path in (folder / "bag", folder / "drive.mcap"):
        with rosbag2.Reader(path) as reader:
            offered = {c.topic: c.ext.offered_qos_profiles[0].durability.name for c in reader.connections}
            assert {topic for topic, durability in offered.items() if durability == "TRANSIENT_LOCAL"} == once
            assert set(offered.values()) == {"TRANSIENT_LOCAL", "VOLATILE"}
            assert reader.message_count == sum(c.msgcount for c in reader.connections)


def test_the_log_and_all_that_it_proves_are_inside(folder, log, tmp_path):
    with (folder / "drive.mcap").open("rb") as file:
        inside = {a.name: a.data for a in mcap_reader.make_reader(file).iter_attachments()}
    assert (
        hashlib.sha256(inside["rollout.npz"]).digest() == hashlib.sha256((folder / "rollout.npz").read_bytes()).digest()
    )
    assert inside["digest.txt"].decode().strip() == log.digest
    assert json.loads(inside["certificate.json"])["certified"] is False
    (tmp_path / "world.yaml").write_bytes(inside["world.yaml"])
    assert load_task(tmp_path / "world.yaml") == log.record.task


def test_the_layout_shows_topics_that_exist(folder, said):
    layout = json.loads((folder / "drive.foxglove.json").read_text())
    assert layout == json.loads((folder / "bag" / "bag.foxglove.json").read_text())
    panels, topics = layout["configById"], {entry.topic for entry in said}

    def named(node):
        return {node} if isinstance(node, str) else named(node["first"]) | named(node["second"])

    assert named(layout["layout"]) == set(panels)
    paths = [path["value"] for panel in panels.values() for path in panel.get("paths", [])]
    assert {path.split(".")[0] for path in paths} <= topics
    for path in paths:
        value = of(said, path.split(".")[0])[0].message
        for name in path.split(".")[1:]:
            value = getattr(value, name)
    assert set(panels["3D!drive"]["topics"]) <= topics


def test_two_robots_in_namespaces_share_nothing_but_the_map(folder, log, said, tmp_path):
    start, everything = 1_777_887_000_250_000_000, {}
    for robot in ("/robot1", "/fleet/robot2"):
        target = tmp_path / f"{robot.rpartition('/')[2]}.mcap"
        export(folder / "rollout.npz", "mcap", target, start=start, namespace=robot)
        now = list(by_rosbags(target))
        assert min(entry.at for entry in now) == start
        assert sorted(entry.at - start for entry in now) == sorted(entry.at for entry in by_mcap(folder / "drive.mcap"))
        assert all(nanoseconds(entry.message.header.stamp) == entry.at for entry in of(now, f"{robot}/odom"))
        tf = [entry for topic in ("tf", "tf_static") for entry in of(now, f"{robot}/{topic}")]
        frames = {
            name for e in tf for one in e.message.transforms for name in (one.header.frame_id, one.child_frame_id)
        }
        frames |= {marker.header.frame_id for e in of(now, f"{robot}/movers") for marker in e.message.markers}
        plain = {
            one.child_frame_id
            for topic in ("/tf", "/tf_static")
            for e in of(said, topic)
            for one in e.message.transforms
        }
        assert frames == {"map", *(f"{robot}/{name}"[1:] for name in plain)}
        assert all(
            topic.startswith((f'"{robot}/', "//"))
            for topic in re.findall('"/[^"]*', target.with_suffix(LAYOUT).read_text())
        )
        everything[robot] = frames - {"map"} | {entry.topic for entry in now}
    assert not everything["/robot1"] & everything["/fleet/robot2"]


def test_frames_of_a_urdf_keep_their_names_in_a_namespace():
    own = frames_of_spec(load_robot("turtlebot4"))
    there = own.under("/robot1")
    assert [link[:2] for link in there.links] == [(f"robot1/{a}", f"robot1/{b}") for a, b, _ in own.links]
    assert (there.base, there.scan) == (f"robot1/{own.base}", f"robot1/{own.scan}")
    assert (there.text, there.joints) == (own.text, own.joints)
