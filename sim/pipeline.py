"""Plan and drive one scenario: the whole of antdrive on one page."""

from __future__ import annotations

import dataclasses
import math
import os
import platform
import time
import zlib
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from importlib import metadata
from typing import Any

import numpy as np

from antdrive.planners import (
    PLANNERS,
    SMOOTHINGS,
    Planner,
    PlanResult,
    PlanStatus,
    Query,
    load_planner,
    smooth,
)
from antdrive.robots import LIMITERS, Avoidance, NoiseModel, PurePursuit, RobotSpec, load_robot
from antdrive.sim.driving.cellwise import monitor_class
from antdrive.sim.driving.drive import drive
from antdrive.sim.driving.perception import Perception, Predictor
from antdrive.sim.driving.recorder import Drive
from antdrive.sim.driving.replanning import Replan, ReplanMonitor, ReplanPolicy
from antdrive.sim.log.certificate import Certificate, certify
from antdrive.sim.log.metrics import METRICS, measure
from antdrive.sim.log.rollout import SCHEMA, Outcome, Rollout
from antdrive.sim.physics.engine import Engine
from antdrive.worlds import Disc, Grid, Route, Task, Trajectories, World, load_task, rasterise
from antdrive.worlds.drawing import LINE, card, world_svg
from antdrive.worlds.errors import FieldError

CONTROLLER, PERCEPTION, AVOIDANCE, REPLANNING = PurePursuit(), Perception(), Avoidance(), ReplanPolicy()
ROUTE_COLOUR = "#182242"  # of routes in notebooks


