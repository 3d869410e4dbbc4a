"""Robots whose footprint is not centred on the axle, from their file to the certificate, the film and the replay."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

from antdrive.planners import load_planner
from antdrive.robots import Footprint, list_robots, load_robot
from antdrive.sim import Outcome, Rollout, Run, Scenario, certify, run
from antdrive.sim.log.certificate import _between_steps, _clearances
from antdrive.views.film.meshes import robot_parts
from antdrive.views.scene import Scene, contact_point
from antdrive.worlds import Cruising, Disc, Task, World, task_to_dict
from benchmarks.second_audit import least_clearance

NOSE = [[0.62, 0.0], [0.45, 0.25], [-0.25, 0.25], [-0.25, -0.25], [0.45, -0.25]]
WORLD = World(
    "yard",
    (0.0, 0.0, 9.0, 6.0),
    (Disc(3.0, 2.6, 0.3), Disc(5.6, 3.9, 0.4), Disc(6.2, 1.2, 0.3)),
    movers=(Cruising(radius=0.25, position=(4.4, 5.0), velocity=(0.0, -0.3)),),
)
TASK = Task(WORLD, (1.2, 3.0, 0.6), (7.6, 3.0), cell=0.1, goal_tolerance=0.2)


def drive(**settings: Any) -> Run:
    robot = dataclasses.replace(load_robot("warehouse"), footprint=Footprint.polygon(NOSE), name="nose")
    return run(Scenario(task=TASK, planner=load_planner("astar"), planner_name="astar", robot=robot, **settings))


@pytest.fixture(scope="module")
def driven() -> Rollout:
    done = drive(noise=1.0, seed=3)
    assert done.succeeded, (done.reason, done.certificate)
    assert done.rollout is not None
    return done.rollout


@pytest.fixture(scope="module")
def hit() -> Rollout:
    """An unknown post in the way of the nose: its tip is 0.62 m ahead of the axle."""
    done = drive(unseen=(Disc(4.2, 3.2, 0.15),), avoidance=None, replanning=None)
    assert done.rollout is not None
    return done.rollout


def test_a_polygon_drives_among_obstacles_and_movers_and_is_certified(driven: Rollout, tmp_path: Path) -> None:
    certificate = certify(driven)
    assert certificate.certified, certificate.problems
    assert driven.record.as_dict()["robot"]["footprint"]["corners"] == NOSE
    path = tmp_path / "drive.npz"
    driven.save(path)
    again = Rollout.load(path)
    assert again.record.robot == driven.record.robot
    assert (again.digest, certify(again).bound) == (driven.digest, certificate.bound)


def test_the_certificate_promises_no_more_than_a_cloud_of_points_that_is_swept_along_the_arcs(driven: Rollout) -> None:
    """The points are 5 mm apart, so the cloud may be 5 mm too optimistic, and never too pessimistic but for rounding."""
    world = task_to_dict(driven.record.task)
    audit = least_clearance(world, {"polygon": NOSE}, driven.pose, driven.twist, driven.record.physics_hz)
    certificate = certify(driven)
    assert certificate.min_clearance - 1e-9 <= audit.rows <= certificate.min_clearance + 0.005
    assert certificate.bound - 1e-9 <= audit.between <= certificate.min_clearance + 0.005


def test_nothing_comes_nearer_between_two_rows_than_the_bound(driven: Rollout) -> None:
    """Every 40th row is kept, so that much happens between them, and what happens is known from the rows left out."""
    kept = dataclasses.replace(
        driven,
        record=dataclasses.replace(driven.record, physics_hz=6, control_hz=6),
        **{key: getattr(driven, key)[::40] for key in ("t", "pose", "twist", "clearance", "movers")},
    )
    still, moving = _clearances(kept)
    twist = np.array([np.abs(driven.twist[k : k + 41]).max(axis=0) for k in range(0, len(driven.t), 40)])
    bound = _between_steps(dataclasses.replace(kept, twist=twist), driven.trajectories(), still, moving)
    between = [driven.clearance[k : k + 41].min() for k in range(0, len(driven.t) - 40, 40)]
    assert (bound[: len(between)] <= np.array(between) + 1e-9).all()
    assert max(np.array(between) - bound[: len(between)]) > 0.02, "the bound is one that can fail"


def test_a_collision_of_the_nose_is_a_collision_in_every_reading(hit: Rollout) -> None:
    assert hit.outcome is Outcome.COLLIDED
    problems = " ".join(certify(hit).problems)
    assert "physics reports" in problems
    assert "disagree" not in problems
    row, obstacle = hit.contacts[0, :2].astype(int).tolist()
    assert obstacle == 3
    x, y = contact_point(Scene.of(hit), hit.pose[row], obstacle, hit.movers[row])
    assert np.hypot(x - 4.2, y - 3.2) == pytest.approx(0.15)
    assert np.hypot(x - hit.pose[row, 0], y - hit.pose[row, 1]) > 0.3, "farther than the rectangle of a centred robot"


def test_a_log_whose_polygon_was_made_smaller_is_not_certified(driven: Rollout) -> None:
    shrunk = Footprint.polygon([[x - 0.01, y] for x, y in NOSE])
    forged = dataclasses.replace(driven.record, robot=dataclasses.replace(driven.record.robot, footprint=shrunk))
    problems = " ".join(certify(dataclasses.replace(driven, record=forged)).problems)
    assert "clearance: logged" in problems
    assert "record.inflate" in problems


@pytest.mark.parametrize("name", [*list_robots(), "nose", "puck"])
def test_a_robot_is_drawn_within_its_footprint(name: str) -> None:
    feet = {"nose": Footprint.polygon(NOSE), "puck": Footprint.disc(0.5, (0.1, 0.05))}
    robot = load_robot(name if name in list_robots() else "warehouse")
    robot = dataclasses.replace(robot, footprint=feet.get(name, robot.footprint))
    for part in robot_parts(robot):
        if not part.wheel:
            deepest = min(robot.footprint.depth(x, y) for x, y in part.mesh.vertices[:, :2].tolist())
            assert deepest >= -1e-9, part.colour


def test_a_robot_file_is_what_the_second_audit_reads() -> None:
    for name, path in list_robots().items():
        foot = load_robot(name).footprint
        raw = yaml.safe_load(path.read_text())["footprint"]
        audit = least_clearance({"bounds": [-5, -5, 5, 5]}, raw, np.array([[3.0, 2.0, 0.7]] * 2), np.zeros((2, 2)), 240)
        turned = np.array(foot.outline(64)) @ np.array([[np.cos(0.7), np.sin(0.7)], [-np.sin(0.7), np.cos(0.7)]])
        expected = min(2 - turned[:, 0].max(), 3 - turned[:, 1].max())
        assert audit.rows == pytest.approx(expected, abs=2e-3), name
