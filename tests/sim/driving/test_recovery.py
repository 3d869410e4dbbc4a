"""What a robot without a map does where it does not get on: turns to look, backs off, makes room ahead."""

import dataclasses
import math
from types import SimpleNamespace

import hypothesis
import numpy as np
import pytest
from hypothesis import strategies as st

from antdrive.planners import load_planner
from antdrive.robots import PursuitState, RobotSpec, Twist
from antdrive.sim import Outcome, Run, Scenario, run
from antdrive.sim.driving.driver import Driver
from antdrive.sim.driving.own_map import forgetting_ticks
from antdrive.sim.driving.parts import Step
from antdrive.sim.driving.recovery import Look, Recovery
from antdrive.sim.driving.replan_causes import LOOKED
from antdrive.sim.driving.replay import replay
from antdrive.sim.physics.engine import State
from antdrive.worlds import Cruising, Disc, Task, World
from tests.sim.driving.guides import exploration_of

HALL = (0.0, 0.0, 8.0, 8.0)
HERE = (4.0, 4.0, 0.0)
FORWARD = Twist(0.5, 0.0)


def driven(robot: RobotSpec, task: Task, **settings: object) -> Run:
    given = {"map": "none", "localisation": "true", "noise": 1.0, **settings}
    return run(Scenario(task=task, planner=load_planner("astar"), planner_name="astar", robot=robot, **given))  # type: ignore[arg-type]


def narrowed(robot: RobotSpec, field_of_view: float = 1.0) -> RobotSpec:
    assert robot.lidar is not None
    return dataclasses.replace(robot, lidar=dataclasses.replace(robot.lidar, field_of_view=field_of_view))


def triggers(done: Run) -> list[str]:
    assert done.rollout is not None
    return [replan.trigger for replan in done.rollout.record.replans]


@pytest.mark.parametrize("robot", ["jackal", "turtlebot"])
def test_a_robot_with_a_narrow_lidar_looks_round_first(robot: str, request: pytest.FixtureRequest) -> None:
    """It sees 57 degrees, and has to go round a post to a goal behind it."""
    task = Task(World("hall", HALL, (Disc(2.6, 4.2, 0.3),)), HERE, (1.2, 4.6), goal_tolerance=0.25, cell=0.1)
    done = driven(narrowed(request.getfixturevalue(robot)), task)
    assert done.succeeded, (done.outcome, done.reason, triggers(done))
    assert done.rollout is not None
    assert triggers(done)[0] == LOOKED
    first = done.rollout.pose[done.rollout.t < done.rollout.record.replans[0].t - 0.1]
    assert np.ptp(np.unwrap(first[:, 2])) > 2 * math.pi - 1.0  # with what it sees at once this is all around
    assert np.hypot(*(first[:, :2] - HERE[:2]).T).max() < 0.02
    assert replay(done.rollout).problems == ()


def test_a_robot_that_cannot_turn_where_it_stands_makes_room_ahead(jackal: RobotSpec) -> None:
    """Two posts behind the robot, where its lidar does not look, stop it from turning either way; the goal is behind them."""
    posts = Disc(3.71, 4.12, 0.02), Disc(3.71, 3.88, 0.02)
    done = driven(jackal, Task(World("hall", HALL, posts), HERE, (2.0, 4.0), goal_tolerance=0.25, cell=0.1))
    assert done.succeeded, (done.outcome, done.reason, triggers(done))
    assert done.rollout is not None
    assert done.rollout.pose[:, 0].max() > 4.2
    assert "stalled" in triggers(done)
    assert LOOKED in triggers(done)  # after it has made room: it had not seen what is behind it


def test_a_robot_is_told_of_a_mover_in_the_circle_of_its_first_turn(jackal: RobotSpec) -> None:
    """It stands behind the robot, where its lidar does not look, on the shorter way round to the goal."""
    creeping = Cruising(radius=0.1, position=(3.61, 4.0), velocity=(0.0, 0.001))
    task = Task(World("hall", HALL, movers=(creeping,)), HERE, (1.0, 4.0), goal_tolerance=0.25, cell=0.1)
    done = driven(jackal, task, noise=0.0, time_limit=4.0)
    assert done.rollout is not None
    assert not len(done.rollout.contacts), done.reason
    assert np.ptp(done.rollout.pose[:, 2]) > 0.1  # it began to turn


