"""Scene of a run for films and figures: world, start, goal, robot shape and movers."""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from antdrive.base.types import Bounds, Flags, Floats, Point, Pose
from antdrive.robots.spec import RobotSpec
from antdrive.sim.log.rollout import Rollout
from antdrive.worlds.movers import Wandering
from antdrive.worlds.trajectories import Trajectories
from antdrive.worlds.world import Task, World

if TYPE_CHECKING:
    from antdrive.worlds import Grid

MIN_JUMP = 0.05  # minimum distance between two rows that counts as a jump of a mover [m]
RIM, NEAREST = 97, 12  # points on a footprint, and discs, among which the nearest two points are found
PLANNED_TRACK = 30.0  # duration of the movers' tracks in a plan's figure [s]


@dataclass(frozen=True, eq=False, kw_only=True)
class Scene:
    """Static content of a run, robot shape and movers' tracks."""

    name: str  # the world's name
    bounds: Bounds  # xmin, ymin, xmax, ymax [m]
    obstacles: Floats  # x, y, radius and height of each cylinder (N, 4) [m]
    unseen: Flags  # whether each obstacle was placed after planning (N,)
    start: Pose  # x, y [m] and heading [rad]
    goal: Point  # x, y [m]
    goal_tolerance: float  # largest distance from the goal at which the robot may stop [m]
    inflate: float  # planned distance of the robot's centre, or of its footprint, from obstacles [m]
    margin: float  # the part of `inflate` beyond the robot's radius, or beyond its footprint [m]
    robot: RobotSpec  # the robot's specification
    mapped: bool = True  # whether the robot had a map
    outlined: bool = False  # whether the plan keeps the footprint clear, and not the disc around it
    mover_radii: tuple[float, ...] = ()  # one per mover [m]
    # one position per mover [m]: at the first contact or closest approach, or at t = 0 for a plan without a drive
    movers: tuple[Point, ...] = ()
    movers_at: float = 0.0  # time of these positions [s]
    tracks: tuple[Floats, ...] = ()  # the movers' polylines (N, 2) [m]; a mover that jumps has several

    @classmethod
    def of(cls, rollout: Rollout) -> Scene:
        """Return the scene of a logged run."""
        record, world = rollout.record, rollout.record.world
        row = decisive_row(rollout)
        return cls._in(
            world,
            record.task,
            record.robot,
            unseen=np.arange(len(world.obstacles)) >= len(world.obstacles) - len(record.unseen),
            inflate=record.inflate if record.footprint_margin is None else record.footprint_margin,
            margin=record.kept_margin,
            outlined=record.footprint_margin is not None,
            mapped=not record.mapless,
            mover_radii=tuple(mover.radius for mover in world.movers),
            movers=tuple((x, y) for x, y in rollout.movers[row].tolist()) if len(rollout.movers) else (),
            movers_at=float(rollout.t[row]) if len(rollout.t) else 0.0,
            tracks=mover_tracks(rollout.movers),
        )

    @classmethod
    def planned(cls, task: Task, robot: RobotSpec, grid: Grid, *, mapped: bool = True) -> Scene:
        """Return the scene of a plan without a drive."""
        # The motion of wandering movers depends on the run's seed.
        shown = [mover for mover in task.world.movers if not isinstance(mover, Wandering)]
        margin = grid.turns.outline.reach - robot.footprint.rounding if grid.turns else grid.inflate - robot.radius
        trajectories = Trajectories.of(dataclasses.replace(task.world, movers=tuple(shown)), task.start[:2])
        positions = trajectories.positions(np.arange(0.0, PLANNED_TRACK, 0.05))
        return cls._in(
            task.world,
            task,
            robot,
            unseen=np.zeros(len(task.world.obstacles), dtype=np.bool_),
            inflate=margin if grid.turns else grid.inflate,
            margin=max(0.0, margin),
            outlined=bool(grid.turns),
            mapped=mapped,
            mover_radii=tuple(trajectories.radii.tolist()),
            movers=tuple((x, y) for x, y in positions[0].tolist()),
            tracks=mover_tracks(positions),
        )

    @classmethod
    def running(cls, task: Task, robot: RobotSpec) -> Scene:
        """Return the scene of a robot that drives without a plan."""
        unseen, radii = np.zeros(len(task.world.obstacles), dtype=np.bool_), [m.radius for m in task.world.movers]
        return cls._in(task.world, task, robot, unseen=unseen, inflate=0.0, margin=0.0, mover_radii=tuple(radii))

    @classmethod
    def _in(cls, world: World, task: Task, robot: RobotSpec, **more: Any) -> Scene:
        discs = [(disc.x, disc.y, disc.radius, disc.height) for disc in world.obstacles]
        obstacles = np.array(discs, dtype=np.float64).reshape(-1, 4)
        ends: dict[str, Any] = {"start": task.start, "goal": task.goal, "goal_tolerance": task.goal_tolerance}
        return cls(name=world.name, bounds=world.bounds, obstacles=obstacles, robot=robot, **ends, **more)

    @property
    def unseen_label(self) -> str:
        """Legend of the obstacles of `--unseen`."""
        return "placed after planning" if self.mapped else "not in the world file"

    @property
    def no_go_label(self) -> str:
        """Legend of the no-go area."""
        if self.outlined:
            return f"no-go area for the footprint\n(margin = {self.inflate:.3g} m)"
        return f"no-go area for the robot's centre\n(radius + margin = {self.inflate:.2f} m)"

    @property
    def has_no_go_area(self) -> bool:
        """Whether the initial plan had a no-go area around obstacles."""
        return self.mapped and self.inflate > 0

    def map_bounds(self, route: Floats) -> Bounds:
        """Return the bounds of the map to show [m]: the world and a mapless robot's initial route (N, 2) [m]."""
        if self.mapped or not len(route):
            return self.bounds
        (x0, y0), (x1, y1) = route.min(axis=0).tolist(), route.max(axis=0).tolist()
        low_x, low_y, high_x, high_y = self.bounds
        return min(low_x, x0), min(low_y, y0), max(high_x, x1), max(high_y, y1)

    def region(self, points: Floats, *, whole: bool = False) -> tuple[Floats, Floats]:
        """Return the corners (2,), (2,) [m] of the region around start, goal and points (N, 2) [m].

        A region larger than half of the world is extended to the whole world, and with `whole` every region.
        """
        room = max(0.8, 3 * self.robot.footprint.radius, 1.5 * self.inflate)
        ends = np.array([self.start[:2], self.goal])
        points = np.vstack([ends, points.reshape(-1, 2)])
        world_low, world_high = np.array(self.bounds[:2]), np.array(self.bounds[2:])
        low = np.maximum(points.min(axis=0) - room, world_low)
        high = np.minimum(points.max(axis=0) + room, world_high)
        if whole or np.prod(high - low) > 0.5 * np.prod(world_high - world_low):
            return world_low, world_high
        return low, high


