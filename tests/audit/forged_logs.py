"""Forged and broken logs for `tests.audit.forgeries`. Each changes a genuine log and updates its digest."""

from __future__ import annotations

import copy
import dataclasses
import hashlib
import io
import json
import math
import struct
import warnings
import zipfile
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from antdrive.base.errors import FieldError, InputError
from antdrive.sim import Rollout
from antdrive.sim.log.certificate import closed_form_clearance
from antdrive.sim.log.consistency import OPTIMA
from antdrive.sim.log.record import DriveRecord
from antdrive.sim.log.rollout import FORMS, SENSED
from antdrive.sim.recording import optima_of
from antdrive.worlds import point_clearance

Array = npt.NDArray[Any]
LEVELS = ("load", "verify", "files", "replay", "none")
UNHASHED = ("digest", "times", "written")  # keys of the record that the digest does not cover
ROWS = ("t", "pose", "twist", "command", "clearance", "limiter", "movers", "estimate", "actuated")


@dataclass
class Log:
    """A mutable log.

    Attributes:
        arrays: the arrays by name
        record: the record as JSON holds it
        sealed: a digest to write in place of the right one
    """

    arrays: dict[str, Array]
    record: dict[str, Any]
    sealed: str | None = None

    @classmethod
    def of(cls, rollout: Rollout) -> Log:
        """Copy a log."""
        return cls({name: getattr(rollout, name).copy() for name in FORMS}, copy.deepcopy(rollout.record.as_dict()))

    def __getitem__(self, name: str) -> Array:
        return self.arrays[name]

    @property
    def hz(self) -> int:
        return int(self.record["physics_hz"])

    @property
    def world(self) -> dict[str, Any]:
        world: dict[str, Any] = self.record["task"]
        return world

    def put(self, **arrays: Array) -> Log:
        """Replace arrays."""
        self.arrays |= arrays
        return self

    def note(self, **values: Any) -> Log:
        """Replace values of the record."""
        self.record |= values
        return self

    def fill(self, value: Any, name: str, at: Any = ...) -> Log:
        """Set the values of an array at some places, by default all."""
        self[name][at] = value
        return self

    def plus(self, value: float, name: str, at: Any = ...) -> Log:
        """Add to the values of an array."""
        self[name][at] += value
        return self

    def times(self, factor: float, name: str, at: Any = ...) -> Log:
        """Multiply the values of an array."""
        self[name][at] *= factor
        return self

    def rows(self, chosen: slice | Array) -> Log:
        """Keep only some rows, with consistent times, and their contacts."""
        count = len(self["t"])
        where = np.arange(count)[chosen]
        for name in ROWS:
            if len(self[name]) == count:
                self.arrays[name] = self[name][where]
        self.arrays["t"] = np.arange(len(where)) / self.hz
        contacts = self["contacts"][np.isin(self["contacts"][:, 0], where)]
        contacts[:, 0] = np.searchsorted(where, contacts[:, 0])
        self.arrays["contacts"] = contacts
        kept = np.isin(self["scan_rows"], where)
        self.arrays |= {"scans": self["scans"][kept], "scan_rows": self["scan_rows"][kept]}
        self["scan_rows"][:] = np.searchsorted(where, self["scan_rows"])
        for name in ("seen", "tracks"):
            self.arrays[name] = self[name][np.isin(self[name][:, 0], where)]
            self[name][:, 0] = np.searchsorted(where, self[name][:, 0])
        return self

    def rollout(self) -> Rollout:
        """Return the log as antdrive reads it."""
        return Rollout(**self.arrays, record=DriveRecord.from_json(json.dumps(self.record)))

    def consistent(self) -> Log:
        """Return the log with movers and clearances recomputed from its record and poses."""
        rollout = self.rollout()
        movers = rollout.trajectories().positions(rollout.t)
        rollout = dataclasses.replace(rollout, movers=movers)
        self.arrays |= {"movers": movers, "clearance": closed_form_clearance(rollout)}
        return self

    def write(self, path: Path) -> None:
        """Write the log with a matching digest (docs/reference/rollout-format.md)."""
        try:
            text = DriveRecord.from_json(json.dumps(self.record)).to_json(without=UNHASHED)
        except (FieldError, InputError, ValueError):
            values = {key: value for key, value in self.record.items() if key not in UNHASHED}
            text = json.dumps(values, sort_keys=True)
        self.record["digest"] = self.sealed or digest(self.arrays, text)
        written = {name: np.ascontiguousarray(self[name]) for name in written_of(self.arrays)}
        arrays = {"record": np.array(json.dumps(self.record, sort_keys=True)), **written}
        with path.open("wb") as file:
            np.savez_compressed(file, **arrays)


def written_of(arrays: Mapping[str, Array]) -> list[str]:
    """Return the names of the arrays in a file."""
    return [name for name in FORMS if name not in SENSED or arrays[name].size]


def digest(arrays: Mapping[str, Array], text: str) -> str:
    """Recompute the digest of a log."""
    sha = hashlib.sha256()
    for name in written_of(arrays):
        array = np.ascontiguousarray(arrays[name])
        sha.update(f"{name} {array.dtype.str} {array.shape}\n".encode() + array.tobytes())
    sha.update(text.encode())
    return sha.hexdigest()


# The forgeries. Each changes a log, and returns None where it makes no sense.

Forger = Callable[[Log], Log | None]
Breaker = Callable[[bytes], bytes]


