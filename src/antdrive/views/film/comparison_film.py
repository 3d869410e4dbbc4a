"""Side-by-side films of several runs, each in its own tile, at the same time."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np
from PIL import Image, ImageDraw

from antdrive.base.errors import InputError
from antdrive.base.files import known_suffix
from antdrive.base.types import Floats
from antdrive.runs.comparing import SameDrive, distinct, path_text
from antdrive.sim.log.rollout import Rollout
from antdrive.views.colours import BAND, CALM, INK, MUTED, OUTCOME_LABELS, Colour, label_styles
from antdrive.views.film import overlay
from antdrive.views.film.camera import Picture, camera_for
from antdrive.views.film.compositor import drawn_height
from antdrive.views.film.film_options import ENCODERS, FilmInfo, FilmOptions
from antdrive.views.film.prelude import has_field, planning_stages, still_camera
from antdrive.views.film.shot import Shot
from antdrive.views.film.text import fitted, font, pill, put, text_width
from antdrive.views.film.video import HOLD, encoded, frame_times
from antdrive.views.scene import Scene

MAX_RUNS = 6
FULL = (1280, 720)  # default size [px]
LEAST_TILE = 360  # minimum width of a tile, so that its header's text fits [px]
FILLED = 0.92  # fraction of a picture's height that the world fills, in oblique view


def compare_film(
    rollouts: Sequence[Rollout],
    path: str | Path,
    *,
    camera: str = "oblique",
    size: tuple[int, int] | None = None,
    fps: float = 30.0,
    speed: float = 1.0,
    titles: Sequence[str] | None = None,
    mark: Mark | None = None,
    prelude: float = 0.0,
    progress: Callable[[float], None] | None = None,
) -> FilmInfo:
    """Film two to six runs side by side. A run that ends before the others keeps its last picture.

    Bitwise identical drives share a tile. The arguments are those of `film`, plus a title per run and a mark at a place. The
    prelude shows iterative planners at work beside the plans of the others.

    Raises:
        InputError: as `film`; or there are fewer than two or more than six runs.
    """
    target = Path(path)
    known_suffix(target, ENCODERS)
    options = FilmOptions(camera=camera, size=size or FULL, fps=fps, speed=speed).checked()
    if not 2 <= len(rollouts) <= MAX_RUNS:
        raise InputError(f"compare: needs 2 to {MAX_RUNS} runs, got {len(rollouts)}")
    one_world = len({log.record.task.world.name for log in rollouts}) == 1
    names = titles or [_title(log, one_world) for log in rollouts]
    drives = distinct(zip(names, rollouts, strict=True))
    logs = [same[0][1] for same in drives]
    before = round(prelude * fps)
    if before and not any(map(has_field, logs)):
        raise InputError("prelude: no planner of the comparison has a field")
    options = replace(options, size=size or fitting_size(logs, camera))
    times = frame_times(max(float(log.t[-1] - log.t[0]) for log in logs), fps, speed)
    screen = SplitScreen(drives, camera, options.size, mark)
    moments = [*times.tolist(), *itertools.repeat(math.inf, round(2 * HOLD * fps))]
    frames = itertools.chain(screen.planning(before) if before else (), map(screen.frame, moments))
    return encoded(target, options, before + len(moments), frames, progress)


class Mark(NamedTuple):
    """Labelled place in a film."""

    t: float  # time at which it appears [s]
    x: float  # place [m]
    y: float  # place [m]
    text: str  # label


class SplitScreen:
    """Frames of several runs, each in a tile; planners of the same drive share one."""

    def __init__(
        self,
        drives: Sequence[SameDrive],
        camera: str,
        size: tuple[int, int],
        mark: Mark | None = None,
    ) -> None:
        rollouts = [same[0][1] for same in drives]
        cols, rows = _tiling(rollouts, camera, size)
        wide, high = (size[0] // cols) // 2 * 2, (size[1] // rows) // 2 * 2
        self._size = size
        self._corners = [((k % cols) * wide, (k // cols) * high) for k in range(len(rollouts))]
        room = (wide - 2, high - 2)
        names = [log.record.planner.name for log in rollouts]
        one_world = len({log.record.task.world.name for log in rollouts}) == 1
        styles = label_styles([same[0][0] for same in drives] if one_world else names, names)
        self._tiles = [Tile(same, style.colour, camera, room, mark) for same, style in zip(drives, styles, strict=True)]

    def frame(self, at: float) -> Picture:
        """Return the frame (H, W, 3) at a time of all runs [s]."""
        return self._joined(tile.frame(at) for tile in self._tiles)

    def planning(self, count: int) -> Iterator[Picture]:
        """Yield `count` frames (H, W, 3) of planning."""
        return map(self._joined, zip(*(tile.planning(count) for tile in self._tiles), strict=True))

    def _joined(self, parts: Iterable[Picture]) -> Picture:
        """Return the tiles' pictures in one frame."""
        frame = np.full((*self._size[::-1], 3), (210, 216, 225), dtype=np.uint8)
        for (x, y), part in zip(self._corners, parts, strict=True):
            frame[y : y + part.shape[0], x : x + part.shape[1]] = part
        return frame


