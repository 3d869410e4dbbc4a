"""Leaving a start where a rectangle cannot turn freely: the rehearsal and physics agree."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest

from antdrive.base import Pose
from antdrive.planners import load_planner
from antdrive.robots import LIMITERS, Footprint, PurePursuit, RobotSpec, load_robot, overlap_at
from antdrive.sim import Engine, Outcome, Scenario, plan, run
from antdrive.sim.driving.drive import drive
from antdrive.sim.driving.leaving import is_narrow
from antdrive.worlds import Disc, Route, Task, World


@pytest.fixture(scope="module")
def cart(jackal: RobotSpec) -> RobotSpec:
    return dataclasses.replace(jackal, name="cart", footprint=Footprint.rectangle(0.9, 0.6))


def beside(cart: RobotSpec, gap: float, start: Pose = (3.0, 3.0, 0.0)) -> Scenario:
    """A cart beside a cylinder on its right, with a goal ahead and to the left."""
    world = World("beside", (0, 0, 8, 6), (Disc(3.0, 3.0 - 0.3 - gap - 0.4, 0.4),))
    return Scenario(task=Task(world, start, (6.5, 5.0), cell=0.1), planner=load_planner("astar"), robot=cart)


@pytest.mark.parametrize("gap", [0.05, 0.1, 0.2])
def test_a_cart_that_would_turn_into_a_cylinder_has_no_path(cart: RobotSpec, gap: float) -> None:
    result = run(beside(cart, gap))
    assert (result.outcome, result.rollout) == (Outcome.NO_PATH, None)
    assert result.reason == (
        f"turning on the spot at the start would bring cart into obstacles[0] at (3, {2.3 - gap:g}) with radius 0.4; "
        f"a free turn needs 0.541 m around its centre, the start has {0.3 + gap:.3f} m"
    )
    assert plan(beside(cart, gap))[1].reason == result.reason


def test_a_cart_that_need_not_turn_leaves_a_narrow_start(cart: RobotSpec) -> None:
    narrow = beside(cart, 0.2)
    ahead = dataclasses.replace(narrow, task=dataclasses.replace(narrow.task, goal=(6.5, 3.0)))
    assert is_narrow(ahead.task.world, cart, ahead.task.start)
    assert run(ahead).succeeded


def test_room_for_a_turn_and_discs_are_not_narrow(cart: RobotSpec, turtlebot: RobotSpec) -> None:
    task = beside(cart, 0.05).task
    assert is_narrow(task.world, cart, task.start)
    assert not is_narrow(task.world, cart, (3.0, 4.0, 0.0))
    assert not is_narrow(task.world, turtlebot, task.start)


def test_the_rehearsal_and_physics_agree(cart: RobotSpec, monkeypatch: pytest.MonkeyPatch) -> None:
    rng, refused, left, step = np.random.default_rng(5), 0, 0, PurePursuit.step
    for _ in range(60):
        yaw, side, gap, along = rng.uniform((-0.7, -1, 0.01, -0.4), (0.7, 1, 0.25, 0.4))
        across = math.copysign(0.3 + gap + 0.3, side)
        at = (3 + along * math.cos(yaw) - across * math.sin(yaw), 3 + along * math.sin(yaw) + across * math.cos(yaw))
        world = World("random", (0, 0, 8, 6), (Disc(*at, 0.3),))
        assert not overlap_at(world, cart, (3.0, 3.0, yaw))
        task = Task(world, (3.0, 3.0, float(yaw)), (6.5, 3.0), cell=0.1)
        s = Scenario(task=task, planner=load_planner("astar"), robot=cart)
        planned = plan(s)
        with monkeypatch.context() as patch:
            patch.setattr("antdrive.sim.pipeline.cannot_leave", lambda *_: "")
            patch.setattr(PurePursuit, "step", lambda self, path, *now: step(self, path.for_any_turn, *now))
            driven = run(s)
        said = "" if planned[1].solved else planned[1].reason
        assert ("would bring" in said) == (driven.outcome is Outcome.COLLIDED), (yaw, at, said, driven.outcome)
        refused, left = refused + bool(said), left + (not said)
    assert min(refused, left) > 9


@pytest.mark.parametrize("side", [-1, 1])
@pytest.mark.parametrize("gap", [0.02, 0.05, 0.08])
def test_a_rectangle_does_not_turn_into_a_post_on_its_way(jackal: RobotSpec, side: int, gap: float) -> None:
    """The route turns back beside a post that the rectangle passes, and that its corners would meet in a turn."""
    post = Disc(3.0, 3.0 - side * (jackal.footprint.half_width + gap + 0.1), 0.1)
    goal = (1.3, 3.0 + 1.5 * side)
    task = Task(World("corner", (0, 0, 6, 6), (post,)), (1.0, 3.0, 0.0), goal, cell=0.1)
    controller = PurePursuit()
    route = Route(np.array([(1.0, 3.0), (3.0, 3.0), goal]))
    tracked = controller.prepare(route, task.world, jackal, 0.03, 1 / 60)
    ends = {}
    for name, path in (("checked", tracked), ("any turn", tracked.for_any_turn)):
        with Engine(task.world, jackal) as engine:
            ends[name] = drive(engine, controller, path, task, time_limit=20)
    assert ends["any turn"].outcome is Outcome.COLLIDED
    assert LIMITERS[ends["any turn"].limiter[-1]] == "rotate"
    assert ends["checked"].outcome is Outcome.STUCK
    assert ends["checked"].clearance.min() > 0.9 * gap


@pytest.mark.parametrize("side", [-1, 1])
def test_a_robot_that_is_not_centred_turns_the_longer_way_where_the_shorter_is_blocked(side: int) -> None:
    """A post stands beside the long nose, on the side of the goal, which is behind: the nose gets there past the other side."""
    robot, start = load_robot("warehouse"), (4.0, 4.0, 0.0)
    post = Disc(4.3, 4.0 + 0.46 * side, 0.05)
    task = Task(World("nose", (0, 0, 8, 8), (post,)), start, (2.0, 4.0 + 3.0 * side), cell=0.1)
    done = run(Scenario(task=task, planner=load_planner("astar"), robot=robot))
    assert done.succeeded, (done.reason, done.certificate)
    assert done.rollout is not None
    turned = np.unwrap(done.rollout.pose[:, 2])
    assert side * turned[np.abs(turned).argmax()] < 0, "away from the post"
    assert np.abs(turned).max() > math.pi, "more than half a turn"
    closed = dataclasses.replace(task.world, obstacles=(post, Disc(4.3, 4.0 - 0.46 * side, 0.05)))
    refused = run(Scenario(task=dataclasses.replace(task, world=closed), planner=load_planner("astar"), robot=robot))
    assert (refused.outcome, "turning on the spot" in refused.reason) == (Outcome.NO_PATH, True), refused.reason
