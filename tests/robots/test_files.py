import dataclasses
import json
import math
from pathlib import Path

import pytest

from antdrive.base import InputError
from antdrive.robots import Footprint, RobotSpec, list_robots, load_robot, robot_schema, robot_to_dict
from antdrive.robots.files import footprint_to_dict
from antdrive.sim import Engine
from antdrive.sim.log.binding import canonical_hash
from antdrive.worlds import World

GOOD = """\
schema: 1
footprint: {radius: 0.2}
height: 0.3
mass: 5.0
wheel_radius: 0.04
track: 0.25
max_speed: 1
max_yaw_rate: 3.0
max_acceleration: 1.0
max_yaw_acceleration: 8.0
max_lateral_acceleration: 1.0
max_wheel_speed: 40.0
wheel_torque: 2.0
"""


def test_catalogue_robots_load() -> None:
    assert set(list_robots()) >= {"turtlebot", "jackal"}
    jackal = load_robot("jackal")
    assert jackal.radius == pytest.approx(0.333, abs=1e-3)
    assert jackal.max_speed == 2.0
    assert load_robot("turtlebot").footprint.is_disc


def test_a_robot_is_described_by_one_file(tmp_path: Path) -> None:
    path = tmp_path / "mine.yaml"
    path.write_text(GOOD)
    mine = load_robot(path)
    assert (mine.name, mine.radius, mine.max_speed) == ("mine", 0.2, 1.0)


@pytest.mark.parametrize(
    ("entry", "footprint"),
    [
        ("{radius: 0.2, centre: [0.05, -0.01]}", Footprint.disc(0.2, (0.05, -0.01))),
        ("{radius: 0.2, centre: [0, 0]}", Footprint.disc(0.2)),
        ("{length: 0.9, width: 0.6, centre: [0.15, 0.0]}", Footprint.rectangle(0.9, 0.6, (0.15, 0.0))),
        (
            "{polygon: [[0.4, 0], [-0.2, 0.4], [-0.2, -0.4]]}",
            Footprint(corners=((0.4, 0.0), (-0.2, 0.4), (-0.2, -0.4))),
        ),
    ],
)
def test_a_footprint_need_not_be_centred_on_the_axle(tmp_path: Path, entry: str, footprint: Footprint) -> None:
    path = tmp_path / "mine.yaml"
    path.write_text(GOOD.replace("{radius: 0.2}", entry))
    mine = load_robot(path)
    assert mine.footprint == footprint
    path.write_text(GOOD.replace("{radius: 0.2}", json.dumps(footprint_to_dict(footprint))))
    assert load_robot(path) == mine, "what is written of it is read as the same"


def test_robots_without_corners_and_lidar_are_recorded_as_they_always_were() -> None:
    """Their logs and hashes stay the same, bit for bit."""
    jackal, turtlebot = (dataclasses.replace(load_robot(name), lidar=None) for name in ("jackal", "turtlebot"))
    assert canonical_hash(jackal) == "8b9a050572644a9fa8fa254c229c73dd56e9a5dfaf8124b543ecbd96a284d8c2"
    assert canonical_hash(turtlebot) == "6015e6951db89082ddc290423b7db58efc1c599cf120244d54e904d6f4220f5f"
    assert robot_to_dict(load_robot("jackal"))["footprint"] == {
        "half_length": 0.254,
        "half_width": 0.215,
        "rounding": 0.0,
    }
    corners = robot_to_dict(load_robot("warehouse"))["footprint"]["corners"]
    assert corners == ((0.6, -0.3), (0.6, 0.3), (-0.3, 0.3), (-0.3, -0.3))


