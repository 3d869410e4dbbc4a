"""A scenario as a person writes it: an entry of a suite, a point of a campaign, a command line, or a log's record."""

from __future__ import annotations

import contextlib
import dataclasses
import shlex
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias

from antdrive.base.checks import resolve, show, suggest
from antdrive.base.errors import FieldError, InputError
from antdrive.base.files import file_name
from antdrive.base.user_code import file_and_rest
from antdrive.sim.settings import SETTINGS

if TYPE_CHECKING:
    from antdrive.planners import Planner
    from antdrive.robots import RobotSpec
    from antdrive.worlds import Task

#: Returns the error for a key and its problem, with the key's place: a file and its line, or an option.
ErrorAt: TypeAlias = Callable[[str, str], InputError]


@contextlib.contextmanager
def placed(at: ErrorAt | None) -> Iterator[None]:
    """Give errors within this block the places of their keys; None leaves them as they are."""
    try:
        yield
    except (FieldError, InputError) as error:
        has_place = isinstance(error, InputError) and not error.key
        raise error if at is None or has_place else at(error.key, error.problem) from None


_KINDS: Mapping[str, Any] = {"start": (list, tuple), "goal": (list, tuple), "task": str, "robot": str, "seed": int}


@dataclass(frozen=True, kw_only=True)
class Written:
    """Plain data of a scenario; files are relative to a home folder, by default the working directory.

    Attributes:
        world: a world of the catalogue, a world file, or {generate: KIND, seed: 7} with the generator's options
        task: one of the world's tasks; None: its own start and goal
        start: another start [x, y, yaw], in metres and radians
        goal: another goal [x, y], in metres
        planner: a registered name, FILE.py:CLASS, MODULE:CLASS, or a plan's file
        options: the planner's options
        robot: a robot of the catalogue, or a robot file
        settings: the settings that are given, by key
        seed: seed of all random numbers
    """

    world: str | Mapping[str, Any]
    task: str | None = None
    start: Sequence[float] | None = None
    goal: Sequence[float] | None = None
    planner: str = "ants"
    options: Mapping[str, Any] = field(default_factory=dict)
    robot: str = "turtlebot"
    settings: Mapping[str, Any] = field(default_factory=dict)
    seed: int = 0

    @classmethod
    def read(cls, data: Mapping[str, Any]) -> Written:
        """Return the scenario of plain data.

        Args:
            data: values by the keys of a suite, and `seed`

        Raises:
            FieldError: a value has another type, or a key is unknown.
        """
        own = {one.name for one in dataclasses.fields(cls)} - {"settings", "options"}
        planner = data.get("planner", "ants")
        options = dict(planner) if isinstance(planner, dict) else {}
        name = planner if isinstance(planner, str) else options.pop("name", None)
        if not isinstance(name, str):
            raise FieldError("planner.name", "missing; write the planner's name, or FILE.py:CLASS or MODULE:CLASS")
        if ":" not in name and (source := options.pop("file", None) or options.pop("module", None)):
            name = f"{source}:{name}"  # as older suites name their planners
        settings = {key: value for key, value in data.items() if key not in own}
        known = {one.key for one in SETTINGS.values()}
        for key in settings:
            if key not in known:
                raise FieldError(key, f"unknown key; {suggest(key, [*own, *known])}")
        given = {key: data[key] for key in own & data.keys()}
        for key, value in given.items():
            wanted = _KINDS.get(key)
            if wanted is not None and not isinstance(value, wanted):
                raise FieldError(key, f"has another type, got {show(value)}")
        world = data.get("world")
        if not isinstance(world.get("generate") if isinstance(world, dict) else world, str):
            raise FieldError("world", "write a file, a name of the catalogue, or {generate: forest, seed: 7}")
        for key, count in (("start", 3), ("goal", 2)):
            ends = given.get(key, [0.0] * count)
            if len(ends) != count or not all(isinstance(number, int | float) for number in ends):
                raise FieldError(key, f"must be {count} numbers, got {show(ends)}")
        return cls(**{**given, "planner": name, "options": options, "settings": settings})

    def plain(self) -> dict[str, Any]:
        """Return plain data for `read`."""
        places = {key: getattr(self, key) for key in ("world", "task", "start", "goal")}
        return {
            **{key: value for key, value in places.items() if value is not None},
            "planner": {"name": self.planner, **self.options} if self.options else self.planner,
            "robot": self.robot,
            **self.settings,
            "seed": self.seed,
        }

    def check_names(self, home: Path | None, at: ErrorAt) -> None:
        """Check that everything named exists, without reading worlds and robots or running user code.

        Args:
            home: base of relative paths
            at: returns the error for a key
        """
        from antdrive.base.user_code import is_user_code
        from antdrive.planners import load_planner
        from antdrive.robots.robot_file import list_robots
        from antdrive.worlds.files.world_file import list_worlds

        with placed(at):
            if isinstance(self.world, str):
                resolve("world", self.world, list_worlds(), home)
            resolve("robot", self.robot, list_robots(), home)
            if not is_user_code(self.planner):
                load_planner(self.planner, home, **self.options)

    def check_settings(self, at: ErrorAt) -> None:
        """Check the keys and values of settings, without user code; those of the controller load the compiler.

        Args:
            at: returns the error for a key
        """
        from antdrive.base.user_code import is_user_code
        from antdrive.sim.forms import name_and_options, scenario_fields

        own = is_user_code(str(name_and_options(self.settings.get("controller"))[0]))
        with placed(at):
            scenario_fields(
                {key: one for key, one in self.settings.items() if one != "auto" and not (own and key == "controller")}
            )

    def load_task(self, home: Path | None = None) -> Task:
        """Return the world with start and goal.

        Args:
            home: base of relative paths
        """
        from antdrive.worlds import load_task

        task = load_task(self.world, self.task, home) if isinstance(self.world, str) else self._generated(self.world)
        ends = {"start": self.start, "goal": self.goal}
        given = {key: tuple(value) for key, value in ends.items() if value is not None}
        return dataclasses.replace(task, **given) if given else task  # type: ignore[arg-type]

    def _generated(self, world: Mapping[str, Any]) -> Task:
        from antdrive.sim.forms import option_text
        from antdrive.worlds.generators.generate import generated

        options = dict(world)
        kind, seed = options.pop("generate"), options.pop("seed", 0)
        if self.task is not None:
            raise FieldError("task", "a random world has no named tasks")
        if type(seed) is not int or not 0 <= seed < 2**63:
            raise FieldError("world.seed", f"must be a whole number of at least 0, got {show(seed)}")
        try:
            return generated(kind, seed, tuple((key, option_text(value)) for key, value in options.items()))
        except InputError as error:
            raise FieldError("world", str(error)) from None

    def words_of(self, part: str) -> dict[str, Any]:
        """Return the fields that name a part of a scenario: its task, planner or robot."""
        keys = {"task": ("world", "task", "start", "goal"), "planner": ("planner", "options"), "robot": ("robot",)}
        return {key: getattr(self, key) for key in keys[part]}

    def command(self) -> str | None:
        """Return the command that drives the scenario; None if the command line has no option for a setting."""
        from antdrive.sim.forms import option_text, setting_words, word_text

        settings = setting_words(self.settings)
        if settings is None:
            return None
        options = [word for key, one in self.options.items() for word in ("--set", f"planner.{key}={option_text(one)}")]
        world, before = (self.world, "") if isinstance(self.world, str) else _generating(dict(self.world))
        places = {"task": self.task, "start": self.start, "goal": self.goal}
        ends = [
            f"--{key}={word_text(list(at) if key != 'task' else at)}" for key, at in places.items() if at is not None
        ]
        words = ["antdrive", "run", world, *ends, "--planner", self.planner, *options, "--robot", self.robot]
        return before + shlex.join([*words, *settings, "--seed", str(self.seed)])

    def moved(self, rename: Callable[[str], str]) -> Written:
        """Return the same with other names for its files.

        Args:
            rename: returns the other name
        """
        from antdrive.robots import list_robots
        from antdrive.worlds import list_worlds

        world = self.world if not isinstance(self.world, str) or self.world in list_worlds() else rename(self.world)

        def code(name: str) -> str:
            file, rest = file_and_rest(name)
            return f"{rename(file)}{rest}" if file else name

        robot = self.robot if self.robot in list_robots() else rename(self.robot)
        settings = with_controller(self.settings, code)
        return dataclasses.replace(self, world=world, planner=code(self.planner), robot=robot, settings=settings)

    def seen_from_here(self, home: Path, *, anywhere: bool = False) -> Written:
        """Return the same with files relative to the working directory, and modules beside the home as files.

        Args:
            home: base of relative paths
            anywhere: whether to write whole paths
        """

        def shown(name: str) -> str:
            path, here = (home / name).resolve(), Path.cwd()
            return str(path if anywhere or not path.is_relative_to(here) else path.relative_to(here))

        def code(name: str) -> str:
            source, _, word = name.rpartition(":")
            beside = home / f"{source}.py"
            moving = anywhere or home.resolve() != Path.cwd()
            is_module = source and moving and not source.endswith(".py") and beside.is_file()
            return f"{beside.name}:{word}" if is_module else name

        settings = with_controller(self.settings, code)
        return dataclasses.replace(self, planner=code(self.planner), settings=settings).moved(shown)


