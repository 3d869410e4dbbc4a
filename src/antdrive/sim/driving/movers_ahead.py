"""What movers mean for routes: when a new one is due, where movers will soon be, and where they roam.

A robot without a map knows only the tracks of `antdrive.sim.driving.watching`, so the ground that movers roam grows with
what was seen of them.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

from antdrive.base import Bounds, Floats, Point, Pose
from antdrive.planners import PlanResult
from antdrive.robots import RobotSpec, TrackedPath
from antdrive.sim.driving.blocking import close_route, covered_discs
from antdrive.sim.driving.mover_gaps import NarrowGaps
from antdrive.sim.driving.parts import Others
from antdrive.sim.driving.replan_causes import OBSTRUCTED, TRAFFIC, WAITED
from antdrive.sim.driving.traffic import TrackedTraffic, Traffic, Zone
from antdrive.sim.driving.watching import Tracked
from antdrive.sim.policy import ReplanPolicy
from antdrive.worlds import Disc, Grid, World, rasterise

if TYPE_CHECKING:
    from antdrive.sim.driving.survey import Survey

COARSE = 0.25  # side of the cells on which a route is held against the ground that movers roam [m]
SLACK = (
    0.4  # the lane that is left along the outermost walls is so much wider than the robot needs: maps are crooked [m]
)
MOST = 1.0  # movers have a radius of at most this [m]


class MoversAhead:
    """When movers make a new route due, and what it keeps off."""

    def __init__(
        self,
        others: Others,
        policy: ReplanPolicy,
        goal: Point,
        grid: Grid,
        hz: int,
        traffic: Traffic | None,
    ) -> None:
        self._predictor, self._policy, self._goal, self._grid, self._hz = others, policy, goal, grid, hz
        self._traffic = traffic
        self._waiting_since = math.nan

    def look(self, tick: int, pose: Pose, waiting: bool) -> None:
        """Take note of what the robot sees in a control period."""
        if self._traffic is not None:
            self._traffic.look(tick, pose[:2])
        if not waiting:
            self.wait_anew()
        elif math.isnan(self._waiting_since):
            self._waiting_since = tick / self._hz

    def wait_anew(self) -> None:
        """Forget how long the robot has waited."""
        self._waiting_since = math.nan

    def trigger(self, tick: int, pose: Pose, tracked: TrackedPath, arc: float) -> str:
        """Why movers make a new route due now; empty if they do not."""
        policy = self._policy
        if tick / self._hz - self._waiting_since >= policy.max_wait:
            self.wait_anew()
            return WAITED
        if close_route(self.discs(tick, pose), tracked, arc, policy.obstruction_range, self._grid.inflate):
            return OBSTRUCTED
        traffic = self._traffic
        if traffic is None or not traffic.grown(self._grid.cell) or not self.heavy(tick, pose):
            return ""
        return TRAFFIC if self.zones(tick, pose, self._around(pose))[-1].crossed(tracked, arc) else ""

    def heavy(self, tick: int, pose: Pose) -> bool:
        """Whether there is so much traffic that the robot should go round the ground that movers roam."""
        return self._traffic is not None and self._traffic.rate(tick, pose[:2]) > self._policy.max_traffic

    def discs(self, tick: int, pose: Pose) -> list[Disc]:
        """What movers will cover soon; they close neither the robot's position nor the goal."""
        ends = np.array([pose[:2], self._goal])
        return covered_discs(self._predictor, tick, ends, self._policy.prediction_time, self._grid)

    def zones(self, tick: int, pose: Pose, grid: Grid) -> list[Zone]:
        """The ground that movers roam, largest first: as estimated, then as seen."""
        assert self._traffic is not None
        return self._traffic.zones(tick, pose[:2], self._goal, grid)

    def way_round(
        self, pose: Pose, zones: list[Zone], discs: list[Disc], plan: Callable[[list[Disc], Zone], PlanResult]
    ) -> tuple[PlanResult, list[Disc]] | None:
        """A plan around the first zone where it is not too long, and what it keeps off; None: all are too long."""
        reach, longest = self._policy.obstruction_range, self._policy.max_detour * math.dist(pose[:2], self._goal)
        for zone in zones:
            # Movers that are far away will have moved on: they must not close the only way to the goal.
            near = [d for d in discs if math.dist((d.x, d.y), pose[:2]) <= reach and zone.holds(d)]
            answer = plan(near, zone)
            if answer.cost <= longest:
                return answer, near + zone.discs
        return None

    def _around(self, pose: Pose) -> Grid:
        """The grid on which a route is held against the ground that movers roam."""
        return self._grid


