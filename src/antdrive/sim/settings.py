"""From what people write about scenarios to the objects that it stands for: tasks, robots, fields of a scenario."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable
from typing import Any, TypeAlias, get_args

from antdrive.base.checks import suggest
from antdrive.base.errors import FieldError, InputError
from antdrive.robots import Avoidance, PurePursuit
from antdrive.sim.driving.perception import Perception, PerceptionKind
from antdrive.sim.driving.replanning import ReplanPolicy
from antdrive.sim.entries import SettingsEntry
from antdrive.worlds import Disc, Task, generate
from antdrive.worlds.reuse import reused

#: The error for a key, such as "planner.ants", and what is wrong with its value: file, line, key and problem.
Fail: TypeAlias = Callable[[str, str], InputError]


#: What a robot knows of the world and of its pose unless it is told otherwise: fields of a scenario.
SENSING: dict[str, Any] = {"map": "given", "localisation": "fixes", "odometry": 1.0}


def scenario_fields(entry: SettingsEntry, fail: Fail) -> dict[str, Any]:
    """The fields of a scenario that an entry's settings stand for, by name.

    Raises:
        InputError: an unknown setting, or a value that it cannot have.
    """
    avoiding = None if entry.avoid in (False, "none") else _record(fail, "avoid", Avoidance(), entry.avoid)
    return {
        "cell": entry.cell,
        "controller": _record(fail, "controller", PurePursuit(), entry.controller),
        "perception": _perception(fail, entry.sees),
        "avoidance": avoiding,
        "replanning": _replanning(fail, entry),
        "unseen": tuple(Disc(disc.x, disc.y, disc.radius, disc.height) for disc in entry.unseen),
        "time_limit": entry.time_limit,
        "physics_hz": entry.physics_hz,
        "control_hz": entry.control_hz,
        # The names of a campaign's runs are made of all of this: they are as they were before there were these settings.
        **{key: getattr(entry, key) for key, usual in SENSING.items() if getattr(entry, key) != usual},
    }


@reused(64)
def generated(kind: str, seed: int, options: tuple[tuple[str, str], ...]) -> Task:
    """The random world that {generate: KIND, seed: SEED} with options stands for.

    Raises:
        InputError: an unknown kind or option, a wrong value, or no such world was found.
    """
    import numpy as np

    return generate(kind, np.random.default_rng(seed), dict(options), name=f"{kind}-{seed}", note=f"seed {seed}")


def _record(fail: Fail, key: str, default: Any, values: Any) -> Any:
    """A record of settings with some of them replaced."""
    if not isinstance(values, dict):
        return default
    known = [field.name for field in dataclasses.fields(default)]
    for name in values:
        if name not in known:
            raise fail(f"{key}.{name}", f"unknown setting; {suggest(name, known)}")
    try:
        return dataclasses.replace(default, **values)
    except FieldError as error:
        raise fail(f"{key}.{error.key}", error.problem) from None
    except TypeError:
        wrong = next((name for name, value in values.items() if not isinstance(value, int | float)), "")
        raise fail(f"{key}.{wrong}" if wrong else key, "must be a number") from None


def _replanning(fail: Fail, entry: SettingsEntry) -> ReplanPolicy | None:
    if entry.replan == "none":
        return None
    policy: ReplanPolicy = _record(fail, "replan", ReplanPolicy(), entry.replan)
    return dataclasses.replace(policy, around_movers=False) if entry.replan is False else policy


def _perception(fail: Fail, sees: str | None) -> Perception | None:
    if sees is None:
        return None
    kind, mark, metres = sees.partition(":")
    if kind not in get_args(PerceptionKind):
        raise fail("sees", f"unknown kind {kind!r}; choose from {', '.join(get_args(PerceptionKind))}")
    try:
        reach = float(metres) if mark else math.inf
    except ValueError:
        reach = math.nan
    if not reach > 0:
        raise fail("sees", "write KIND or KIND:METRES with a range greater than 0, such as positions:3")
    return Perception(kind=kind, range=reach)  # type: ignore[arg-type]
