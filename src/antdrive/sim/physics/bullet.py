"""PyBullet module and clients. No other module imports PyBullet."""

from __future__ import annotations

import contextlib
import ctypes
import functools
import os
from collections.abc import Iterator
from typing import Any

from antdrive.base.version import require_physics

# Collision groups. The chassis collides with obstacles and walls only, so its contacts are exactly the collisions.
GROUND, WHEELS, CHASSIS, OBSTACLE = 1, 2, 4, 8


@functools.cache
def bullet() -> Any:
    """Return the PyBullet module, imported without its banner on stderr.

    Raises:
        InputError: PyBullet is not installed, or twice.
    """
    require_physics()
    stderr, null = os.dup(2), os.open(os.devnull, os.O_WRONLY)
    os.dup2(null, 2)
    try:
        import pybullet
    finally:
        os.dup2(stderr, 2)
        os.close(stderr)
        os.close(null)
    return pybullet


class _CStdout:
    """C's `stdout`, silenced while a client is open: Bullet prints its warnings there.

    Python writes to file descriptor 1 itself and is not affected. Redirecting the descriptor would flush C's buffer at
    every step, and swallow Python's output. Windows has no such variable: its users see the warnings.
    """

    def __init__(self) -> None:
        self._clients = 0
        self._real: int | None = None
        self._stream: ctypes.c_void_p | None = None
        try:
            libc = ctypes.CDLL(None)
        except TypeError:  # Windows
            return
        libc.fopen.restype = ctypes.c_void_p
        self._nowhere = libc.fopen(os.fsencode(os.devnull), b"w")
        for name in ("stdout", "__stdoutp"):  # glibc, macOS
            with contextlib.suppress(ValueError):
                self._stream = ctypes.c_void_p.in_dll(libc, name)
                break

    def shut(self) -> None:
        """Count an opened client."""
        self._clients += 1
        if self._clients == 1 and self._stream is not None and self._nowhere:
            self._real, self._stream.value = self._stream.value, self._nowhere

    def release(self) -> None:
        """Count a closed client."""
        self._clients -= 1
        if self._clients == 0 and self._real is not None and self._stream is not None:
            self._stream.value, self._real = self._real, None


_c_stdout = functools.cache(_CStdout)
_idle: list[int] = []  # an idle client for the next world: opening one takes 16 ms


@contextlib.contextmanager
def client() -> Iterator[int]:
    """Provide a headless PyBullet client without bodies, by its number.

    Within the block Bullet prints nothing on stdout, which may be JSON. The engine's parameters may be those of another
    world: set all of them.
    """
    p, stdout = bullet(), _c_stdout()
    stdout.shut()
    try:
        number = _connected()
        try:
            p.setPhysicsEngineParameter(enableFileCaching=0, physicsClientId=number)
            yield number
            p.resetSimulation(physicsClientId=number)
        except BaseException:
            p.disconnect(number)
            raise
        if number and not _idle:
            _idle.append(number)
        else:
            p.disconnect(number)
    finally:
        stdout.release()


def _connected() -> int:
    """Return an idle or new client other than 0, the default of a user's own PyBullet calls."""
    p = bullet()
    while _idle:
        number = _idle.pop()
        if p.isConnected(number):
            return number
    opened = [p.connect(p.DIRECT)]
    if opened[0] == 0:
        opened.append(p.connect(p.DIRECT))
        p.disconnect(0)
    if opened[-1] < 0:
        raise RuntimeError("PyBullet opened no physics client; more than 1024 may be open already")
    return int(opened[-1])


def drawn_as(number: int) -> int:
    """Create a visual shape of one triangle in client `number`, for bodies that are never drawn.

    Without one, Bullet derives it from the collision shape, which takes longer than the rest of the body: 0.2 ms for a
    cylinder or sphere, 2 ms for a plane.
    """
    p = bullet()
    shape: int = p.createVisualShape(
        p.GEOM_MESH,
        vertices=((0, 0, 0), (1, 0, 0), (0, 1, 0)),
        indices=(0, 1, 2),
        normals=((0, 0, 1),) * 3,
        physicsClientId=number,
    )
    return shape
