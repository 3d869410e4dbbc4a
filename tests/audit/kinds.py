"""Kinds of drives: the product of every choice that the settings of a scenario declare, and random drives of each kind.

Genuine drives and the drives behind forgeries are drawn from it. A new choice of a setting is a new kind at once; a new setting
without choices needs an entry in `VALUES`.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping
from typing import Any, TypeAlias, get_args

import numpy as np

from antdrive.base.errors import FieldError, InputError
from antdrive.planners import PLANNERS
from antdrive.robots import Avoidance, PurePursuit, RobotSpec
from antdrive.sim import Perception, ReplanPolicy, Scenario
from antdrive.sim.policy import PerceptionKind
from antdrive.sim.settings import SETTINGS, DeclaredSetting
from antdrive.worlds import Cruising, Disc, Keyframed, Task, Wandering, World
from benchmarks.drives import with_lidar

DriveKind: TypeAlias = Mapping[str, Any]  # the values of some settings; may name a planner

STILL = "still"  # in place of a perception: the world has no movers
#: Values of settings that are no words; the first is the default.
VALUES: Mapping[str, tuple[Any, ...]] = {
    "perception": (STILL, *get_args(PerceptionKind)),
    "noise": (0.0, 1.0),
    "margin": (None, 0.05),
    "cell": (None, 0.1),
    "odometry": (1.0, 0.5),
    "controller": (PurePursuit(), PurePursuit(lookahead_time=0.8)),
    "avoidance": (Avoidance(), None),
    "replanning": (ReplanPolicy(), ReplanPolicy(around_movers=False)),
    "unseen": ((), (Disc(0.1, 0.1, 0.05),)),
    "time_limit": (None, 3.0),
    "physics_hz": (240, 120),
    "control_hz": (60, 30),
    "seed": (0, 1, 2, 3),
}
#: The settings whose choices are all combined; other settings have another value than their first in one of `RARELY` drives.
CROSSED = ("footprint", "map", "perception", "noise")
RARELY = 8
ROBOTS = ("jackal", "husky", "warehouse", "turtlebot3-burger", "turtlebot3-waffle", "pioneer3dx")  # no discs
DISCS = ("turtlebot", "turtlebot4")
DISC_SHARE = 0.3  # share of disc-shaped robots among plans for the disc
LONGEST = 25.0  # time limit of the drives [s]
GATE_SHARE = 0.5  # share of worlds with a gate that is too narrow for the disc
QUICK = ("astar", "dijkstra", "dstar", "dstar-lite", "sipp", "tangent")  # planners of most drives; others take seconds


def axes(settings: Mapping[str, DeclaredSetting] = SETTINGS) -> dict[str, tuple[Any, ...]]:
    """Return the values of every setting, its default first.

    Raises:
        KeyError: a setting has neither choices nor an entry in `VALUES`.
    """
    found = {name: one.setting.choices or VALUES[name] for name, one in settings.items()}
    return {
        name: values
        if name in VALUES
        else (settings[name].default, *(one for one in values if one != settings[name].default))
        for name, values in found.items()
    }


def crossed() -> list[DriveKind]:
    """Return every combination of the settings in `CROSSED`."""
    choices = axes()
    return [dict(zip(CROSSED, one, strict=True)) for one in itertools.product(*(choices[name] for name in CROSSED))]


def scenario(kind: DriveKind, rng: np.random.Generator) -> Scenario:
    """Draw a scenario of a kind: a small world, a robot, a planner, and the other settings.

    Raises:
        LookupError: no drive has this kind.
    """
    for _ in range(400):
        try:
            return _drawn(kind, rng)
        except (FieldError, InputError):  # settings that exclude each other, or a start in an obstacle
            continue
    raise LookupError(f"no drive is of the kind {dict(kind)}")


def _drawn(kind: DriveKind, rng: np.random.Generator) -> Scenario:
    values = {name: _value(choices, rng) for name, choices in axes().items()} | dict(kind)
    seen = values.pop("perception")
    disc = values["footprint"] == "disc" and rng.random() < DISC_SHARE
    robot = with_lidar(str(rng.choice(DISCS if disc else ROBOTS)))
    values["perception"] = None if seen == STILL else Perception(kind=seen)
    planner = str(rng.choice(QUICK if rng.integers(RARELY) else list(PLANNERS)))
    planner = values.pop("planner", planner)
    options = {"iterations": 5} if hasattr(PLANNERS[planner], "iterations") else {}
    task = task_of(rng, robot, moving=seen != STILL)
    return Scenario.of(task, planner, robot, options=options, **values)


def _value(choices: tuple[Any, ...], rng: np.random.Generator) -> Any:
    return choices[0] if rng.integers(RARELY) else choices[rng.integers(len(choices))]


def task_of(rng: np.random.Generator, robot: RobotSpec, *, moving: bool) -> Task:
    """Draw a small world with start and goal for a robot: posts, often a gate that its disc does not fit through, movers."""
    unit = max(0.25, robot.radius)
    width, height = 8 * unit, 5 * unit
    start = (1.4 * unit, float(rng.uniform(1.5, 3.5)) * unit, float(rng.choice([0.0, rng.uniform(-math.pi, math.pi)])))
    goal = (6.6 * unit, float(rng.uniform(0.8, 4.2)) * unit)
    posts = []
    for x, y, radius in rng.uniform((2.6, 0.0, 0.1), (7.8, 5.0, 0.45), (rng.integers(1, 6), 3)) * unit:
        if math.dist((x, y), goal) > radius + 0.6 * unit:
            posts.append(Disc(float(x), float(y), float(radius)))
    if rng.random() < GATE_SHARE:
        room, half = robot.footprint.inner_radius, 0.12 * unit
        gap, middle = (
            float(rng.uniform(*sorted((room + 0.05, robot.radius + 0.03)))),
            float(rng.uniform(1.5, 3.5)) * unit,
        )
        low, high = (
            np.arange(middle - gap - half, -half, -2 * half),
            np.arange(middle + gap + half, height + half, 2 * half),
        )
        posts = [disc for disc in posts if abs(disc.x - 4 * unit) > disc.radius + 1.2 * unit]
        posts += [Disc(4 * unit, float(y), half) for y in (*low, *high) if 0 < y < height]
    world = World("kind", (0.0, 0.0, width, height), tuple(posts), movers=_movers(rng, unit) if moving else ())
    tolerance, cell = float(rng.uniform(0.1, 0.3)), float(rng.choice([0.05, 0.1, 0.2]))
    return Task(world, start, goal, goal_tolerance=tolerance, cell=cell, time_limit=LONGEST)


def _movers(rng: np.random.Generator, unit: float) -> tuple[Any, ...]:
    x, y = (rng.uniform((3.0, 0.5), (6.0, 4.5)) * unit).tolist()
    speed = 0.3 * unit * float(rng.choice([-1, 1]))
    to_and_fro = Keyframed(radius=0.2 * unit, keyframes=((0.0, x, 0.8 * unit), (8.0, x, 4.2 * unit)))
    some = (
        Cruising(radius=0.25 * unit, position=(x, y), velocity=(0.1 * speed, speed)),
        to_and_fro,
        Wandering(radius=0.2 * unit, cell=unit, period=4.0, start=(5.5 * unit, 2.5 * unit)),
    )
    return some[: rng.integers(1, 3)] if rng.random() < 0.7 else some[2:]
