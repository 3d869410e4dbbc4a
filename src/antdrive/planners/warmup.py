"""Warm-up of planner kernels before plans are timed.

The first call of a kernel loads or compiles its machine code. That takes 10 to 100 ms, while planning may take 0.1 ms.
Each planner therefore plans on a tiny grid once per process, with a separate random stream: no plan depends on it.
"""

from __future__ import annotations

import contextlib
import contextvars
import dataclasses
from collections.abc import Iterator
from contextvars import ContextVar
from typing import TYPE_CHECKING, Protocol

import numpy as np

from antdrive.base.kernel_cache import compiled

if TYPE_CHECKING:
    from antdrive.planners.plan import PlanResult, Query

#: Nested planners belong to the timed planner, whose warm-up loads their kernels.
_within: ContextVar[bool] = ContextVar("_within", default=False)
_loaded: set[str] = set()  # planners warmed up in this process


class WarmsUp(Protocol):
    """A planner with a warm-up variant."""

    def for_warmup(self) -> WarmsUp:
        """Return this planner with minimal work that calls the same kernels."""
        ...

    def plan(self, query: Query, rng: np.random.Generator) -> PlanResult:
        """Find a path from the start cell to the goal cell."""
        ...


@contextlib.contextmanager
def kernels_loaded(planner: WarmsUp, query: Query) -> Iterator[None]:
    """Load the planner's kernels, then run this block of timed planning."""
    if not _within.get():
        load_kernels(planner, query)
    with untimed():
        yield


@contextlib.contextmanager
def untimed() -> Iterator[None]:
    """Load no kernels before the plans of this block, of which nobody reads the time."""
    token = _within.set(True)
    try:
        yield
    finally:
        _within.reset(token)


def load_kernels(planner: WarmsUp, query: Query) -> None:
    """Plan on a tiny grid, once per process, planner and options."""
    shorter = planner.for_warmup()
    writeable = query.grid.free.flags.writeable
    kind = (bool(query.motions), query.task is not None, writeable, bool(query.grid.turns))
    key = f"{type(shorter).__module__}.{shorter!r} {kind}"
    if key in _loaded:
        return
    _loaded.add(key)
    # A new context has no progress callback. A planner that fails here fails again when timed.
    with contextlib.suppress(Exception):
        contextvars.Context().run(_warm_up, shorter, tiny_query(type(query), *kind))


def _warm_up(planner: WarmsUp, query: Query) -> None:
    _within.set(True)
    with compiled():
        planner.plan(query, np.random.default_rng(0))


def tiny_query(
    query_type: type[Query], motions: bool, task: bool, writeable: bool = False, turns: bool = False
) -> Query:
    """Build a query on 12 x 12 cells around a cylinder, with the same types as queries of worlds."""
    from antdrive.worlds import Cruising, Disc, Task, Trajectories, World, rasterise
    from antdrive.worlds.grid import DISC
    from antdrive.worlds.headings import Outline

    oblong = Outline(np.array([(0.3, -0.1), (0.3, 0.1), (-0.1, 0.1), (-0.1, -0.1)]), 0.02)
    mover = Cruising(radius=0.1, position=(0.2, 2.8), velocity=(0.1, 0.0))
    world = World("tiny", (0.0, 0.0, 3.0, 3.0), (Disc(1.5, 1.5, 0.2),), movers=(mover,))
    made = Task(world, (0.75, 0.75, 0.0), (2.25, 2.25), cell=0.25)
    grid = rasterise(world, made.cell, 0.2, oblong if turns else DISC)
    if writeable:
        grid = dataclasses.replace(grid, free=grid.free.copy(), moves=grid.moves.copy())
    query = query_type.between(grid, made)
    return dataclasses.replace(
        query, task=made if task else None, motions=Trajectories.of(world, made.start[:2], 0).motions if motions else ()
    )
