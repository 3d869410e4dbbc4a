"""Mapless guidance: plan through the robot's own occupancy map and re-plan when the lidar hits something new.

Plans treat unknown ground as free (S. Koenig and Y. Smirnov, *Sensor-based planning with the freespace assumption*,
ICRA 1997). The speed limit does not, see `antdrive.sim.driving.stopping_constraint`.
"""

from __future__ import annotations

import dataclasses
import functools
import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from antdrive.base import Bounds, Floats, Pose
from antdrive.base.kernel_cache import clock
from antdrive.base.records import unchecked_copy
from antdrive.planners import PlanResult, PlanStatus, Query, smooth
from antdrive.robots import TrackedPath, outline_of
from antdrive.robots.control.pursuit import obstacles_around
from antdrive.robots.default_margin import mapless_margins
from antdrive.sim.driving import _kernels_hits
from antdrive.sim.driving.blockage import with_obstacles
from antdrive.sim.driving.guide import Follow, Moment, RouteGuide, Wait
from antdrive.sim.driving.movers_ahead import MoversSeenAhead
from antdrive.sim.driving.parts import Drive, table_logged
from antdrive.sim.driving.recovery import TRAIL, Recovery
from antdrive.sim.driving.route_planner import RoutePlanner, bounds_of
from antdrive.sim.driving.survey import PATIENCE, ROUTE_CHECK_STEP, RoutePoints, Survey
from antdrive.sim.policy import ReplanPolicy, Trigger
from antdrive.worlds import Disc, Grid, Route, Task, World, point_clearance, rasterise
from antdrive.worlds.world import PointWorld

GROWTH = (4.0, 16.0)  # extent of the planning area beyond start and goal; the second if no path is found [m]
#: Fractions of the margin that plans for the disc keep; the second if no route exists or it is long.
MARGINS = (1.0, 0.0)
FAIR = 1.25  # a route longer than the straight line by more than this factor is long
DETOUR = 1.15  # a route with less margin must be shorter by this factor; a turn at its beginning counts as length
CORRIDOR = 1.2  # smoothing considers obstacles within this distance of the plan, beyond the inflation [m]
SAMPLES = 0.06  # spacing of the points of a route that get speed limits and lookaheads [m]
SPARE = 0.25  # the controller knows obstacles this much beyond its longest arcs [m]
INTERVAL = 0.15  # shortest time between two plans [s]
COVERS = 1e-3  # hits this close to the robot or its goal count as map errors [m]
FORGIVING = 0.005  # arcs of a disc-shaped robot may come this much closer to hits than to mapped obstacles [m]
CORNERED = 0.1  # other shapes: additional allowance per metre by which their corners protrude [m/m]
TURNING = 0.015  # a rectangle that turns on the spot keeps this much more from hits than from known obstacles [m]
TURNING_IN = 0.1  # a robot that brakes for a rotation turns in if it then stops this far from hits [m]
SEEN = PointWorld.of("seen", (0.0, 0.0, 1.0, 1.0), np.empty((0, 3)))
LATELY = 30.0  # the ending's reason mentions failed searches up to this age [s]


