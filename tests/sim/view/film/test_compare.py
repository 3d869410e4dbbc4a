import re
from dataclasses import replace

import numpy as np
import pytest
from PIL import Image

from antdrive.sim.log.outcome import Outcome
from antdrive.sim.log.record import ComponentRecord
from antdrive.sim.view.film.caption import VERDICTS
from antdrive.sim.view.film.compare import Split, compare_film
from antdrive.sim.view.style import PLANNER_STYLES, planner_style
from antdrive.worlds import InputError

SIZE = (640, 360)


@pytest.fixture(scope="module")
def drives(made_up_drive):
    short, long = made_up_drive(seconds=0.6), made_up_drive(seconds=1.0)
    return [
        replace(log, record=replace(log.record, planner=ComponentRecord(name=name, settings={})))
        for log, name in ((short, "astar"), (long, "mmas"))
    ]


def test_runs_are_side_by_side_at_the_same_moment_and_wait_for_the_last(drives):
    with Split(drives, "top", SIZE) as split:
        at = [split.picture(t) for t in (0.3, 0.7, 0.8)]
        alone = split._tiles[1].shot.replay.pose(0.8)
    assert all(picture.shape == (*SIZE[::-1], 3) for picture in at)
    left, right = np.s_[:, :318], np.s_[:, 320:]
    assert (at[1][left] == at[2][left]).all(), "over"
    assert (at[0][left] != at[1][left]).any()
    assert (at[1][right] != at[2][right]).any(), "still driving"
    assert alone[0] > drives[1].pose[0, 0]


def test_each_run_has_its_planners_colour_and_its_outcome(drives):
    with Split(drives, "top", SIZE) as split:
        end = split.picture(np.inf)
    for k, log in enumerate(drives):
        colour = np.array(planner_style(log.record.planner.name)[0])
        assert np.abs(end[2, 320 * k + 2].astype(int) - colour).max() == 0
    green = np.array(VERDICTS[Outcome.SUCCEEDED][1])
    assert (np.abs(end.astype(int) - green).max(axis=-1) < 6).sum() > 500


@pytest.mark.parametrize("count", [2, 3, 4, 5, 6])
def test_up_to_six_fit(drives, count):
    with Split((drives * 3)[:count], "oblique", SIZE) as split:
        assert len(set(split._corners)) == count
        for (x, y), tile in zip(split._corners, split._tiles, strict=True):
            high, wide, _ = tile.picture(0.1).shape
            assert x + wide <= SIZE[0]
            assert y + high <= SIZE[1]


def test_the_film_has_the_frames_it_claims(drives, tmp_path):
    info = compare_film(drives, tmp_path / "c.gif", size=SIZE, fps=5, camera="top")
    assert info.frames == 6 + 10
    with Image.open(info.path) as picture:
        assert picture.size == SIZE
        assert picture.n_frames <= info.frames


@pytest.mark.parametrize("count", [1, 7])
def test_one_or_seven_runs_are_refused(drives, tmp_path, count):
    with pytest.raises(InputError, match=re.escape(f"needs 2 to 6 runs, got {count}")):
        compare_film((drives * 4)[:count], tmp_path / "c.mp4")


def test_planners_look_different_from_each_other():
    styles = list(PLANNER_STYLES.values())
    assert len(set(styles)) == len(styles)
    assert planner_style("somebody-elses") == planner_style("somebody-elses")
