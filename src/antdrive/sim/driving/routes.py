"""Guide that follows one route."""

from __future__ import annotations

import dataclasses

from antdrive.base.caches import Keyed, bits, cached
from antdrive.planners import PlanResult, PlanStatus, TimedPlan, smooth
from antdrive.robots import TrackedPath
from antdrive.sim.driving.guide import RouteGuide, Schedule
from antdrive.sim.driving.leaving import cannot_leave, is_narrow
from antdrive.sim.driving.route_planner import RoutePlanner, by_contents
from antdrive.sim.log.streams import random_stream
from antdrive.sim.reasons import no_path_reason
from antdrive.worlds import Grid, Route


class OneRoute(RouteGuide):
    """Guide that keeps the first route. Its grid has no movers; space-time planners get their motions."""

    def first(self) -> tuple[Grid, PlanResult]:
        """Plan from the start; report no path if the start is too narrow to follow it."""
        grid, plan = self._planned()
        if plan.status is PlanStatus.NO_PATH:
            return grid, dataclasses.replace(plan, reason=no_path_reason(self._routes, grid, plan.reason, _finds_path))
        return grid, self._drivable(grid, plan)

    def _planned(self) -> tuple[Grid, PlanResult]:
        routes = self._routes
        grid = routes.chosen_grid()
        query, rng = routes.query(grid, routes.task), random_stream(routes.seed, "planner")
        return grid, routes.plan(query, rng, routes.planner_label)

    def accept(self, grid: Grid, plan: PlanResult) -> tuple[Grid, PlanResult]:
        """Check an external plan on the grid of `first`."""
        if not plan.solved:
            return grid, plan
        return grid, self._drivable(grid, self._routes.validated(self._routes.query(grid, self._routes.task), plan))

    def route(self, grid: Grid, plan: PlanResult) -> tuple[Route, TrackedPath]:
        """Return the route of a plan, and its path for the controller."""
        route, path = self._prepared(grid, plan)
        self._track(plan, route)
        return route, path

    def _track(self, plan: PlanResult, route: Route) -> None:
        """Set the schedule of a new route, among movers of known motions."""
        self.schedule = Schedule.of(plan, route) if self._routes.motions and isinstance(plan, TimedPlan) else None

    def _prepared(self, grid: Grid, plan: PlanResult) -> tuple[Route, TrackedPath]:
        routes = self._routes
        numbers = bits(plan.cost, routes.margin, 1 / routes.hz, routes.noise)
        line = plan.waypoints.tobytes() if plan.waypoints is not None else b""
        setting = type(routes.controller), repr((routes.robot, routes.controller))
        contents = by_contents(grid, routes.task)
        plan_made = plan.cells.tobytes(), line, numbers, *setting
        return _tracked(Keyed((routes, grid, plan), (*contents.key, *plan_made)), routes.smoothing)

    def _drivable(self, grid: Grid, plan: PlanResult) -> PlanResult:
        """Return the plan, or no path if the robot cannot leave its start along it."""
        routes = self._routes
        task, robot = routes.task, routes.robot
        if not plan.solved or not is_narrow(task.world, robot, task.start):
            return plan
        _, tracked = self._prepared(grid, plan)
        reason = cannot_leave(tracked, routes.controller, task.world, robot, task.start, routes.hz)
        if not reason:
            return plan
        return PlanResult(
            status=PlanStatus.NO_PATH,
            reason=reason,
            work=plan.work,
            work_unit=plan.work_unit,
            options=plan.options,
            wall_s=plan.wall_s,
        )


def _finds_path(routes: RoutePlanner) -> bool:
    """Return whether the first plan is a path that the robot can follow from its start."""
    guide = OneRoute(routes)
    return guide._drivable(*guide._planned()).solved


@cached(64)
def _tracked(asked: Keyed[tuple[RoutePlanner, Grid, PlanResult]], kind: str) -> tuple[Route, TrackedPath]:
    routes, grid, plan = asked.value
    route = smooth(plan, grid, routes.task, kind=kind)
    return route, routes.prepared(route, routes.task.world, routes.margin)
