"""Mover declarations: cylinders that follow keyframes, bounce between the walls or walk at random.

Movers are kinematic: they pass through each other, and robots do not push them. Keyframed and cruising movers also pass
through obstacles; wanderers avoid them. `antdrive.worlds.trajectories` computes positions over time.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal, TypeAlias

from antdrive.base.errors import FieldError, require
from antdrive.base.plane import format_numbers
from antdrive.base.records import require_choices
from antdrive.worlds.limits import MAX_PHASE, MAX_SPEED, MIN_PERIOD

Loop = Literal["pingpong", "teleport", "once"]
Interpolation = Literal["linear", "catmull-rom"]


@dataclass(frozen=True, kw_only=True)
class _Body:
    """A moving upright cylinder.

    Attributes:
        radius: true radius, never inflated [m], > 0
        height: height of the cylinder [m], > 0
        phase: time into the motion at a run's start [s], >= 0
    """

    radius: float
    height: float = 1.0
    phase: float = 0.0

    def __post_init__(self) -> None:
        require("radius", self.radius, above=0)
        require("height", self.height, above=0)
        if not 0 <= self.phase <= MAX_PHASE:
            raise FieldError("phase", f"must be from 0 to {MAX_PHASE:g} s, got {self.phase:g}")


@dataclass(frozen=True, kw_only=True)
class Keyframed(_Body):
    """A mover with given positions at given times. It stands at the first position until the first keyframe.

    Attributes:
        keyframes: time [s], x [m] and y [m] of each, at least two, in order of time; with equal positions the mover
            stands still
        loop: after the last keyframe the mover goes back and forth ("pingpong"), jumps to the first position
            ("teleport"), or stops ("once")
        interpolation: straight at constant speed ("linear"), or along a cubic through all positions ("catmull-rom").
            The cubic is uniform in each segment's fraction of time, as in Gazebo's animations. Where a
            short segment follows a long one, the mover is much faster than with "linear".

    Raises:
        FieldError: fewer than two keyframes, times that do not increase, or more than 20 m/s between keyframes.
    """

    keyframes: tuple[tuple[float, float, float], ...]
    loop: Loop = "pingpong"
    interpolation: Interpolation = "linear"

    def __post_init__(self) -> None:
        super().__post_init__()
        require_choices(self)
        if len(self.keyframes) < 2:
            raise FieldError("keyframes", f"must have at least 2 entries [t, x, y], got {len(self.keyframes)}")
        for i, frame in enumerate(self.keyframes):
            if not all(map(math.isfinite, frame)):
                raise FieldError(f"keyframes[{i}]", f"must be finite numbers, got {list(frame)}")
        for i, ((t0, *here), (t1, *there)) in enumerate(zip(self.keyframes, self.keyframes[1:], strict=False), 1):
            if not t1 > t0:
                raise FieldError(f"keyframes[{i}]", f"time must be greater than the previous {t0:g} s, got {t1:g}")
            if math.dist(here, there) > MAX_SPEED * (t1 - t0):
                speed = math.dist(here, there) / (t1 - t0)
                raise FieldError(f"keyframes[{i}]", f"needs {speed:.4g} m/s; the limit is {MAX_SPEED:g} m/s")


@dataclass(frozen=True, kw_only=True)
class Cruising(_Body):
    """A mover at constant speed whose surface bounces off the walls.

    Attributes:
        position: initial centre, x and y [m]
        velocity: initial velocity, x and y [m/s]

    Raises:
        FieldError: a velocity of 0 or of more than 20 m/s.
    """

    position: tuple[float, float]
    velocity: tuple[float, float]

    def __post_init__(self) -> None:
        super().__post_init__()
        for key, values in (("position", self.position), ("velocity", self.velocity)):
            if len(values) != 2 or not all(map(math.isfinite, values)):
                raise FieldError(key, f"must be 2 finite numbers, got {list(values)}")
        speed = math.hypot(*self.velocity)
        if not 0 < speed <= MAX_SPEED:
            raise FieldError("velocity", f"must be a speed above 0 and at most {MAX_SPEED:g} m/s, got {speed:g}")


@dataclass(frozen=True, kw_only=True)
class Wandering(_Body):
    """A random walker: one step each period, from a cell's centre to a neighbour's (hasan's dynamic obstacle).

    All of the eight neighbours reachable without contact are equally likely. If there is none, the mover waits for a
    period.

    Attributes:
        cell: side of the cells of a grid over the world [m]
        period: time for one step, straight or diagonal [s]
        start: a point in the first cell, x and y [m]; None: a random free cell at least 1 m from the robot's start
        seed: random seed of this mover; None: derived from the run's seed and the mover's index

    Raises:
        FieldError: a period below 0.05 s, or steps faster than 20 m/s.
    """

    cell: float
    period: float
    start: tuple[float, float] | None = None
    seed: int | None = None

    def __post_init__(self) -> None:
        super().__post_init__()
        require("walk.cell", self.cell, above=0)
        if not MIN_PERIOD <= self.period < math.inf:
            raise FieldError("walk.period", f"must be at least {MIN_PERIOD:g} s, got {self.period:g}")
        if math.sqrt(2) * self.cell > MAX_SPEED * self.period:
            raise FieldError("walk.period", f"a diagonal in {self.period:g} s is faster than {MAX_SPEED:g} m/s")
        if self.start is not None and not (len(self.start) == 2 and all(map(math.isfinite, self.start))):
            raise FieldError("walk.start", f"must be 2 finite numbers, got {format_numbers(self.start)}")
        if self.seed is not None and not (isinstance(self.seed, int) and self.seed >= 0):
            raise FieldError("walk.seed", f"must be a whole number of at least 0, got {self.seed}")


#: A moving cylinder of one of three kinds.
Mover: TypeAlias = Keyframed | Cruising | Wandering

#: The keys of each kind of mover in a file; the first one determines the kind.
_KEYS_BY_KIND = {
    "keyframes": ("keyframes", "loop", "interpolation"),
    "velocity": ("velocity", "position"),
    "walk": ("walk",),
}


def mover_from_dict(entry: Mapping[str, Any]) -> Mover:
    """Return the mover in plain data, as in a world file."""
    given = {key: value for key, value in entry.items() if value is not None}
    kinds = [kind for kind in _KEYS_BY_KIND if kind in given]
    if not kinds:
        raise FieldError("", f"must have one of the keys {', '.join(_KEYS_BY_KIND)}")
    if len(kinds) > 1:
        raise FieldError(kinds[1], f"excludes {kinds[0]}; keep one of them")
    kind = kinds[0]
    body = {key: given[key] for key in ("radius", "height", "phase") if key in given}
    for key in given:
        if key not in body and key not in _KEYS_BY_KIND[kind]:
            owner = next((k for k, keys in _KEYS_BY_KIND.items() if key in keys), "no mover")
            raise FieldError(key, f"belongs to {owner}, not to {kind}; remove it")
    if kind == "keyframes":
        frames = tuple((t, x, y) for t, x, y in given["keyframes"])
        rest = {key: given[key] for key in ("loop", "interpolation") if key in given}
        return Keyframed(**body, keyframes=frames, **rest)
    if kind == "velocity":
        if "position" not in given:
            raise FieldError("position", "missing; write [x, y], the centre at the start")
        return Cruising(**body, position=tuple(given["position"]), velocity=tuple(given["velocity"]))
    walk = {key: value for key, value in given["walk"].items() if value is not None}
    start = tuple(walk.pop("start")) if "start" in walk else None
    return Wandering(**body, **walk, start=start)


def mover_to_dict(mover: Mover) -> dict[str, Any]:
    """Return a mover as JSON-ready data with the keys of a world file."""
    body: dict[str, Any] = {"radius": float(mover.radius), "height": float(mover.height)}
    if mover.phase:
        body["phase"] = float(mover.phase)
    if isinstance(mover, Keyframed):
        frames = [[float(value) for value in frame] for frame in mover.keyframes]
        return {**body, "loop": mover.loop, "interpolation": mover.interpolation, "keyframes": frames}
    if isinstance(mover, Cruising):
        return {**body, "position": _floats(mover.position), "velocity": _floats(mover.velocity)}
    walk: dict[str, Any] = {"cell": float(mover.cell), "period": float(mover.period)}
    if mover.start is not None:
        walk["start"] = _floats(mover.start)
    if mover.seed is not None:
        walk["seed"] = int(mover.seed)
    return {**body, "walk": walk}


def later(mover: Mover, seconds: float) -> Mover:
    """Return the mover with its phase advanced."""
    return dataclasses.replace(mover, phase=mover.phase + seconds)


def _floats(values: tuple[float, float]) -> list[float]:
    return [float(value) for value in values]