class MoversOnMap(MoversAhead):
    """Movers among the obstacles of a given map, and the narrow gaps beside those that stand still."""

    def __init__(
        self,
        others: Others,
        policy: ReplanPolicy,
        goal: Point,
        grid: Grid,
        hz: int,
        traffic: Traffic | None,
        gaps: NarrowGaps,
    ) -> None:
        super().__init__(others, policy, goal, grid, hz, traffic)
        self._gaps = gaps

    def discs(self, tick: int, pose: Pose) -> list[Disc]:
        """What movers will cover soon, larger where the robot has waited beside one."""
        return super().discs(tick, pose) + self._gaps.discs(tick, np.array([pose[:2], self._goal]))


class MoversSeenAhead(MoversAhead):
    """Movers without a map: those that the robot tracks, around walls as far as they were seen."""

    def __init__(
        self,
        tracked: Tracked,
        survey: Survey,
        policy: ReplanPolicy,
        robot: RobotSpec,
        goal: Point,
        inflate: float,
        hz: int,
    ) -> None:
        grid = rasterise(World("measure", (0.0, 0.0, 1.0, 1.0)), COARSE, inflate)
        self._roamed = TrackedTraffic(tracked, robot, hz)
        super().__init__(tracked, policy, goal, grid, hz, self._roamed)
        self._survey = survey

    def discs(self, tick: int, pose: Pose) -> list[Disc]:
        """What movers will cover soon; they close neither the robot's position nor the goal."""
        return super().discs(tick, pose) if len(self._predictor.within_range(tick, pose[:2])) else []

    def _around(self, pose: Pose) -> Grid:
        (x, y), (gx, gy) = pose[:2], self._goal
        around = self.bounds((min(x, gx) - 1.0, min(y, gy) - 1.0, max(x, gx) + 1.0, max(y, gy) + 1.0))
        return rasterise(World("around movers", around), COARSE, self._grid.inflate)

    def zones(self, tick: int, pose: Pose, grid: Grid) -> list[Zone]:
        """The ground that movers roam, largest first: all but a lane along the outermost walls that were seen, then as seen."""
        zones = self._roamed.zones(tick, pose[:2], self._goal, grid)
        roamed, radius = self._roamed.box, self._roamed.widest(tick, pose[:2])
        lane = radius + 2 * self._grid.inflate + SLACK
        lower, upper = self._outermost()
        inner = np.concatenate((np.minimum(lower + lane, roamed[:2]), np.maximum(upper - lane, roamed[2:])))
        return [Zone(inner, radius, pose[:2], self._goal, grid), *zones]

    def bounds(self, least: Bounds) -> Bounds:
        """Bounds that hold a way round the ground that movers roam, as far as it was seen."""
        box, more = self._roamed.box, 2 * (MOST + self._grid.inflate)
        lower, upper = self._outermost()
        x0, y0 = np.floor(np.minimum(lower, box[:2] - more)).tolist()
        x1, y1 = np.ceil(np.maximum(upper, box[2:] + more)).tolist()
        return min(least[0], x0), min(least[1], y0), max(least[2], x1), max(least[3], y1)

    def _outermost(self) -> tuple[Floats, Floats]:
        """The lower left and the upper right corner of all that was hit (2,), (2,) [m]; of what movers roam if nothing was."""
        hits = self._survey.map.discs()[:, :2]
        if not len(hits):
            return self._roamed.box[:2], self._roamed.box[2:]
        return hits.min(axis=0), hits.max(axis=0)

    def without_trails(self, discs: Floats, pose: Pose) -> Floats:
        """What was hit, as discs (N, 3) [m], without what movers may have left behind where they roam.

        A mover that is as far away as ground is not seen free is no track yet, so its hits are entered in the map.
        """
        if not self._roamed.samples:
            return discs
        box = self._roamed.box
        far = np.hypot(*(discs[:, :2] - pose[:2]).T) > self._survey.map.trust
        there = ((discs[:, :2] > box[:2]) & (discs[:, :2] < box[2:])).all(axis=1)
        return np.asarray(discs[~(far & there)])
