"""Plan and drive one scenario: the whole of antdrive on one page."""

from __future__ import annotations

import dataclasses
import math
import platform
import time
import zlib
from collections.abc import Callable
from dataclasses import dataclass, field
from importlib import metadata
from typing import Any

import numpy as np

from antdrive.planners import (
    PLANNERS,
    SMOOTHINGS,
    MaxMinDStar,
    Planner,
    PlanResult,
    PlanStatus,
    Query,
    load_planner,
    smooth,
)
from antdrive.robots import LIMITERS, Avoidance, PurePursuit, RobotSpec, Senses, load_robot
from antdrive.sim.driving.drive import Drive, drive
from antdrive.sim.driving.perception import Perception, Predictor
from antdrive.sim.driving.replanning import CellwiseMonitor, Replan, ReplanMonitor, ReplanPolicy
from antdrive.sim.log.certificate import Certificate, certify
from antdrive.sim.log.metrics import measure
from antdrive.sim.log.rollout import SCHEMA, Outcome, Rollout
from antdrive.sim.physics.engine import Engine
from antdrive.worlds import Disc, Grid, Route, Task, Trajectories, World, load_task, rasterise, task_to_dict
from antdrive.worlds.errors import FieldError


@dataclass(frozen=True, kw_only=True)
class Scenario:
    """Everything a run depends on. The same scenario gives the same rollout, bit for bit, on one machine."""

    task: Task
    planner: Planner
    robot: RobotSpec
    planner_name: str = ""  # what records call the planner; its class by default
    margin: float = 0.03  # kept free around the robot, on top of its radius [m]
    cell: float | None = None  # grid resolution [m]; None: the task's own
    smoothing: str = (
        "clearance"  # how the plan becomes a route: none, taut or clearance, see `antdrive.planners.smoothing`
    )
    seed: int = 0
    controller: PurePursuit = field(default_factory=PurePursuit)
    noise: float = 0.0  # how much of the robot's documented noise it has; 1 is all of it
    knowledge: Perception = field(default_factory=Perception)  # what the robot knows of movers
    yielding: Avoidance | None = field(default_factory=Avoidance)  # how it keeps clear of them; None: not at all
    replanning: ReplanPolicy | None = field(default_factory=ReplanPolicy)  # when it looks for a new route among them
    unseen: tuple[Disc, ...] = ()  # obstacles that neither planner nor controller know of
    time_limit: float | None = None  # simulated time allowed [s]; None: the task's, or ample for the route
    physics_hz: int = 240
    control_hz: int = 60

    def __post_init__(self) -> None:
        if not self.margin >= 0:
            raise FieldError("margin", f"must be at least 0, got {self.margin:g}")
        if self.smoothing not in SMOOTHINGS:
            raise FieldError("smoothing", f"unknown {self.smoothing!r}; choose from {', '.join(SMOOTHINGS)}")
        try:
            self.robot.noise.scaled(self.noise)
        except ValueError as error:
            raise FieldError("noise", f"{self.noise:g} times the robot's own is too much: {error}") from None
        if self.time_limit is not None and not self.time_limit > 0:
            raise FieldError("time_limit", f"must be greater than 0, got {self.time_limit:g}")

    @property
    def inflate(self) -> float:
        """What planners keep between the robot's centre and every surface [m]."""
        return self.robot.radius + self.margin

    @property
    def timed(self) -> bool:
        """Whether the planner plans in space and time, among movers."""
        return bool(self.built.movers) and getattr(self.planner, "needs_motions", False)

    @property
    def sees(self) -> Perception:
        """What the robot knows of movers: whose planner knows the motions, knows them while it drives."""
        return Perception(told="motions") if self.timed else self.knowledge

    @property
    def yields(self) -> Avoidance | None:
        """How it keeps clear of them. Whose motions are known do not turn back unforeseen; what a timed plan foresees comes
        to pass, so that only what is near is looked at again."""
        if self.yielding is None or self.sees.told != "motions":
            return self.yielding
        horizon = min(self.yielding.horizon, 1.0) if self.timed else self.yielding.horizon
        return dataclasses.replace(self.yielding, wary=0.0, horizon=horizon)

    def rng(self, purpose: str) -> np.random.Generator:
        """A stream of random numbers of its own for each purpose, from the one seed."""
        return np.random.default_rng([self.seed, zlib.crc32(purpose.encode())])

    @property
    def built(self) -> World:
        """The world as it is driven in: with what is unseen."""
        return dataclasses.replace(self.task.world, obstacles=self.task.world.obstacles + self.unseen)

    @property
    def traffic(self) -> Trajectories:
        """The world's movers as functions of time, drawn from the seed."""
        return Trajectories.of(self.built, self.task.start[:2], self.seed)

    @classmethod
    def of(
        cls, world: str, planner: str = "ants", robot: str = "turtlebot", *, options: dict[str, Any] | None = None,
        **settings: Any,
    ) -> Scenario:  # fmt: skip
        """A scenario by names: of a world and a robot (or their files) and of a planner with its options."""
        return cls(
            task=load_task(world),
            planner=load_planner(planner, **(options or {})),
            planner_name=planner,
            robot=load_robot(robot),
            **settings,
        )


