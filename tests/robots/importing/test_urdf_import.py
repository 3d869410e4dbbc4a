"""Import of robots from URDF: published dimensions are reproduced, and other drives are refused."""

import itertools
import math
import os
import re
import tempfile
from pathlib import Path

import numpy as np
import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st

from antdrive.base import InputError
from antdrive.robots import Footprint, load_robot
from antdrive.robots.importing.hull import convex_hull, fewer_corners, footprint_around
from antdrive.robots.importing.urdf_import import import_urdf
from antdrive.robots.robot_file import footprint_to_dict as written
from antdrive.worlds.formats.meshes import checked_mesh
from benchmarks.robots import SPECIFICATIONS, values_of

FIXTURES = Path(__file__).parent / "urdf"
#: The kind of footprint that follows from the specification; its values are in benchmarks.robots.
KINDS = {
    "burger.urdf": "polygon", "waffle.urdf": "rectangle", "turtlebot4.urdf": "disc", "pioneer3dx.urdf": "polygon",
    "warehouse.urdf.xacro": "rectangle",
}  # fmt: skip
CATALOGUE = {
    "burger.urdf": "turtlebot3-burger", "waffle.urdf": "turtlebot3-waffle", "turtlebot4.urdf": "turtlebot4",
    "pioneer3dx.urdf": "pioneer3dx", "warehouse.urdf.xacro": "warehouse",
}  # fmt: skip


def imported(name, **settings):
    return import_urdf(FIXTURES / name, **settings)


def comments(found):
    """Return the file's comment on each value."""
    lines = found.text.splitlines()
    beside = {line.split(":")[0]: line.partition("  # ")[2] for line in lines if "  # " in line}
    above = {line.split(":")[0]: last[2:] for last, line in itertools.pairwise(lines) if last.startswith("# ")}
    return beside | above


def changed(tmp_path, name, *changes):
    """A fixture with changes. The burger loses its drive plugin, so that its wheels and limits are those of the geometry."""
    text = (FIXTURES / name).read_text()
    if name == "burger.urdf":
        text = re.sub(r"<gazebo>.*</gazebo>", "", text, flags=re.DOTALL)
    for old, new in changes:
        assert old in text
        text = text.replace(old, new)
    path = tmp_path / name
    path.write_text(text)
    return path


@pytest.mark.parametrize("name", KINDS)
def test_what_is_imported_is_within_a_hundredth_of_all_public_values(name):
    found, specified = imported(name), SPECIFICATIONS[name]
    robot, values = found.spec, values_of(found.spec)
    assert {key: values[key] for key in specified} == pytest.approx(specified, rel=0.01)
    assert {"length", "width", "height", "mass", "wheel_radius", "track", "max_speed", "max_yaw_rate"} <= set(specified)
    kind = "disc" if robot.footprint.rounding else "rectangle" if robot.footprint.box else "polygon"
    assert kind == KINDS[name]
    ours = load_robot(CATALOGUE[name])
    assert robot.footprint.bounds == pytest.approx(ours.footprint.bounds, abs=0.01 * ours.radius)
    shared = ("track", "wheel_radius", "mass", "height", "max_speed", "max_yaw_rate")
    assert [getattr(robot, key) for key in shared] == pytest.approx([getattr(ours, key) for key in shared], rel=0.01)
    outside = most_outside(
        yaml.safe_load(found.text)["footprint"], [point for piece in found.pieces for point in piece]
    )
    assert outside <= 1e-8, "no footprint is smaller than the collision geometry"


def test_the_file_says_of_each_value_where_it_comes_from(tmp_path):
    found = imported("pioneer3dx.urdf", given={"mass": 9.5})
    path = tmp_path / "pioneer.yaml"
    path.write_text(found.text)
    assert load_robot(path) == found.spec
    assert found.spec.mass == 9.5
    numbers = [line for line in found.text.splitlines() if re.match(r"\w+: [\d.]+ ", line)]
    assert len(numbers) == 11
    kinds = {line.split(":")[0]: line.split("# ")[1].split(":")[0] for line in numbers}
    assert kinds == {
        "height": "computed", "mass": "given", "wheel_radius": "read", "track": "computed", "max_speed": "read",
        "max_yaw_rate": "read", "max_acceleration": "assumed", "max_yaw_acceleration": "assumed",
        "max_lateral_acceleration": "assumed", "max_wheel_speed": "read", "wheel_torque": "read",
    }  # fmt: skip
    assert set(yaml.safe_load(found.text)) == {"schema", "name", "source", "footprint", "noise", *kinds}


def test_the_noise_is_assumed_as_in_the_catalogue():
    found = imported("burger.urdf")
    assert found.spec.noise == load_robot("turtlebot3-burger").noise
    assert "# assumed: as in the catalogue; measure the robot's own\nnoise: {pose_xy" in found.text