@dataclass(frozen=True)
class Kind:
    """A kind of forgery.

    Attributes:
        name: what is forged
        level: the last level at which each of these must be found
        forge: changes a log
        breaks: changes a file's bytes instead
    """

    name: str
    level: str
    forge: Forger | None = None
    breaks: Breaker | None = None


KINDS: dict[str, Kind] = {}


def guarded(forge: Callable[[Log], Log | None], when: str) -> Forger:
    """Register a forger for drives that match all words of `when`; a forger that returns None changed its log in place."""

    def forged(log: Log) -> Log | None:
        return (forge(log) or log) if all(WHEN[word](log) for word in when.split()) else None

    return forged


def forgery(name: str, level: str, when: str = "") -> Callable[[Callable[..., Log | None]], None]:
    """Register a function as a kind of forgery of some drives."""

    def register(forge: Callable[[Log], Log | None]) -> None:
        KINDS[name] = Kind(name, level, forge=guarded(forge, when))

    return register


def breakage(name: str) -> Callable[[Breaker], Breaker]:
    """Register a function that breaks a file."""

    def register(breaks: Breaker) -> Breaker:
        KINDS[name] = Kind(name, "load", breaks=breaks)
        return breaks

    return register


def collided(log: Log) -> bool:
    return bool(len(log["contacts"]))


def noisy(log: Log) -> bool:
    return bool(len(log["actuated"]))


def moving(log: Log) -> bool:
    return bool(log["movers"].shape[1])


#: The drives that a kind of forgery is for.
WHEN: dict[str, Callable[[Log], bool]] = {
    "collided": collided,
    "arrived": lambda log: not collided(log),
    "noisy": noisy,
    "exact": lambda log: not noisy(log),
    "moving": moving,
    "still": lambda log: not moving(log),
    "long": lambda log: len(log["t"]) > 4 * log.hz,
    "mapped": lambda log: (log.record.get("sensing") or {}).get("map") != "none",
    "gridded": lambda log: len(log["cells"]) > 1 and log.record["plan"]["cost_m"] is not None,
    "angular": lambda log: not log.rollout().record.robot.footprint.is_disc,
    "disc": lambda log: "footprint_margin" not in log.record,
    "short": lambda log: len(log["t"]) <= 4 * log.hz,
}


# Arrays of other kinds, shapes and values

_DTYPES = {
    "int8": "i1", "int16": "i2", "int32": "i4", "float16": "f2", "float32": "f4", "complex numbers": "c16",
    "big-endian numbers": ">f8", "text": "U32", "truth values": "?",
}  # fmt: skip
for _as, _dtype in _DTYPES.items():

    @forgery(f"poses as {_as}", "load")
    def _(log: Log, dtype: str = _dtype) -> Log:
        log.arrays["pose"] = log["pose"].astype(dtype)
        return log


for _value, _named in ((np.nan, "NaN"), (np.inf, "infinity"), (1e300, "1e300")):

    @forgery(f"a pose of {_named}", "load")
    def _(log: Log, value: float = _value) -> Log:
        log["pose"][5, 0] = value
        return log


# Records of no drive


def edited(*path: str | int, to: Any) -> Forger:
    """Replace one value of the record."""

    def forge(log: Log) -> Log | None:
        inner: Any = log.record
        for key in path[:-1]:
            if isinstance(inner, dict) and key not in inner:
                return None
            inner = inner[key]
        inner[path[-1]] = to
        return log

    return forge


_HUGE = 10**400
_DEEP: Any = []
for _ in range(150):
    _DEEP = [_DEEP]
for _name, _path, _to in (
    ("a schema of true", ("schema",), True),
    ("a later schema", ("schema",), 3),
    ("an unknown key", ("extra",), 1),
    ("a time limit of 400 digits", ("time_limit",), _HUGE),
    ("a margin of 400 digits", ("margin",), _HUGE),
    ("an unknown outcome", ("outcome",), "won"),
    ("an unknown smoothing", ("smoothing", "asked"), "magic"),
    ("a route of unknown smoothing", ("smoothing", "made"), "magic"),
    ("an unknown perception", ("perception",), {"kind": "clairvoyance", "range_m": None}),
    ("a perception within -3 m", ("perception",), {"kind": "positions", "range_m": -3.0}),
    ("physics at 1 MHz", ("physics_hz",), 1_000_000),
    ("a time limit of 0", ("time_limit",), 0.0),
    ("a cell of -1", ("cell",), -1.0),
    ("a robot without mass", ("robot", "mass"), 0.0),
    ("a robot of 1 mm", ("robot", "footprint"), {"half_length": 0.0, "half_width": 0.0, "rounding": 0.001}),
    ("an unknown key in the footprint", ("robot", "footprint", "colour"), 1),
    ("a cylinder of height -5", ("task", "obstacles", 0, "height"), -5.0),
    ("a cylinder of radius 0", ("task", "obstacles", 0, "radius"), 0.0),
    ("a start out of bounds", ("task", "start"), [-5.0, 1.0, 0.0]),
    ("bounds the wrong way round", ("task", "bounds"), [6.0, 0.0, 0.0, 3.5]),
    ("a mover of 1 km/s", ("task", "movers", 0, "velocity"), [1000.0, 0.0]),
    ("a mover 1e300 s ahead", ("task", "movers", 0, "phase"), 1e300),
    ("a wanderer of 1e-9 s a step", ("task", "movers", 2, "walk", "period"), 1e-9),
    ("a wanderer of cells of 1e-9 m", ("task", "movers", 2, "walk", "cell"), 1e-9),
    ("a wanderer 200,000 steps ahead", ("task", "movers", 2), {
        "radius": 0.15, "height": 1.0, "phase": 1e4, "walk": {"cell": 0.5, "period": 0.05, "start": [5.2, 0.6]},
    }),
):  # fmt: skip
    KINDS[_name] = Kind(_name, "load", forge=edited(*_path, to=_to))


