import itertools
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
from antdrive.sim.log.record import ReplanRecord
from antdrive.views.film import encoder, overlay, video
from antdrive.views.film.overlay import Layout, _entry_width, banner, legend_entries, legend_rows
from antdrive.views.film.shot import Shot
from antdrive.views.film.text import text_width
from antdrive.views.film.video import film, frame_times, still
from antdrive.views.scene import Scene
from antdrive.views.style import VERDICTS

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
    seen: list[float] = []
    info = film(drive, path, size=SIZE, fps=20, note="certified", progress=seen.append)
    return info, seen


def ffmpeg(*arguments):
    command = [imageio_ffmpeg.get_ffmpeg_exe(), "-hide_banner", *map(str, arguments)]
    return subprocess.run(command, capture_output=True, check=False)


def decoded(path):
    """ffmpeg's description of the video stream, and the frames."""
    stream = next(line for line in ffmpeg("-i", path).stderr.decode().splitlines() if " Video: " in line)
    width, height = (int(side) for side in re.search(r", (\d+)x(\d+)", stream).groups())
    raw = ffmpeg("-v", "error", "-i", path, "-f", "rawvideo", "-pix_fmt", "rgb24", "-").stdout
    return stream, np.frombuffer(raw, dtype=np.uint8).reshape(-1, height, width, 3)


def test_a_film_has_the_frames_size_rate_and_format_it_claims(filmed):
    info, _ = filmed
    stream, frames = decoded(info.path)
    assert len(frames) == info.frames == 21 + 20
    assert frames.shape[2:0:-1] == info.size == SIZE
    assert "Video: h264" in stream
    assert "yuv420p" in stream
    assert ", 20 fps" in stream
    assert imageio_ffmpeg.count_frames_and_secs(str(info.path))[0] == info.frames
    assert info.fps == 20
    assert info.duration_s == pytest.approx(2.05)
    assert info.renderer == "TinyRenderer"


def test_a_film_shows_what_was_drawn(filmed, drive):
    info, _ = filmed
    _, frames = decoded(info.path)
    with Shot(drive, camera="oblique", size=SIZE, note="certified") as shot:
        drawn = shot.frame(0.0)
    assert np.abs(frames[0].astype(int) - drawn.astype(int)).mean() < 4
    assert np.abs(frames[10].astype(int) - frames[0].astype(int)).max() > 100


def test_progress_ends_at_one(filmed):
    _, seen = filmed
    assert seen[-1] == 1.0
    assert all(a < b for a, b in itertools.pairwise(seen))


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


def test_every_camera_shows_robot_and_goal(drive, tmp_path):
    pictures = {}
    for camera in video.CAMERAS:
        path = still(drive, tmp_path / f"{camera}.png", 0.5, camera=camera, size=SIZE)
        with Image.open(path) as picture:
            pictures[camera] = np.asarray(picture).astype(int)
        red, green, blue = np.moveaxis(pictures[camera], -1, 0)
        assert ((red > 215) & (green > 80) & (green < 150) & (blue < 60)).sum() > 8, "the robot's orange shell"
    assert np.abs(pictures["top"] - pictures["oblique"]).max() > 100


@pytest.mark.parametrize("size", [(640, 480), (1280, 720), (320, 240), (480, 640)])
def test_the_band_fits_every_size(drive, size):
    for rows in (0, 1):
        layout = Layout.of(size, rows)
        assert layout.height % 2 == 0
        assert layout.height < 0.35 * size[1]
    with Shot(drive, camera="top", size=size, note="certified: min clearance 0.043 m") as shot:
        assert shot.frame(0.5).shape == (size[1], size[0], 3)


DRIFTED = (
    "the robot believed that it was at the goal, 0.01 m from it, but was 1.411 m from it (the tolerance is 1 m): "
    "its estimate was wrong by 1.42 m"
)


@pytest.mark.parametrize("size", [(960, 540), (640, 480), (1280, 720), (480, 640)])
def test_a_cause_that_has_no_room_beside_the_numbers_has_lines_of_its_own(drive, size):
    note = f"seed 0, stuck: {DRIFTED}"
    layout = Layout.of(size, 1, note)
    assert " ".join(layout.note) == note
    assert all(text_width(line, layout.small, True) <= size[0] - 2 * layout.unit for line in layout.note)
    assert Layout.of(size, 1).height < layout.height < 0.4 * size[1]
    assert Layout.of(size, 1, "seed 0") == Layout.of(size, 1)
    with Shot(drive, camera="top", size=size, note=note) as shot:
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


