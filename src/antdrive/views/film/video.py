"""Films and stills of a run, rendered from its log.

Frames go to the encoder one at a time: memory does not grow with the film's length. Files are written atomically.
"""

from __future__ import annotations

import functools
import itertools
import subprocess
import tempfile
import time
import uuid
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import asdict
from fractions import Fraction
from pathlib import Path
from typing import IO, Any

import numpy as np
from PIL import Image

from antdrive.base.atomic import atomic_write
from antdrive.base.errors import FieldError
from antdrive.base.files import file_name, known_suffix
from antdrive.base.types import Floats
from antdrive.runs.pool import Pool, cores
from antdrive.sim.log.rollout import Rollout
from antdrive.views.film.camera import Picture
from antdrive.views.film.film_options import ENCODERS, STILLS, FilmInfo, FilmOptions
from antdrive.views.film.playback import SLOW_MOTION, Playback
from antdrive.views.film.prelude import check_field, planning_frames
from antdrive.views.film.shot import Shot

HOLD = 1.0  # duration of the last picture [s]
CHUNK = 16  # frames per task of a process
MIN_FRAMES = 300  # starting processes takes as long as rendering this many frames
MAX_PROCESSES = 8  # each takes about 150 MB
FAILURE_SIZE = (960, 540)  # of films of a campaign's failures [px]
LONGEST_FAILURE = 30.0  # films of longer drives are sped up to this length [s]


def film(
    rollout: Rollout,
    path: str | Path,
    *,
    camera: str = "oblique",
    size: tuple[int, int] = (1280, 720),
    fps: float = 30.0,
    speed: float = 1.0,
    note: str | None = None,
    prelude: float = 0.0,
    jobs: int | None = None,
    progress: Callable[[float], None] | None = None,
) -> FilmInfo:
    """Film a run, four times slower around a contact.

    Args:
        rollout: the run's log
        path: the file to write; its suffix selects the format: .mp4 (H.264), .gif or .webp
        camera: `oblique`, `top` or `follow`
        size: width and height, even numbers from 160 to 4096 [px]
        fps: frames per second, at most 240
        speed: the film's speed relative to the run; 2 is twice as fast
        note: a line in the band below the picture, such as the certificate's result
        prelude: length of an introduction with the planning [s]: the field of an iterative planner and its best path
            so far, planned again from the run's seed
        jobs: number of rendering processes for the camera `follow`, by default one per core; it does not change the film
        progress: called after each frame with the completed fraction

    Raises:
        InputError: an unknown camera or suffix; a size, rate or speed out of range; a prelude for a planner without a
            field; or the film cannot be written.
    """
    target = Path(path)
    known_suffix(target, ENCODERS)
    options = FilmOptions(camera=camera, size=size, fps=fps, speed=speed, note=note).checked()
    playback = Playback(rollout)
    times = frame_times(playback.duration, fps, speed, playback.slow_motion(speed))
    before, hold = round(prelude * fps), round(HOLD * fps)
    if before:
        check_field(rollout)
    frames = _frames(rollout, asdict(options), before, times, hold, jobs)
    return encoded(target, options, before + len(times) + hold, frames, progress)


def _frames(
    rollout: Rollout, setting: dict[str, Any], before: int, times: Floats, hold: int, jobs: int | None
) -> Iterator[Picture]:
    """Yield all frames: `before` frames of planning, the drive at `times`, `hold` frames of its end."""
    if before:
        yield from planning_frames(rollout, setting, before)
    shot = Shot(rollout, **setting)
    jobs = process_count() if jobs is None else jobs
    if setting["camera"] == "follow" and jobs > 1 and len(times) > MIN_FRAMES:
        yield from render_frames(rollout, setting, times, jobs)
        for at in times:  # in the same steps as in the rendering processes
            shot.extend_trail(at)
    else:
        for at in times:
            yield shot.frame(at)
    yield from itertools.repeat(shot.last_frame(), hold)