class Tile:
    """Tile of one run: a header with its name and numbers, and the picture below."""

    def __init__(
        self, same: SameDrive, colour: Colour, camera: str, size: tuple[int, int], mark: Mark | None = None
    ) -> None:
        rollout = same[0][1]
        self._unit, self._head = _head_of(size)
        self._rollout, self._size = rollout, (size[0], size[1] - self._head)
        self.shot = Shot(rollout, camera=camera, size=self._size, bare=True)
        self._names, self._mark = [name for name, _ in same], mark
        self._colour = colour
        self._outcome = rollout.outcome
        self._planned = [log.record.plan.length_m for _, log in same]  # [m]
        self._last: Picture | None = None  # the tile once the run is over

    def frame(self, at: float) -> Picture:
        """Return the tile (h, w, 3) at a time [s]; after the run's end, the last one."""
        end = self.shot.playback.duration
        if at < end:
            return self._driving(self.shot.view(at), at, (f"{at:.1f} s", CALM))
        if self._last is None:
            self._last = self._driving(self.shot.view(end, last=True), end, OUTCOME_LABELS[self._outcome])
        return self._last

    def planning(self, count: int) -> Iterator[Picture]:
        """Yield `count` tiles (h, w, 3) of planning: the iterations, or the plan of a planner without a field."""
        if not has_field(self._rollout):
            planned = self._with_head(self.shot.view(0.0), [f"planned {self._planned[0]:.2f} m"], ("planned", CALM))
            yield from itertools.repeat(planned, count)
            return
        camera = still_camera(self.shot.options.camera)
        shot = Shot(self._rollout, camera=camera, size=self._size, bare=True, planning=True)
        for stage in planning_stages(self._rollout, count):
            best = f"best {stage.state.best:.2f} m" if math.isfinite(stage.state.best) else "no path yet"
            facts = [f"iteration {stage.number} / {stage.total}", best]
            yield self._with_head(shot.planning_view(stage.grid, stage.levels, stage.path), facts, overlay.PLANNING)

    def _driving(self, view: Picture, at: float, status: tuple[str, Colour]) -> Picture:
        """Return the tile at a time with the mark from its time on."""
        if self._mark is not None and at >= self._mark.t:
            self.shot.put_label(view, self._mark.text, self._mark.x, self._mark.y)
        playback = self.shot.playback
        facts = [
            *(["drive the same line"] if len(self._names) > 1 else []),
            f"path {path_text(self._planned, playback.driven(at))} m",
            f"min clearance {playback.min_clearance(at):.3f} m",
            *([f"time {at:.1f} s"] if at >= playback.duration else []),
        ]
        return self._with_head(view, facts, status)

    def _with_head(self, view: Picture, facts: Sequence[str], status: tuple[str, Colour]) -> Picture:
        """Put the header over a view; facts that do not fit are left out from the end."""
        unit, wide = self._unit, view.shape[1]
        image = Image.new("RGB", (wide, self._head), BAND)
        draw = ImageDraw.Draw(image)
        draw.rectangle((0, 0, round(0.5 * unit), self._head), fill=self._colour)
        badge = pill(status[0], round(0.85 * unit), status[1])
        room = wide - badge.shape[1] - round(2.2 * unit)
        large, small = round(1.15 * unit), round(0.8 * unit)
        name = fitted(", ".join(self._names), room, large, True)
        draw.text((1.2 * unit, 0.3 * unit), name, font=font(large, True), fill=INK)
        facts = list(facts)
        while len(facts) > 1 and text_width("  ·  ".join(facts), small) > wide - 2 * unit:
            facts.pop()
        draw.text((1.2 * unit, 1.9 * unit), "  ·  ".join(facts), font=font(small), fill=MUTED)
        head = np.array(image)
        put(head, badge, wide - badge.shape[1] - round(0.5 * unit), 0.25 * unit)
        return np.vstack([head, view])


