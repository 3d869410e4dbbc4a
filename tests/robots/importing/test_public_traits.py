"""Traits of public robots, re-made: what drives differentially is imported, and other robots are refused by what they are."""

import re

import pytest

from antdrive.base import InputError
from antdrive.robots.importing.urdf_import import import_urdf
from antdrive.robots.robot_file import robot_from_text
from tests.robots.importing.urdf_parts import LIMIT, box, joint, pair, robot, wheel

BASE = box("base")
PLUGIN = "<gazebo><plugin><leftJoint>left_wheel_joint</leftJoint><rightJoint>right_wheel_joint</rightJoint></plugin></gazebo>"
ARM = (
    box("upper", "0.5 0.06 0.06", "0.25 0 0")
    + joint("shoulder_pan", "turret", "0.2 0 0.6", "revolute", "0 0 1", more=LIMIT.format('lower="-1.6" upper="1.6"'))
    + box("turret", "0.1 0.1 0.1", "0 0 0")
    + joint("upperarm_roll", "upper", "0 0 0.1", axis="1 0 0", parent="turret")
)


def imported(tmp_path, *parts, name="made_up", **settings):
    path = tmp_path / "made_up.urdf"
    path.write_text(robot(*parts, name=name))
    return import_urdf(path, **settings)


def caster(name, x, y, kind="continuous", more=""):
    return (
        f'<link name="{name}_fork"/>'
        + joint(f"{name}_swivel", f"{name}_fork", f"{x} {y} 0.1", kind, "0 0 1", more=more)
        + wheel(f"{name}_wheel", -0.02, 0, 0.05, f"{name}_fork", z=-0.05)
    )


DIFFERENTIAL = {
    "casters that swivel": pair() + caster("left_caster", -0.2, 0.1) + caster("right_caster", -0.2, -0.1),
    "casters that swivel half a turn": pair()
    + caster("left_caster", -0.2, 0.1, "revolute", LIMIT.format('lower="-3.14159" upper="3.1416"')),
    "passive omni wheels in front": pair() + wheel("omni_left", 0.25, 0.22) + wheel("omni_right", 0.25, -0.22),
    "a suspension": '<link name="drop"/>'
    + joint("wheel_drop", "drop", "0 0 0", "prismatic", "0 0 1", more=LIMIT.format('upper="0.03"'))
    + pair(parent="drop"),
    "a rocker": '<link name="rocker"/>'
    + joint("rocker", "rocker", "0 0 0", "revolute", more=LIMIT.format('lower="-0.3" upper="0.3"'))
    + pair(0.2, "front_", parent="rocker")
    + pair(-0.2, "rear_"),
    "an arm": pair() + ARM,
    "flippers": pair()
    + "".join(
        f'<link name="flipper{y}"><collision><origin xyz="0.15 0 0"/><geometry><box size="0.3 0.04 0.06"/></geometry>'
        "</collision></link>" + joint(f"flipper{y}", f"flipper{y}", f"0.2 {y} 0.03")
        for y in (0.3, -0.3)
    ),
    "a spinning lidar and a head": pair()
    + wheel("spinner", 0, 0, 0.03, z=0.5)
    + box("head", "0.1 0.1 0.1", "0 0 0")
    + joint("head_pan", "head", "0 0 0.6", "revolute", "0 0 1", more=LIMIT.format('lower="-1" upper="1"')),
    "a fixed joint without direction": pair()
    + '<link name="estop"/>'
    + joint("estop_joint", "estop", "0 0 0.3", "fixed", "0 0 0"),
    "limits without limit": pair().replace(
        "</joint>",
        LIMIT.format('lower="-1e16" upper="1e16"').replace('"10"', '"inf"').replace('"5"', '"1e9"') + "</joint>",
    ),
    "an infrared sensor": pair()
    + '<gazebo><plugin name="ir_omni_plugin" filename="libgazebo_ros_create_ir_opcode.so"/></gazebo>',
    "wheels that are fixed to turning hubs": pair().replace("_wheel", "_hub").replace("collision>", "visual>")
    + "".join(
        f'<link name="{side}_tyre"><collision><origin rpy="1.5708 0 0"/><geometry><cylinder radius="0.1" length="0.05"/>'
        "</geometry></collision></link>" + joint(f"{side}_tyre", f"{side}_tyre", "0 0 0", "fixed", parent=f"{side}_hub")
        for side in ("left", "right")
    ),
    "wheels that are only drawn": pair().replace("collision>", "visual>"),
    "virtual joints of the whole": '<link name="odom"/>'
    + joint("theta", "base", "0 0 0", axis="0 0 1", parent="odom")
    + pair(),
}


