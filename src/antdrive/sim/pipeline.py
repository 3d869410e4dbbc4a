"""Plan and drive one scenario: every step from the grid to the certificate."""

from __future__ import annotations

import contextlib
import dataclasses
import functools
import platform
import time
from collections.abc import Callable
from dataclasses import dataclass
from importlib import metadata
from typing import Any

import numpy as np

from antdrive.base.errors import FieldError
from antdrive.planners import (
    PLANNERS,
    GridPlanner,
    PlanResult,
    PlanStatus,
    Query,
    ask,
    checked,
    smooth,
)
from antdrive.robots import LIMITERS, TrackedPath
from antdrive.sim.driving.cellwise import monitor_class
from antdrive.sim.driving.drive import drive
from antdrive.sim.driving.driver import EXPLORING_LIMITERS
from antdrive.sim.driving.leaving import cannot_leave, is_narrow
from antdrive.sim.driving.localising import noise_model_of
from antdrive.sim.driving.perception import Predictor
from antdrive.sim.driving.recorder import Drive
from antdrive.sim.driving.replanning import OBSTRUCTED, Replan, ReplanMonitor
from antdrive.sim.log.certificate import Certificate, certify
from antdrive.sim.log.metrics import METRICS, measure
from antdrive.sim.log.outcome import Outcome
from antdrive.sim.log.record import (
    ComponentRecord,
    DriveRecord,
    MarginRecord,
    PerceptionRecord,
    PlanRecord,
    ReplanRecord,
    SmoothingRecord,
    TimesRecord,
    finite_or_none,
    settings_of,
)
from antdrive.sim.log.rollout import Rollout
from antdrive.sim.log.sights import passed
from antdrive.sim.log.streams import random_stream
from antdrive.sim.physics.engine import Engine
from antdrive.sim.reasons import no_path_reason
from antdrive.sim.scenario import Scenario
from antdrive.sim.unknown import caution_of, exploration_of, lookout_of, predictor_of
from antdrive.worlds import Cruising, Disc, Grid, Route, Task, World, rasterise
from antdrive.worlds.drawing import LINE, card, world_svg
from antdrive.worlds.reuse import Keyed, bits, by_geometry, reused

ROUTE_COLOUR = "#182242"  # of routes in notebooks
ENDED_BY = {
    PlanStatus.NO_PATH: Outcome.NO_PATH,
    PlanStatus.STOPPED: Outcome.STOPPED,
    PlanStatus.INVALID: Outcome.INVALID_PLAN,
}


@dataclass(frozen=True, eq=False)
class Run:
    """The result of a scenario: a plan and, if the planner found a path, a rollout with its certificate.

    Attributes:
        scenario: what was planned and driven
        grid: the grid that was planned on
        plan: the planner's answer
        rollout: the log of the drive; None if planning found no path
        certificate: whether the log proves that nothing was touched; None without a rollout
    """

    scenario: Scenario
    grid: Grid
    plan: PlanResult
    rollout: Rollout | None = None
    certificate: Certificate | None = None

    @property
    def outcome(self) -> Outcome:
        """How the run ended."""
        if self.rollout is not None:
            return self.rollout.outcome
        return ENDED_BY[self.plan.status]

    @property
    def reason(self) -> str:
        """Details that the outcome's sentence leaves out; may be empty."""
        return self.rollout.record.reason if self.rollout is not None else self.plan.reason

    @property
    def succeeded(self) -> bool:
        """Whether the robot stopped at the goal in time and its log proves that nothing was touched."""
        return self.outcome is Outcome.SUCCEEDED and self.certificate is not None and self.certificate.certified

    @property
    def metrics(self) -> dict[str, float]:
        """Every metric of the drive by name; `METRICS` defines them.

        Raises:
            ValueError: the run has no rollout, because planning found no path.
        """
        return measure(self._driven())

    def metric(self, name: str) -> float:
        """One metric of the drive, such as `run.metric("spl")`.

        Raises:
            ValueError: the run has no rollout, because planning found no path; or there is no such metric.
        """
        rollout = self._driven()
        if name not in METRICS:
            raise FieldError("metric", f"unknown {name!r}; choose from {', '.join(METRICS)}")
        return METRICS[name](rollout)

    def _driven(self) -> Rollout:
        if self.rollout is None:
            reason = f": {self.reason}" if self.reason else ""
            raise ValueError(f"no rollout: planning ended with {self.outcome.key}{reason}")
        return self.rollout

    def as_dict(self) -> dict[str, Any]:
        """Plain values, for JSON; `docs/reference/rollout-format.md` lists the keys."""
        log = self.rollout
        options = settings_of(self.plan.options) if log is None else log.record.planner.settings
        return {
            **self.scenario.as_dict(),
            **({"options": dict(options)} if options else {}),
            "outcome": self.outcome.key,
            "sentence": self.outcome.value,
            "reason": self.reason,
            "succeeded": self.succeeded,
            "certificate": self.certificate.as_dict() if self.certificate else None,
            "metrics": measure(self.rollout) if self.rollout else {"plan_s": self.plan.wall_s},
            **({"sights": [sight.as_dict() for sight in passed(log)]} if log is not None and len(log.scans) else {}),
            "digest": self.rollout.digest if self.rollout else None,
        }

    def _repr_html_(self) -> str:
        s = self.scenario
        task = s.task
        facts: dict[str, object] = {"planner": s.planner_label, "robot": s.robot.name}
        lines = []
        if self.rollout is not None:
            lines = [(self.rollout.route, ROUTE_COLOUR, True), (self.rollout.pose[::12, :2], LINE, False)]
            facts["time"] = f"{self.rollout.t[-1]:.1f} s"
            facts["least clearance"] = f"{self.rollout.clearance.min():.3f} m"
            facts["certified"] = "yes" if self.certificate and self.certificate.certified else "no"
        if self.reason:
            facts["reason"] = self.reason
        goal = (*task.goal, task.goal_tolerance)
        world = s.driven_world
        movers = world.ways(task.start[:2], s.seed)
        picture = world_svg(world.bounds, world.discs, start=task.start, goal=goal, lines=lines, movers=movers)
        return card(picture, f"{task.world.name}: {self.outcome.value}", facts)


