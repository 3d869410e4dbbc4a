"""A scenario: everything that a run depends on."""

from __future__ import annotations

import dataclasses
import os
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np

from antdrive.base.errors import FieldError
from antdrive.base.plane import place_name
from antdrive.planners import SMOOTHINGS, Planner, capabilities_of, load_planner, record_name
from antdrive.robots import Avoidance, PurePursuit, RobotSpec, load_robot, overlap_at
from antdrive.robots.odometry import Odometry
from antdrive.runs.margins.choice import choose_margin
from antdrive.runs.margins.prediction import Calibration
from antdrive.runs.margins.trial import Conditions
from antdrive.sim.driving.perception import Perception, usual_perception
from antdrive.sim.driving.replanning import ReplanPolicy
from antdrive.sim.log.record import LOCALISATIONS, MAPS, SensingRecord, settings_of
from antdrive.sim.log.streams import random_stream
from antdrive.worlds import Disc, Task, Trajectories, World, load_task
from antdrive.worlds.drawing import card, world_svg

PHYSICS_HZ = (60, 10_000)  # slower physics jolts the robot
SLOWEST_CONTROL = 10  # [Hz]
DRIFTING = "odometry", "matching"  # localisation without fixes
FINE = 0.05  # without a map, plans are made on cells of this side at most [m]

CONTROLLER, PERCEPTION, AVOIDANCE, REPLANNING = PurePursuit(), Perception(), Avoidance(), ReplanPolicy()