def test_limits_that_contradict_each_other_are_resolved_or_refused(tmp_path):
    slow = ('<axis xyz="0 1 0"/>', '<axis xyz="0 1 0"/><limit effort="2" velocity="5"/>')
    found = import_urdf(changed(tmp_path, "waffle.urdf", slow))
    assert found.spec.max_speed == pytest.approx(5 * 0.033)
    assert comments(found)["max_speed"] == (
        "computed: the velocity limit of joint wheel_left_joint, 5 rad/s; <max_linear_velocity> of the drive plugin is 0.26"
    )
    with pytest.raises(
        InputError, match=r"max_wheel_speed: 7 rad/s on a robot of 1 kg .* but max_speed is 9; raise max_wheel_speed"
    ):
        imported("burger.urdf", given={"max_speed": 9.0})


def plugged(inside, left="wheel_left_joint", right="wheel_right_joint"):
    """A drive plugin of these joints with more in it."""
    joints = f"<left_joint>{left}</left_joint><right_joint>{right}</right_joint>"
    return f"<gazebo><plugin>{joints}{inside}</plugin></gazebo>"


def limited(tmp_path, words):
    """The burger with a limit on both wheels."""
    path = changed(tmp_path, "burger.urdf")
    path.write_text(path.read_text().replace('<axis xyz="0 0 1"/>', f'<axis xyz="0 0 1"/><limit {words}/>'))
    return import_urdf(path)


@pytest.mark.parametrize(
    ("words", "key", "value", "says"),
    [
        ('velocity="6.67"', "max_speed", 0.22011, "computed: the velocity limit of joint wheel_left_joint, 6.67 rad/s, "),
        ('velocity="6.67"', "max_wheel_speed", 6.67, "read: the velocity limit of joint wheel_left_joint, 6.67 rad/s"),
        ('velocity="50"', "max_speed", 1.65, "computed: the velocity limit of joint wheel_left_joint, 50 rad/s, times"),
        ('velocity="50"', "max_yaw_rate", 3.14, "assumed: half a turn a second; the velocity limit of joint"),
        ('velocity="400"', "max_speed", 0.5,
         "assumed: the velocity limit of joint wheel_left_joint, 400 rad/s, would be 13.2 m/s, implausible for its size, "
         "not used"),
        ('velocity="1"', "max_speed", 0.5, "assumed: the velocity limit of joint wheel_left_joint, 1 rad/s, would be 0.033 m/s"),
        ('velocity="1"', "max_wheel_speed", 18.182, "assumed: 1.2 times the speeds' requirement"),
        ('velocity="inf"', "max_speed", 0.5, "assumed: the file has no limit"),
        ('velocity="400"', "max_wheel_speed", 400.0, "read: the velocity limit of joint wheel_left_joint, 400 rad/s"),
        ('velocity="99999"', "max_wheel_speed", 18.182,
         "assumed: 1.2 times the speeds' requirement; the velocity limit of joint wheel_left_joint, 99999 rad/s is above the "
         "10000 rad/s limit of robot files, not used"),
        ("", "max_speed", 0.5, "assumed: the file has no limit"),
        ('effort="0.3"', "wheel_torque", 0.3, "read: the effort limit of joint wheel_left_joint, 0.3 N m"),
        ('effort="0.0001"', "wheel_torque", 0.066, "assumed: 4 times the torque for 1 m/s2; the effort limit of joint wheel_lef"),
        ('effort="1e6"', "wheel_torque", 1e6, "read: the effort limit of joint wheel_left_joint, 1000000 N m"),
        ("", "wheel_torque", 0.066, "assumed: 4 times the torque for 1 m/s2"),
        ('effort="0.01"', "max_acceleration", 0.545455, "computed: 0.9 times the limit of motors and grip"),
    ],
)  # fmt: skip
def test_every_unused_limit_of_a_joint_is_named(tmp_path, words, key, value, says):
    found = limited(tmp_path, words)
    assert getattr(found.spec, key) == pytest.approx(value, rel=1e-4)
    assert comments(found)[key].startswith(says)


@pytest.mark.parametrize(
    ("tag", "told", "velocity", "key", "value", "says"),
    [
        ("max_linear_velocity", 50, "", "max_speed", 0.5, "assumed: <max_linear_velocity> of the drive plugin, 50 m/s, is above "
         "the 10 m/s limit of robot files, not used"),
        ("max_linear_velocity", 50, 'velocity="7"', "max_speed", 0.231, "computed: the velocity limit of joint "
         "wheel_left_joint, 7 rad/s, times the wheels' radius; <max_linear_velocity> of the drive plugin, 50 m/s, is above"),
        ("max_linear_velocity", 12, 'velocity="400"', "max_speed", 0.5, "assumed: the velocity limit of joint wheel_left_joint, "
         "400 rad/s, would be 13.2 m/s, implausible for its size, not used; <max_linear_velocity>"),
        ("max_linear_velocity", 10, "", "max_speed", 10.0, "read: <max_linear_velocity> of the drive plugin"),
        ("max_angular_velocity", 99, "", "max_yaw_rate", 2.0, "assumed: <max_angular_velocity> of the drive plugin, 99 rad/s, "
         "is above the 50 rad/s limit of robot files, not used"),
    ],
)  # fmt: skip
def test_a_speed_that_means_no_limit_is_named_and_not_used(tmp_path, tag, told, velocity, key, value, says):
    plugin = plugged(f"<{tag}>{told}</{tag}>") + "</robot>"
    limit = f'<axis xyz="0 0 1"/><limit {velocity}/>'
    found = import_urdf(changed(tmp_path, "burger.urdf", ("</robot>", plugin), ('<axis xyz="0 0 1"/>', limit)))
    assert getattr(found.spec, key) == pytest.approx(value)
    assert comments(found)[key].startswith(says)


