"""The worlds of the BARN set."""

import math
import tarfile

import numpy as np
import pytest

from antdrive.worlds import import_barn, point_clearance, rasterise
from tests.worlds.oracles import passable
from tools.shared_data import BARN


@pytest.fixture(scope="module")
def barn_worlds(tmp_path_factory):
    if not BARN.exists():
        pytest.skip("needs BARN's worlds (docs/how-to/data.md)")
    folder = tmp_path_factory.mktemp("barn")
    with tarfile.open(BARN) as archive:
        archive.extractall(folder, filter="data")
    worlds = sorted(folder.rglob("world_*.world"), key=lambda p: int(p.stem.split("_")[1]))
    assert len(worlds) == 50
    return worlds


def test_a_barn_world_lets_a_jackal_through(barn_worlds):
    for path in barn_worlds[::10]:
        task = import_barn(path)
        assert 181 <= len(task.world.obstacles) <= 365
        assert {(d.radius, d.height) for d in task.world.obstacles} == {(0.075, 0.5)}
        assert passable(task, rasterise(task.world, task.cell, 0.333 + 0.04)), path.name


def test_the_outer_cylinders_of_a_barn_world_touch_the_bounds(barn_worlds):
    task = import_barn(barn_worlds[0])
    x, y, radius = task.world.discs.T
    assert (task.world.name, task.start, task.goal) == ("world_0", (-2.25, 3.0, math.pi / 2), (-2.25, 13.0))
    assert ((x - radius).min(), (x + radius).max(), (y - radius).min()) == pytest.approx((-4.5, 0.0, 0.0))
    assert task.world.bounds[3] - task.goal[1] > task.goal_tolerance


def test_the_reference_path_of_a_barn_world_leads_between_its_cylinders(barn_worlds):
    for path in barn_worlds[1::25]:
        task = import_barn(path)
        cells = np.load(path.with_name(path.name.replace("world_", "path_")).with_suffix(".npy"))
        xy = np.column_stack([0.15 * cells[:, 0] - 4.425, 0.15 * cells[:, 1] + 5.175])
        assert point_clearance(task.world, xy).min() > 0.1
