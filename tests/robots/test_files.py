from pathlib import Path

import pytest

from antdrive.robots import list_robots, load_robot, robot_schema
from antdrive.worlds import InputError

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
    ("old", "new", "expected"),
    [
        ("mass: 5.0", "mass: -5.0", "mass: must be greater than 0, got -5.0"),
        ("mass: 5.0", "mass: heavy", "mass: must be a number"),
        ("mass: 5.0\n", "", "mass: missing"),
        ("mass: 5.0", "mas: 5.0", "mas: unknown key; did you mean mass?"),
        ("{radius: 0.2}", "{radius: 0.2, length: 1.0}", "footprint: write {radius: 0.18}"),
        ("{radius: 0.2}", "{length: 1.0}", "footprint: write {radius: 0.18}"),
        ("track: 0.25", "track: 0.55", "track: wheels of 0.04 m, 0.55 m apart, stand outside the footprint"),
        ("wheel_radius: 0.04", "wheel_radius: 0.4", "track: wheels of 0.4 m"),
        ("{radius: 0.2}", "{length: 0.6, width: 0.2}", "track: wheels 0.25 m apart stand outside the footprint"),
        ("{radius: 0.2}", "{length: 0.06, width: 0.3}", "wheel_radius: wheels of 0.04 m stand outside the footprint"),
        ("max_speed: 1", "max_speed: .inf", "max_speed: must be"),
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


def test_an_unknown_name_suggests_a_robot_of_the_catalogue() -> None:
    with pytest.raises(InputError, match="did you mean jackal"):
        load_robot("jackel")


def test_the_schema_requires_what_the_file_requires() -> None:
    schema = robot_schema()
    assert set(schema["required"]) >= {"schema", "footprint", "mass", "track"}
    assert "name" not in schema["required"]
