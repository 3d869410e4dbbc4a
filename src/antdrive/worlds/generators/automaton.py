"""The field of a BARN world: filled cells from a cellular automaton, and a cylinder for each of them."""

from __future__ import annotations

import math
from typing import Any, TypeAlias

import numpy as np
import numpy.typing as npt

from antdrive.worlds.formats.barn import BARN_BOUNDS, BARN_CELL
from antdrive.worlds.grid import DIRECTIONS
from antdrive.worlds.world import Disc

Picture: TypeAlias = npt.NDArray[np.bool_]  # (rows, columns), True where filled

SIDE = 30  # rows and columns of the automaton
RUNWAY = 34  # rows before the field; the first row is a wall
HEIGHT = 0.5  # of a cylinder [m]


def grow_field(rng: np.random.Generator, fill: float, rounds: int) -> Picture:
    """A random field after smoothing, (30, 30), rows in the direction from start to goal."""
    field = rng.random((SIDE, SIDE)) < fill
    field[:, [0, -1]] = True
    for _ in range(rounds):
        count = _neighbours(field)
        field = (field & (count > 1)) | (count >= 5)
        field[:, [0, -1]] = True
    return field


def _neighbours(field: Picture) -> npt.NDArray[np.int64]:
    """The number of filled neighbours of each cell. Beyond the side walls all cells count as filled, beyond the ends none."""
    rows, cols = field.shape
    padded = np.zeros((rows + 2, cols + 2), dtype=np.int64)
    padded[:, [0, -1]] = 1
    padded[1:-1, 1:-1] = field
    count = np.zeros(field.shape, dtype=np.int64)
    for dr, dc in DIRECTIONS:
        count += padded[1 + dr : 1 + dr + rows, 1 + dc : 1 + dc + cols]
    return count


def crossable(field: Picture, robot_radius: float) -> bool:
    """Whether cells with room for the robot join the field's ends: a cheap test that every crossable field passes."""
    reach = math.floor((robot_radius / BARN_CELL) + 0.5)
    free = np.ones(field.shape, dtype=np.bool_)
    rows, cols = field.shape
    for row, col in np.ndindex(2 * reach + 1, 2 * reach + 1):
        dr, dc = row - reach, col - reach
        if math.hypot(dr, dc) * BARN_CELL - BARN_CELL / 2 <= robot_radius:
            to_row, to_col = slice(max(0, dr), rows + min(0, dr)), slice(max(0, dc), cols + min(0, dc))
            from_row, from_col = slice(max(0, -dr), rows - max(0, dr)), slice(max(0, -dc), cols - max(0, dc))
            free[to_row, to_col] &= ~field[from_row, from_col]
    reached = np.zeros(field.shape, dtype=np.bool_)
    reached[0] = free[0]
    count: Any = -1
    while np.count_nonzero(reached) != count:
        count = np.count_nonzero(reached)
        reached[1:] |= reached[:-1]
        reached[:-1] |= reached[1:]
        reached[:, 1:] |= reached[:, :-1]
        reached[:, :-1] |= reached[:, 1:]
        reached &= free
    return bool(reached[-1].any())


def cylinders(field: Picture) -> tuple[Disc, ...]:
    """The cylinders of a world: one for each filled cell of the field and of the walled runway before it."""
    runway = np.zeros((RUNWAY, SIDE), dtype=np.bool_)
    runway[0] = True
    runway[:, [0, -1]] = True
    x0, y0 = BARN_BOUNDS[0] + BARN_CELL / 2, BARN_BOUNDS[1] + BARN_CELL / 2
    return tuple(
        Disc(round(x0 + BARN_CELL * col, 3), round(y0 + BARN_CELL * row, 3), BARN_CELL / 2, HEIGHT)
        for row, col in np.argwhere(np.vstack([runway, field])).tolist()
    )