@pytest.mark.parametrize("trait", DIFFERENTIAL)
def test_a_differential_drive_is_found_whatever_else_moves(tmp_path, trait):
    spec = imported(tmp_path, BASE, DIFFERENTIAL[trait]).spec
    assert (spec.track, spec.wheel_radius) == (pytest.approx(0.44), pytest.approx(0.1))


STEER = LIMIT.format('lower="-0.6" upper="0.6"')


def steered(name, x, y, how, kind="continuous", axis="0 0 1"):
    return (
        f'<link name="{name}_knuckle"/>'
        + joint(f"{name}_{how}", f"{name}_knuckle", f"{x} {y} 0.1", kind, axis, more=STEER if how == "hinge" else "")
        + wheel(f"{name}_wheel", 0, 0, parent=f"{name}_knuckle", z=0)
    )


def four(make):
    return "".join(
        make(f"{end}_{side}", x, y) for end, x in (("f", 0.2), ("r", -0.2)) for side, y in (("l", 0.22), ("r", -0.22))
    )


def chain(name, at, kind="revolute"):
    link = (
        '<link name="{0}"><collision><origin xyz="0 0 -0.1"/><geometry><cylinder radius="0.02" length="0.2"/></geometry>'
        "</collision></link>"
    )
    return (
        link.format(f"{name}_thigh")
        + joint(f"{name}_hip", f"{name}_thigh", at, kind, more=STEER)
        + link.format(f"{name}_shank")
        + joint(f"{name}_knee", f"{name}_shank", "0 0 -0.2", kind, parent=f"{name}_thigh", more=STEER)
    )


