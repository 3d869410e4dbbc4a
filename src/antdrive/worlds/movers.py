"""Moving cylinders as a world declares them: along keyframes, bouncing between the walls, or wandering from cell to cell.

Nothing stops a mover or turns it aside: movers pass through each other, and a robot does not push them. Keyframed and
cruising movers also pass through obstacles; wanderers choose steps that avoid them. `antdrive.worlds.trajectories`
computes where movers are at any time.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal, TypeAlias, get_args

from antdrive.base.errors import FieldError, require_positive
from antdrive.worlds.limits import MAX_PHASE, MAX_SPEED, MIN_PERIOD

Loop = Literal["pingpong", "teleport", "once"]
Interpolation = Literal["linear", "catmull-rom"]


@dataclass(frozen=True, kw_only=True)
class _Body:
    """An upright cylinder that moves.

    Attributes:
        radius: as built, never inflated [m], > 0
        height: [m], > 0
        phase: how much of the motion has already passed when a run starts [s], >= 0
    """

    radius: float
    height: float = 1.0
    phase: float = 0.0

    def __post_init__(self) -> None:
        require_positive("radius", self.radius)
        require_positive("height", self.height)
        if not 0 <= self.phase <= MAX_PHASE:
            raise FieldError("phase", f"must be from 0 to {MAX_PHASE:g} s, got {self.phase:g}")


@dataclass(frozen=True, kw_only=True)
class Keyframed(_Body):
    """A mover that is at given places at given times. Before the first keyframe it stands at the first place.

    Attributes:
        radius: as built, never inflated [m], > 0
        height: [m], > 0
        phase: how much of the motion has already passed when a run starts [s], >= 0
        keyframes: time [s], x [m] and y [m] of each place, at least two, in the order of time; a mover whose
            keyframes are all at one place stands still
        loop: after the last keyframe the mover goes back the way it came, and forth again ("pingpong"), appears at
            the first place again ("teleport"), or stays where it is ("once")
        interpolation: between keyframes the mover goes straight at constant speed ("linear"), or along a cubic through
            all places ("catmull-rom"). The cubic is uniform in each segment's share of time, as in Gazebo's
            animations, and much faster than linear where a short segment follows a long one.

    Raises:
        FieldError: fewer than two keyframes, times that do not increase, or more than 20 m/s between keyframes.
    """

    keyframes: tuple[tuple[float, float, float], ...]
    loop: Loop = "pingpong"
    interpolation: Interpolation = "linear"

    def __post_init__(self) -> None:
        super().__post_init__()
        _require_choice("loop", self.loop, Loop)
        _require_choice("interpolation", self.interpolation, Interpolation)
        if len(self.keyframes) < 2:
            raise FieldError("keyframes", f"must have at least 2 entries [t, x, y], got {len(self.keyframes)}")
        for i, frame in enumerate(self.keyframes):
            if not all(map(math.isfinite, frame)):
                raise FieldError(f"keyframes[{i}]", f"must be finite numbers, got {list(frame)}")
        for i, ((t0, *here), (t1, *there)) in enumerate(zip(self.keyframes, self.keyframes[1:], strict=False), 1):
            if not t1 > t0:
                raise FieldError(f"keyframes[{i}]", f"its time must be later than the {t0:g} s before it, got {t1:g}")
            if math.dist(here, there) > MAX_SPEED * (t1 - t0):
                speed = math.dist(here, there) / (t1 - t0)
                raise FieldError(
                    f"keyframes[{i}]", f"is reached at {speed:.4g} m/s; at most {MAX_SPEED:g} m/s are allowed"
                )


@dataclass(frozen=True, kw_only=True)
class Cruising(_Body):
    """A mover that goes straight on at constant speed; its surface bounces off the walls like a ball off a cushion.

    Attributes:
        radius: as built, never inflated [m], > 0
        height: [m], > 0
        phase: how much of the motion has already passed when a run starts [s], >= 0
        position: the centre at first, x and y [m]
        velocity: the velocity at first, x and y [m/s]

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
    """A mover that walks at random: in every period from a cell's centre to a neighbour's (hasan's dynamic obstacle).

    All of the eight neighbours that this radius can be moved to without touching an obstacle or a wall are equally
    likely. Where there is none, the mover waits for a period.

    Attributes:
        radius: as built, never inflated [m], > 0
        height: [m], > 0
        phase: how much of the motion has already passed when a run starts [s], >= 0
        cell: side of the cells, which are those of a grid over the world [m]
        period: time for one step, straight or diagonal [s]
        start: a point in the first cell, x and y [m]; None: a random free cell at least 1 m from the robot's start
        seed: random seed of this mover; None: drawn from the run's seed and the mover's place in the list

    Raises:
        FieldError: a period below 0.05 s, or steps faster than 20 m/s.
    """

    cell: float
    period: float
    start: tuple[float, float] | None = None
    seed: int | None = None

    def __post_init__(self) -> None:
        super().__post_init__()
        require_positive("walk.cell", self.cell)
        if not MIN_PERIOD <= self.period < math.inf:
            raise FieldError("walk.period", f"must be at least {MIN_PERIOD:g} s, got {self.period:g}")
        if math.sqrt(2) * self.cell > MAX_SPEED * self.period:
            raise FieldError("walk.period", f"a diagonal in {self.period:g} s is faster than {MAX_SPEED:g} m/s")
        if self.start is not None and not (len(self.start) == 2 and all(map(math.isfinite, self.start))):
            raise FieldError("walk.start", f"must be 2 finite numbers, got {list(self.start)}")
        if self.seed is not None and not (isinstance(self.seed, int) and self.seed >= 0):
            raise FieldError("walk.seed", f"must be a whole number of at least 0, got {self.seed}")


#: A cylinder that moves, in one of three ways.
Mover: TypeAlias = Keyframed | Cruising | Wandering

#: The keys of each kind of mover in a file; the first of them says which kind it is.
_KEYS_BY_KIND = {
    "keyframes": ("keyframes", "loop", "interpolation"),
    "velocity": ("velocity", "position"),
    "walk": ("walk",),
}


def mover_from_dict(entry: Mapping[str, Any]) -> Mover:
    """The mover in plain data, as in a world file."""
    given = {key: value for key, value in entry.items() if value is not None}
    kinds = [kind for kind in _KEYS_BY_KIND if kind in given]
    if not kinds:
        raise FieldError("", f"must have one of the keys {', '.join(_KEYS_BY_KIND)}, which says how it moves")
    if len(kinds) > 1:
        raise FieldError(kinds[1], f"cannot be given together with {kinds[0]}; a mover moves in one way, keep one")
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
            raise FieldError("position", "missing; write [x, y], the centre at first")
        return Cruising(**body, position=tuple(given["position"]), velocity=tuple(given["velocity"]))
    walk = {key: value for key, value in given["walk"].items() if value is not None}
    start = tuple(walk.pop("start")) if "start" in walk else None
    return Wandering(**body, **walk, start=start)


def mover_to_dict(mover: Mover) -> dict[str, Any]:
    """A mover as plain data with the keys of a world file, ready for JSON."""
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
    """The same mover, further into its motion when a run starts."""
    return dataclasses.replace(mover, phase=mover.phase + seconds)


def _floats(values: tuple[float, float]) -> list[float]:
    return [float(value) for value in values]


def _require_choice(key: str, value: str, choices: Any) -> None:
    if value not in get_args(choices):
        raise FieldError(key, f"must be one of {', '.join(get_args(choices))}, got {value!r}")
