"""What a robot without a map knows of the world: what its lidar has seen, in the frame of its odometry."""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from antdrive.base import Bounds, Floats, Point, Pose
from antdrive.robots import RobotSpec, Twist
from antdrive.robots.lidar import Lidar
from antdrive.sim.driving import _kernels_hits
from antdrive.sim.driving.own_map import MAP_CELL, PAD, RECENT, horizon_of, turning_room
from antdrive.sim.driving.parts import Rows
from antdrive.sim.driving.watching import Watch
from antdrive.sim.log.scans import scans_logged
from antdrive.sim.log.streams import random_stream
from antdrive.sim.sensing.mapping import OccupancyMap
from antdrive.sim.sensing.matching import FAR, ScanMatcher, sliding_left_out
from antdrive.sim.sensing.scanner import Scanner
from antdrive.sim.sensing.sight import clear_distance, clear_turn
from antdrive.worlds import Task, Trajectories, World

TOLERANCE = 0.008  # a route may lose this much of its clearance without being planned anew [m]
BLUR = 0.02  # and this much more for each metre of distance [m/m]
SHARPEST = 0.05  # arcs of a smaller radius than this are nearly turns on the spot [m]
FAR_AMONG_MOVERS = 15.0  # scans are matched up to this far where movers, which are no marks, hide what is near [m]


class Scan(NamedTuple):
    """One scan."""

    tick: int  # the control period in which it was taken
    estimate: Pose  # where the robot believed it was
    ranges: Floats  # what was measured (beams,) [m]
    # which beams met movers that are followed (beams,); None where nobody looks for movers
    movers: npt.NDArray[np.bool_] | None = None


@dataclass(frozen=True, eq=False)
class Senses:
    """What a robot is surveying with."""

    scanner: Scanner  # the lidar in the true world
    world: World  # what stands in it
    trajectories: Trajectories | None  # the true motions of the movers; None where there are none
    rng: np.random.Generator | None  # where the noise of ranges comes from; None: no noise
    hz: int  # control periods per second

    @classmethod
    def of(cls, lidar: Lidar, world: World, trajectories: Trajectories, *, seed: int, noisy: bool, hz: int) -> Senses:
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


