"""What a robot's lidar tells it, in the frame of its estimates: scans, movers among a given map, and a map of its own."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from antdrive.base import Floats, Point, Pose
from antdrive.robots import RobotSpec, Twist
from antdrive.robots.lidar import Lidar
from antdrive.sim.driving import _kernels_hits
from antdrive.sim.driving.parts import Rows
from antdrive.sim.log.record import DriveRecord
from antdrive.sim.log.rollout import scans_logged
from antdrive.sim.log.streams import random_stream
from antdrive.sim.policy import SCANNED
from antdrive.sim.sensing.mapping import OccupancyMap, clear_distance, clear_turn
from antdrive.sim.sensing.matching import FAR, ScanMatcher, without_sliding
from antdrive.sim.sensing.scanner import Scanner
from antdrive.sim.sensing.tracking import Ground, MappedGround, MoverTracker, TrackedMovers
from antdrive.worlds import Task, Trajectories, World

MAP_CELL = 0.05  # side of the map's cells [m]
HORIZON, HORIZON_AMONG_MOVERS = 10.0, 16.0  # hits farther away are not entered in the map [m]
RECENT = 1.0  # scans of this time are kept where the map is made anew [s]
PAD = 0.01  # the robot keeps this from what was hit and from what was not seen: rounding of ranges, and of cells [m]
PATIENCE = 3  # plans in a row that find no path before the robot no longer believes what it saw long ago
TOLERANCE = 0.008  # a route may lose this much of its clearance without being planned anew [m]
BLUR = 0.02  # and this much more for each metre of distance [m/m]
SHARPEST = 0.05  # arcs of a smaller radius than this are nearly turns on the spot [m]
FAR_AMONG_MOVERS = 15.0  # scans are matched up to this far where movers, which are no marks, hide what is near [m]


def horizon_of(*, tracks_movers: bool) -> float:
    """How far away a hit may be that is entered in a robot's map [m]."""
    return HORIZON_AMONG_MOVERS if tracks_movers else HORIZON


def turning_room(radius: float) -> float:
    """How far around a robot ground is to be free, so that it may turn on the spot in its own sight [m].

    Half a cell is more than the circle around a cell, by which ground that was not seen counts, stands out of it.
    """
    return radius + PAD + 0.5 * MAP_CELL


def reset_ticks(record: DriveRecord) -> Iterator[int]:
    """The control periods in which a robot without a map forgot what it had seen: after some plans in a row found no path."""
    failures = 0
    for replan in record.replans:
        if failures >= PATIENCE and replan.trigger != SCANNED:
            failures = 0
            yield round(replan.t * record.control_hz)
        failures = 0 if replan.solved else failures + 1


def table_logged(
    taken: Iterable[tuple[int, npt.NDArray[Any]]], columns: int, log: Rows, per_tick: int
) -> npt.NDArray[np.float32]:
    """A table (K, columns) of a log: what was noted in control periods, each line after the row of its period."""
    kept = [(tick * per_tick, lines) for tick, lines in taken if tick * per_tick < len(log.t)]
    tables = [np.column_stack((np.full(len(lines), row), lines)) for row, lines in kept]
    return np.concatenate(tables or [np.empty((0, columns))]).astype(np.float32)


class MoverTracking:
    """What a robot's scans tell of movers, and the log of it.

    Attributes:
        tracker: finds and follows them
        tick: the control period of the last scan
        sight: the ground that its beams crossed within `reach` [m^2]
        reach: up to where beams lie no farther apart than a cell of a map [m]
    """

    def __init__(self, lidar: Lidar, hz: int, pose_xy: float = 0.0, pose_yaw: float = 0.0) -> None:
        lidar = lidar.at(hz)
        self.tracker, self.tick = MoverTracker(lidar, None, pose_xy, pose_yaw), 0
        self.sight, self.reach = 0.0, min(lidar.max_range, MAP_CELL / lidar.spacing)
        self._hz, self._spacing = hz, lidar.spacing
        self._settle = max(2, round(self.tracker.policy.settle * lidar.rate))
        self._log: list[tuple[int, TrackedMovers]] = []

    def read(self, ground: Ground, pose: Pose, ranges: Floats, tick: int) -> npt.NDArray[np.bool_]:
        """Read a scan; which beams met movers that are followed (beams,)."""
        theirs = self.tracker.update(ground, pose, ranges, tick / self._hz)
        self.tick = tick
        crossed = np.clip(ranges, 0.0, self.reach)
        self.sight = float(0.5 * self._spacing * (crossed * crossed).sum())
        self._log.append((tick, self.tracker.movers()))
        return theirs

    def update_on_map(self, seen: OccupancyMap, pose: Pose, ranges: Floats, tick: int) -> npt.NDArray[np.bool_]:
        """The same for a robot that makes its own map, before the scan is entered."""
        return self.read(MappedGround(seen, self._settle), pose, ranges, tick)

    def standing(self, seen: OccupancyMap, pose: Pose, ranges: Floats, tick: int) -> Floats:
        """A scan that was not read yet without what may move (beams,) [m]: nothing is in range there."""
        ground = MappedGround(seen, self._settle)
        return np.where(self.tracker.suspected(ground, pose, ranges, tick / self._hz), np.inf, ranges)

    def logged(self, log: Rows, per_tick: int) -> dict[str, Any]:
        """The array `tracks` of a log (K, 7): the movers that were followed."""
        lines = (
            (tick, np.column_stack((found.numbers, found.positions, found.velocities, found.radii)))
            for tick, found in self._log
        )
        return {"tracks": table_logged(lines, 7, log, per_tick)}


