"""How far the ends of a path on a grid may lie from a task's start and goal: one rule for planning and for every check.

A start or a goal need not lie at the centre of a free cell. The robot gets to a free cell near it on a straight line, no
longer than `end_reach`. Where the start has less room than paths keep, that line, and nothing else of the path, may come
as close to an obstacle as the start itself. Where the goal has less room, the path ends within the goal's tolerance of it.
The line of a planner that is not bound to the grid has a path of cells beside it, which is as long but for `DETOUR`.
"""

from __future__ import annotations

import math

DETOUR = 3.0  # cells by which the line of a planner that is not bound to the grid may be longer than its cells


def cells_beside(inflate: float, cell: float) -> int:
    """How many rows and columns away from its own cell an end may be joined to the grid.

    Getting to farther cells would take a plan of its own.
    """
    return max(3, math.ceil(inflate / cell) + 1)


def end_reach(inflate: float, cell: float) -> float:
    """The farthest that the centre of such a cell can be from the end [m]."""
    return math.sqrt(2.0) * (cells_beside(inflate, cell) + 0.5) * cell


def longest_line(cost: float, leads: float, cell: float) -> float:
    """The greatest length of a line beside a path of cells [m]."""
    return cost + leads + DETOUR * cell
