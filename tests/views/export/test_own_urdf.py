"""Bags with the robot's own URDF: its links, joints and lidar frame replace the generated ones."""

import math
import xml.etree.ElementTree as ElementTree
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from antdrive.base import InputError
from antdrive.base.plane import wrap_angle
from antdrive.robots.importing.urdf_import import import_urdf
from antdrive.sim.driving.odometry import odometry_of
from antdrive.views.export.exporting import topics_of
from antdrive.views.export.robot_frames import frames_of_urdf
from antdrive.views.export.samples import DriveScans
from antdrive.views.export.topics import message_types
from tests.made_up_drive import scanned

URDF = Path(__file__).parents[2] / "robots" / "importing" / "urdf"
BURGER = URDF / "burger.urdf"
SENSOR = (
    '<gazebo reference="scan"><sensor name="lds" type="ray"><update_rate>10</update_rate><ray><scan><horizontal>'
    "<samples>90</samples><min_angle>-1</min_angle><max_angle>2</max_angle></horizontal></scan><range><min>0.12</min>"
    "<max>3.5</max></range></ray></sensor></gazebo></robot>"
)


def changed(tmp_path, *changes):
    """The burger with a lidar that sees more to its left, and changes."""
    text = BURGER.read_text()
    for old, new in (("</robot>", SENSOR), *changes):
        assert old in text
        text = text.replace(old, new)
    (tmp_path / "burger.urdf").write_text(text)
    return tmp_path / "burger.urdf"


def drive_of(drive, path):
    """A drive of the robot that a URDF file describes."""
    robot = import_urdf(path).spec
    robot = replace(robot, lidar=robot.lidar or drive.record.robot.lidar)
    drive = replace(drive, record=replace(drive.record, robot=robot))
    return scanned(drive, **{key: getattr(robot.lidar, key) for key in ("x", "y", "yaw")})


def exported(log, path, **settings):
    """Return the messages by topic."""
    read = message_types().deserialize_cdr
    topics = topics_of(log, DriveScans.of(log), frames_of_urdf(log.record.robot, path, **settings))
    return {topic.name: [read(raw, topic.kind) for raw in topic.payloads] for topic in topics}


def matrix(transform):
    """Return a transform (4, 4), by rotating the unit vectors."""
    q, at = transform.rotation, transform.translation
    u, place = np.array([q.x, q.y, q.z]), np.eye(4)
    place[:3, :3] = np.transpose([e + 2 * np.cross(u, np.cross(u, e) + q.w * e) for e in np.eye(3)])
    place[:3, 3] = at.x, at.y, at.z
    return place


def in_robot(said, base):
    """Return each static frame in the robot's frame (4, 4), after a check that they form one tree."""
    placed = {base: np.eye(4)}
    left = {t.child_frame_id: t for t in said["/tf_static"][0].transforms}
    assert len(left) == len(said["/tf_static"][0].transforms)
    while left:
        child = next(name for name, t in left.items() if t.header.frame_id in placed)
        t = left.pop(child)
        placed[child] = placed[t.header.frame_id] @ matrix(t.transform)
    return placed


def test_the_bag_has_the_links_joints_and_text_of_the_urdf(made_up_drive, tmp_path):
    path = changed(tmp_path)
    log = drive_of(made_up_drive(), path)
    said = exported(log, path)
    text = ElementTree.fromstring(said["/robot_description"][0].data)
    links = {link.get("name") for link in text.findall("link")}
    assert links == {"base_footprint", "base_link", "wheel_left_link", "wheel_right_link", "scan"}
    placed = in_robot(said, "base_footprint")
    assert set(placed) == links
    assert said["/odom"][0].child_frame_id == "base_footprint"
    robot = log.record.robot
    assert placed["wheel_left_link"][:3, 3] == pytest.approx((0, robot.track / 2, robot.wheel_radius), abs=1e-3)
    assert placed["scan"][:3, 3] == pytest.approx((robot.lidar.x, robot.lidar.y, robot.lidar.height), abs=1e-3)
    assert {tuple(state.name) for state in said["/joint_states"]} == {("wheel_left_joint", "wheel_right_joint")}
    assert {scan.header.frame_id for scan in said["/scan"]} == {"scan"}


