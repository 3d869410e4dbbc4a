"""Robots imported from URDF drive a BARN world, certified, or say why they cannot."""

from __future__ import annotations

import tarfile
from pathlib import Path

import pytest

from antdrive.planners import load_planner
from antdrive.robots.importing.urdf import import_urdf
from antdrive.sim import Outcome, Scenario, run
from antdrive.worlds import Task, import_barn
from tools.shared_data import BARN

URDF = Path(__file__).parents[1] / "robots" / "importing" / "urdf"

pytestmark = pytest.mark.skipif(not BARN.exists(), reason="needs BARN's worlds (docs/how-to/data.md)")


@pytest.fixture(scope="module")
def barn_0(tmp_path_factory: pytest.TempPathFactory) -> Task:
    folder = tmp_path_factory.mktemp("barn")
    with tarfile.open(BARN) as archive:
        archive.extract("world_0.world", folder, filter="data")
    return import_barn(folder / "world_0.world")


@pytest.mark.parametrize(
    "name",
    [
        "pioneer3dx.urdf",
        *(pytest.param(name, marks=pytest.mark.slow) for name in ("burger.urdf", "waffle.urdf", "turtlebot4.urdf")),
    ],
)
def test_an_imported_robot_drives_a_barn_world_certified(name: str, barn_0: Task) -> None:
    robot = import_urdf(URDF / name).robot
    done = run(Scenario(task=barn_0, planner=load_planner("astar"), planner_name="astar", robot=robot))
    assert done.succeeded, (done.outcome, done.reason, done.certificate)


def test_a_robot_that_is_too_large_for_a_barn_world_says_where_and_what_it_needs(barn_0: Task) -> None:
    pytest.importorskip("xacrodoc")
    robot = import_urdf(URDF / "warehouse.urdf.xacro").robot
    done = run(Scenario(task=barn_0, planner=load_planner("astar"), planner_name="astar", robot=robot))
    assert done.outcome is Outcome.NO_PATH
    assert (
        "the widest disc that passes has a radius of 0.511 m, at (-3.15, 5.92), between obstacles[143]" in done.reason
    )
    assert done.reason.endswith(
        "the place is 1.02 m wide, and plans are made for the disc around warehouse, which needs 1.4 m; "
        "its rectangle of 0.9 x 0.6 m would need 0.66 m straight ahead"
    )
