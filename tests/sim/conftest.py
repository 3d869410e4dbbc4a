"""What the tests of films and figures share: a made-up drive along a smooth curve among cylinders, without physics."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable

import numpy as np
import pytest

from antdrive.robots import load_robot
from antdrive.robots.spec import Footprint
from antdrive.sim.log.outcome import Outcome
from antdrive.sim.log.record import ComponentRecord
from antdrive.sim.log.rollout import Rollout
from antdrive.worlds.movers import Cruising
from antdrive.worlds.world import Disc, Task, World
from tests.records import made_up_record


@pytest.fixture(scope="session")
def made_up_drive() -> Callable[..., Rollout]:
    return _made_up_drive


def _made_up_drive(
    *,
    obstacles: int = 20,
    seconds: float = 1.0,
    collide: bool = False,
    square: bool = False,
    movers: int = 0,
    size: tuple[float, float] = (4.0, 3.0),
    outcome: str = "succeeded",
) -> Rollout:
    """A rollout with a record of the usual form; `collide` puts a cylinder in the way and ends there."""
    rng = np.random.default_rng(7)
    hz, radius = 240, 0.18
    t = np.arange(round(seconds * hz) + 1) / hz
    share = 0.5 - 0.5 * np.cos(np.pi * t / seconds)
    x = size[0] * (0.12 + 0.76 * share)
    y = size[1] * (0.5 + 0.25 * np.sin(2 * np.pi * share))
    dx, dy = np.gradient(x, t), np.gradient(y, t)
    yaw = np.unwrap(np.arctan2(np.gradient(y, x + 1e-9 * t), 1.0))
    pose = np.column_stack([x, y, yaw])
    twist = np.column_stack([np.hypot(dx, dy), np.gradient(yaw, t)])
    found: list[dict[str, float]] = []
    for _ in range(20000):
        if len(found) == obstacles:
            break
        r = rng.uniform(0.08, 0.2)
        ox, oy = rng.uniform((r, r), (size[0] - r, size[1] - r))
        free = all(math.hypot(ox - o["x"], oy - o["y"]) > r + o["radius"] for o in found)
        if free and np.hypot(x - ox, y - oy).min() > r + 0.35:
            found.append({"x": ox, "y": oy, "radius": r, "height": 0.5})
    contacts = np.empty((0, 4))
    if collide:
        end = round(0.6 * len(t))
        ahead = radius + 0.15
        hit = {"x": x[end] + ahead * math.cos(yaw[end]), "y": y[end] + ahead * math.sin(yaw[end])}
        found.append({**hit, "radius": 0.15, "height": 0.5})
        t, pose, twist = t[: end + 1], pose[: end + 1], twist[: end + 1]
        contacts = np.array([[end, len(found) - 1, -0.001, 25.0]])
        outcome = "collided"
    discs = np.array([(o["x"], o["y"], o["radius"]) for o in found]).reshape(-1, 3)
    away = np.hypot(pose[:, None, 0] - discs[:, 0], pose[:, None, 1] - discs[:, 1]) - discs[:, 2] - radius
    walls = np.minimum.reduce([pose[:, 0], size[0] - pose[:, 0], pose[:, 1], size[1] - pose[:, 1]]) - radius
    here = [(float(x[0]) + 0.6 + m, float(y[0])) for m in range(movers)]
    world = World(
        "made-up",
        (0.0, 0.0, *size),
        tuple(Disc(**{key: float(value) for key, value in o.items()}) for o in found),
        movers=tuple(Cruising(radius=0.12, position=position, velocity=(0.0, 0.5)) for position in here),
    )
    start_x, start_y, start_yaw = pose[0].tolist()
    task = Task(world, (start_x, start_y, start_yaw), (float(x[-1]), float(y[-1])), goal_tolerance=0.2, cell=0.25)
    robot = dataclasses.replace(
        load_robot("turtlebot"),
        footprint=Footprint(half_length=0.2, half_width=0.15) if square else Footprint.disc(radius),
        height=0.2,
        wheel_radius=0.04,
        track=0.25,
        max_speed=min(10.0, float(twist[:, 0].max()) + 0.1),
    )
    record = made_up_record(
        task=task,
        robot=robot,
        planner=ComponentRecord(name="mmas", settings={}),
        outcome=Outcome.from_key(outcome),
        physics_hz=hz,
    )
    places = np.empty((len(t), movers, 2))
    for m, position in enumerate(here):
        places[:, m] = np.column_stack([position[0] + 0 * t, position[1] + 0.5 * t])
    return Rollout(
        t=t,
        pose=pose,
        twist=twist,
        command=twist * 1.01,
        clearance=np.minimum(away.min(axis=1, initial=9.0), walls),
        limiter=(np.abs(twist[:, 1]) > 1).astype(np.uint8),
        movers=places,
        contacts=contacts,
        route=np.column_stack([x, y])[::24],
        cells=np.empty((0, 2), dtype=np.int32),
        record=record,
    )
