"""Gaps beside movers that stand still: driven at the safety margin if nothing moves, else refused with the reason."""

import numpy as np
import pytest

from antdrive.planners import load_planner
from antdrive.robots import RobotSpec
from antdrive.sim import Outcome, Perception, ReplanPolicy, Run, Scenario, run
from antdrive.sim.log.certificate import closed_form_clearance
from antdrive.worlds import Disc, Keyframed, Mover, Task, World

LANE, RADIUS = 2.0, 0.3
RESTLESS = Keyframed(radius=0.1, keyframes=((0.0, 7.0, 0.3), (3.0, 7.5, 0.3)))


def standing(gap: float, *later: tuple[float, float, float]) -> Keyframed:
    y = LANE - gap - RADIUS
    return Keyframed(radius=RADIUS, keyframes=((0.0, 5.0, y), (9.0, 5.0, y), *later), loop="once")


def past(
    gap: float,
    *others: Mover,
    mover: Keyframed | None = None,
    robot: RobotSpec,
    planner: str = "dstar-lite",
    **settings: object,
) -> Run:
    """A lane that cylinders close but for a mover and a gap between it and the wall."""
    y = LANE - gap - RADIUS
    posts = tuple(Disc(5.0, 0.1 + 0.2 * k, 0.1) for k in range(9) if 0.1 + 0.2 * k < y)
    world = World("gap", (0.0, 0.0, 8.0, LANE), posts, movers=(mover or standing(gap), *others))
    task = Task(world, (0.6, 1.0, 0.0), (7.2, 1.0), cell=0.05)
    return run(Scenario(task=task, planner=load_planner(planner), robot=robot, **settings))  # type: ignore[arg-type]


@pytest.mark.parametrize("planner", ["dstar-lite", "tangent", "astar"])
@pytest.mark.parametrize("gap", [0.44, 0.5])
def test_a_gap_beside_a_mover_that_stands_still_is_driven_at_the_margin(
    turtlebot: RobotSpec, gap: float, planner: str
) -> None:
    done = past(gap, robot=turtlebot, planner=planner)
    assert done.succeeded, done.reason
    assert done.rollout is not None
    least = float(closed_form_clearance(done.rollout).min())
    assert 0.02 < least < gap / 2 - turtlebot.radius + 1e-9, "closer than avoidance usually lets the robot come"
    assert len(done.rollout.record.replans) <= 4


def test_while_anything_moves_the_gap_is_refused_with_the_reason(turtlebot: RobotSpec) -> None:
    done = past(0.46, RESTLESS, robot=turtlebot, replanning=ReplanPolicy(patience=8.0), time_limit=60.0)
    assert done.outcome is Outcome.BLOCKED
    assert done.reason.startswith(
        "movers[0] stands still at (5.00, 1.24) and leaves a gap too narrow for local avoidance, which keeps the robot's "
        "centre 0.28 m from it; no route to the goal for 8 s"
    )
    assert done.certificate is not None
    assert done.certificate.certified
    assert done.rollout is not None
    assert len(done.rollout.record.replans) <= 8


def test_a_mover_beyond_the_range_of_perception_does_not_count(turtlebot: RobotSpec) -> None:
    assert past(0.46, RESTLESS, robot=turtlebot, perception=Perception(range=1.5)).succeeded


def test_a_gap_that_no_plan_passes_closes_the_way(turtlebot: RobotSpec) -> None:
    done = past(0.41, robot=turtlebot, replanning=ReplanPolicy(patience=3.0))
    assert done.outcome is Outcome.BLOCKED
    assert "and closes the way;" in done.reason


def test_a_wider_way_is_taken_instead(turtlebot: RobotSpec) -> None:
    """The way through the gap is shorter, the way past the other end of the wall wider."""
    wall = tuple(Disc(5.0, y, 0.1) for y in np.arange(1.7, 4.4, 0.2))
    mover = Keyframed(radius=0.3, keyframes=((0.0, 5.0, 4.7), (9.0, 5.0, 4.7)))
    world = World("two ways", (0.0, 0.0, 9.0, 5.5), wall, movers=(mover,))  # gaps of 0.5 m and 1.6 m
    task = Task(world, (2.0, 4.7, 0.0), (8.0, 4.7), cell=0.1)
    done = run(Scenario(task=task, planner=load_planner("dstar-lite"), robot=turtlebot))
    assert done.succeeded, done.reason
    assert done.rollout is not None
    assert done.rollout.pose[:, 1].min() < 1.5


@pytest.mark.parametrize("seconds", [12.0, 13.0])
def test_a_mover_that_sets_out_while_the_robot_passes_is_not_run_into(turtlebot: RobotSpec, seconds: float) -> None:
    """It moves away along the lane, either way, when the robot is about to enter its gap."""
    y = LANE - 0.5 - RADIUS
    for x in (3.0, 7.0):
        leaves = standing(0.5, (seconds, 5.0, y), (seconds + 8.0, x, y))
        done = past(0.5, mover=leaves, robot=turtlebot, time_limit=30.0)
        assert done.outcome is not Outcome.COLLIDED


def test_a_robot_without_avoidance_notes_no_gaps(turtlebot: RobotSpec) -> None:
    assert past(0.46, robot=turtlebot, avoidance=None).succeeded
