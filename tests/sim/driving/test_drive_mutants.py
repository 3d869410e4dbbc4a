"""Parts of the drive loop, by themselves: each small fault that was put there once is noticed here."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from antdrive.robots import AvoidanceState, Footprint, PurePursuit, PursuitState, RobotSpec, Twist
from antdrive.sim import Outcome
from antdrive.sim.driving.driver import STUCK_TIME, StuckClock
from antdrive.sim.driving.following import OnePath, follow
from antdrive.sim.driving.leaving import cannot_leave, is_narrow
from antdrive.sim.driving.localising import TruePose
from antdrive.sim.driving.parts import Ending, Guide, Step
from antdrive.sim.driving.plants import Bullet
from antdrive.sim.driving.rules import AVOIDING, WAITING_SPEED, Avoid
from antdrive.sim.physics.engine import Engine, State
from antdrive.worlds import World
from tests.sim.driving.test_driver import TASK, driver


def test_the_stuck_clock_begins_at_zero() -> None:
    assert StuckClock() == (0.0, 0, 0, 0)
    assert StuckClock(farthest=1.0, driving=5, turning=5).after(PursuitState(arc=3.0), waiting=False) == (3.0, 0, 0, 0)


def test_a_robot_at_the_very_tolerance_has_arrived(turtlebot: RobotSpec) -> None:
    x, y = TASK.goal
    assert (
        driver(turtlebot)._arrival((x, y, 0.0), State(x - TASK.goal_tolerance, y, 0.0, 0.0, 0.0)).outcome
        is Outcome.SUCCEEDED
    )


class Cautious:
    """Avoidance that always stops the robot."""

    prediction_times = np.array([0.0, 0.1])
    step = 0.1

    def avoid(self, *_: Any, **__: Any) -> tuple[Twist, bool, AvoidanceState]:
        return Twist(0.0, 0.0), True, AvoidanceState()


def test_a_robot_that_gives_way_is_not_stuck(turtlebot: RobotSpec) -> None:
    nobody: Any = SimpleNamespace(predict=lambda *_: (np.empty((2, 0, 2)), np.empty(0)))
    cautious: Any = Cautious()
    waits, rest = (
        driver(turtlebot, None, Avoid(cautious, nobody, OnePath(), TASK, turtlebot, 60)),
        State(*TASK.start, 0.0, 0.0),
    )
    for tick in range(round(STUCK_TIME * 60) + 20):
        assert waits.decide(tick, TASK.start, rest) is None
    assert waits.step.pursuit.limiter == AVOIDING
    assert waits.gives_up(rest) is None


class Watcher(Guide):
    """A guide that notes whether the robot waits, and where it is asked for a way because the robot missed the goal."""

    may_wait = True

    def __init__(self) -> None:
        self.log = []
        self.waiting: list[bool] = []
        self.misses: list[Any] = []

    def update(self, tick: int, pose: Any, waiting: bool, *_: Any) -> None:
        self.waiting.append(waiting)

    def missed(self, tick: int, pose: Any) -> None:
        self.misses.append(pose)


@pytest.mark.parametrize(
    ("avoids", "speed", "waits"),
    [
        (True, 0.0, True), (True, 0.9 * WAITING_SPEED, True), (True, -0.9 * WAITING_SPEED, True),
        (True, WAITING_SPEED, False), (True, -1.1 * WAITING_SPEED, False), (False, 0.0, False),
    ],
)  # fmt: skip
def test_a_robot_waits_if_it_stands_to_give_way(turtlebot: RobotSpec, avoids: bool, speed: float, waits: bool) -> None:
    monitor = Watcher()
    robot = driver(turtlebot, monitor)
    robot.step = Step(avoids=avoids)
    robot.decide(0, TASK.start, State(*TASK.start, speed, 0.0))
    assert monitor.waiting == [waits]


@pytest.mark.parametrize(("true", "outcome"), [(0.4, Outcome.STUCK), (0.1, Outcome.SUCCEEDED)])
@pytest.mark.parametrize(("off", "knows"), [(0.0, False), (0.25, False), (0.26, True), (0.4, True)])
def test_a_robot_looks_for_a_new_route_to_a_goal_that_it_believes_it_missed(
    turtlebot: RobotSpec, off: float, knows: bool, true: float, outcome: Outcome
) -> None:
    """It stands `true` from the goal, and estimates that it is `off` from it. What is true ends no drive for it."""
    monitor, (x, y) = Watcher(), TASK.goal
    robot = driver(turtlebot, monitor)
    endings = []
    for tick in range(9):  # the command comes to rest first
        robot.step = robot.step._replace(pursuit=PursuitState(arc=robot.path.length))
        endings.append(robot.decide(tick, (x - off, y, 0.0), State(x - true, y, 0.0, 0.0, 0.0)))
    assert bool(monitor.misses) is knows
    assert any(ending is not None and ending.outcome is outcome for ending in endings) is not knows


@pytest.mark.parametrize("control_hz", [7, 50, 480])
def test_control_periods_are_whole_numbers_of_steps(turtlebot: RobotSpec, control_hz: int) -> None:
    tracked = driver(turtlebot).path
    with Engine(TASK.world, turtlebot) as engine, pytest.raises(ValueError, match="must divide the physics rate 240"):
        follow(engine, PurePursuit(), tracked, TASK, control_hz=control_hz, limit=0.1)


def test_progress_is_told_ten_times_a_second(turtlebot: RobotSpec) -> None:
    told: list[float] = []
    with Engine(TASK.world, turtlebot) as engine:
        tracked = driver(turtlebot).path
        log = follow(engine, PurePursuit(), tracked, TASK, limit=1.0, progress=told.append)
    assert len(log.t) == 241
    assert len(told) == 10
    assert told == sorted(told)


def test_the_first_row_is_at_rest_and_estimates_keep_their_error(turtlebot: RobotSpec) -> None:
    with Engine(TASK.world, turtlebot) as engine:
        plant = Bullet(engine, TASK.start, 80)
        x, y, yaw = plant.state.pose
        localiser = TruePose(turtlebot.noise, turtlebot.track, 1 / 80, TASK.start, np.random.default_rng(0))
        localiser.settle((x + 0.1, y - 0.2, yaw + 0.3 + 2 * np.pi))
        plant.advance(Step(Twist(0.2, 0.1), PursuitState(limiter=2)), Twist(0.3, 0.4))
        found = plant.finish(Ending(Outcome.TIMED_OUT))
        logged = localiser.logged(found, plant.per_tick)
    np.testing.assert_array_equal(found.command, [(0.0, 0.0), *[(0.2, 0.1)] * 3])
    np.testing.assert_array_equal(logged["actuated"], [(0.0, 0.0), *[(0.3, 0.4)] * 3])
    np.testing.assert_array_equal(found.limiter, [0, 2, 2, 2])
    np.testing.assert_allclose(logged["estimate"] - found.pose, [(0.1, -0.2, 0.3)] * 4)


def test_room_for_exactly_the_radius_is_narrow(turtlebot: RobotSpec) -> None:
    """A point of the footprint would touch the wall."""
    cart = replace(turtlebot, footprint=Footprint.rectangle(0.6, 0.8))
    world = World("w", (0.0, 0.0, 6.0, 4.0))
    assert cart.radius == 0.5
    assert is_narrow(world, cart, (0.5, 2.0, 0.0))
    assert not is_narrow(world, cart, (0.501, 2.0, 0.0))


def test_the_first_motion_is_rehearsed_for_a_minute(turtlebot: RobotSpec) -> None:
    """A controller that stays in a narrow place is left to the drive."""
    steps: list[int] = []

    def step(*_: Any) -> tuple[Twist, PursuitState]:
        steps.append(1)
        return Twist(0.0, 0.0), PursuitState()

    cart = replace(turtlebot, footprint=Footprint.rectangle(0.6, 0.8))
    world = World("w", (0.0, 0.0, 6.0, 4.0))
    stays: Any = SimpleNamespace(step=step)
    assert cannot_leave(driver(turtlebot).path, stays, world, cart, (0.45, 2.0, 0.0), 2) == ""
    assert len(steps) == 2 * 60
