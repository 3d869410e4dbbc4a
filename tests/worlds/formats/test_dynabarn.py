"""The worlds of the DynaBARN set, from their decoded keyframes."""

import json
import math

import numpy as np
import pytest

from antdrive.worlds import Trajectories, import_dynabarn, load_task, save_task
from tools.shared_data import DYNABARN

MOVER = {"radius": 0.5, "length": 1.0, "period": 8.0, "loop": "teleport",
         "keyframes_t_x_y": [[0.0, 5.0, 1.0], [8.0, 5.0, 9.0]]}  # fmt: skip
ONE = {"name": "one", "bounds": [-12, -12, 12, 12], "start": [11, 0, 3.14], "goal": [-9, 0], "goal_tolerance": 1.0,
       "movers": [MOVER]}  # fmt: skip


def written(folder, content):
    path = folder / "set.json"
    path.write_text(content if isinstance(content, str) else json.dumps(content))
    return path


@pytest.mark.skipif(not DYNABARN.exists(), reason="needs DynaBARN's worlds (docs/how-to/data.md)")
def test_the_ten_worlds_follow_the_protocol(tmp_path):
    tasks = import_dynabarn(DYNABARN)
    assert [task.world.name for task in tasks] == [f"dynabarn-{i:02}" for i in (0, 4, 8, 12, 20, 24, 28, 40, 44, 48)]
    raw = {world["name"]: world for world in json.loads(DYNABARN.read_text())}
    for task in tasks:
        assert (task.start[:2], task.goal, task.goal_tolerance, task.time_limit) == ((11, 0), (-9, 0), 1.0, 100.0)
        assert task.start[2] == pytest.approx(math.pi)
        assert "DynaBARN" in (task.world.source or "")
        save_task(task, tmp_path / "w.yaml")
        assert load_task(tmp_path / "w.yaml") == task
        moving = Trajectories.of(task.world, task.start[:2])
        assert set(moving.radii) == {0.5}
        for k, mover in enumerate(raw[task.world.name]["movers"]):
            t, x, y = np.array(mover["keyframes_t_x_y"]).T
            when = np.linspace(0, 99, 500)
            lap = when % mover["period"]
            calm = np.minimum(lap, mover["period"] - lap) > 1e-6
            expected = np.column_stack([np.interp(lap, t, x), np.interp(lap, t, y)])
            np.testing.assert_allclose(moving.positions(when)[calm, k], expected[calm], atol=1e-9)


@pytest.mark.skipif(not DYNABARN.exists(), reason="needs DynaBARN's worlds (docs/how-to/data.md)")
def test_speeds_are_those_of_their_class():
    for task in import_dynabarn(DYNABARN):
        number = int(task.world.name[-2:])
        low, high = (0.5, 0.95) if number < 20 else (1.0, 1.45) if number < 40 else (1.5, 1.95)
        speed = np.hypot(*np.moveaxis(Trajectories.of(task.world, (11, 0)).velocities(np.arange(0, 30, 0.1)), -1, 0))
        assert low - 0.05 < np.median(speed) < high + 0.05


#: Sets that are wrong in one way each.
BAD = (
    "[",
    "[" * 100000,
    {"name": "one"},
    [],
    [3],
    [ONE | {"movers": [4]}],
    [ONE | {"movers": [{"radius": 0.5}]}],
    [ONE | {"movers": [MOVER | {"period": 9}]}],
    [ONE | {"movers": [MOVER | {"loop": "back"}]}],
    [ONE | {"movers": [MOVER | {"keyframes_t_x_y": [[0, 1], [8, 1]]}]}],
    [ONE | {"movers": [MOVER | {"radius": None}]}],
    [{k: v for k, v in ONE.items() if k != "goal"}],
    [ONE | {"start": [math.nan, 0, 0]}],
)


def test_one_world_is_one_task(tmp_path):
    (task,) = import_dynabarn(written(tmp_path, [ONE]), cell=0.5)
    assert task.cell == 0.5
    assert len(task.world.movers) == 1
