"""Films and stills of runs, rendered from their logs.

Frames go to the encoder one at a time: memory does not grow with the film's length. Files are written atomically.
"""

from __future__ import annotations

import itertools
import subprocess
import tempfile
import time
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import asdict
from fractions import Fraction
from pathlib import Path
from typing import IO, Any

import numpy as np
from PIL import Image

from antdrive.base.atomic import atomic_write
from antdrive.base.errors import FieldError, InputError
from antdrive.base.files import known_suffix
from antdrive.base.types import Floats
from antdrive.sim.log.rollout import Rollout
from antdrive.views.film.camera import Picture
from antdrive.views.film.film_options import ENCODERS, STILLS, FilmInfo, FilmOptions
from antdrive.views.film.playback import SLOW_MOTION, Playback
from antdrive.views.film.prelude import check_field, has_field, planning_frames
from antdrive.views.film.shot import Shot

HOLD = 1.0  # duration of the last picture [s]; twice that of several runs
MAX_RUNS = 6


def film(
    rollouts: Rollout | Mapping[str, Rollout],
    path: str | Path,
    *,
    camera: str | None = None,
    size: tuple[int, int] = (1280, 720),
    fps: float = 30.0,
    speed: float = 1.0,
    note: str | None = None,
    prelude: float = 0.0,
    progress: Callable[[float], None] | None = None,
) -> FilmInfo:
    """Film a run, or up to six runs in one world on one clock.

    The film of one run closes in on its first contact, four times slower. Of several runs each robot and path has its
    planner's colour; bitwise identical drives are one robot; a drive that ends early leaves a pale robot.

    Args:
        rollouts: the run's log, or the logs by name
        path: the file to write; its suffix selects the format: .mp4 (H.264), .gif or .webp
        camera: `oblique`, `top` or, of one run, `follow`; default: `follow`, of several runs `oblique`
        size: width and height, even numbers from 160 to 4096 [px]
        fps: frames per second, at most 240
        speed: the film's speed relative to the run; 2 is twice as fast
        note: a line in the band above the picture, such as the certificate's result
        prelude: length of an introduction with the planning [s]: the field of an iterative planner and its best path
            so far, planned again from the run's seed; beside it the plans of the others
        progress: called after each frame with the completed fraction

    Raises:
        InputError: an unknown camera or suffix; a size, rate or speed out of range; a prelude without a planner that has
            a field; more than six runs, or runs in different worlds; or the film cannot be written.
    """
    target = Path(path)
    known_suffix(target, ENCODERS)
    if not isinstance(rollouts, Rollout) and len(rollouts) == 1:
        (rollouts,) = rollouts.values()
    options = FilmOptions(camera=camera, size=size, fps=fps, speed=speed, note=note)
    options = options.checked(several=not isinstance(rollouts, Rollout))
    before, hold = round(prelude * fps), round(HOLD * fps)
    if isinstance(rollouts, Rollout):
        playback = Playback(rollouts)
        times = frame_times(playback.duration, fps, speed, playback.slow_motion(speed))
        if before:
            check_field(rollouts)
    else:
        hold *= 2
        _check_several(rollouts, before > 0)
        times = frame_times(max(float(log.t[-1] - log.t[0]) for log in rollouts.values()), fps, speed)
    frames = _frames(rollouts, asdict(options), before, times, hold)
    return encoded(target, options, before + len(times) + hold, frames, progress)


def _check_several(rollouts: Mapping[str, Rollout], prelude: bool) -> None:
    """Raise `InputError` unless several runs fit in one film."""
    if not 2 <= len(rollouts) <= MAX_RUNS:
        raise InputError(f"film: needs 1 to {MAX_RUNS} runs, got {len(rollouts)}")
    worlds = {log.record.world.obstacles: log.record.task.world.name for log in rollouts.values()}
    if len(worlds) > 1:
        raise InputError(
            f"film: runs in different worlds ({', '.join(dict.fromkeys(worlds.values()))}); film each alone"
        )
    if prelude and not any(map(has_field, rollouts.values())):
        raise InputError("prelude: no planner of the comparison has a field")


def _frames(
    rollouts: Rollout | Mapping[str, Rollout],
    setting: dict[str, Any],
    before: int,
    times: Floats,
    hold: int,
) -> Iterator[Picture]:
    """Yield all frames: `before` frames of planning, the drive at `times`, `hold` frames of its end."""
    if before:
        yield from planning_frames(rollouts, setting, before)
    shot = Shot(rollouts, **setting)
    yield from map(shot.frame, times)
    yield from itertools.repeat(shot.last_frame(), hold)


