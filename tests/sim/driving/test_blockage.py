"""A robot gives up where movers that stand still close every way, and nowhere else."""

import dataclasses
import math

import numpy as np
import pytest

from antdrive.planners import load_planner
from antdrive.robots import RobotSpec
from antdrive.sim import Outcome, Perception, ReplanPolicy, Rollout, Run, Scenario, certify, run
from antdrive.worlds import Disc, Keyframed, Mover, Task, World

LANE = World("lane", (0.0, 0.0, 8.0, 1.2))
TASK = Task(LANE, (0.6, 0.6, 0.0), (7.2, 0.6), cell=0.1)
PLUG = Keyframed(radius=0.3, keyframes=((0.0, 5.0, 0.6), (9.0, 5.0, 0.6)))


def among(*movers: Mover, robot: RobotSpec, planner: str = "dstar-lite", **settings: object) -> Run:
    task = dataclasses.replace(TASK, world=dataclasses.replace(LANE, movers=movers))
    return run(Scenario(task=task, planner=load_planner(planner), robot=robot, **settings))  # type: ignore[arg-type]


@pytest.fixture(scope="module")
def blocked(turtlebot: RobotSpec) -> Rollout:
    log = among(PLUG, robot=turtlebot).rollout
    assert log is not None
    return log


def with_record(log: Rollout, **changes: object) -> Rollout:
    return dataclasses.replace(log, record=dataclasses.replace(log.record, digest=None, **changes))


def test_each_search_waits_twice_as_long_as_the_one_before(blocked: Rollout) -> None:
    assert blocked.outcome is Outcome.BLOCKED
    assert blocked.record.reason == (
        "movers[0] stands still at (5.00, 0.60) and closes the way; no route to the goal for 30 s, in 6 attempts"
    )
    times = [replan.t for replan in blocked.record.replans]
    assert np.diff(times) == pytest.approx([1, 2, 4, 8, 15], abs=0.02)  # to a control period
    assert not any(replan.solved for replan in blocked.record.replans)
    assert blocked.t[-1] == pytest.approx(times[-1])
    assert certify(blocked).certified


@pytest.mark.parametrize("planner", ["ants", "tangent", "mmas-dstar"])
def test_planners_of_every_kind_give_up(planner: str, turtlebot: RobotSpec) -> None:
    done = among(PLUG, robot=turtlebot, planner=planner, replanning=ReplanPolicy(patience=5.0))
    assert done.outcome is Outcome.BLOCKED, done.reason
    assert done.rollout is not None
    assert sum(not replan.solved for replan in done.rollout.record.replans) <= 4
    assert done.certificate is not None
    assert done.certificate.certified


def test_a_mover_that_leaves_in_time_is_waited_for(turtlebot: RobotSpec) -> None:
    leaves = Keyframed(radius=0.3, keyframes=((0.0, 5.0, 0.6), (25.0, 5.0, 0.6), (30.0, 9.0, 0.6)), loop="once")
    assert among(leaves, robot=turtlebot).succeeded
    assert among(leaves, robot=turtlebot, replanning=ReplanPolicy(patience=10.0)).outcome is Outcome.BLOCKED


def test_a_mover_that_is_known_to_leave_is_waited_for_without_end(turtlebot: RobotSpec) -> None:
    leaves = Keyframed(radius=0.3, keyframes=((0.0, 5.0, 0.6), (15.0, 5.0, 0.6), (20.0, 9.0, 0.6)), loop="once")
    policy = ReplanPolicy(patience=10.0)
    assert among(leaves, robot=turtlebot, replanning=policy).outcome is Outcome.BLOCKED
    assert among(leaves, robot=turtlebot, replanning=policy, perception=Perception(kind="motions")).succeeded


def test_patience_begins_anew_when_the_mover_moves_on(turtlebot: RobotSpec) -> None:
    frames = ((0.0, 5.0, 0.6), (10.0, 5.0, 0.6), (12.0, 5.6, 0.6))
    moves_on = Keyframed(radius=0.3, keyframes=frames, loop="once")
    done = among(moves_on, robot=turtlebot, replanning=ReplanPolicy(patience=12.0))
    assert done.outcome is Outcome.BLOCKED
    assert "(5.60, 0.60)" in done.reason
    assert done.rollout is not None
    assert 22.0 < done.rollout.t[-1] < 26.0