def test_wheels_of_different_radii_are_named_with_both(tmp_path):
    """Wherever their axle is: at one height, or with both on the floor; and where the file names them itself."""
    text = (FIXTURES / "burger.urdf").read_text()
    plain, plugin = changed(tmp_path, "burger.urdf").read_text(), text[text.index("<gazebo>") :]
    says = "have different radii, 0.033 m (link wheel_left_link) and 0.02 m (link wheel_right_link)"
    for height in (0.023, 0.010):
        for start in (
            plain.removesuffix("</robot>\n"),
            plain.removesuffix("</robot>\n") + plugin.removesuffix("</robot>\n"),
        ):
            first, last = start.split('<link name="wheel_right_link">')
            last = last.replace('radius="0.033"', 'radius="0.02"').replace("-0.080 0.023", f"-0.080 {height}")
            path = tmp_path / "unlike.urdf"
            path.write_text(f'{first}<link name="wheel_right_link">{last}</robot>')
            with pytest.raises(InputError) as caught:
                import_urdf(path)
            assert says in str(caught.value)


CONTROL = (
    '<ros2_control name="all" type="system">'
    '<joint name="{}"><command_interface name="velocity">{}</command_interface><state_interface name="velocity"/></joint>'
    '<joint name="{}"><command_interface name="velocity"/></joint></ros2_control></robot>'
)


def test_ros2_control_names_the_driven_wheels_and_their_limit(tmp_path):
    """Of four wheels on two axles those that it drives by speed; the right one comes first in the file."""
    most = '<param name="min">-9</param><param name="max">5</param>'
    control = CONTROL.format("rear_right_wheel", most, "rear_left_wheel")
    text = re.sub(r"<gazebo>.*</gazebo>", "", (FIXTURES / "husky.urdf").read_text(), flags=re.DOTALL)
    path = tmp_path / "driven.urdf"
    path.write_text(text.replace("</robot>", control))
    found = import_urdf(path)
    assert found.spec.footprint.bounds == pytest.approx((-0.239, -0.335, 0.751, 0.335), abs=1e-3)
    assert (found.spec.max_wheel_speed, found.spec.max_speed) == (5.0, pytest.approx(5 * 0.1651))
    assert comments(found)["max_wheel_speed"] == "read: the limit of joint rear_right_wheel in <ros2_control>, 5 rad/s"
    for joint, limit, says in (
        ("rear_wrong_wheel", most, "<ros2_control> names joint 'rear_wrong_wheel', which does not exist"),
        (
            "rear_right_wheel",
            '<param name="max">-5</param>',
            "max in <ros2_control> must be a number above 0, got '-5'",
        ),
        ("rear_right_wheel", '<param name="max">fast</param>', "must be a number above 0, got 'fast'"),
        ("front_left_wheel", "", "front_left_wheel and rear_left_wheel are not on one axle"),
    ):
        path.write_text(text.replace("</robot>", CONTROL.format(joint, limit, "rear_left_wheel")))
        with pytest.raises(InputError, match=re.escape(says)):
            import_urdf(path)


def test_a_wheel_that_is_a_little_askew_adds_no_corners(tmp_path):
    """Quarter turns are often written 1.57, which tilts a wheel by 0.8 mrad."""
    straight, askew = (
        import_urdf(changed(tmp_path, "burger.urdf", ("-1.5707963", turn))) for turn in ("-1.5707963", "-1.57")
    )
    assert len(askew.spec.footprint.corners) == len(straight.spec.footprint.corners) == 8
    assert askew.spec.footprint.bounds == pytest.approx(straight.spec.footprint.bounds, abs=1e-4)


@pytest.mark.parametrize(
    ("effort", "plugin", "torque", "beside"),
    [
        (0.0001, 5, 5.0, "0.0001 N m would not move"),
        (3, 1e9, 3.0, "<max_wheel_torque> of the drive plugin, 1e+09 N m is above"),
        (3, 2, 2.0, "the effort limit of joint wheel_left_joint, 3 N m is more"),
    ],
)
def test_the_lowest_torque_that_can_be_used_is_and_the_other_is_named(tmp_path, effort, plugin, torque, beside):
    end = plugged(f"<max_wheel_torque>{plugin}</max_wheel_torque>") + "</robot>"
    found = import_urdf(changed(tmp_path, "burger.urdf", ('effort="1.4"', f'effort="{effort}"'), ("</robot>", end)))
    how = comments(found)["wheel_torque"]
    assert found.spec.wheel_torque == torque
    assert how.startswith("read: ")
    assert beside in how


@pytest.mark.parametrize("key", ["velocity", "effort"])
def test_a_negative_limit_is_refused_with_joint_and_key(tmp_path, key):
    with pytest.raises(InputError, match=rf"joint wheel_\w+_joint: the limit's {key} must be at least 0, got -5$"):
        limited(tmp_path, f'{key}="-5"')
    none = limited(tmp_path, f'{key}="0"')
    assert none.spec == limited(tmp_path, "").spec  # 0 is how files say that there is none


