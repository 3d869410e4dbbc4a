"""Films of a run: a replay of its log, so that physics never waits for pixels and an old run can be filmed again.

Frames go straight to the encoder, one at a time; a film's length costs no memory. A file appears when it is complete.
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

from antdrive.sim.log.rollout import Rollout
from antdrive.sim.view.film import _kernels_paint as kernels
from antdrive.sim.view.film.camera import CAMERAS, Camera, camera_for
from antdrive.sim.view.film.caption import (
    DRIVEN,
    DRIVING,
    PLANNING,
    SEARCHED,
    SLOWED,
    VERDICTS,
    Band,
    Layout,
    Reading,
    Values,
    banner,
    entries_for,
    legend_card,
)
from antdrive.sim.view.film.encode import ENCODERS as ENCODERS
from antdrive.sim.view.film.encode import encoding, known_suffix
from antdrive.sim.view.film.lettering import Sprite, burst, label
from antdrive.sim.view.film.model import robot_height
from antdrive.sim.view.film.paint import grid_step
from antdrive.sim.view.film.parallel import WORTH, pictures, processes
from antdrive.sim.view.film.replay import SLOW as SLOW
from antdrive.sim.view.film.replay import Renewal, Replay
from antdrive.sim.view.film.stage import Stage, drawn_height
from antdrive.sim.view.scene import Scene
from antdrive.sim.view.style import CONTACT, GOAL, ROUTE, START, Colour
from antdrive.worlds.errors import InputError
from antdrive.worlds.files.atomic import written_whole

Floats = npt.NDArray[np.float64]
Picture = npt.NDArray[np.uint8]  # (H, W, 3)

HOLD = 1.0  # the last picture stays this long [s]
FLASH = 0.45  # a contact flashes this long [s]
NEWS = 1.5  # the cause of a new route is told this long [s]


@dataclass(frozen=True)
class FilmInfo:
    """What was filmed."""

    path: Path
    frames: int
    size: tuple[int, int]  # [px]
    fps: float
    camera: str
    wall_s: float  # how long rendering and encoding took [s]

    @property
    def renderer(self) -> str:
        """What drew the bodies."""
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
    """Film a run as MP4 (H.264), GIF or WebP by the file's suffix, `speed` times as fast as it happened.

    `note` is a line of the caption, for example what a certificate says. `progress` is told the fraction that is done.
    With `prelude` the film begins with that many seconds of planning: the field of an iterative planner on the ground and
    its best path so far, planned anew from the run's seed. Around a contact the film is `SLOW` times slower.
    A camera that moves renders in `jobs` processes, by default one for each core; the film is the same for any number.

    Raises:
        InputError: an unknown camera or suffix, an odd or tiny size, a rate or speed that is not positive.
        OSError: the encoder could not write the film.
    """
    target = Path(path)
    known_suffix(target)
    check_options(camera, size, fps, speed)
    started = time.perf_counter()
    setting = {"camera": camera, "size": size, "note": note, "speed": speed}
    replay = Replay(rollout)
    times = frame_times(replay.duration, fps, speed, replay.slow(speed))
    before, hold = round(prelude * fps), round(HOLD * fps)
    total = before + len(times) + hold
    if before:
        from antdrive.sim.view.film.prelude import check_field

        check_field(rollout)
    with written_whole(target) as temporary, encoding(temporary, size, fps) as send:
        for k, picture in enumerate(_pictures(rollout, setting, before, times, hold, jobs)):
            send(picture)
            if progress is not None:
                progress((k + 1) / total)
    return FilmInfo(target, total, size, float(fps), camera, time.perf_counter() - started)


def _pictures(
    rollout: Rollout, setting: dict[str, Any], before: int, times: Floats, hold: int, jobs: int | None
) -> Iterator[Picture]:
    """Every frame of a film in turn: how it was planned, the drive, how it ended."""
    if before:
        from antdrive.sim.view.film.prelude import planning_pictures

        yield from planning_pictures(rollout, setting, before)
    with Shot(rollout, **setting) as shot:
        jobs = processes() if jobs is None else jobs
        if setting["camera"] == "follow" and jobs > 1 and len(times) > WORTH:
            yield from pictures(rollout, setting, times, jobs)
            for at in times:
                shot.drive(at)
        else:
            for at in times:
                yield shot.picture(at)
        yield from itertools.repeat(shot.ending(), hold)


def still(
    rollout: Rollout,
    path: str | Path,
    t: float | None = None,
    *,
    camera: str = "oblique",
    size: tuple[int, int] = (1280, 720),
    note: str | None = None,
) -> Path:
    """One picture of a run at a time [s], as PNG; without a time, how it ended.

    Raises:
        InputError: an unknown camera, a suffix other than .png, an odd or tiny size.
    """
    target = Path(path)
    if target.suffix.lower() != ".png":
        raise InputError(f"{target}: unknown suffix {target.suffix!r}; choose .png")
    check_options(camera, size, 1.0, 1.0)
    with Shot(rollout, camera=camera, size=size, note=note) as shot:
        picture = shot.ending() if t is None else shot.picture(min(max(float(t), 0.0), shot.replay.duration))
    with written_whole(target) as temporary:
        Image.fromarray(picture).save(temporary, format="PNG")
    return target


def frame_times(duration: float, fps: float, speed: float, slow: tuple[float, float] | None = None) -> Floats:
    """The moments of a run [s] that a film's frames show: the first is 0, the last the end or less than a frame before.

    Between the moments `slow`, the film is `SLOW` times slower.
    """
    if slow is None:
        return np.arange(int(duration * fps / speed + 1e-9) + 1, dtype=np.float64) * (speed / fps)
    run = np.array([0.0, *slow, duration])
    shown = np.concatenate([[0.0], np.cumsum(np.diff(run) * [1, SLOW, 1])]) / speed
    return np.asarray(np.interp(np.arange(int(shown[-1] * fps + 1e-9) + 1) / fps, shown, run))


class Shot:
    """A run before a camera, shown at moments that never go back. Use it in a `with` block."""

    def __init__(
        self,
        rollout: Rollout,
        *,
        camera: str,
        size: tuple[int, int],
        note: str | None = None,
        speed: float = 1.0,
        planning: bool = False,
        bare: bool = False,
    ) -> None:
        self.replay = Replay(rollout)
        self.slow = self.replay.slow(speed)
        self._flash = FLASH * speed
        self.scene = scene = Scene.of(rollout)
        self.outcome = rollout.outcome
        self._follows = camera == "follow"
        replans = not planning and any(renewal.told for renewal in self.replay.renewals)
        for card in (True, False):
            self._layout = layout = Layout.of(size, card)
            band = 0 if bare else layout.height
            self._camera = self._aim(camera, rollout, (size[0], size[1] - band))
            entries = entries_for(
                scene, grid_step(self._camera), self._camera.pixel, planning=planning, replans=replans
            )
            self._legend = legend_card(entries, layout) if card and not bare else None
            if self._legend is not None and self._free(self._legend):
                break
        planner = rollout.record.planner.name
        subtitle = f"planner {planner}  ·  robot {scene.robot.name}"
        self._band = Band(
            layout, scene.name, subtitle, None if planning else note, entries, SEARCHED if planning else DRIVEN
        )
        fine = 3 if size[0] * size[1] <= 400_000 and not self._follows else 2
        stays = not (planning or self.replay.renewals)  # else the route is drawn in every frame
        self._stage = Stage(
            scene, self._camera, route=rollout.route[: None if stays else 0], fine=fine, moves=self._follows
        )
        self._news = NEWS * speed
        self._route, self._renewed = rollout.route, 0
        self._beside = 0 if self._legend is None else self._legend.shape[1] + 2 * layout.unit  # the legend's card [px]
        self._end = banner(self.outcome, layout, max(size[0] - self._beside, size[0] // 2))
        self.shown = 0.0  # the trail reaches this moment [s]

    def __enter__(self) -> Shot:
        self._stage.__enter__()
        self._lay_labels()
        if self.replay.renewals:
            self._reroute(0)
        return self

    def __exit__(self, *problem: object) -> None:
        self._stage.__exit__(*problem)

    def picture(self, at: float) -> Picture:
        """The frame (H, W, 3) at a moment of the run [s]."""
        slow = self.slow is not None and self.slow[0] <= at < self.slow[1]
        return self._framed(self.view(at), at, SLOWED if slow else DRIVING)

    def ending(self) -> Picture:
        """The frame that tells how it ended."""
        at = self.replay.duration
        view = self.view(at, last=True)
        unit = self._layout.unit
        high = self._stage.pixel(*self.replay.pose(at)[:2])[1] < 0.4 * view.shape[0]  # the robot is: say it below
        low = high or self._beside + self._end.shape[1] > view.shape[1]
        top = view.shape[0] - self._end.shape[0] - round(1.2 * unit) if low else round(1.2 * unit)
        left = max((view.shape[1] - self._end.shape[1]) // 2, 0 if low else self._beside)
        kernels.put_sprite(view, self._end, left, top, 1.0)
        return self._framed(view, at, VERDICTS[self.outcome])

    def planning(self, values: Values, paint: Callable[[Stage], Picture]) -> Picture:
        """A frame before the drive: what `paint` makes of the ground, with values of its own in the band."""
        view = paint(self._stage)
        self._lay_legend(view)
        return np.vstack([view, self._band.draw(values, PLANNING)])

    def drive(self, at: float) -> None:
        """Continue the trail to a moment [s]."""
        if at > self.shown:
            self._stage.drive(*self.replay.trail(self.shown, at))
            self.shown = at

    def view(self, at: float, *, last: bool = False) -> Picture:
        """What the camera sees at a moment, without the band below; contacts flash."""
        replay, stage = self.replay, self._stage
        if self._follows:
            stage.look(self._camera.moved(*replay.smooth(at)))
        self.drive(at)
        renewed = replay.renewed(at)
        if renewed != self._renewed:
            self._reroute(renewed)
        view = stage.frame(replay.pose(at), replay.wheels(at), replay.movers(at), replay.mover_velocities(at))
        if renewed:
            self._tell_replan(view, at, replay.renewals[renewed - 1])
        self._mark_contacts(view, at, self._flash, last)
        self._lay_legend(view)
        return view

    def _framed(self, view: Picture, at: float, verdict: tuple[str, Colour]) -> Picture:
        replay = self.replay
        reading = Reading(at, replay.speed(at), replay.clearance(at), replay.least_clearance(at))
        return np.vstack([view, self._band.draw(reading.told, verdict)])

    def _lay_legend(self, view: Picture) -> None:
        if self._legend is not None:
            kernels.put_sprite(view, self._legend, self._layout.unit, self._layout.unit, 1.0)

    def _aim(self, camera: str, rollout: Rollout, size: tuple[int, int]) -> Camera:
        """A camera that sees the whole task or, where it follows, the robot's surroundings."""
        scene = self.scene
        tall = drawn_height(scene)
        if camera == "follow":
            reach = max(1.2, 7 * scene.robot.footprint.radius)
            return camera_for(camera, (-reach, -0.6 * reach), (reach, 0.6 * reach), tall, size)
        low, high = scene.region(np.vstack([rollout.pose[:, :2], rollout.route]))
        return camera_for(camera, low, high, tall, size)

    def _free(self, card: Sprite) -> bool:
        """Whether a card in the upper left corner leaves the world uncovered."""
        if self._follows:
            return True
        x0, y0, x1, y1 = self.scene.bounds
        along = np.linspace(0, 1, 33)
        edge = np.concatenate(
            [np.column_stack([x0 + (x1 - x0) * along, np.full(33, y)]) for y in (y0, y1)]
            + [np.column_stack([np.full(33, x), y0 + (y1 - y0) * along]) for x in (x0, x1)]
        )
        at = self._camera.pixels(np.column_stack([edge, np.zeros(len(edge))]))
        reach = np.array([card.shape[1], card.shape[0]]) + 1.3 * self._layout.unit
        return not bool((at < reach).all(axis=1).any())

    def _lay_labels(self) -> None:
        size = self._layout.unit
        scene = self.scene
        radius = scene.robot.footprint.radius
        start = (*scene.start[:2], 1.3 * radius)
        for (x, y, reach), text, colour in (
            (start, "START", START), ((*scene.goal, scene.goal_tolerance), "GOAL", GOAL)
        ):  # fmt: skip
            self._stage.write(label(text, round(0.95 * size), colour), x, y, reach)

    def _reroute(self, count: int) -> None:
        """Show the route after so many replans, and where they were."""
        replay = self.replay
        route = replay.renewals[count - 1].route if count else self._route
        told = [replay.pose(renewal.t)[:2] for renewal in replay.renewals[:count] if renewal.told]
        self._stage.reroute(route, np.array(told).reshape(-1, 2))
        self._renewed = count

    def _tell_replan(self, view: Picture, at: float, renewal: Renewal) -> None:
        """What the last replan was for, above the robot, for a while."""
        if not renewal.told or at - renewal.t > self._news:
            return
        sprite = label(renewal.told, self._layout.unit, ROUTE)
        x, y, _ = self.replay.pose(at)
        px, py = self._stage.pixel(x, y, robot_height(self.scene.robot))
        left = min(max(px - sprite.shape[1] / 2, 0), view.shape[1] - sprite.shape[1])
        top = py - 2.2 * self._layout.unit - sprite.shape[0]
        kernels.put_sprite(view, sprite, round(left), round(max(top, 0)), 1.0)

    def _mark_contacts(self, view: Picture, at: float, flash: float, last: bool) -> None:
        touched = self.replay.touched(at)
        if touched is None:
            return
        x, y, age = touched
        size = 2 * round(2.2 * self._layout.unit)
        px, py = self._stage.pixel(x, y, robot_height(self.scene.robot) / 2)
        kernels.put_sprite(view, burst(size, CONTACT), round(px - size / 2), round(py - size / 2), 1.0)
        fresh = max(0.0, 1.0 - age / flash)
        edge, tint = (0.75, 0.0) if last else (fresh, 0.25 * fresh)
        if edge > 0:
            kernels.flash(view, np.array(CONTACT, dtype=np.float64), 0.9 * self._layout.unit, edge, tint)


def check_options(camera: str, size: tuple[int, int], fps: float, speed: float) -> None:
    """Refuse what no film can be.

    Raises:
        InputError: an unknown camera, an odd or tiny size, a rate or speed that is not positive.
    """
    if camera not in CAMERAS:
        raise InputError(f"camera: unknown camera {camera!r}; choose one of {', '.join(CAMERAS)}")
    if len(size) != 2 or any(side % 2 or not 160 <= side <= 4096 for side in size):
        raise InputError(f"size: width and height must be even numbers from 160 to 4096, got {size}")
    for key, value in (("fps", fps), ("speed", speed)):
        if not 0 < value <= 240:
            raise InputError(f"{key}: must be greater than 0 and at most 240, got {value:g}")