def with_controller(settings: Mapping[str, Any], rename: Callable[[str], str]) -> Mapping[str, Any]:
    """Return settings as files write them, with another name of the controller.

    Args:
        settings: the settings by key
        rename: returns the other name
    """
    value = settings.get("controller")
    if isinstance(value, str):
        return {**settings, "controller": rename(value)}
    if isinstance(value, dict) and isinstance(value.get("name"), str):
        return {**settings, "controller": {**value, "name": rename(value["name"])}}
    return settings


def named_task(task: Task, _: str) -> dict[str, Any]:
    """Return a task's name in the catalogue, with its start and goal if they differ; else a file's name."""
    from antdrive.sim.log.record import canonical_hash

    usual = _catalogue_task(task.world.name)
    if usual is not None:
        ends = {key: getattr(task, key) for key in ("start", "goal") if getattr(task, key) != getattr(usual, key)}
        try:
            usual = dataclasses.replace(usual, **ends)
        except FieldError:
            usual = None
        if usual is not None and canonical_hash(usual) == canonical_hash(task):
            return {"world": task.world.name, **{key: list(value) for key, value in ends.items()}}
    return {"world": f"{file_name(task.world.name)}.yaml"}


@cache
def _catalogue_task(name: str) -> Task | None:
    from antdrive.worlds import list_worlds, load_task

    return load_task(name) if name in list_worlds() else None