def plan(s: Scenario) -> tuple[Grid, PlanResult]:
    """Rasterise the world of a scenario and plan on it; the grid and the planner's answer, checked.

    Movers are not on the grid. A planner in space and time is given their motions. A wrong answer is replaced by one
    without a path, whose status is `INVALID` and whose reason says what is wrong. If the robot has too little room at the
    start to get away along the path, the answer is `NO_PATH` with the reason.

    Raises:
        PlannerError: the planner raised something, or returned something that is no `PlanResult`.
    """
    if s.exploring:
        return exploration_of(s).plan(s.task.start)
    grid = _grid(by_geometry(s.task.world), s.cell or s.task.cell, s.inflate)
    query = _query(s, grid)
    answer = checked(query, ask(s.planner, query, s.rng("planner"), s.planner_label))
    if answer.status is PlanStatus.NO_PATH:
        return grid, dataclasses.replace(answer, reason=no_path_reason(s, grid, answer.reason))
    return grid, _drivable(s, grid, answer)


@reused(16)
def _grid(world: Keyed[World], cell: float, inflate: float) -> Grid:
    return rasterise(world.value, cell, inflate)


def _drivable(s: Scenario, grid: Grid, answer: PlanResult) -> PlanResult:
    """The answer, without its path if the robot cannot get away from its start along it."""
    world, start = s.task.world, s.task.start
    if not answer.solved or not is_narrow(world, s.robot, start):
        return answer
    _, tracked = _tracked(s, grid, answer)
    reason = cannot_leave(tracked, s.controller, world, s.robot, start, s.control_hz)
    if not reason:
        return answer
    return PlanResult(
        status=PlanStatus.NO_PATH,
        reason=reason,
        work=answer.work,
        work_unit=answer.work_unit,
        options=answer.options,
        wall_s=answer.wall_s,
    )


def _tracked(s: Scenario, grid: Grid, answer: PlanResult) -> tuple[Route, TrackedPath]:
    """The route of a plan, and the same prepared for the controller."""
    numbers = bits(answer.cost, s.margin, 1 / s.control_hz)
    line = answer.waypoints.tobytes() if answer.waypoints is not None else b""
    plan_made = answer.cells.tobytes(), line, numbers, type(s.controller), repr((s.robot, s.controller))
    contents = _by_contents(grid, s.task)
    kind = "none" if s.timed else s.smoothing
    return _tracked_plan(Keyed((s, grid, answer), (*contents.key, *plan_made)), kind)


@reused(64)
def _tracked_plan(asked: Keyed[tuple[Scenario, Grid, PlanResult]], kind: str) -> tuple[Route, TrackedPath]:
    s, grid, answer = asked.value
    route = smooth(answer, grid, s.task, kind=kind)
    period, tolerance = 1 / s.control_hz, s.task.goal_tolerance
    return route, s.controller.prepare(route, s.task.world, s.robot, s.margin, period, tolerance)


def _query(s: Scenario, grid: Grid) -> Query:
    query = Query.between(grid, s.task)
    return dataclasses.replace(query, motions=s.trajectories.motions) if s.timed else query


