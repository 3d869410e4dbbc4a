"""The log of one drive: everything that metrics, certificates and films read.

The file is a `.npz` readable with numpy alone (no pickles).
"""

from __future__ import annotations

import enum
import hashlib
import itertools
import json
import math
import zipfile
import zlib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from antdrive.worlds.errors import FieldError, InputError
from antdrive.worlds.files.atomic import written_whole
from antdrive.worlds.movers import mover_from_dict
from antdrive.worlds.trajectories import Trajectories
from antdrive.worlds.world import Disc, World

SCHEMA = 1


class Outcome(enum.Enum):
    """How a run ended. The value is the sentence shown to people.

    The first contact ends a drive, and says whose it is. `COLLIDED`: the robot's own, also with a mover that comes
    towards it while it drives. `RUN_INTO`: it stood still, and a mover came. `JUMPED_ON`: a mover whose loop teleports
    appeared on the robot, or nearer than it could stop. The last two are not counted against the planner; but none of
    the three is a success, and no drive with a contact is certified. See `antdrive.sim.log.contacts` for the exact rule.
    """

    SUCCEEDED = "stopped at the goal without contact"
    COLLIDED = "touched an obstacle"
    RUN_INTO = "was run into by a moving obstacle while it stood still"
    JUMPED_ON = "a moving obstacle appeared on the robot, or nearer than it could stop"
    TIMED_OUT = "the time limit passed before the goal was reached"
    STUCK = "stopped making progress"
    NO_PATH = "no path on this grid"
    STOPPED = "planning stopped early"