@pytest.mark.parametrize("size", [(480, 360), (640, 480), (1280, 720), (320, 240), (160, 160)])
def test_a_legend_stays_within_its_rows(drive, size):
    entries = legend_entries(Scene.of(drive), 0.5, 0.02, replans=True, sight=True, followed=True)
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
    ended = replace(drive, record=replace(drive.record, outcome=outcome))
    with Shot(ended, camera="top", size=SIZE) as shot:
        before, after = shot.frame(1.0), shot.last_frame()
    colour = np.array(VERDICTS[outcome][1])
    count = [(np.abs(frame.astype(int) - colour).max(axis=-1) < 6).sum() for frame in (before, after)]
    assert count[1] > count[0] + 300


def test_a_contact_flashes_and_stays_marked(crash):
    with Shot(crash, camera="oblique", size=SIZE) as shot:
        end = shot.replay.duration
        before, at, final = shot.frame(end - 0.2), shot.frame(end), shot.last_frame()
        px, py = (round(value) for value in shot._compositor.pixel(*shot.replay.contact(end)[:2], 0.1))

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


def test_the_smallest_clearance_so_far_never_grows(crash):
    with Shot(crash, camera="top", size=SIZE) as shot:
        replay = shot.replay
    read = [replay.min_clearance(at) for at in np.linspace(0, replay.duration, 50)]
    assert all(a >= b for a, b in itertools.pairwise(read))
    assert read[-1] == crash.clearance.min()


def test_wheels_roll_as_far_as_the_robot_drives(drive):
    with Shot(drive, camera="top", size=SIZE) as shot:
        left, right = shot.replay.wheels(shot.replay.duration)
    length = np.hypot(*np.diff(drive.pose[:, :2], axis=0).T).sum()
    assert (left + right) / 2 * Scene.of(drive).robot.wheel_radius == pytest.approx(length, rel=0.01)


def test_a_drive_without_rows_still_makes_a_picture(drive, tmp_path):
    empty = replace(
        drive, t=drive.t[:0], pose=drive.pose[:0], twist=drive.twist[:0], command=drive.command[:0],
        clearance=drive.clearance[:0], limiter=drive.limiter[:0], movers=drive.movers[:0], route=np.empty((0, 2)),
        record=replace(drive.record, outcome=Outcome.NO_PATH),
    )  # fmt: skip
    info = film(empty, tmp_path / "nothing.mp4", size=SIZE, fps=10)
    assert info.frames == 11


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


def test_an_encoder_that_dies_is_reported(drive, tmp_path, monkeypatch):
    monkeypatch.setitem(encoder.ENCODERS, ".mp4", ("-c:v", "no-such-codec"))
    with pytest.raises(OSError, match="no-such-codec"):
        film(drive, tmp_path / "drive.mp4", size=SIZE)
    assert not list(tmp_path.iterdir())


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


def test_the_index_is_in_front_so_that_browsers_play_at_once(filmed):
    head = filmed[0].path.read_bytes()
    assert head.index(b"moov") < head.index(b"mdat")


def test_ffmpeg_decodes_the_film_without_errors(filmed):
    checked = ffmpeg("-v", "error", "-i", filmed[0].path, "-f", "null", "-")
    assert checked.returncode == 0
    assert checked.stderr == b""


@pytest.mark.parametrize(
    ("path", "options", "message"),
    [
        ("a.avi", {}, r"unknown suffix '.avi'; choose one of .mp4, .gif, .webp"),
        ("a", {}, "unknown suffix ''"),
        ("a.mp4", {"camera": "side"}, "unknown camera 'side'; choose one of oblique, top, follow"),
        ("a.mp4", {"size": (321, 240)}, "size: .*even"),
        ("a.mp4", {"size": (32, 24)}, "size: .*from 160"),
        ("a.mp4", {"fps": 0}, "fps: must be greater than 0"),
        ("a.mp4", {"speed": -1}, "speed: must be greater than 0"),
    ],
)
def test_wrong_input_is_named(drive, tmp_path, path, options, message):
    with pytest.raises(InputError, match=message):
        film(drive, tmp_path / path, **options)
    assert not list(tmp_path.iterdir())


def test_a_still_is_a_png(drive, tmp_path):
    with pytest.raises(InputError, match=r"choose .png"):
        still(drive, tmp_path / "a.jpg")


