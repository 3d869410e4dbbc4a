"""Movers and cylinders have bodies only near the robot, and nothing else changes."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest

from antdrive.robots import load_robot
from antdrive.sim import Engine, Scenario, run
from antdrive.sim.physics import engine as engines
from antdrive.sim.physics import movers as bodies_of_movers
from antdrive.sim.physics.engine import Contact
from antdrive.sim.physics.near import HOLD
from antdrive.worlds import Cruising, Disc, Keyframed, Mover, Task, Trajectories, Wandering, World

BOUNDS = (-10.0, -10.0, 10.0, 10.0)
ACROSS = ((0.0, -6.0, 0.3), (4.0, 5.0, -0.2), (7.0, -2.0, 1.0))
CROWD: tuple[Mover, ...] = (
    Keyframed(radius=0.3, keyframes=ACROSS, loop="teleport", phase=0.7),
    Keyframed(radius=0.3, keyframes=ACROSS, loop="pingpong", interpolation="catmull-rom"),
    Cruising(radius=0.3, position=(9.0, 0.6), velocity=(-1.7, 0.0)),
    Cruising(radius=0.2, position=(-9.0, -9.0), velocity=(3.1, 2.7)),
    Wandering(radius=0.2, cell=0.5, period=0.4, start=(2.0, 2.0), seed=3),
    Cruising(radius=0.4, position=(9.0, 9.0), velocity=(-0.01, 0.0)),
)


def crowded(spec, hz, steps):
    """The movers' bodies by step: places and velocities; the robot's states; and its contacts, with their steps."""
    world = World("crowd", BOUNDS, movers=CROWD)
    bodies, states, contacts = [], [], []
    with Engine(world, spec, physics_hz=hz, trajectories=Trajectories.of(world, (0.0, 0.0))) as engine:
        engine.place((0.0, 0.0, 0.4))
        for k in range(steps):
            engine.command(0.5, 0.3 * math.sin(k / 100))
            contacts += [(float(k), *contact) for contact in engine.step()]
            states.append(tuple(engine.state()))
            places = engine.mover_positions()
            bodies.append({
                m: (*places[m].tolist(), *engine._p.getBaseVelocity(body, engine._client)[0][:2])
                for m, body in engine._movers.held.items()
            })  # fmt: skip
    return bodies, np.array(states), contacts


@pytest.mark.parametrize("hz", [60, 240])
def test_bodies_that_come_and_go_change_no_bit(turtlebot, hz, monkeypatch):
    """Every body is where it is when all movers always have one, so contacts and the robot's way are the same."""
    steps = 8 * hz
    bodies, states, contacts = crowded(turtlebot, hz, steps)
    monkeypatch.setattr(bodies_of_movers, "MARGIN", math.inf)
    always, same_states, same_contacts = crowded(turtlebot, hz, steps)
    assert all(len(now) == len(CROWD) for now in always)
    for now, then in zip(bodies, always, strict=True):
        assert all(then[m] == here for m, here in now.items())
    assert contacts == same_contacts
    assert (states == same_states).all()
    assert contacts
    if hz == 240:  # a window is shorter than at 60 Hz
        counts = [len(now) for now in bodies]
        came = sum(len(later.keys() - now.keys()) for now, later in itertools.pairwise(bodies))
        assert came >= 5
        assert np.mean(counts) < 0.4 * len(CROWD)
        first, met = int(contacts[0][0]), int(contacts[0][1])
        assert any(met not in now for now in bodies[:first])  # what was met had not always had a body


def test_the_track_is_that_of_the_trajectories(turtlebot):
    world = World("crowd", BOUNDS, movers=CROWD)
    trajectories = Trajectories.of(world, (0.0, 0.0))
    with Engine(world, turtlebot, trajectories=trajectories) as engine:
        for steps in (700, 479, 1):  # placing the robot begins a new track
            engine.place((0.0, 0.0, 0.0))
            for _ in range(steps):
                engine.step()
            assert (engine.mover_track(steps + 1) == trajectories.positions(np.arange(steps + 1) / 240)).all()
    with Engine(World("empty", BOUNDS), turtlebot) as engine:
        assert engine.mover_track(7).shape == (7, 0, 2)


ROBOT = load_robot("turtlebot")


def street(count=60):
    """A street of 12 m between two rows of cylinders of two sizes."""
    xs = np.linspace(0.3, 13.7, count).tolist()
    discs = [Disc(x, y, 0.08 if i % 3 else 0.1, 0.4) for i, x in enumerate(xs) for y in (0.3, 1.7)]
    return Task(World("street", (0.0, 0.0, 14.0, 2.0), tuple(discs)), (1.0, 1.0, 0.0), (13.0, 1.0), cell=0.1)


@pytest.fixture
def few(monkeypatch):
    """What is done in worlds of more than 1000 cylinders is done in those of more than 20."""
    monkeypatch.setattr(engines, "MANY_BODIES", 20)


def test_a_drive_is_the_same_bit_for_bit(few, monkeypatch):
    near = run(Scenario.of(street(), "astar"))
    monkeypatch.setattr(engines, "MANY_BODIES", 10_000)
    whole = run(Scenario.of(street(), "astar"))
    assert near.succeeded
    assert near.rollout.digest == whole.rollout.digest


def test_a_cylinder_far_from_the_start_is_touched_as_the_cylinder_that_it_is(few):
    task = street()
    hidden = Disc(9.0, 1.0, 0.2, 0.5)
    done = run(Scenario.of(task, "astar", unseen=(hidden,)))
    assert done.rollout.outcome.key == "collided"
    assert set(done.rollout.contacts[:, 1]) == {len(task.world.obstacles)}


def test_only_cylinders_in_reach_have_bodies_wherever_the_robot_goes(few):
    task = street()
    discs = task.world.discs
    with Engine(task.world, ROBOT) as engine:
        engine.place(task.start)
        for x in (1.0, 4.0, 5.5, 9.0, 3.0):
            engine._near.follow(x, 1.0)
            away = np.hypot(discs[:, 0] - x, discs[:, 1] - 1.0) - discs[:, 2]
            made = set(engine._near._held())
            assert set(np.flatnonzero(away <= ROBOT.radius + 0.2).tolist()) <= made
            assert len(made) < len(discs) / 2
            assert engine.audit() == ""


def test_a_placed_robot_meets_the_cylinders_there(few):
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


def test_bodies_are_updated_before_the_robot_reaches_the_edge():
    """The reach holds what the fastest robot drives between two updates, after the last of which it may be HOLD away."""
    with Engine(street().world, ROBOT) as engine:
        bodies = engine._near_bodies()
    least = HOLD + ROBOT.radius + 1.5 * ROBOT.max_speed * engines.CHECK_EVERY / 240
    assert bodies._reach > least
