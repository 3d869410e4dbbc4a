"""What a process computes from a world, a robot or a file is kept for its next run, until others have taken its place.

Everything kept is a function of its key alone: the text of a file, or the numbers of a world. A run therefore gives the same
result, bit for bit, whatever ran before it in the process. `forget` frees the memory.
"""

from __future__ import annotations

import functools
import struct
from collections.abc import Callable
from typing import Any, Generic, ParamSpec, TypeVar, cast

from antdrive.worlds.world import World

P = ParamSpec("P")
R = TypeVar("R")
V = TypeVar("V")

_kept: list[Any] = []  # the caches, to clear them


def reused(most: int) -> Callable[[Callable[P, R]], Callable[P, R]]:
    """A decorator: the function's last results are kept and given again for equal arguments of the same types.

    The function must not depend on anything but its arguments, and nobody may change its results. Errors are not kept.
    """

    def decorate(function: Callable[P, R]) -> Callable[P, R]:
        cached = functools.lru_cache(maxsize=most, typed=True)(function)
        _kept.append(cached)
        return cast(Callable[P, R], cached)

    return decorate


def forget() -> None:
    """Free the memory of everything that is kept between the runs of this process. Results stay the same."""
    for cached in _kept:
        cached.cache_clear()


class Keyed(Generic[V]):
    """A value that counts as equal to another one if their keys are equal.

    Attributes:
        value: the value
        key: what stands for it; two values with equal keys must be the same for whoever asks
    """

    __slots__ = ("_hash", "key", "value")

    def __init__(self, value: V, key: tuple[Any, ...]) -> None:
        self.value, self.key, self._hash = value, key, hash(key)

    def __hash__(self) -> int:
        return self._hash

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Keyed) and self.key == other.key


def by_geometry(world: World) -> Keyed[World]:
    """The world, equal to all worlds whose walls and standing cylinders have the same bits, seen from above."""
    return Keyed(world, (bits(*world.bounds), world.discs.tobytes()))


def bits(*values: float) -> bytes:
    """The numbers as a key that tells apart what Python holds equal, such as 0.0 and -0.0."""
    return struct.pack(f"{len(values)}d", *values)