def test_what_the_drive_plugin_says_otherwise_stands_beside_what_is_used(tmp_path):
    plugin = plugged(
        "<wheel_separation>0.2</wheel_separation><wheel_diameter>0.0661</wheel_diameter>"
        "<max_linear_acceleration>0.4</max_linear_acceleration><max_wheel_torque>0.02</max_wheel_torque>"
    )
    found = import_urdf(changed(tmp_path, "burger.urdf", ("</robot>", f"{plugin}</robot>")))
    says = comments(found)
    assert says["track"].endswith("; <wheel_separation> of the drive plugin is 0.2; check which is right")
    assert says["wheel_radius"] == "read: cylinder of link wheel_left_link", "it agrees"
    assert (found.spec.max_acceleration, found.spec.wheel_torque) == (0.4, 0.02)
    assert says["max_acceleration"] == "read: <max_linear_acceleration> of the drive plugin"
    assert says["wheel_torque"] == (
        "read: <max_wheel_torque> of the drive plugin, 0.02 N m; the effort limit of joint wheel_left_joint, 1.4 N m is more"
    )


def test_links_without_a_mass_are_named(tmp_path):
    found = import_urdf(changed(tmp_path, "waffle.urdf", ('<mass value="0.03"/>', "")))
    assert comments(found)["mass"] == "computed: sum of the masses of base_link; left, right have none"


def test_a_skid_steer_robot_turns_about_the_middle_unless_an_axle_is_named():
    found = imported("husky.urdf")
    assert found.spec.footprint.bounds == pytest.approx((-0.495, -0.335, 0.495, 0.335), abs=1e-3)
    assert (found.spec.track, found.spec.max_speed) == (pytest.approx(0.5708), 1.0), (
        "as the plugin of all four wheels says"
    )
    assert found.notes[0].startswith(
        "skid-steer: turns about the middle between its 2 axles (front_left_wheel, rear_left"
    )
    robot = imported("husky.urdf", left="rear_left_wheel", right="rear_right_wheel").spec
    assert robot.footprint.bounds == pytest.approx((-0.239, -0.335, 0.751, 0.335), abs=1e-3)


#: Changes that make a file wrong, in one way each.
WRONG = (
    (("<robot name", "<sdf name"), ("</robot>", "</sdf>")), (('type="continuous"', 'type="fixed"'),),
    (("0 -0.080 0.023", "0.05 -0.080 0.023"),), (('child link="scan"', 'child link="scam"'),),
    (('child link="scan"', 'child link="base_link"'),), (('radius="0.035"', 'radius="wide"'),),
    (('<box size="0.138 0.140 0.143"/>', '<mesh filename="package://a/b.stl"/>'),), (("<box size", "<box dimensions"),),
    (("<box size", "<cone size"),), (('<link name="scan">', "<link>"),), (('value="0.83"', 'value="nan"'),),
    (("<robot name", "<!DOCTYPE robot><robot name"),), (('value="0.83"', 'value="2e8"'),),
    (('value="0.83"', 'value="-0.83"'),), (('radius="0.033"', 'radius="-0.033"'),),
    (('<origin xyz="-0.032 0 0.070"/>', '<origin xyz="-0.032 0 0.030"/>'),),
    (('type="continuous"', 'type="revolute"'),), (('value="0.83"', 'value="2e5"'),),
)  # fmt: skip


@pytest.mark.parametrize(
    "plugin",
    [
        'name="gz::sim::systems::AckermannSteering" filename="gz-sim-ackermann-steering-system"',
        'name="drive" filename="libgazebo_ros_tricycle_drive.so"',
        'name="gz::sim::systems::MecanumDrive" filename="gz-sim-mecanum-drive-system"',
        'name="base" filename="libgazebo_ros_planar_move.so"',
    ],
)
def test_a_plugin_for_another_drive_is_refused_by_name(tmp_path, plugin):
    path = changed(tmp_path, "waffle.urdf", ("<gazebo>", f"<gazebo><plugin {plugin}/></gazebo><gazebo>"))
    name = plugin.replace('name="', "").replace('" file', " ").replace('"', "")
    with pytest.raises(InputError, match=f"plugin {name}: .*; only differential drives can be simulated"):
        import_urdf(path)


def test_a_plugin_that_names_one_of_two_axles_chooses_it(tmp_path):
    one = plugged("", "rear_left_wheel", "rear_right_wheel")
    text = re.sub(r"<gazebo>.*</gazebo>", one, (FIXTURES / "husky.urdf").read_text(), flags=re.DOTALL)
    path = tmp_path / "husky.urdf"
    path.write_text(text)
    assert import_urdf(path).spec.footprint.bounds[2] == pytest.approx(0.751, abs=1e-3)


def test_a_robot_without_low_collision_geometry_has_no_footprint():
    with pytest.raises(InputError, match=r"has no collision geometry below 0\.005 m other than its wheels"):
        imported("burger.urdf", below=0.005)