def still(
    rollout: Rollout,
    path: str | Path,
    t: float | None = None,
    *,
    camera: str | None = None,
    size: tuple[int, int] = (1280, 720),
    note: str | None = None,
) -> Path:
    """Write one picture of a run as PNG or WebP.

    Args:
        rollout: the run's log
        path: the file to write, with the suffix .png or .webp
        t: the time to show [s]; None: the end, with the outcome as a sentence
        camera: `oblique`, `top` or `follow`, the default
        size: width and height, even numbers from 160 to 4096 [px]
        note: a line in the band above the picture

    Returns:
        The file's path.

    Raises:
        InputError: an unknown camera, a suffix other than .png and .webp, or a size out of range.
        FieldError: the drive ends before the time.
    """
    target = Path(path)
    kind = known_suffix(target, STILLS)
    shot = Shot(rollout, camera=camera, size=size, note=note)
    if t is not None and not 0.0 <= t <= shot.duration:
        raise FieldError("at", f"{t:g} s is outside the drive, which lasts {shot.duration:.2f} s")
    picture = shot.last_frame() if t is None else shot.frame(float(t))
    with atomic_write(target) as temporary:
        Image.fromarray(picture).save(temporary, format=kind[1:], **STILLS[kind])
    return target


def frame_times(duration: float, fps: float, speed: float, slow: tuple[float, float] | None = None) -> Floats:
    """Return the times of the frames [s]: the first is 0, the last less than one frame before the end."""
    if slow is None:
        return np.arange(int(duration * fps / speed + 1e-9) + 1, dtype=np.float64) * (speed / fps)
    run = np.array([0.0, *slow, duration])
    shown = np.concatenate([[0.0], np.cumsum(np.diff(run) * [1, SLOW_MOTION, 1])]) / speed
    return np.asarray(np.interp(np.arange(int(shown[-1] * fps + 1e-9) + 1) / fps, shown, run))


def encoded(
    target: Path,
    options: FilmOptions,
    total: int,
    frames: Iterable[Picture],
    progress: Callable[[float], None] | None = None,
) -> FilmInfo:
    """Render and encode a film atomically and return facts about it."""
    started = time.perf_counter()
    with atomic_write(target) as temporary, encoding(temporary, options.size, options.fps) as send:
        for k, picture in enumerate(frames):
            send(picture)
            if progress is not None:
                progress((k + 1) / total)
    wall_s = time.perf_counter() - started
    return FilmInfo(target, total, options.size, float(options.fps), str(options.camera), wall_s)


@contextmanager
def encoding(path: Path, size: tuple[int, int], fps: float) -> Iterator[Callable[[Picture], None]]:
    """Yield a function that appends a frame (H, W, 3) to a film through a pipe to ffmpeg; the block's end completes the film."""
    import imageio_ffmpeg

    rate = str(Fraction(fps).limit_denominator(100_000))
    command = [
        *(imageio_ffmpeg.get_ffmpeg_exe(), "-y", "-v", "error", "-f", "rawvideo", "-pix_fmt", "rgb24"),
        *("-s", f"{size[0]}x{size[1]}", "-r", rate, "-i", "-", "-an", *ENCODERS[path.suffix.lower()], str(path)),
    ]
    with tempfile.TemporaryFile() as messages:
        # In its own session: Ctrl-C reaches only this process, which stops ffmpeg and removes the file.
        process = subprocess.Popen(  # noqa: S603
            command,
            stdin=subprocess.PIPE,
            stdout=subprocess.DEVNULL,
            stderr=messages,
            start_new_session=True,
            bufsize=0,
        )
        pipe = process.stdin
        assert pipe is not None
        try:
            yield lambda picture: _write_all(pipe, picture)
            pipe.close()
            process.wait()
        except (BrokenPipeError, ConnectionResetError):
            process.wait()
        finally:
            if process.poll() is None:
                process.kill()
                process.wait()
            pipe.close()
        if process.returncode != 0:
            messages.seek(0)
            lines = messages.read().decode(errors="replace").strip().splitlines()
            raise OSError(f"ffmpeg failed to write the film ({lines[0] if lines else process.returncode})")


def _write_all(pipe: IO[bytes], frame: Picture) -> None:
    left = np.ascontiguousarray(frame).data.cast("B")
    while left:
        left = left[pipe.write(left) :]
