"""Films: format, captions, prelude, slow motion and end."""

import os
import re
import subprocess
import tracemalloc
from dataclasses import replace

import imageio_ffmpeg
import numpy as np
import pytest
from PIL import Image

from antdrive.base import InputError
from antdrive.sim.log.outcome import Outcome
from antdrive.sim.log.record import ComponentRecord, ReplanRecord
from antdrive.sim.pipeline import run
from antdrive.sim.scenario import Scenario
from antdrive.views.colours import OUTCOME_LABELS
from antdrive.views.film import overlay, playback, prelude, video
from antdrive.views.film.comparison_film import SplitScreen, compare_film
from antdrive.views.film.compositor import has_glow
from antdrive.views.film.overlay import Layout, _entry_width, banner, legend_entries, legend_rows
from antdrive.views.film.prelude import field_levels, plan_again, planning_frames
from antdrive.views.film.shot import Shot, caption
from antdrive.views.film.text import pill, text_width
from antdrive.views.film.video import film, film_failures, frame_times, render_frames, still
from antdrive.views.scene import Scene
from antdrive.worlds import Disc, Task, World, rasterise
from tests.records import changed

SIZE = (320, 240)


@pytest.fixture(scope="module")
def drive(made_up_drive):
    return made_up_drive()


@pytest.fixture(scope="module")
def crash(made_up_drive):
    return made_up_drive(collide=True)


@pytest.fixture(scope="module")
def filmed(drive, tmp_path_factory):
    path = tmp_path_factory.mktemp("films") / "drive.mp4"
    seen = []
    info = film(drive, path, size=SIZE, fps=20, note="certified", progress=seen.append)
    return info, seen


def ffmpeg(*arguments):
    command = [imageio_ffmpeg.get_ffmpeg_exe(), "-hide_banner", *map(str, arguments)]
    return subprocess.run(command, capture_output=True, check=False)


def decoded(path):
    """Return ffmpeg's description of the video stream, and the frames."""
    stream = next(line for line in ffmpeg("-i", path).stderr.decode().splitlines() if " Video: " in line)
    width, height = (int(side) for side in re.search(r", (\d+)x(\d+)", stream).groups())
    raw = ffmpeg("-v", "error", "-i", path, "-f", "rawvideo", "-pix_fmt", "rgb24", "-").stdout
    return stream, np.frombuffer(raw, dtype=np.uint8).reshape(-1, height, width, 3)


def test_a_film_has_the_frames_size_rate_and_format_it_claims(filmed):
    info, seen = filmed
    stream, frames = decoded(info.path)
    assert len(frames) == info.frames == 21 + 20
    assert frames.shape[2:0:-1] == info.size == SIZE
    assert "Video: h264" in stream
    assert re.search(r"yuv420p\(tv, bt709\b", stream)
    assert ", 20 fps" in stream
    assert imageio_ffmpeg.count_frames_and_secs(str(info.path))[0] == info.frames
    head, checked = info.path.read_bytes(), ffmpeg("-v", "error", "-i", info.path, "-f", "null", "-")
    assert head.index(b"moov") < head.index(b"mdat"), "browsers play it at once"
    assert (checked.returncode, checked.stderr) == (0, b"")
    assert seen == sorted(set(seen))
    assert seen[-1] == 1.0
    assert info.fps == 20
    assert info.duration_s == pytest.approx(2.05)


def test_a_film_shows_what_was_drawn(filmed, drive):
    info, _ = filmed
    _, frames = decoded(info.path)
    shot = Shot(drive, camera="oblique", size=SIZE, note="certified")
    drawn = shot.frame(0.0)
    assert np.abs(frames[0].astype(int) - drawn.astype(int)).mean() < 4
    assert np.abs(frames[10].astype(int) - frames[0].astype(int)).max() > 100


def test_a_film_can_run_faster_than_the_drive(drive):
    assert len(frame_times(10.0, 30, 1.0)) == 301
    times = frame_times(10.0, 30, 4.0)
    assert len(times) == 76
    assert times[-1] == pytest.approx(10.0)