def named_robot(robot: RobotSpec, _: str) -> dict[str, Any]:
    """Return a robot's name in the catalogue, else a file's name."""
    from antdrive.robots import list_robots, load_robot
    from antdrive.sim.log.record import canonical_hash

    same = robot.name in list_robots() and canonical_hash(load_robot(robot.name)) == canonical_hash(robot)
    return {"robot": robot.name if same else f"{file_name(robot.name)}.yaml"}


def named_planner(planner: Planner | Mapping[str, Any], label: str) -> dict[str, Any]:
    """Return a planner's registered name, else that of its class, and the options that differ from the registered ones."""
    from antdrive.planners import list_planners
    from antdrive.sim.log.record import settings_of

    usual = list_planners().get(label)
    known = {} if usual is None else settings_of(usual)
    given = settings_of(planner) if isinstance(planner, Mapping) or dataclasses.is_dataclass(planner) else {}
    options = {key: value for key, value in given.items() if known.get(key, key) != value}
    return {"planner": label if usual is not None else f"FILE.py:{label}", "options": options}


def _generating(world: dict[str, Any]) -> tuple[str, str]:
    """Return the file's name of a random world, and the command that generates it first."""
    from antdrive.sim.forms import option_text

    kind, seed = world.pop("generate"), world.pop("seed", 0)
    name = f"{kind}-{seed}.yaml"
    words = ["antdrive", "worlds", "generate", kind, "--seed", str(seed), "--out", name]
    words += [word for key, value in world.items() for word in ("--set", f"{key}={option_text(value)}")]
    return name, f"{shlex.join(words)} && "