def test_a_still_may_be_webp(drive, tmp_path):
    with Image.open(still(drive, tmp_path / "a.webp", 0.5, size=SIZE)) as picture:
        assert (picture.format, picture.size, getattr(picture, "n_frames", 1)) == ("WEBP", SIZE, 1)


@pytest.mark.parametrize("size", [(320, 240), (640, 480), (1280, 720)])
def test_the_outcomes_sentence_does_not_cover_the_legend(drive, size):
    with Shot(drive, camera="follow", size=size) as shot:
        before, after = shot.frame(shot.replay.duration), shot.last_frame()
        high, wide = (shot._layout.unit + side for side in shot._legend.shape[:2])
    assert np.array_equal(before[:high, :wide], after[:high, :wide])
    assert not np.array_equal(before, after)


def test_a_film_goes_into_slow_motion_around_a_contact(crash):
    with Shot(crash, camera="oblique", size=SIZE) as shot:
        end, (first, last) = shot.replay.duration, shot.slow_motion
        times = frame_times(end, 30, 1.0, shot.slow_motion)
        word = [shot.frame(at)[-100:, -120:] for at in (first - 0.1, first + 0.1)]
    steps = np.diff(times)
    slowly = (times[:-1] >= first) & (times[1:] <= last)
    assert steps[slowly] == pytest.approx(1 / 30 / video.SLOW_MOTION)
    assert steps[: slowly.argmax() - 1] == pytest.approx(1 / 30)
    assert times[0] == 0
    assert end - times[-1] < 1 / 30
    red = [((part[..., 0].astype(int) - part[..., 1]) > 120).sum() for part in word]
    assert red[0] == 0
    assert red[1] > 100, "the band is labelled SLOW"


@pytest.mark.parametrize("jobs", [2])
def test_frames_rendered_in_several_processes_equal_those_of_one(drive, jobs):
    from antdrive.views.film.parallel import render_frames

    setting = {"camera": "follow", "size": SIZE, "note": None, "speed": 1.0}
    times = frame_times(0.6, 60, 1.0)
    shared = list(render_frames(drive, setting, times, jobs))
    with Shot(drive, **setting) as shot:
        alone = [shot.frame(at) for at in times]
    assert len(shared) == len(alone) == len(times)
    assert all((a == b).all() for a, b in zip(shared, alone, strict=True))


def test_a_small_robot_gets_a_glow_and_a_large_one_none(made_up_drive):
    for size, found in (((30.0, 22.0), True), ((4.0, 3.0), False)):
        with Shot(made_up_drive(size=size, obstacles=0), camera="top", size=SIZE) as shot:
            compositor, pose = shot._compositor, shot.replay.pose(0.5)
            px, py = (round(value) for value in compositor.pixel(*pose[:2]))
            tinted = compositor.frame(pose).astype(int) - compositor.backdrop.pixels
        ring = np.abs(tinted[py - 14 : py + 14, px - 14 : px + 14, 2]).max()
        aside = np.abs(tinted[py, px + 5 : px + 9]).max() if found else 0
        assert ring > 100
        assert (aside > 20) == found


def test_a_replan_shows_its_new_route_and_its_cause(drive):
    """The new route replaces the old one, a dot marks the place, and the cause is shown for a while."""
    new = ReplanRecord(t=0.3, trigger="obstructed", solved=True, cost_m=2.5, work=1, route=((1.0, 0.4), (3.5, 0.4)))
    unsolved = replace(new, t=0.8, trigger="waited", solved=False, cost_m=None, route=())
    replanned = replace(drive, record=replace(drive.record, replans=(new, unsolved)))

    def views(rollout, news, *times):
        with Shot(rollout, camera="top", size=SIZE, bare=True) as shot:
            shot._replan_caption = news
            return [shot.view(at).astype(int) for at in times]

    kept, plain = views(drive, 0.0, 0.2, 0.5)
    before, after, failed = views(replanned, 0.0, 0.2, 0.5, 0.85)
    captioned = views(replanned, 1.0, 0.5)[0]
    with Shot(drive, camera="top", size=SIZE, bare=True) as shot:
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
    decided = replace(drive, record=replace(drive.record, replans=(entry,)))
    with Shot(decided, camera="top", size=SIZE) as shot:
        assert [event.caption for event in shot.replay.replans] == [""]
        shot.frame(0.5)
