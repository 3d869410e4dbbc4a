"""BARN's worlds, driven by the jackal."""

import tarfile
from pathlib import Path

import numpy as np
import pytest

from antdrive.planners import load_planner
from antdrive.robots import RobotSpec
from antdrive.sim import Scenario, run
from antdrive.sim.log.metrics import barn as barn_score
from antdrive.sim.log.metrics import tracking_error
from antdrive.worlds import import_barn
from tools.shared_data import BARN

WORLDS = range(0, 300, 6)

pytestmark = pytest.mark.skipif(not BARN.exists(), reason="needs BARN's worlds (docs/how-to/data.md)")


@pytest.fixture(scope="module")
def barn(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("barn")
    with tarfile.open(BARN) as archive:
        archive.extractall(folder, filter="data")
    return folder


@pytest.mark.parametrize("number", [pytest.param(n, marks=[] if n % 30 == 0 else [pytest.mark.slow]) for n in WORLDS])
def test_the_jackal_drives_a_barn_world(number: int, barn: Path, jackal: RobotSpec) -> None:
    task = import_barn(barn / f"world_{number}.world")
    result = run(Scenario(task=task, planner=load_planner("astar"), robot=jackal))
    assert result.succeeded, (result.outcome, result.certificate)
    assert result.rollout is not None
    assert barn_score(result.rollout) == pytest.approx(0.5)  # the highest score
    error, speed = tracking_error(result.rollout), result.rollout.twist[:, 0]
    assert np.percentile(error[np.abs(speed - 1) < 0.1], 95) < 0.02
    assert np.percentile(error[speed > 1.8], 95) < 0.01


@pytest.mark.slow
@pytest.mark.parametrize(
    ("planner", "noise", "smoothing"),
    [("ants", 0.0, "clearance"), ("aco-han", 0.0, "taut"), ("astar", 1.0, "clearance")],
)
@pytest.mark.parametrize("number", WORLDS)
def test_every_planners_path_is_safe_to_follow(
    number: int, planner: str, noise: float, smoothing: str, barn: Path, jackal: RobotSpec
) -> None:
    task = import_barn(barn / f"world_{number}.world")
    result = run(Scenario(task=task, planner=load_planner(planner), robot=jackal, noise=noise, smoothing=smoothing))
    assert result.succeeded, (result.outcome, result.certificate)
