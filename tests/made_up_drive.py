"""What the tests of films and figures share: a made-up drive along a smooth curve among cylinders, without physics."""

import math
from dataclasses import replace

import numpy as np
import pytest

from antdrive.robots import load_robot
from antdrive.robots.spec import Footprint
from antdrive.sim.log.outcome import Outcome
from antdrive.sim.log.record import ComponentRecord, SensingRecord
from antdrive.sim.log.rollout import millimetres
from antdrive.sim.sensing import Scanner
from antdrive.worlds.movers import Cruising
from antdrive.worlds.world import Disc, Task, World
from tests.records import made_up_log, made_up_record


@pytest.fixture(scope="session")
def made_up_drive():
    return _made_up_drive


def _made_up_drive(
    *, obstacles=20, seconds=1.0, collide=False, square=False, movers=0, size=(4.0, 3.0), outcome="succeeded"
):
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
    found = []
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
    robot = replace(
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
    return made_up_log(
        pose, hz, record, twist=twist, command=twist * 1.01, clearance=np.minimum(away.min(axis=1, initial=9.0), walls),
        limiter=(np.abs(twist[:, 1]) > 1).astype(np.uint8), movers=places, contacts=contacts,
        route=np.column_stack([x, y])[::24],
    )  # fmt: skip


def scanned(drive, **changes):
    """The drive of a mapless robot and without noise; `changes` are of its lidar."""
    lidar = drive.record.robot.lidar
    exact = replace(lidar, **{"sigma": 0.0, "resolution": 0.0, "rate": 10.0, **changes})
    rows = np.arange(0, len(drive.t), round(drive.record.physics_hz / exact.rate), dtype=np.int32)
    scanner = Scanner.of(exact, drive.record.world)
    x, y, yaw = drive.pose.T
    radii = np.array([mover.radius for mover in drive.record.world.movers])
    scans = [millimetres(scanner.scan((float(x[k]), float(y[k]), float(yaw[k])), drive.movers[k], radii)) for k in rows]
    record = replace(
        drive.record,
        robot=replace(drive.record.robot, lidar=exact),
        sensing=SensingRecord(map="none", localisation="true", odometry=1.0),
    )
    return replace(drive, record=record, scans=np.array(scans), scan_rows=rows)


def undriven(drive):
    """The log of a run that ended before the robot drove."""
    names = ("t", "pose", "twist", "command", "clearance", "limiter", "movers", "route")
    record = replace(drive.record, outcome=Outcome.NO_PATH)
    return replace(drive, record=record, **{name: getattr(drive, name)[:0] for name in names})