@dataclass(frozen=True, eq=False, kw_only=True)
class Rollout:
    """One drive, a row per physics step; row 0 is the start, before the first step."""

    t: npt.NDArray[np.float64]  # (T,) [s]
    pose: npt.NDArray[np.float64]  # (T, 3) x, y [m], yaw [rad] of the axle's centre
    twist: npt.NDArray[np.float64]  # (T, 2) measured forward speed [m/s] and yaw rate [rad/s]
    command: npt.NDArray[np.float64]  # (T, 2) commanded forward speed and yaw rate
    clearance: npt.NDArray[np.float64]  # (T,) robot's surface to the nearest disc's or wall's [m]
    limiter: npt.NDArray[np.uint8]  # (T,) the rule that held the speed, index into meta["limiters"]
    movers: npt.NDArray[np.float64]  # (T, M, 2) centres of moving obstacles [m]; radii are in meta["task"]["movers"]
    contacts: npt.NDArray[np.float64]  # (K, 4) step, obstacle index (discs, movers, walls), distance [m], force [N]
    route: npt.NDArray[np.float64]  # (N, 2) the line that was followed [m]
    cells: npt.NDArray[np.int32]  # (N, 2) the planned cells (row, col)
    estimate: npt.NDArray[np.float64] = field(
        default_factory=lambda: np.empty((0, 3))
    )  # (T, 3) where a noisy robot believed to be
    meta: Mapping[str, Any]  # world, planner, robot, seed, versions, outcome, times: see `Rollout.save`

    @property
    def outcome(self) -> Outcome:
        """How the run ended."""
        return Outcome[str(self.meta["outcome"]).upper()]

    @property
    def digest(self) -> str:
        """A SHA-256 of every array and of the metadata that a repetition must reproduce (all but wall times)."""
        sha = hashlib.sha256()
        for name in _ARRAYS:
            array = np.ascontiguousarray(getattr(self, name))
            sha.update(f"{name} {array.dtype.str} {array.shape}\n".encode())
            sha.update(array.tobytes())
        kept = {key: value for key, value in self.meta.items() if key not in ("digest", "times")}
        sha.update(json.dumps(kept, sort_keys=True).encode())
        return sha.hexdigest()

    def legs(self) -> list[tuple[slice, npt.NDArray[np.float64]]]:
        """The lines (N, 2) that were followed [m], each with the rows in which it was: the first, then what replans led to."""
        renewed = [(float(entry["t"]), entry["route"]) for entry in self.meta.get("replans", ()) if entry["solved"]]
        lines = [self.route, *(np.array(route, dtype=np.float64) for _, route in renewed)]
        rows = [0, *np.searchsorted(self.t, [t - 1e-9 for t, _ in renewed]).tolist(), len(self.t)]
        return [(slice(*ends), line) for ends, line in zip(itertools.pairwise(rows), lines, strict=True)]

    def traffic(self) -> Trajectories:
        """The movers as the log's own task and seed define them.

        Raises:
            ValueError: the task defines movers that cannot be.
        """
        task = self.meta["task"]
        entries = task.get("movers") or []
        if not entries:
            return Trajectories(np.empty(0), np.empty(0), ())
        try:
            discs = tuple(Disc(d["x"], d["y"], d["radius"], d["height"]) for d in task["obstacles"])
            world = World("log", tuple(task["bounds"]), discs, movers=tuple(map(mover_from_dict, entries)))
            return Trajectories.of(world, (task["start"][0], task["start"][1]), self.meta["seed"])
        except (KeyError, TypeError, AttributeError, OverflowError) as error:
            raise FieldError("movers", f"{error!r}") from None

    def save(self, path: str | Path) -> Path:
        """Write the log, whole or not at all; the metadata gain the digest."""
        target = Path(path)
        meta = json.dumps({**self.meta, "digest": self.digest}, sort_keys=True)
        with written_whole(target) as temporary, temporary.open("wb") as file:
            np.savez_compressed(file, meta=np.array(meta), **{name: getattr(self, name) for name in _ARRAYS})
        return target

    @classmethod
    def load(cls, path: str | Path) -> Rollout:
        """Read a log.

        Raises:
            InputError: no such file, not a rollout, or written by a newer version.
        """
        try:
            with Path(path).open("rb") as raw, zipfile.ZipFile(raw):  # a plain array is no archive
                pass
            with Path(path).open("rb") as raw, np.load(raw, allow_pickle=False) as file:
                arrays = {name: file[name] for name in (*_ARRAYS, "meta")}
                meta = json.loads(str(arrays.pop("meta")[()]))
        except FileNotFoundError:
            raise InputError(f"{path}: no such file") from None
        except KeyError as error:
            raise InputError(f"{path}: not a rollout: {error.args[0]}") from None
        except RecursionError:
            raise InputError(f"{path}: meta: nested too deeply") from None
        except (OSError, ValueError, EOFError, zipfile.BadZipFile, zlib.error) as error:
            problem = getattr(error, "strerror", None) or str(error).splitlines()[0]
            raise InputError(f"{path}: not a rollout ({problem})") from None
        if not isinstance(meta, dict) or meta.get("schema") != SCHEMA:
            found = meta.get("schema") if isinstance(meta, dict) else meta
            raise InputError(
                f"{path}: meta.schema: this version reads rollouts of schema {SCHEMA}, found {found!r:.40}"
            )
        if "digest" not in meta:
            raise InputError(f"{path}: meta.digest: missing; a log that antdrive wrote has one")
        loaded = cls(**arrays, meta=meta)
        problems = loaded.problems()
        if problems:
            raise InputError(f"{path}: {problems[0]}")
        return loaded

    def _repr_html_(self) -> str:
        from antdrive.worlds import task_from_dict
        from antdrive.worlds.drawing import LINE, card, world_svg

        task = task_from_dict(self.meta["task"], "rollout")
        lines = [(self.route, "#182242", True), (self.pose[::12, :2], LINE, False)]
        goal = (*task.goal, task.goal_tolerance)
        picture = world_svg(task.world.bounds, task.world.discs, start=task.start, goal=goal, lines=lines)
        facts = {"planner": self.meta["planner"]["name"], "robot": self.meta["robot"]["name"], "time": f"{self.t[-1]:.1f} s",
                 "least clearance": f"{self.clearance.min():.3f} m"}  # fmt: skip
        return card(picture, f"{task.world.name}: {self.outcome.value}", facts)

    def problems(self) -> list[str]:
        """What no log of a drive can look like: a sentence for each array or entry of wrong shape or kind."""
        return [*self._array_problems(), *_meta_problems(self.meta)]

    def _array_problems(self) -> Iterator[str]:
        rows = self.t.shape[0] if self.t.ndim else 0
        shapes = {
            "t": (rows,), "pose": (rows, 3), "twist": (rows, 2), "command": (rows, 2), "clearance": (rows,),
            "limiter": (rows,), "contacts": (None, 4), "movers": (rows, None, 2), "route": (None, 2), "cells": (None, 2),
            "estimate": (rows if np.size(self.estimate) else 0, 3),
        }  # fmt: skip
        if rows == 0:
            yield "t: the log is empty"
        for name, shape in shapes.items():
            array = getattr(self, name)
            fits = len(array.shape) == len(shape) and all(
                m in (None, n) for n, m in zip(array.shape, shape, strict=True)
            )
            if not fits:
                yield f"{name}: shape {array.shape} where {_told(shape)} is due"
            elif array.dtype.kind not in "fiu":
                yield f"{name}: holds {array.dtype} where numbers are due"
            elif not np.isfinite(array).all():
                yield f"{name}: holds numbers that are not finite"
        steps = self.contacts[:, 0] if self.contacts.ndim == 2 and self.contacts.shape[1:] == (4,) else np.empty(0)
        if steps.size and steps.dtype.kind in "fiu" and not (steps.min() >= 0 and steps.max() < rows):
            yield "contacts: a step outside the log"
        told = _mapping(self.meta.get("task")).get("movers") or []
        if self.movers.ndim == 3 and isinstance(told, list) and self.movers.shape[1] != len(told):
            yield f"movers: {self.movers.shape[1]} of them where the task has {len(told)}"


