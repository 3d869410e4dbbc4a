import itertools

import numpy as np
import pytest
from PIL import Image

from antdrive.sim.log.outcome import Outcome
from antdrive.sim.log.record import ComponentRecord
from antdrive.views.colours import OUTCOME_LABELS, label_styles
from antdrive.views.film import comparison_film
from antdrive.views.film.comparison_film import FULL, LEAST_TILE, Mark, SplitScreen, compare_film, fitting_size
from tests.records import changed

SIZE = (640, 360)


@pytest.fixture(scope="module")
def drives(made_up_drive):
    short, long = made_up_drive(seconds=0.6), made_up_drive(seconds=1.0)
    return [
        changed(log, "record", planner=ComponentRecord(name=name, settings={}))
        for log, name in ((short, "astar"), (long, "mmas"))
    ]


def screen_of(logs, camera, size=SIZE, names=("astar", "mmas"), mark=None):
    return SplitScreen([[named] for named in zip(itertools.cycle(names), logs, strict=False)], camera, size, mark)


def shaped(log, high):
    """Return the log in a world whose height is `high` times its width."""
    xmin, ymin, xmax, _ = log.record.world.bounds
    return changed(log, "record.task.world", bounds=(xmin, ymin, xmax, ymin + high * (xmax - xmin)))


def test_tiles_show_the_same_moment_and_a_finished_run_keeps_its_last_picture(drives):
    screen = screen_of(drives, "top")
    at = [screen.frame(t) for t in (0.3, 0.7, 0.8)]
    alone = screen._tiles[1].shot.playback.pose(0.8)
    assert all(picture.shape == (*SIZE[::-1], 3) for picture in at)
    left, right = np.s_[:, :318], np.s_[:, 320:]
    assert (at[1][left] == at[2][left]).all(), "over"
    assert (at[0][left] != at[1][left]).any()
    assert (at[1][right] != at[2][right]).any(), "still driving"
    assert alone[0] > drives[1].pose[0, 0]


def test_each_run_has_its_planners_colour_and_its_outcome(drives):
    screen = screen_of(drives, "top")
    end = screen.frame(np.inf)
    for k, log in enumerate(drives):
        colour = np.array(label_styles([log.record.planner.name])[0].colour)
        assert np.abs(end[2, 320 * k + 2].astype(int) - colour).max() == 0
    green = np.array(OUTCOME_LABELS[Outcome.SUCCEEDED][1])
    assert (np.abs(end.astype(int) - green).max(axis=-1) < 6).sum() > 500


@pytest.mark.parametrize("count", [2, 3, 4, 5, 6])
def test_up_to_six_runs_fit_into_the_frame(drives, count):
    screen = screen_of((drives * 3)[:count], "oblique")
    assert len(set(screen._corners)) == count
    for (x, y), tile in zip(screen._corners, screen._tiles, strict=True):
        high, wide, _ = tile.frame(0.1).shape
        assert x + wide <= SIZE[0]
        assert y + high <= SIZE[1]


def test_the_film_has_the_frames_it_claims(drives, tmp_path):
    info = compare_film(drives, tmp_path / "c.gif", size=SIZE, fps=5, camera="top")
    assert info.frames == 6 + 10
    with Image.open(info.path) as picture:
        assert picture.size == SIZE
        assert picture.n_frames <= info.frames


def test_a_mark_is_in_every_tile_from_its_moment_on(drives):
    x, y = drives[1].pose[len(drives[1].pose) // 3, :2]
    mark = Mark(0.3, float(x), float(y), "here")
    plain, marked = screen_of(drives, "top"), screen_of(drives, "top", mark=mark)
    for at, shown in ((0.2, False), (0.4, True), (np.inf, True)):
        differs = (plain.frame(at) != marked.frame(at)).any(axis=-1)
        assert differs[:, :318].any() == differs[:, 320:].any() == shown


def test_titles_replace_the_planners_names(drives):
    named, plain = (screen_of(drives, "top", names=names) for names in (("then", "now"), ("astar", "mmas")))
    differs = (named.frame(0.1) != plain.frame(0.1)).any(axis=-1)
    assert differs[:30].any()
    assert not differs[60:].any()


def test_oblique_views_of_a_wide_world_stand_above_each_other(drives):
    def corners(camera, high):
        return screen_of([shaped(log, high) for log in drives], camera)._corners

    assert corners("oblique", 1.0) == [(0, 0), (320, 0)]
    assert corners("oblique", 0.5) == [(0, 0), (0, 180)]
    assert corners("top", 0.5) == [(0, 0), (320, 0)]


@pytest.mark.parametrize(("high", "count"), [(0.5, 2), (3.0, 2), (0.5, 5)])
def test_a_film_from_above_has_no_empty_ground_beside_the_worlds(drives, high, count):
    logs = [shaped(log, high) for log in (drives * 3)[:count]]
    size = fitting_size(logs, "top")
    assert all(160 <= side <= most and side % 2 == 0 for side, most in zip(size, FULL, strict=True))
    screen = screen_of(logs, "top", size)
    shot = screen._tiles[0].shot
    assert len(screen._corners) == count
    x0, y0, x1, y1 = logs[0].record.task.world.bounds
    seen = np.ptp(shot._camera.pixels([(x0, y0, 0.0), (x1, y1, 0.0)]), axis=0)
    wide, tall = seen / shot._camera.size
    assert tall > 0.8
    assert wide > 0.8 or shot._camera.size[0] < LEAST_TILE
    assert fitting_size(logs, "follow") == FULL


def test_a_film_without_a_size_fits_its_worlds(drives, tmp_path):
    logs = [shaped(log, 0.5) for log in drives]
    info = compare_film(logs, tmp_path / "c.gif", fps=1, camera="top")
    assert info.size == fitting_size(logs, "top") < FULL
    with Image.open(info.path) as picture:
        assert picture.size == info.size


def test_planners_of_one_drive_share_a_tile_that_names_them_all(drives, tmp_path, monkeypatch):
    seen = []
    original = comparison_film.SplitScreen
    monkeypatch.setattr(
        comparison_film,
        "SplitScreen",
        lambda *given: seen.append([[name for name, _ in same] for same in given[0]]) or original(*given),
    )
    logs = [drives[0], drives[1], changed(drives[0], "record", planner=ComponentRecord(name="sipp", settings={}))]
    compare_film(logs, tmp_path / "c.gif", size=SIZE, fps=1, camera="top")
    assert seen == [[["astar", "sipp"], ["mmas"]]]
