"""Frames of one run, or of several on one clock, by one camera, with trails, routes, labels, legend and status bar."""

from __future__ import annotations

import functools
import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from antdrive.base.plane import polyline_length
from antdrive.base.types import Floats, Point
from antdrive.runs.comparing import distinct
from antdrive.sim.log.certificate import certify
from antdrive.sim.log.rollout import Rollout
from antdrive.views.colours import CONTACT, GOAL, INK, PAPER, START, Colour, field_name, label_of, label_styles, mixed
from antdrive.views.film import overlay
from antdrive.views.film.camera import Camera, Picture, camera_for
from antdrive.views.film.compositor import Actor, Compositor, DrivenPath, drawn_height
from antdrive.views.film.film_options import FilmOptions
from antdrive.views.film.ground import grid_step
from antdrive.views.film.lidar_view import BeamPainter, OwnMapPainter
from antdrive.views.film.meshes import Part, robot_height, robot_parts
from antdrive.views.film.playback import Playback
from antdrive.views.film.text import Sprite, label, pill, put
from antdrive.worlds import Grid

REPLAN_CAPTION = 1.5  # duration of the status of a replan [s]
CENTRED = 0.45  # largest way of a followed robot from the middle, as a fraction of the way to the picture's edge
SHORT = 0.05  # paths no longer than this are not in the legend [m]
WIDTHS = (1.5, 1.0, 0.66, 0.5, 0.4, 0.3)  # of the paths of several drives, in multiples of one alone
FAR = 1.0  # largest distance to which a line is drawn [m]
GHOST = 0.66  # paleness of a robot whose drive has ended


class FilmedDrive:
    """Drive in a picture: its playback, names, colour and robot."""

    def __init__(self, same: Sequence[tuple[str, Rollout]], colour: Colour | None) -> None:
        self.names, self.logs = ", ".join(name for name, _ in same), [log for _, log in same]
        self.rollout = self.logs[0]
        self.playback, self.outcome = Playback(self.rollout), self.rollout.outcome
        self.robot, self.colour = self.rollout.record.robot, colour
        self.parts = robot_parts(self.robot) if colour is None else robot_parts(self.robot, colour)
        self._ghost = tuple(Part(p.mesh, mixed(p.colour, PAPER, GHOST)) for p in self.parts)
        self.planned = "/".join(dict.fromkeys(f"{log.record.plan.length_m:.1f}" for _, log in same))  # [m]
        self.route = f"{polyline_length(self.rollout.route):.1f}" if len(self.rollout.route) > 1 else self.planned

    @functools.cached_property
    def certificate(self) -> str:
        """Line about the certificate."""
        return caption(self.rollout)

    def actor(self, at: float, *, last: bool) -> Actor:
        """Return the robot at a time [s], pale after the drive's end unless the film ends."""
        parts = self._ghost if at > self.playback.duration and not last else self.parts
        return Actor(self.robot, parts, self.playback.pose(min(at, self.playback.duration)))

    def trail(self, at: float, number: int, tints: Sequence[Colour]) -> DrivenPath:
        """Return the path driven up to a time [s] of drive `number`, alone in the limiters' colours `tints`."""
        pieces = self.playback.trail(min(at, self.playback.duration))
        if self.colour is None:
            return DrivenPath([(line, tints[limiter]) for line, limiter in pieces])
        return DrivenPath([(line, self.colour) for line, _ in pieces], WIDTHS[number])

    def row(self, at: float) -> overlay.DriveRow:
        """Return the drive's row in the band at a time [s]."""
        playback, verdict = self.playback, None
        if at >= playback.duration:
            name, colour = label_of(self.rollout)
            proof = f"  ·  {self.certificate}" if self.certificate else ""
            verdict = f"{name} in {playback.duration:.1f} s{proof}", colour
        facts = driven_text(playback.driven(at), self.route), f"minimum {playback.min_clearance(at):.3f} m"
        return overlay.DriveRow(self.names, self.colour or INK, facts, verdict)