@pytest.mark.parametrize("suffix", [".gif", ".webp"])
def test_gif_and_webp_are_animated(drive, tmp_path, suffix):
    info = film(drive, tmp_path / f"drive{suffix}", size=(160, 160), fps=5, camera="top")
    with Image.open(info.path) as picture:
        assert picture.size == (160, 160)
        assert 2 <= picture.n_frames <= info.frames  # equal frames at the end may be one


@pytest.mark.parametrize("size", [(320, 240), (480, 640)])
def test_the_band_fits_every_size(drive, size):
    for rows in (0, 1):
        layout = Layout.of(size, rows)
        assert layout.height % 2 == 0
        assert layout.height < 0.35 * size[1]
    shot = Shot(drive, camera="top", size=size, note="certified: min clearance 0.043 m")
    assert shot.frame(0.5).shape == (size[1], size[0], 3)


DRIFTED = (
    "the robot believed that it was at the goal, 0.01 m from it, but was 1.411 m from it (the tolerance is 1 m): "
    "its estimate was wrong by 1.42 m"
)


@pytest.mark.parametrize("size", [(960, 540), (480, 640)])
def test_a_cause_that_has_no_room_beside_the_numbers_has_lines_of_its_own(drive, size):
    note = f"seed 0, stuck: {DRIFTED}"
    layout = Layout.of(size, 1, note)
    assert " ".join(layout.note) == note
    assert all(text_width(line, layout.small, True) <= size[0] - 2 * layout.unit for line in layout.note)
    assert Layout.of(size, 1).height < layout.height < 0.4 * size[1]
    assert Layout.of(size, 1, "seed 0") == Layout.of(size, 1)
    shot = Shot(drive, camera="top", size=size, note=note)
    assert shot.frame(0.5).shape == (size[1], size[0], 3)


def test_a_picture_too_small_for_a_note_cuts_it_off():
    layout = Layout.of((320, 240), 0, 9 * DRIFTED)
    assert layout.height < 0.36 * 240
    assert layout.note[-1].endswith("…")
    assert Layout.of((160, 160), 0, DRIFTED).note == ()


def test_the_sentence_at_the_end_names_the_reason_and_does_not_contradict_it(monkeypatch):
    drawn = []
    monkeypatch.setattr(overlay, "pill", lambda text, size, colour, more=(), small=0: drawn.append((text, list(more))))
    layout = Layout.of((960, 540), 1)
    banner(Outcome.STUCK, layout, 960, DRIFTED)
    banner(Outcome.STUCK, layout, 960)
    banner(Outcome.TIMED_OUT, layout, 960, "no way through what was seen, last at t = 7.9 s")
    (stuck, why), general, timed_out = drawn
    assert (stuck, " ".join(why)) == ("Stuck", DRIFTED)
    assert general == ("Stopped making progress", [])
    assert timed_out[0].startswith("The time limit passed")
    assert timed_out[1] == ["no way through what was seen, last at t = 7.9 s"]
    monkeypatch.undo()
    assert banner(Outcome.STUCK, layout, 960, DRIFTED).shape[0] > banner(Outcome.STUCK, layout, 960).shape[0]
    assert banner(Outcome.STUCK, layout, 960, DRIFTED).shape[1] <= 0.9 * 960


@pytest.mark.parametrize("size", [(640, 480), (320, 240), (160, 160)])
def test_a_legend_stays_within_its_rows(drive, size):
    entries = legend_entries(Scene.of(drive), 0.5, 0.02, replans=True, own_map=True, tracked=True)
    whole = False
    for rows in range(1, 5):
        layout = Layout.of(size, rows)
        legend = legend_rows(entries, layout)
        shown = [entry for row in legend.rows for entry in row]
        assert shown == entries[: len(shown)]
        assert legend.whole == (shown == entries)
        for row in legend.rows:
            wide = sum(sum(_entry_width(entry, legend.size)) for entry in row) + legend.size * (len(row) - 1)
            assert wide <= layout.width - 2 * layout.unit or len(row) == 1
        whole |= legend.whole and layout.height < 0.35 * size[1]
    assert whole == (size[0] > 320), "a very small picture cannot name everything"


