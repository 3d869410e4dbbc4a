"""Command that repeats a logged drive, from the log's record alone."""

from __future__ import annotations

import dataclasses
import math
import shlex
from functools import cache

from antdrive.base.errors import FieldError, InputError
from antdrive.base.files import file_name
from antdrive.base.plane import polyline_length
from antdrive.planners import list_planners
from antdrive.robots import list_robots, load_robot
from antdrive.sim.forms import option_text, setting_words, written
from antdrive.sim.log.ending import control_periods
from antdrive.sim.log.record import DriveRecord, canonical_hash, settings_of
from antdrive.sim.log.rollout import Rollout
from antdrive.sim.rebuild import scenario_values
from antdrive.sim.scenario import usual_time_limit
from antdrive.sim.settings import SETTINGS
from antdrive.worlds import Task, list_worlds, load_task


def command_of(rollout: Rollout) -> str | None:
    """Return the `antdrive run` command of a log's scenario; None if a setting has no option.

    Worlds and robots that are not the catalogue's are named as files of the working folder, unregistered planners as
    classes in FILE.py.

    Args:
        rollout: the log
    """
    record = rollout.record
    try:
        values = scenario_values(record)
        given = written(lambda name: values.get(name, SETTINGS[name].default))
    except (FieldError, InputError):
        return None
    limit = record.task.time_limit or usual_time_limit(polyline_length(rollout.route), record.robot, record.noise)
    usual = {
        "cell": values["cell"] == record.task.cell,
        "time_limit": control_periods(record.time_limit, record.control_hz)
        == control_periods(limit, record.control_hz),
    }
    given = {key: value for key, value in given.items() if key != "seed" and not usual.get(key)}
    settings = setting_words(given)
    if settings is None:
        return None
    world, ends = _world(record.task)
    planner = record.planner.name if record.planner.name in list_planners() else f"FILE.py:{record.planner.name}"
    words = ["antdrive", "run", world, *ends, "--planner", planner, *_options(record)]
    return shlex.join([*words, "--robot", _robot(record), *settings, "--seed", str(record.seed)])


def _options(record: DriveRecord) -> list[str]:
    """Return the options of a planner that differ from its defaults."""
    known = list_planners().get(record.planner.name)
    usual = {} if known is None else settings_of(known)
    changed = {key: value for key, value in record.planner.settings.items() if usual.get(key, key) != value}
    limits = {key: math.inf if value is None else value for key, value in changed.items()}
    return [word for key, value in limits.items() for word in ("--set", f"planner.{key}={option_text(value)}")]


def _world(task: Task) -> tuple[str, list[str]]:
    """Return the world's name in commands, and the options of another start and goal."""
    name = task.world.name
    usual = _catalogue_task(name)
    if usual is not None:
        ends = {"start": task.start, "goal": task.goal}
        different = {key: value for key, value in ends.items() if value != getattr(usual, key)}
        try:
            usual = dataclasses.replace(usual, **different)  # type: ignore[arg-type]
        except FieldError:
            usual = None
        if usual is not None and canonical_hash(usual) == canonical_hash(task):
            return name, [f"--{key}={option_text(list(value))}" for key, value in different.items()]
    return f"{file_name(name)}.yaml", []


def _robot(record: DriveRecord) -> str:
    """Return the robot's name in commands."""
    name = record.robot.name
    same = name in list_robots() and canonical_hash(load_robot(name)) == canonical_hash(record.robot)
    return name if same else f"{file_name(name)}.yaml"


@cache
def _catalogue_task(name: str) -> Task | None:
    return load_task(name) if name in list_worlds() else None
