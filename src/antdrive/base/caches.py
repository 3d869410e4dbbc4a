"""Per-process LRU caches.

Every cached value is a function of its key alone: a file's text, or a world's numbers. A run therefore gives bit-identical
results, regardless of what the process ran before. `clear_caches` frees the memory.
"""

from __future__ import annotations

import functools
import struct
from collections.abc import Callable
from typing import Any, Generic, ParamSpec, TypeVar, cast

P = ParamSpec("P")
R = TypeVar("R")
V = TypeVar("V")

_caches: list[Any] = []  # all cached functions, for `clear_caches`


def cached(maxsize: int) -> Callable[[Callable[P, R]], Callable[P, R]]:
    """Return a decorator that caches a function's most recent results by arguments and argument types.

    The function must be pure, and callers must not modify its results. Exceptions are not cached.
    """

    def decorate(function: Callable[P, R]) -> Callable[P, R]:
        wrapped = functools.lru_cache(maxsize=maxsize, typed=True)(function)
        _caches.append(wrapped)
        return cast(Callable[P, R], wrapped)

    return decorate


def clear_caches() -> None:
    """Free the memory of all caches of this process. Results do not change."""
    for function in _caches:
        function.cache_clear()


class Keyed(Generic[V]):
    """A value hashed and compared by a key. Values with equal keys must be interchangeable."""

    __slots__ = ("_hash", "key", "value")

    def __init__(self, value: V, key: tuple[Any, ...]) -> None:
        self.value, self.key, self._hash = value, key, hash(key)

    def __hash__(self) -> int:
        return self._hash

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Keyed) and self.key == other.key


def bits(*values: float) -> bytes:
    """Pack numbers into a key that distinguishes values equal in Python, such as 0.0 and -0.0."""
    return struct.pack(f"{len(values)}d", *values)
