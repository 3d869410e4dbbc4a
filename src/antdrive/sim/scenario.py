"""A scenario: task, planner, robot, seed and the settings of `antdrive.sim.settings`, checked together."""

from __future__ import annotations

import dataclasses
import hashlib
import json
import os
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from antdrive.base.checks import suggest
from antdrive.base.components import is_built_in
from antdrive.base.errors import FieldError
from antdrive.base.plane import format_position
from antdrive.base.user_code import is_user_code, module_hash
from antdrive.planners import Planner, capabilities_of, load_planner, record_name
from antdrive.robots import Controller, PurePursuit, RobotSpec, capabilities_of_controller, load_robot, overlap_at
from antdrive.robots.control.speed_limits import heading_error, steady
from antdrive.robots.controllers.registry import REGISTRY as CONTROLLER_REGISTRY
from antdrive.robots.default_margin import default_margin, outline_margins
from antdrive.sim.log.record import (
    DriveRecord,
    MarginRecord,
    SensingRecord,
    canonical_hash,
    changes,
    options_of,
    require_factors,
    settings_of,
)
from antdrive.sim.log.streams import random_stream
from antdrive.sim.policy import Perception, usual_perception
from antdrive.sim.settings import SETTINGS, SLOWEST_CONTROL, Settings, part_of_key
from antdrive.sim.written import ErrorAt, Written, named_planner, named_robot, named_task, placed
from antdrive.worlds import Disc, Task, Trajectories, World
from antdrive.worlds.svg import card, world_svg

DRIFTING = "odometry", "matching"  # localisation without fixes
KEY_DIGITS = 32  # hexadecimal digits of a key; two of 10^9 runs collide with probability 1e-21
FINE = 0.05  # largest planning cell without a map [m]
NO_LIDAR = "has no lidar; add one to its file, or drive jackal or turtlebot4"


def unchosen(s: Scenario) -> Scenario:
    """Leave a margin that is to be chosen at zero, which suffices for checks."""
    return s


@dataclass(frozen=True, kw_only=True)
class LossFactors:
    """Inputs of a margin calibration: scenarios with equal factors share one."""

    robot: RobotSpec  # the robot
    controller: PurePursuit  # the controller
    noise: float  # factor on the robot's documented noise
    smoothing: str  # how plans become routes
    outlined: bool = False  # whether all plans keep the footprint clear, on routes of lines and turns
    physics_hz: int = 240  # physics steps per simulated second
    control_hz: int = 60  # control periods per simulated second

    def __post_init__(self) -> None:
        SETTINGS["smoothing"].check(self.smoothing)


@dataclass(frozen=True, kw_only=True)
class MarginChoice:
    """Choice of a margin, see `antdrive.runs.margins.choice.with_chosen_margin`."""

    margin: float  # the chosen margin [m]
    record: MarginRecord  # its record
    factors: LossFactors  # factors of the loss


