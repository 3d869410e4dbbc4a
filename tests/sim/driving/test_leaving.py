"""Leaving a start where a rectangle cannot turn freely: the rehearsal and physics agree."""

from __future__ import annotations

import math
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from antdrive.robots import LIMITERS, Footprint, PurePursuit, PursuitState, Twist, load_robot, overlap_at
from antdrive.sim import Engine, Outcome, Scenario, plan, run
from antdrive.sim.driving.drive import follow
from antdrive.sim.driving.leaving import cannot_leave, is_narrow
from antdrive.worlds import Disc, Route, Task, World
from tests.records import COARSE, changed
from tests.sim.driving.test_driver import driver


@pytest.fixture(scope="module")
def cart(jackal):
    return replace(jackal, name="cart", footprint=Footprint.rectangle(0.9, 0.6))


def beside(cart, gap, start=(3.0, 3.0, 0.0)):
    """A cart beside a cylinder on its right, with a goal ahead and to the left."""
    world = World("beside", (0, 0, 8, 6), (Disc(3.0, 3.0 - 0.3 - gap - 0.4, 0.4),))
    return Scenario.of(Task(world, start, (6.5, 5.0), cell=0.1), "astar", cart)


@pytest.mark.parametrize("gap", [0.05, 0.1, 0.2])
def test_a_cart_that_would_turn_into_a_cylinder_has_no_path(cart, gap):
    result = run(beside(cart, gap))
    assert (result.outcome, result.rollout) == (Outcome.NO_PATH, None)
    assert result.reason == (
        f"turning on the spot at the start would bring cart into obstacles[0] at (3, {2.3 - gap:g}) with radius 0.4; "
        f"a free turn needs 0.541 m around its centre, the start has {0.3 + gap:.3f} m"
    )
    assert plan(beside(cart, gap))[1].reason == result.reason


def test_a_cart_that_need_not_turn_leaves_a_narrow_start(cart):
    narrow = beside(cart, 0.2)
    ahead = changed(narrow, "task", goal=(6.5, 3.0))
    assert is_narrow(ahead.task.world, cart, ahead.task.start)
    assert run(ahead).succeeded


def test_room_for_a_turn_and_discs_are_not_narrow(cart, turtlebot):
    task = beside(cart, 0.05).task
    assert is_narrow(task.world, cart, task.start)
    assert not is_narrow(task.world, cart, (3.0, 4.0, 0.0))
    assert not is_narrow(task.world, turtlebot, task.start)


def test_the_rehearsal_and_physics_agree(cart, monkeypatch):
    rng, refused, left, step = np.random.default_rng(5), 0, 0, PurePursuit.pursue
    for _ in range(40):
        yaw, side, gap, along = rng.uniform((-0.7, -1, 0.01, -0.4), (0.7, 1, 0.25, 0.4))
        across = math.copysign(0.3 + gap + 0.3, side)
        at = (3 + along * math.cos(yaw) - across * math.sin(yaw), 3 + along * math.sin(yaw) + across * math.cos(yaw))
        world = World("random", (0, 0, 8, 6), (Disc(*at, 0.3),))
        assert not overlap_at(world, cart, (3.0, 3.0, yaw))
        task = Task(world, (3.0, 3.0, float(yaw)), (6.5, 3.0), cell=0.1)
        s = Scenario.of(task, "astar", cart, **COARSE)
        planned = plan(s)
        with monkeypatch.context() as patch:
            patch.setattr("antdrive.sim.driving.routes.cannot_leave", lambda *_: "")
            patch.setattr(
                PurePursuit, "pursue", lambda self, path, *now: step(self, path.ignoring_turn_clearance, *now)
            )
            driven = run(s)
        said = "" if planned[1].solved else planned[1].reason
        assert ("would bring" in said) == (driven.outcome is Outcome.COLLIDED), (yaw, at, said, driven.outcome)
        refused, left = refused + bool(said), left + (not said)
    assert min(refused, left) > 6


@pytest.mark.parametrize("side", [-1, 1])
@pytest.mark.parametrize("gap", [0.02, 0.05, 0.08])
def test_a_rectangle_does_not_turn_into_a_post_on_its_way(jackal, side, gap):
    """The route turns back beside a post that the rectangle passes, and that its corners would meet in a turn."""
    post = Disc(3.0, 3.0 - side * (jackal.footprint.half_width + gap + 0.1), 0.1)
    goal = (1.3, 3.0 + 1.5 * side)
    task = Task(World("corner", (0, 0, 6, 6), (post,)), (1.0, 3.0, 0.0), goal, cell=0.1)
    controller = PurePursuit()
    route = Route(np.array([(1.0, 3.0), (3.0, 3.0), goal]))
    tracked = controller.prepare(route, task.world, jackal, 0.03, 1 / 60)
    ends = {}
    for name, path in (("checked", tracked), ("any turn", tracked.ignoring_turn_clearance)):
        with Engine(task.world, jackal) as engine:
            ends[name] = follow(engine, controller, path, task, limit=20)
    assert ends["any turn"].outcome is Outcome.COLLIDED
    assert LIMITERS[ends["any turn"].limiter[-1]] == "rotate"
    assert ends["checked"].outcome is Outcome.STUCK
    assert ends["checked"].clearance.min() > 0.9 * gap


@pytest.mark.parametrize("side", [-1, 1])
def test_a_robot_that_is_not_centred_turns_the_longer_way_where_the_shorter_is_blocked(side):
    """A post stands beside the long nose, on the side of the goal, which is behind: the nose gets there past the other side."""
    robot, start = load_robot("warehouse"), (4.0, 4.0, 0.0)
    post = Disc(4.3, 4.0 + 0.46 * side, 0.05)
    task = Task(World("nose", (0, 0, 8, 8), (post,)), start, (2.0, 4.0 + 3.0 * side), cell=0.1)
    done = run(Scenario.of(task, "astar", robot, **COARSE))
    assert done.succeeded, (done.reason, done.certificate)
    turned = np.unwrap(done.rollout.pose[:, 2])
    assert side * turned[np.abs(turned).argmax()] < 0, "away from the post"
    assert np.abs(turned).max() > math.pi, "more than half a turn"
    closed = replace(task.world, obstacles=(post, Disc(4.3, 4.0 - 0.46 * side, 0.05)))
    refused = run(Scenario.of(replace(task, world=closed), "astar", robot))
    assert (refused.outcome, "turning on the spot" in refused.reason) == (Outcome.NO_PATH, True), refused.reason


def test_room_for_exactly_the_radius_is_narrow(turtlebot):
    """A point of the footprint would touch the wall."""
    cart = replace(turtlebot, footprint=Footprint.rectangle(0.6, 0.8))
    world = World("w", (0.0, 0.0, 6.0, 4.0))
    assert cart.radius == 0.5
    assert is_narrow(world, cart, (0.5, 2.0, 0.0))
    assert not is_narrow(world, cart, (0.501, 2.0, 0.0))


def test_the_first_motion_is_rehearsed_for_a_minute(turtlebot):
    """A controller that stays in a narrow place is left to the drive."""
    steps = []

    def step(*_):
        steps.append(1)
        return Twist(0.0, 0.0), PursuitState()

    cart = replace(turtlebot, footprint=Footprint.rectangle(0.6, 0.8))
    world = World("w", (0.0, 0.0, 6.0, 4.0))
    stays = SimpleNamespace(pursue=step)
    assert cannot_leave(driver(turtlebot).way.path, stays, world, cart, (0.45, 2.0, 0.0), 2) == ""
    assert len(steps) == 2 * 60
