"""Robots whose footprint is not centred on the axle, and robots imported from URDF, drive certified."""

from __future__ import annotations

import tarfile
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from antdrive.robots import Footprint, list_robots, load_robot
from antdrive.robots.importing.urdf_import import import_urdf
from antdrive.sim import Outcome, Rollout, Scenario, certify, run
from antdrive.views.film.meshes import robot_parts
from antdrive.views.scene import Scene, contact_point
from antdrive.worlds import Cruising, Disc, Task, World, import_barn, task_to_dict
from tests.audit.second_audit import least_clearance
from tests.records import COARSE, changed
from tools.shared_data import BARN

NOSE = [[0.62, 0.0], [0.45, 0.25], [-0.25, 0.25], [-0.25, -0.25], [0.45, -0.25]]
WORLD = World(
    "yard",
    (0.0, 0.0, 9.0, 6.0),
    (Disc(3.0, 2.6, 0.3), Disc(5.6, 3.9, 0.4), Disc(6.2, 1.2, 0.3)),
    movers=(Cruising(radius=0.25, position=(4.4, 5.0), velocity=(0.0, -0.3)),),
)
TASK = Task(WORLD, (1.2, 3.0, 0.6), (7.6, 3.0), cell=0.1, goal_tolerance=0.2)


def drive(**settings):
    robot = replace(load_robot("warehouse"), footprint=Footprint.polygon(NOSE), name="nose")
    return run(Scenario.of(TASK, "astar", robot, **COARSE, **settings))


@pytest.fixture(scope="module")
def driven():
    done = drive(noise=1.0, seed=3)
    assert done.succeeded, (done.reason, done.certificate)
    return done.rollout


@pytest.fixture(scope="module")
def hit():
    """An unknown post in the way of the nose: its tip is 0.62 m ahead of the axle."""
    done = drive(unseen=(Disc(4.2, 3.2, 0.15),), avoidance=None, replanning=None)
    return done.rollout


def test_a_polygon_drives_among_obstacles_and_movers_and_is_certified(driven, tmp_path):
    certificate = certify(driven)
    assert certificate.certified, certificate.problems
    assert driven.record.as_dict()["robot"]["footprint"]["corners"] == NOSE
    path = tmp_path / "drive.npz"
    driven.save(path)
    again = Rollout.load(path)
    assert again.record.robot == driven.record.robot
    assert (again.digest, certify(again).bound) == (driven.digest, certificate.bound)


def test_the_certificate_promises_no_more_than_a_cloud_of_points_that_is_swept_along_the_arcs(driven):
    """The points are 5 mm apart, so the cloud may be 5 mm too optimistic, and never too pessimistic but for rounding."""
    world = task_to_dict(driven.record.task)
    audit = least_clearance(world, {"polygon": NOSE}, driven.pose, driven.twist, driven.record.physics_hz)
    certificate = certify(driven)
    assert certificate.min_clearance - 1e-9 <= audit.rows <= certificate.min_clearance + 0.005
    assert certificate.bound - 1e-9 <= audit.between <= certificate.min_clearance + 0.005


def test_a_collision_of_the_nose_is_a_collision_in_every_reading(hit):
    assert hit.outcome is Outcome.COLLIDED
    problems = " ".join(certify(hit).problems)
    assert "physics reports" in problems
    assert "disagree" not in problems
    row, obstacle = hit.contacts[0, :2].astype(int).tolist()
    assert obstacle == 3
    x, y = contact_point(Scene.of(hit), hit.pose[row], obstacle, hit.movers[row])
    assert np.hypot(x - 4.2, y - 3.2) == pytest.approx(0.15)
    assert np.hypot(x - hit.pose[row, 0], y - hit.pose[row, 1]) > 0.3, "farther than the rectangle of a centred robot"


def test_a_log_whose_polygon_was_made_smaller_is_not_certified(driven):
    shrunk = Footprint.polygon([[x - 0.01, y] for x, y in NOSE])
    forged = changed(driven.record, "robot", footprint=shrunk)
    problems = " ".join(certify(replace(driven, record=forged)).problems)
    assert "clearance: logged" in problems
    assert "record.inflate" in problems


@pytest.mark.parametrize("name", [*list_robots(), "nose", "puck"])
def test_a_robot_is_drawn_within_its_footprint(name):
    feet = {"nose": Footprint.polygon(NOSE), "puck": Footprint.disc(0.5, (0.1, 0.05))}
    robot = load_robot(name if name in list_robots() else "warehouse")
    robot = replace(robot, footprint=feet.get(name, robot.footprint))
    for part in robot_parts(robot):
        deepest = min(robot.footprint.depth(x, y) for x, y in part.mesh.vertices[:, :2].tolist())
        assert deepest >= -1e-9, part.colour


URDF = Path(__file__).parents[1] / "robots" / "importing" / "urdf"

needs_barn = pytest.mark.skipif(not BARN.exists(), reason="needs BARN's worlds (docs/how-to/data.md)")


@pytest.fixture(scope="module")
def barn_0(tmp_path_factory):
    folder = tmp_path_factory.mktemp("barn")
    with tarfile.open(BARN) as archive:
        archive.extract("world_0.world", folder, filter="data")
    return import_barn(folder / "world_0.world")


@needs_barn
@pytest.mark.parametrize(
    "name",
    [
        "pioneer3dx.urdf",
        *(pytest.param(name, marks=pytest.mark.slow) for name in ("burger.urdf", "waffle.urdf", "turtlebot4.urdf")),
    ],
)
def test_an_imported_robot_drives_a_barn_world_certified(name, barn_0):
    robot = import_urdf(URDF / name).spec
    done = run(Scenario.of(barn_0, "astar", robot))
    assert done.succeeded, (done.outcome, done.reason, done.certificate)


@needs_barn
def test_a_robot_that_is_too_large_for_a_barn_world_says_where_and_what_it_needs(barn_0):
    robot = import_urdf(URDF / "warehouse.urdf.xacro").spec
    done = run(Scenario.of(barn_0, "tangent", robot))
    assert done.outcome is Outcome.NO_PATH
    assert (
        "the widest disc that passes has a radius of 0.511 m, at (-3.22, 6.00), between obstacles[140]" in done.reason
    )
    assert done.reason.endswith(
        "plans use the disc of warehouse; its rectangle of 0.9 x 0.6 m needs 0.66 m of the 1.02 m straight ahead; "
        "-p astar --footprint exact finds one"
    )
