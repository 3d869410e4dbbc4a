"""Drives past people in the catalogue's worlds: certified, without long detours, slowly near people, hardly backwards."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from antdrive.base.plane import polyline_length
from antdrive.robots import load_robot
from antdrive.sim import Perception, Scenario, run
from antdrive.worlds import load_task
from tests.records import changed

LIDAR = Perception(kind="lidar")
SEES = {
    "truth": {},
    "lidar": {"perception": LIDAR},
    "mapless": {"perception": LIDAR, "map": "none", "localisation": "matching"},
}


def driven(log):
    """The driven length [m], and at each row the way backwards that was not driven forwards again (T,) [m]."""
    behind, ways = 0.0, []
    for speed in log.twist[:, 0]:
        behind = max(0.0, behind - speed / log.record.physics_hz)
        ways.append(behind)
    return polyline_length(log.pose[:, :2]), np.array(ways)


def backs_off_only_from_people(log, backwards, radius):
    """Whether the robot has driven at most 0.52 m backwards, or a person would have hit it, standing there, within 2 s."""
    row = int(np.argmax(backwards > 0.52))
    soon = log.movers[row : row + 2 * log.record.physics_hz] - log.pose[row, :2]
    gaps = np.hypot(soon[..., 0], soon[..., 1]) - [mover.radius for mover in log.record.world.movers]
    return row == 0 or gaps.min() < radius


@cache
def way_alone(world, settings, robot):
    """The length driven without people [m]."""
    task = changed(load_task(world), "world", movers=())
    return driven(run(Scenario.of(task, "dstar-lite", robot, **dict(settings))).rollout)[0]


@pytest.mark.slow
@pytest.mark.parametrize("sees", SEES)
@pytest.mark.parametrize("world", ["people-aisle", "people-corridor", "people-crossing", "people-doorway"])
def test_a_robot_passes_people_slowly_and_without_a_long_detour(world, sees, jackal):
    task = load_task(world)
    scenario = Scenario.of(task, "dstar-lite", jackal, **SEES[sees])
    settings = {key: value for key, value in SEES[sees].items() if key != "perception"}
    done = run(scenario)
    assert done.succeeded, (done.outcome, done.reason)
    log = done.rollout
    way, backwards = driven(log)
    assert way <= 1.5 * way_alone(world, tuple(settings.items()), jackal)
    assert backs_off_only_from_people(log, backwards, jackal.radius)
    to = log.movers - log.pose[:, None, :2]
    gaps = np.hypot(to[..., 0], to[..., 1]) - [mover.radius for mover in task.world.movers] - jackal.radius
    ahead = to[..., 0] * np.cos(log.pose[:, 2:]) + to[..., 1] * np.sin(log.pose[:, 2:]) > 0
    if world != "people-aisle" or sees != "mapless":  # there the person stands, and is part of the map
        assert log.twist[((gaps < 1.0) & ahead).any(axis=1), 0].max(initial=0.0) <= 0.82


@pytest.mark.slow
@pytest.mark.parametrize(("world", "sees"), [("people-corridor", "truth"), ("people-aisle", "mapless")])
def test_a_long_robot_passes_people_by_its_outline(world, sees, jackal):
    """Its disc does not fit beside the person; behind the desks there is a long way for its footprint."""
    task, robot = load_task(world), replace(load_robot("warehouse"), lidar=jackal.lidar)
    done = run(Scenario.of(task, "dstar-lite", robot, **SEES[sees]))
    assert done.succeeded, (done.outcome, done.reason)
    way, backwards = driven(done.rollout)
    assert way <= 1.2 * np.hypot(*np.subtract(task.goal, task.start[:2]))
    assert backwards.max() <= 0.52


@pytest.mark.slow
def test_a_person_far_away_leaves_no_wall_in_the_map(jackal):
    """The person walks across the aisle's end, 10 m away; nothing else is there. The robot is slow and plans often."""
    task = load_task("people-aisle")
    task = changed(task, "world", movers=task.world.later(3.0).movers)
    log = run(Scenario.of(task, "dstar-lite", replace(jackal, max_speed=0.5), **SEES["mapless"])).rollout
    for row in np.unique(log.seen[log.seen[:, 0] < 8 * log.record.physics_hz, 0]).astype(int):
        x, y = log.seen[log.seen[:, 0] == row, 1:3].T
        lane = (abs(x - 11.6) < 0.4) & (abs(y - 3.0) < 1.9)
        away = np.hypot(x - log.movers[row, 0, 0], y - log.movers[row, 0, 1]) > 0.5
        assert np.count_nonzero(lane & away) < 20