@pytest.mark.parametrize("outcome", list(Outcome))
def test_every_outcome_ends_with_words_in_its_colour(drive, outcome):
    ended = changed(drive, "record", outcome=outcome)
    shot = Shot(ended, camera="top", size=SIZE)
    before, after = shot.frame(1.0), shot.last_frame()
    colour = np.array(OUTCOME_LABELS[outcome][1])
    count = [(np.abs(frame.astype(int) - colour).max(axis=-1) < 6).sum() for frame in (before, after)]
    assert count[1] > count[0] + 300


def test_a_contact_flashes_and_stays_marked(crash):
    shot = Shot(crash, camera="oblique", size=SIZE)
    end = shot.playback.duration
    before, at, final = shot.frame(end - 0.2), shot.frame(end), shot.last_frame()
    px, py = (round(value) for value in shot._compositor.pixel(*shot.playback.contact(end)[:2], 0.1))

    def redness(picture, where):
        red, green, _ = np.moveaxis(picture[where].astype(int), -1, 0)
        return ((red - green) > 90).mean()

    border = np.s_[100:130, 0:5]
    mark = np.s_[py - 12 : py + 12, px - 12 : px + 12]
    assert redness(before, border) == 0
    assert redness(at, border) > 0.9
    assert redness(final, border) > 0.9
    assert redness(before, mark) < 0.05
    assert redness(final, mark) > 0.15


def test_a_failure_in_the_middle_leaves_no_file(drive, tmp_path, monkeypatch):
    shown = []

    def fails(self, at, **_):
        shown.append(at)
        if len(shown) == 3:
            raise RuntimeError("no more paint")
        return np.zeros((*SIZE[::-1], 3), dtype=np.uint8)

    monkeypatch.setattr(Shot, "frame", fails)
    (tmp_path / "drive.mp4").write_bytes(b"an older film")
    with pytest.raises(RuntimeError, match="no more paint"):
        film(drive, tmp_path / "drive.mp4", size=SIZE)
    assert [path.name for path in tmp_path.iterdir()] == ["drive.mp4"]
    assert (tmp_path / "drive.mp4").read_bytes() == b"an older film"


def test_memory_does_not_grow_with_the_film(made_up_drive, tmp_path):
    peaks = []
    for seconds in (0.5, 2.5):
        drive = made_up_drive(seconds=seconds)
        tracemalloc.start()
        try:
            film(drive, tmp_path / "drive.mp4", size=(320, 240), fps=20, camera="top")
            peaks.append(tracemalloc.get_traced_memory()[1])
        finally:
            tracemalloc.stop()
    assert peaks[1] < peaks[0] + 3 * 320 * 240 * 3


def test_a_still_may_be_webp(drive, tmp_path):
    with Image.open(still(drive, tmp_path / "a.webp", 0.5, size=SIZE)) as picture:
        assert (picture.format, picture.size, getattr(picture, "n_frames", 1)) == ("WEBP", SIZE, 1)


@pytest.mark.parametrize("size", [(320, 240), (640, 480)])
def test_the_outcomes_sentence_does_not_cover_the_legend(drive, size):
    shot = Shot(drive, camera="follow", size=size)
    before, after = shot.frame(shot.playback.duration), shot.last_frame()
    high, wide = (shot._layout.unit + side for side in shot._legend.shape[:2])
    assert np.array_equal(before[:high, :wide], after[:high, :wide])
    assert not np.array_equal(before, after)


def test_a_film_goes_into_slow_motion_around_a_contact(crash):
    shot = Shot(crash, camera="oblique", size=SIZE)
    end, (first, last) = shot.playback.duration, shot.slow_motion
    times = frame_times(end, 30, 1.0, shot.slow_motion)
    word = [shot.frame(at)[-100:, -120:] for at in (first - 0.1, first + 0.1)]
    steps = np.diff(times)
    slowly = (times[:-1] >= first) & (times[1:] <= last)
    assert steps[slowly] == pytest.approx(1 / 30 / playback.SLOW_MOTION)
    assert steps[: slowly.argmax() - 1] == pytest.approx(1 / 30)
    assert times[0] == 0
    assert end - times[-1] < 1 / 30
    red = [((part[..., 0].astype(int) - part[..., 1]) > 120).sum() for part in word]
    assert red[0] == 0
    assert red[1] > 100, "the band is labelled SLOW"


