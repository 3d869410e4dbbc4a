"""Films of several runs side by side, each in its own tile, all at the same moment."""

from __future__ import annotations

import itertools
import time
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from PIL import Image, ImageDraw

from antdrive.sim.log.rollout import Rollout
from antdrive.sim.view.film import _kernels_paint as kernels
from antdrive.sim.view.film.encoder import encoding, known_suffix
from antdrive.sim.view.film.shot import Shot
from antdrive.sim.view.film.text import fitted, font, pill, text_width
from antdrive.sim.view.film.video import HOLD, FilmInfo, check_options, frame_times
from antdrive.sim.view.style import BAND, CALM, INK, MUTED, VERDICTS, planner_style
from antdrive.worlds.errors import InputError
from antdrive.worlds.files.atomic import written_whole

Picture = npt.NDArray[np.uint8]  # (H, W, 3)

MAX_RUNS = 6


def compare_film(
    rollouts: Sequence[Rollout],
    path: str | Path,
    *,
    camera: str = "oblique",
    size: tuple[int, int] = (1280, 720),
    fps: float = 30.0,
    speed: float = 1.0,
    titles: Sequence[str] | None = None,
    mark: Mark | None = None,
    progress: Callable[[float], None] | None = None,
) -> FilmInfo:
    """Film two to six runs side by side. A run that ends before the others keeps its last picture.

    Args:
        rollouts: the logs of the runs
        path: the file to write; its suffix chooses the format: .mp4 (H.264), .gif or .webp
        camera: `oblique`, `top` or `follow`
        size: width and height, even numbers from 160 to 4096 [px]
        fps: frames per second, at most 240
        speed: how many times as fast as the runs the film is
        titles: the name of each run's tile; None: its planner's name
        mark: a place and a moment that are marked in every tile from then on
        progress: called after each frame with the fraction that is done

    Raises:
        InputError: fewer than two runs or more than six, or an option that `film` refuses.
        OSError: the encoder could not write the film.
    """
    target = Path(path)
    known_suffix(target)
    check_options(camera, size, fps, speed)
    if not 2 <= len(rollouts) <= MAX_RUNS:
        raise InputError(f"compare: needs 2 to {MAX_RUNS} runs, got {len(rollouts)}")
    started = time.perf_counter()
    times = frame_times(max(float(log.t[-1] - log.t[0]) for log in rollouts), fps, speed)
    total = len(times) + round(2 * HOLD * fps)
    with (
        written_whole(target) as temporary,
        encoding(temporary, size, fps) as send,
        SplitScreen(rollouts, camera, size, titles, mark) as screen,
    ):
        for k, at in enumerate(itertools.chain(times, itertools.repeat(np.inf, total - len(times)))):
            send(screen.frame(float(at)))
            if progress is not None:
                progress((k + 1) / total)
    return FilmInfo(target, total, size, float(fps), camera, time.perf_counter() - started)


class Mark(NamedTuple):
    """A place that is marked in a film.

    Attributes:
        t: from when on [s]
        x: where [m]
        y: where [m]
        text: what is written there
    """

    t: float
    x: float
    y: float
    text: str


