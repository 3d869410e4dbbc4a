"""What a robot had seen, made again from its log, against ray casting in plain numpy."""

import dataclasses
import math

import numpy as np
import pytest

from antdrive.sim.log.record import SensingRecord
from antdrive.sim.log.rollout import Rollout
from antdrive.views.recollection import Recollection, laid_in_world
from tests.views.scanned import scanned


@pytest.fixture(scope="module")
def log(made_up_drive) -> Rollout:
    return scanned(made_up_drive(size=(6.0, 4.0), obstacles=40))


def bodies_met(log: Rollout, k: int) -> set[int]:
    """The cylinders that the beams of scan k end on: the least root of each beam's quadratic for each cylinder."""
    lidar, discs = log.record.robot.lidar, log.record.world.discs
    assert lidar is not None
    x, y, yaw = lidar.pose_on(tuple(log.pose[log.scan_rows[k]]))
    angles = yaw - lidar.yaw + lidar.angles
    ways = np.stack([np.cos(angles), np.sin(angles)], axis=1)
    to = discs[:, :2] - (x, y)
    b = ways @ to.T
    root = b**2 - (to**2).sum(axis=1) + discs[:, 2] ** 2
    hits = np.where((root > 0) & (b > 0), b - np.sqrt(np.maximum(root, 0)), np.inf)
    low, high = np.array(log.record.world.bounds).reshape(2, 2)
    with np.errstate(divide="ignore"):
        walls = np.where(ways > 0, (high - (x, y)) / ways, (low - (x, y)) / ways).min(axis=1)
    first = hits.argmin(axis=1)
    best = hits[np.arange(len(ways)), first]
    return set(first[(best < walls) & (best < lidar.max_range) & (best > lidar.min_range)].tolist())


def test_obstacles_are_met_when_a_beam_first_ends_on_them(log: Rollout) -> None:
    expected = np.full(len(log.record.world.obstacles), math.inf)
    for k in reversed(range(len(log.scans))):
        expected[list(bodies_met(log, k))] = log.t[log.scan_rows[k]]
    seen = Recollection(log)
    seen.advance(log.t[-1])
    assert len(set(expected.tolist())) > 4  # some at once, some later
    assert seen.met.tolist() == expected.tolist()


def test_what_was_seen_grows_whatever_the_steps(log: Rollout) -> None:
    once, stepwise = Recollection(log), Recollection(log)
    grown = []
    for at in np.arange(0.0, log.t[-1] + 0.03, 0.03):
        stepwise.advance(at)
        grown.append(stepwise.explored)
    once.advance(log.t[-1])
    assert np.array_equal(once.seen, stepwise.seen)
    assert (np.diff(grown) >= 0).all()
    assert 5.0 < grown[0] < grown[-1] < 6.3 * 4.3
    assert np.array_equal(once.map.discs(), stepwise.map.discs())


def test_the_map_is_laid_where_the_robot_believes_to_be(log: Rollout) -> None:
    turn, shift = 0.2, np.array([0.5, -0.3])
    cos, sin = math.cos(turn), math.sin(turn)
    wrong = np.column_stack([log.pose[:, :2] @ np.array([[cos, sin], [-sin, cos]]) + shift, log.pose[:, 2] + turn])
    drifted = dataclasses.replace(log, estimate=wrong)
    straight, seen = Recollection(log), Recollection(drifted)
    for recollection in (straight, seen):
        recollection.advance(0.5)
    assert straight.drift(0.5) == pytest.approx([1, 0, 0, 0])
    there = seen.drift(0.5)
    assert there == pytest.approx([cos, sin, *shift])
    laid, true = laid_in_world(seen.map.discs()[:, :2], there), straight.map.discs()[:, :2]
    apart = np.hypot(*(laid[:, None] - true[None]).transpose(2, 0, 1)).min(axis=1)
    assert apart.max() < 0.04  # grains of 2.5 cm are cut otherwise
    assert np.hypot(*(seen.map.discs()[:, :2][:, None] - true[None]).transpose(2, 0, 1)).min(axis=1).max() > 0.1


def test_a_log_without_scans_is_refused(made_up_drive) -> None:
    with pytest.raises(ValueError, match="no scans"):
        Recollection(made_up_drive())


def test_scanned_logs_are_logs(log: Rollout) -> None:
    assert log.problems() == []
    assert log.record.sensing == SensingRecord(map="none", localisation="true", odometry=1.0)