def test_a_mover_that_moves_is_never_given_up_on(turtlebot: RobotSpec) -> None:
    """It walks to and fro by 0.3 m, and the lane is closed all the time; the robot looks for a way every second."""
    restless = Keyframed(radius=0.3, keyframes=((0.0, 5.0, 0.6), (3.0, 5.3, 0.6)))
    done = among(restless, robot=turtlebot, time_limit=50.0)
    assert done.outcome is Outcome.TIMED_OUT
    assert done.rollout is not None
    assert len(done.rollout.record.replans) > 40


def test_a_way_that_only_movers_on_the_move_close_is_open(turtlebot: RobotSpec) -> None:
    """A mover stands in one gate, and another walks in the other."""
    wall = tuple(Disc(4.0, y, 0.25) for y in np.arange(0.25, 6.0, 0.5) if not (2.2 < y < 3.8 or y > 5.0))
    hall = World("hall", (0.0, 0.0, 8.0, 6.5), wall)
    stands = Keyframed(radius=0.45, keyframes=((0.0, 4.0, 3.0), (9.0, 4.0, 3.0)))
    walks = Keyframed(radius=0.6, keyframes=((0.0, 4.0, 5.6), (3.0, 4.2, 5.8)))
    for second, outcome in (
        (walks, Outcome.TIMED_OUT),
        (dataclasses.replace(walks, keyframes=((0.0, 4.0, 5.6), (3.0, 4.0, 5.6))), Outcome.BLOCKED),
    ):
        task = Task(dataclasses.replace(hall, movers=(stands, second)), (1.0, 3.0, 0.0), (7.0, 3.0), cell=0.25)
        policy = ReplanPolicy(patience=5.0)
        done = run(
            Scenario(task=task, planner=load_planner("dstar-lite"), robot=turtlebot, replanning=policy, time_limit=25.0)
        )
        assert done.outcome is outcome, done.reason


def test_a_robot_that_may_not_replan_around_movers_waits_to_the_end(turtlebot: RobotSpec) -> None:
    for policy in (None, ReplanPolicy(around_movers=False, patience=2.0)):
        assert among(PLUG, robot=turtlebot, replanning=policy, time_limit=12.0).outcome is Outcome.TIMED_OUT


def test_an_unseen_cylinder_in_the_lane_is_run_into(turtlebot: RobotSpec) -> None:
    done = among(robot=turtlebot, unseen=(Disc(5.0, 0.6, 0.3),))
    assert done.outcome is Outcome.COLLIDED


def test_a_negative_patience_is_refused() -> None:
    with pytest.raises(ValueError, match=r"patience: must be at least 0 and finite, got -1"):
        ReplanPolicy(patience=-1.0)
    with pytest.raises(ValueError, match="patience"):
        ReplanPolicy(patience=math.inf)


def test_a_log_that_ends_with_a_route_is_not_blocked(blocked: Rollout) -> None:
    *rest, last = blocked.record.replans
    for replans in ((), (*rest, dataclasses.replace(last, solved=True, cost_m=1.0, route=((4.0, 0.6), (5.0, 0.6))))):
        (problem,) = certify(with_record(blocked, replans=replans)).problems
        assert problem == "outcome: blocked, but the drive does not end with a search that found no route"


def test_a_log_whose_movers_all_move_is_not_blocked(turtlebot: RobotSpec) -> None:
    restless = Keyframed(radius=0.3, keyframes=((0.0, 5.0, 0.6), (3.0, 5.3, 0.6)))
    log = among(restless, robot=turtlebot, time_limit=12.0).rollout
    assert log is not None
    assert certify(log).certified
    (problem,) = certify(with_record(log, outcome=Outcome.BLOCKED)).problems
    assert problem.startswith("outcome: blocked, but no mover stood still from t = ")
