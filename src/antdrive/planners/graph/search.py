"""Shortest paths on the grid: Dijkstra's algorithm and A* (Hart, Nilsson & Raphael 1968)."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from antdrive.planners.plan import Capabilities, GridPlanner, PlanResult, PlanStatus, Query

UNREACHABLE = "no sequence of allowed moves leads from the start to the goal"


@dataclass(frozen=True, kw_only=True)
class Dijkstra(GridPlanner):
    """The shortest path over the grid's moves, by Dijkstra's algorithm.

    Known weakness, measured (docs/notebook/planner-quality.md): the search is not directed; on 100 x 100 cells
    among cylinders it takes three times as long as A*. Its paths share A*'s weakness.
    """

    capabilities: ClassVar[Capabilities] = Capabilities(deterministic=True, turns=True)

    def search(self, query: Query, rng: np.random.Generator) -> PlanResult:
        """Search the grid without a heuristic."""
        return shortest(query, informed=False)


@dataclass(frozen=True, kw_only=True)
class AStar(GridPlanner):
    """The shortest path over the grid's moves, by A*.

    The octile heuristic guides the search (Hart, Nilsson & Raphael 1968).

    Known weakness, measured (`tests/planners/graph/test_search.py`): paths turn by multiples of 45 degrees only.
    In five worlds of the catalogue they are up to 21 per cent longer than the exact shortest path among the
    discs (`tangent`), 12 per cent in the median; on open ground at most 8.2 per cent.
    """

    capabilities: ClassVar[Capabilities] = Capabilities(deterministic=True, turns=True)

    def search(self, query: Query, rng: np.random.Generator) -> PlanResult:
        """Search the grid with the octile distance as the heuristic."""
        return shortest(query, informed=True)


def shortest(query: Query, *, informed: bool = True) -> PlanResult:
    """Return the shortest path between two free cells, or `NO_PATH`.

    Uses A* if `informed`, else Dijkstra's algorithm.
    """
    from antdrive.planners.graph import _kernels_search  # imported here because it loads the compiler

    cells, straight, diagonal, expanded = _kernels_search.shortest_path(
        query.grid.graph, query.start_node, query.goal_cell, informed
    )
    if not len(cells):
        return PlanResult(status=PlanStatus.NO_PATH, reason=UNREACHABLE, work=expanded)
    cost = query.grid.cell * (straight + math.sqrt(2.0) * diagonal)
    return PlanResult(status=PlanStatus.SOLVED, cells=cells, cost=cost, work=expanded)


def reachable(query: Query) -> bool:
    """Return whether allowed moves lead from the start to the goal."""
    from antdrive.worlds import _kernels_turns

    if query.start_node < 0:
        return False
    reached = _kernels_turns.led_to(query.grid.graph, query.start_node)
    return bool(reached[query.grid.nodes_at(query.goal)].any())