def run(
    s: Scenario,
    *,
    planned: tuple[Grid, PlanResult] | None = None,
    progress: Callable[[float], None] | None = None,
) -> Run:
    """Plan and drive one scenario.

    Args:
        s: the scenario
        planned: what `plan` returned for the scenario, or a plan of one's own on that grid, which is checked; None: plan
            first
        progress: is called with the fraction of the route that is done

    Raises:
        PlannerError: the planner raised something, or returned something that is no `PlanResult`.
    """
    grid, answer = planned or plan(s)
    if planned and answer.status is not PlanStatus.INVALID and not s.exploring:
        answer = _drivable(s, grid, checked(_query(s, grid), answer))
    if not answer.solved:
        return Run(s, grid, answer)
    exploration = exploration_of(s) if s.exploring else None
    route, tracked = exploration.route(s.task.start, grid, answer) if exploration else _tracked(s, grid, answer)
    limit = s.time_limit or s.task.time_limit or 30.0 + 10.0 * route.length / s.robot.max_speed
    _load_replanning(s)
    started = time.perf_counter()
    noise_model = noise_model_of(s.localisation, s.robot, s.noise, s.odometry, 1 / s.control_hz, s.task.start, s.seed)
    trajectories = s.trajectories
    lookout = lookout_of(s)
    watch = exploration.survey.watch if exploration else lookout.watch if lookout else None
    predictor = predictor_of(s, watch)
    monitor = exploration or _monitor(s, grid, predictor)
    if isinstance(monitor, ReplanMonitor):
        monitor.track(answer, route)
    with Engine(s.driven_world, s.robot, physics_hz=s.physics_hz, trajectories=trajectories) as engine:
        log = drive(
            engine,
            s.controller,
            tracked,
            s.task,
            control_hz=s.control_hz,
            time_limit=limit,
            noise_model=noise_model,
            avoidance=s.effective_avoidance,
            predictor=predictor,
            monitor=monitor,
            caution=caution_of(s, exploration) if exploration else None,
            lookout=lookout,
            progress=progress,
        )
    wall = time.perf_counter() - started
    rollout = _record(s, grid, answer, route, log, monitor.log if monitor else [], limit, wall)
    per_tick, rows = s.physics_hz // s.control_hz, len(log.t)
    if scanning := exploration or lookout:
        rollout = dataclasses.replace(rollout, **scanning.logged(per_tick, rows))
    if watch:
        rollout = dataclasses.replace(rollout, tracks=watch.logged(per_tick, rows))
    return Run(s, grid, answer, rollout, certify(rollout))


def _monitor(s: Scenario, grid: Grid, predictor: Predictor | None) -> ReplanMonitor | None:
    """The monitor that finds new routes during the drive; None where no movers are predicted or without a replanning policy."""
    if predictor is None or s.replanning is None:
        return None
    avoidance = s.effective_avoidance
    return monitor_class(s.planner, s.replanning)(
        s.replanning,
        s.planner,
        grid,
        s.task,
        s.rng("replanner"),
        predictor=predictor,
        robot=s.robot,
        controller=s.controller,
        margin=s.margin,
        smoothing=s.smoothing,
        hz=s.control_hz,
        keeps=s.robot.radius + avoidance.min_clearance if avoidance else 0.0,
    )


_rehearsed: set[str] = set()  # how replanning has been rehearsed in this process


def _load_replanning(s: Scenario) -> None:
    """Replan twice in a tiny world, once per process and planner, so that the times of replans hold no loading of kernels."""
    if not s.driven_world.movers or s.replanning is None or not isinstance(s.planner, GridPlanner):
        return
    planner = s.planner.rehearsal()
    key = f"{type(planner).__module__}.{planner!r} {s.smoothing} {s.effective_perception.kind} {s.replanning}"
    if key in _rehearsed:
        return
    _rehearsed.add(key)
    unit, hz = s.inflate, s.control_hz
    mover = Cruising(radius=unit, position=(8 * unit, 11 * unit), velocity=(0.1 * unit, 0.0))
    world = World("tiny", (0.0, 0.0, 24 * unit, 24 * unit), (Disc(12 * unit, 12 * unit, 2 * unit),), movers=(mover,))
    task = Task(world, (4 * unit, 4 * unit, 0.0), (20 * unit, 20 * unit), goal_tolerance=unit, cell=unit)
    with contextlib.suppress(Exception):  # a planner that fails here fails where it is timed
        tiny = dataclasses.replace(s, task=task, planner=planner, cell=None, unseen=())
        grid, answer = plan(tiny)
        monitor = _monitor(tiny, grid, Predictor(tiny.trajectories, tiny.effective_perception, hz))
        if monitor is not None and answer.solved:
            monitor.track(answer, _tracked(tiny, grid, answer)[0])
            for tick in (0, 5 * hz):
                monitor.replan(tick, task.start, OBSTRUCTED)