def test_a_robot_that_is_boxed_in_looks_round_before_it_gives_up(jackal: RobotSpec) -> None:
    ring = tuple(Disc(4 + math.cos(a), 4 + math.sin(a), 0.12) for a in np.arange(0.0, 2 * math.pi, 0.18))
    task = Task(World("pen", HALL, ring), HERE, (7.0, 4.0), goal_tolerance=0.25, cell=0.1)
    done = driven(jackal, task, time_limit=5.0)
    assert done.rollout is not None
    assert not len(done.rollout.contacts)
    assert done.outcome is Outcome.TIMED_OUT
    assert done.reason.startswith("no way through what was seen")
    assert LOOKED in triggers(done)
    assert replay(done.rollout).problems == ()


def test_what_a_look_has_shown_is_not_forgotten_at_once(jackal: RobotSpec) -> None:
    """The plan after a look uses all that was seen; only the next one in vain makes the map anew."""
    task = Task(World("hall", HALL), HERE, (7.0, 4.0), goal_tolerance=0.25, cell=0.1)
    done = driven(jackal, task, time_limit=1.0)
    assert done.rollout is not None
    hz = done.rollout.record.control_hz
    replans = [
        SimpleNamespace(t=(k + 1) / hz, trigger=trigger, solved=False)
        for k, trigger in enumerate(["no way"] * 3 + [LOOKED, "no way"])
    ]
    assert list(forgetting_ticks(SimpleNamespace(replans=replans, control_hz=hz))) == [5]  # type: ignore[arg-type]


@pytest.mark.parametrize("lost", [True, False])
def test_a_robot_that_has_no_way_where_its_route_ends_looks_for_one_for_a_while(jackal: RobotSpec, lost: bool) -> None:
    """It has backed off, stands at the end of that route, 3 m from the goal, and planned in vain."""
    task = Task(World("hall", HALL), HERE, (7.0, 4.0), goal_tolerance=0.25, cell=0.1)
    s = Scenario(task=task, planner=load_planner("astar"), planner_name="astar", robot=jackal, map="none")
    exploration = exploration_of(s)
    _, tracked = exploration.route(*exploration.first())
    robot = Driver(exploration, (), tracked, task, jackal, 60)
    asked = []
    exploration.replan = lambda tick, pose, trigger: asked.append(trigger)  # type: ignore[method-assign, assignment, return-value]
    exploration.lost = lost
    robot.step = Step(pursuit=PursuitState(arc=tracked.length))
    ending = robot._end_of_route(0, HERE, State(*HERE, 0.0, 0.0))
    assert (ending is None) == lost
    assert asked == ([] if lost else ["missed the goal"])


@hypothesis.settings(max_examples=60)
@hypothesis.given(
    st.lists(st.floats(0.4, 6.0).flatmap(lambda a: st.sampled_from([a, -a])), min_size=1, max_size=2),
    st.floats(-3.0, 3.0),
    st.floats(0.2, 3.0),
    st.sampled_from([10, 60, 240]),
)
def test_a_look_turns_as_far_as_it_is_to_and_stands(
    turtlebot: RobotSpec, turns: list[float], yaw: float, rate: float, hz: int
) -> None:
    look, last, turned, reached = Look(turns, yaw, rate, turtlebot, hz), Twist(0.0, 0.0), 0.0, []
    hardest = turtlebot.max_yaw_acceleration / hz
    for _ in range(60 * hz):
        twist = look.command((1.0, 2.0, math.remainder(yaw + turned, 2 * math.pi)), last)
        if look.done:
            break
        assert twist.speed == 0.0
        assert abs(twist.yaw_rate) <= rate + 1e-9
        assert abs(twist.yaw_rate - last.yaw_rate) <= hardest + 1e-9
        last, turned = twist, turned + twist.yaw_rate / hz
        reached.append(turned)
    assert look.done
    assert last.yaw_rate == pytest.approx(0.0, abs=0.01)
    assert turned == pytest.approx(sum(turns), abs=0.05 * len(turns) + hardest / hz)
    farthest = max(reached, key=lambda angle: angle * math.copysign(1.0, turns[0]))
    assert farthest == pytest.approx(
        max([turns[0], sum(turns)], key=lambda a: a * math.copysign(1.0, turns[0])), abs=0.15
    )


def test_a_look_that_is_not_let_turn_ends(turtlebot: RobotSpec) -> None:
    look = Look([2.0, -3.0], 0.0, 1.0, turtlebot, 60)
    periods = 0
    while not look.done:
        look.command((0.0, 0.0, 0.0), Twist(0.0, 0.0))
        periods += 1
        assert periods < 200
    moving = Look([2.0], 0.0, 1.0, turtlebot, 60)
    hardest = turtlebot.max_yaw_acceleration / 60
    for _ in range(60 * 10):  # movers turn the robot to and fro
        assert abs(moving.command((0.0, 0.0, 0.0), Twist(0.0, 1.0)).yaw_rate - 1.0) <= hardest + 1e-12
    assert moving.done


