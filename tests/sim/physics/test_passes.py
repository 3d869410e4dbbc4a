"""What `benchmarks.physics` says of a pass beside a cylinder: physics' contact beside the overlap of the drive as it was."""

import math

import pytest

from antdrive import load_robot
from benchmarks.physics import Pass, drive_on, drive_past


@pytest.mark.parametrize("clearance", [-0.005, 0.002, 0.02])
def test_a_pass_is_judged_by_where_the_robot_drove(clearance: float) -> None:
    """At 60 Hz the turtlebot leaves its line by 9 mm on the way to the cylinder, so that 2 mm of clearance are an overlap."""
    robot = load_robot("turtlebot")
    radius, speed = robot.footprint.bounds[3], robot.max_speed / 2
    poses = drive_on(robot, 60, speed)
    found = drive_past(robot, 60, speed, clearance, poses)
    away = min(math.hypot(3.0 - x, radius + clearance + 0.3 - y) for x, y, _ in poses)
    assert found.overlap == pytest.approx(1e3 * (radius + 0.3 - away), abs=1e-6)
    assert found.overlap + 1e3 * clearance == pytest.approx(9.5, abs=1.0)
    assert found.felt == (clearance < 0.009)
    assert (found.missed, found.false) == (False, False)


def test_physics_and_the_closed_form_may_disagree_in_two_ways() -> None:
    judged = {(felt, overlap): Pass(felt, overlap) for felt in (False, True) for overlap in (-1.0, 1.0)}
    assert [case for case, found in judged.items() if found.missed] == [(False, 1.0)]
    assert [case for case, found in judged.items() if found.false] == [(True, -1.0)]