@pytest.mark.parametrize("key", ["mass", "wheel_radius", "track"])
@pytest.mark.parametrize("value", [0.0, -1.0, math.inf, math.nan])
def test_given_values_that_no_robot_has_are_refused(key, value):
    with pytest.raises(InputError, match=f"{key}: must be a number greater than 0"):
        imported("burger.urdf", given={key: value})


@pytest.mark.parametrize(
    ("key", "value"), [("max_lateral_acceleration", 0.785398), ("max_yaw_acceleration", 3.14159265)]
)
def test_long_numbers_stand_apart_from_their_comments(key, value):
    found = imported("burger.urdf", given={key: value})
    assert yaml.safe_load(found.text)[key] == pytest.approx(value)
    assert getattr(found.spec, key) == pytest.approx(value)


def test_wheels_are_given_by_joint_or_link():
    there = imported("burger.urdf").spec
    assert imported("burger.urdf", left="wheel_left_link", right="wheel_right_joint").spec == there
    with pytest.raises(InputError, match="write --left wheel_left_joint --right wheel_right_joint"):
        imported("burger.urdf", left="wheel_right_link", right="wheel_left_link")
    with pytest.raises(
        InputError, match="scan: does not turn freely about a level axis; wheels on the floor: wheel_left_joint, wh"
    ):
        imported("burger.urdf", left="scan", right="wheel_right_link")
    with pytest.raises(InputError, match="wheel: no such joint or link"):
        imported("burger.urdf", left="wheel", right="wheel_right_link")
    with pytest.raises(InputError, match="--left, --right: give both or none"):
        imported("burger.urdf", left="wheel")


def test_higher_pieces_and_missing_meshes_are_omitted_on_request(tmp_path):
    wide = changed(tmp_path, "turtlebot4.urdf", ('size="0.1 0.1 0.246"', 'size="0.9 0.1 0.246"'))
    assert import_urdf(wide).spec.radius > 0.45
    low = import_urdf(wide, below=0.1)
    assert low.spec.footprint.is_disc
    assert low.spec.radius == pytest.approx(0.1705, rel=0.01)
    assert (len(low.pieces), len(low.above)) == (1, 1), "without the wheels' spheres"
    assert low.spec.height == pytest.approx(0.351), "the body is as high as it is"
    mesh = changed(
        tmp_path, "turtlebot4.urdf", ('<box size="0.1 0.1 0.246"/>', '<mesh filename="package://tb/mast.stl"/>')
    )
    found = import_urdf(mesh, without_meshes=True)
    assert "omitted, because not found: mast: package://tb/mast.stl" in found.notes
    assert found.text.endswith("# note: omitted, because not found: mast: package://tb/mast.stl\n")


def test_a_mesh_is_read_with_its_scale(tmp_path):
    corners = [(x, y, z) for x in (-1, 1) for y in (-2, 2) for z in (-1, 1)]
    (tmp_path / "meshes").mkdir()
    text = "".join(f"v {x} {y} {z}\n" for x, y, z in corners) + "f 1 2 3\nf 6 7 8\nf 1 5 8\nf 2 4 6\nf 3 4 7\n"
    (tmp_path / "meshes" / "body.obj").write_text(text)
    path = changed(
        tmp_path,
        "waffle.urdf",
        ('<box size="0.281 0.306 0.119"/>', '<mesh filename="package://waffle/meshes/body.obj" scale="0.2 0.1 0.05"/>'),
    )
    assert import_urdf(path).spec.footprint.bounds == pytest.approx((-0.264, -0.2, 0.136, 0.2), abs=1e-4)


@pytest.mark.parametrize(("unit", "scale"), [('<unit meter="0.001" name="millimetre"/>', 1.0), ("", 0.001)])
def test_the_unit_of_a_collada_mesh_counts(tmp_path, unit, scale):
    """A box of 400 x 300 x 100 units, as few tags as COLLADA allows."""
    corners = " ".join(f"{x} {y} {z}" for x in (-200, 200) for y in (-150, 150) for z in (-50, 50))
    faces = "0 1 3 0 3 2 4 6 7 4 7 5 0 4 5 0 5 1 2 3 7 2 7 6 0 2 6 0 6 4 1 5 7 1 7 3"
    (tmp_path / "body.dae").write_text(
        '<?xml version="1.0"?><COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1"><asset>'
        f"<created>2020-01-01T00:00:00</created><modified>2020-01-01T00:00:00</modified>{unit}</asset>"
        '<library_geometries><geometry id="g"><mesh><source id="p"><float_array id="pa" count="24">'
        f'{corners}</float_array><technique_common><accessor source="#pa" count="8" stride="3"><param name="X" type="float"/>'
        '<param name="Y" type="float"/><param name="Z" type="float"/></accessor></technique_common></source><vertices id="v">'
        '<input semantic="POSITION" source="#p"/></vertices><triangles count="12">'
        '<input semantic="VERTEX" source="#v" offset="0"/>'
        f"<p>{faces}</p></triangles></mesh></geometry></library_geometries>"
        '<library_visual_scenes><visual_scene id="s"><node id="n">'
        '<instance_geometry url="#g"/></node></visual_scene></library_visual_scenes>'
        '<scene><instance_visual_scene url="#s"/></scene>'
        "</COLLADA>"
    )
    mesh = f'<mesh filename="body.dae" scale="{scale} {scale} {scale}"/>'
    path = changed(tmp_path, "waffle.urdf", ('<box size="0.281 0.306 0.119"/>', mesh))
    assert import_urdf(path).spec.footprint.bounds == pytest.approx((-0.264, -0.1525, 0.136, 0.1525), abs=1e-3)