FRONT = {"left": 0.22, "right": -0.22}
OTHERS = {
    "Ackermann": (
        pair(-0.2, "rear_") + "".join(steered(s, 0.2, y, "hinge", "revolute") for s, y in FRONT.items()),
        "left_hinge, right_hinge steer wheels",
    ),
    "Ackermann with continuous joints": (
        pair(-0.2, "rear_") + "".join(steered(s, 0.2, y, "hinge") for s, y in FRONT.items()),
        "steer wheels",
    ),
    "Ackermann without limits or names": (
        pair(-0.2, "rear_") + "".join(steered(s, 0.2, y, "pin") for s, y in FRONT.items()),
        "left_pin, right_pin steer wheels",
    ),
    "a steered and driven front wheel": (
        pair(-0.2)
        + caster("front", 0.2, 0)
        + "<ros2_control><joint name='front_swivel'><command_interface name='position'/></joint></ros2_control>",
        "front_swivel steer wheels",
    ),
    "a front wheel on an unnamed swivel without trail": (
        pair(-0.2) + steered("front", 0.2, 0, "pin"),
        "front_pin steer wheels",
    ),
    "front wheels that steer and collide as spheres": (
        pair(-0.2, "rear_")
        + "".join(
            steered(s, 0.2, y, "pin").replace('cylinder radius="0.1" length="0.04"', 'sphere radius="0.1"')
            for s, y in FRONT.items()
        ),
        "left_pin, right_pin steer wheels",
    ),
    "small front wheels that steer": (
        pair(-0.2, "rear_") + "".join(steered(s, 0.2, y, "pin").replace("0.1", "0.06") for s, y in FRONT.items()),
        "left_pin, right_pin steer wheels",
    ),
    "wheels that steer but do not roll": (
        pair(-0.2, "rear_")
        + pair(0.2, "front_").replace("continuous", "revolute").replace('xyz="0 1 0"/>', 'xyz="0 0 1"/>' + STEER),
        "front_left_wheel_joint, front_right_wheel_joint steer wheels",
    ),
    "Ackermann by name, axes of a CAD export": (
        pair(-0.2, "rear_") + "".join(steered(s, 0.2, y, "steer", axis="0 1 0") for s, y in FRONT.items()),
        "left_steer, right_steer steer wheels",
    ),
    "four steered wheels": (
        four(lambda name, x, y: steered(name, x, y, "unit")),
        "steer all its wheels",
    ),
    "steered wheels without rolling joints": (
        "".join(
            f'<link name="l{x}{y}"/>' + joint(f"j{x}{y}", f"l{x}{y}", f"{x} {y} 0.1", axis="0 0 1")
            for x in (0.2, -0.2)
            for y in (0.2, -0.2)
        ),
        "turn about upright axes, and no wheel about a level one: steered wheels",
    ),
    "a drive below its body": (
        '<link name="roll"/>' + joint("base_roll", "roll", "0 0 0", axis="0 0 1") + pair(parent="roll"),
        "steer all its wheels",
    ),
    "mecanum meshes": (
        four(lambda name, x, y: wheel(name, x, y, mesh="package://a/meshes/mecanum_a.dae")),
        "omni or mecanum wheels",
    ),
    "omni wheels by name": (four(lambda name, x, y: wheel(f"{name}_omni_wheel", x, y)), "omni or mecanum wheels"),
    "rollers": (
        pair()
        + "".join(
            f'<link name="r{k}"/>' + joint(f"roller_{k}", f"r{k}", "0 0 0", axis="1 1 0", parent="left_wheel")
            for k in range(3)
        ),
        "its wheels have 3 rollers, such as roller_0: omni or mecanum wheels",
    ),
    "three wheels at 120 degrees": (
        wheel("a_wheel", 0.2, 0)
        + re.sub('axis xyz="0 1 0"', 'axis xyz="0.866 0.5 0"', wheel("b_wheel", -0.1, 0.17))
        + re.sub('axis xyz="0 1 0"', 'axis xyz="0.866 -0.5 0"', wheel("c_wheel", -0.1, -0.17)),
        "wheels point in different directions",
    ),
    "four omni wheels in a cross": (
        pair()
        + re.sub(
            'axis xyz="0 1 0"',
            'axis xyz="1 0 0"',
            wheel("ahead", 0.22, 0, shape="sphere") + wheel("behind", -0.22, 0, shape="sphere"),
        ),
        "its 4 wheels point in different directions",
    ),
    "planar move": (
        pair() + '<gazebo><plugin name="m" filename="libgazebo_ros_planar_move.so"/></gazebo>',
        "an omnidirectional drive",
    ),
    "force based move": (
        four(wheel) + '<gazebo><plugin name="m" filename="libridgeback_ros_force_based_move.so"/></gazebo>',
        "an omnidirectional drive",
    ),
    "omni drive plugin": (
        pair() + '<gazebo><plugin name="omni_drive" filename="liba.so"/></gazebo>',
        "an omnidirectional drive",
    ),
    "legs": (four(lambda name, x, y: chain(name, f"{x} {y} 0.4")), "it has 4 legs"),
    "legs without a leg's names": (
        four(
            lambda name, x, y: (
                chain(name, f"{x} {y} 0.4")
                .replace("hip", "a")
                .replace("knee", "b")
                .replace("shank", "c")
                .replace("thigh", "d")
            )
        ),
        "it has 4 legs",
    ),
    "wheels on legs": (
        four(lambda name, x, y: chain(name, f"{x} {y} 0.4") + wheel(f"{name}w", 0, 0, parent=f"{name}_shank", z=-0.3)),
        "it has 4 legs",
    ),
    "legs without geometry": (
        "".join(
            f'<link name="a{y}"/><link name="b{y}"/>'
            + joint(f"pan{y}", f"a{y}", f"0 {y} 0", "revolute", "0 0 1", more=STEER)
            + joint(f"tilt{y}", f"b{y}", "0.1 0 0", "revolute", parent=f"a{y}", more=STEER)
            for y in range(6)
        ),
        "it has 6 arms or legs (pan0, pan1, pan2, pan3 and 2 more)",
    ),
    "legs of continuous joints": (four(lambda name, x, y: chain(name, f"{x} {y} 0.4", "continuous")), "it has 4 legs"),
    "arm": (chain("arm", "0 0 0.6"), "it is an arm (arm_hip, arm_knee in a row)"),
    "drone of fixed propellers": (
        four(lambda name, x, y: f'<link name="prop_{name}"/>' + joint(name, f"prop_{name}", f"{x} {y} 0.3", "fixed")),
        "are propellers",
    ),
    "drone": (
        four(
            lambda name, x, y: (
                f'<link name="rotor_{name}"/>' + joint(f"{name}_joint", f"rotor_{name}", f"{x} {y} 0.3", axis="0 0 1")
            )
        ),
        "are propellers",
    ),
    "trailer": (
        pair()
        + '<link name="bar"/>'
        + joint("hitch", "bar", "-0.3 0 0.1", axis="0 0 1")
        + pair(-0.3, "trailer_", parent="bar", z=0),
        "hitch joins a second body with its own wheels",
    ),
    "trailer on a limited hitch": (
        pair()
        + '<link name="bar"/>'
        + joint("hitch", "bar", "-0.3 0 0.1", "revolute", "0 0 1", more=STEER)
        + pair(-0.3, "trailer_", parent="bar", z=0),
        "hitch joins a second body with its own wheels",
    ),
    "bicycle": (
        wheel("front_wheel", 0.3, 0) + wheel("rear_wheel", -0.3, 0),
        "all of its 2 wheels (front_wheel_joint, rear_wheel_joint) are one behind the other, as on a bicycle",
    ),
    "display only": (
        pair().replace("continuous", "fixed"),
        "none of its joints moves, so the file is for display",
    ),
    "tracks": (
        '<link name="left_track"/>' + joint("t", "left_track", "0 0 0", "prismatic"),
        "it has tracks (t) and no wheels",
    ),
}