def survey_of(robot: RobotSpec, left: float, right: float, open_: float = 1.0) -> SimpleNamespace:
    """A survey that sees so much free ground for turns, and none ahead, where nothing was hit for so far."""
    turns = {1.0: left, -1.0: right}
    return SimpleNamespace(
        lidar=robot.lidar,
        map=SimpleNamespace(share=1, turns=1),
        clear_turn=lambda pose, side, farthest: min(turns[side], farthest),
        clear_distance=lambda pose, speed, rate, longest: 0.0,
        clear_way=lambda pose, twist, farthest, daring: open_ if daring else 0.0,
    )


@pytest.mark.parametrize(
    ("left", "right", "turns"),
    [
        (9.0, 9.0, [math.pi / 2 + 0.2]),  # all that a lidar of 270 degrees does not see, and a little more
        (1.0, 0.8, [0.9, -1.6]),
        (0.8, 1.0, [-0.9, 1.6]),
        (1.0, 0.2, [0.9]),
        (0.2, 0.2, []),
    ],
)
def test_a_look_goes_both_ways_where_one_is_not_free(
    jackal: RobotSpec, left: float, right: float, turns: list[float]
) -> None:
    recovery = Recovery(survey_of(jackal, left, right), jackal, HERE, 60)  # type: ignore[arg-type]
    assert recovery.begin_look(HERE) == bool(turns)
    assert (recovery.look is not None) == bool(turns)
    if recovery.look is not None:
        assert [recovery.look._left, *recovery.look._turns] == pytest.approx(turns, abs=1e-4)


def test_a_robot_looks_round_once_at_a_place(jackal: RobotSpec, turtlebot: RobotSpec) -> None:
    recovery = Recovery(survey_of(jackal, 9.0, 9.0), jackal, HERE, 60)  # type: ignore[arg-type]
    assert not recovery.held(0.0, HERE)  # it sees enough to begin with
    recovery.note_sight(1.0, FORWARD)
    recovery.note_sight(1.4, FORWARD)
    assert [recovery.held(now, HERE) for now in (1.4, 1.6)] == [False, True]
    assert recovery.begin_look(HERE)
    recovery.end_look(3.0, HERE)
    recovery.note_sight(3.0, FORWARD)
    assert not recovery.held(9.0, HERE)
    assert not recovery.begin_look((4.2, 4.0, 1.0))
    assert recovery.held(9.0, (4.4, 4.0, 1.0))
    recovery.note_sight(9.1, None)
    assert not recovery.held(9.2, (4.4, 4.0, 1.0))
    around = Recovery(survey_of(turtlebot, 9.0, 9.0), turtlebot, HERE, 60)  # type: ignore[arg-type]
    around.note_sight(1.0, FORWARD)
    assert not around.held(9.0, HERE)  # its lidar sees all around
    assert not around.begin_look(HERE)
    before_a_post = Recovery(survey_of(jackal, 9.0, 9.0, 0.05), jackal, HERE, 60)  # type: ignore[arg-type]
    before_a_post.note_sight(1.0, FORWARD)
    assert not before_a_post.held(9.0, HERE)  # there is nothing to see


def test_ground_that_was_not_seen_is_told_from_what_was_hit(jackal: RobotSpec) -> None:
    """The robot looks ahead: a post in front of it was hit, and behind it there is ground that was not seen."""
    task = Task(World("hall", HALL, (Disc(4.8, 4.0, 0.2),)), HERE, (7.0, 4.0), goal_tolerance=0.25, cell=0.1)
    s = Scenario(task=task, planner=load_planner("astar"), planner_name="astar", robot=jackal, map="none")
    exploration = exploration_of(s)
    survey, recovery = exploration.survey, exploration._recovery
    for twist, unseen in ((FORWARD, False), (Twist(-0.5, 0.0), True), (Twist(0.001, 1.0), False)):
        recovery.note_sight(0.0, twist)
        seen, open_ = survey.clear_way(HERE, twist, 1.0), survey.clear_way(HERE, twist, 1.0, daring=True)
        assert seen <= open_
        assert recovery.misses_sight(HERE) == unseen, (twist, seen, open_)
