"""BARN's worlds, which nobody here made: driven with the jackal, on raw grid paths."""

import tarfile
from pathlib import Path

import pytest

from planners import find_planner
from robots import RobotSpec
from sim import Scenario, run
from tests.conftest import SHARED
from worlds import import_barn

ARCHIVE = SHARED / "barn" / "barn50.tar.xz"
WORLDS = range(0, 300, 6)

pytestmark = pytest.mark.skipif(not ARCHIVE.exists(), reason="BARN's worlds are not in ../shared/data")


@pytest.fixture(scope="module")
def barn(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("barn")
    with tarfile.open(ARCHIVE) as archive:
        archive.extractall(folder, filter="data")
    return folder


@pytest.mark.parametrize("number", [pytest.param(n, marks=[] if n % 30 == 0 else [pytest.mark.slow]) for n in WORLDS])
def test_the_jackal_drives_a_barn_world(number: int, barn: Path, jackal: RobotSpec) -> None:
    task = import_barn(barn / f"world_{number}.world")
    result = run(Scenario(task=task, planner=find_planner("astar"), robot=jackal))
    assert result.succeeded, (result.outcome, result.certificate)
