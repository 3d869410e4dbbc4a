import dataclasses
import json

import pytest

from antdrive.robots import Footprint, load_robot, robot_schema, robot_to_dict
from antdrive.robots.robot_file import footprint_to_dict
from antdrive.sim import Engine
from antdrive.sim.log.record import canonical_hash
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


def test_a_robot_is_described_by_one_file(tmp_path):
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
def test_a_footprint_need_not_be_centred_on_the_axle(tmp_path, entry, footprint):
    path = tmp_path / "mine.yaml"
    path.write_text(GOOD.replace("{radius: 0.2}", entry))
    mine = load_robot(path)
    assert mine.footprint == footprint
    path.write_text(GOOD.replace("{radius: 0.2}", json.dumps(footprint_to_dict(footprint))))
    assert load_robot(path) == mine, "what is written of it is read as the same"


def test_robots_without_corners_and_lidar_are_recorded_as_they_always_were():
    """Their logs and hashes stay the same, bit for bit."""
    jackal, turtlebot = (dataclasses.replace(load_robot(name), lidar=None) for name in ("jackal", "turtlebot"))
    assert canonical_hash(jackal) == "8b9a050572644a9fa8fa254c229c73dd56e9a5dfaf8124b543ecbd96a284d8c2"
    assert canonical_hash(turtlebot) == "6015e6951db89082ddc290423b7db58efc1c599cf120244d54e904d6f4220f5f"
    assert "lidar" not in robot_to_dict(turtlebot)
    assert canonical_hash(load_robot("turtlebot")) != canonical_hash(turtlebot)
    assert robot_to_dict(load_robot("jackal"))["footprint"] == {
        "half_length": 0.254,
        "half_width": 0.215,
        "rounding": 0.0,
    }
    corners = robot_to_dict(load_robot("warehouse"))["footprint"]["corners"]
    assert corners == ((0.6, -0.3), (0.6, 0.3), (-0.3, 0.3), (-0.3, -0.3))


#: Changes that make a robot's file wrong, in one way each.
WRONG = (
    ("mass: 5.0", "mass: -5.0"), ("mass: 5.0", "mass: heavy"), ("mass: 5.0\n", ""), ("mass: 5.0", "mas: 5.0"),
    ("{radius: 0.2}", "{radius: 0.2, length: 1.0}"), ("{radius: 0.2}", "{length: 1.0}"), ("track: 0.25", "track: 0.55"),
    ("wheel_radius: 0.04", "wheel_radius: 0.4"), ("{radius: 0.2}", "{length: 0.6, width: 0.2}"),
    ("{radius: 0.2}", "{length: 0.06, width: 0.3}"), ("{radius: 0.2}", "{polygon: [[0.2, 0.2], [0.2, -0.2]]}"),
    ("{radius: 0.2}", "{polygon: [[0.3, -0.2], [0.3, 0.2], [0.0, 0.05], [-0.3, 0.2], [-0.3, -0.2]]}"),
    ("{radius: 0.2}", "{radius: 0.2, polygon: [[1, 0], [0, 1], [-1, -1]]}"), ("{radius: 0.2}", "{centre: [0.1, 0.0]}"),
    ("{radius: 0.2}", "{radius: 0.2, centre: [0.1]}"),
    ("{radius: 0.2}", "{length: 0.5, width: 0.4, centre: [0.23, 0.0]}"), ("max_speed: 1", "max_speed: .inf"),
    ("max_speed: 1", "max_speed: 0.0024"), ("max_speed: 1", "max_speed: 30"), ("mass: 5.0", "mass: 1.0e-300"),
    ("height: 0.3", "height: 1.0e-300"), ("{radius: 0.2}", "{radius: 0.005}"),
    ("{radius: 0.2}", "{length: 0.6, width: 0.252}"), ("height: 0.3", "height: 0.05"),
    ("max_wheel_speed: 40.0", "max_wheel_speed: 20.0"), ("max_yaw_rate: 3.0", "max_yaw_rate: 13.0"),
    ("wheel_torque: 2.0", "wheel_torque: 0.09"), ("mass: 5.0", "mass: 20000.0"),
    ("max_yaw_acceleration: 8.0", "max_yaw_acceleration: 93.0"),
    ("wheel_torque: 2.0", "wheel_torque: 2.0\nwheel_friction: 0.1"), ("schema: 1", 'schema: 1\nname: "a\\0b"'),
    ("schema: 1", 'schema: 1\nname: "a\\nb"'), ("schema: 1", 'schema: 1\nname: "\\e[2J"'), ("schema: 1", "schema: 9"),
)  # fmt: skip


def test_the_promised_accelerations_are_reached_in_physics(tmp_path):
    """A robot whose motors just reach its limits reaches them in physics; closed form and PyBullet agree."""
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


def test_the_files_name_is_made_printable_where_it_names_the_robot(tmp_path):
    path = tmp_path / "a\nb.yaml"
    path.write_text(GOOD)
    assert load_robot(path).name == "ab"


def test_the_schema_requires_what_the_file_requires():
    schema = robot_schema()
    assert set(schema["required"]) >= {"schema", "footprint", "mass", "track"}
    assert "name" not in schema["required"]
