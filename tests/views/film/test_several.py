"""Films of several drives in one picture on one clock."""

from dataclasses import replace

import numpy as np
import pytest
from PIL import Image

from antdrive.base import InputError
from antdrive.sim.log.record import ComponentRecord
from antdrive.views.colours import label_styles
from antdrive.views.film import overlay
from antdrive.views.film.shot import Shot
from antdrive.views.film.video import film
from tests.records import changed

SIZE = (640, 360)


@pytest.fixture(scope="module")
def drives(made_up_drive):
    """Two drives on the same clock that start apart; the first ends earlier."""
    short, long = made_up_drive(seconds=1.0), made_up_drive(seconds=1.0)
    short = replace(
        short,
        **{name: getattr(short, name)[:145] for name in ("t", "twist", "command", "clearance", "limiter", "movers")},
        pose=short.pose[:145] + [0.0, 0.45, 0.0],
    )
    logs = zip((short, long), ("astar", "mmas"), strict=True)
    return {name: changed(log, "record", planner=ComponentRecord(name=name, settings={})) for log, name in logs}


@pytest.fixture
def rows(monkeypatch):
    """The drawn rows of drives."""
    drawn, original = [], overlay._draw_drive
    monkeypatch.setattr(
        overlay, "_draw_drive", lambda draw, row, *rest: (drawn.append(row), original(draw, row, *rest))
    )
    return drawn


def near(one, x, y):
    px, py = (round(value) for value in one._compositor.pixel(x, y))
    return np.s_[py - 14 : py + 14, px - 14 : px + 14]


def count(picture, colour, within=24):
    return int((np.abs(picture.astype(int) - colour).max(axis=-1) < within).sum())


def test_robots_and_paths_have_their_planners_colours_at_the_same_moment(drives):
    one = Shot(drives, camera="top", size=SIZE, bare=True)
    picture = one.view(0.5)
    for drive, log in zip(one.drives, drives.values(), strict=True):
        colour = np.array(label_styles([drive.names])[0].colour)
        assert count(picture[near(one, *drive.playback.pose(0.5)[:2])], colour, 60) > 10
        assert count(picture[near(one, *log.pose[60, :2])], colour) > 10


def test_a_drive_that_has_ended_is_pale_until_the_film_ends(drives):
    one = Shot(drives, camera="top", size=SIZE, bare=True)
    colour, place = np.array(label_styles(["astar"])[0].colour), drives["astar"].pose[-1, :2]
    driving, over, end = (count(one.view(at, last=last)[near(one, *place)], colour, 60) for at, last in
                          ((0.59, False), (0.9, False), (1.0, True)))  # fmt: skip
    assert over < 0.6 * driving
    assert end > over


def test_rows_name_planners_lengths_and_verdicts(drives, rows):
    one = Shot(drives, camera="top", size=SIZE)
    one.frame(0.8)
    assert [row.names for row in rows] == ["astar", "mmas"]
    early, late = rows
    assert early.verdict[0].startswith("✓ SUCCEEDED in 0.6 s  ·  ")
    assert "certified" in early.verdict[0]
    assert late.verdict is None
    assert late.facts[0] == f"driven {one.drives[1].playback.driven(0.8):.2f} of {one.drives[1].route} m"
    one.last_frame()
    assert all(row.verdict is not None for row in rows[-2:])


def test_identical_drives_are_one_robot_with_both_names(drives, rows):
    again = changed(drives["astar"], "record", planner=ComponentRecord(name="sipp", settings={}))
    one = Shot({"astar": drives["astar"], "sipp": again, "mmas": drives["mmas"]}, camera="top", size=SIZE)
    one.frame(0.1)
    assert [row.names for row in rows] == ["astar, sipp", "mmas"]


def test_the_film_lasts_as_long_as_the_longest_drive(drives, tmp_path):
    info = film(drives, tmp_path / "c.gif", size=SIZE, fps=5)
    assert (info.frames, info.camera) == (6 + 10, "oblique")
    with Image.open(info.path) as picture:
        assert picture.size == SIZE
        assert picture.n_frames <= info.frames
    assert film({"only": drives["mmas"]}, tmp_path / "d.gif", size=SIZE, fps=5).camera == "follow"


def test_what_does_not_fit_in_a_picture_is_refused(drives, made_up_drive, tmp_path):
    other = {**drives, "b": made_up_drive(obstacles=3)}
    for logs, words in ((other, "different worlds"), ({str(k): drives["mmas"] for k in range(7)}, "1 to 6 runs")):
        with pytest.raises(InputError, match=words):
            film(logs, tmp_path / "c.gif")
    with pytest.raises(InputError, match="follow shows one drive"):
        film(drives, tmp_path / "c.gif", camera="follow")
