"""Every registered body is where its obstacle is, whatever comes and goes, and one that is not is found."""

import itertools
import math
from dataclasses import replace

import numpy as np
import pytest

from antdrive import Rollout, certify, run
from antdrive.sim import Engine, Scenario
from antdrive.sim.physics.bodies import BELOW
from antdrive.sim.physics.bullet import CHASSIS, OBSTACLE
from antdrive.worlds import Cruising, Disc, Keyframed, Task, Trajectories, World


def lane(cylinders, movers, seed):
    """A lane of 60 m between cylinders of several sizes, and movers that cross it or follow it."""
    rng = np.random.default_rng(seed)
    aside = rng.uniform(1.3, 9.0, cylinders) * rng.choice([-1, 1], cylinders)
    sizes = rng.choice([0.05, 0.08, 0.1], cylinders), rng.choice([0.02, 0.3, 1.0], cylinders)
    discs = zip(
        rng.uniform(-29, 29, cylinders).tolist(), aside.tolist(), *(size.tolist() for size in sizes), strict=True
    )
    moving = []
    for m in range(movers):
        x, y, speed, phase = rng.uniform((-27, -0.8, 0.3, 0), (-5, 0.8, 2.0, 5)).tolist()
        body = {"radius": (0.2, 0.3)[m % 2], "height": (0.5, 1.7)[m // 2 % 2], "phase": phase}
        if m % 3 < 2:
            moving.append(Cruising(position=(x, y), velocity=((0.1, speed), (speed, 0.05))[m % 3], **body))
        else:
            frames = ((0.0, x, -3.0), (6.0 / speed, x + 1.0, 3.0))
            moving.append(Keyframed(keyframes=frames, loop=("teleport", "pingpong")[m // 3 % 2], **body))
    return World("lane", (-30.0, -10.0, 30.0, 10.0), tuple(Disc(*disc) for disc in discs), movers=tuple(moving))


def misplaced(engine):
    """Contact indices of bodies that PyBullet has elsewhere, of what lacks one, and numbers of bodies that are used twice.

    It shares no code with the audit.
    """
    world, held, robot, found = engine.world, engine._bodies.held, engine.state(), []
    moving = engine.trajectories.positions(engine.time)[0].tolist() if world.movers else []
    places = [(disc.x, disc.y, max(disc.height, 0.05) / 2) for disc in world.obstacles]
    places += [(*place, mover.height / 2) for place, mover in zip(moving, world.movers, strict=True)]
    (x0, y0, x1, y1), (x, y) = world.bounds, np.mean(np.reshape(world.bounds, (2, 2)), axis=0)
    places += [(x0 - 0.1, y, None), (x1 + 0.1, y, None), (x, y0 - 0.1, None), (x, y1 + 0.1, None)]

    def place_of(body):
        return engine._p.getBasePositionAndOrientation(body, engine._client)[0]

    for index, body in held.items():
        there = [(a, b) for a, b in zip(place_of(body), places[index], strict=True) if b is not None]
        found += [index] if max(abs(a - b) for a, b in there) > 1e-7 or engine._bodies.index[body] != index else []
    for index, cylinder in enumerate((*world.obstacles, *world.movers)):
        close = math.dist(places[index][:2], robot[:2]) - cylinder.radius - engine.robot.radius < 0.1
        found += [index] if close and index not in held else []
    parked = [body for same in engine._bodies._parked.values() for body in same]
    found += [body for body in parked if place_of(body)[2] != BELOW]
    numbers = sorted([*held.values(), *parked])
    return found + [a for a, b in itertools.pairwise(numbers) if a == b]


def random_drive(world, robot, seed, seconds):
    """Drive along the lane at random; return the number of swaps, after each of which the oracle has looked."""
    rng, swaps = np.random.default_rng(seed), 0
    with Engine(world, robot, trajectories=Trajectories.of(world, (-28.0, 0.0)) if world.movers else None) as engine:
        engine.place((-28.0, 0.0, 0.0))
        before = None
        for k in range(round(240 * seconds)):
            if k % 60 == 0:
                _, y, yaw, *_ = engine.state()
                turn = rng.uniform(-0.5, 0.5) - 1.5 * y - 2.0 * yaw
                engine.command(robot.max_speed * rng.uniform(0.5, 1.0), min(1.5, max(-1.5, turn)))
            engine.step()
            if engine._bodies.held != before:
                before, swaps = dict(engine._bodies.held), swaps + 1
                assert misplaced(engine) == []
                assert engine.audit() == ""
        assert misplaced(engine) == []
        assert engine.audit() == ""
    return swaps


@pytest.mark.parametrize(("cylinders", "movers"), [(1100, 6), (400, 12)])
def test_bodies_are_in_place_after_every_swap(cylinders, movers, jackal):
    assert random_drive(lane(cylinders, movers, 1), jackal, 1, 5.0) > 4


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(50))
def test_bodies_are_in_place_after_every_swap_of_long_drives(seed, turtlebot, jackal):
    cylinders = (1100, 2500, 5000, 12000)[seed % 4]
    movers = (1, 2, 4, 8, 16, 24)[seed % 6]
    assert random_drive(lane(cylinders, movers, seed), (turtlebot, jackal)[seed // 4 % 2], seed, 15.0) > 3


def test_a_mover_that_jumps_in_the_first_step_is_in_place(turtlebot):
    """Its body begins the step away from the trajectory, so that it ends on it."""
    shuttle = Keyframed(radius=0.2, keyframes=((0.0, -0.5, 0.5), (2.0, 0.5, 0.5)), loop="teleport", phase=1.999)
    world = World("shuttle", (-3, -3, 3, 3), movers=(shuttle,))
    with Engine(world, turtlebot, trajectories=Trajectories.of(world, (0.0, 0.0))) as engine:
        engine.place((0.0, 0.0, 0.0))
        assert engine.audit() == ""
        for _ in range(3):
            engine.step()
            assert engine.audit() == ""
            assert misplaced(engine) == []


def cylinder(engine):
    return next(index for index in engine._bodies.held if index < len(engine.world.obstacles))


def mover(engine):
    first = len(engine.world.obstacles)
    return next(i for i in engine._bodies.held if first <= i < first + len(engine.world.movers))


def shift(engine, body, by):
    place, turn = engine._p.getBasePositionAndOrientation(body, engine._client)
    place = tuple(np.add(place, by).tolist())
    engine._p.resetBasePositionAndOrientation(body, place, turn, physicsClientId=engine._client)


def move(kind):
    return lambda engine, bodies: shift(engine, bodies.held[kind(engine)], (0.001, 0, 0))


def lift(engine, bodies):
    index = cylinder(engine)
    body = bodies.held[index]
    bodies.park(index)
    engine.step()
    shift(engine, body, (0, 0, -BELOW))


def swap(first, second):
    def plant(engine, bodies):
        a = first(engine)
        b = second(engine) if second is not first else next(i for i in bodies.held if a < i < 1100)
        bodies.held[a], bodies.held[b] = bodies.held[b], bodies.held[a]
        bodies.index.update({bodies.held[a]: a, bodies.held[b]: b})

    return plant


def remove(engine, bodies):
    engine._p.removeBody(bodies.held[cylinder(engine)], physicsClientId=engine._client)


def remove_and_reuse(engine, bodies):
    body = bodies.held[cylinder(engine)]
    remove(engine, bodies)
    assert engine._p.createMultiBody(0, 0, basePosition=(0, 0, 9), physicsClientId=engine._client) == body


def resize(engine, bodies):
    index = cylinder(engine)
    disc = engine.world.obstacles[index]
    bodies.park(index)
    shape = engine._shape_of(replace(disc, radius=disc.radius + 0.001))
    engine._build_obstacles([index], shape, [(disc.x, disc.y, max(disc.height, 0.05) / 2)])


def share(engine, bodies):
    index = cylinder(engine)
    bodies.held[index + 1] = bodies.held[index]


def forget(index_of):
    def plant(engine, bodies):
        body = bodies.held.pop(index_of(engine))
        del bodies.index[body], bodies._shapes[body]

    return plant


def beside(engine):
    """The cylinder that the robot is placed next to."""
    disc = engine.world.obstacles[7]
    engine.place((disc.x, disc.y - disc.radius - engine.robot.radius - 0.05, 0.0))
    engine.step()
    return 7


def swerve(engine, bodies):
    body = bodies.held[mover(engine)]
    engine._p.resetBaseVelocity(body, (0.1, 0.1, 0), (0, 0, 0), physicsClientId=engine._client)


FAULTS = {
    "a cylinder is moved": (move(cylinder), "of obstacle"),
    "a mover is moved": (move(mover), "of movers["),
    "a wall is moved": (move(lambda engine: len(engine.world.obstacles) + 6 + 3), "of the upper wall"),
    "a mover has another velocity": (swerve, "of movers["),
    "a parked body is lifted": (lift, "of no obstacle"),
    "two cylinders are swapped": (swap(cylinder, cylinder), "of obstacle"),
    "a cylinder and a mover are swapped": (swap(cylinder, mover), "m off its place"),
    "a body is removed": (remove, "does not exist"),
    "a removed number is reused": (remove_and_reuse, "of obstacle"),
    "a cylinder has another size": (resize, "0.001 m off its place"),
    "two cylinders share a body": (share, "has no body of its own"),
    "a near cylinder has none": (forget(beside), "obstacles[7] has no body of its own"),
    "a wall has none": (forget(lambda engine: len(engine.world.obstacles) + 6), "the left wall has no body of its own"),
}


@pytest.mark.parametrize("fault", FAULTS)
def test_a_planted_fault_is_found(fault, turtlebot):
    plant, words = FAULTS[fault]
    world = lane(1100, 6, 1)
    meeting = Cruising(radius=0.3, position=(-27.0, 0.0), velocity=(-0.5, 0.1))
    world = replace(world, movers=(meeting, *world.movers[1:]))
    with Engine(world, turtlebot, trajectories=Trajectories.of(world, (-28.0, 0.0))) as engine:
        engine.place((-28.0, 0.0, 0.0))
        for _ in range(9):
            engine.step()
        assert engine.audit() == ""
        plant(engine, engine._bodies)
        engine.step()
        assert words in engine.audit()


OPEN = Task(World("open", (-1, -2, 4, 2), (Disc(2.0, 1.5, 0.1), Disc(2.0, -1.5, 0.1))), (0.0, 0.0, 0.0), (3.0, 0.0))


@pytest.fixture
def faulty(monkeypatch):
    """Drive in a world after a fault planted after a second."""

    def drive(plant):
        command = Engine.command

        def planting(engine, speed, yaw_rate):
            command(engine, speed, yaw_rate)
            if engine._steps == 240:
                plant(engine, engine._bodies)

        with monkeypatch.context() as patch:
            patch.setattr(Engine, "command", planting)
            return run(Scenario.of(OPEN, "astar"))

    return drive


def test_a_drive_with_a_misplaced_body_is_not_certified_and_the_log_says_why(faulty, tmp_path):
    done = faulty(move(cylinder))
    assert (done.outcome.key, done.succeeded) == ("succeeded", False)
    assert done.rollout.record.physics.startswith("body 2 of obstacles[0] is 0.001 m off its place at t = ")
    assert done.certificate.problems == (f"physics: its contacts are no evidence, since {done.rollout.record.physics}",)
    done.rollout.save(tmp_path / "log.npz")
    assert certify(Rollout.load(tmp_path / "log.npz")) == done.certificate


def test_a_contact_with_an_unknown_body_is_no_error_and_no_certificate(faulty):
    def plant(engine, bodies):
        shape = engine._shape_of(Disc(1.5, 0.0, 0.2))
        body = engine._p.createMultiBody(0, shape, basePosition=(1.5, 0.0, 0.5), physicsClientId=engine._client)
        engine._p.setCollisionFilterGroupMask(body, -1, OBSTACLE, CHASSIS, physicsClientId=engine._client)

    done = faulty(plant)
    assert done.rollout.record.physics.startswith(
        "physics reports a contact with body 8, which is of no obstacle at t ="
    )
    assert not done.certificate.certified


def test_a_fault_is_found_at_the_swap_and_not_forgotten(faulty):
    """A body put into its place later has missed contacts meanwhile."""

    def plant(engine, bodies):
        bodies.move(0, (2.0, 1.6, 0.5))
        bodies.fresh.add(bodies.held[0])
        engine.step()
        bodies.move(0, (2.0, 1.5, 0.5))

    assert faulty(plant).rollout.record.physics == "body 2 of obstacles[0] is 0.1 m off its place at t = 1.004 s"


def test_a_drive_with_its_bodies_in_place_says_nothing_about_them():
    done = run(Scenario.of(OPEN, "astar"))
    assert done.succeeded
    assert "physics" not in done.rollout.record.as_dict()