class Scan(NamedTuple):
    """One scan."""

    tick: int  # the control period in which it was taken
    estimate: Pose  # where the robot believed it was
    ranges: Floats  # what was measured (beams,) [m]
    # which beams met movers that are followed (beams,); None where nobody looks for movers
    movers: npt.NDArray[np.bool_] | None = None


@dataclass(frozen=True, eq=False)
class SimulatedLidar:
    """What a robot is surveying with."""

    scanner: Scanner  # the lidar in the true world
    world: World  # what stands in it
    trajectories: Trajectories | None  # the true motions of the movers; None where there are none
    rng: np.random.Generator | None  # where the noise of ranges comes from; None: no noise
    hz: int  # control periods per second

    @classmethod
    def of(
        cls, lidar: Lidar, world: World, trajectories: Trajectories, *, seed: int, noisy: bool, hz: int
    ) -> SimulatedLidar:
        """A lidar in a world, whose noise is drawn from a drive's seed; it scans once in a control period at most."""
        rng = random_stream(seed, "lidar") if noisy else None
        return cls(Scanner.of(lidar.at(hz), world), world, trajectories or None, rng, hz)

    @property
    def movers_at_start(self) -> Floats | None:
        """Where the movers are at first, as discs (M, 3): x, y, radius [m]; None where there are none."""
        movers = self.trajectories
        return np.column_stack((movers.positions(np.zeros(1))[0], movers.radii)) if movers else None

    def due(self, tick: int, last: int) -> bool:
        """Whether a scan is due in a control period, after one in an earlier period; a negative one: after none."""
        return last < 0 or (tick != last and self.scanner.lidar.due(tick, self.hz))

    def ranges(self, tick: int, pose: Pose) -> Floats:
        """A scan (beams,) [m]."""
        movers = self.trajectories
        if not movers:
            return self.scanner.scan(pose, rng=self.rng)
        return self.scanner.scan(pose, movers.positions(np.array([tick / self.hz]))[0], movers.radii, self.rng)


class Scans:
    """The scans of a lidar, each taken when it is due. Nothing but their ranges depends on true poses and the true world.

    Attributes:
        scans: all scans so far
    """

    def __init__(self, sensor: SimulatedLidar) -> None:
        self.scans: list[Scan] = []
        self._sensor = sensor

    def scan(self, tick: int, pose: Pose, estimate: Pose) -> Pose:
        """Take a scan from the true pose if one is due in a control period; the estimate, which the scan may correct."""
        if not self._sensor.due(tick, self.scans[-1].tick if self.scans else -1):
            return estimate
        return self.read(tick, estimate, self._sensor.ranges(tick, pose))

    def read(self, tick: int, estimate: Pose, ranges: Floats) -> Pose:
        """Keep a scan; the estimate, which it does not correct."""
        self.scans.append(Scan(tick, estimate, ranges))
        return estimate

    def logged(self, log: Rows, per_tick: int) -> dict[str, Any]:
        """The arrays of a log that hold the scans."""
        return scans_logged(((scan.tick, scan.ranges) for scan in self.scans), per_tick, len(log.t))


class MoverDetector(Scans):
    """Lidar-based mover detection for a robot with a map.

    Attributes:
        watch: the tracks of the movers
    """

    def __init__(self, sensor: SimulatedLidar, ground: Ground, tracking: MoverTracking) -> None:
        super().__init__(sensor)
        self.tracking, self._ground = tracking, ground

    def read(self, tick: int, estimate: Pose, ranges: Floats) -> Pose:
        """Keep a scan, and look for movers in it; the estimate."""
        self.tracking.read(self._ground, estimate, ranges, tick)
        return super().read(tick, estimate, ranges)


