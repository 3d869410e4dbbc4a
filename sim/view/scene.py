"""What films and figures show of a run, taken from its log: the world, the marks and the robot's shape."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from antdrive.robots.spec import Footprint, RobotSpec
from antdrive.sim.log.rollout import Rollout
from antdrive.worlds.errors import InputError
from antdrive.worlds.movers import Wandering
from antdrive.worlds.trajectories import Trajectories
from antdrive.worlds.types import Bounds, Point, Pose
from antdrive.worlds.world import Task

Floats = npt.NDArray[np.float64]

JUMP = 0.05  # a mover that moves less from row to row has not jumped [m]
PLANNED_TRACK = 30.0  # how much of the movers' ways a plan's figure shows [s]


@dataclass(frozen=True)
class Body:
    """The robot's shape, as far as it can be seen."""

    name: str
    footprint: Footprint
    height: float  # [m]
    wheel_radius: float  # [m]
    track: float  # [m]
    max_speed: float  # [m/s]

    @classmethod
    def of(cls, robot: RobotSpec) -> Body:
        """The body of a robot."""
        return cls(robot.name, robot.footprint, robot.height, robot.wheel_radius, robot.track, robot.max_speed)


@dataclass(frozen=True, eq=False, kw_only=True)
class Scene:
    """Everything that stands still, and the robot's shape."""

    name: str
    bounds: Bounds  # [m]
    obstacles: Floats  # (N, 4) x, y, radius, height [m]
    unseen: npt.NDArray[np.bool_]  # (N,) placed after planning
    start: Pose
    goal: Point
    goal_tolerance: float  # [m]
    inflate: float  # robot radius + margin, as planned with [m]
    margin: float  # [m]
    robot: Body
    mover_radii: tuple[float, ...] = ()  # [m]
    movers: tuple[Point, ...] = ()  # where they are when the run ends, or at first before it began [m]
    tracks: tuple[Floats, ...] = ()  # where each mover goes, (N, 2) a piece [m]; jumps part pieces

    @classmethod
    def of(cls, rollout: Rollout) -> Scene:
        """The scene of a run.

        Raises:
            InputError: the log's metadata do not say enough.
        """
        meta = rollout.meta
        try:
            task, robot = meta["task"], meta["robot"]
            found = task.get("obstacles") or []
            unseen = np.zeros(len(found), dtype=np.bool_)
            unseen[np.asarray(meta.get("unseen") or [], dtype=np.int64)] = True
            foot = {key: float(value) for key, value in robot["footprint"].items()}
            return cls(
                name=str(task["name"]),
                bounds=_floats(task["bounds"], 4),
                obstacles=_discs(found),
                unseen=unseen,
                start=_floats(task["start"], 3),
                goal=_floats(task["goal"], 2),
                goal_tolerance=float(task.get("goal_tolerance", 0.25)),
                inflate=float(meta.get("inflate", 0.0)),
                margin=float(meta.get("margin", 0.0)),
                robot=Body(
                    str(robot["name"]),
                    Footprint(**foot),
                    *(float(robot[key]) for key in ("height", "wheel_radius", "track", "max_speed")),
                ),
                mover_radii=tuple(float(mover["radius"]) for mover in task.get("movers") or []),
                movers=tuple((float(x), float(y)) for x, y in rollout.movers[-1]) if len(rollout.movers) else (),
                tracks=pieces(rollout.movers),
            )
        except (KeyError, IndexError, TypeError, ValueError, AttributeError) as error:
            raise InputError(f"rollout: its metadata do not describe a world and a robot ({error!r})") from None

    @classmethod
    def planned(cls, task: Task, robot: RobotSpec, inflate: float) -> Scene:
        """The scene of a plan that was not driven."""
        discs = [(disc.x, disc.y, disc.radius, disc.height) for disc in task.world.obstacles]
        shown = [mover for mover in task.world.movers if not isinstance(mover, Wandering)]  # their way hangs on a seed
        traffic = Trajectories.of(dataclasses.replace(task.world, movers=tuple(shown)), task.start[:2])
        ways = traffic.positions(np.arange(0.0, PLANNED_TRACK, 0.05))
        return cls(
            name=task.world.name,
            bounds=task.world.bounds,
            obstacles=np.array(discs, dtype=np.float64).reshape(-1, 4),
            unseen=np.zeros(len(discs), dtype=np.bool_),
            start=task.start,
            goal=task.goal,
            goal_tolerance=task.goal_tolerance,
            inflate=inflate,
            margin=max(0.0, inflate - robot.radius),
            robot=Body.of(robot),
            mover_radii=tuple(traffic.radii.tolist()),
            movers=tuple((x, y) for x, y in ways[0].tolist()),
            tracks=pieces(ways),
        )

    def region(self, lines: Floats) -> tuple[Floats, Floats]:
        """The corners (2,), (2,) of the part of the world that the task and lines of points (N, 2) take up.

        It is the whole world unless that would leave most of a picture unused.
        """
        room = max(0.8, 3 * self.robot.footprint.radius, 1.5 * self.inflate)
        ends = np.array([self.start[:2], self.goal])
        points = np.vstack([ends, lines.reshape(-1, 2)])
        world_low, world_high = np.array(self.bounds[:2]), np.array(self.bounds[2:])
        low = np.maximum(points.min(axis=0) - room, world_low)
        high = np.minimum(points.max(axis=0) + room, world_high)
        if np.prod(high - low) > 0.5 * np.prod(world_high - world_low):
            return world_low, world_high
        return low, high


def jumping(movers: Floats) -> npt.NDArray[np.bool_]:
    """Whether movers at places (T, M, 2) jump from one row to the next, (T - 1, M): far, and not as a part of motion."""
    step = np.hypot(*np.moveaxis(np.diff(movers, axis=0), -1, 0))
    around = np.zeros_like(step)
    if len(step) > 1:
        around[1:] = step[:-1]
        around[:-1] = np.maximum(around[:-1], step[1:])
    return np.asarray((step > JUMP) & (step > 3 * around))


def pieces(movers: Floats) -> tuple[Floats, ...]:
    """The ways (N, 2) of movers at places (T, M, 2), cut where they jump."""
    cuts = jumping(movers)
    return tuple(
        piece
        for m in range(movers.shape[1])
        for piece in np.split(movers[:, m], np.flatnonzero(cuts[:, m]) + 1)
        if len(piece) > 1
    )


def _discs(entries: list[Mapping[str, Any]]) -> Floats:
    rows = [(entry["x"], entry["y"], entry["radius"], entry.get("height", 1.0)) for entry in entries]
    return np.array(rows, dtype=np.float64).reshape(-1, 4)


def _floats(values: Any, count: int) -> Any:
    numbers = tuple(float(value) for value in values)
    if len(numbers) != count:
        raise ValueError(f"expected {count} numbers, found {len(numbers)}")
    return numbers