@forgery("5,000 movers", "load", "moving")
def _(log: Log) -> Log:
    log = log.rows(slice(50))
    log.world["movers"] = [log.world["movers"][0]] * 5000
    log.arrays["movers"] = np.repeat(log["movers"][:, :1], 5000, axis=1)
    return log


@forgery("1,000 wanderers that take 20 steps a second", "load", "moving")
def _(log: Log) -> Log:
    """Forge a log of few rows, one per second, that spans hours."""
    log = log.rows(slice(500))
    walk = {"cell": 0.5, "period": 0.05, "start": [5.2, 0.6]}
    log.world["movers"] = [{"radius": 0.15, "height": 1.0, "walk": walk}] * 1000
    log.record["physics_hz"] = log.record["control_hz"] = 1
    log.arrays["movers"] = np.repeat(log["movers"][:, :1], 1000, axis=1)
    return log


@forgery("no seed in the record", "load")
def _(log: Log) -> None:
    del log.record["seed"]


# One value of the record, and the drives for which that makes sense

for _name, _level, _when, _path, _to in (
    ("settings nested 150 deep", "load", "", ("planner", "settings",), {"deep": _DEEP}),
    ("a higher noise level", "replay", "noisy", ("noise",), 1.1),
    ("an optimum shorter than the straight line", "verify", "", ("plan", "euclidean_optimum_m",), 1.0),
    ("an optimum of 60 m", "verify", "", ("plan", "euclidean_optimum_m",), 60.0),
    ("an optimum of 60 m on the grid", "verify", "", ("plan", "grid_optimum_m",), 60.0),
    ("no optimum", "verify", "", ("plan", "euclidean_optimum_m",), None),
    ("no optimum on the grid", "verify", "", ("plan", "grid_optimum_m",), None),
    ("another planner's name", "replay", "", ("planner", "name",), "ants"),
    ("less work", "replay", "", ("plan", "work",), 1),
    ("other versions", "none", "", ("versions",), {"antdrive": "9.9"}),
    ("other settings of the controller", "none", "", ("controller", "settings", "lookahead_max",), 9.0),
    ("a margin of 1 m", "verify", "", ("margin",), 1.0),
    ("an inflation of 1 cm", "verify", "", ("inflate",), 0.01),
    ("a success that was timed out", "verify", "arrived", ("outcome",), "timed_out"),
    ("a success that was stuck", "verify", "arrived still", ("outcome",), "stuck"),
    ("a success among movers that was stuck", "verify", "moving", ("outcome",), "stuck"),
    ("a success that was blocked", "verify", "arrived", ("outcome",), "blocked"),
    ("a collision that is none", "verify", "arrived", ("outcome",), "collided"),
    ("a collision called a success", "verify", "collided", ("outcome",), "succeeded"),
    ("a time limit that was over", "verify", "arrived", ("time_limit",), 1.0),
    ("a goal elsewhere", "verify", "arrived", ("task", "goal",), [1.0, 2.8]),
    ("a tolerance of 100 m", "files", "arrived", ("task", "goal_tolerance",), 100.0),
    ("nothing perceived among movers", "verify", "moving", ("perception",), None),
    ("movers perceived where there are none", "verify", "still", ("perception",), {"kind": "velocities", "range_m": None}),
    ("no avoidance", "replay", "moving", ("avoidance",), None),
    ("other wall-clock times", "none", "", ("times", "plan_s",), 0.0),
):  # fmt: skip
    KINDS[_name] = Kind(_name, _level, forge=guarded(edited(*_path, to=_to), _when))


# Rows that are those of no drive


@forgery("two rows, the start and the goal, at rest", "verify")
def _(log: Log) -> Log:
    log = log.rows(np.array([0, len(log["t"]) - 1]))
    log["twist"][:] = 0.0
    return log.consistent()


@forgery("two rows on either side of a post", "verify")
def _(log: Log) -> Log:
    log = log.rows(np.arange(2))
    log.record["outcome"] = "stuck"
    x, y = log.world["obstacles"][0]["x"], log.world["obstacles"][0]["y"]
    log.world["start"] = [x - 0.8, y, 0.0]
    log["pose"][:] = [[x - 0.8, y, 0.0], [x + 0.8, y, 0.0]]
    log["twist"][:] = 0.0
    return log.consistent()


@forgery("a speed of 800 m/s", "verify")
def _(log: Log) -> None:
    log["twist"][:, 0] *= 800.0 / max(1e-9, float(np.abs(log["twist"][:, 0]).max()))


@forgery("a slide of 4 cm/s at the end", "verify", "arrived")
def _(log: Log) -> Log:
    extra = 240
    for name in ROWS:
        if len(log[name]) == len(log["t"]) and name != "t":
            log.arrays[name] = np.concatenate([log[name], np.repeat(log[name][-1:], extra, axis=0)])
    log.arrays["t"] = np.arange(len(log["t"]) + extra) / log.hz
    aside = 0.04 * np.arange(1, extra + 1) / log.hz
    yaw = log["pose"][-1, 2]
    for name in ("pose", "estimate") if noisy(log) else ("pose",):
        log[name][-extra:, 0] -= aside * math.sin(yaw)
        log[name][-extra:, 1] += aside * math.cos(yaw)
    log["twist"][-extra:] = 0.0
    log["command"][-extra:] = 0.0
    return log.consistent()