@pytest.mark.parametrize("kind", OTHERS)
def test_another_robot_is_refused_by_what_it_is(tmp_path, kind):
    parts, says = OTHERS[kind]
    base = BASE if not kind.startswith("legs") else box("base", at="0 0 0.5")
    with pytest.raises(InputError, match=re.escape(says)) as caught:
        imported(tmp_path, base, parts)
    assert str(caught.value).isprintable()


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (('type="continuous"', 'type="fixed"'), "left_wheel_joint: fixed, so the file is for display only"),
        (('<axis xyz="0 1 0"/>', ""), 'left_wheel_joint has no <axis>, .* give both wheels <axis xyz="0 1 0"/>'),
        (('type="continuous"', 'type="revolute"'), "left_wheel_joint: revolute, with a range of 0 rad"),
    ],
)
def test_a_fault_of_the_named_wheels_is_named(tmp_path, change, says):
    with pytest.raises(InputError, match=says):
        imported(tmp_path, BASE, pair().replace(*change), PLUGIN)


def test_wheels_without_axes_are_named_though_nothing_calls_them_driven(tmp_path):
    with pytest.raises(InputError, match=r"left_wheel_joint has no <axis>, .* give both wheels"):
        imported(tmp_path, BASE, pair().replace('<axis xyz="0 1 0"/>', ""))


def test_the_noted_remedy_for_swapped_sides_of_a_plugin_works(tmp_path):
    swapped = PLUGIN.replace("left_wheel", "a").replace("right_wheel", "b")
    parts = BASE, wheel("a", 0, -0.22), wheel("b", 0, 0.22), swapped
    note = next(note for note in imported(tmp_path, *parts).notes if "face backwards" in note)
    left, right = re.search(r"--left (\w+) --right (\w+)", note).groups()
    assert any("faces the file's -x axis" in note for note in imported(tmp_path, *parts, left=left, right=right).notes)


def test_left_is_left_by_position_and_swapped_names_are_refused_with_the_command(tmp_path):
    wheels = wheel("a", 0, 0.22) + wheel("b", 0, -0.22)
    with pytest.raises(InputError, match="write --left a_joint --right b_joint"):
        imported(tmp_path, BASE, wheels, left="b", right="a")
    swapped = wheel("right_wheel", 0, 0.22) + wheel("left_wheel", 0, -0.22)
    base = box("base", at="0.1 0 0.2")
    found = imported(tmp_path, base, swapped)
    assert found.spec.footprint.bounds[2] == pytest.approx(0.4, abs=1e-4)
    assert found.notes[0].startswith(
        "right_wheel_joint is on the left of the file's x axis, although named for the right: --left left_"
    )
    back = imported(tmp_path, base, swapped, left="left_wheel", right="right_wheel")
    assert back.spec.footprint.bounds[2] == pytest.approx(0.2, abs=1e-4)
    assert "the robot faces the file's -x axis" in back.notes[0]


def test_axles_with_unlike_wheels_are_asked_for_left_first(tmp_path):
    parts = (
        wheel("b", 0.2, -0.22) + wheel("a", 0.2, 0.22) + wheel("d", -0.2, -0.22, 0.08) + wheel("c", -0.2, 0.22, 0.08)
    )
    with pytest.raises(InputError, match=r"2 axles with unlike wheels .* --left a_joint --right b_joint"):
        imported(tmp_path, BASE, parts)