@dataclass(frozen=True, eq=False)
class Run:
    """What came of a scenario: a plan and, if that found a path, a rollout with its certificate."""

    scenario: Scenario
    grid: Grid
    plan: PlanResult
    rollout: Rollout | None = None
    certificate: Certificate | None = None

    @property
    def outcome(self) -> Outcome:
        """How it ended."""
        if self.rollout is not None:
            return self.rollout.outcome
        return Outcome.NO_PATH if self.plan.status is PlanStatus.NO_PATH else Outcome.STOPPED

    @property
    def reason(self) -> str:
        """What the outcome's sentence leaves open, if anything."""
        return str(self.rollout.meta["reason"]) if self.rollout is not None else self.plan.reason

    @property
    def succeeded(self) -> bool:
        """Whether the robot stopped at the goal in time, and its log proves that nothing and it touched each other."""
        return self.outcome is Outcome.SUCCEEDED and self.certificate is not None and self.certificate.certified

    def as_dict(self) -> dict[str, Any]:
        """Plain values, for JSON."""
        s = self.scenario
        return {
            "world": s.task.world.name,
            "planner": _name(s),
            "robot": s.robot.name,
            "seed": s.seed,
            "outcome": self.outcome.name.lower(),
            "sentence": self.outcome.value,
            "reason": self.reason,
            "succeeded": self.succeeded,
            "certificate": self.certificate.as_dict() if self.certificate else None,
            "metrics": measure(self.rollout) if self.rollout else {"plan_s": self.plan.wall_s},
            "digest": self.rollout.digest if self.rollout else None,
        }


def plan(s: Scenario) -> tuple[Grid, PlanResult]:
    """Rasterise the world and plan on it. Movers are not on the grid; a planner of space and time is told their motions."""
    grid = rasterise(s.task.world, s.cell or s.task.cell, s.inflate)
    query = Query.between(grid, s.task)
    if s.timed:
        query = dataclasses.replace(query, motions=s.traffic.motions)
    return grid, s.planner.plan(query, s.rng("planner"))