@pytest.mark.parametrize(
    ("old", "new", "expected"),
    [
        ("mass: 5.0", "mass: -5.0", "mass: must be at least 0.01, got -5.0"),
        ("mass: 5.0", "mass: heavy", "mass: must be a number"),
        ("mass: 5.0\n", "", "mass: missing"),
        ("mass: 5.0", "mas: 5.0", "mas: unknown key; did you mean mass?"),
        ("{radius: 0.2}", "{radius: 0.2, length: 1.0}", "footprint: write {radius: 0.18}"),
        ("{radius: 0.2}", "{length: 1.0}", "footprint: write {radius: 0.18}"),
        ("track: 0.25", "track: 0.55", "track: wheels of 0.04 m, 0.55 m apart, stand outside the footprint"),
        ("wheel_radius: 0.04", "wheel_radius: 0.4", "track: wheels of 0.4 m"),
        ("{radius: 0.2}", "{length: 0.6, width: 0.2}", "track: wheels 0.25 m apart stand outside the footprint"),
        ("{radius: 0.2}", "{length: 0.06, width: 0.3}", "wheel_radius: wheels of 0.04 m stand outside the footprint"),
        ("{radius: 0.2}", "{polygon: [[0.2, 0.2], [0.2, -0.2]]}", "footprint.polygon: must be three points or more"),
        (
            "{radius: 0.2}",
            "{polygon: [[0.3, -0.2], [0.3, 0.2], [0.0, 0.05], [-0.3, 0.2], [-0.3, -0.2]]}",
            "footprint.polygon: must be a convex polygon; it turns inwards at (0, 0.05)",
        ),
        ("{radius: 0.2}", "{radius: 0.2, polygon: [[1, 0], [0, 1], [-1, -1]]}", "footprint: write {radius: 0.18}"),
        ("{radius: 0.2}", "{centre: [0.1, 0.0]}", "footprint: write {radius: 0.18}"),
        ("{radius: 0.2}", "{radius: 0.2, centre: [0.1]}", "footprint.centre: must have 2 entries"),
        (
            "{radius: 0.2}",
            "{length: 0.5, width: 0.4, centre: [0.23, 0.0]}",
            "footprint: wheels of 0.04 m, 0.25 m apart, stand",
        ),
        ("max_speed: 1", "max_speed: .inf", "max_speed: must be"),
        ("max_speed: 1", "max_speed: 0.0024", "max_speed: must be at least 0.05, got 0.0024"),
        ("max_speed: 1", "max_speed: 30", "max_speed: must be at most 10, got 30"),
        ("mass: 5.0", "mass: 1.0e-300", "mass: must be at least 0.01, got 1.0e-300"),
        ("height: 0.3", "height: 1.0e-300", "height: must be at least 0.01, got 1.0e-300"),
        ("{radius: 0.2}", "{radius: 0.005}", "footprint: must be between 0.02 and 20, got 0.01"),
        ("{radius: 0.2}", "{length: 0.6, width: 0.252}", "track: wheels 0.25 m apart have their middles 0.001 m from"),
        ("height: 0.3", "height: 0.05", "wheel_radius: wheels of 0.04 m are higher than the body of 0.05 m"),
        (
            "max_wheel_speed: 40.0",
            "max_wheel_speed: 20.0",
            "max_wheel_speed: 20 rad/s on a robot of 5 kg with wheels of 0.04 m, 0.25 m apart, reach 0.8 m/s at most, "
            "but max_speed is 1; raise max_wheel_speed or lower max_speed",
        ),
        ("max_yaw_rate: 3.0", "max_yaw_rate: 13.0", "reach 12.8 rad/s at most, but max_yaw_rate is 13"),
        ("wheel_torque: 2.0", "wheel_torque: 0.09", "reach 0.9 m/s2 at most, but max_acceleration is 1"),
        ("mass: 5.0", "mass: 20000.0", "reach 0.005 m/s2 at most, but max_acceleration is 1"),
        ("max_yaw_acceleration: 8.0", "max_yaw_acceleration: 93.0", "reach 92 rad/s2 at most, but"),
        ("wheel_torque: 2.0", "wheel_torque: 2.0\nwheel_friction: 0.1", "wheel_friction: a friction of 0.1 on a robot"),
        ("schema: 1", 'schema: 1\nname: "a\\0b"', "name: must be one line of printable characters"),
        ("schema: 1", 'schema: 1\nname: "a\\nb"', "name: must be one line of printable characters"),
        ("schema: 1", 'schema: 1\nname: "\\e[2J"', "name: must be one line of printable characters"),
        ("schema: 1", "schema: 9", "schema: must be 1, got 9"),
    ],
)
def test_an_error_is_one_line_that_names_the_file_and_the_key(
    tmp_path: Path, old: str, new: str, expected: str
) -> None:
    path = tmp_path / "mine.yaml"
    assert old in GOOD
    path.write_text(GOOD.replace(old, new))
    with pytest.raises(InputError) as caught:
        load_robot(path)
    message = str(caught.value)
    assert str(path) in message
    assert expected in message
    assert "\n" not in message


