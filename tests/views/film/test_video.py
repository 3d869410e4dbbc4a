"""Films: format, captions, prelude, slow motion and end."""

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
from antdrive.views.colours import BAND, OUTCOME_LABELS, label_styles
from antdrive.views.film import overlay, playback, prelude, shot
from antdrive.views.film.overlay import Layout, banner, legend_entries
from antdrive.views.film.prelude import field_levels, plan_again, planning_frames
from antdrive.views.film.shot import Shot, caption
from antdrive.views.film.text import pill, text_width
from antdrive.views.film.video import film, frame_times, still
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
    drawn = Shot(drive, camera="follow", size=SIZE, note="certified").frame(0.0)
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
    layout = Shot(drive, camera="top", size=size, note="certified: min clearance 0.043 m")._layout
    assert layout.height % 2 == 0
    assert layout.height < 0.4 * size[1]
    frame = Shot(drive, camera="top", size=size, note="certified: min clearance 0.043 m").frame(0.5)
    assert frame.shape == (size[1], size[0], 3)
    assert (frame[: layout.height] == BAND).all(axis=-1).mean() > 0.6, "the band is on top"
    assert (frame[-layout.height :] == BAND).all(axis=-1).mean() < 0.1


DRIFTED = (
    "the robot believed that it was at the goal, 0.01 m from it, but was 1.411 m from it (the tolerance is 1 m): "
    "its estimate was wrong by 1.42 m"
)


@pytest.mark.parametrize("size", [(960, 540), (480, 640)])
def test_a_note_has_lines_of_its_own(drive, size):
    note = f"seed 0, stuck: {DRIFTED}"
    layout = Layout.of(size, note=note)
    assert " ".join(layout.note) == note
    assert all(text_width(line, layout.small, True) <= size[0] - 2 * layout.unit for line in layout.note)
    assert Layout.of(size).height < layout.height < 0.4 * size[1]
    shot = Shot(drive, camera="top", size=size, note=note)
    assert shot.frame(0.5).shape == (size[1], size[0], 3)


def test_a_picture_too_small_for_a_note_cuts_it_off():
    layout = Layout.of((320, 240), note=9 * DRIFTED)
    assert layout.height < 0.45 * 240
    assert layout.note[-1].endswith("…")
    assert Layout.of((160, 160), note=DRIFTED).note == ()


def test_the_sentence_at_the_end_names_the_reason_and_does_not_contradict_it(monkeypatch):
    drawn = []
    monkeypatch.setattr(overlay, "pill", lambda text, size, colour, more=(), small=0: drawn.append((text, list(more))))
    layout = Layout.of((960, 540))
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
    entries = legend_entries(Scene.of(drive), replans=True, own_map=True, tracked=True)
    layout = Layout.of(size, entries=entries)
    shown = [entry for row in layout.legend for entry in row]
    assert shown == entries[: len(shown)]
    for row in layout.legend:
        assert sum(map(layout.width_of, row)) <= layout.width - layout.unit or len(row) == 1
    assert layout.height < (0.4 if size[0] > 160 else 0.6) * size[1]
    assert (shown == entries) == (size[0] > 320), "a very small picture cannot name everything"


@pytest.mark.parametrize("outcome", list(Outcome))
def test_every_outcome_ends_with_words_in_its_colour(drive, outcome):
    ended = changed(drive, "record", outcome=outcome)
    shot = Shot(ended, camera="top", size=SIZE)
    before, after = shot.frame(1.0), shot.last_frame()
    colour = np.array(OUTCOME_LABELS[outcome][1])
    count = [(np.abs(frame.astype(int) - colour).max(axis=-1) < 6).sum() for frame in (before, after)]
    assert count[1] > count[0] + 300


def test_the_camera_closes_in_on_a_contact_and_names_it(crash, monkeypatch):
    said = []
    monkeypatch.setattr(shot, "pill", lambda *given: said.append(given[0]) or pill(*given))
    one = Shot(crash, camera="oblique", size=SIZE)
    end = one.playback.duration
    first, before = one.frame(0.0), one.frame(end - 0.31)
    wide = one._compositor.camera.pixel
    assert not said
    final = one.last_frame()
    assert said == ["COLLIDED"]
    assert one._compositor.camera.pixel < 0.6 * wide
    px, py = (round(value) for value in one._compositor.pixel(*one.playback.first_contact, 0.1))
    py += one._layout.height

    def redness(picture):
        red, green, _ = np.moveaxis(picture[py - 12 : py + 12, px - 12 : px + 12].astype(int), -1, 0)
        return ((red - green) > 90).mean()

    assert redness(final) > 0.15
    assert first.shape == before.shape == final.shape