class Survey(Scans):
    """What a robot without a map knows of the world: a map of its scans.

    True poses and the true world are used for the ranges of scans, and for nothing else but this: the robot is told which of the
    ground that it covers when it turns at the start is free. Whoever puts it down sees that.

    Attributes:
        lidar: what it surveys with
        map: what was hit, and which ground was seen free
        whole: how many scans were entered as a whole, with the ground that is free
        watch: what follows the movers in the scans; None: nothing does
    """

    def __init__(
        self,
        sensor: SimulatedLidar,
        robot: RobotSpec,
        start: Pose,
        goal: Point,
        *,
        matching: bool = False,
        tracking: MoverTracking | None = None,
    ) -> None:
        super().__init__(sensor)
        self.lidar = sensor.scanner.lidar
        foot = robot.footprint
        self._footprint = dataclasses.replace(foot, rounding=foot.rounding + PAD)
        self._turning_room = turning_room(robot.radius)
        self._goal = goal
        self.tracking = tracking
        self.map = OccupancyMap(
            self.lidar, MAP_CELL, start[:2], horizon_of(tracks_movers=tracking is not None), goal=goal
        )
        self.map.mark_free(start[:2], self._turning_room, sensor.world, sensor.movers_at_start)
        self._recent = math.ceil(RECENT * self.lidar.rate)
        self._matcher = ScanMatcher(self.lidar, FAR if tracking is None else FAR_AMONG_MOVERS) if matching else None
        self.whole = 0

    @classmethod
    def of(
        cls, robot: RobotSpec, task: Task, sensor: SimulatedLidar, *, matching: bool, tracking: MoverTracking | None
    ) -> Survey:
        """The survey of a drive, after the first scan from the start."""
        survey = cls(sensor, robot, task.start, task.goal, matching=matching, tracking=tracking)
        survey.scan(0, task.start, task.start)
        return survey

    def read(self, tick: int, estimate: Pose, ranges: Floats) -> Pose:
        """Enter a scan in the map; the estimated pose, which the scan may correct."""
        if self.map.whole:
            self.whole += 1
            if self._matcher is not None:
                estimate = self._matched(self._matcher, estimate, ranges, tick)
        movers = self.tracking.update_on_map(self.map, estimate, ranges, tick) if self.tracking is not None else None
        self.map.insert(estimate, ranges, movers)
        self.scans.append(Scan(tick, estimate, ranges, movers))
        return estimate

    def _matched(self, matcher: ScanMatcher, estimate: Pose, ranges: Floats, tick: int) -> Pose:
        """The estimated pose, corrected by a scan; among movers by what stands, and by nothing that slides along a wall."""
        if self.tracking is None:
            return matcher.corrected(self.map, estimate, ranges)
        standing = self.tracking.standing(self.map, estimate, ranges, tick)
        corrected = matcher.corrected(self.map, estimate, standing)
        near = np.where(standing <= FAR_AMONG_MOVERS, standing, np.inf)
        return without_sliding(estimate, corrected, self.map.endpoints(estimate, near))

    def hit_within(self, points: Floats, needed: Floats, ahead: Floats) -> bool:
        """Whether a beam of the last scan ended clearly nearer to a point of a route than the clearance that it needs."""
        scan = self.scans[-1]
        x, y, yaw = self.lidar.pose_on(scan.estimate)
        ranges = scan.ranges if scan.movers is None else np.where(scan.movers, np.inf, scan.ranges)
        return bool(_kernels_hits.hit_within(points, needed, ahead, TOLERANCE, BLUR, x, y, yaw, self.map.beams, ranges))

    def reset(self, pose: Pose) -> None:
        """Make the map anew of the latest scans: what was seen before may be elsewhere in a frame that drifts.

        What the robot covers when it turns stays free as far as it was seen free. Hits there become ground that was not seen:
        open to plans, but the robot does not move over it before it has looked again.
        """
        self.map = self.map.reset_around(pose[:2], self._turning_room, self._goal)
        for scan in self.scans[-self._recent :]:
            self.map.insert(scan.estimate, scan.ranges, scan.movers)

    def clear_distance(self, pose: Pose, speed: float, yaw_rate: float, longest: float) -> float:
        """How far the robot can go on an arc over ground that it has seen free [m]."""
        return clear_distance(self.map, pose, speed, yaw_rate, self._footprint, longest)

    def clear_turn(self, pose: Pose, yaw_rate: float, farthest: float) -> float:
        """How far the robot can turn on the spot over ground that it has seen free [rad]."""
        return clear_turn(self.map, pose, yaw_rate, self._footprint, farthest)

    def clear_way(self, pose: Pose, twist: Twist, farthest: float, *, freespace: bool = False) -> float:
        """How far the robot can go with a twist over ground that it has seen free [m]; for what is nearly a turn [rad]."""
        if abs(twist.speed) <= SHARPEST * abs(twist.yaw_rate):
            return clear_turn(self.map, pose, twist.yaw_rate, self._footprint, farthest, freespace=freespace)
        return clear_distance(self.map, pose, *twist, self._footprint, farthest, freespace=freespace)