@pytest.mark.slow
def test_frames_rendered_in_several_processes_equal_those_of_one(drive):
    setting = {"camera": "follow", "size": SIZE, "note": None, "speed": 1.0}
    times = frame_times(0.6, 20, 1.0)
    shared = list(render_frames(drive, setting, times, 2))
    shot = Shot(drive, **setting)
    alone = [shot.frame(at) for at in times]
    assert len(shared) == len(alone) == len(times)
    assert all((a == b).all() for a, b in zip(shared, alone, strict=True))


def test_the_certificate_appears_with_the_outcome_at_the_end(drive, monkeypatch):
    words = []
    monkeypatch.setattr(overlay, "pill", lambda *given: words.append(given) or pill(*given))
    shot = Shot(drive, camera="top", size=SIZE)
    shot.frame(0.0)
    assert "certified" not in str(words)
    shot.last_frame()
    assert caption(drive) in str(words)


def test_a_small_robot_gets_a_glow_and_a_large_one_none(made_up_drive):
    for size, found in (((30.0, 22.0), True), ((4.0, 3.0), False)):
        shot = Shot(made_up_drive(size=size, obstacles=0), camera="top", size=SIZE)
        assert has_glow(shot.scene, shot._camera) == found
        entries = legend_entries(shot.scene, 0.5, 0.02, glow=found)
        assert ("robot" in {entry.text for entry in entries}) == found
        compositor, pose = shot._compositor, shot.playback.pose(0.5)
        px, py = (round(value) for value in compositor.pixel(*pose[:2]))
        tinted = compositor.frame(pose).astype(int) - compositor.backdrop.pixels
        ring = np.abs(tinted[py - 14 : py + 14, px - 14 : px + 14, 2]).max()
        aside = np.abs(tinted[py, px + 5 : px + 9]).max() if found else 0
        assert ring > 100
        assert (aside > 20) == found


def test_a_replan_shows_its_new_route_and_its_cause(drive):
    """The new route replaces the old one, a dot marks the place, and the caption shows the cause."""
    new = ReplanRecord(t=0.3, trigger="obstructed", solved=True, cost_m=2.5, work=1, route=((1.0, 0.4), (3.5, 0.4)))
    unsolved = replace(new, t=0.8, trigger="waited", solved=False, cost_m=None, route=())
    replanned = changed(drive, "record", replans=(new, unsolved))

    def views(rollout, news, *times):
        shot = Shot(rollout, camera="top", size=SIZE, bare=True)
        shot._replan_caption = news
        return [shot.view(at).astype(int) for at in times]

    kept, plain = views(drive, 0.0, 0.2, 0.5)
    before, after, failed = views(replanned, 0.0, 0.2, 0.5, 0.85)
    captioned = views(replanned, 1.0, 0.5)[0]
    shot = Shot(drive, camera="top", size=SIZE, bare=True)
    new_line = [shot._compositor.pixel(x, 0.4) for x in np.linspace(1.0, 3.5, 200)]
    x = np.linspace(2.4, 3.1, 100)
    old_line = [shot._compositor.pixel(*at) for at in zip(x, np.interp(x, *drive.route.T), strict=True)]

    def dark(view, line):
        return np.mean([view[round(py), round(px)].sum() < 300 for px, py in line])

    assert np.abs(before - kept).max(axis=-1).mean() < 2, "a route drawn in every frame looks about the same"
    assert dark(plain, new_line) == dark(before, new_line) == 0
    assert dark(after, new_line) > 0.3
    assert dark(failed, new_line) > 0.3
    assert dark(plain, old_line) > 0.2
    assert dark(after, old_line) == 0
    assert (np.abs(captioned - after).max(axis=-1) > 60).sum() > 100


def test_replans_at_every_cell_have_no_caption(drive):
    entry = ReplanRecord(t=0.0, trigger="decision", solved=True, cost_m=0.5, work=1, route=((1.0, 1.0), (1.5, 1.0)))
    decided = changed(drive, "record", replans=(entry,))
    shot = Shot(decided, camera="top", size=SIZE)
    assert [event.caption for event in shot.playback.replans] == [""]
    shot.frame(0.5)


