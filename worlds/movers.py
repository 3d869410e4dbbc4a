"""Moving cylinders as a world declares them: along keyframes, straight on between the walls, or wandering from cell to cell.

Movers keep to their course whatever is in the way: they pass through each other and through standing cylinders (wanderers
keep off those by choice), and a robot does not stop them. `antdrive.worlds.trajectories` says where they are at any time.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal, TypeAlias, get_args

Loop = Literal["pingpong", "teleport", "once"]
Interpolation = Literal["linear", "catmull-rom"]

MAX_SPEED = 20.0  # faster than this something was mistyped [m/s]; physics feels movers up to five times as fast
MIN_PERIOD = 0.05  # the shortest step of a wanderer [s]
MAX_PHASE = 1e4  # [s]


@dataclass(frozen=True, kw_only=True)
class _Body:
    """An upright cylinder that moves."""

    radius: float  # as built, never inflated [m], > 0
    height: float = 1.0  # [m], > 0
    phase: float = 0.0  # how much of its motion has passed when a run starts [s], >= 0

    def __post_init__(self) -> None:
        _positive("radius", self.radius)
        _positive("height", self.height)
        if not 0 <= self.phase <= MAX_PHASE:
            raise ValueError(f"phase: must be from 0 to {MAX_PHASE:g} s, got {self.phase:g}")


@dataclass(frozen=True, kw_only=True)
class Keyframed(_Body):
    """Moves through places at given times; it stands at the first place until the first time.

    After the last keyframe it goes back the way it came and so on (`pingpong`), appears at the first place again
    (`teleport`), or stays (`once`). In between it moves straight at constant speed (`linear`), or along a cubic
    through all places (`catmull-rom`: uniform in each segment's share of time, as Gazebo animates, and much
    faster than linear where a short segment follows a long one).

    Raises:
        ValueError: fewer than two keyframes, times that do not increase, or speeds beyond 20 m/s between them.
    """

    keyframes: tuple[tuple[float, float, float], ...]  # t [s], x [m], y [m]
    loop: Loop = "pingpong"
    interpolation: Interpolation = "linear"

    def __post_init__(self) -> None:
        super().__post_init__()
        _choice("loop", self.loop, Loop)
        _choice("interpolation", self.interpolation, Interpolation)
        if len(self.keyframes) < 2:
            raise ValueError(f"keyframes: must have at least 2 entries [t, x, y], got {len(self.keyframes)}")
        for i, frame in enumerate(self.keyframes):
            if not all(map(math.isfinite, frame)):
                raise ValueError(f"keyframes[{i}]: must be finite numbers, got {list(frame)}")
        for i, ((t0, *here), (t1, *there)) in enumerate(zip(self.keyframes, self.keyframes[1:], strict=False), 1):
            if not t1 > t0:
                raise ValueError(f"keyframes[{i}]: its time must be later than the {t0:g} s before it, got {t1:g}")
            if math.dist(here, there) > MAX_SPEED * (t1 - t0):
                fast = math.dist(here, there) / (t1 - t0)
                raise ValueError(f"keyframes[{i}]: is reached at {fast:.4g} m/s; at most {MAX_SPEED:g} m/s are allowed")
        if len({frame[1:] for frame in self.keyframes}) == 1:
            raise ValueError("keyframes: all at one place; write what never moves under obstacles")


@dataclass(frozen=True, kw_only=True)
class Cruising(_Body):
    """Moves straight on at constant speed; its surface bounces off the walls of the world like a ball off a cushion.

    Raises:
        ValueError: it stands still or is faster than 20 m/s.
    """

    position: tuple[float, float]  # where it is at first [m]
    velocity: tuple[float, float]  # [m/s]

    def __post_init__(self) -> None:
        super().__post_init__()
        for key, values in (("position", self.position), ("velocity", self.velocity)):
            if len(values) != 2 or not all(map(math.isfinite, values)):
                raise ValueError(f"{key}: must be 2 finite numbers, got {list(values)}")
        speed = math.hypot(*self.velocity)
        if not 0 < speed <= MAX_SPEED:
            raise ValueError(f"velocity: must be a speed above 0 and at most {MAX_SPEED:g} m/s, got {speed:g}")


@dataclass(frozen=True, kw_only=True)
class Wandering(_Body):
    """Goes, in every period, from a cell's centre to that of a random free neighbour: hasan's dynamic obstacle.

    Each of the eight neighbours is as likely whose way is free of standing cylinders and walls for this radius; where
    none is, it waits. Cells are those of a grid of `cell` metres over the world.

    Raises:
        ValueError: a period below 0.05 s, or a speed beyond 20 m/s.
    """

    cell: float  # [m]
    period: float  # for one cell, straight or diagonal [s]
    start: tuple[float, float] | None = (
        None  # in the first cell [m]; None: a random free one, 1 m off the robot's start
    )
    seed: int | None = None  # of its own; None: drawn from the run's seed and its place in the list

    def __post_init__(self) -> None:
        super().__post_init__()
        _positive("walk.cell", self.cell)
        if not MIN_PERIOD <= self.period < math.inf:
            raise ValueError(f"walk.period: must be at least {MIN_PERIOD:g} s, got {self.period:g}")
        if math.sqrt(2) * self.cell > MAX_SPEED * self.period:
            raise ValueError(f"walk.period: a diagonal in {self.period:g} s is faster than {MAX_SPEED:g} m/s")
        if self.start is not None and not (len(self.start) == 2 and all(map(math.isfinite, self.start))):
            raise ValueError(f"walk.start: must be 2 finite numbers, got {list(self.start)}")
        if self.seed is not None and not (isinstance(self.seed, int) and self.seed >= 0):
            raise ValueError(f"walk.seed: must be a whole number of at least 0, got {self.seed}")


Mover: TypeAlias = Keyframed | Cruising | Wandering

_KEYS = {
    "keyframes": ("keyframes", "loop", "interpolation"),
    "velocity": ("velocity", "position"),
    "walk": ("walk",),
}


def mover_from_dict(entry: Mapping[str, Any]) -> Mover:
    """A mover from plain data, as in a world file; a key whose value is None counts as left out.

    Raises:
        ValueError: "key: what is wrong and what would be right".
    """
    given = {key: value for key, value in entry.items() if value is not None}
    kinds = [kind for kind in _KEYS if kind in given]
    if not kinds:
        raise ValueError(f": must have one of the keys {', '.join(_KEYS)}, which says how it moves")
    if len(kinds) > 1:
        raise ValueError(f"{kinds[1]}: stands beside {kinds[0]}; a mover moves in one way, keep one")
    kind = kinds[0]
    body = {key: given[key] for key in ("radius", "height", "phase") if key in given}
    for key in given:
        if key not in body and key not in _KEYS[kind]:
            owner = next((k for k, keys in _KEYS.items() if key in keys), "no mover")
            raise ValueError(f"{key}: belongs to {owner}, not to {kind}; remove it")
    if kind == "keyframes":
        frames = tuple((t, x, y) for t, x, y in given["keyframes"])
        rest = {key: given[key] for key in ("loop", "interpolation") if key in given}
        return Keyframed(**body, keyframes=frames, **rest)
    if kind == "velocity":
        if "position" not in given:
            raise ValueError("position: missing; write [x, y], where it is at first")
        return Cruising(**body, position=tuple(given["position"]), velocity=tuple(given["velocity"]))
    walk = {key: value for key, value in given["walk"].items() if value is not None}
    start = tuple(walk.pop("start")) if "start" in walk else None
    return Wandering(**body, **walk, start=start)


def mover_to_dict(mover: Mover) -> dict[str, Any]:
    """A mover as plain data, in the same form as in a file and ready for JSON."""
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
    """The same mover with `seconds` more of its motion passed when a run starts."""
    return dataclasses.replace(mover, phase=mover.phase + seconds)


def _floats(values: tuple[float, float]) -> list[float]:
    return [float(value) for value in values]


def _positive(key: str, value: float) -> None:
    if not 0 < value < math.inf:
        raise ValueError(f"{key}: must be greater than 0, got {value:g}")


def _choice(key: str, value: str, choices: Any) -> None:
    if value not in get_args(choices):
        raise ValueError(f"{key}: must be one of {', '.join(get_args(choices))}, got {value!r}")