def test_masses_and_torques_that_a_file_lacks_are_assumed(tmp_path):
    path = changed(tmp_path, "waffle.urdf", ('<mass value="1.74"/>', ""), ('<mass value="0.03"/>', ""))
    found = import_urdf(path)
    assert found.spec.mass == pytest.approx(150 * 0.281 * 0.306 * 0.141, rel=1e-3)
    assert "# assumed: 150 kg/m3, as the file has no masses" in found.text


@given(st.floats(0.01, 0.5), st.floats(0.2, 2.0), st.floats(1.0, 100.0))
def test_any_limits_of_the_joints_give_a_robot_that_reaches_what_it_promises(radius, track, velocity):
    """Whatever the rounding does: a robot whose motors fall short by the last digit would be refused."""
    text = (FIXTURES / "waffle.urdf").read_text().partition("<gazebo>")[0] + "</robot>"
    body = f'<box size="{2.5 * max(radius, track)} {2 * track} 0.1"/>'
    for old, new in (
        ('<box size="0.281 0.306 0.119"/>', body),
        ('radius="0.033"', f'radius="{radius!r}"'),
        ("0.1435 0.033", f"{track / 2!r} {radius!r}"),
        ('<axis xyz="0 1 0"/>', f'<axis xyz="0 1 0"/><limit effort="0" velocity="{velocity!r}"/>'),
    ):
        assert old in text
        text = text.replace(old, new)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "any.urdf"
        path.write_text(text)
        refused, robot = "", None
        try:
            robot = import_urdf(path).spec
        except InputError as error:
            refused = str(error)
    assert "reach" not in refused, "only a robot that antdrive is not meant for is refused"
    assert robot is None or 0.05 <= robot.max_speed <= max(velocity * radius * (1 + 1e-6), 0.5)


points = st.tuples(st.floats(-1, 1), st.floats(-1, 1))


def most_outside(footprint, some):
    """How far the outermost of some points lies outside a footprint as it stands in a robot's file [m]."""
    x, y = np.array(some).T
    if "radius" in footprint:
        cx, cy = footprint.get("centre", (0.0, 0.0))
        return float((np.hypot(x - cx, y - cy) - footprint["radius"]).max())
    if "polygon" not in footprint:
        (cx, cy), length, width = footprint.get("centre", (0.0, 0.0)), footprint["length"], footprint["width"]
        return float(np.maximum(abs(x - cx) - length / 2, abs(y - cy) - width / 2).max())
    corners = np.array(footprint["polygon"])
    edges = np.roll(corners, -1, axis=0) - corners
    outwards = np.column_stack([edges[:, 1], -edges[:, 0]]) / np.hypot(*edges.T)[:, None]
    return float(((np.array(some)[:, None] - corners) * outwards).sum(axis=2).max())


@given(st.lists(points, min_size=3, max_size=60), st.sampled_from(["auto", "disc", "rectangle", "polygon"]))
def test_a_footprint_holds_every_point_that_it_was_made_around(some, kind):
    ring = [(0.3 * math.cos(k), 0.2 * math.sin(k)) for k in range(7)]
    foot = footprint_around(some + ring, kind)
    assert most_outside(written(foot), some + ring) <= 1e-8
    assert len(foot.corners) <= 12
    foot.require_convex()


@given(
    st.tuples(st.floats(0.05, 0.5), st.floats(0.05, 0.5)), st.floats(-0.05, 0.05), st.floats(-0.05, 0.05), st.floats(-3, 3),
    st.sampled_from(["auto", "disc", "rectangle", "polygon"]),
)  # fmt: skip
def test_no_corner_of_a_turned_box_is_outside_of_the_footprint(size, x, y, yaw, kind):
    """A few corners of any digits: a corner that is rounded to the nearest is too far inside for half of them."""
    box = [(x + a * math.cos(yaw) - b * math.sin(yaw), y + a * math.sin(yaw) + b * math.cos(yaw))
           for a in (-size[0], size[0]) for b in (-size[1], size[1])]  # fmt: skip
    foot = footprint_around(box, kind)
    assert most_outside(written(foot), box) <= 1e-8
    xmin, ymin, xmax, ymax = foot.bounds
    reach = max(math.hypot(*corner) for corner in box)
    assert max(-xmin, -ymin, xmax, ymax) <= reach + 3e-5, "outwards, but by little"


@given(st.lists(st.tuples(st.floats(-1, 1), st.floats(0, 1)), min_size=3, max_size=40), st.floats(0.2, 0.8))
def test_a_robot_with_two_equal_sides_has_a_footprint_with_two_equal_sides(some, at):
    ring = [(at + 0.4 * math.cos(k / 30 * math.pi), 0.4 * math.sin(k / 30 * math.pi)) for k in range(31)]
    both = [(x, side * y) for x, y in some + ring for side in (-1, 1)]
    foot = footprint_around(both, "polygon")
    assert most_outside(written(foot), both) <= 1e-8
    assert len(foot.corners) <= 12
    for x, y in foot.corners:
        assert min(math.dist((x, -y), corner) for corner in foot.corners) <= 1e-4