def row(key, rollout, *, succeeded=False):
    return {
        "key": key, "world": "world_6", "planner": "as ants=5", "robot": "jackal", "seed": 3, "rollout": rollout,
        "succeeded": succeeded, "outcome": "collided", "reason": "movers[3] at 1 m/s",
    }  # fmt: skip


def test_each_failure_that_has_a_log_is_filmed_once(made_up_drive, tmp_path, monkeypatch):
    log = made_up_drive(collide=True).save(tmp_path / "rollouts" / "a.npz")
    rows = [row("aaaabbbbcc", "rollouts/a.npz"), row("b", None), row("c", "rollouts/a.npz", succeeded=True)]
    done = []
    monkeypatch.setattr(video, "LONGEST_FAILURE", 0.3)  # of 0.6 s
    films = film_failures(rows, tmp_path, tmp_path / "films", size=(320, 180), progress=done.append)
    assert films == {"aaaabbbbcc": tmp_path / "films" / "world_6-as_ants_5-jackal-3-aaaabbbb.mp4"}
    assert done == [1.0]
    (path,) = films.values()
    frames, _ = imageio_ffmpeg.count_frames_and_secs(str(path))
    assert frames > 5
    before = path.stat()
    film_failures(rows, tmp_path, tmp_path / "films", size=(320, 180))
    assert path.stat() == before
    os.utime(log, (before.st_mtime + 9, before.st_mtime + 9))  # another drive with the same key
    film_failures(rows, tmp_path, tmp_path / "films", size=(320, 180))
    assert path.stat().st_ino != before.st_ino


def test_the_line_below_the_picture_is_the_cause(made_up_drive, tmp_path, monkeypatch):
    made_up_drive(collide=True).save(tmp_path / "a.npz")
    notes = []

    def note(log, path, **given):
        notes.append((path.name, given["note"], given["speed"]))

    monkeypatch.setattr(video, "film", note)
    film_failures([row("x", "a.npz"), {**row("y", "a.npz"), "reason": None}], tmp_path, tmp_path)
    monkeypatch.setattr(video, "LONGEST_FAILURE", 0.3)
    film_failures([row("x", "a.npz")], tmp_path, tmp_path)
    assert [text for _, text, _ in notes[:2]] == ["seed 3, collided: movers[3] at 1 m/s", "seed 3, collided"]
    assert [speed for *_, speed in notes] == [1.0, 1.0, pytest.approx(2.0, rel=0.02)]


def test_a_log_that_is_gone_leaves_the_film_that_was_made_of_it(made_up_drive, tmp_path):
    log = made_up_drive(collide=True).save(tmp_path / "a.npz")
    rows, done = [row("x", "a.npz"), row("y", "gone.npz")], list[float]()
    films = film_failures(rows, tmp_path, tmp_path / "films", size=(320, 180), progress=done.append)
    assert (list(films), done) == (["x"], [0.5, 1.0])
    log.unlink()
    assert film_failures(rows, tmp_path, tmp_path / "films", size=(320, 180)) == films


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


def test_a_comparisons_prelude_shows_ants_at_work_beside_a_plan_without_a_field(walked, tmp_path):
    other = changed(walked, "record", planner=ComponentRecord(name="astar", settings={}))
    screen = SplitScreen([[("as", walked)], [("astar", other)]], "top", (640, 360))
    first, _, last = screen.planning(3)
    left, right = np.s_[60:, :318], np.s_[:, 322:]
    assert (first[left] != last[left]).any()
    assert (first[right] == last[right]).all()
    with pytest.raises(InputError, match="no planner of the comparison has a field"):
        compare_film([other, other], tmp_path / "c.gif", prelude=1)


def test_a_film_is_longer_by_its_prelude(walked, tmp_path):
    lengths = [film(walked, tmp_path / "a.mp4", size=(320, 240), fps=4, prelude=p).frames for p in (0.0, 2.0)]
    assert lengths[1] == lengths[0] + 8


def test_a_log_whose_path_planning_again_does_not_give_is_refused(walked):
    other = replace(walked, cells=walked.cells[::-1])
    with pytest.raises(InputError, match="another path"):
        list(planning_frames(other, SETTING, 2))


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