@forgery("100 rows per second", "verify")
def _(log: Log) -> Log:
    log.record["physics_hz"] = 100
    log.record["control_hz"] = 50
    log.arrays["t"] = np.arange(len(log["t"])) / 100
    return log.consistent()


@forgery("one row per second", "verify")
def _(log: Log) -> Log:
    log.record["physics_hz"] = log.record["control_hz"] = 1
    log.record["time_limit"] = 1e6
    log.arrays["t"] = np.arange(len(log["t"]), dtype=np.float64)
    return log.consistent()


@forgery("10,000 rows per second", "verify")
def _(log: Log) -> Log:
    log.record["physics_hz"] = log.record["control_hz"] = 10_000
    log.arrays["t"] = np.arange(len(log["t"])) / 10_000
    return log.consistent()


@forgery("half a second left out", "verify")
def _(log: Log) -> Log:
    middle = len(log["t"]) // 3
    return log.rows(np.concatenate([np.arange(middle), np.arange(middle + log.hz // 2, len(log["t"]))])).consistent()


def _bent(log: Log, aside: float, *, follow: bool, seconds: float = 1.0, whole: bool = False) -> Log:
    """Bend the path to the side and back; `follow`: heading and measured speeds follow the bend."""
    end = int(log["contacts"][0, 0]) - 2 if collided(log) else len(log["t"])
    length = end if whole else min(end - 2, round(2 * seconds * log.hz))
    first = 0 if whole else max(1, (end - length) // 3)
    some = slice(first, first + length)
    bump = aside * np.sin(np.linspace(0.0, math.pi, length)) ** 2
    before = log["pose"].copy()
    pose = log["pose"]
    yaw = np.unwrap(pose[:, 2])
    pose[some, 0] -= bump * np.sin(yaw[some])
    pose[some, 1] += bump * np.cos(yaw[some])
    if follow:
        speed = log["twist"][some, 0]
        slope = np.gradient(bump) * log.hz
        lean = np.where(np.abs(speed) > 0.05, np.arctan2(slope, np.maximum(speed, 0.05)), 0.0)
        pose[some, 2] += lean
        step = np.diff(pose[some, :2], axis=0)
        middle = pose[some, 2][:-1] + np.diff(np.unwrap(pose[some, 2])) / 2
        along = (step * np.column_stack([np.cos(middle), np.sin(middle)])).sum(axis=1) * log.hz
        rate = np.diff(np.unwrap(pose[some, 2])) * log.hz
        log["twist"][some, 0] = np.interp(np.arange(length), np.arange(length - 1) + 0.5, along)
        log["twist"][some, 1] = np.interp(np.arange(length), np.arange(length - 1) + 0.5, rate)
        pose[:, 2] = np.angle(np.exp(1j * pose[:, 2]))
    if noisy(log):
        log["estimate"][:] += pose - before
    return log.consistent()


def _commanded(log: Log) -> Log:
    """Make commands and motor targets consistent with the measured speeds."""
    period = log.hz // int(log.record["control_hz"])
    count = len(log["t"])
    held = 1 + (np.arange(1, count) - 1) // period * period + period - 1
    target = log["twist"][np.minimum(held, count - 1)]
    robot = log.record["robot"]
    limits = np.array([robot["max_speed"], robot["max_yaw_rate"]])
    target = np.clip(target, -limits, limits)
    log["command"][1:] = target
    if noisy(log):
        late = round(robot["noise"]["delay"] * log.record["noise"] * log.record["control_hz"]) * period
        log["actuated"][1:] = target
        log["command"][:] = np.concatenate([log["actuated"][late:], np.repeat(log["actuated"][-1:], late, axis=0)])
        log["command"][0] = 0.0
    return log


def _mirrored(log: Log) -> Log:
    axis = sum(log.world["bounds"][1::2])
    for name in ("pose", "estimate"):
        if len(log[name]):
            log[name][:, 1] = axis - log[name][:, 1]
            log[name][:, 2] *= -1
    for name in ("twist", "command", "actuated"):
        log[name][:, 1] *= -1
    return log


def _timed_out(log: Log) -> Log:
    return log.note(outcome="timed_out", time_limit=float(log["t"][-1]))


def _consistent_among_movers(log: Log) -> Log:
    return log.consistent() if moving(log) else log


# Commands, noise, plan


@forgery("commands a second early", "verify")
def _(log: Log) -> None:
    log["command"][1:] = np.concatenate([log["command"][1 + log.hz :], np.repeat(log["command"][-1:], log.hz, axis=0)])


@forgery("targets without slip", "replay", "noisy")
def _(log: Log) -> None:
    late = round(log.record["robot"]["noise"]["delay"] * log.record["control_hz"]) * log.hz // log.record["control_hz"]
    log.arrays["actuated"] = np.concatenate([np.zeros((late, 2)), log["command"][:-late]])
    log["actuated"][: late + 1] = 0.0


@forgery("noise left out", "none", "noisy")
def _(log: Log) -> None:
    log.record["noise"] = 0.0
    log.arrays |= {"command": log["actuated"], "actuated": np.empty((0, 2)), "estimate": np.empty((0, 3))}


@forgery("noise that was not there", "replay", "exact")
def _(log: Log) -> Log:
    log.record["noise"] = 0.01
    return _with_noise(log)


def _with_noise(log: Log) -> Log:
    late = round(log.record["robot"]["noise"]["delay"] * log.record["noise"] * log.record["control_hz"])
    assert late == 0
    log.arrays |= {"actuated": log["command"].copy(), "estimate": log["pose"].copy()}
    return log


def _along_the_wall(log: Log) -> Log:
    (x, y, _), (gx, gy) = log.world["start"], log.world["goal"]
    low = float(log.record["inflate"]) + 0.01
    log.arrays["route"] = np.array([[x, y], [x, low], [gx, low], [gx, gy]])
    return log


@forgery("a route with 5 m more", "verify")
def _(log: Log) -> None:
    log.record["plan"]["length_m"] += 5.0


@forgery("cells straight through the posts", "verify")
def _(log: Log) -> None:
    (r, c), (gr, gc) = log["cells"][0], log["cells"][-1]
    steps = max(abs(gr - r), abs(gc - c)) + 1
    line = np.column_stack([np.linspace(r, gr, steps), np.linspace(c, gc, steps)])
    log.arrays["cells"] = np.rint(line).astype(np.int32)


@forgery("a plan that costs half", "verify")
def _(log: Log) -> None:
    log.record["plan"]["cost_m"] /= 2


@forgery("an optimum longer than the plan", "verify")
def _(log: Log) -> None:
    log.record["plan"]["grid_optimum_m"] = 2 * log.record["plan"]["length_m"]


def _with_optima(log: Log) -> None:
    """Let the optima be those of the record's world, margins and cells."""
    r = log.rollout().record
    found = optima_of(r.task, r.cell, r.robot, r.margin, r.footprint_margin)
    log.record["plan"] |= dict(zip(OPTIMA, found, strict=True))


@forgery("an optimum of a margin that closes the cells' gaps", "verify", "gridded disc")
def _(log: Log) -> None:
    """Raise the margin by less than the routes' slack, just above the room of the cells."""
    r, cells = log.rollout().record, log["cells"]
    room = float(point_clearance(r.task.world, (cells[:, ::-1] + 0.5) * r.cell + r.world.bounds[:2]).min())
    log.record |= {"margin": room + 1e-3 - r.robot.radius, "inflate": room + 1e-3}
    _with_optima(log)


for _more in (7e-4, 0.0117, 0.6):  # margins are whole millimetres

    @forgery(f"an optimum of a footprint kept {1000 * _more:g} mm clearer", "verify")
    def _(log: Log, more: float = _more) -> None:
        log.record["footprint_margin"] = log.record.get("footprint_margin", log.record["margin"]) + more
        _with_optima(log)


@forgery("an optimum of a footprint where the settings plan for the disc", "verify", "disc")
def _(log: Log) -> None:
    log.record["settings"] = {**(log.record.get("settings") or {}), "footprint": "disc"}
    log.record["footprint_margin"] = log.record["margin"]
    _with_optima(log)


@forgery("no footprint's margin where the settings plan for it", "verify", "angular")
def _(log: Log) -> None:
    log.record["settings"] = {**(log.record.get("settings") or {}), "footprint": "exact"}
    log.record.pop("footprint_margin", None)


@forgery("an optimum longer than the plan's line and its leads", "verify", "gridded")
def _(log: Log) -> None:
    r = log.rollout().record
    first, last = (log["cells"][[0, -1], ::-1] + 0.5) * r.cell + r.world.bounds[:2]
    leads = math.dist(first, r.task.start[:2]) + math.dist(last, r.task.goal)
    log.record["plan"]["length_m"] = max(0.0, (r.plan.euclidean_optimum_m or 0.0) - leads - 0.05)


@forgery("a route cut short, as by a planner that decides cell by cell", "verify", "mapped moving")
def _(log: Log) -> None:
    start = log["route"][0]
    log.arrays["route"] = np.array([start, start + (0.2, 0.0)])
    _replanned(log, "decision", t=0.0)


@forgery("a margin of 1 m, inflation to match", "verify")
def _(log: Log) -> None:
    log.record["inflate"] += 1.0 - log.record["margin"]
    log.record["margin"] = 1.0


# Outcome and end


@forgery("contacts left out, the poses held back", "verify", "collided")
def _(log: Log) -> Log:
    """Stop the robot at once, 2 cm before the post."""
    touch = int(log["contacts"][0, 0])
    last = int(np.flatnonzero(log["clearance"][:touch] > 0.02)[-1])
    for name in ("pose", "twist"):
        log[name][last:] = log[name][last]
    log["twist"][last:] = 0.0
    log.arrays["contacts"] = log["contacts"][:0]
    _timed_out(log)
    return log.consistent()


@forgery("contacts left out, the path bent around", "verify", "collided")
def _(log: Log) -> Log:
    count = len(log["t"])
    aside = 0.35 * np.sin(np.linspace(0.0, math.pi / 2, count)) ** 2
    yaw = log["pose"][:, 2].copy()
    log["pose"][:, 0] -= aside * np.sin(yaw)
    log["pose"][:, 1] += aside * np.cos(yaw)
    log.arrays["contacts"] = log["contacts"][:0]
    _timed_out(log)
    return log.consistent()


@forgery("a collision cut off before the contact", "none", "collided")
def _(log: Log) -> Log:
    """Cut the log where physics is genuine, and forge the time limit."""
    period = log.hz // int(log.record["control_hz"])
    log = log.rows(slice(((int(log["contacts"][0, 0]) - 8) // period - 2) * period + 1))
    _timed_out(log)
    return log


@forgery("a success cut off at speed", "verify", "arrived")
def _(log: Log) -> Log:
    left = np.hypot(*(log["pose"][:, :2] - log.world["goal"]).T)
    return log.rows(slice(int((left < log.world["goal_tolerance"]).argmax()) + 1))


@forgery("a success cut off half way, timed out", "none", "arrived")
def _(log: Log) -> Log:
    log = log.rows(slice(len(log["t"]) // 8 * 4 + 1))
    _timed_out(log)
    log.record["replans"] = [r for r in log.record["replans"] if r["t"] <= log["t"][-1]]
    log.record["times"]["replans_s"] = log.record["times"]["replans_s"][: len(log.record["replans"])]
    return log


# Other worlds and robots, all else to match


@forgery("a post left out", "files", "arrived")
def _(log: Log) -> Log:
    del log.world["obstacles"][0]
    return log.consistent()


@forgery("a post half as wide", "files", "arrived")
def _(log: Log) -> Log:
    log.world["obstacles"][0]["radius"] /= 2
    return log.consistent()


@forgery("cut half way, a tolerance of 100 m", "verify", "arrived")
def _(log: Log) -> Log:
    log.world["goal_tolerance"] = 100.0
    return log.rows(slice(len(log["t"]) // 2))


@forgery("a robot 2 cm smaller", "files", "arrived")
def _(log: Log) -> Log:
    foot = log.record["robot"]["footprint"]
    if foot["half_length"]:
        foot["half_length"] -= 0.01
    else:
        foot["rounding"] -= 0.01
    rollout = log.rollout()
    log.record["inflate"] = rollout.record.robot.radius + log.record["margin"]
    return log.consistent()


@forgery("a robot that may be faster", "files", "arrived")
def _(log: Log) -> None:
    log.record["robot"]["max_speed"] *= 2


@forgery("a lighter robot", "files", "arrived")
def _(log: Log) -> None:
    log.record["robot"]["mass"] *= 0.9


@forgery("world and drive mirrored", "files", "arrived still")
def _(log: Log) -> Log:
    axis = sum(log.world["bounds"][1::2])
    _mirrored(log)
    for disc in log.world["obstacles"]:
        disc["y"] = axis - disc["y"]
    (x, y, yaw), (gx, gy) = log.world["start"], log.world["goal"]
    log.world["start"], log.world["goal"] = [x, axis - y, -yaw], [gx, axis - gy]
    log["route"][:, 1] = axis - log["route"][:, 1]
    rows = round((log.world["bounds"][3] - log.world["bounds"][1]) / log.record["cell"] - 0.5)
    log["cells"][:, 0] = rows - log["cells"][:, 0]
    return log.consistent()


@forgery("world and drive shifted by 1 m", "files", "arrived still")
def _(log: Log) -> Log:
    for name in ("pose", "route", "estimate"):
        log[name][:, 0] += 1.0
    for disc in log.world["obstacles"]:
        disc["x"] += 1.0
    for key in ("start", "goal"):
        log.world[key][0] += 1.0
    log.world["bounds"] = [v + 1.0 * (i % 2 == 0) for i, v in enumerate(log.world["bounds"])]
    return log.consistent()


# Movers


@forgery("a mover logged elsewhere", "verify", "moving")
def _(log: Log) -> None:
    log["movers"][:, 0] += 0.05
    rollout = log.rollout()
    log.arrays["clearance"] = closed_form_clearance(rollout)


@forgery("a mover that starts elsewhere", "files", "moving")
def _(log: Log) -> Log:
    log.world["movers"][0]["position"] = [3.2, 3.0]
    return log.consistent()


@forgery("a mover left out", "files", "moving")
def _(log: Log) -> Log:
    del log.world["movers"][1]
    return log.consistent()


@forgery("all movers left out", "verify", "moving")
def _(log: Log) -> Log:
    del log.world["movers"]
    return log.consistent()


@forgery("smaller movers", "files", "moving")
def _(log: Log) -> Log:
    for mover in log.world["movers"]:
        mover["radius"] *= 0.9
    return log.consistent()


def _replanned(log: Log, trigger: str = "waited", **values: Any) -> None:
    """Let one replan be all replans, which did not succeed."""
    replan = {"trigger": trigger, "solved": False, "cost_m": None, "work": 1, "route": [], **values}
    log.record["replans"], log.record["times"]["replans_s"] = [replan], [0.1]


@forgery("a replan after the end", "verify", "moving")
def _(log: Log) -> None:
    before, times = log.record["replans"], log.record["times"]["replans_s"]
    _replanned(log, t=float(log["t"][-1]) + 5.0)
    log.record["replans"], log.record["times"]["replans_s"] = [*before, *log.record["replans"]], [*times, 0.1]


@forgery("a replan that leads elsewhere", "verify", "moving")
def _(log: Log) -> None:
    _replanned(log, t=float(log["t"][-1]) / 2, solved=True, cost_m=1.0, route=[[0.4, 3.0], [0.4, 3.2]])


@forgery("replans in a world without movers", "verify", "still")
def _(log: Log) -> None:
    _replanned(log, t=1.0)


# One change each

#: By the last level at which they must be found and the drives that they are for.
_CHANGES: dict[tuple[str, str], dict[str, Forger]] = {
    ("load", ""): {
        "rows missing in one array": lambda log: log.put(twist=log["twist"][:-1]),
        "a fourth column": lambda log: log.put(pose=np.column_stack([log["pose"], log["pose"][:, 0]])),
        "no rows": lambda log: log.rows(slice(0)),
        "a contact in a row that does not exist": lambda log: log.put(
            contacts=np.array([[len(log["t"]) + 5.0, 0.0, -0.001, 1.0]])
        ),
        "a contact with an obstacle that does not exist": lambda log: log.put(
            contacts=np.array([[5.0, 99.0, -0.001, 1.0]])
        ),
        "a limiter that has no name": lambda log: log.fill(200, "limiter", 5),
        "a route of one point": lambda log: log.put(route=log["route"][:1]),
    },
    ("verify", ""): {
        "only the first row, as a success": lambda log: log.rows(slice(1)).note(outcome="succeeded"),
        "a full turn between two rows": lambda log: log.fill(2 * math.pi * log.hz, "twist", np.s_[300:302, 1]),
        "speeds three times as high": lambda log: log.times(3.0, "twist"),
        "time stretched by 1 %": lambda log: log.times(1.01, "t"),
        "a heading of 7 rad": lambda log: log.plus(2 * math.pi, "pose", np.s_[:, 2]),
        "the path shifted by 5 cm": lambda log: log.plus(0.05, "pose", np.s_[:, 1]).consistent(),
        "the path mirrored": lambda log: _mirrored(log).consistent(),
        "one row 5 mm aside": lambda log: log.plus(0.005, "pose", (len(log["t"]) // 3, 1)).consistent(),
        "a bend of 35 mm in 1 s": lambda log: _bent(log, 0.035, follow=False),
        "a bend of 15 cm in 1 s, speeds to match": lambda log: _bent(log, 0.15, follow=True),
        "commands of 1e9": lambda log: log.times(1e9, "command", np.s_[1:]),
        "no commands": lambda log: log.fill(0.0, "command"),
        "a command within a control period": lambda log: log.times(0.9, "command", len(log["t"]) // 3 // 4 * 4 + 3),
        "a first command before the start": lambda log: log.fill(0.1, "command", 0),
        "a route 50 m away": lambda log: log.plus(50.0, "route"),
        "a route the wrong way round": lambda log: log.put(route=log["route"][::-1].copy()),
        "a plan straight through the posts": lambda log: log.put(
            route=np.array([log.world["start"][:2], log.world["goal"]])
        ),
        "cells 99 rows away": lambda log: log.plus(99, "cells"),
        "every other cell": lambda log: log.put(cells=log["cells"][::2].copy()),
        "no path, with rows": lambda log: log.put(contacts=log["contacts"][:0]).note(outcome="no_path"),
        "an invalid plan, with rows": lambda log: log.put(contacts=log["contacts"][:0]).note(outcome="invalid_plan"),
    },
    ("replay", ""): {
        # within what targets leave: 1 cm, 0.05 rad and what late motors explain
        "a bend of 35 mm in 1 s, speeds to match": lambda log: _bent(log, 0.035, follow=True),
        "a bend of 35 mm in 1 s, speeds and commands to match": lambda log: _commanded(_bent(log, 0.035, follow=True)),
        "a bend of 3 mm in 2 s": lambda log: _bent(log, 0.003, follow=False, seconds=2.0),
        "commands 1 % lower": lambda log: log.times(0.99, "command").times(0.99, "actuated"),
        "other rules that limited the speed": lambda log: log.fill(0, "limiter"),
    },
    ("replay", "arrived"): {
        "a bend of 0.2 m over the whole drive, all to match": lambda log: _commanded(
            _bent(log, 0.2, follow=True, whole=True)
        ),
    },
    ("replay", "arrived still"): {
        "a drive that was made up": lambda log: _commanded(_bent(log, -0.15, follow=True, whole=True)).note(seed=77),
    },
    ("verify", "long"): {
        "commands 10 % lower": lambda log: log.times(0.9, "command"),
    },
    ("replay", "short"): {
        # late motors explain as much while the robot speeds up
        "commands 10 % lower for less than 4 s": lambda log: log.times(0.9, "command"),
    },
    ("verify", "noisy"): {
        "commands and targets 10 % lower": lambda log: log.times(0.9, "command").times(0.9, "actuated"),
        "targets half as large again": lambda log: log.times(1.5, "actuated"),
        "an estimate 5 m off": lambda log: log.plus(5.0, "estimate"),
    },
    ("replay", "noisy"): {
        "an estimate without error": lambda log: log.put(estimate=log["pose"].copy()),
        "another seed of a noisy drive": lambda log: _consistent_among_movers(log.note(seed=log.record["seed"] + 1)),
    },
    ("none", "exact still"): {
        "another seed": lambda log: log.note(seed=log.record["seed"] + 1),
    },
    ("verify", "moving"): {
        "another seed among movers": lambda log: log.note(seed=log.record["seed"] + 1),
    },
    ("verify", "arrived still"): {
        "a plan along the wall": lambda log: _along_the_wall(log),
    },
    ("replay", "moving"): {
        # the robot may leave its route for a mover
        "a plan along the wall, among movers": lambda log: _along_the_wall(log),
    },
    ("verify", "collided"): {
        "contacts left out": lambda log: log.put(contacts=log["contacts"][:0]).note(outcome="stuck"),
        "a collision cut off before the contact, stuck": lambda log: log.rows(
            slice(int(log["contacts"][0, 0]) - 8)
        ).note(outcome="stuck"),
        "a contact that happens at the start": lambda log: log.fill(3.0, "contacts", np.s_[:, 0]),
        "a contact with another obstacle": lambda log: log.fill(0.0, "contacts", np.s_[:, 1]),
        "a contact of impossible depth and force": lambda log: log.fill((3.0, -5.0), "contacts", np.s_[:, 2:]),
    },
    ("files", "collided"): {
        "contacts left out, with the post": lambda log: (
            _timed_out(log.put(contacts=log["contacts"][:0])).note(unseen=[]).consistent()
        ),
    },
    ("verify", "arrived"): {
        "a success cut off half way": lambda log: log.rows(slice(len(log["t"]) // 2)),
    },
    ("none", ""): {
        # within rounding; replay reports a difference in bits
        "a pose edited by a picometre": lambda log: log.plus(1e-12, "pose", (len(log["t"]) // 3, 0)),
    },
    ("none", "arrived"): {
        # it can only make the drive harder
        "a post that was not there": lambda log: log.note(
            unseen=[{"x": 5.85, "y": 3.35, "radius": 0.05, "height": 1.0}]
        ).consistent(),
    },
}
for (_level, _when), _changes in _CHANGES.items():
    KINDS |= {_name: Kind(_name, _level, forge=guarded(_change, _when)) for _name, _change in _changes.items()}


# Broken files

for _name, _breaks in (
    ("half the file", lambda data: data[: len(data) // 2]),
    ("an empty file", lambda data: b""),
    ("text instead of an archive", lambda data: b"not an archive\n" * 100),
    ("a bomb of 600 MB", lambda data: _with_member(data, "pose.npy", lambda _: bytes(600 << 20))),
    (
        "a header that promises 1e10 rows",
        lambda data: _with_member(data, "pose.npy", lambda _: _npy("'<f8'", "(10000000000, 3)")),
    ),
    (
        "a header of wrong length",
        lambda data: _with_member(data, "pose.npy", lambda old: old[:8] + struct.pack("<H", 60_000) + old[10:]),
    ),
    (
        "a header that is code",
        lambda data: _with_member(data, "pose.npy", lambda _: _npy("__import__('os').getcwd()", "(1, 3)")),
    ),
    (
        "objects that numpy would unpickle",
        lambda data: _with_member(data, "pose.npy", lambda _: _npy("'|O'", "(1, 3)") + b"cos\ngetcwd\n(tR."),
    ),
    ("a member less", lambda data: _with_member(data, "command.npy", lambda _: None)),
    (
        "a member packed with LZMA",
        lambda data: _with_member(data, "pose.npy", lambda old: old, method=zipfile.ZIP_LZMA),
    ),
    ("a record that is no JSON", lambda data: _with_record(data, "{")),
    ("a record with NaN", lambda data: _with_record(data, '{"schema": 2, "noise": NaN}')),
    (
        "a record nested 100,000 deep",
        lambda data: _with_record(data, '{"schema": 2, "task": ' + "[" * 100_000 + "]" * 100_000 + "}"),
    ),
    ("a record of 160 MB", lambda data: _with_record(data, '{"schema": 2, "reason": "' + "x" * 40_000_000 + '"}')),
):
    KINDS[_name] = Kind(_name, "load", breaks=_breaks)


@breakage("100 bytes flipped")
def _(data: bytes) -> bytes:
    broken = np.frombuffer(data, dtype=np.uint8).copy()
    broken[np.random.default_rng(7).integers(0, len(data), 100)] ^= 0xFF
    return broken.tobytes()


@breakage("100 members more")
def _(data: bytes) -> bytes:
    out = io.BytesIO(data)
    with zipfile.ZipFile(out, "a") as archive:
        for n in range(100):
            archive.writestr(f"more-{n}.npy", b"x")
    return out.getvalue()


@breakage("two members of one name")
def _(data: bytes) -> bytes:
    out = io.BytesIO(data)
    with warnings.catch_warnings(), zipfile.ZipFile(out, "a") as archive:
        warnings.simplefilter("ignore")
        archive.writestr("pose.npy", b"x")
    return out.getvalue()


@breakage("a member that claims to be encrypted")
def _(data: bytes) -> bytes:
    at = data.index(b"PK\x01\x02")
    return data[: at + 8] + bytes([data[at + 8] | 1]) + data[at + 9 :]


def _npy(descr: str, shape: str) -> bytes:
    text = f"{{'descr': {descr}, 'fortran_order': False, 'shape': {shape}, }}".ljust(117) + "\n"
    return b"\x93NUMPY\x01\x00" + struct.pack("<H", len(text)) + text.encode()


def _with_record(data: bytes, text: str) -> bytes:
    out = io.BytesIO()
    np.save(out, np.array(text))
    return _with_member(data, "record.npy", lambda _: out.getvalue())


def _with_member(
    data: bytes, name: str, change: Callable[[bytes], bytes | None], method: int = zipfile.ZIP_DEFLATED
) -> bytes:
    """Return the archive with one member changed or omitted."""
    out = io.BytesIO()
    packing = zipfile.ZipFile(out, "w", zipfile.ZIP_DEFLATED, compresslevel=1)
    with zipfile.ZipFile(io.BytesIO(data)) as old, packing as new:
        for info in old.infolist():
            content = old.read(info)
            changed = change(content) if info.filename == name else content
            if changed is not None:
                new.compression = method if info.filename == name else zipfile.ZIP_DEFLATED
                with new.open(info.filename, "w", force_zip64=True) as member:
                    member.write(changed)
    return out.getvalue()