class SplitScreen:
    """The frames of several runs, each in a tile. Use it in a `with` block."""

    def __init__(
        self,
        rollouts: Sequence[Rollout],
        camera: str,
        size: tuple[int, int],
        titles: Sequence[str] | None = None,
        mark: Mark | None = None,
    ) -> None:
        cols, rows = _arrangement(len(rollouts), size, _proportion(rollouts) if camera == "oblique" else 1.0)
        wide, high = (size[0] // cols) // 2 * 2, (size[1] // rows) // 2 * 2
        self._size = size
        self._corners = [((k % cols) * wide, (k // cols) * high) for k in range(len(rollouts))]
        one_world = len({log.record.task.world.name for log in rollouts}) == 1
        names = titles or [_title(log, one_world) for log in rollouts]
        room = (wide - 2, high - 2)
        self._tiles = [Tile(log, camera, room, name, mark) for log, name in zip(rollouts, names, strict=True)]
        self._open = ExitStack()

    def __enter__(self) -> SplitScreen:
        for tile in self._tiles:
            self._open.enter_context(tile.shot)
        return self

    def __exit__(self, *problem: object) -> None:
        self._open.close()

    def frame(self, at: float) -> Picture:
        """The frame (H, W, 3) at a moment of all runs [s]."""
        frame = np.full((*self._size[::-1], 3), (210, 216, 225), dtype=np.uint8)
        for (x, y), tile in zip(self._corners, self._tiles, strict=True):
            part = tile.frame(at)
            frame[y : y + part.shape[0], x : x + part.shape[1]] = part
        return frame


class Tile:
    """One run among several: a head with its name and the run's numbers, and the picture below."""

    def __init__(
        self, rollout: Rollout, camera: str, size: tuple[int, int], name: str, mark: Mark | None = None
    ) -> None:
        self._unit = max(11, round(min(size[0] / 30, size[1] / 22)))
        self._head = 2 * round(1.55 * self._unit)
        self.shot = Shot(rollout, camera=camera, size=(size[0], size[1] - self._head), bare=True)
        self._name, self._mark = name, mark
        self._colour = planner_style(rollout.record.planner.name)[0]
        self._outcome = rollout.outcome
        self._length = rollout.record.plan.length_m
        self._last: Picture | None = None  # the tile once the run is over

    def frame(self, at: float) -> Picture:
        """The tile (h, w, 3) at a moment [s]; after the run's end, the last one."""
        end = self.shot.replay.duration
        if at < end:
            return self._with_head(self._marked(self.shot.view(at), at), at, False)
        if self._last is None:
            self._last = self._with_head(self._marked(self.shot.view(end, last=True), end), end, True)
        return self._last

    def _marked(self, view: Picture, at: float) -> Picture:
        """The picture with the mark, from its moment on."""
        if self._mark is not None and at >= self._mark.t:
            self.shot.put_label(view, self._mark.text, self._mark.x, self._mark.y)
        return view

    def _with_head(self, view: Picture, at: float, over: bool) -> Picture:
        unit, wide = self._unit, view.shape[1]
        image = Image.new("RGB", (wide, self._head), BAND)
        draw = ImageDraw.Draw(image)
        draw.rectangle((0, 0, round(0.5 * unit), self._head), fill=self._colour)
        words, colour = VERDICTS[self._outcome] if over else (f"{at:.1f} s", CALM)
        verdict = pill(words, round(0.85 * unit), colour)
        room = wide - verdict.shape[1] - round(2.2 * unit)
        large, small = round(1.15 * unit), round(0.8 * unit)
        name = fitted(self._name, room, large, True)
        draw.text((1.2 * unit, 0.3 * unit), name, font=font(large, True), fill=INK)
        facts = [f"path {self._length:.2f} m", f"min clearance {self.shot.replay.min_clearance(at):.3f} m"]
        facts = [*facts, f"took {at:.1f} s"] if over else facts
        while len(facts) > 1 and text_width("  ·  ".join(facts), small) > wide - 2 * unit:
            facts.pop(0)
        draw.text((1.2 * unit, 1.9 * unit), "  ·  ".join(facts), font=font(small), fill=MUTED)
        head = np.array(image)
        kernels.put_sprite(head, verdict, wide - verdict.shape[1] - round(0.5 * unit), round(0.25 * unit), 1.0)
        return np.vstack([head, view])


def _title(log: Rollout, one_world: bool) -> str:
    planner = log.record.planner.name
    return planner if one_world else f"{planner} · {log.record.task.world.name}"


def _proportion(rollouts: Sequence[Rollout]) -> float:
    """Width over height of the widest world, at least 1."""
    bounds = [log.record.task.world.bounds for log in rollouts]
    return max(1.0, *((xmax - xmin) / (ymax - ymin) for xmin, ymin, xmax, ymax in bounds))


def _arrangement(count: int, size: tuple[int, int], proportion: float) -> tuple[int, int]:
    """Columns and rows of tiles, with few empty ones, whose pictures suit a world of this width over height."""

    def cost(cols: int) -> float:
        rows = -(-count // cols)
        return abs(float(np.log(size[0] / cols / (size[1] / rows) / (1.2 * proportion)))) + 0.4 * (cols * rows - count)

    cols = min(range(1, count + 1), key=cost)
    return cols, -(-count // cols)