def _record(
    s: Scenario,
    grid: Grid,
    answer: PlanResult,
    route: Route,
    log: Drive,
    replans: list[Replan],
    limit: float,
    wall: float,
) -> Rollout:
    """The rollout of a drive: its arrays, and the record of what it came from."""
    perception, avoidance, among_movers = s.effective_perception, s.effective_avoidance, s.among_movers
    replans_there = among_movers or s.exploring
    record = DriveRecord(
        task=s.task,
        unseen=s.unseen,
        seed=s.seed,
        planner=ComponentRecord(name=s.planner_label, settings=settings_of(answer.options)),
        plan=_plan_record(s, grid, answer),
        robot=s.robot,
        controller=ComponentRecord(name=type(s.controller).__name__, settings=settings_of(s.controller)),
        smoothing=SmoothingRecord(asked=s.smoothing, made=route.kind, note=route.note),
        perception=PerceptionRecord(kind=perception.kind, range_m=finite_or_none(perception.range))
        if among_movers
        else None,
        avoidance=settings_of(avoidance) if among_movers and avoidance else None,
        replanning=settings_of(s.replanning) if replans_there and s.replanning else None,
        replans=tuple(_replan_record(replan) for replan in replans),
        limiters=EXPLORING_LIMITERS if s.exploring else LIMITERS,
        noise=s.noise,
        margin=s.margin,
        margin_choice=_margin_record(s),
        sensing=s.sensing,
        inflate=s.inflate,
        cell=grid.cell,
        physics_hz=s.physics_hz,
        control_hz=s.control_hz,
        time_limit=limit,
        outcome=log.outcome,
        reason=log.reason,
        versions=versions(),
        times=TimesRecord(
            plan_s=answer.wall_s, drive_wall_s=wall, replans_s=tuple(replan.wall_s for replan in replans)
        ),
    )
    return Rollout(
        t=log.t,
        pose=log.pose,
        twist=log.twist,
        command=log.command,
        clearance=log.clearance,
        limiter=log.limiter,
        movers=log.movers,
        contacts=log.contacts,
        estimate=log.estimate,
        actuated=log.actuated,
        route=route.xy,
        cells=answer.cells if not s.exploring else answer.cells[:0],  # they lie on the grid of what was seen
        record=record,
    )


def _plan_record(s: Scenario, grid: Grid, answer: PlanResult) -> PlanRecord:
    if s.exploring:  # the shortest ways are those of the world as it is
        grid = _grid(by_geometry(s.task.world), grid.cell, s.inflate)
    grid_optimum, euclidean_optimum = _optima(_by_contents(grid, s.task))
    return PlanRecord(
        cost_m=finite_or_none(answer.cost),
        length_m=answer.line_length,
        grid_optimum_m=grid_optimum,
        euclidean_optimum_m=euclidean_optimum,
        work=answer.work,
        work_unit=answer.work_unit,
    )


def _by_contents(grid: Grid, task: Task) -> Keyed[tuple[Grid, Task]]:
    """A grid and a task, equal to others whose cells, numbers, walls and standing cylinders have the same bits."""
    numbers = bits(grid.cell, *grid.origin, grid.inflate, *task.start, *task.goal, task.goal_tolerance)
    cells = grid.shape, grid.free.tobytes(), grid.moves.tobytes()
    return Keyed((grid, task), (numbers, cells, by_geometry(task.world)))


@reused(64)
def _optima(asked: Keyed[tuple[Grid, Task]]) -> tuple[float | None, float | None]:
    """The lengths of the shortest path on the grid and of that among the inflated discs [m]; both searches draw nothing."""
    query, rng = Query.between(*asked.value), random_stream(0, "optimum")
    on_grid, free = PLANNERS["astar"].plan(query, rng), PLANNERS["tangent"].plan(query, rng)
    return finite_or_none(on_grid.cost), finite_or_none(free.line_length)


def _margin_record(s: Scenario) -> MarginRecord | None:
    chosen = s.chosen
    if chosen is None:
        return None
    return MarginRecord(
        loss_m=chosen.loss, reserve_m=chosen.reserve, probability=chosen.probability, drives=chosen.drives
    )


def _replan_record(replan: Replan) -> ReplanRecord:
    return ReplanRecord(
        t=replan.t,
        trigger=replan.trigger,
        solved=replan.solved,
        cost_m=finite_or_none(replan.cost),
        work=replan.work,
        route=tuple((x, y) for x, y in np.round(replan.route, 4).tolist()),
    )


def versions() -> dict[str, str]:
    """The versions of Python and of the packages that a run depends on."""
    return dict(_versions())


@functools.cache
def _versions() -> dict[str, str]:
    packages = ("antdrive", "numpy", "pybullet", "numba")
    return {"python": platform.python_version(), **{name: metadata.version(name) for name in packages}}