def test_the_camera_leaves_a_contact_after_which_the_drive_goes_on(made_up_drive):
    drive = made_up_drive(seconds=4.0)
    touched = replace(drive, contacts=np.array([[240.0, 0.0, -0.001, 9.0]]))
    closeness = [playback.Playback(touched).closeness(at, 1.0) for at in (0.6, 1.0, 1.1, 1.7, 3.9)]
    assert closeness == pytest.approx([0.0, 1.0, 1.0, 0.0, 0.0])


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


def test_a_film_goes_into_slow_motion_around_a_contact(crash):
    shot = Shot(crash, camera="oblique", size=SIZE)
    end, (first, last) = shot.playback.duration, shot.slow_motion
    times = frame_times(end, 30, 1.0, shot.slow_motion)
    word = [shot.frame(at)[:60, -120:] for at in (first - 0.1, first + 0.1)]
    steps = np.diff(times)
    slowly = (times[:-1] >= first) & (times[1:] <= last)
    assert steps[slowly] == pytest.approx(1 / 30 / playback.SLOW_MOTION)
    assert steps[: slowly.argmax() - 1] == pytest.approx(1 / 30)
    assert times[0] == 0
    assert end - times[-1] < 1 / 30
    red = [((part[..., 0].astype(int) - part[..., 1]) > 120).sum() for part in word]
    assert red[0] == 0
    assert red[1] > 100, "the band is labelled SLOW"


def test_the_certificate_appears_with_the_outcome_at_the_end(drive, monkeypatch):
    words = []
    monkeypatch.setattr(overlay, "pill", lambda *given: words.append(given) or pill(*given))
    shot = Shot(drive, camera="top", size=SIZE)
    shot.frame(0.0)
    assert "certified" not in str(words)
    shot.last_frame()
    assert caption(drive) in str(words)


def test_a_replan_shows_its_new_route_and_its_cause(drive, monkeypatch):
    """The new route replaces the old one, a ring marks the place, and the status shows the cause."""
    new = ReplanRecord(t=0.3, trigger="obstructed", solved=True, cost_m=2.5, work=1, route=((1.0, 0.4), (3.5, 0.4)))
    unsolved = replace(new, t=0.8, trigger="waited", solved=False, cost_m=None, route=())
    replanned = changed(drive, "record", replans=(new, unsolved))

    def views(rollout, *times):
        shot = Shot(rollout, camera="top", size=SIZE, bare=True)
        return [shot.view(at).astype(int) for at in times]

    kept, plain = views(drive, 0.2, 0.5)
    before, after, failed = views(replanned, 0.2, 0.5, 0.85)
    said = []
    monkeypatch.setattr(overlay, "pill", lambda *given: said.append(given[0]) or pill(*given))
    shown = Shot(replanned, camera="top", size=SIZE)
    for at in (0.2, 0.5, 0.85):
        shown.frame(at)
    assert said == ["DRIVING", "NEW ROUTE: BLOCKED", "NO NEW ROUTE: WAITED"]
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


def test_replans_at_every_cell_have_no_caption(drive):
    entry = ReplanRecord(t=0.0, trigger="decision", solved=True, cost_m=0.5, work=1, route=((1.0, 1.0), (1.5, 1.0)))
    decided = changed(drive, "record", replans=(entry,))
    shot = Shot(decided, camera="top", size=SIZE)
    assert [event.caption for event in shot.playback.replans] == [""]
    shot.frame(0.5)


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


def test_a_comparisons_prelude_shows_ants_at_work_and_the_other_plan(walked, tmp_path, monkeypatch):
    other = changed(walked, "record", planner=ComponentRecord(name="astar", settings={}))
    other = replace(other, pose=other.pose + [1e-6, 0.0, 0.0])
    rows = []
    monkeypatch.setattr(overlay, "_draw_drive", lambda draw, row, *_: rows.append((row.names, *row.facts)))
    setting = {"camera": "top", "size": (640, 360)}
    first, _, last = planning_frames({"as": walked, "astar": other}, setting, 3)
    assert (first[80:] != last[80:]).any()
    assert rows[0][:2] == ("as", "iteration 4 of 12")
    assert rows[1] == ("astar", f"planned {other.record.plan.length_m:.1f} m")
    purple = np.array(label_styles(["astar"])[0].colour)
    assert (np.abs(last.astype(int) - purple).max(axis=-1) < 30).sum() > 50
    with pytest.raises(InputError, match="no planner of the comparison has a field"):
        film({"a": other, "b": other}, tmp_path / "c.gif", prelude=1)


def test_a_prelude_shows_the_field_of_any_of_identical_drives(walked):
    other = changed(walked, "record", planner=ComponentRecord(name="astar", settings={}))
    assert len(list(planning_frames({"astar": other, "as": walked}, {"camera": "top", "size": SIZE}, 2))) == 2


def test_planning_shows_the_iteration_that_found_the_best_path_so_far(walked):
    lengths = [stage.state.best for stage in prelude.planning_stages(walked, 12)]
    found = [stage.found for stage in prelude.planning_stages(walked, 12)]
    assert found == [1 + lengths.index(length) for length in lengths]


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