def run(
    s: Scenario,
    *,
    planned: tuple[Grid, PlanResult] | None = None,
    progress: Callable[[float], None] | None = None,
) -> Run:
    """Plan and drive one scenario, or drive what `plan` planned for it; `progress` is told the fraction driven."""
    grid, answer = planned or plan(s)
    if not answer.solved:
        return Run(s, grid, answer)
    route = smooth(answer, grid, s.task, kind="none" if s.timed else s.smoothing)
    guide = s.controller.guide(route, s.task.world, s.robot, s.margin, 1 / s.control_hz, s.task.goal_tolerance)
    limit = s.time_limit or s.task.time_limit or 30.0 + 10.0 * route.length / s.robot.max_speed
    started = time.perf_counter()
    noise = s.robot.noise.scaled(s.noise)
    senses = Senses(noise, s.robot.track, 1 / s.control_hz, s.task.start, s.rng("noise")) if noise.loud else None
    traffic = s.traffic
    watch = Predictor(traffic, s.sees, s.control_hz) if traffic else None
    rerouter = None
    if watch and s.replanning:
        rerouter = (CellwiseMonitor if isinstance(s.planner, MaxMinDStar) and s.replanning.around else ReplanMonitor)(
            s.replanning, s.planner, grid, s.task, s.rng("replanner"),
            watch=watch, robot=s.robot, controller=s.controller, margin=s.margin, kind=s.smoothing, hz=s.control_hz,
        )  # fmt: skip
        rerouter.follows(answer, route)
    with Engine(s.built, s.robot, physics_hz=s.physics_hz, traffic=traffic) as engine:
        log = drive(
            engine,
            s.controller,
            guide,
            s.task,
            control_hz=s.control_hz,
            time_limit=limit,
            senses=senses,
            yielding=s.yields,
            watch=watch,
            rerouter=rerouter,
            progress=progress,
        )
    rollout = _record(
        s, grid, answer, route, log, rerouter.log if rerouter else [], limit, time.perf_counter() - started
    )
    return Run(s, grid, answer, rollout, certify(rollout))


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
    task = task_to_dict(s.task)
    known = len(s.task.world.obstacles)
    task["obstacles"] += [dataclasses.asdict(disc) for disc in s.unseen]
    query = Query.between(grid, s.task)
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
        route=route.xy,
        cells=answer.cells,
        meta={
            "schema": SCHEMA,
            "task": task,
            "unseen": list(range(known, known + len(s.unseen))),
            "planner": {"name": _name(s), "options": _plain(answer.options)},
            "plan": {
                "status": answer.status.name.lower(),
                "cost_m": answer.cost,
                "length_m": answer.line_length,
                "grid_optimum_m": PLANNERS["astar"].plan(query, s.rng("optimum")).cost,
                "euclidean_optimum_m": PLANNERS["tangent"].plan(query, s.rng("optimum")).line_length,
                "work": answer.work,
                "work_unit": answer.work_unit,
            },
            "robot": dataclasses.asdict(s.robot),
            "controller": {"name": type(s.controller).__name__, **dataclasses.asdict(s.controller)},
            **(_among_movers(s, replans) if s.built.movers else {}),
            "limiters": list(LIMITERS),
            "route": {"asked": s.smoothing, "kind": route.kind, "note": route.note},
            "noise": s.noise,
            "margin": s.margin,
            "inflate": s.inflate,
            "cell": grid.cell,
            "seed": s.seed,
            "rows": "physics",
            "physics_hz": s.physics_hz,
            "control_hz": s.control_hz,
            "time_limit": limit,
            "outcome": log.outcome.name.lower(),
            "reason": log.reason,
            "versions": versions(),
            "times": {"plan_s": answer.wall_s, "drive_wall_s": wall, **_replan_times(replans)},
        },
    )


def _among_movers(s: Scenario, replans: list[Replan]) -> dict[str, Any]:
    """What records tell of a drive among movers."""
    sees, yields = s.sees, s.yields
    return {
        "knowledge": {"told": sees.told, "reach_m": sees.reach if math.isfinite(sees.reach) else None},
        "yielding": dataclasses.asdict(yields) if yields else None,
        "replanning": dataclasses.asdict(s.replanning) if s.replanning else None,
        "replans": [replan.as_dict() for replan in replans],
    }


def _replan_times(replans: list[Replan]) -> dict[str, list[float]]:
    return {"replans_s": [replan.wall_s for replan in replans]} if replans else {}


def versions() -> dict[str, str]:
    """What a run was made with."""
    packages = ("antdrive", "numpy", "pybullet", "numba")
    return {"python": platform.python_version(), **{name: metadata.version(name) for name in packages}}


def _name(s: Scenario) -> str:
    return s.planner_name or type(s.planner).__name__


def _plain(options: Any) -> dict[str, Any]:
    """Planner options as JSON can hold them."""
    return {k: v if isinstance(v, bool | int | float | str | None) else str(v) for k, v in dict(options).items()}