_ARRAYS = tuple(f.name for f in fields(Rollout) if f.name != "meta")


def _told(shape: tuple[int | None, ...]) -> str:
    return "(" + ", ".join("any" if n is None else str(n) for n in shape) + ("," if len(shape) == 1 else "") + ")"


def _meta_problems(meta: Mapping[str, Any]) -> Iterator[str]:
    """What is missing or impossible in the metadata that certificates, metrics and films read."""
    task, robot, plan = (_mapping(meta.get(key)) for key in ("task", "robot", "plan"))
    foot = _mapping(robot.get("footprint"))
    checks: list[tuple[str, bool]] = [
        ("outcome", str(meta.get("outcome")).upper() in Outcome.__members__),
        ("physics_hz", _numbers([meta.get("physics_hz")], 1) and meta["physics_hz"] >= 1),
        ("task.bounds", _numbers(task.get("bounds"), 4)),
        ("task.start", _numbers(task.get("start"), 3)),
        ("task.goal", _numbers(task.get("goal"), 2)),
        ("task.goal_tolerance", _numbers([task.get("goal_tolerance")], 1) and task["goal_tolerance"] > 0),
        ("robot.footprint", _numbers([foot.get(k) for k in ("half_length", "half_width", "rounding")], 3)
            and min(foot.values()) >= 0 < max(foot.values())),
        ("plan", all(_numbers([plan.get(k)], 1, finite=False) for k in ("length_m", "grid_optimum_m", "euclidean_optimum_m"))),
        ("inflate", _numbers([meta.get("inflate")], 1)),
    ]  # fmt: skip
    for key, fine in checks:
        if not fine:
            yield f"meta.{key}: missing or impossible"
    obstacles = task.get("obstacles")
    if not isinstance(obstacles, list):
        yield "meta.task.obstacles: missing"
        return
    for i, disc in enumerate(obstacles):
        if not (_numbers([_mapping(disc).get(k) for k in ("x", "y", "radius", "height")], 4) and disc["radius"] > 0):
            yield f"meta.task.obstacles[{i}]: missing or impossible"
    replans = meta.get("replans", [])
    if not isinstance(replans, list):
        yield "meta.replans: impossible"
        return
    now = 0.0
    for i, replan in enumerate(replans):
        route: Any = _mapping(replan).get("route")
        fine = _numbers([_mapping(replan).get("t")], 1) and isinstance(route, list)
        fine = fine and isinstance(replan.get("cause"), str) and replan.get("solved") is (len(route) > 1)
        if not (fine and replan["t"] >= now and all(_numbers(point, 2) for point in route)):
            yield f"meta.replans[{i}]: missing or impossible"
            return
        now = replan["t"]
    movers = task.get("movers", [])
    if not isinstance(movers, list):
        yield "meta.task.movers: impossible"
        return
    for i, mover in enumerate(movers):
        if not (_numbers([_mapping(mover).get("radius")], 1) and mover["radius"] > 0):
            yield f"meta.task.movers[{i}]: missing or impossible"


def _mapping(value: Any) -> Mapping[str, Any]:
    return value if isinstance(value, dict) else {}


def _numbers(values: Any, count: int, *, finite: bool = True) -> bool:
    return (
        isinstance(values, list | tuple)
        and len(values) == count
        and all(isinstance(v, int | float) and not isinstance(v, bool) for v in values)
        and (not finite or all(math.isfinite(v) for v in values))
    )
