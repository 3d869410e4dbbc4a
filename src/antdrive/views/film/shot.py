"""Frames of one run by one camera, with trail, route, labels, legend and status bar."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from antdrive.base.types import Floats
from antdrive.sim.log.certificate import certify
from antdrive.sim.log.rollout import Rollout
from antdrive.views.colours import CONTACT, GOAL, ROUTE, START, Colour, label_of
from antdrive.views.film import overlay
from antdrive.views.film.camera import Camera, Picture, camera_for
from antdrive.views.film.compositor import Compositor, drawn_height, has_glow
from antdrive.views.film.film_options import FilmOptions
from antdrive.views.film.ground import grid_step
from antdrive.views.film.lidar_view import BeamPainter, OwnMapPainter
from antdrive.views.film.meshes import robot_height
from antdrive.views.film.playback import Playback, ReplanEvent
from antdrive.views.film.text import Sprite, burst, label, put
from antdrive.views.scene import Scene
from antdrive.worlds import Grid

FLASH = 0.45  # duration of the border's flash after a contact [s]
MOST_LEGEND_ROWS = 4
REPLAN_CAPTION = 1.5  # duration of the caption of a replan [s]


class Shot:
    """Frames of a run by one camera. Times must be requested in increasing order."""

    def __init__(self, rollout: Rollout, *, planning: bool = False, bare: bool = False, **options: Any) -> None:
        self.options = FilmOptions(**options)
        size, note, speed = self.options.size, self.options.note, self.options.speed
        self._rollout, self.playback = rollout, Playback(rollout)
        self.slow_motion = self.playback.slow_motion(speed)
        self._flash = FLASH * speed
        self.scene = scene = Scene.of(rollout)
        self.outcome, self.label = rollout.outcome, label_of(rollout)
        self._follows = self.options.camera == "follow"
        self._tracks_movers = not planning and len(rollout.tracks) > 0
        scans = not planning and len(rollout.scans) > 0
        self._own_map = OwnMapPainter(rollout, scene) if scans and not scene.mapped else None
        self._fan = self._own_map or (BeamPainter(rollout) if scans else None)
        replans = not planning and any(event.caption for event in self.playback.replans)
        legend = self._lay_out(rollout, planning=planning, replans=replans, bare=bare)
        planner = rollout.record.planner.name
        subtitle = f"{'planner ' if rollout.measured is None else ''}{planner}  ·  robot {scene.robot.name}"
        fields = overlay.PLAN_FIELDS if planning else overlay.DRIVE_FIELDS
        self._band = overlay.Band(self._layout, scene.name, subtitle, None if planning else note, legend, fields)
        fine = 3 if size[0] * size[1] <= 400_000 and not self._follows else 2
        fixed = not (planning or self.playback.replans or self._fan)  # a changing route is drawn in every frame
        route = rollout.route[: None if fixed else 0]
        self._compositor = Compositor(scene, self._camera, route=route, fine=fine, lidar_view=self._fan)
        self._replan_caption = REPLAN_CAPTION * speed
        self._route, self._replans_shown = rollout.route, 0
        self._legend_width = 0 if self._legend is None else self._legend.shape[1] + 2 * self._layout.unit  # [px]
        self.shown = 0.0  # end of the trail [s]
        self._add_labels()
        if self.playback.replans or self._fan:
            self._show_route(0)

    def _lay_out(self, rollout: Rollout, *, planning: bool, replans: bool, bare: bool) -> overlay.LegendRows:
        """Choose layout, camera and legend: a card in a corner, or rows of the band if the card would cover the world."""
        shows = {"beams": self._fan is not None, "own_map": self._own_map is not None, "tracked": self._tracks_movers}
        shows["routed"] = len(rollout.route) > 0
        size = self.options.size
        for rows in range(1 + MOST_LEGEND_ROWS):
            layout = overlay.Layout.of(size, rows, self.options.note or "")
            if rows > 1 and layout.height > overlay.MOST_BAND * size[1]:
                break
            self._layout = layout
            self._camera = self._aim(rollout, (size[0], size[1] - (0 if bare else layout.height)))
            step, pixel = grid_step(self._camera), self._camera.pixel
            shows["glow"] = not planning and has_glow(self.scene, self._camera)
            entries = overlay.legend_entries(self.scene, step, pixel, planning=planning, replans=replans, **shows)
            legend = overlay.legend_rows(entries, layout)
            self._legend = None if rows or bare else overlay.legend_card(entries, layout)
            if bare or (legend.whole if self._legend is None else self._fits_beside_world(self._legend)):
                break
        return legend

    def frame(self, at: float) -> Picture:
        """Return the frame (H, W, 3) at a time of the run [s]."""
        slow = self.slow_motion is not None and self.slow_motion[0] <= at < self.slow_motion[1]
        return self._with_band(self.view(at), self._values(at), overlay.SLOWED if slow else overlay.DRIVING)

    def last_frame(self) -> Picture:
        """Return the frame (H, W, 3) at the run's end, with the outcome as a sentence and the certificate."""
        at = self.playback.duration
        view = self.view(at, last=True)
        unit, room = self._layout.unit, max(view.shape[1] - self._legend_width, view.shape[1] // 2)
        said, label = self._rollout.record.reason, self.label if self._rollout.measured else None
        verdict = overlay.banner(self.outcome, self._layout, room, said, caption(self._rollout), label)
        robot_high = self._compositor.pixel(*self.playback.pose(at)[:2])[1] < 0.4 * view.shape[0]
        low = robot_high or self._legend_width + verdict.shape[1] > view.shape[1]
        top = view.shape[0] - verdict.shape[0] - round(1.2 * unit) if low else round(1.2 * unit)
        left = max((view.shape[1] - verdict.shape[1]) // 2, 0 if low else self._legend_width)
        put(view, verdict, left, top)
        return self._with_band(view, self._values(at), self.label)

    def planning_frame(self, values: overlay.Values, grid: Grid, levels: Floats, path: Floats) -> Picture:
        """Return a frame (H, W, 3) of planning: the planner's field and its best path (N, 2) [m] so far."""
        return self._with_band(self.planning_view(grid, levels, path), values, overlay.PLANNING)

    def planning_view(self, grid: Grid, levels: Floats, path: Floats) -> Picture:
        """Return the picture of `planning_frame` without the band."""
        view = self._compositor.field_frame(grid, levels, path)
        self._put_legend(view)
        return view

    def extend_trail(self, at: float) -> None:
        """Extend the driven path to a time [s]."""
        if at > self.shown:
            self._compositor.extend_trail(*self.playback.trail(self.shown, at))
            self.shown = at

    def view(self, at: float, *, last: bool = False) -> Picture:
        """Return the frame at a time [s] without the band; `last` keeps the flash of a contact."""
        playback, compositor = self.playback, self._compositor
        if self._follows:
            compositor.set_camera(self._camera.moved(*playback.camera_target(at)))
        self.extend_trail(at)
        count = playback.replan_count(at)
        if self._fan is not None:
            self._fan.advance(at)
        if count != self._replans_shown or self._own_map is not None:
            self._show_route(count)
        tracked = self._tracked_movers(at) if self._tracks_movers else None
        velocities = None if self._tracks_movers else playback.mover_velocities(at)
        view = compositor.frame(playback.pose(at), playback.wheels(at), playback.movers(at), velocities, tracked)
        if count:
            self._put_replan_caption(view, at, playback.replans[count - 1])
        self._mark_contact(view, at, self._flash, last)
        self._put_legend(view)
        return view

    def _tracked_movers(self, at: float) -> Floats:
        """Return the tracked movers (N, 5) in the world's frame; a mapless robot's own frame drifts."""
        tracked = self.playback.tracked(at)
        if self._own_map is not None:
            tracked[:, :2] = self._own_map.to_world(tracked[:, :2])
            tracked[:, 2:4] = self._own_map.to_world(tracked[:, 2:4]) - self._own_map.to_world(np.zeros((1, 2)))
        return tracked

    def put_label(self, view: Picture, text: str, x: float, y: float) -> None:
        """Mark a point x, y [m] on the ground, with a text above it."""
        size = 2 * round(1.1 * self._layout.unit)
        px, py = self._compositor.pixel(x, y)
        put(view, burst(size, CONTACT), px - size / 2, py - size / 2)
        _put_above(view, label(text, round(0.95 * self._layout.unit), CONTACT), px, py - size)

    def _values(self, at: float) -> overlay.Values:
        playback = self.playback
        return overlay.drive_values(at, playback.speed(at), playback.clearance(at), playback.min_clearance(at))

    def _with_band(self, view: Picture, values: overlay.Values, status: tuple[str, Colour]) -> Picture:
        height = len(view)
        picture = np.empty((height + self._layout.height, *view.shape[1:]), dtype=np.uint8)
        picture[:height] = view
        self._band.draw(values, status, picture[height:])
        return picture

    def _put_legend(self, view: Picture) -> None:
        if self._legend is not None:
            put(view, self._legend, self._layout.unit, self._layout.unit)

    def _aim(self, rollout: Rollout, size: tuple[int, int]) -> Camera:
        """Return a camera that shows the whole run or, when following, the robot's surroundings."""
        low, high = self.scene.region(np.vstack([rollout.pose[:, :2], rollout.route]))
        if self._follows:
            reach = max(1.2, 7 * self.scene.robot.footprint.radius)
            low, high = np.array([-reach, -0.6 * reach]), np.array([reach, 0.6 * reach])
        return camera_for(self.options.camera, low, high, drawn_height(self.scene), size)

    def _fits_beside_world(self, card: Sprite) -> bool:
        """Return whether a card in the upper left corner leaves the world uncovered."""
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

    def _add_labels(self) -> None:
        scene, text = self.scene, round(0.95 * self._layout.unit)
        self._compositor.add_label(label("START", text, START), *scene.start[:2], 1.3 * scene.robot.footprint.radius)
        self._compositor.add_label(label("GOAL", text, GOAL), *scene.goal, scene.goal_tolerance)

    def _show_route(self, count: int) -> None:
        """Show the route after `count` replans and the places of these replans."""
        playback = self.playback
        route = playback.replans[count - 1].route if count else self._route
        if self._own_map is not None:  # planned on the occupancy map
            route = self._own_map.to_world(route)
        places = [playback.pose(event.t)[:2] for event in playback.replans[:count] if event.caption]
        self._compositor.show_route(route, np.array(places).reshape(-1, 2))
        self._replans_shown = count

    def _put_replan_caption(self, view: Picture, at: float, event: ReplanEvent) -> None:
        """Draw the cause of a recent replan above the robot."""
        if not event.caption or at - event.t > self._replan_caption:
            return
        sprite = label(event.caption, self._layout.unit, ROUTE)
        x, y, _ = self.playback.pose(at)
        px, py = self._compositor.pixel(x, y, robot_height(self.scene.robot))
        _put_above(view, sprite, px, py - 2.2 * self._layout.unit)

    def _mark_contact(self, view: Picture, at: float, flash: float, last: bool) -> None:
        """Mark the point of the first contact and flash the picture's border after recent contacts."""
        contact = self.playback.contact(at)
        if contact is None:
            return
        x, y, age = contact
        size = 2 * round(2.2 * self._layout.unit)
        px, py = self._compositor.pixel(x, y, robot_height(self.scene.robot) / 2)
        put(view, burst(size, CONTACT), px - size / 2, py - size / 2)
        fresh = max(0.0, 1.0 - age / flash)
        edge, tint = (0.75, 0.0) if last else (fresh, 0.25 * fresh)
        if edge > 0:
            share, border = np.full((*view.shape[:2], 1), edge), math.ceil(0.9 * self._layout.unit)
            share[border:-border, border:-border] = tint
            view[:] = view + (CONTACT - view.astype(np.float64)) * share + 0.5


def caption(log: Rollout) -> str:
    """Return a film's line about the certificate; empty if the robot has not driven."""
    if not len(log.t):
        return ""
    return certify(log).caption


def _put_above(view: Picture, sprite: Sprite, x: float, bottom: float) -> None:
    """Draw a sprite above a point of a picture, within its borders."""
    left = min(max(x - sprite.shape[1] / 2, 0), view.shape[1] - sprite.shape[1])
    put(view, sprite, left, max(bottom - sprite.shape[0], 0))