@pytest.mark.parametrize("turn", ["0 0 0", "0 0 3.0", "3.14159265 0 0.5"], ids=["ahead", "to the back", "upside down"])
def test_beams_keep_their_directions_in_the_lidars_link(made_up_drive, tmp_path, turn):
    lies = '<origin xyz="-0.032 0 0.167"/>', f'<origin xyz="-0.032 0 0.167" rpy="{turn}"/>'
    path = changed(tmp_path, lies)
    log = drive_of(made_up_drive(), path)
    said, lidar = exported(log, path), log.record.robot.lidar
    place, scan = in_robot(said, "base_footprint")["scan"], said["/scan"][0]
    angles = scan.angle_min + scan.angle_increment * np.arange(lidar.beams)
    assert abs(angles.mean()) <= math.pi + 1e-6
    ahead = place[:2, :2] @ [np.cos(angles), np.sin(angles)]
    seen = {round(float(wrap_angle(a)), 3) + 0.0: r for a, r in zip(np.arctan2(*ahead[::-1]), scan.ranges, strict=True)}
    logged = DriveScans.of(log).ranges[0]
    expected = {round(float(wrap_angle(a)), 3) + 0.0: r for a, r in zip(lidar.angles, logged, strict=True)}
    order = sorted(expected)
    assert sorted(seen) == pytest.approx(order, abs=2e-3)
    assert [seen[a] for a in sorted(seen)] == pytest.approx([expected[a] for a in order], rel=1e-6)


def test_a_root_elsewhere_and_a_joint_about_the_opposite_axis_are_converted(made_up_drive, tmp_path):
    text, path = (URDF / "pioneer3dx.urdf").read_text(), tmp_path / "pioneer3dx.urdf"
    path.write_text(text.replace('xyz="0 0.1655', 'xyz="0.05 0.1655').replace('xyz="0 -0.1655', 'xyz="0.05 -0.1655'))
    log = drive_of(made_up_drive(), path)
    said = exported(log, path)
    placed, robot = in_robot(said, "base_footprint"), log.record.robot
    wheels = [placed[link][:3, 3] for link in ("lwheel", "rwheel")]
    assert np.mean(wheels, axis=0) == pytest.approx((0, 0, robot.wheel_radius), abs=1e-3)
    assert {scan.header.frame_id for scan in said["/scan"]} == {"base_scan"}, "no link is at the lidar's position"
    speeds = odometry_of(log).wheels / robot.wheel_radius
    told = np.array([state.velocity for state in said["/joint_states"]])
    assert '<axis xyz="0 -1 0"/>' in text, "of the right wheel"
    assert told == pytest.approx(speeds * [1, -1])


def test_frames_never_have_two_parents(made_up_drive, tmp_path):
    renamed = changed(
        tmp_path, ('"base_link"', '"body"'), ('"base_footprint"', '"base_link"'), ('"scan"', '"base_footprint"')
    )
    log = drive_of(made_up_drive(), renamed)
    said = exported(log, renamed)
    assert said["/odom"][0].child_frame_id == "antdrive_base_footprint"
    assert "base_footprint" in in_robot(said, "antdrive_base_footprint")


def test_a_skid_steered_robot_turns_about_the_middle_unless_it_was_imported_with_an_axle():
    axle = {"left": "front_left_wheel", "right": "front_right_wheel"}
    for named in ({}, axle):
        robot = import_urdf(URDF / "husky.urdf", **named).spec
        assert frames_of_urdf(robot, URDF / "husky.urdf", **named).joints[0].startswith("front_left")
    with pytest.raises(InputError, match=r"its footprint differs by 0\.256 m"):
        frames_of_urdf(robot, URDF / "husky.urdf")


def test_xacro_is_resolved():
    path = URDF / "warehouse.urdf.xacro"
    text = frames_of_urdf(import_urdf(path).spec, path).text
    assert "xacro:" not in text
    assert ElementTree.fromstring(text).find("link[@name='left_wheel']") is not None


def test_another_robots_urdf_is_refused(tmp_path, data_regression):
    robot = import_urdf(BURGER).spec
    taller = tmp_path / "taller.urdf"
    taller.write_text(BURGER.read_text().replace('radius="0.033"', 'radius="0.036"'))
    said = {}
    for name, spec, path in (
        ("track", robot, URDF / "waffle.urdf"),
        ("wheel radius", robot, taller),
        ("footprint", replace(robot, footprint=import_urdf(URDF / "waffle.urdf").spec.footprint), BURGER),
    ):
        with pytest.raises(InputError) as raised:
            frames_of_urdf(spec, path)
        said[name] = str(raised.value).replace(str(path.parent), "FOLDER")
    data_regression.check(said)


@pytest.mark.parametrize("kind", ["disc", "rectangle", "polygon"])
def test_each_kind_of_imported_footprint_fits_its_urdf(kind):
    for path in (BURGER, URDF / "waffle.urdf", URDF / "turtlebot4.urdf", URDF / "pioneer3dx.urdf"):
        for below in (math.inf, 0.1):
            frames_of_urdf(import_urdf(path, footprint=kind, below=below).spec, path)
