"""Worlds of many cylinders: only those around the robot have bodies, and nothing else changes."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
import pytest

from antdrive.robots import load_robot
from antdrive.sim import Scenario, run
from antdrive.sim.physics import engine as engines
from antdrive.sim.physics.engine import Contact, Engine
from antdrive.sim.physics.near import HOLD, NearBodies
from antdrive.worlds import Disc, Task, World

ROBOT = load_robot("turtlebot")


def street(count: int = 60) -> Task:
    """A street of 12 m between two rows of cylinders of two sizes."""
    xs = np.linspace(0.3, 13.7, count).tolist()
    discs = [Disc(x, y, 0.08 if i % 3 else 0.1, 0.4) for i, x in enumerate(xs) for y in (0.3, 1.7)]
    return Task(World("street", (0.0, 0.0, 14.0, 2.0), tuple(discs)), (1.0, 1.0, 0.0), (13.0, 1.0), cell=0.1)


@pytest.fixture
def few(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """What is done in worlds of more than 1000 cylinders is done in those of more than 20."""
    monkeypatch.setattr(engines, "MANY_BODIES", 20)
    return


def test_a_drive_is_the_same_bit_for_bit(few: None, monkeypatch: pytest.MonkeyPatch) -> None:
    near = run(Scenario.of(street(), "astar"))
    monkeypatch.setattr(engines, "MANY_BODIES", 10_000)
    whole = run(Scenario.of(street(), "astar"))
    assert near.rollout is not None
    assert whole.rollout is not None
    assert near.succeeded
    assert near.rollout.digest == whole.rollout.digest


def test_a_cylinder_far_from_the_start_is_touched_as_the_cylinder_that_it_is(few: None) -> None:
    task = street()
    hidden = Disc(9.0, 1.0, 0.2, 0.5)
    done = run(Scenario.of(task, "astar", unseen=(hidden,)))
    assert done.rollout is not None
    assert done.rollout.outcome.key == "collided"
    assert set(done.rollout.contacts[:, 1]) == {len(task.world.obstacles)}


def test_only_cylinders_in_reach_have_bodies_wherever_the_robot_goes(few: None) -> None:
    task = street()
    discs = task.world.discs
    with Engine(task.world, ROBOT) as engine:
        engine.place(task.start)
        assert engine._near is not None
        for x in (1.0, 4.0, 5.5, 9.0, 3.0):
            engine._near.follow(x, 1.0)
            away = np.hypot(discs[:, 0] - x, discs[:, 1] - 1.0) - discs[:, 2]
            made = set(engine._near._made)
            assert set(np.flatnonzero(away <= ROBOT.radius + 0.2).tolist()) <= made
            assert len(made) < len(discs) / 2
            for index, body in engine._near._made.items():
                place, _ = engine._p.getBasePositionAndOrientation(body, engine._client)
                assert place == pytest.approx((task.world.obstacles[index].x, task.world.obstacles[index].y, 0.2))
            waiting = [body for bodies in engine._near._spare.values() for body in bodies]
            assert not {engine._obstacles.get(body) for body in waiting} - {None}


def test_a_placed_robot_meets_the_cylinders_there(few: None) -> None:
    task = street()
    with Engine(task.world, ROBOT) as engine:
        for x in (1.0, 12.0, 1.0):
            engine.place((x, 1.0, 0.0))
            assert engine.contacts() == []
        near = min(range(len(task.world.obstacles)), key=lambda i: abs(task.world.obstacles[i].x - 7.0))
        disc = task.world.obstacles[near]
        engine.place((disc.x, disc.y, 0.0))
        touched = engine.contacts()
        assert all(isinstance(contact, Contact) for contact in touched)
        assert near in {contact.obstacle for contact in touched}


def test_a_body_out_of_place_would_be_seen(few: None, monkeypatch: pytest.MonkeyPatch) -> None:
    """Without looking again on the way, the robot drives through what had no body at the start."""
    monkeypatch.setattr(NearBodies, "follow", lambda self, x, y: _first_only(self, x, y))
    done = run(Scenario.of(street(), "astar", unseen=(Disc(9.0, 1.0, 0.2, 0.5),)))
    assert done.rollout is not None
    assert not len(done.rollout.contacts)
    assert done.certificate is not None
    assert not done.certificate.certified


_follow = NearBodies.follow


def _first_only(bodies: NearBodies, x: float, y: float) -> None:
    if math.isinf(bodies._centre[0]):
        _follow(bodies, x, y)


def test_bodies_are_looked_for_before_the_robot_can_get_to_the_edge() -> None:
    """The reach holds what the fastest robot drives between two looks, after the last of which it may be HOLD away."""
    with Engine(street().world, ROBOT) as engine:
        bodies = engine._near_bodies()
    least = HOLD + ROBOT.radius + 1.5 * ROBOT.max_speed * engines.LOOK_EVERY / 240
    assert bodies._reach > least
