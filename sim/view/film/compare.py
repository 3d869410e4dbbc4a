"""Several runs side by side, synchronised: each in a picture of its own, all at the same moment."""

from __future__ import annotations

import itertools
import time
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from pathlib import Path

import numpy as np
import numpy.typing as npt
from PIL import Image, ImageDraw

from antdrive.sim.log.rollout import Rollout
from antdrive.sim.view.film import _kernels_paint as kernels
from antdrive.sim.view.film.caption import VERDICTS
from antdrive.sim.view.film.encode import encoding, known_suffix
from antdrive.sim.view.film.lettering import fitted, font, pill, text_width
from antdrive.sim.view.film.video import HOLD, FilmInfo, Shot, check_options, frame_times
from antdrive.sim.view.style import BAND, CALM, INK, MUTED, planner_style
from antdrive.worlds.errors import InputError
from antdrive.worlds.files.atomic import written_whole

Picture = npt.NDArray[np.uint8]  # (H, W, 3)

MOST = 6


def compare_film(
    rollouts: Sequence[Rollout],
    path: str | Path,
    *,
    camera: str = "oblique",
    size: tuple[int, int] = (1280, 720),
    fps: float = 30.0,
    speed: float = 1.0,
    progress: Callable[[float], None] | None = None,
) -> FilmInfo:
    """Film two to six runs side by side, `speed` times as fast as they happened; those that end first wait for the last.

    Raises:
        InputError: fewer than two runs or more than six; what `film` refuses.
        OSError: the encoder could not write the film.
    """
    target = Path(path)
    known_suffix(target)
    check_options(camera, size, fps, speed)
    if not 2 <= len(rollouts) <= MOST:
        raise InputError(f"compare: needs 2 to {MOST} runs, got {len(rollouts)}")
    started = time.perf_counter()
    times = frame_times(max(float(log.t[-1] - log.t[0]) for log in rollouts), fps, speed)
    total = len(times) + round(2 * HOLD * fps)
    with (
        written_whole(target) as temporary,
        encoding(temporary, size, fps) as send,
        Split(rollouts, camera, size) as split,
    ):
        for k, at in enumerate(itertools.chain(times, itertools.repeat(np.inf, total - len(times)))):
            send(split.picture(float(at)))
            if progress is not None:
                progress((k + 1) / total)
    return FilmInfo(target, total, size, float(fps), camera, time.perf_counter() - started)


class Split:
    """Several runs before cameras of one kind. Use it in a `with` block."""

    def __init__(self, rollouts: Sequence[Rollout], camera: str, size: tuple[int, int]) -> None:
        cols, rows = _arrangement(len(rollouts), size)
        wide, high = (size[0] // cols) // 2 * 2, (size[1] // rows) // 2 * 2
        self._size = size
        self._corners = [((k % cols) * wide, (k // cols) * high) for k in range(len(rollouts))]
        one_world = len({log.record.task.world.name for log in rollouts}) == 1
        self._tiles = [Tile(log, camera, (wide - 2, high - 2), one_world) for log in rollouts]
        self._open = ExitStack()

    def __enter__(self) -> Split:
        for tile in self._tiles:
            self._open.enter_context(tile.shot)
        return self

    def __exit__(self, *problem: object) -> None:
        self._open.close()

    def picture(self, at: float) -> Picture:
        """The frame (H, W, 3) at a moment of all runs [s]."""
        frame = np.full((*self._size[::-1], 3), (210, 216, 225), dtype=np.uint8)
        for (x, y), tile in zip(self._corners, self._tiles, strict=True):
            part = tile.picture(at)
            frame[y : y + part.shape[0], x : x + part.shape[1]] = part
        return frame


class Tile:
    """One run among several: its picture under a line with its planner's name and a line of numbers."""

    def __init__(self, rollout: Rollout, camera: str, size: tuple[int, int], one_world: bool) -> None:
        self._unit = max(11, round(min(size[0] / 30, size[1] / 22)))
        self._head = 2 * round(1.55 * self._unit)
        self.shot = Shot(rollout, camera=camera, size=(size[0], size[1] - self._head), bare=True)
        planner = rollout.record.planner.name
        self._name = planner if one_world else f"{planner} · {rollout.record.task.world.name}"
        self._colour = planner_style(planner)[0]
        self._outcome = rollout.outcome
        self._length = rollout.record.plan.length_m
        self._last: Picture | None = None  # what stays once the run is over

    def picture(self, at: float) -> Picture:
        """The tile (h, w, 3) at a moment [s]; after the run's end, the end."""
        end = self.shot.replay.duration
        if at < end:
            return self._framed(self.shot.view(at), at, False)
        if self._last is None:
            self._last = self._framed(self.shot.view(end, last=True), end, True)
        return self._last

    def _framed(self, view: Picture, at: float, over: bool) -> Picture:
        unit, wide = self._unit, view.shape[1]
        image = Image.new("RGB", (wide, self._head), BAND)
        draw = ImageDraw.Draw(image)
        draw.rectangle((0, 0, round(0.5 * unit), self._head), fill=self._colour)
        words, colour = VERDICTS[self._outcome] if over else (f"{at:.1f} s", CALM)
        sign = pill(words, round(0.85 * unit), colour)
        room = wide - sign.shape[1] - round(2.2 * unit)
        draw.text((1.2 * unit, 0.3 * unit), fitted(self._name, room, round(1.15 * unit), True),
                  font=font(round(1.15 * unit), True), fill=INK)  # fmt: skip
        small = round(0.8 * unit)
        told = [f"plan {self._length:.2f} m", f"nearest {self.shot.replay.least_clearance(at):.3f} m"]
        told = [*told, f"took {at:.1f} s"] if over else told
        while len(told) > 1 and text_width("  ·  ".join(told), small) > wide - 2 * unit:
            told.pop(0)
        draw.text((1.2 * unit, 1.9 * unit), "  ·  ".join(told), font=font(small), fill=MUTED)
        head = np.array(image)
        kernels.put_sprite(head, sign, wide - sign.shape[1] - round(0.5 * unit), round(0.25 * unit), 1.0)
        return np.vstack([head, view])


def _arrangement(count: int, size: tuple[int, int]) -> tuple[int, int]:
    """Columns and rows for pictures that are as near to 4:3 as can be."""

    def off(cols: int) -> float:
        rows = -(-count // cols)
        return abs(float(np.log(size[0] / cols / (size[1] / rows) / 1.2))) + 0.4 * (cols * rows - count)

    cols = min(range(1, count + 1), key=off)
    return cols, -(-count // cols)