@dataclass(frozen=True, kw_only=True)
class Scenario(Settings):
    """Complete input of a run. The same scenario gives the same rollout, bit for bit, on one machine.

    Attributes:
        task: the world, the start and the goal
        planner: the planner
        robot: the robot's specification
        planner_name: the planner's name in records; empty: its class name
        margin_choice: how the margin was chosen; None: it was given
        named_as: the words for task, planner and robot, each with its object, which may have been replaced since

    Raises:
        ValueError: a setting is out of range, or the robot's footprint overlaps an obstacle or a wall at the start.
    """

    task: Task
    planner: Planner
    robot: RobotSpec
    planner_name: str = ""
    margin_choice: MarginChoice | None = None
    named_as: Mapping[str, tuple[Any, Mapping[str, Any]]] = dataclasses.field(default_factory=dict, compare=False)

    def __post_init__(self) -> None:
        self._check_kinds()
        super().__post_init__()
        require_factors(self.robot, self.noise, self.odometry)
        self._check_sensing()
        if not self.control_hz <= self.physics_hz or self.physics_hz % self.control_hz:
            rates = (hz for hz in range(SLOWEST_CONTROL, self.physics_hz + 1) if not self.physics_hz % hz)
            nearest = min(rates, key=lambda hz: abs(hz - self.control_hz))
            problem = f"must divide the physics rate {self.physics_hz}, got {self.control_hz}; {nearest} would do"
            raise FieldError("control_hz", problem)
        overlap = overlap_at(self.task.world, self.robot, self.task.start, self.unseen)
        if overlap:
            at = format_position(self.task.frame, *self.task.start[:2], None)
            raise FieldError("start", f"{self.robot.name} at {at} {overlap}; move the start away from it")

    def _check_kinds(self) -> None:
        """Raise FieldError for objects of the wrong type."""
        if self.planner is None or issubclass(type(self.planner), type):
            raise FieldError("planner", f"must be a planner, such as AStar(), got {self.planner!r:.60}")
        kinds: dict[str, type] = {"task": Task, "robot": RobotSpec, "perception": Perception, "unseen": tuple}
        kinds |= {name: type(SETTINGS[name].default) for name in ("avoidance", "replanning")}
        for name, kind in kinds.items():
            value, optional = getattr(self, name), name in ("perception", "avoidance", "replanning")
            if not isinstance(value, kind) and not (optional and value is None):
                wanted = f"{kind.__name__} or None" if optional else kind.__name__
                raise FieldError(name, f"must be a {wanted}, got {value!r:.60}")
        if isinstance(self.controller, type) or not isinstance(self.controller, Controller):
            raise FieldError("controller", f"must be a controller, such as PurePursuit(), got {self.controller!r:.60}")
        if not all(isinstance(disc, Disc) for disc in self.unseen):
            raise FieldError("unseen", f"must hold Disc objects, got {self.unseen!r:.60}")

    def _check_sensing(self) -> None:
        """Raise FieldError for invalid combinations of map, localisation, perception, planner and robot."""
        if self.mapless and self.replanning is None:
            raise FieldError(
                "replan", "none: a mapless robot finds its way by replanning; false replans around no movers"
            )
        if self.mapless and self.robot.lidar is None:
            raise FieldError("map", f"none: {self.robot.name} {NO_LIDAR}")
        kind = self.known_perception.kind
        if kind == "lidar" and self.robot.lidar is None:
            raise FieldError("sees", f"lidar: {self.robot.name} {NO_LIDAR}")
        if kind == "lidar" and not self.mapless and self.localisation == "odometry":
            raise FieldError("sees", "lidar: with a given map the pose must not drift; localise by fixes or true")
        drifts = self.mapless and self.drifting
        if drifts and self.task.world.movers and kind != "lidar":
            raise FieldError(
                "sees",
                f"{kind}: the pose drifts with localisation {self.localisation}, which displaces ground-truth movers in "
                "the robot's frame; write lidar, or localise by fixes or true",
            )
        if not self.mapless and self.localisation == "matching":
            raise FieldError("localisation", "matching: needs map none, since scans are matched to the occupancy map")
        can = capabilities_of(self.planner)
        if self.footprint == "exact" and not self.robot.footprint.is_disc and not self.follows_turns:
            raise FieldError("footprint", f"exact: {self.controller_label} follows no routes with turns on the spot")
        if self.footprint == "exact" and not self.plans_footprints and not self.robot.footprint.is_disc:
            among = " among movers" if can.turns else ""
            raise FieldError(
                "footprint",
                f"exact: {self.planner_label} plans for the disc around the robot{among}; `antdrive planners` lists those that "
                "plan for its footprint",
            )
        if self.mapless and (can.needs_motions or can.exact_line):
            needs = "needs ground-truth motions of movers, which a mapless robot lacks"
            problem = "is one plan, but a mapless robot replans" if can.exact_line else needs
            raise FieldError("map", f"none: {self.planner_label} {problem}")

    @classmethod
    def of(
        cls,
        world: str | os.PathLike[str] | Task,
        planner: str | Planner = "ants",
        robot: str | os.PathLike[str] | RobotSpec = "turtlebot",
        *,
        options: Mapping[str, Any] | None = None,
        **settings: Any,
    ) -> Scenario:
        """Create a scenario from names, files or objects.

        >>> Scenario.of("forest", "aco-han", "jackal", options={"ants": 30}, noise=1.0, seed=2)

        Args:
            world: a world of the catalogue, a world file, or a task
            planner: a planner's name, FILE.py:CLASS, MODULE:CLASS, a plan's file, or a planner
            robot: a robot of the catalogue, a robot file, or a specification
            options: options of a planner given by name
            settings: fields of `Scenario`, such as noise=1.0; the controller may be a name, or a mapping as in files

        Raises:
            InputError: a world, planner, option or robot is unknown, or a file is invalid.
            ValueError: a setting is out of range, the robot does not fit, or `options` are given for a planner object.
        """
        for name in settings:
            if name not in {one.name for one in dataclasses.fields(cls)}:
                raise FieldError(name, f"unknown setting; {suggest(name, SETTINGS)}")
        if not isinstance(planner, str) and options:
            raise FieldError("options", "need a planner's name; set the options of a planner object itself")
        words: dict[str, Any] = {"options": options or {}}
        if isinstance(settings.get("controller"), str | dict):
            words["settings"] = {"controller": settings.pop("controller")}
        made = dict[str, Any]()
        for key, name, value in (("world", "task", world), ("planner", "planner", planner), ("robot", "robot", robot)):
            if isinstance(value, str | os.PathLike):
                words[key] = os.fspath(value)
            else:
                words[key], made[name] = "", value
        return cls.read(Written(**words), **settings, **made)

    @classmethod
    def read(
        cls,
        words: Written,
        home: Path | None = None,
        at: ErrorAt | None = None,
        *,
        choose: Callable[[Scenario], Scenario] = unchosen,
        **made: Any,
    ) -> Scenario:
        """Return the scenario of words.

        Args:
            words: the scenario as written
            home: base of relative paths
            at: returns the error for a key; None: errors are those of the values
            choose: chooses the margin `auto`
            made: fields of the scenario that exist already, such as its task; the words of those without are empty

        Raises:
            InputError: something does not exist, or a value is invalid.
        """
        from antdrive.sim.forms import scenario_fields

        auto = words.settings.get("margin") == "auto" and "margin" not in made
        with placed(at):
            known = {key: value for key, value in words.settings.items() if key not in made}
            fields = scenario_fields({**known, **({"margin": 0.0} if auto else {})}, home)
            fields |= {"seed": words.seed, "planner_name": record_name(words.planner), **made}
            if "task" not in made:
                fields["task"] = words.load_task(home)
            if "planner" not in made:
                fields["planner"] = load_planner(words.planner, home, **words.options)
            if "robot" not in made:
                fields["robot"] = load_robot(words.robot, home)
            here = words if home is None else words.seen_from_here(home)
            options = {key: getattr(fields["planner"], key, value) for key, value in words.options.items()}  # not text
            here = dataclasses.replace(here, options=options)
            names = {"task": here.world, "planner": here.planner, "robot": here.robot}
            named = {part: (fields[part], here.words_of(part)) for part, word in names.items() if word}
            s = cls(**fields, named_as=named)
            return choose(s) if auto else s

    @property
    def written(self) -> Written:
        """The scenario as a person writes it; parts made in Python are files named after them."""
        from antdrive.sim.forms import written

        words: dict[str, Any] = {}
        for part, named in (("task", named_task), ("planner", named_planner), ("robot", named_robot)):
            made, known = self.named_as.get(part, (None, {}))
            words |= known if made is getattr(self, part) else named(getattr(self, part), self.planner_label)
        settings = written(lambda name: getattr(self, name)) | ({} if self.chosen is None else {"margin": "auto"})
        settings.pop("seed", None)
        return Written(**words, settings=settings, seed=int(self.seed))

    def identity(self, **known: Any) -> str:
        """Return everything that the drive depends on, except its seed, as JSON text.

        Args:
            known: parts that are known otherwise, such as the hash of the task, and further ones
        """
        fields = {name: getattr(self, name) for name in SETTINGS if name != "seed"}
        fields |= {"margin": self.planned_margin, "perception": self.known_perception}
        fields |= {name: known.pop(name) for name in fields.keys() & known.keys()}
        planner: Any = self.planner
        if type(self.controller) is not PurePursuit:
            own = {} if is_built_in(self.controller) else {"file": module_hash(type(self.controller).__module__)}
            fields["controller"] = {"name": self.controller_label, **options_of(self.controller), **own}
        parts = {"planner": self.planner_label, "options": options_of(planner)}
        parts |= {name: canonical_hash(getattr(self, name)) for name in ("task", "robot") if name not in known}
        return json.dumps({**parts, **known, "settings": settings_of(part_of_key(fields))}, sort_keys=True)

    @property
    def key(self) -> str:
        """Hash of everything that the drive depends on."""
        return key_of(self.identity(), self.seed)

    @property
    def sources(self) -> Mapping[str, str]:
        """Hashes by name of what it consists of besides, or instead."""
        return {}

    @property
    def loss_factors(self) -> LossFactors:
        """Factors of the loss of margin."""
        return LossFactors(
            robot=self.robot,
            controller=self.pursuit,
            noise=float(self.noise),
            smoothing=self.driven_smoothing,
            outlined=self.footprint == "exact" and not self.robot.footprint.is_disc,
            physics_hz=self.physics_hz,
            control_hz=self.control_hz,
        )

    @property
    def chosen(self) -> MarginChoice | None:
        """The choice of the margin; None if it was given, or the factors have changed."""
        choice = self.margin_choice
        same = choice is not None and (choice.margin, choice.factors) == (self.margin, self.loss_factors)
        return choice if same else None

    def as_dict(self) -> dict[str, Any]:
        """Return the settings as plain values, for JSON; `docs/reference/rollout-format.md` lists the keys.

        `settings` holds the unseen obstacles and the non-default values of all settings without a key of their own, null where
        there is none.
        """
        task, planner = self.task, self.planner
        from antdrive.sim.forms import USUAL_CONTROLLER, controller_words

        name, options = controller_words(self.controller)
        named = {} if name == USUAL_CONTROLLER else {"name": self.controller_label}
        changed: dict[str, Any] = {"controller": {**named, **settings_of(options)}}
        for key in ("perception", "avoidance", "replanning"):
            value = self.known_perception if key == "perception" else getattr(self, key)
            usual = Perception() if key == "perception" else SETTINGS[key].default
            changed[key] = None if value is None else settings_of(changes(value, usual))
        if self.sensing is not None:
            changed |= settings_of(self.sensing)
        if self.unseen:
            changed["unseen"] = [[disc.x, disc.y, disc.radius] for disc in self.unseen]
        changed |= self.other_settings or {}
        return {
            "world": task.world.name,
            "planner": self.planner_label,
            "robot": self.robot.name,
            "seed": self.seed,
            "options": options_of(planner),
            "smoothing": self.smoothing,
            "noise": self.noise,
            "margin_m": self.planned_margin,
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
    def controller_label(self) -> str:
        """The controller's name in records: `PurePursuit`, the registered name, or the class."""
        name = CONTROLLER_REGISTRY.word_of(self.controller)
        return type(self.controller).__name__ if is_user_code(name) or name == "pure-pursuit" else name

    @property
    def pursuit(self) -> PurePursuit:
        """The controller if it is pure pursuit, else pure pursuit with its defaults, which prepares paths and sets margins."""
        return self.controller if isinstance(self.controller, PurePursuit) else PurePursuit()

    @property
    def follows_turns(self) -> bool:
        """Whether the controller follows routes with turns on the spot."""
        return capabilities_of_controller(self.controller).turns

    @property
    def inflate(self) -> float:
        """Distance that plans keep between the robot's centre and every surface [m]."""
        return self.robot.radius + self.planned_margin

    @property
    def planned_margin(self) -> float:
        """Clearance of plans on top of the robot's radius [m]: the margin as set, else the default."""
        return self.usual_margin if self.margin is None else self.margin

    @property
    def usual_margin(self) -> float:
        """Default margin for robot, controller, noise and smoothing [m]."""
        factors = self.loss_factors
        return default_margin(factors.robot, factors.controller, factors.noise, factors.smoothing)

    @property
    def outline_margins(self) -> tuple[float, ...]:
        """Clearances of plans for the footprint, in turn until there is a path [m].

        A margin that was set holds for them too. Before the default, and before one calibrated on drives of the disc, comes the
        margin of lines.
        """
        margin, of_disc = self.planned_margin, self.chosen is not None and self.footprint == "auto"
        of_lines = of_disc or margin == self.usual_margin
        return outline_margins(self.robot, self.pursuit, self.noise, margin, of_lines=of_lines)

    @property
    def driven_world(self) -> World:
        """World of the drive: the task's world with the unseen obstacles."""
        world = self.task.world
        return dataclasses.replace(world, obstacles=world.obstacles + self.unseen) if self.unseen else world

    @property
    def trajectories(self) -> Trajectories:
        """Motions of the world's movers, drawn from the seed."""
        return Trajectories.of(self.driven_world, self.task.start[:2], self.seed)

    @property
    def planning_cell(self) -> float:
        """Side of the planning cells [m]; fine without a map, since coarse cells close gaps."""
        if self.cell is not None:
            return self.cell
        return min(self.task.cell, FINE) if self.mapless else self.task.cell

    @property
    def sensing(self) -> SensingRecord | None:
        """Map, localisation and odometry for the record; None for a given map and pose fixes."""
        if (self.map, self.localisation) == ("given", "fixes"):
            return None
        return SensingRecord(map=self.map, localisation=self.localisation, odometry=float(self.odometry))

    @property
    def other_settings(self) -> dict[str, Any] | None:
        """Non-default settings that no other key of the record holds."""
        names = (
            name for name, one in SETTINGS.items() if not DriveRecord.held(name) and getattr(self, name) != one.default
        )
        return settings_of({name: getattr(self, name) for name in names}) or None

    @property
    def timed(self) -> bool:
        """Whether the planner plans in space and time, among movers."""
        return bool(self.driven_world.movers) and capabilities_of(self.planner).needs_motions

    @property
    def cell_by_cell(self) -> bool:
        """Whether the planner decides cell by cell, among movers on a map."""
        around = not self.mapless and self.moving and self.replanning is not None and self.replanning.around_movers
        return around and capabilities_of(self.planner).cell_by_cell

    @property
    def plans_footprints(self) -> bool:
        """Whether plans may keep the robot's footprint clear; a planner that decides cell by cell knows no headings."""
        return capabilities_of(self.planner).turns and not self.cell_by_cell and self.follows_turns

    @property
    def driven_smoothing(self) -> str:
        """Kind of smoothing of the driven routes: none for plans in space and time, and for plans of files."""
        return "none" if self.timed or capabilities_of(self.planner).exact_line else self.smoothing

    @property
    def usual_perception(self) -> Perception:
        """Default perception of movers."""
        return usual_perception(self.map, movers=bool(self.task.world.movers))

    @property
    def known_perception(self) -> Perception:
        """Perception of movers as set, else the default."""
        return self.perception or self.usual_perception

    @property
    def moving(self) -> bool:
        """Whether the drive accounts for movers: the world has some, or the robot looks for them by lidar."""
        return bool(self.driven_world.movers) or self.known_perception.kind == "lidar"

    @property
    def mapless(self) -> bool:
        """Whether the robot has no map."""
        return self.map == "none"

    @property
    def scans(self) -> bool:
        """Whether the drive uses the robot's lidar."""
        return self.mapless or (self.known_perception.kind == "lidar" and not self.timed)

    @property
    def noisy(self) -> bool:
        """Whether the robot's documented noise acts."""
        return bool(self.noise) and self.robot.noise.nonzero

    @property
    def drifting(self) -> bool:
        """Whether the pose comes from odometry, whose errors accumulate."""
        return self.localisation in DRIFTING

    def rng(self, purpose: str) -> np.random.Generator:
        """Return the random stream of a purpose. Streams of different purposes are independent."""
        return random_stream(self.seed, purpose)

    def __repr__(self) -> str:
        names = f"{self.planner_label} in {self.task.world.name} with {self.robot.name}"
        return f"<Scenario: {names}, smoothing {self.smoothing}, noise {self.noise:g}, seed {self.seed}>"

    def _repr_html_(self) -> str:
        task = self.task
        facts = {
            "planner": self.planner_label,
            "robot": self.robot.name,
            "smoothing": self.smoothing,
            "margin": f"{self.planned_margin:g} m",
            "noise": f"{self.noise:g}",
            "seed": self.seed,
        }
        if self.driven_world.movers:
            facts["movers"] = len(self.driven_world.movers)
        return card(picture_of(self), task.world.name, facts)


def usual_time_limit(length: float, robot: RobotSpec, noise: float) -> float:
    """Return the time limit of a drive for which neither scenario nor world names one [s].

    Args:
        length: length of the route [m]
        robot: the robot
        noise: factor on its noise, which slows robots of low yaw acceleration
    """
    return 30.0 + 10.0 * length / steady(robot, heading_error(robot, noise)).max_speed


def picture_of(s: Scenario) -> str:
    """Draw the driven world as SVG, with start, goal and paths of movers."""
    world, task = s.driven_world, s.task
    goal, movers = (*task.goal, task.goal_tolerance), world.mover_paths(task.start[:2], s.seed)
    return world_svg(world.bounds, world.discs, start=task.start, goal=goal, movers=movers)


def key_of(identity: str, seed: int) -> str:
    """Return the hash of a scenario's identity and seed: a SHA-256, cut to 32 hexadecimal digits."""
    return hashlib.sha256(f"{identity}\n{seed}".encode()).hexdigest()[:KEY_DIGITS]
