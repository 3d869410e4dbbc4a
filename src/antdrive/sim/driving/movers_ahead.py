"""What the movers that a robot without a map follows mean for its routes: where they will soon be, and where they roam.

The robot is told nothing of them. What it knows are the tracks of `antdrive.sim.driving.watching`, so the ground that movers
roam grows with what was seen of them.
"""

from __future__ import annotations

import math

import numpy as np

from antdrive.base import Bounds, Floats, Point, Pose
from antdrive.robots import RobotSpec, TrackedPath
from antdrive.sim.driving.blocking import close_route, covered_discs
from antdrive.sim.driving.replanning import OBSTRUCTED, TRAFFIC, WAITED, ReplanPolicy
from antdrive.sim.driving.survey import Survey
from antdrive.sim.driving.traffic import TrackedTraffic, Zone
from antdrive.sim.driving.watching import TrackedPredictor
from antdrive.worlds import Disc, Grid, World, rasterise

COARSE = 0.25  # side of the cells on which a route is held against the ground that movers roam [m]
SLACK = (
    0.4  # the lane that is left along the outermost walls is so much wider than the robot needs: maps are crooked [m]
)
MOST = 1.0  # movers have a radius of at most this [m]


class MoversAhead:
    """When the movers that a robot without a map follows make a new route due, and what it keeps off."""

    def __init__(
        self,
        predictor: TrackedPredictor,
        survey: Survey,
        policy: ReplanPolicy,
        robot: RobotSpec,
        goal: Point,
        inflate: float,
        hz: int,
    ) -> None:
        self._predictor, self._survey, self._policy, self._goal = predictor, survey, policy, goal
        self._inflate, self._hz = inflate, hz
        self._traffic = TrackedTraffic(predictor, robot, hz)
        self._waiting_since = math.nan
        self._measure = rasterise(World("measure", (0.0, 0.0, 1.0, 1.0)), COARSE, inflate)

    def look(self, tick: int, pose: Pose, waiting: bool) -> None:
        """Take note of what the robot sees in a control period."""
        self._traffic.look(tick, pose[:2])
        if not waiting:
            self._waiting_since = math.nan
        elif math.isnan(self._waiting_since):
            self._waiting_since = tick / self._hz

    def trigger(self, tick: int, pose: Pose, tracked: TrackedPath, arc: float) -> str:
        """Why movers make a new route due now; empty if they do not."""
        policy = self._policy
        if tick / self._hz - self._waiting_since >= policy.max_wait:
            self._waiting_since = math.nan
            return WAITED
        if close_route(self.discs(tick, pose), tracked, arc, policy.obstruction_range, self._inflate):
            return OBSTRUCTED
        if not self._traffic.grown(COARSE) or not self.heavy(tick, pose):
            return ""
        (x, y), (gx, gy) = pose[:2], self._goal
        around = self.bounds((min(x, gx) - 1.0, min(y, gy) - 1.0, max(x, gx) + 1.0, max(y, gy) + 1.0))
        zones = self.zones(tick, pose, rasterise(World("around movers", around), COARSE, self._inflate))
        return TRAFFIC if zones[-1].crossed(tracked, arc) else ""

    def heavy(self, tick: int, pose: Pose) -> bool:
        """Whether there is so much traffic that the robot should go round the ground that movers roam."""
        return self._traffic.rate(tick, pose[:2]) > self._policy.max_traffic

    def discs(self, tick: int, pose: Pose, within: Zone | None = None) -> list[Disc]:
        """What movers will cover soon; they close neither the robot's position nor the goal."""
        if not len(self._predictor.within_range(tick, pose[:2])):
            return []
        ends = np.array([pose[:2], self._goal])
        soon = covered_discs(self._predictor, tick, ends, self._policy.prediction_time, self._measure)
        if within is None:
            return soon
        reach = self._policy.obstruction_range
        return [disc for disc in soon if math.dist((disc.x, disc.y), pose[:2]) <= reach and within.holds(disc)]

    def zones(self, tick: int, pose: Pose, grid: Grid) -> list[Zone]:
        """The ground that movers roam, largest first: all but a lane along the outermost walls that were seen, then as seen."""
        zones = self._traffic.zones(tick, pose[:2], self._goal, grid)
        roamed, radius = self._traffic.box, self._traffic.widest(tick, pose[:2])
        lane = radius + 2 * self._inflate + SLACK
        lower, upper = self._outermost()
        inner = np.concatenate((np.minimum(lower + lane, roamed[:2]), np.maximum(upper - lane, roamed[2:])))
        return [Zone(inner, radius, pose[:2], self._goal, grid), *zones]

    def bounds(self, least: Bounds) -> Bounds:
        """Bounds that hold a way round the ground that movers roam, as far as it was seen."""
        box, more = self._traffic.box, 2 * (MOST + self._inflate)
        lower, upper = self._outermost()
        x0, y0 = np.floor(np.minimum(lower, box[:2] - more)).tolist()
        x1, y1 = np.ceil(np.maximum(upper, box[2:] + more)).tolist()
        return min(least[0], x0), min(least[1], y0), max(least[2], x1), max(least[3], y1)

    def _outermost(self) -> tuple[Floats, Floats]:
        """The lower left and the upper right corner of all that was hit (2,), (2,) [m]; of what movers roam if nothing was."""
        hits = self._survey.map.discs()[:, :2]
        if not len(hits):
            return self._traffic.box[:2], self._traffic.box[2:]
        return hits.min(axis=0), hits.max(axis=0)

    def without_trails(self, discs: Floats, pose: Pose) -> Floats:
        """What was hit, as discs (N, 3) [m], without what movers may have left behind where they roam.

        A mover that is as far away as ground is not seen free is no track yet, so its hits are entered in the map.
        """
        if not self._traffic.samples:
            return discs
        box = self._traffic.box
        far = np.hypot(*(discs[:, :2] - pose[:2]).T) > self._survey.map.trust
        there = ((discs[:, :2] > box[:2]) & (discs[:, :2] < box[2:])).all(axis=1)
        return np.asarray(discs[~(far & there)])