def still(
    rollout: Rollout,
    path: str | Path,
    t: float | None = None,
    *,
    camera: str = "oblique",
    size: tuple[int, int] = (1280, 720),
    note: str | None = None,
) -> Path:
    """Write one picture of a run as PNG or WebP.

    Args:
        rollout: the run's log
        path: the file to write, with the suffix .png or .webp
        t: the time to show [s]; None: the end, with the outcome as a sentence
        camera: `oblique`, `top` or `follow`
        size: width and height, even numbers from 160 to 4096 [px]
        note: a line in the band below the picture

    Returns:
        The file's path.

    Raises:
        InputError: an unknown camera, a suffix other than .png and .webp, or a size out of range.
        FieldError: the drive ends before the time.
    """
    target = Path(path)
    kind = known_suffix(target, STILLS)
    shot = Shot(rollout, **asdict(FilmOptions(camera=camera, size=size, note=note).checked()))
    if t is not None and not 0.0 <= t <= shot.playback.duration:
        raise FieldError("at", f"{t:g} s is outside the drive, which lasts {shot.playback.duration:.2f} s")
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
    return FilmInfo(target, total, options.size, float(options.fps), options.camera, wall_s)


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


def process_count() -> int:
    """Return the default number of rendering processes: one per available core, at most `MAX_PROCESSES`."""
    return min(MAX_PROCESSES, cores())


def render_frames(rollout: Rollout, setting: dict[str, Any], times: Floats, jobs: int) -> Iterator[Picture]:
    """Yield frames (H, W, 3) in order, rendered in several processes, for cameras that need a backdrop per frame.

    Frames do not depend on the number of processes; `jobs` x `CHUNK` frames are held at once.
    """
    chunks = [(first, min(first + CHUNK, len(times))) for first in range(0, len(times), CHUNK)]
    render = functools.partial(_render, uuid.uuid4().hex, rollout, setting, times)
    with Pool(0 if jobs == 1 else jobs) as pool:
        for k in range(0, len(chunks), jobs):
            for rendered in pool.results(render, chunks[k : k + jobs]):
                yield from rendered


#: Shot of the film that a worker process renders, by the film's id.
_shots: dict[str, Shot] = {}


def _render(
    number: str, rollout: Rollout, setting: dict[str, Any], times: Floats, chunk: tuple[int, int]
) -> list[Picture]:
    first, end = chunk
    shot = _shots.get(number)
    if shot is None:
        _shots.clear()
        shot = _shots[number] = Shot(rollout, **setting)
    for at in times[:first][times[:first] > shot.shown]:
        shot.extend_trail(at)
    return [shot.frame(at) for at in times[first:end]]


def film_failures(
    rows: Iterable[Mapping[str, Any]],
    logs: str | Path,
    folder: str | Path,
    *,
    size: tuple[int, int] = FAILURE_SIZE,
    progress: Callable[[float], None] | None = None,
) -> dict[str, Path]:
    """Film every failed run of a campaign that has a log, and return all films by the runs' keys.

    The note names seed, outcome and reason. Films of drives longer than 30 s are sped up to 30 s. A film newer than its
    log, or without a log, is kept.
    """
    failed = [row for row in rows if not row["succeeded"] and row["rollout"]]
    films = {}
    for k, row in enumerate(failed):
        log = Path(logs) / row["rollout"]
        name = f"{row['world']}-{row['planner']}-{row['robot']}-{row['seed']}-{row['key'][:8]}.mp4"
        path = Path(folder) / file_name(name)
        kept = log.exists()
        if kept and (not path.exists() or path.stat().st_mtime < log.stat().st_mtime):
            cause = ": ".join(text for text in (row["outcome"], row["reason"]) if text)
            path.parent.mkdir(parents=True, exist_ok=True)
            drive = Rollout.load(log)
            speed = max(1.0, float(drive.t[-1]) / LONGEST_FAILURE)
            film(drive, path, size=size, speed=speed, note=f"seed {row['seed']}, {cause}")
        if kept or path.exists():
            films[row["key"]] = path
        if progress is not None:
            progress((k + 1) / len(failed))
    return films
