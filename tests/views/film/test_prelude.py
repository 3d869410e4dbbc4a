from dataclasses import replace

import numpy as np
import pytest

from antdrive.base import InputError
from antdrive.sim.log.record import ComponentRecord
from antdrive.sim.pipeline import run
from antdrive.sim.scenario import Scenario
from antdrive.views.film import prelude
from antdrive.views.film.prelude import field_levels, plan_again, planning_frames
from antdrive.views.film.video import film
from antdrive.worlds import Disc, Task, World, rasterise

SETTING = {"camera": "top", "size": (320, 240), "note": None, "speed": 1.0}


@pytest.fixture(scope="module")
def walked(tmp_path_factory):
    """A short run by ants."""
    from antdrive.worlds import save_task

    world = World("posts", (0.0, 0.0, 3.0, 2.4), (Disc(1.5, 1.2, 0.25),))
    path = tmp_path_factory.mktemp("worlds") / "posts.yaml"
    save_task(Task(world, (0.5, 0.5, 0.0), (2.5, 1.9), cell=0.15), path)
    return run(Scenario.of(str(path), "as", options={"ants": 8, "iterations": 12}, seed=3)).rollout


def test_planning_again_gives_the_logged_path(walked):
    _, total, states = plan_again(walked)
    assert total == 12
    *_, last = states
    assert np.array_equal(last.cells, walked.cells)


def test_a_prelude_shows_the_field_and_goes_on_to_the_last_iteration(walked):
    frames = list(planning_frames(walked, SETTING, 5))
    assert len(frames) == 5
    assert all(frame.shape == (240, 320, 3) for frame in frames)
    blue = [(frame[..., 2].astype(int) - frame[..., 0] > 60).sum() for frame in frames]
    assert min(blue) > 150, "the dark end of the field"
    assert (frames[0] != frames[-1]).any()


def test_a_film_is_longer_by_its_prelude(walked, tmp_path):
    lengths = [film(walked, tmp_path / "a.mp4", size=(320, 240), fps=4, prelude=p).frames for p in (0.0, 2.0)]
    assert lengths[1] == lengths[0] + 8


def test_a_log_whose_path_planning_again_does_not_give_is_refused(walked):
    other = replace(walked, cells=walked.cells[::-1])
    with pytest.raises(InputError, match="another path"):
        list(planning_frames(other, SETTING, 2))


@pytest.mark.parametrize(
    ("planner", "message"),
    [
        ({"name": "astar", "settings": {}}, "astar does not plan in iterations"),
        ({"name": "as", "settings": {"time_budget": 1.0}}, "time budget"),
        ({"name": "nobody", "settings": {}}, "nobody"),
    ],
)
def test_planners_without_a_field_are_refused_before_anything_is_drawn(walked, tmp_path, planner, message):
    with pytest.raises(InputError, match=message):
        film(
            replace(walked, record=replace(walked.record, planner=ComponentRecord(**planner))),
            tmp_path / "a.mp4",
            prelude=1.0,
        )
    assert not list(tmp_path.iterdir())


def test_field_levels_run_from_0_to_1_and_leave_blocked_cells_out():
    grid = rasterise(World("one", (0, 0, 3, 3), (Disc(1.5, 1.5, 0.4),)), 0.3, 0.1)
    field = np.arange(np.prod(grid.shape), dtype=float).reshape(grid.shape)
    levels = field_levels(grid, field)
    assert np.isnan(levels[~grid.free]).all()
    free = levels[grid.free]
    assert free.min() == 0
    assert free.max() == 1
    assert (np.diff(free) >= 0).all()
    assert not np.nanmax(prelude.field_levels(grid, np.ones(grid.shape)))