def test_a_cylinder_is_as_long_and_as_wide_as_its_diameter(tmp_path):
    path = changed(
        tmp_path, "burger.urdf", ('<box size="0.138 0.140 0.143"/>', '<cylinder radius="0.2" length="0.143"/>')
    )
    for kind in ("rectangle", "polygon"):
        bounds = import_urdf(path, footprint=kind).spec.footprint.bounds
        assert (bounds[2] - bounds[0], bounds[3] - bounds[1]) == pytest.approx(
            (0.4, 0.4), rel=0.06 if kind == "polygon" else 1e-4
        )


@given(st.integers(13, 90), st.floats(0.3, 1.0))
def test_fewer_corners_cost_little(count, squash):
    ellipse = [(math.cos(2 * math.pi * k / count), squash * math.sin(2 * math.pi * k / count)) for k in range(count)]
    fewer = fewer_corners(convex_hull(ellipse), 12)
    assert 4 <= len(fewer) <= 12
    x, y = np.array(fewer).T
    area = (x * np.roll(y, -1) - y * np.roll(x, -1)).sum() / 2
    assert squash * 3.0 < area < squash * math.pi * 1.08
    foot = Footprint.polygon(fewer)
    assert min(foot.depth(*point) for point in ellipse) > -1e-6


def test_the_yaw_of_the_axle_is_the_robots(tmp_path):
    """A model whose ahead is the root's y axis: the same robot, turned."""
    path = changed(
        tmp_path,
        "burger.urdf",
        ('<origin xyz="-0.032 0 0.070"/>', '<origin xyz="0 -0.032 0.070" rpy="0 0 1.5707963"/>'),
        ('xyz="0 0.080 0.023" rpy="-1.5707963 0 0"', 'xyz="-0.080 0 0.023" rpy="-1.5707963 0 1.5707963"'),
        ('xyz="0 -0.080 0.023" rpy="-1.5707963 0 0"', 'xyz="0.080 0 0.023" rpy="-1.5707963 0 1.5707963"'),
        ('xyz="-0.032 0 0.167"', 'xyz="0 -0.032 0.167"'),
    )
    assert import_urdf(path).spec.footprint.bounds == pytest.approx((-0.101, -0.089, 0.037, 0.089), abs=1e-4)


@pytest.mark.parametrize(
    ("inside", "says"),
    [
        ('<link name="${1/0}"/>', "division by zero when evaluating expression"),
        (
            '<a b="$(find nowhere)${1/0}"/>',
            "division by zero when evaluating expression '1/0'; Package not found: nowhere",
        ),
        ("<xacro:wheel/>", "unknown macro name: xacro:wheel"),
    ],
    ids=["expression", "package", "macro"],
)
def test_what_xacro_cannot_expand_is_refused_in_one_line(tmp_path, inside, says):
    path = tmp_path / "robot.xacro"
    path.write_text(f'<robot xmlns:xacro="http://www.ros.org/wiki/xacro" name="x">{inside}</robot>')
    with pytest.raises(InputError) as caught:
        import_urdf(path)
    message = str(caught.value)
    assert message.startswith(f"{path}: xacro cannot expand it: {says}")
    assert message.isprintable()
    assert message.count(says) == 1
    assert "\\n" not in message


