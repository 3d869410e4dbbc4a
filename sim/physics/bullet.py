"""The PyBullet module and its clients. No other module imports PyBullet."""

from __future__ import annotations

import contextlib
import functools
import os
from collections.abc import Iterator
from typing import Any

# Collision groups. The chassis meets obstacles and walls only, so its contact list is exactly the list of
# collisions.
GROUND, WHEELS, CHASSIS, OBSTACLE = 1, 2, 4, 8


@functools.cache
def bullet() -> Any:
    """The PyBullet module, imported without its banner on stderr."""
    stderr, null = os.dup(2), os.open(os.devnull, os.O_WRONLY)
    os.dup2(null, 2)
    try:
        import pybullet
    finally:
        os.dup2(stderr, 2)
        os.close(stderr)
        os.close(null)
    return pybullet


@contextlib.contextmanager
def client() -> Iterator[int]:
    """The number of a new headless PyBullet client, which is disconnected at the end of the `with` block.

    Raises:
        RuntimeError: PyBullet refuses another client.
    """
    p = bullet()
    number = p.connect(p.DIRECT)
    if number < 0:
        raise RuntimeError("PyBullet opened no physics client; more than 1024 may be open already")
    try:
        p.setPhysicsEngineParameter(enableFileCaching=0, physicsClientId=number)
        yield number
    finally:
        p.disconnect(number)
