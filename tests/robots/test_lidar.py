"""Lidars in robot files; robots without one keep record and hash."""

import math
from pathlib import Path

import pytest
import yaml

from antdrive.robots import Lidar, Odometry, PurePursuit, load_robot
from antdrive.sim.log.record import DriveRecord

CATALOG = Path(__file__).parent.parent.parent / "robots" / "catalog"
LIDAR = {"beams": 181, "field_of_view": 3.0, "min_range": 0.1, "max_range": 5.0, "rate": 10.0}


def changed(tmp_path, **lidar):
    values = yaml.safe_load((CATALOG / "turtlebot.yaml").read_text())
    values["lidar"] = {**LIDAR, **lidar}
    path = tmp_path / "mine.yaml"
    path.write_text(yaml.safe_dump(values))
    return load_robot(path)


def test_jackal_carries_the_challenges_sensor(jackal):
    lidar = jackal.lidar
    assert (lidar.beams, lidar.rate, lidar.min_range, lidar.max_range) == (720, 50.0, 0.1, 30.0)
    assert math.degrees(lidar.spacing) == pytest.approx(0.3755, abs=1e-4)
    assert math.degrees(lidar.angles[-1]) == pytest.approx(135, abs=1e-3)
    assert lidar.angles[0] == -lidar.angles[-1]


def test_turtlebots_lidar_covers_a_full_circle(turtlebot):
    lidar = turtlebot.lidar
    assert lidar.full_circle
    assert math.degrees(lidar.spacing) == pytest.approx(1.0, abs=1e-6)
    assert lidar.angles[0] == -math.pi
    assert lidar.angles[-1] == pytest.approx(math.pi - lidar.spacing)


@pytest.mark.parametrize(("rate", "hz", "taken"), [(1000.0, 60, 60), (50.0, 60, 50), (60.0, 60, 60), (90.0, 30, 30)])
def test_a_robot_takes_one_scan_in_a_control_period_at_most(tmp_path, rate, hz, taken):
    lidar = changed(tmp_path, rate=rate).lidar
    assert lidar.at(hz).rate == taken
    due = [lidar.due(tick, hz) for tick in range(10 * hz)]
    assert due == [lidar.at(hz).due(tick, hz) for tick in range(10 * hz)]
    assert sum(due) == pytest.approx(10 * taken, abs=1)


def test_a_file_places_the_lidar(tmp_path):
    lidar = changed(tmp_path, x=0.1, yaw=0.5).lidar
    assert lidar.pose_on((1.0, 2.0, math.pi / 2)) == pytest.approx((1.0, 2.1, math.pi / 2 + 0.5))


#: Values that no lidar has.
WRONG = (
    {"beams": 2}, {"beams": 3.5}, {"max_range": -1.0}, {"min_range": 5.0}, {"field_of_view": 360.0}, {"range": 3.0},
    {"rate": None}, {"x": 20.0}, {"x": 0.1, "y": -0.2},
)  # fmt: skip


def test_the_record_of_a_drive_holds_the_lidar(small_run):
    record = small_run.rollout.record
    again = DriveRecord.from_json(record.to_json())
    assert isinstance(again.robot.lidar, Lidar)
    assert again.robot == record.robot


def test_errors_of_odometry_scale():
    assert Odometry().scaled(0).gyro_bias == 0
    assert Odometry().scaled(5).gyro_bias == pytest.approx(0.025)


@pytest.mark.parametrize("written", [6.2832, 6.28319, 6.283186, 6.284])
def test_a_full_circle_may_be_rounded_up(tmp_path, written):
    lidar = changed(tmp_path, field_of_view=written).lidar
    assert lidar.full_circle
    assert lidar.field_of_view <= 2 * math.pi + 1e-6


@pytest.mark.parametrize("written", [3.1416, -3.1416, 3.142])
def test_half_a_turn_may_be_rounded_up(tmp_path, written):
    assert changed(tmp_path, yaw=written).lidar.yaw == math.copysign(math.pi, written)
    assert Lidar(beams=3, field_of_view=1.0, min_range=0.0, max_range=1.0, rate=5.0, yaw=written).yaw == pytest.approx(
        written, abs=1e-3
    )


def test_a_quarter_turn_may_be_rounded_up():
    assert PurePursuit(rotate_in_place_above=1.5708).rotate_in_place_above < math.pi / 2