def test_a_pipe_that_a_xacro_file_includes_is_refused(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    path = tmp_path / "robot.xacro"
    head = '<robot xmlns:xacro="http://www.ros.org/wiki/xacro" name="x">'
    for inside in (
        '<xacro:include filename="part"/>',
        "<xacro:property name='a' value=\"${xacro.load_yaml('part')}\"/>${a}",
    ):
        path.write_text(f"{head}{inside}</robot>")
        (tmp_path / "part").unlink(missing_ok=True)
        os.mkfifo(tmp_path / "part")
        with pytest.raises(InputError, match="part: is a pipe; give a xacro file"):
            import_urdf(path)


def test_xacro_takes_arguments_and_finds_packages_beside_the_file(tmp_path):
    text = (FIXTURES / "burger.urdf").read_text()
    top = '<robot xmlns:xacro="http://www.ros.org/wiki/xacro" name="$(arg name)">'
    body = text.partition("<robot")[2].partition(">")[2].partition("</robot>")[0]
    (tmp_path / "parts" / "urdf").mkdir(parents=True)
    (tmp_path / "parts" / "urdf" / "all.xacro").write_text(
        f'<robot xmlns:xacro="http://www.ros.org/wiki/xacro">{body}</robot>'
    )
    (tmp_path / "mine" / "urdf").mkdir(parents=True)
    path = tmp_path / "mine" / "urdf" / "mine.urdf.xacro"
    path.write_text(f'{top}<xacro:include filename="$(find parts)/urdf/all.xacro"/></robot>')
    with pytest.raises(InputError, match="Undefined substitution argument name; give it with --arg NAME=VALUE"):
        import_urdf(path)
    found = import_urdf(path, arguments={"name": "two"})
    assert found.spec.name == "two"
    (tmp_path / "parts").rename(tmp_path / "elsewhere")
    with pytest.raises(InputError, match="Package not found: parts; give its folder with --package parts=FOLDER"):
        import_urdf(path, arguments={"name": "two"})
    assert import_urdf(path, arguments={"name": "two"}, packages={"parts": tmp_path / "elsewhere"}).spec == found.spec
    with pytest.raises(InputError, match=r"--arg name: burger\.urdf is not a \.xacro file"):
        imported("burger.urdf", arguments={"name": "two"})


def test_an_unknown_argument_is_refused_with_those_that_exist(tmp_path):
    top = '<robot xmlns:xacro="http://www.ros.org/wiki/xacro" name="a">'
    names = '<xacro:arg name="body_width" default="1"/><xacro:arg name="prefix" default=""/>'
    body = (FIXTURES / "burger.urdf").read_text().partition("<robot")[2].partition(">")[2]
    path = tmp_path / "a.xacro"
    path.write_text(top + names + body)
    with pytest.raises(InputError, match=r"--arg body_widht: a.xacro has no such argument; did you mean body_width\?"):
        import_urdf(path, arguments={"body_widht": "2"})
    with pytest.raises(InputError, match=r"--arg x: a.xacro has no such argument; choose from body_width, prefix"):
        import_urdf(path, arguments={"x": "2"})
    assert import_urdf(path, arguments={"body_width": "2"}).spec.track == imported("burger.urdf").spec.track


def test_meshes_of_a_package_are_in_its_given_folder(tmp_path):
    (tmp_path / "elsewhere").mkdir()
    (tmp_path / "elsewhere" / "body.obj").write_text(
        "v -0.2 -0.2 0.1\nv 0.2 -0.2 0.1\nv 0.2 0.2 0.1\nv -0.2 0.2 0.1\nf 1 2 3\nf 1 3 4\n"
    )
    mesh = ('<box size="0.281 0.306 0.119"/>', '<mesh filename="package://waffle/body.obj"/>')
    path = changed(tmp_path, "waffle.urdf", mesh)
    found = import_urdf(path, packages={"waffle": tmp_path / "elsewhere"})
    assert found.spec.footprint.bounds == pytest.approx((-0.264, -0.2, 0.136, 0.2), abs=1e-4)


def stl(corners):
    """A binary STL file of triangles (N, 3, 3)."""
    layout = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
    triangles = np.zeros(len(corners), layout)
    triangles["corners"] = corners
    return bytes(80) + len(corners).to_bytes(4, "little") + triangles.tobytes()


def dae(x):
    return f"<COLLADA><library_geometries><float_array>0 0 0 1 {x} 0 1 1 0</float_array></library_geometries></COLLADA>"


@pytest.mark.parametrize("number", ["nan", "-NaN", "inf", "1e400", "-Infinity"])
def test_a_mesh_with_a_coordinate_that_is_not_finite_is_refused_by_name(tmp_path, number):
    corners = np.zeros((2, 3, 3))
    corners[1, 2, 0] = float(number)
    texts = {
        "binary.stl": stl(corners),
        "text.stl": f"solid inf\nfacet normal 0 0 1\nouter loop\nvertex 1 2 3\n  vertex 1 {number} 3\nendloop".encode(),
        "body.obj": f"# nan\nv 0 0 0\nv 1 0 0\nv {number} 0 0\nvn nan 0 0\nf 1 2 3\n".encode(),
        "body.dae": dae(number).encode(),
    }
    for name, content in texts.items():
        (tmp_path / name).write_bytes(content)
        path = changed(
            tmp_path, "waffle.urdf", ('<box size="0.281 0.306 0.119"/>', f'<mesh filename="file://{tmp_path}/{name}"/>')
        )
        with pytest.raises(InputError, match=f"{name}: 1 of its coordinates are not finite"):
            import_urdf(path)


def test_meshes_are_refused_before_they_are_read_if_they_are_too_large_or_no_meshes(tmp_path):
    path = tmp_path / "huge.stl"
    with path.open("wb") as file:
        file.write(bytes(80) + (10**7).to_bytes(4, "little"))
        file.truncate(84 + 50 * 10**7)
    with pytest.raises(InputError, match=r"huge.stl: is too large; the limit is 20 MB"):
        checked_mesh(path)
    wrong = {"a.stl": b"hello", "b.obj": b"v a b c\n", "c.dae": b"<a/>", "d.dae": dae("x").encode(), "e.obj": b""}
    for name, content in wrong.items():
        (tmp_path / name).write_bytes(content)
        with pytest.raises(InputError, match=rf"{name}: (has no vertices|not a mesh)"):
            checked_mesh(tmp_path / name)


@pytest.mark.parametrize("content", [stl(np.ones((2, 3, 3))), b"solid a\n vertex 1 2 3\n"])
def test_a_mesh_of_finite_numbers_is_handed_on_as_it_is(tmp_path, content):
    (tmp_path / "a.stl").write_bytes(content)
    assert checked_mesh(tmp_path / "a.stl") == content
