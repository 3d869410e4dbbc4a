"""What scans say about ground and obstacles, against plain numpy and by hand."""

import dataclasses
import math

import numpy as np
import pytest

from antdrive.robots import load_robot
from antdrive.robots.footprint import footprint_clearance
from antdrive.sim import METRICS, Rollout
from antdrive.sim.log.sights import PASSED, first_meetings, passed, seen_ground, sightings
from antdrive.worlds import Disc, World
from tests.sim.view.scanned import scanned


@pytest.fixture(scope="module")
def log(made_up_drive) -> Rollout:
    return scanned(made_up_drive(size=(6.0, 4.0), obstacles=40))


def visible(log: Rollout, k: int, points: np.ndarray) -> np.ndarray:
    """Whether the lidar sees places from where scan k was taken: nothing stands on the line, and it is in the field of view."""
    lidar, discs = log.record.robot.lidar, log.record.world.discs
    assert lidar is not None
    x, y, yaw = lidar.pose_on(tuple(log.pose[log.scan_rows[k]]))
    to = points - (x, y)
    away = np.hypot(*to.T)
    seen = away < lidar.max_range
    if not lidar.full_circle:
        seen &= np.abs((np.arctan2(to[:, 1], to[:, 0]) - yaw + np.pi) % (2 * np.pi) - np.pi) < lidar.field_of_view / 2
    for cx, cy, radius in discs:
        share = np.clip((to @ (cx - x, cy - y)) / away**2, 0.0, 1.0)
        seen &= np.hypot(x + share * to[:, 0] - cx, y + share * to[:, 1] - cy) > radius
    return seen


def test_ground_is_seen_where_nothing_stands_between(log: Rollout) -> None:
    seen, cell = seen_ground(log)
    assert cell == 0.1
    assert seen.shape == (40, 60)
    middles = np.stack(np.meshgrid((np.arange(60) + 0.5) * cell, (np.arange(40) + 0.5) * cell), axis=2).reshape(-1, 2)
    expected = np.any([visible(log, k, middles) for k in range(len(log.scans))], axis=0).reshape(40, 60)
    assert (seen != expected).mean() < 0.02  # cells at the edges of shadows, between two beams
    assert 0.5 < expected.mean() < 0.95
    assert METRICS["explored_m2"](log) == pytest.approx(seen.sum() * 0.01)


def test_a_lidar_that_sees_less_far_explores_less(log: Rollout, made_up_drive) -> None:
    near = scanned(made_up_drive(size=(6.0, 4.0), obstacles=40), max_range=1.0)
    assert METRICS["explored_m2"](near) < 0.8 * METRICS["explored_m2"](log)
    assert math.isnan(METRICS["explored_m2"](made_up_drive()))


@pytest.mark.parametrize("robot", ["turtlebot", "jackal"])
def test_approaches_are_as_near_as_clearances_say(log: Rollout, robot: str) -> None:
    """Against the clearance of each cylinder alone in a hall without end."""
    foot = load_robot(robot).footprint
    record = dataclasses.replace(log.record, robot=dataclasses.replace(log.record.robot, footprint=foot))
    poses = log.pose + (0.0, 0.0, 0.3)
    found = {
        sight.obstacle: sight
        for sight in sightings(dataclasses.replace(log, pose=poses, record=record), first_meetings(log))
    }
    for j, disc in enumerate(log.record.world.obstacles):
        apart = footprint_clearance(World("hall", (-99.0, -99.0, 99.0, 99.0), (disc,)), foot, poses)
        if apart.min() > 0:
            assert found[j].nearest == pytest.approx(apart.min())
            assert found[j].nearest_at == log.t[apart.argmin()]
            if math.isfinite(found[j].seen_at):
                assert found[j].seen_from == pytest.approx(apart[np.searchsorted(log.t, found[j].seen_at)])


def test_a_polygon_s_approach_is_to_its_edge(log: Rollout) -> None:
    foot = dataclasses.replace(load_robot("turtlebot").footprint, half_length=0.0, half_width=0.0, rounding=0.0)
    corners = ((0.4, -0.2), (0.4, 0.2), (-0.1, 0.2), (-0.1, -0.2))
    polygon = dataclasses.replace(foot, corners=corners)
    world = dataclasses.replace(log.record.world, obstacles=(Disc(3.0, 2.0, 0.2),))
    record = dataclasses.replace(
        log.record,
        task=dataclasses.replace(log.record.task, world=world),
        robot=dataclasses.replace(log.record.robot, footprint=polygon),
    )
    ahead = np.column_stack([np.linspace(1.0, 2.0, len(log.t)), np.full(len(log.t), 2.0), np.zeros(len(log.t))])
    (sight,) = sightings(dataclasses.replace(log, pose=ahead, record=record), np.array([0.0]))
    assert sight.nearest == pytest.approx(3.0 - 2.0 - 0.4 - 0.2)
    assert sight.seen_from == pytest.approx(3.0 - 1.0 - 0.4 - 0.2)


def test_passed_is_what_came_within_half_a_metre(log: Rollout, made_up_drive) -> None:
    everything = sightings(log, first_meetings(log))
    listed = passed(log)
    assert {sight.obstacle for sight in listed} == {sight.obstacle for sight in everything if sight.nearest <= PASSED}
    assert 0 < len(listed) < len(everything)
    assert [sight.nearest_at for sight in listed] == sorted(sight.nearest_at for sight in listed)
    plain = listed[0].as_dict()
    assert plain["nearest_m"] == listed[0].nearest
    never = listed[0]._replace(seen_at=math.inf, seen_from=math.nan).as_dict()
    assert never["seen_s"] is never["seen_from_m"] is None
    far = everything[-1]._replace(touched=True)
    assert far.passed  # whatever was touched was passed
    assert passed(made_up_drive()) == []