class Shot:
    """Frames of runs by one camera. Times must be requested in increasing order."""

    def __init__(
        self,
        rollouts: Rollout | Mapping[str, Rollout],
        *,
        planning: bool = False,
        bare: bool = False,
        **options: Any,
    ) -> None:
        several = not isinstance(rollouts, Rollout)
        self.options = FilmOptions(**options).checked(several=several)
        self._speed = self.options.speed
        self.drives = _drives(rollouts) if not isinstance(rollouts, Rollout) else [FilmedDrive([("", rollouts)], None)]
        lead = max(self.drives, key=lambda drive: drive.playback.duration)
        self._rollout = rollout = lead.rollout
        self.playback, self._several = lead.playback, several
        self.slow_motion = None if several else self.playback.slow_motion(self._speed)
        self.scene = scene = self.playback.scene
        self.outcome, self.label = rollout.outcome, label_of(rollout)
        self._camera_name = str(self.options.camera)
        self._follows = self._camera_name == "follow"
        alone = not (planning or several)
        self._tracks_movers = alone and len(rollout.tracks) > 0
        scans = alone and len(rollout.scans) > 0
        self._own_map = OwnMapPainter(rollout) if scans and not scene.mapped else None
        self._fan = self._own_map or (BeamPainter(rollout) if scans else None)
        self._replans = [event for event in self.playback.replans if event.caption] if alone else []
        self._tints = overlay.limiter_tints(rollout.record.limiters)
        shows = {"beams": self._fan is not None, "own_map": self._own_map is not None, "tracked": self._tracks_movers}
        shows |= {"route": not several and len(rollout.route) > 0, "replans": bool(self._replans)}
        names, way = rollout.record.limiters, self.playback.limited_lengths()
        limiters = [(self._tints[k], name) for k, name in enumerate(names) if way[k] > SHORT and not several]
        units = " ".join(drive.rollout.record.plan.work_unit for drive in self.drives)
        field = field_name(units) if planning else ""
        entries = overlay.legend_entries(scene, field=field, limiters=limiters, **shows)
        size, said = self.options.size, "" if planning else self.options.note or ""
        count = len(self.drives) if several else 0
        self._layout = layout = overlay.Layout.of(size, note=said, drives=count, entries=entries)
        self._view_size = (size[0], size[1] - (0 if bare else layout.height))
        self._camera = self._aim()
        robots = " and ".join(dict.fromkeys(drive.robot.name for drive in self.drives))
        by = "planner " if rollout.measured is None else ""
        subtitle = ("" if several else f"{by}{rollout.record.planner.name}  ·  ") + f"robot {robots}"
        fields = (overlay.PLAN_FIELDS if planning else overlay.DRIVE_FIELDS)[: (0 if planning else 1) if several else 4]
        self._band = overlay.Band(layout, scene.name, subtitle, f"grid {grid_step(self._camera):g} m", fields)
        self._shows_route = alone
        self._compositor = Compositor(scene, self._camera, lidar_view=self._fan)
        self._add_labels()

    @property
    def duration(self) -> float:
        """The length of the longest drive [s]."""
        return self.playback.duration

    def frame(self, at: float) -> Picture:
        """Return the frame (H, W, 3) at a time of the run [s]."""
        status = overlay.DRIVING
        recent = [event for event in self._replans if 0 <= at - event.t <= REPLAN_CAPTION * self._speed]
        if self.slow_motion is not None and self.slow_motion[0] <= at < self.slow_motion[1]:
            status = overlay.SLOWED
        elif recent:
            status = recent[-1].caption, overlay.DRIVING[1]
        return self._with_band(self.view(at), self._values(at), status, self._rows(at))

    def last_frame(self) -> Picture:
        """Return the frame (H, W, 3) at the end, with outcomes and certificates."""
        at = self.duration
        view = self.view(at, last=True)
        if self._several:
            return self._with_band(view, self._values(at), overlay.ENDED, self._rows(at))
        unit = self._layout.unit
        reason = self._rollout.record.reason
        label = self.label if self._rollout.measured else None
        verdict = overlay.banner(self.outcome, self._layout, view.shape[1], reason, caption(self._rollout), label)
        robot_low = self._compositor.pixel(*self.playback.pose(at)[:2])[1] > 0.5 * view.shape[0]
        above = robot_low and not self.playback.touched(at)
        top = round(1.2 * unit) if above else view.shape[0] - verdict.shape[0] - round(1.2 * unit)
        put(view, verdict, max((view.shape[1] - verdict.shape[1]) // 2, 0), top)
        return self._with_band(view, self._values(at), self.label)

    def planning_frame(
        self,
        values: overlay.Values,
        grid: Grid,
        levels: Floats,
        paths: Sequence[Floats],
        rows: Sequence[overlay.DriveRow] = (),
    ) -> Picture:
        """Return a frame (H, W, 3) of planning: a planner's field and each planner's best path (N, 2) [m] so far."""
        tints = [drive.colour for drive in self.drives]
        view = self._compositor.field_frame(grid, levels, list(zip(paths, tints, strict=True)))
        return self._with_band(view, values, overlay.PLANNING, rows)

    def view(self, at: float, *, last: bool = False) -> Picture:
        """Return the frame at a time [s] without the band."""
        playback, compositor = self.playback, self._compositor
        self._move_camera(at)
        if self._fan is not None:
            self._fan.advance(at)
        if self._shows_route:
            self._show_route(playback.replan_count(at))
        tracked = self._tracked_movers(at) if self._tracks_movers else None
        velocities = None if self._tracks_movers else playback.mover_velocities(at)
        actors = [drive.actor(at, last=last) for drive in self.drives]
        clearance = playback.clearance(at)
        close = not self._several and 0.0 < clearance <= max(FAR, 4 * self.scene.robot.radius)
        gap = playback.nearest_points(at) if close else None
        trails = [drive.trail(at, number, self._tints) for number, drive in enumerate(self.drives)]
        shown: dict[str, Any] = {"velocities": velocities, "tracked": tracked, "gap": gap, "trails": trails}
        view = compositor.frame_of(actors, playback.movers(at), **shown)
        if gap is not None:
            self._put_distance(view, playback.pose(at)[:2], *gap, clearance)
        self._mark_contact(view, at)
        return view

    def _move_camera(self, at: float) -> None:
        """Follow the robot, or close in on a contact."""
        close = 0.0 if self._several else self.playback.closeness(at, self._speed)
        contact = self.playback.first_contact
        target = self._target(at) if self._follows else None
        if contact is not None and close > 0.0:
            self._compositor.set_camera(self._aim(close, contact, target), moves=True)
        elif target is not None:
            self._compositor.set_camera(self._camera.moved(*target), moves=True)
        elif self._compositor.camera is not self._camera:
            self._compositor.set_camera(self._camera)

    def _target(self, at: float) -> Point:
        """Return the middle of a following picture [m]: the robot, but not far beyond the world's edge."""
        low, high = self._near_ground
        target = np.array(self.playback.camera_target(at))
        x0, y0, x1, y1 = self.scene.bounds
        first, last = np.array([x0, y0]) - low, np.array([x1, y1]) - high
        inner = np.where(first < last, np.clip(target, first, last), (first + last) / 2)
        x, y = np.clip(inner, target - CENTRED * high, target - CENTRED * low).tolist()
        return x, y

    @functools.cached_property
    def _near_ground(self) -> tuple[Floats, Floats]:
        """Corners (2,), (2,) of the ground around the target of a following camera, at the target's distance [m]."""
        width, height = self._view_size
        back = np.linalg.inv(self._camera.ground)
        middle = self._camera.pixels([(0.0, 0.0, 0.0)])[0]
        ends = np.array([(0, middle[1], 1), (width, middle[1], 1), (middle[0], height, 1), (middle[0], 0, 1)]) @ back.T
        left, right, near, far = ends[:, :2] / ends[:, 2:]
        return np.array([left[0], near[1]]), np.array([right[0], far[1]])

    def _tracked_movers(self, at: float) -> Floats:
        """Return the tracked movers (N, 5) in the world's frame; a mapless robot's own frame drifts."""
        tracked = self.playback.tracked(at)
        if self._own_map is not None:
            tracked[:, :2] = self._own_map.to_world(tracked[:, :2])
            tracked[:, 2:4] = self._own_map.to_world(tracked[:, 2:4]) - self._own_map.to_world(np.zeros((1, 2)))
        return tracked

    def _put_distance(self, view: Picture, robot: Point, here: Point, there: Point, clearance: float) -> None:
        """Write the distance to the nearest body on the robot's other side, where it covers no part of the gap."""
        sprite, tall = label(f"{clearance:.3f} m", self._layout.unit, INK), robot_height(self.scene.robot)
        away = np.subtract(here, there) * self.scene.robot.footprint.radius / max(math.dist(here, there), 1e-9)
        edge = np.add(robot, away).tolist()
        middle, *edges = self._compositor.camera.pixels([(*robot, tall / 2), (*edge, 0.0), (*edge, tall)])
        out = max((at - middle for at in edges), key=lambda at: math.hypot(*at))
        place = middle + out + out / max(math.hypot(*out), 1e-9) * (np.array(sprite.shape[1::-1]) / 2 + 3)
        _put_centred(view, sprite, *place.tolist())

    def _values(self, at: float) -> overlay.Values:
        playback = self.playback
        if self._several:
            return [(f"{at:.1f} s", False)]
        return overlay.drive_values(at, playback.speed(at), playback.clearance(at), playback.min_clearance(at))

    def _rows(self, at: float) -> list[overlay.DriveRow]:
        return [drive.row(at) for drive in self.drives] if self._several else []

    def _with_band(
        self, view: Picture, values: overlay.Values, status: tuple[str, Colour], rows: Sequence[overlay.DriveRow] = ()
    ) -> Picture:
        high = self._layout.height
        picture = np.empty((high + len(view), *view.shape[1:]), dtype=np.uint8)
        self._band.draw(values, status, picture[:high], rows)
        picture[high:] = view
        return picture

    def _aim(self, close: float = 0.0, contact: Point | None = None, target: Point | None = None) -> Camera:
        """Return a camera that shows the whole run or, when following, the robot's surroundings at `target`.

        `close`: how much it closes in on a contact, from 0 to 1.
        """
        scene, reach = self.scene, max(1.2, 7 * self.scene.robot.footprint.radius)
        paths = [part for drive in self.drives for part in (drive.rollout.pose[:, :2], drive.rollout.route)]
        low, high = scene.region(np.vstack(paths), whole=self.options.camera == "top")
        turned = camera_for(self._camera_name, low, high, drawn_height(scene), self._view_size).is_turned
        if self._follows:
            middle = np.array(target or (0.0, 0.0))
            low, high = middle - np.array([reach, 0.6 * reach]), middle + np.array([reach, 0.6 * reach])
        if contact is not None:
            half = 0.7 * reach * np.array([1.0, 0.6][:: -1 if turned else 1])
            low, high = ((1 - close) * low + close * (contact - half), (1 - close) * high + close * (contact + half))
        return camera_for(self._camera_name, low, high, drawn_height(scene), self._view_size, turned)

    def _add_labels(self) -> None:
        scene, text = self.scene, round(0.95 * self._layout.unit)
        self._compositor.add_label(label("START", text, START), *scene.start[:2], 1.3 * scene.robot.footprint.radius)
        self._compositor.add_label(label("GOAL", text, GOAL), *scene.goal, scene.goal_tolerance)

    def _show_route(self, count: int) -> None:
        """Show the route after `count` replans and the places of these replans."""
        playback = self.playback
        route = playback.replans[count - 1].route if count else self._rollout.route
        if self._own_map is not None:  # planned on the occupancy map
            route = self._own_map.to_world(route)
        places = [playback.pose(event.t)[:2] for event in playback.replans[:count] if event.caption]
        self._compositor.route, self._compositor.replanned_at = route, np.array(places).reshape(-1, 2)

    def _mark_contact(self, view: Picture, at: float) -> None:
        """Mark the point of the first contact from then on."""
        contact = self.playback.first_contact
        if self._several or contact is None or not self.playback.touched(at):
            return
        name = self.label[0]
        text, size = name[2:] if name.startswith("✕") else "CONTACT", round(self._layout.unit)
        px, py = self._compositor.pixel(*contact, robot_height(self.scene.robot) / 2)
        _put_centred(view, label("✕", 2 * size, CONTACT), px, py)
        _put_centred(view, pill(text, size, CONTACT), px, py - 3 * size)


def _drives(rollouts: Mapping[str, Rollout]) -> list[FilmedDrive]:
    """Return drives in the colours of their planners; bitwise identical ones are one."""
    same = distinct(rollouts.items())
    styles = label_styles([each[0][0] for each in same], [each[0][1].record.planner.name for each in same])
    return [FilmedDrive(each, style.colour) for each, style in zip(same, styles, strict=True)]


def driven_text(driven: float, route: str) -> str:
    """Return the driven length and the route's [m], such as "driven 9.70 of 17.5 m"."""
    return f"driven {driven:.2f} of {route} m"


def caption(log: Rollout) -> str:
    """Return a film's line about the certificate; empty if the robot has not driven."""
    if not len(log.t):
        return ""
    return certify(log).caption


def _put_centred(view: Picture, sprite: Sprite, x: float, y: float) -> None:
    """Draw a sprite around a point of a picture, within its borders."""
    left = min(max(x - sprite.shape[1] / 2, 0), view.shape[1] - sprite.shape[1])
    put(view, sprite, left, min(max(y - sprite.shape[0] / 2, 0), view.shape[0] - sprite.shape[0]))
