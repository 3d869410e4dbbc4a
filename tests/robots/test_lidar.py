"""The lidar in robot files, and what a robot without one keeps: its record and its hash."""

import json
import math
from pathlib import Path

import pytest
import yaml

from antdrive.base import InputError
from antdrive.robots import Lidar, Odometry, RobotSpec, load_robot, robot_to_dict
from antdrive.robots.files import robot_schema
from antdrive.sim import Run
from antdrive.sim.log.binding import canonical_hash
from antdrive.sim.log.record import DriveRecord

CATALOG = Path(__file__).parent.parent.parent / "robots" / "catalog"
LIDAR = {"beams": 181, "field_of_view": 3.0, "min_range": 0.1, "max_range": 5.0, "rate": 10.0}


def changed(tmp_path: Path, **lidar: object) -> RobotSpec:
    values = yaml.safe_load((CATALOG / "turtlebot.yaml").read_text())
    values["lidar"] = {**LIDAR, **lidar}
    path = tmp_path / "mine.yaml"
    path.write_text(yaml.safe_dump(values))
    return load_robot(path)


def test_jackal_carries_the_challenges_sensor(jackal: RobotSpec) -> None:
    lidar = jackal.lidar
    assert lidar is not None
    assert (lidar.beams, lidar.rate, lidar.min_range, lidar.max_range) == (720, 50.0, 0.1, 30.0)
    assert math.degrees(lidar.spacing) == pytest.approx(0.3755, abs=1e-4)
    assert math.degrees(lidar.angles[-1]) == pytest.approx(135, abs=1e-3)
    assert lidar.angles[0] == -lidar.angles[-1]


def test_turtlebot_sees_all_around(turtlebot: RobotSpec) -> None:
    lidar = turtlebot.lidar
    assert lidar is not None
    assert lidar.full_circle
    assert math.degrees(lidar.spacing) == pytest.approx(1.0, abs=1e-6)
    assert lidar.angles[0] == -math.pi
    assert lidar.angles[-1] == pytest.approx(math.pi - lidar.spacing)


@pytest.mark.parametrize(("rate", "hz", "taken"), [(1000.0, 60, 60), (50.0, 60, 50), (60.0, 60, 60), (90.0, 30, 30)])
def test_a_robot_takes_one_scan_in_a_control_period_at_most(tmp_path: Path, rate: float, hz: int, taken: int) -> None:
    lidar = changed(tmp_path, rate=rate).lidar
    assert lidar is not None
    assert lidar.at(hz).rate == taken
    due = [lidar.due(tick, hz) for tick in range(10 * hz)]
    assert due == [lidar.at(hz).due(tick, hz) for tick in range(10 * hz)]
    assert sum(due) == pytest.approx(10 * taken, abs=1)


def test_a_file_places_the_lidar(tmp_path: Path) -> None:
    lidar = changed(tmp_path, x=0.1, yaw=0.5).lidar
    assert lidar is not None
    assert lidar.pose_on((1.0, 2.0, math.pi / 2)) == pytest.approx((1.0, 2.1, math.pi / 2 + 0.5))


@pytest.mark.parametrize(
    ("wrong", "expected"),
    [
        ({"beams": 2}, "lidar.beams: must be at least 3, got 2"),
        ({"beams": 3.5}, "lidar.beams: must be a whole number"),
        ({"max_range": -1.0}, "lidar.max_range: must be at least 0.1, got -1.0"),
        ({"min_range": 5.0}, "lidar.min_range: must be below max_range, 5, got 5"),
        ({"field_of_view": 360.0}, "lidar.field_of_view: must be at most 6.28"),
        ({"range": 3.0}, "lidar.range: unknown key"),
        ({"rate": None}, "lidar.rate: must be a number"),
        ({"x": 20.0}, "lidar.x: the lidar at (20, 0) is 19.8 m outside the footprint; it must be on the robot"),
        ({"x": 0.1, "y": -0.2}, "lidar.y: the lidar at (0.1, -0.2) is 0.0436 m outside the footprint"),
    ],
)
def test_an_error_is_one_line_with_the_key(tmp_path: Path, wrong: dict[str, object], expected: str) -> None:
    with pytest.raises(InputError) as caught:
        changed(tmp_path, **wrong)
    assert expected in str(caught.value)
    assert "\n" not in str(caught.value)


def test_the_schema_describes_the_lidar() -> None:
    assert "LidarEntry" in json.dumps(robot_schema())


def test_a_robot_without_a_lidar_has_the_hash_that_it_always_had(tmp_path: Path) -> None:
    """The hash of this file before robots could have lidars."""
    values = yaml.safe_load((CATALOG / "turtlebot.yaml").read_text())
    del values["lidar"]
    path = tmp_path / "turtlebot.yaml"
    path.write_text(yaml.safe_dump(values))
    blind = load_robot(path)
    assert "lidar" not in robot_to_dict(blind)
    assert canonical_hash(blind) == BLIND_TURTLEBOT
    assert canonical_hash(changed(tmp_path)) != BLIND_TURTLEBOT


BLIND_TURTLEBOT = "6015e6951db89082ddc290423b7db58efc1c599cf120244d54e904d6f4220f5f"


def test_the_record_of_a_drive_holds_the_lidar(small_run: Run) -> None:
    assert small_run.rollout is not None
    record = small_run.rollout.record
    again = DriveRecord.from_json(record.to_json())
    assert isinstance(again.robot.lidar, Lidar)
    assert again.robot == record.robot


def test_errors_of_odometry_scale() -> None:
    assert Odometry().scaled(0).gyro_bias == 0
    assert Odometry().scaled(5).gyro_bias == pytest.approx(0.025)
    with pytest.raises(ValueError, match=r"gyro_bias: must be between 0 and 1, got 5"):
        Odometry(gyro_bias=5.0)
