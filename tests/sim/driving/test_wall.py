"""The wall of truth: a robot acts by what it observes, and by nothing else."""

from __future__ import annotations

import dataclasses
import inspect
import math

import numpy as np
import pytest

from antdrive.robots import CONTROLLERS
from antdrive.robots.controllers.coulter import Coulter
from antdrive.sim import Perception, Scenario
from antdrive.sim.driving.driver import Driver
from antdrive.sim.driving.senses import MoverSense
from antdrive.sim.pipeline import driven
from antdrive.worlds import Cruising, Disc, Keyframed, Task, Trajectories, World
from tests.records import changed

ROOM = World("room", (0.0, 0.0, 12.0, 6.0), (Disc(3.0, 4.6, 0.3), Disc(5.0, 4.0, 0.4)))
TASK = Task(ROOM, (1.0, 3.0, 0.0), (9.0, 3.0), cell=0.2)
TURNS = ((0.0, 3.4, 1.0), (3.0, 3.4, 2.2))  # a mover that walks up, and whose way is another from 3 s on
UP, DOWN = (Keyframed(radius=0.2, keyframes=(*TURNS, (6.0, 3.4, y)), loop="once") for y in (4.0, 0.8))
FAR = Cruising(radius=0.3, position=(9.5, 5.0), velocity=(-0.4, -0.2))
#: What is true in a second drive, unlike in the first, and what the robot has: it does not know the difference at first.
KINDS = {
    "obstacles that no sensor sees": ({"unseen": (Disc(4.0, 3.0, 0.1),)}, {}),
    "obstacles behind others": ({"unseen": (Disc(5.8, 4.2, 0.1),)}, {"map": "none", "robot": "turtlebot4"}),
    "the same with noise": (
        {"unseen": (Disc(5.8, 4.2, 0.1),)},
        {"map": "none", "robot": "turtlebot4", "noise": 1.0, "localisation": "matching"},
    ),
    "a mover's later way": ({"movers": (DOWN,)}, {"movers": (UP,)}),
    "a mover's later way by lidar": (
        {"movers": (DOWN,)},
        {"movers": (UP,), "robot": "jackal", "perception": Perception(kind="lidar"), "noise": 1.0},
    ),
    "a mover's later way without a map": ({"movers": (DOWN,)}, {"movers": (UP,), "robot": "jackal", "map": "none"}),
    "a mover out of range": (
        {"movers": (UP, dataclasses.replace(FAR, velocity=(-0.5, -0.25)))},
        {"movers": (UP, FAR), "perception": Perception(range=2.0)},
    ),
}
#: Kinds of drives for every controller but the default, which drives in all.
BRIEF = "obstacles that no sensor sees", "the same with noise", "a mover's later way"
DRIVES = [("pure-pursuit", kind) for kind in KINDS]
DRIVES += [(name, kind) for name in CONTROLLERS if name != "pure-pursuit" for kind in BRIEF]


@dataclasses.dataclass(frozen=True, kw_only=True)
class Peeking(Coulter):
    """Looks up the stack for the scenario, where the truth is."""

    def step(self, now, path, arc):
        frame = inspect.currentframe()
        while frame.f_code.co_name != "driven":
            frame = frame.f_back
        down = now.t > 1 and frame.f_locals["s"].task.world.movers == (DOWN,)
        command, arc = super().step(now, path, arc)
        return command._replace(speed=command.speed / (1 + down)), arc


def acted(monkeypatch, movers=(), robot="turtlebot", **settings):
    """The observations and the actions of a drive."""
    found, act = [], Driver.act

    def recorded(self, now):
        action = act(self, now)
        found.append((now, action))
        return action

    with monkeypatch.context() as patch:
        patch.setattr(Driver, "act", recorded)
        driven(Scenario.of(changed(TASK, "world", movers=movers), "astar", robot, time_limit=8.0, **settings))
    return found


def same(one, other):
    return all(np.array_equal(a, b, equal_nan=True) for a, b in zip(parts(one), parts(other), strict=True))


def parts(now):
    return [*now[:4], now.scan if now.scan is not None else math.nan, *now.movers]


def unlike(monkeypatch, truth, robot):
    """The control periods in which two drives act unlike each other before they observe a difference."""
    one, other = acted(monkeypatch, **robot), acted(monkeypatch, **{**robot, **truth})
    pairs = list(zip(one, other, strict=False))
    alike = next((k for k, (a, b) in enumerate(pairs) if not same(a[0], b[0])), len(pairs))
    assert alike > 30, "the drives differ too soon to tell anything"
    return [now.tick for (now, action), (_, again) in pairs[:alike] if action != again]


@pytest.mark.parametrize(("name", "kind"), DRIVES)
def test_robots_act_alike_until_they_observe_a_difference(name, kind, monkeypatch):
    truth, robot = KINDS[kind]
    assert unlike(monkeypatch, truth, {**robot, "controller": name}) == []


def test_a_controller_that_reaches_for_the_truth_is_found(monkeypatch):
    truth, robot = KINDS["a mover's later way"]
    assert unlike(monkeypatch, truth, {**robot, "controller": Peeking()})


def test_a_robot_that_is_given_the_later_ways_of_movers_acts_on_them(monkeypatch):
    """So the test above finds a mind that knows more than it observes."""
    truth, robot = KINDS["a mover's later way"]
    assert unlike(monkeypatch, truth, {**robot, "perception": Perception(kind="motions")})


def test_a_robot_is_given_the_movers_near_its_range_and_their_motion_since_the_last_period():
    world = World("w", ROOM.bounds, movers=(UP, FAR))
    truth = Trajectories.of(world, TASK.start[:2])
    seen = MoverSense(truth, Perception(kind="positions", range=2.0), 10).read(7, (6.5, 1.0))
    assert seen.numbers.tolist() == [0]
    at = truth.positions([0.6, 0.7])[:, 0]
    np.testing.assert_allclose(seen.positions, at[1:])
    np.testing.assert_allclose(seen.velocities, 10 * np.diff(at, axis=0))
    assert MoverSense(truth, Perception(range=2.5), 10).read(7, (6.5, 1.0)).numbers.tolist() == [0, 1]