def decisive_row(rollout: Rollout) -> int:
    """Return the row of the first contact, else of the closest approach; 0 without rows."""
    if not len(rollout.t):
        return 0
    return min(rollout.first_contact, len(rollout.t) - 1) if len(rollout.contacts) else int(rollout.clearance.argmin())


def contact_point(scene: Scene, pose: npt.ArrayLike, index: int, movers: Floats) -> tuple[float, float]:
    """Return the point [m] on the surface of an obstacle, mover or wall nearest to the robot."""
    x, y, yaw = (float(value) for value in np.asarray(pose))
    foot = scene.robot.footprint
    discs = np.vstack([scene.obstacles[:, :3], np.column_stack([movers, scene.mover_radii])])
    if index >= len(discs):
        x0, y0, x1, y1 = scene.bounds
        return ((x0, y), (x1, y), (x, y0), (x, y1))[(index - len(discs)) % 4]
    ox, oy, radius = (float(value) for value in discs[index])
    cosine, sine = math.cos(yaw), math.sin(yaw)
    ahead, aside = foot.nearest((ox - x) * cosine + (oy - y) * sine, (oy - y) * cosine - (ox - x) * sine)
    nx, ny = x + ahead * cosine - aside * sine, y + ahead * sine + aside * cosine
    gap = math.hypot(nx - ox, ny - oy)
    if gap < 1e-9:
        return ox, oy
    return ox + radius * (nx - ox) / gap, oy + radius * (ny - oy) / gap


def nearest_points(scene: Scene, pose: Pose, movers: Floats) -> tuple[Point, Point]:
    """Return the nearest two points of the footprint and of an obstacle, mover or wall [m], to about a millimetre."""
    x, y, yaw = pose
    corners = np.array([*scene.robot.footprint.outline(), scene.robot.footprint.outline()[0]]) @ (1, 1j)
    arc = np.concatenate([[0.0], np.cumsum(np.abs(np.diff(corners)))])
    rim = complex(x, y) + np.interp(np.linspace(0, arc[-1], RIM), arc, corners) * np.exp(1j * yaw)
    discs = np.vstack([scene.obstacles[:, :3], np.column_stack([movers, scene.mover_radii])])
    discs = discs[np.argsort(np.hypot(discs[:, 0] - x, discs[:, 1] - y) - discs[:, 2])[:NEAREST]]
    ways = discs[:, :2] @ (1, 1j) - rim[:, None]
    lengths = np.abs(ways)
    x0, y0, x1, y1 = scene.bounds
    walls = np.column_stack([x0 - rim.real, x1 - rim.real, 1j * (y0 - rim.imag), 1j * (y1 - rim.imag)])
    ways = np.hstack([ways * (1 - discs[:, 2] / np.maximum(lengths, 1e-9)), walls])
    at, _ = best = np.unravel_index(np.abs(ways).argmin(), ways.shape)
    one, other = complex(rim[at]), complex(rim[at] + ways[best])
    return (one.real, one.imag), (other.real, other.imag)


def jumps(movers: Floats) -> Flags:
    """Return whether movers at positions (T, M, 2) jump between consecutive rows (T - 1, M).

    A jump is longer than `MIN_JUMP` and more than three times as long as the steps before and after it.
    """
    step = np.hypot(*np.moveaxis(np.diff(movers, axis=0), -1, 0))
    around = np.zeros_like(step)
    if len(step) > 1:
        around[1:] = step[:-1]
        around[:-1] = np.maximum(around[:-1], step[1:])
    return np.asarray((step > MIN_JUMP) & (step > 3 * around))


def mover_tracks(movers: Floats) -> tuple[Floats, ...]:
    """Return the polylines (N, 2) of movers at positions (T, M, 2), cut at jumps."""
    cuts = jumps(movers)
    return tuple(
        piece
        for m in range(movers.shape[1])
        for piece in np.split(movers[:, m], np.flatnonzero(cuts[:, m]) + 1)
        if len(piece) > 1
    )