@dataclass(frozen=True, kw_only=True)
class Scenario:
    """Everything a run depends on. The same scenario gives the same rollout, bit for bit, on one machine.

    Attributes:
        task: the world, the start and the goal
        planner: finds the path
        robot: drives it
        planner_name: what records call the planner; empty: its class
        margin: distance kept free around the robot, on top of its radius [m]
        cell: grid resolution [m]; None: the task's own
        smoothing: how the plan becomes a route: none, taut or clearance, see `antdrive.planners.smooth`
        seed: of all random numbers
        controller: follows the route
        noise: the share of the robot's documented noise in sensing and acting; 0: none, 1: all of it
        perception: what the robot perceives of movers
        avoidance: how the robot avoids movers; None: not at all
        replanning: when the robot looks for a new route among movers; None: never
        unseen: obstacles that neither the planner nor the controller knows of
        time_limit: simulated time after which the drive ends [s]; None: the task's, or ample for the route
        physics_hz: physics steps per simulated second
        control_hz: control periods per simulated second; must divide `physics_hz`

    Raises:
        ValueError: a setting is out of range.
    """

    task: Task
    planner: Planner
    robot: RobotSpec
    planner_name: str = ""
    margin: float = 0.03
    cell: float | None = None
    smoothing: str = "clearance"
    seed: int = 0
    controller: PurePursuit = CONTROLLER
    noise: float = 0.0
    perception: Perception = PERCEPTION
    avoidance: Avoidance | None = AVOIDANCE
    replanning: ReplanPolicy | None = REPLANNING
    unseen: tuple[Disc, ...] = ()
    time_limit: float | None = None
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

    @classmethod
    def of(
        cls,
        world: str | os.PathLike[str] | Task,
        planner: str | Planner = "ants",
        robot: str | os.PathLike[str] | RobotSpec = "turtlebot",
        *,
        options: Mapping[str, Any] | None = None,
        margin: float = 0.03,
        cell: float | None = None,
        smoothing: str = "clearance",
        seed: int = 0,
        controller: PurePursuit = CONTROLLER,
        noise: float = 0.0,
        perception: Perception = PERCEPTION,
        avoidance: Avoidance | None = AVOIDANCE,
        replanning: ReplanPolicy | None = REPLANNING,
        unseen: tuple[Disc, ...] = (),
        time_limit: float | None = None,
        physics_hz: int = 240,
        control_hz: int = 60,
    ) -> Scenario:
        """A scenario from names, files or objects.

        >>> Scenario.of("forest", "aco-han", "jackal", options={"ants": 30}, noise=1.0, seed=2)

        The settings margin, cell, smoothing, seed, controller, noise, perception, avoidance, replanning,
        unseen, time_limit, physics_hz and control_hz are the fields of `Scenario`, which describes them.

        Args:
            world: a world of the catalogue, a world file, or a task
            planner: a planner's name, or a planner
            robot: a robot of the catalogue, a robot file, or a robot
            options: options of a planner that is given by name

        Raises:
            InputError: there is no such world, planner, option or robot, or a file is wrong.
            ValueError: a setting is out of range, or `options` are given for a planner object.
        """
        if not isinstance(planner, str) and options:
            raise ValueError("options: need a planner's name; set the options of a planner object itself")
        return cls(
            task=world if isinstance(world, Task) else load_task(world),
            planner=load_planner(planner, **(options or {})) if isinstance(planner, str) else planner,
            planner_name=planner if isinstance(planner, str) else "",
            robot=robot if isinstance(robot, RobotSpec) else load_robot(robot),
            margin=margin,
            cell=cell,
            smoothing=smoothing,
            seed=seed,
            controller=controller,
            noise=noise,
            perception=perception,
            avoidance=avoidance,
            replanning=replanning,
            unseen=unseen,
            time_limit=time_limit,
            physics_hz=physics_hz,
            control_hz=control_hz,
        )

    @property
    def inflate(self) -> float:
        """The distance that planners keep between the robot's centre and every surface [m]."""
        return self.robot.radius + self.margin

    @property
    def driven_world(self) -> World:
        """The world that the robot drives in: the task's world with the unseen obstacles."""
        return dataclasses.replace(self.task.world, obstacles=self.task.world.obstacles + self.unseen)

    @property
    def trajectories(self) -> Trajectories:
        """The motions of the world's movers, drawn from the seed."""
        return Trajectories.of(self.driven_world, self.task.start[:2], self.seed)

    @property
    def timed(self) -> bool:
        """Whether the planner plans in space and time, among movers."""
        return bool(self.driven_world.movers) and capabilities_of(self.planner).needs_motions

    @property
    def effective_perception(self) -> Perception:
        """What the robot perceives of movers: their motions, if the planner is given them."""
        return Perception(kind="motions") if self.timed else self.perception

    @property
    def effective_avoidance(self) -> Avoidance | None:
        """How the robot avoids movers, given what it knows of them.

        Movers whose motions are known do not turn back unexpectedly, so reversals are not considered. A
        timed plan has avoided the movers already, so the horizon is short.
        """
        if self.avoidance is None or self.effective_perception.kind != "motions":
            return self.avoidance
        horizon = min(self.avoidance.horizon, 1.0) if self.timed else self.avoidance.horizon
        return dataclasses.replace(self.avoidance, reversal_weight=0.0, horizon=horizon)

    def rng(self, purpose: str) -> np.random.Generator:
        """A random stream from the seed; every `purpose` has its own, so that one does not change another."""
        return np.random.default_rng([self.seed, zlib.crc32(purpose.encode())])

    def _repr_html_(self) -> str:
        task = self.task
        facts = {
            "planner": _name(self),
            "robot": self.robot.name,
            "smoothing": self.smoothing,
            "margin": f"{self.margin:g} m",
            "noise": f"{self.noise:g}",
            "seed": self.seed,
        }
        if self.driven_world.movers:
            facts["movers"] = len(self.driven_world.movers)
        picture = world_svg(
            self.driven_world.bounds, self.driven_world.discs, start=task.start, goal=(*task.goal, task.goal_tolerance)
        )
        return card(picture, task.world.name, facts)


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
        return Outcome.NO_PATH if self.plan.status is PlanStatus.NO_PATH else Outcome.STOPPED

    @property
    def reason(self) -> str:
        """What the outcome's sentence leaves open; may be empty."""
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
            raise ValueError(f"metric: unknown {name!r}; choose from {', '.join(METRICS)}")
        return METRICS[name](rollout)

    def _driven(self) -> Rollout:
        if self.rollout is None:
            reason = f": {self.reason}" if self.reason else ""
            raise ValueError(f"no rollout: planning ended with {self.outcome.key}{reason}")
        return self.rollout

    def as_dict(self) -> dict[str, Any]:
        """Plain values, for JSON."""
        s = self.scenario
        return {
            "world": s.task.world.name,
            "planner": s.planner_label,
            "robot": s.robot.name,
            "seed": s.seed,
            "outcome": self.outcome.key,
            "sentence": self.outcome.value,
            "reason": self.reason,
            "succeeded": self.succeeded,
            "certificate": self.certificate.as_dict() if self.certificate else None,
            "metrics": measure(self.rollout) if self.rollout else {"plan_s": self.plan.wall_s},
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
        picture = world_svg(s.driven_world.bounds, s.driven_world.discs, start=task.start, goal=goal, lines=lines)
        return card(picture, f"{task.world.name}: {self.outcome.value}", facts)


def plan(s: Scenario) -> tuple[Grid, PlanResult]:
    """Rasterise the world of a scenario and plan on it; the grid and the planner's answer.

    Movers are not on the grid. A planner in space and time is given their motions.
    """
    grid = rasterise(s.task.world, s.cell or s.task.cell, s.inflate)
    query = Query.between(grid, s.task)
    if s.timed:
        query = dataclasses.replace(query, motions=s.trajectories.motions)
    return grid, s.planner.plan(query, s.rng("planner"))


def run(
    s: Scenario,
    *,
    planned: tuple[Grid, PlanResult] | None = None,
    progress: Callable[[float], None] | None = None,
) -> Run:
    """Plan and drive one scenario.

    Args:
        s: the scenario
        planned: what `plan` returned for the scenario; None: plan first
        progress: is called with the fraction of the route that is done
    """
    grid, answer = planned or plan(s)
    if not answer.solved:
        return Run(s, grid, answer)
    route = smooth(answer, grid, s.task, kind="none" if s.timed else s.smoothing)
    tracked = s.controller.prepare(route, s.task.world, s.robot, s.margin, 1 / s.control_hz, s.task.goal_tolerance)
    limit = s.time_limit or s.task.time_limit or 30.0 + 10.0 * route.length / s.robot.max_speed
    started = time.perf_counter()
    noise = s.robot.noise.scaled(s.noise)
    noise_model = (
        NoiseModel(noise, s.robot.track, 1 / s.control_hz, s.task.start, s.rng("noise")) if noise.nonzero else None
    )
    trajectories = s.trajectories
    predictor = Predictor(trajectories, s.effective_perception, s.control_hz) if trajectories else None
    monitor = _monitor(s, grid, predictor)
    if monitor:
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
            progress=progress,
        )
    rollout = _record(s, grid, answer, route, log, monitor.log if monitor else [], limit, time.perf_counter() - started)
    return Run(s, grid, answer, rollout, certify(rollout))


