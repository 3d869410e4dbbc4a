"""The ends of a drive: what is logged after a contact, and where a robot that brakes counts as there."""

import numpy as np
import pytest

from antdrive.robots import Avoidance, RobotSpec, Twist
from antdrive.sim import Perception, Run
from antdrive.sim.driving.following import OnePath
from antdrive.sim.driving.perception import Told
from antdrive.sim.driving.rules import Avoid, braked, stopping_time
from antdrive.worlds import Trajectories
from tests.sim.driving.test_driver import HALL, TASK


def test_half_a_second_of_braking_is_logged_after_a_contact(collided_run: Run) -> None:
    log = collided_run.rollout
    assert log is not None
    first = int(log.contacts[0, 0])
    after = len(log.t) - 1 - first
    assert 120 <= after < 120 + 240 // 60, "the control period is finished first"
    assert not log.command[-120:].any()
    assert log.command[-121].any()
    assert abs(log.twist[-1, 0]) < abs(log.twist[first, 0])


@pytest.mark.parametrize(
    ("before", "speed", "stops"),
    [
        (0.237, 0.0, True),  # 95 % of 0.25 m
        (0.238, 0.0, False),
        (-0.238, 0.0, False),
        (0.23, 0.6, True),  # 0.18 m on, at 1 m/s^2
        (0.05, 0.7, True),  # 0.245 m on
        (0.0, 0.7, False),
        (0.3, 0.6, False),  # it is not there yet
        (-0.1, -0.5, True),  # 0.125 m back
        (0.12, -0.5, False),
    ],
)
def test_a_robot_that_brakes_stops_at_the_goal_if_both_ends_of_its_way_are_there(
    turtlebot: RobotSpec, before: float, speed: float, stops: bool
) -> None:
    x, y = TASK.goal
    assert TASK.goal_tolerance == 0.25
    for yaw, pose in ((0.0, (x - before, y, 0.0)), (np.pi / 2, (x, y - before, np.pi / 2))):
        nobody = Told(Trajectories.of(HALL, TASK.start[:2]), Perception(), 60)
        rule = Avoid(Avoidance(), nobody, OnePath(), TASK, turtlebot, 60)
        assert rule._stops_at_goal(pose, Twist(speed, 0.0)) is stops, yaw


def test_braking_keeps_the_curve_as_far_as_the_turn_can_be_slowed(turtlebot: RobotSpec) -> None:
    assert braked(Twist(0.5, 1.0), turtlebot, 60) == pytest.approx((0.5 - 1 / 60, (0.5 - 1 / 60) / 0.5))
    assert braked(Twist(-0.5, 1.0), turtlebot, 60) == pytest.approx((-0.5 + 1 / 60, (0.5 - 1 / 60) / 0.5))
    slower = 1.0 - turtlebot.max_yaw_acceleration / 60  # the wheels cannot stop the turn at once
    assert braked(Twist(0.01, 1.0), turtlebot, 60) == pytest.approx((0.0, slower))
    assert braked(Twist(0.0, -1.0), turtlebot, 60) == pytest.approx((0.0, -slower))
    assert braked(Twist(0.0, 0.01), turtlebot, 60) == (0.0, 0.0)


def test_stopping_takes_as_long_as_the_slower_of_speed_and_turn(turtlebot: RobotSpec) -> None:
    assert stopping_time(Twist(-0.5, 1.0), turtlebot) == 0.5
    assert stopping_time(Twist(0.1, -2.0), turtlebot) == 0.25