def test_a_heavy_robot_whose_motors_are_too_weak_is_refused(tmp_path: Path) -> None:
    """20 t and 8 rad/s2, with motors for 0.55: it would oscillate and never arrive."""
    path = tmp_path / "truck.yaml"
    path.write_text(
        GOOD.replace("{radius: 0.2}", "{length: 6.0, width: 2.5}")
        .replace("height: 0.3", "height: 3.0")
        .replace("mass: 5.0", "mass: 2.0e+4")
        .replace("track: 0.25", "track: 2.0")
        .replace("wheel_radius: 0.04", "wheel_radius: 0.5")
        .replace("wheel_torque: 2.0", "wheel_torque: 1.0e+4")
    )
    with pytest.raises(
        InputError, match=r"reach 0\.568 rad/s2 at most, but max_yaw_acceleration is 8; raise wheel_torque"
    ):
        load_robot(path)


def test_the_promised_accelerations_are_reached_in_physics(tmp_path: Path) -> None:
    """A robot whose motors can just do what it promises does so in physics; closed form and PyBullet agree."""
    path = tmp_path / "mine.yaml"
    path.write_text(
        GOOD.replace("wheel_torque: 2.0", "wheel_torque: 0.1001").replace(
            "max_yaw_acceleration: 8.0", "max_yaw_acceleration: 6.2"
        )
    )
    robot = load_robot(path)
    for twist, rate, reached in (((1.0, 0.0), "speed", 1.0), ((0.0, 3.0), "yaw_rate", 6.25)):
        with Engine(World("open", (-5, -5, 5, 5)), robot) as engine:
            engine.place((0, 0, 0))
            engine.command(*twist)
            for _ in range(60):
                engine.step()
            assert getattr(engine.state(), rate) * 4 == pytest.approx(reached, rel=0.1)


def test_the_files_name_is_made_printable_where_it_names_the_robot(tmp_path: Path) -> None:
    path = tmp_path / "a\nb.yaml"
    path.write_text(GOOD)
    assert load_robot(path).name == "ab"


def test_an_unknown_name_suggests_a_robot_of_the_catalogue() -> None:
    with pytest.raises(InputError, match="did you mean jackal"):
        load_robot("jackel")


def test_the_schema_requires_what_the_file_requires() -> None:
    schema = robot_schema()
    assert set(schema["required"]) >= {"schema", "footprint", "mass", "track"}
    assert "name" not in schema["required"]


@pytest.mark.parametrize(
    ("key", "value", "says"),
    [
        ("max_speed", 0.0025, "max_speed: must be between 0.05 and 10, got 0.0025"),
        ("max_speed", math.nan, "max_speed: must be greater than 0, got nan"),
        ("wheel_friction", 0.01, "wheel_friction: must be between 0.1 and 100, got 0.01"),
        ("wheel_torque", 1e7, r"wheel_torque: must be between 1e-06 and 1e\+06, got 1e\+07"),
    ],
)
def test_robots_that_antdrive_is_not_meant_for_cannot_be_made_in_python_either(
    jackal: RobotSpec, key: str, value: float, says: str
) -> None:
    with pytest.raises(ValueError, match=says):
        dataclasses.replace(jackal, **{key: value})


@pytest.mark.parametrize("name", ["mine.urdf", "mine.urdf.xacro"])
def test_a_urdf_file_is_no_robot_file_and_the_message_says_what_makes_one_of_it(tmp_path: Path, name: str) -> None:
    path = tmp_path / name
    path.write_text("<robot/>")
    with pytest.raises(InputError) as caught:
        load_robot(path)
    assert str(caught.value) == f"{path}: is no robot file; make one of it with antdrive robots import {path}"