@dataclass(frozen=True, kw_only=True)
class Scenario:
    """Everything a run depends on. The same scenario gives the same rollout, bit for bit, on one machine.

    Attributes:
        task: the world, the start and the goal
        planner: finds the path
        robot: drives it
        planner_name: the planner's name in records; empty: the name of its class
        margin: distance kept free around the robot, on top of its radius [m]
        cell: grid resolution [m]; None: the task's own, without a map at most 5 cm
        smoothing: how the plan becomes a route: none, taut or clearance, see `antdrive.planners.smooth`
        seed: the seed of all random numbers
        controller: follows the route
        noise: the factor on the robot's documented noise in sensing and acting; 0: a perfect robot
        perception: what the robot perceives of movers; None: their velocities, without a map only what its lidar finds
        avoidance: how the robot avoids movers; None: not at all
        replanning: when the robot looks for a new route in a world with movers; None: never
        unseen: obstacles that neither the planner nor the controller knows of
        map: `given`: planner and controller know the world; `none`: the robot knows only what its lidar has seen
        localisation: how the robot knows its pose: `fixes` with the noise of its file, `odometry` without any fix,
            `matching`: odometry that is corrected by laying scans on the map that the robot makes, or `true`, without error
        odometry: the factor on the errors of odometry, see `antdrive.robots.odometry`
        time_limit: simulated time after which the drive ends [s]; None: the task's own, or 30 s plus ten times the
            route at full speed
        physics_hz: physics steps per simulated second, 60 to 10000
        control_hz: control periods per simulated second, at least 10; must divide `physics_hz`
        calibration: what the margin was chosen by; see `with_chosen_margin`

    Raises:
        ValueError: a setting is out of range, or the robot's footprint overlaps an obstacle or a wall at the start.
    """

    task: Task
    planner: Planner
    robot: RobotSpec
    planner_name: str = ""
    margin: float = 0.03
    cell: float | None = None
    smoothing: str = "clearance"
    seed: int = 0
    controller: PurePursuit = field(default_factory=PurePursuit)
    noise: float = 0.0
    perception: Perception | None = None
    avoidance: Avoidance | None = field(default_factory=Avoidance)
    replanning: ReplanPolicy | None = field(default_factory=ReplanPolicy)
    unseen: tuple[Disc, ...] = ()
    map: str = "given"
    localisation: str = "fixes"
    odometry: float = 1.0
    time_limit: float | None = None
    physics_hz: int = 240
    control_hz: int = 60
    calibration: Calibration | None = None

    def __post_init__(self) -> None:
        self._check_kinds()
        if not self.margin >= 0:
            raise FieldError("margin", f"must be at least 0, got {self.margin:g}")
        if self.smoothing not in SMOOTHINGS:
            raise FieldError("smoothing", f"unknown {self.smoothing!r}; choose from {', '.join(SMOOTHINGS)}")
        try:
            self.robot.noise.scaled(self.noise)
        except ValueError as error:
            raise FieldError("noise", f"{self.noise:g} times the robot's own is too much: {error}") from None
        self._check_sensing()
        if self.time_limit is not None and not self.time_limit > 0:
            raise FieldError("time_limit", f"must be greater than 0, got {self.time_limit:g}")
        self._check_rates()
        overlap = overlap_at(self.task.world, self.robot, self.task.start, self.unseen)
        if overlap:
            at = place_name(self.task.frame, *self.task.start[:2], "g")
            raise FieldError("start", f"{self.robot.name} at {at} {overlap}; move the start away from it")

    def _check_sensing(self) -> None:
        """Refuse unknown kinds of maps and localisation, and a robot without a map that has no lidar."""
        for key, known in (("map", MAPS), ("localisation", LOCALISATIONS)):
            if getattr(self, key) not in known:
                raise FieldError(key, f"unknown {getattr(self, key)!r:.60}; choose from {', '.join(known)}")
        if not self.odometry >= 0:
            raise FieldError("odometry", f"must be at least 0, got {self.odometry:g}")
        try:
            Odometry().scaled(self.odometry)
        except FieldError as error:
            raise FieldError(
                "odometry", f"{self.odometry:g} times the documented errors is too much: {error}"
            ) from None
        if self.map == "none" and self.robot.lidar is None:
            raise FieldError(
                "map",
                f"none: {self.robot.name} has no lidar; add one to its file, or drive jackal or turtlebot4",
            )
        kind = self.known_perception.kind
        if kind == "lidar" and self.robot.lidar is None:
            raise FieldError(
                "sees",
                f"lidar: {self.robot.name} has no lidar; add one to its file, or drive jackal or turtlebot4",
            )
        if kind == "lidar" and self.map == "given" and self.localisation == "odometry":
            raise FieldError("sees", "lidar: with a given map the pose must not drift; localise by fixes or true")
        drifts = self.map == "none" and self.localisation in DRIFTING
        if drifts and self.task.world.movers and kind != "lidar":
            raise FieldError(
                "sees",
                f"{kind}: the pose drifts with localisation {self.localisation}, and movers that are told would be "
                "elsewhere in the robot's frame; write lidar, or localise by fixes or true",
            )
        if self.map == "given" and self.localisation == "matching":
            raise FieldError("localisation", "matching: needs map none; with a given map the robot makes none")
        can = capabilities_of(self.planner)
        if self.map == "none" and can.needs_motions:
            raise FieldError(
                "map", f"none: {self.planner_label} plans among known motions, and a robot without a map knows none"
            )

    def _check_rates(self) -> None:
        """Refuse rates at which the robot is not simulated as it would drive."""
        low, high = PHYSICS_HZ
        if not low <= self.physics_hz <= high:
            raise FieldError("physics_hz", f"must be between {low} and {high}, got {self.physics_hz}")
        if not SLOWEST_CONTROL <= self.control_hz <= self.physics_hz or self.physics_hz % self.control_hz:
            rates = (hz for hz in range(SLOWEST_CONTROL, self.physics_hz + 1) if not self.physics_hz % hz)
            nearest = min(rates, key=lambda hz: abs(hz - self.control_hz))
            raise FieldError(
                "control_hz",
                f"must divide the physics rate {self.physics_hz} and be at least {SLOWEST_CONTROL}, "
                f"got {self.control_hz}; {nearest} would do",
            )

    def _check_kinds(self) -> None:
        """Refuse values of the wrong type here, where the setting can be named, and not deep in a run."""
        kinds: tuple[tuple[str, type | tuple[type, ...], str], ...] = (
            ("task", Task, "a Task, such as load_task gives"),
            ("robot", RobotSpec, "a RobotSpec, such as load_robot gives"),
            ("controller", PurePursuit, "a PurePursuit"),
            (
                "perception",
                (Perception, type(None)),
                "a Perception, such as Perception(kind='positions'), or None for the usual one",
            ),
            ("avoidance", (Avoidance, type(None)), "an Avoidance, or None for no avoidance"),
            ("replanning", (ReplanPolicy, type(None)), "a ReplanPolicy, or None for no replanning"),
            ("unseen", tuple, "a tuple of Disc"),
            ("calibration", (Calibration, type(None)), "a Calibration, such as choose_margin gives, or None"),
            ("seed", (int, np.integer), "a whole number"),
            ("physics_hz", (int, np.integer), "a whole number"),
            ("control_hz", (int, np.integer), "a whole number"),
        )
        for key, kind, wanted in kinds:
            value = getattr(self, key)
            if not isinstance(value, kind) or isinstance(value, bool):
                raise FieldError(key, f"must be {wanted}, got {value!r:.60}")
        if not all(isinstance(disc, Disc) for disc in self.unseen):
            raise FieldError("unseen", f"must hold Disc objects, got {self.unseen!r:.60}")
        if self.seed < 0:
            raise FieldError("seed", f"must be at least 0, got {self.seed}")
        for key in ("margin", "noise", "odometry", "cell", "time_limit"):
            value = getattr(self, key)
            optional = value is None and key in ("cell", "time_limit")
            if not optional and (not isinstance(value, int | float | np.number) or isinstance(value, bool)):
                raise FieldError(key, f"must be a number, got {value!r:.60}")

    @classmethod
    def of(
        cls,
        world: str | os.PathLike[str] | Task,
        planner: str | Planner = "ants",
        robot: str | os.PathLike[str] | RobotSpec = "turtlebot",
        *,
        options: Mapping[str, Any] | None = None,
        margin: float | Literal["auto"] = 0.03,
        cell: float | None = None,
        smoothing: str = "clearance",
        seed: int = 0,
        controller: PurePursuit = CONTROLLER,
        noise: float = 0.0,
        perception: Perception | None = None,
        avoidance: Avoidance | None = AVOIDANCE,
        replanning: ReplanPolicy | None = REPLANNING,
        unseen: tuple[Disc, ...] = (),
        map: str = "given",
        localisation: str = "fixes",
        odometry: float = 1.0,
        time_limit: float | None = None,
        physics_hz: int = 240,
        control_hz: int = 60,
    ) -> Scenario:
        """A scenario from names, files or objects.

        >>> Scenario.of("forest", "aco-han", "jackal", options={"ants": 30}, noise=1.0, seed=2)

        The settings margin, cell, smoothing, seed, controller, noise, perception, avoidance, replanning, unseen,
        map, localisation, odometry, time_limit, physics_hz and control_hz are the fields of `Scenario`. "auto": see
        `with_chosen_margin`.

        Args:
            world: a world of the catalogue, a world file, or a task
            planner: a planner's name, FILE.py:CLASS, MODULE:CLASS, or a planner
            robot: a robot of the catalogue, a robot file, or a robot
            options: options of a planner that is given by name

        Raises:
            InputError: there is no such world, planner, option or robot, or a file is wrong.
            ValueError: a setting is out of range, the robot does not fit, or `options` are given for a planner object.
        """
        if not isinstance(planner, str) and options:
            raise FieldError("options", "need a planner's name; set the options of a planner object itself")
        scenario = cls(
            task=world if isinstance(world, Task) else load_task(world),
            planner=load_planner(planner, **(options or {})) if isinstance(planner, str) else planner,
            planner_name=record_name(planner) if isinstance(planner, str) else "",
            robot=robot if isinstance(robot, RobotSpec) else load_robot(robot),
            margin=0.0 if margin == "auto" else margin,
            cell=cell, smoothing=smoothing, seed=seed, controller=controller, noise=noise,
            perception=perception, avoidance=avoidance, replanning=replanning, unseen=unseen,
            map=map, localisation=localisation, odometry=odometry,
            time_limit=time_limit, physics_hz=physics_hz, control_hz=control_hz,
        )  # fmt: skip
        return scenario.with_chosen_margin() if margin == "auto" else scenario

    @property
    def conditions(self) -> Conditions:
        """What the loss of margin depends on."""
        return Conditions(
            robot=self.robot,
            controller=self.controller,
            noise=float(self.noise),
            smoothing="none" if self.timed else self.smoothing,
            physics_hz=self.physics_hz,
            control_hz=self.control_hz,
        )

    def with_chosen_margin(self, progress: Callable[[int, float], None] | None = None) -> Scenario:
        """The scenario with the least margin whose predicted loss leaves a reserve, see `antdrive.runs.margins`.

        Short drives of this robot predict the loss, once; the cache keeps the result. Movers are no part of it.

        Args:
            progress: is called after each of these drives with their number so far and the margin that is tried [m]

        Raises:
            FieldError: no margin leaves the reserve.
        """
        calibration = choose_margin(self.conditions, progress=progress)
        return dataclasses.replace(self, margin=calibration.margin, calibration=calibration)

    @property
    def chosen(self) -> Calibration | None:
        """The calibration that the margin comes from; None where the margin was given, or the conditions have changed."""
        calibration = self.calibration
        if calibration is None or calibration.margin != self.margin or calibration.key != self.conditions.key:
            return None
        return calibration

    def as_dict(self) -> dict[str, Any]:
        """The settings as plain values, for JSON; `docs/reference/rollout-format.md` lists the keys.

        `settings` holds the values of controller, perception, avoidance and replanning that differ from their defaults, null
        where there is none, and the unseen obstacles.
        """
        task, planner = self.task, self.planner
        defaults = {
            "controller": CONTROLLER,
            "perception": PERCEPTION,
            "avoidance": AVOIDANCE,
            "replanning": REPLANNING,
        }
        values = {key: getattr(self, key) for key in defaults} | {"perception": self.known_perception}
        changed: dict[str, Any] = {key: _changed(values[key], default) for key, default in defaults.items()}
        if self.sensing is not None:
            changed |= settings_of(self.sensing)
        if self.unseen:
            changed["unseen"] = [[disc.x, disc.y, disc.radius] for disc in self.unseen]
        return {
            "world": task.world.name,
            "planner": self.planner_label,
            "robot": self.robot.name,
            "seed": self.seed,
            "options": settings_of(planner) if dataclasses.is_dataclass(planner) else {},
            "smoothing": self.smoothing,
            "noise": self.noise,
            "margin_m": self.margin,
            "margin_auto": self.chosen is not None,
            "cell_m": self.planning_cell,
            "physics_hz": self.physics_hz,
            "control_hz": self.control_hz,
            "time_limit_s": self.time_limit or task.time_limit,
            "task": {"start": list(task.start), "goal": list(task.goal), "goal_tolerance_m": task.goal_tolerance},
            **({"frame": list(task.frame)} if any(task.frame) else {}),
            "settings": {key: value for key, value in changed.items() if value != {}},
        }

    @property
    def planner_label(self) -> str:
        """The planner's name in records."""
        return self.planner_name or type(self.planner).__name__

    @property
    def inflate(self) -> float:
        """The distance that planners keep between the robot's centre and every surface [m]."""
        return self.robot.radius + self.margin

    @property
    def driven_world(self) -> World:
        """The world that the robot drives in: the task's world with the unseen obstacles."""
        world = self.task.world
        return dataclasses.replace(world, obstacles=world.obstacles + self.unseen) if self.unseen else world

    @property
    def trajectories(self) -> Trajectories:
        """The motions of the world's movers, drawn from the seed."""
        return Trajectories.of(self.driven_world, self.task.start[:2], self.seed)

    @property
    def exploring(self) -> bool:
        """Whether the robot has no map."""
        return self.map == "none"

    @property
    def planning_cell(self) -> float:
        """The side of the cells that routes are planned on [m]; without a map fine ones: coarse ones close gaps."""
        if self.cell is not None:
            return self.cell
        return min(self.task.cell, FINE) if self.exploring else self.task.cell

    @property
    def sensing(self) -> SensingRecord | None:
        """What the robot knows of the world and of its pose, for the record; None where that is the map and pose fixes."""
        if (self.map, self.localisation) == ("given", "fixes"):
            return None
        return SensingRecord(map=self.map, localisation=self.localisation, odometry=float(self.odometry))

    @property
    def timed(self) -> bool:
        """Whether the planner plans in space and time, among movers."""
        return bool(self.driven_world.movers) and capabilities_of(self.planner).needs_motions

    @property
    def among_movers(self) -> bool:
        """Whether there are movers, or the robot looks for some."""
        return bool(self.driven_world.movers) or self.watching

    @property
    def watching(self) -> bool:
        """Whether the robot looks for movers with its lidar, and is told nothing of them."""
        return self.effective_perception.kind == "lidar"

    @property
    def effective_perception(self) -> Perception:
        """What the robot perceives of movers: their motions, if the planner is given them."""
        return Perception(kind="motions") if self.timed else self.known_perception

    @property
    def known_perception(self) -> Perception:
        """What the robot perceives of movers as asked for; the usual where nobody asked."""
        return self.perception or usual_perception(self.map, movers=bool(self.task.world.movers))

    @property
    def effective_avoidance(self) -> Avoidance | None:
        """How the robot avoids movers, given what it knows of them.

        Movers whose motions are known do not reverse unexpectedly, so reversals are not considered. A plan in
        space and time avoids the movers already, so the horizon is short.
        """
        if self.avoidance is None or self.effective_perception.kind != "motions":
            return self.avoidance
        horizon = min(self.avoidance.horizon, 1.0) if self.timed else self.avoidance.horizon
        return dataclasses.replace(self.avoidance, reversal_weight=0.0, horizon=horizon)

    def rng(self, purpose: str) -> np.random.Generator:
        """A random stream from the seed; every `purpose` has its own, so that one does not change another."""
        return random_stream(self.seed, purpose)

    def _repr_html_(self) -> str:
        task = self.task
        facts = {
            "planner": self.planner_label,
            "robot": self.robot.name,
            "smoothing": self.smoothing,
            "margin": f"{self.margin:g} m",
            "noise": f"{self.noise:g}",
            "seed": self.seed,
        }
        if self.driven_world.movers:
            facts["movers"] = len(self.driven_world.movers)
        world = self.driven_world
        goal, movers = (*task.goal, task.goal_tolerance), world.ways(task.start[:2], self.seed)
        picture = world_svg(world.bounds, world.discs, start=task.start, goal=goal, movers=movers)
        return card(picture, task.world.name, facts)


def _changed(values: Any, default: Any) -> dict[str, Any] | None:
    """The settings that differ from their defaults; None where there are none at all."""
    if values is None:
        return None
    usual = settings_of(default)
    return {key: value for key, value in settings_of(values).items() if value != usual[key]}