class Survey:
    """The robot's knowledge. It takes a scan when one is due, and builds a map of it.

    True poses and the true world are used for the ranges of scans, and for nothing else but this: the robot is told which of the
    ground that it covers when it turns at the start is free. Whoever puts it down sees that.

    Attributes:
        lidar: what it surveys with
        map: what was hit, and which ground was seen free
        scans: all scans so far
        whole: how many of them were entered as a whole, with the ground that is free
        watch: what follows the movers in the scans; None: nothing does
    """

    def __init__(
        self,
        senses: Senses,
        robot: RobotSpec,
        start: Pose,
        goal: Point,
        *,
        matching: bool = False,
        watch: Watch | None = None,
    ) -> None:
        self._senses, self.lidar = senses, senses.scanner.lidar
        foot = robot.footprint
        self._footprint = dataclasses.replace(foot, rounding=foot.rounding + PAD)
        self._turning_room = turning_room(robot.radius)
        self._goal = goal
        self.watch = watch
        self.map = self._empty_map(start)
        self._recent = math.ceil(RECENT * self.lidar.rate)
        self._matcher = ScanMatcher(self.lidar, FAR if watch is None else FAR_AMONG_MOVERS) if matching else None
        self.scans: list[Scan] = []
        self.whole = 0

    @classmethod
    def of(cls, robot: RobotSpec, task: Task, senses: Senses, *, matching: bool, watch: Watch | None) -> Survey:
        """The survey of a drive, after the first scan from the start."""
        survey = cls(senses, robot, task.start, task.goal, matching=matching, watch=watch)
        survey.scan(0, task.start, task.start)
        return survey

    def scan(self, tick: int, pose: Pose, estimate: Pose) -> Pose:
        """Take a scan if one is due in a control period; the estimated pose, which the scan may correct."""
        if not self._senses.due(tick, self.scans[-1].tick if self.scans else -1):
            return estimate
        ranges = self._senses.ranges(tick, pose)
        if self.map.whole:
            self.whole += 1
            if self._matcher is not None:
                estimate = self._matched(self._matcher, estimate, ranges, tick)
        movers = self.watch.read_on_map(self.map, estimate, ranges, tick) if self.watch is not None else None
        self.map.insert(estimate, ranges, movers)
        self.scans.append(Scan(tick, estimate, ranges, movers))
        return estimate

    def _matched(self, matcher: ScanMatcher, estimate: Pose, ranges: Floats, tick: int) -> Pose:
        """The estimated pose, corrected by a scan; among movers by what stands, and by nothing that slides along a wall."""
        if self.watch is None:
            return matcher.corrected(self.map, estimate, ranges)
        standing = self.watch.standing(self.map, estimate, ranges, tick)
        corrected = matcher.corrected(self.map, estimate, standing)
        near = np.where(standing <= FAR_AMONG_MOVERS, standing, np.inf)
        return sliding_left_out(estimate, corrected, self.map.endpoints(estimate, near))

    def logged(self, log: Rows, per_tick: int) -> dict[str, Any]:
        """The arrays of a log that hold the scans."""
        return scans_logged(((scan.tick, scan.ranges) for scan in self.scans), per_tick, len(log.t))

    def discs(self, bounds: Bounds) -> Floats:
        """What was hit within bounds, as discs (N, 3) [m]."""
        return self.map.discs(bounds)

    def hit_within(self, points: Floats, needed: Floats, ahead: Floats) -> bool:
        """Whether a beam of the last scan ended clearly nearer to a point of a route than the clearance that it needs."""
        scan = self.scans[-1]
        x, y, yaw = self.lidar.pose_on(scan.estimate)
        ranges = scan.ranges if scan.movers is None else np.where(scan.movers, np.inf, scan.ranges)
        return bool(_kernels_hits.hit_within(points, needed, ahead, TOLERANCE, BLUR, x, y, yaw, self.map.beams, ranges))

    def forget(self, pose: Pose) -> None:
        """Make the map anew of the latest scans: what was seen before may be elsewhere in a frame that drifts.

        What the robot covers when it turns stays free as far as it was seen free. Hits there become ground that was not seen:
        open to plans, but the robot does not move over it before it has looked again.
        """
        self.map = self.map.renewed(pose[:2], self._turning_room, self._goal)
        for scan in self.scans[-self._recent :]:
            self.map.insert(scan.estimate, scan.ranges, scan.movers)

    def _empty_map(self, pose: Pose) -> OccupancyMap:
        horizon = horizon_of(watching=self.watch is not None)
        seen = OccupancyMap(self.lidar, MAP_CELL, pose[:2], horizon, goal=self._goal)
        seen.take_as_free(pose[:2], self._turning_room, self._senses.world, self._senses.movers_at_start)
        return seen

    def clear_distance(self, pose: Pose, speed: float, yaw_rate: float, longest: float) -> float:
        """How far the robot can go on an arc over ground that it has seen free [m]."""
        return clear_distance(self.map, pose, speed, yaw_rate, self._footprint, longest)

    def clear_turn(self, pose: Pose, yaw_rate: float, farthest: float) -> float:
        """How far the robot can turn on the spot over ground that it has seen free [rad]."""
        return clear_turn(self.map, pose, yaw_rate, self._footprint, farthest)

    def clear_way(self, pose: Pose, twist: Twist, farthest: float, *, daring: bool = False) -> float:
        """How far the robot can go with a twist over ground that it has seen free [m]; for what is nearly a turn [rad]."""
        if abs(twist.speed) <= SHARPEST * abs(twist.yaw_rate):
            return clear_turn(self.map, pose, twist.yaw_rate, self._footprint, farthest, daring=daring)
        return clear_distance(self.map, pose, *twist, self._footprint, farthest, daring=daring)