class Exploration(RouteGuide):
    """Guide that plans on the occupancy map.

    Attributes:
        lost: whether the map has no path; the robot then stops
        recovery: what the robot does where it stalls
    """

    def __init__(
        self,
        planner: RoutePlanner,
        survey: Survey,
        policy: ReplanPolicy,
        movers: MoversSeenAhead | None = None,
    ) -> None:
        super().__init__(planner)
        self._movers, self.survey, self._policy = movers, survey, policy
        self._task, self._robot = planner.task, planner.robot
        self._points: RoutePoints | None = None
        self._checked = self._indexed = 0
        self._planned_at = -math.inf
        self.lost, self._failures, self._gave_up_at = False, 0, -math.inf
        self.recovery = Recovery(survey, planner.robot, planner.task.start, planner.hz)
        self._tick = 0
        self._seen: list[tuple[int, Floats]] = []
        self._known_as: tuple[tuple[Any, ...], Task] = (), planner.task

    @property
    def _may_wait(self) -> bool:  # type: ignore[override]
        """Whether the robot may stay in place: it has no path and tries again, or it makes a scan turn."""
        return self.lost or self.recovery.scan_turn is not None

    def first(self) -> tuple[Grid, PlanResult]:
        """Plan from the start on the map of the first scan. Later plans do not depend on it."""
        grid, plan = self.plan(self._task.start)
        self._routes.restart()
        return dataclasses.replace(grid, free=grid.free.copy(), moves=grid.moves.copy()), plan

    def accept(self, grid: Grid, plan: PlanResult) -> tuple[Grid, PlanResult]:
        """Check an external plan on the grid of `first`, which has the obstacles of the first scan."""
        if not plan.solved:
            return grid, plan
        return grid, self._routes.validated(Query.between(grid, self._known(self._task.start, bounds_of(grid))), plan)

    # ---- plans

    def plan(self, pose: Pose, avoided: Sequence[Disc] = ()) -> tuple[Grid, PlanResult]:
        """Plan on the map from a pose; return grid and plan.

        Where no path exists otherwise, plan with less margin, in larger bounds, and for the footprint.
        """
        straight = math.dist(pose[:2], self._task.goal)
        best: tuple[float, Grid, PlanResult] | None = None
        for outlined, growth in self._searches(pose):
            for margin in self._margins(outlined):
                task = self._known(pose, self._bounds(growth, pose))
                grid = self._grid(task, margin, outlined=outlined)
                answer = self._routes.around(task, grid, avoided)
                if answer.status is PlanStatus.INVALID:
                    return grid, answer
                cost = answer.cost + self._turn_cost(pose, grid, answer)
                if best is None or cost < best[0] / DETOUR:
                    best = cost, grid, answer
                if answer.solved and (outlined or cost <= FAIR * straight):
                    break
            assert best is not None
            if best[2].solved:
                break
        assert best is not None
        return best[1:]

    def _turn_cost(self, pose: Pose, grid: Grid, answer: PlanResult) -> float:
        """Return how far the robot could drive during the rotation in place at the beginning of a plan [m].

        Among movers it is 0, and the robot does not turn in: measured, that costs certified drives (docs/notebook/movers.md).
        """
        if self._movers is not None or not len(answer.cells):
            return 0.0
        controller, robot = self._routes.controller, self._robot
        line = grid.xy(answer.line) - pose[:2]
        far = np.hypot(line[:, 0], line[:, 1]) >= controller.lookahead_max
        x, y = line[far.argmax() if far.any() else -1]
        turn = abs(math.remainder(math.atan2(y, x) - pose[2], 2 * math.pi))
        if turn <= controller.rotate_in_place_above:
            return 0.0
        return robot.max_speed * (turn / robot.max_yaw_rate + robot.max_yaw_rate / robot.max_yaw_acceleration)

    def _searches(self, pose: Pose) -> list[tuple[bool, float]]:
        """Return the shapes to plan for, whether the footprint, and the extents of the planning area [m], in turn.

        Once the footprint led into a passage that is too narrow for the disc, plans from there are for the footprint first: a
        route of the disc begins with a move aside.
        """
        shapes = self._routes.shapes
        if self._routes.footprint_margin is not None and len(shapes) > 1:
            world = self._known(pose, self._bounds(GROWTH[0], pose)).world
            if point_clearance(world, np.array([pose[:2]]))[0] < self._robot.radius:
                shapes = shapes[::-1]
        return [(shape, growth) for shape in shapes for growth in GROWTH[: 1 if shape else 2]]

    def _margins(self, outlined: bool) -> tuple[float, ...]:
        """Return the margins to plan with, in turn [m]."""
        if outlined:
            return mapless_margins(self._routes.outline_margins, self._routes.margin)
        return tuple(share * self._routes.margin for share in MARGINS)

    def _grid(self, task: Task, margin: float, *, outlined: bool = False) -> Grid:
        """Return the grid for the disc or for the footprint."""
        if not outlined:
            return self._routes.observed(task.world, margin)
        robot = self._robot
        return rasterise(task.world, self._routes.cell, robot.radius + margin, outline_of(robot.footprint, margin))

    def _plan_around(self, pose: Pose, trigger: str) -> tuple[Grid, PlanResult, list[Disc]]:
        """Plan around tracked movers from a pose; return the grid, the plan and the discs that it avoids."""
        movers = self._movers
        if movers is None:
            return (*self.plan(pose), [])
        if movers.heavy:
            task = self._known(pose, movers.bounds(self._bounds(GROWTH[0], pose)))
            grid = self._grid(task, self._routes.margin)
            zones, soon = movers.zones(grid), movers.discs()
            around = movers.plan_around_zones(zones, soon, functools.partial(self._routes.around, task, grid))
            if around is not None:
                return (grid, *around)
        discs = movers.discs()
        if discs:
            grid, answer = self.plan(pose, discs)
            # Only for the footprint, whose detours have turns on the spot. For the disc the rule saves time on average, but
            # some waits take twice the detour, and robots stay near movers that turn back for longer.
            if answer.solved and grid.turns:
                free, speed = self.plan(pose), self._robot.max_speed
                if movers.waiting_is_quicker(trigger, speed, answer.cost, free[1].cost):
                    return (*free, [])
            if answer.solved:
                return grid, answer, discs
        return (*self.plan(pose), [])

    def route(self, grid: Grid, plan: PlanResult) -> tuple[Route, TrackedPath]:
        """Return the route of a plan, and its path for the controller."""
        return self._route(self._task.start, grid, plan)

    def _route(
        self, pose: Pose, grid: Grid, answer: PlanResult, avoided: Sequence[Disc] = ()
    ) -> tuple[Route, TrackedPath]:
        bounds = bounds_of(grid)
        task = self._known(pose, bounds)
        seen, points = task.world.discs, grid.xy(answer.line)
        self._seen.append((self._tick, seen))
        line = np.empty((len(points) + 2, 2))
        line[0], line[1:-1], line[-1] = pose[:2], points, self._task.goal
        discs = _kernels_hits.near_polyline(line, seen, grid.inflate + CORRIDOR)
        near = unchecked_copy(task, world=SEEN.among(bounds, discs))
        route = smooth(answer, grid, with_obstacles(near, avoided), kind=self._routes.smoothing)
        tracked = self._prepare(route, near.world, grid.inflate - self._robot.radius)
        self._points = RoutePoints.of(route, near.world, grid.inflate)
        return route, tracked

    def _bounds(self, growth: float, pose: Pose) -> Bounds:
        """Return bounds around start and goal, extended to a robot whose estimate drifted outside."""
        (x0, y0), (x1, y1), (x, y) = self._task.start[:2], self._task.goal, pose[:2]
        low, high = (min(x0, x1) - growth, min(y0, y1) - growth), (max(x0, x1) + growth, max(y0, y1) + growth)
        return (
            low[0] if x > low[0] else x - growth,
            low[1] if y > low[1] else y - growth,
            high[0] if x < high[0] else x + growth,
            high[1] if y < high[1] else y + growth,
        )

    def _known(self, pose: Pose, bounds: Bounds) -> Task:
        """Return a task that starts at a pose, with the map's discs as obstacles."""
        # Bounds recovered from a grid carry rounding errors.
        key = self.survey.map, len(self.survey.scans), pose, tuple(round(side, 9) for side in bounds)
        if self._known_as[0] == key:
            return self._known_as[1]
        discs = self.survey.map.discs(bounds)
        if self._movers is not None:
            discs = self._movers.without_trails(discs, pose)
        ends = np.array((pose[:2], self._task.goal))
        discs = _kernels_hits.beside(discs, ends, COVERS)  # hits that cover one of them are map errors
        known = unchecked_copy(self._task, world=SEEN.among(bounds, discs), start=pose)
        self._known_as = key, known
        return known

    def _prepare(self, route: Route, world: World, margin: float) -> TrackedPath:
        robot = self._robot
        self._indexed = -1  # the path indexes obstacles along the route; the next refresh adds those near the robot
        tracked = self._routes.prepared(route, world, margin, SAMPLES, indexed=False)
        foot, tuning = robot.footprint, tracked.tuning
        give = FORGIVING + CORNERED * (robot.radius - foot.inner_radius)
        return unchecked_copy(
            tracked,
            tuning=tuning._replace(
                lookahead_clearance=tuning.lookahead_clearance - give,
                stopping_clearance=tuning.stopping_clearance - give,
                robot_radius=tuning.robot_radius + TURNING,
                rounding=tuning.rounding + TURNING,
                turn_in_clearance=robot.radius + TURNING_IN if self._movers is None else math.inf,
            ),
        )

    # ---- the driver's queries

    def _way(self, path: TrackedPath) -> Follow:
        return Wait(path, scan_turn=self.recovery.scan_turn) if self._may_wait else super()._way(path)

    def _refreshed(self, path: TrackedPath, pose: Pose) -> TrackedPath:
        if self._indexed == self.survey.whole:
            return path
        self._indexed = self.survey.whole
        x, y, _ = pose
        near = self._routes.controller.lookahead_max + path.tuning.lookahead_clearance + SPARE
        discs = self.survey.map.discs((x - near, y - near, x + near, y + near))
        return path.with_obstacles(obstacles_around(np.array((x, y)), discs, path.obstacles.bounds))

    def trigger(self, now: Moment) -> str:
        """Return the trigger of a new route; empty if none is due."""
        t, pose, tracked, arc = now.observed.t, now.pose, now.way.path, now.before.pursuit.arc
        if self._movers is not None:
            self._movers.observe(now.waiting)
        recovery = self.recovery
        if recovery.scan_turn is not None:
            return Trigger.SCAN_TURN if recovery.scan_turn.done else ""
        if self.lost:
            return Trigger.LOST if t - self._planned_at >= INTERVAL else ""
        turns = tracked.route.turns is not None
        recovery.note_progress(t, pose, waiting=now.waiting, backwards=tracked.backwards, turns=turns)
        if tracked.route is recovery.route:
            over = tracked.length - arc < 2 * TRAIL or recovery.stalled(t)
            return (Trigger.BACKED_OFF if tracked.backwards else Trigger.MADE_ROOM) if over else ""
        if t - self._planned_at < INTERVAL:
            return ""
        if recovery.stalled(t):
            return Trigger.STALLED
        if recovery.held(t, pose):
            return Trigger.CONSTRAINED
        if self._movers is not None and t - self._planned_at >= self._policy.min_interval:
            due = self._movers.trigger(tracked, arc)
            if due:
                return due
        if self._checked == self.survey.whole:
            return ""
        self._checked = self.survey.whole
        assert self._points is not None
        path = tracked.samples.xy, tracked.samples.arc
        place, hit = self.survey.check(path, self._points, arc, int(arc / ROUTE_CHECK_STEP))
        if math.dist(place, pose[:2]) > self._policy.max_deviation:
            return Trigger.STRAYED
        return Trigger.DISCOVERED if hit else ""

    def replan(self, now: Moment, trigger: str) -> TrackedPath | None:
        """Return a new path; None if there is none, or a scan turn comes first."""
        t, pose, spent = now.observed.t, now.pose, clock()
        self._planned_at, self._tick = t, now.tick
        if trigger in (Trigger.STALLED, Trigger.CONSTRAINED, Trigger.BACKED_OFF, Trigger.MADE_ROOM, Trigger.SCAN_TURN):
            recovers, way = self._recovered(t, pose, trigger)
            if way is not None:
                self.note(t, trigger, spent(), 0, way.length, way.route.xy)
            if recovers:
                return way
        if self._failures >= PATIENCE and trigger != Trigger.SCAN_TURN:
            self._failures = 0
            self.survey.reset(pose)
        grid, plan, avoided = self._plan_around(pose, trigger)
        self.lost = not (plan.solved and len(plan.cells)) or bool(self._routes.plan_error)
        if not self.lost:
            self._failures = 0
            route, tracked = self._route(pose, grid, plan, avoided)
            self.note(t, trigger, spent(), plan.work, plan.cost, route.xy)
            return tracked
        self.note(t, trigger, spent(), plan.work)
        self._failures += 1
        self.recovery.note_rest(t, pose)
        if self._failures >= PATIENCE:
            self._gave_up_at = t
            self.recovery.begin_scan_turn(pose)
        return None

    def _recovered(self, now: float, pose: Pose, trigger: str) -> tuple[bool, TrackedPath | None]:
        """Start a recovery; return whether it replaces planning, and the path that it follows."""
        recovery = self.recovery
        if trigger == Trigger.SCAN_TURN:
            recovery.end_scan_turn(now, pose)
            return False, None
        if trigger in (Trigger.BACKED_OFF, Trigger.MADE_ROOM):
            recovery.note_rest(now, pose)
        if trigger == Trigger.STALLED:
            recovery.note_stall(now, pose)
        if (trigger != Trigger.STALLED or recovery.held_by_unknown(pose)) and recovery.begin_scan_turn(pose):
            return True, None
        if trigger == Trigger.CONSTRAINED:
            return True, None
        route = recovery.escape(pose) if trigger == Trigger.STALLED else None
        if route is None:
            return False, None
        way = self._prepare(route, SEEN.among(self._bounds(GROWTH[1], pose), np.empty((0, 3))), 0.0)
        return True, dataclasses.replace(way, backwards=recovery.backwards)

    def failure_note(self, tick: int) -> str:
        """Return a note that the latest searches found no path; empty if one did, or after `LATELY`."""
        if tick / self._hz - self._gave_up_at > LATELY:
            return ""
        return f"no way through what was seen, last at t = {self._gave_up_at:.1f} s"

    def logged(self, log: Drive, per_tick: int) -> dict[str, Any]:
        """Return the array `seen`: the discs behind each plan. `cells` is empty, since the log has no grid for them."""
        return {"seen": table_logged(self._seen, 4, log, per_tick), "cells": np.empty((0, 2), dtype=np.int32)}