def _monitor(s: Scenario, grid: Grid, predictor: Predictor | None) -> ReplanMonitor | None:
    """What finds new routes during the drive; None without movers or where the scenario says never."""
    if predictor is None or s.replanning is None:
        return None
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
    )


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
            "planner": {"name": s.planner_label, "options": _plain(answer.options)},
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
            **(_among_movers(s, replans) if s.driven_world.movers else {}),
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
            "outcome": log.outcome.key,
            "reason": log.reason,
            "versions": versions(),
            "times": {"plan_s": answer.wall_s, "drive_wall_s": wall, **_replan_times(replans)},
        },
    )


def _among_movers(s: Scenario, replans: list[Replan]) -> dict[str, Any]:
    """What the record holds of a drive among movers."""
    sees, yields = s.effective_perception, s.effective_avoidance
    return {
        "knowledge": {"told": sees.kind, "reach_m": sees.range if math.isfinite(sees.range) else None},
        "yielding": dataclasses.asdict(yields) if yields else None,
        "replanning": dataclasses.asdict(s.replanning) if s.replanning else None,
        "replans": [replan.as_dict() for replan in replans],
    }


def _replan_times(replans: list[Replan]) -> dict[str, list[float]]:
    return {"replans_s": [replan.wall_s for replan in replans]} if replans else {}


def versions() -> dict[str, str]:
    """The versions of Python and of the packages that a run depends on."""
    packages = ("antdrive", "numpy", "pybullet", "numba")
    return {"python": platform.python_version(), **{name: metadata.version(name) for name in packages}}


def _name(s: Scenario) -> str:
    return s.planner_name or type(s.planner).__name__


def _plain(options: Any) -> dict[str, Any]:
    """Planner options as JSON can hold them."""
    return {k: v if isinstance(v, bool | int | float | str | None) else str(v) for k, v in dict(options).items()}
