"""Movers have bodies only near the robot, and these are where they would be if they had always been there."""

import itertools
import math

import numpy as np
import numpy.typing as npt
import pytest

from antdrive.robots import RobotSpec
from antdrive.sim import Engine
from antdrive.sim.physics import movers as bodies_of_movers
from antdrive.worlds import Cruising, Keyframed, Mover, Trajectories, Wandering, World

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


def drive(
    spec: RobotSpec, hz: int, steps: int
) -> tuple[list[dict[int, tuple[float, ...]]], npt.NDArray[np.float64], list[tuple[float, ...]]]:
    """The movers' bodies by step: places and velocities; the robot's states; and its contacts, with their steps."""
    world = World("crowd", BOUNDS, movers=CROWD)
    bodies, states, contacts = [], [], []
    with Engine(world, spec, physics_hz=hz, trajectories=Trajectories.of(world, (0.0, 0.0))) as engine:
        assert engine._movers is not None
        engine.place((0.0, 0.0, 0.4))
        for k in range(steps):
            engine.command(0.5, 0.3 * math.sin(k / 100))
            contacts += [(float(k), *contact) for contact in engine.step()]
            states.append(tuple(engine.state()))
            places = engine.mover_positions()
            bodies.append({
                m: (*places[m].tolist(), *engine._p.getBaseVelocity(body, engine._client)[0][:2])
                for m, body in engine._movers.bodies.items()
            })  # fmt: skip
    return bodies, np.array(states), contacts


@pytest.mark.parametrize("hz", [60, 240])
def test_bodies_that_come_and_go_change_no_bit(turtlebot: RobotSpec, hz: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """Every body is where it is when all movers always have one, so contacts and the robot's way are the same."""
    steps = 20 * hz
    bodies, states, contacts = drive(turtlebot, hz, steps)
    monkeypatch.setattr(bodies_of_movers, "MARGIN", math.inf)
    always, same_states, same_contacts = drive(turtlebot, hz, steps)
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


@pytest.mark.parametrize("hz", [60, 240])
def test_a_mover_that_could_be_touched_within_a_window_has_a_body(turtlebot: RobotSpec, hz: int) -> None:
    world = World("crowd", BOUNDS, movers=CROWD)
    trajectories = Trajectories.of(world, (0.0, 0.0))
    with Engine(world, turtlebot, physics_hz=hz, trajectories=trajectories) as engine:
        assert engine._movers is not None
        engine.place((0.0, 0.0, 0.0))
        for k in range(15 * hz):
            engine.step()
            x, y = engine.state()[:2]
            away = np.hypot(*(trajectories.positions((k + 1) / hz)[0] - (x, y)).T) - trajectories.radii
            near = np.flatnonzero(away <= turtlebot.radius + bodies_of_movers.MARGIN)
            assert engine._movers.bodies.keys() >= set(near.tolist())


def test_the_track_is_that_of_the_trajectories(turtlebot: RobotSpec) -> None:
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