def test_a_skid_steer_robot_has_the_torque_of_all_motors(tmp_path):
    motors = (pair(0.2, "front_") + pair(-0.2, "rear_")).replace("</joint>", LIMIT.format("") + "</joint>")
    spec = imported(tmp_path, BASE, motors).spec
    assert (spec.wheel_torque, spec.max_wheel_speed) == (10.0, 10.0)
    assert spec.footprint.bounds == pytest.approx((-0.3, -0.24, 0.3, 0.24), abs=1e-4)


def test_an_arm_in_the_footprint_is_noted_and_the_noted_height_leaves_it_out(tmp_path):
    found = imported(tmp_path, BASE, pair(), ARM)
    note = next(note for note in found.notes if "widen" in note)
    assert note.startswith("links on moving joints (upper) widen the footprint's radius from 0.361 m to 0.701 m")
    below = float(re.search(r"--below ([\d.]+)", note)[1])
    without = imported(tmp_path, BASE, pair(), ARM, below=below)
    assert without.spec.radius == imported(tmp_path, BASE, pair()).spec.radius
    assert not any("widen" in note for note in without.notes)


def test_the_sphere_of_a_wheel_does_not_widen_the_outline(tmp_path):
    spheres = wheel("l", 0, 0.22, shape="sphere") + wheel("r", 0, -0.22, shape="sphere")
    assumed = imported(tmp_path, BASE, spheres)
    assert assumed.spec.footprint.bounds[3] == pytest.approx(0.23)
    assert "wheels from the sphere of link l; width assumed: 0.02 m" in assumed.notes
    drawn = '<visual><origin rpy="1.5708 0 0"/><geometry><cylinder radius="0.1" length="0.05"/></geometry></visual><collision>'
    seen = imported(tmp_path, BASE, spheres.replace("<collision>", drawn))
    assert seen.spec.footprint.bounds[3] == pytest.approx(0.245, abs=1e-4)


def test_implausible_values_are_noted_unless_they_are_given(tmp_path):
    fast = PLUGIN.replace("</plugin>", "<max_linear_velocity>9</max_linear_velocity></plugin>")
    light = box("base").replace('value="10"', 'value="0.1"')
    notes = imported(
        tmp_path, light, pair(), box("boom", "3 0.1 0.1", "0 0 0.2"), joint("b", "boom", "0 0 0", "fixed"), fast
    ).notes
    assert [note.split(" looks implausible")[0] for note in notes] == ["max_speed 9 m/s", "the footprint, 3 m long,"]
    notes = imported(tmp_path, light, pair(), fast, given={"max_speed": 9.0}).notes
    assert [note.split(" looks implausible")[0] for note in notes] == ["mass 0.1 kg"]


def test_what_is_written_can_be_read_whatever_its_digits(tmp_path):
    bumper = (
        '<link name="rim"><collision><geometry><cylinder radius="0.4" length="0.05"/></geometry></collision></link>'
    )
    found = imported(
        tmp_path, BASE, pair(), bumper, joint("rim", "rim", "0.00002 0.00002 0.1", "fixed"), footprint="polygon"
    )
    assert robot_from_text(found.text, "a", "a") == found.spec
    assert "e-05" not in found.text


def test_a_body_without_collision_geometry_is_refused_or_noted(tmp_path):
    drawn = box("base").replace("collision>", "visual>")
    with pytest.raises(InputError, match="has no collision geometry other than its wheels, so no footprint"):
        imported(tmp_path, drawn, pair(0.2, "front_"), pair(-0.2, "rear_"))
    found = imported(
        tmp_path, drawn, pair(), box("mast", "0.1 0.1 0.4", "0 0 0"), joint("mast", "mast", "0 0 0.4", "fixed")
    )
    assert any(
        "the footprint is no longer than the wheels; if the body's <collision> is missing" in note
        for note in found.notes
    )


def test_a_robot_that_is_only_drawn_has_its_drawn_shape(tmp_path):
    solid, drawn = (
        imported(tmp_path, BASE.replace("collision", tag), pair().replace("collision", tag))
        for tag in ("collision", "visual")
    )
    assert drawn.spec == solid.spec
    assert "the file has no collision geometry: the drawn one counts" in drawn.notes


def test_a_moving_joint_without_direction_does_not_hide_another_drive(tmp_path):
    rollers = "".join(
        f'<link name="r{k}"/>' + joint(f"roller_{k}", f"r{k}", "0 0 0", axis="0 0 0", parent="left_wheel")
        for k in range(9)
    )
    with pytest.raises(InputError, match="mecanum"):
        imported(tmp_path, BASE, pair(), rollers, name="mecanum_base")