def _title(log: Rollout, one_world: bool) -> str:
    planner = log.record.planner.name
    return planner if one_world else f"{planner} · {log.record.task.world.name}"


def fitting_size(rollouts: Sequence[Rollout], camera: str) -> tuple[int, int]:
    """Return the film size that shows the worlds at the scale of `FULL`, without empty ground above, below or beside them."""
    if camera == "follow":
        return FULL
    cols, rows = _tiling(rollouts, camera, FULL)
    full = (FULL[0] // cols - 2, FULL[1] // rows - 2)
    head = _head_of(full)[1]
    view = (full[0], full[1] - head)
    extent = np.max([_extent(log, camera, view) for log in rollouts], axis=0)
    wide, high = extent / (FILLED if camera == "oblique" else np.max(extent / view))
    width = FULL[0] if camera == "oblique" else _even(cols * max(wide + 2, LEAST_TILE), FULL[0])
    return width, _even(rows * (high + head + 2), FULL[1])


def _extent(log: Rollout, camera: str, view: tuple[int, int]) -> Floats:
    """Return width and height (2,) of the ground of a run in a view of this size [px]."""
    scene = Scene.of(log)
    low, high = scene.region(np.vstack([log.pose[:, :2], log.route]))
    corners = np.array([(x, y, 0.0) for x in (low[0], high[0]) for y in (low[1], high[1])])
    return np.asarray(np.ptp(camera_for(camera, low, high, drawn_height(scene), view).pixels(corners), axis=0))


def _even(length: float, most: int) -> int:
    """Return the next even number, from 160 to `most`."""
    return min(max(2 * math.ceil(length / 2), 160), most)


def _head_of(tile: tuple[int, int]) -> tuple[int, int]:
    """Return the height of small text in a tile of this size, and of its header [px]."""
    unit = max(11, round(min(tile[0] / 30, tile[1] / 22)))
    return unit, 2 * round(1.55 * unit)


def _tiling(rollouts: Sequence[Rollout], camera: str, size: tuple[int, int]) -> tuple[int, int]:
    """Return the columns and rows of tiles."""
    count = len(rollouts)
    if camera != "top":
        bounds = [log.record.task.world.bounds for log in rollouts] if camera == "oblique" else []
        widest = max([1.0, *((xmax - xmin) / (ymax - ymin) for xmin, ymin, xmax, ymax in bounds)])
        return _arrangement(count, size, widest)

    def scale(cols: int) -> float:
        tile = size[0] // cols - 2, size[1] // -(-count // cols) - 2
        return min(float(np.prod(_extent(log, camera, (tile[0], tile[1] - _head_of(tile)[1])))) for log in rollouts)

    cols = max(range(1, count + 1), key=scale)
    return cols, -(-count // cols)


def _arrangement(count: int, size: tuple[int, int], proportion: float) -> tuple[int, int]:
    """Return columns and rows of tiles that suit a world of this width over height, with few empty tiles."""

    def cost(cols: int) -> float:
        rows = -(-count // cols)
        return abs(float(np.log(size[0] / cols / (size[1] / rows) / (1.2 * proportion)))) + 0.4 * (cols * rows - count)

    cols = min(range(1, count + 1), key=cost)
    return cols, -(-count // cols)
