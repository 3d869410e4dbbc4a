"""Films and stills of a run, rendered from its log after the drive, so that an old run can be filmed again.

Frames go straight to the encoder, one at a time, so a long film needs no more memory than a short one. A file appears
when it is complete.
"""

from __future__ import annotations

import itertools
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
from PIL import Image

from antdrive.base.atomic import written_whole
from antdrive.base.errors import InputError
from antdrive.sim.log.rollout import Rollout
from antdrive.views.film.camera import CAMERAS
from antdrive.views.film.encoder import encoding, known_suffix
from antdrive.views.film.parallel import MIN_FRAMES, process_count, render_frames
from antdrive.views.film.prelude import check_field, planning_frames
from antdrive.views.film.replay import SLOW_MOTION, Replay
from antdrive.views.film.shot import Shot

Floats = npt.NDArray[np.float64]
Picture = npt.NDArray[np.uint8]  # (H, W, 3)

STILLS: dict[str, dict[str, Any]] = {".png": {}, ".webp": {"quality": 82, "method": 4}}  # how pictures are written

HOLD = 1.0  # the last picture stays this long [s]


@dataclass(frozen=True)
class FilmInfo:
    """Facts about a film that was written.

    Attributes:
        path: the file
        frames: the number of frames
        size: width and height [px]
        fps: frames per second
        camera: the camera's name
        wall_s: how long rendering and encoding took [s]
    """

    path: Path
    frames: int
    size: tuple[int, int]
    fps: float
    camera: str
    wall_s: float

    @property
    def renderer(self) -> str:
        """The name of the renderer that drew the bodies."""
        return "TinyRenderer and rays" if self.camera == "follow" else "TinyRenderer"

    @property
    def duration_s(self) -> float:
        """The film's length [s]."""
        return self.frames / self.fps


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
    """Film a run. Around a contact the film goes into slow motion, four times slower.

    Args:
        rollout: the run's log
        path: the file to write; its suffix chooses the format: .mp4 (H.264), .gif or .webp
        camera: `oblique`, `top` or `follow`
        size: width and height, even numbers from 160 to 4096 [px]
        fps: frames per second, at most 240
        speed: the film's speed relative to the run; 2 is twice as fast
        note: a line for the band below the picture, for example the certificate's verdict
        prelude: the length of an introduction that shows how the path was planned [s]: the field of an iterative
            planner on the ground, and its best path so far; the path is planned again from the run's seed
        jobs: how many processes render for the camera `follow`, by default one per core; the film does not depend on it
        progress: called after each frame with the fraction that is done

    Raises:
        InputError: an unknown camera or suffix, a size, rate or speed that is out of range, or a prelude for a
            planner without a field.
        OSError: the encoder could not write the film.
    """
    target = Path(path)
    known_suffix(target)
    check_options(camera, size, fps, speed)
    started = time.perf_counter()
    setting = {"camera": camera, "size": size, "note": note, "speed": speed}
    replay = Replay(rollout)
    times = frame_times(replay.duration, fps, speed, replay.slow_motion(speed))
    before, hold = round(prelude * fps), round(HOLD * fps)
    total = before + len(times) + hold
    if before:
        check_field(rollout)
    with written_whole(target) as temporary, encoding(temporary, size, fps) as send:
        for k, picture in enumerate(_frames(rollout, setting, before, times, hold, jobs)):
            send(picture)
            if progress is not None:
                progress((k + 1) / total)
    return FilmInfo(target, total, size, float(fps), camera, time.perf_counter() - started)


def _frames(
    rollout: Rollout, setting: dict[str, Any], before: int, times: Floats, hold: int, jobs: int | None
) -> Iterator[Picture]:
    """Every frame in turn: `before` frames of planning, the drive at `times`, `hold` frames of its end."""
    if before:
        yield from planning_frames(rollout, setting, before)
    with Shot(rollout, **setting) as shot:
        jobs = process_count() if jobs is None else jobs
        if setting["camera"] == "follow" and jobs > 1 and len(times) > MIN_FRAMES:
            yield from render_frames(rollout, setting, times, jobs)
            for at in times:  # the trail is painted step by step, as in the other processes
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
        t: the moment to show [s]; None for the end, with the outcome as a sentence
        camera: `oblique`, `top` or `follow`
        size: width and height, even numbers from 160 to 4096 [px]
        note: a line for the band below the picture

    Returns:
        The file's path.

    Raises:
        InputError: an unknown camera, a suffix other than .png and .webp, or a size that is out of range.
    """
    target = Path(path)
    kind = target.suffix.lower()
    if kind not in STILLS:
        raise InputError(f"{target}: unknown suffix {target.suffix!r}; choose {' or '.join(STILLS)}")
    check_options(camera, size, 1.0, 1.0)
    with Shot(rollout, camera=camera, size=size, note=note) as shot:
        picture = shot.last_frame() if t is None else shot.frame(min(max(float(t), 0.0), shot.replay.duration))
    with written_whole(target) as temporary:
        Image.fromarray(picture).save(temporary, format=kind[1:], **STILLS[kind])
    return target


def frame_times(duration: float, fps: float, speed: float, slow: tuple[float, float] | None = None) -> Floats:
    """The moments of the run that frames show [s]; the first is 0, the last less than a frame before the end."""
    if slow is None:
        return np.arange(int(duration * fps / speed + 1e-9) + 1, dtype=np.float64) * (speed / fps)
    run = np.array([0.0, *slow, duration])
    shown = np.concatenate([[0.0], np.cumsum(np.diff(run) * [1, SLOW_MOTION, 1])]) / speed
    return np.asarray(np.interp(np.arange(int(shown[-1] * fps + 1e-9) + 1) / fps, shown, run))


def check_options(camera: str, size: tuple[int, int], fps: float, speed: float) -> None:
    """Check a film's options before any work.

    Raises:
        InputError: an unknown camera, or a size, rate or speed that is out of range.
    """
    if camera not in CAMERAS:
        raise InputError(f"camera: unknown camera {camera!r}; choose one of {', '.join(CAMERAS)}")
    if len(size) != 2 or any(side % 2 or not 160 <= side <= 4096 for side in size):
        raise InputError(f"size: width and height must be even numbers from 160 to 4096, got {size}")
    for key, value in (("fps", fps), ("speed", speed)):
        if not 0 < value <= 240:
            raise InputError(f"{key}: must be greater than 0 and at most 240, got {value:g}")
