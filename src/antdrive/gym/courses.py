"""Courses: the tasks from which an environment draws its episodes."""

from __future__ import annotations

import dataclasses
import functools
import itertools
import os
import tempfile
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, NamedTuple, TypeAlias

from antdrive.base.caches import cached
from antdrive.base.errors import FieldError, InputError
from antdrive.robots import RobotSpec, overlap_at
from antdrive.runs.barn_challenge import WORLDS, unpacked
from antdrive.worlds import Task, Wandering, import_barn, import_dynabarn, load_task
from antdrive.worlds.generators.generate import BARN_FILLS, BARN_ROUNDS, GENERATORS, generated

Source: TypeAlias = str | os.PathLike[str] | Task
#: Fill ratios and smoothing rounds of generated BARN-like worlds, in turn; as often in the set's 300 worlds.
BARN_MIX = tuple({"fill": fill, "rounds": rounds} for fill, rounds in itertools.product(BARN_FILLS, BARN_ROUNDS))
#: Sets of third-party worlds: what `source` must name.
SETS = {
    "barn50": "the folder or archive of the BARN challenge's world_N.world files",
    "dynabarn": "the JSON file of a DynaBARN set",
}


class Course(NamedTuple):
    """Numbered tasks."""

    worlds: int  # how many there are
    task: Callable[[int], Task]  # the task of a number from 0


def course_of(kind: str, robot: RobotSpec, worlds: int, source: Source | None, options: Mapping[str, Any]) -> Course:
    """Return a course by a generator's name with options, `world`, or a name of `SETS`; generated worlds have room for the robot.

    Raises:
        InputError: the course is unknown, its source is missing, not wanted or invalid, or there are no worlds.
    """
    if kind not in (*GENERATORS, "world", *SETS):
        raise InputError(f"course: unknown {kind!r}; choose from {', '.join((*GENERATORS, 'world', *SETS))}")
    if kind in GENERATORS:
        if source is not None:
            raise InputError(f"source: {kind} has generated worlds alone; omit it, or take World-v0 or Barn50-v0")
        if worlds < 1:
            raise InputError(f"worlds: must be at least 1, got {worlds}")
        tasks: Callable[[int], Task] = functools.partial(_generated, kind, robot, options)
    elif kind == "world":
        worlds, task = 1, task_of("forest" if source is None else source)
        tasks = (task,).__getitem__
    elif source is None or isinstance(source, Task):
        raise InputError(f"source: missing; name {SETS[kind]} (docs/how-to/data.md says where to get it)")
    else:
        known = _barn(os.fspath(source)) if kind == "barn50" else tuple(import_dynabarn(source))
        worlds, tasks = len(known), known.__getitem__
    return Course(worlds, functools.cache(lambda number: task_of(repeated(tasks(number), number), robot)))


def _generated(kind: str, robot: RobotSpec, options: Mapping[str, Any], number: int) -> Task:
    given: dict[str, Any] = {} if kind == "office" else {"robot_radius": round(robot.radius + 0.03, 3)}
    given |= (BARN_MIX[number % len(BARN_MIX)] if kind == "barn" else {}) | dict(options)
    texts = ((key, ",".join(map(str, v)) if isinstance(v, tuple | list) else str(v)) for key, v in given.items())
    return generated(kind, number, tuple(texts))


def task_of(world: Source, robot: RobotSpec | None = None, **ends: Any) -> Task:
    """Return a task by its world's name or file, with another start or goal; the robot must fit at its start.

    Raises:
        InputError: the world is unknown or invalid, or an end is not free.
    """
    task = world if isinstance(world, Task) else load_task(world)
    try:
        given: dict[str, Any] = {key: tuple(map(float, value)) for key, value in ends.items()}
        for key, value in given.items():
            if len(value) != (3 if key == "start" else 2):
                raise FieldError(key, f"must be {'x, y and yaw' if key == 'start' else 'x and y'}, got {value}")
        task = dataclasses.replace(task, **given) if given else task
        overlap = "" if robot is None else overlap_at(task.world, robot, task.start)
        if robot is not None and overlap:
            raise FieldError("start", f"{robot.name} {overlap}; move the start away from it")
    except FieldError as error:
        raise error.as_input() from None
    except (TypeError, ValueError):
        raise InputError(f"start, goal: must be numbers, got {ends}") from None
    return task


def repeated(task: Task, number: int) -> Task:
    """Return a task whose wandering movers have seeds, made from its number: each of its episodes has the same movers."""
    movers = tuple(
        dataclasses.replace(one, seed=1000 * number + i) if isinstance(one, Wandering) and one.seed is None else one
        for i, one in enumerate(task.world.movers)
    )
    world = task.world if movers == task.world.movers else dataclasses.replace(task.world, movers=movers)
    return dataclasses.replace(task, world=world)


@cached(4)
def _barn(source: str) -> tuple[Task, ...]:
    with tempfile.TemporaryDirectory() as folder:
        files = unpacked(Path(source), Path(folder)).rglob(WORLDS)
        return tuple(import_barn(path) for path in sorted(files, key=lambda path: (len(path.stem), path.stem)))
