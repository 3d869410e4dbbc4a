"""The planning time is that of machine code, without its compilation and loading."""

import os

import numba
import numpy as np
import pytest

from antdrive.base import kernel_cache
from antdrive.planners import AStar, GridPlanner, Query
from antdrive.worlds import Task, World, rasterise

NOW = [5.0]  # [s]


@pytest.fixture
def query():
    task = Task(World("open", (0.0, 0.0, 3.0, 3.0)), (0.75, 0.75, 0.0), (2.25, 2.25), cell=0.25)
    return Query.between(rasterise(task.world, task.cell, 0.2), task)


class Loading(GridPlanner):
    """A planner that loads nested kernels and notes whether kernels are compiled."""

    blocks: list[int] = []  # noqa: RUF012 - shared on purpose

    def search(self, query, rng):
        self.blocks.append(kernel_cache.blocks)
        NOW.append(NOW[-1] + 1.0)
        with kernel_cache.account, kernel_cache.account:
            NOW.append(NOW[-1] + 60.0)
        return AStar().untimed(query, rng)


def test_loading_and_compiling_are_left_out(query, monkeypatch):
    monkeypatch.setattr(kernel_cache.time, "perf_counter", lambda: NOW[-1])
    assert Loading().plan(query, np.random.default_rng(0)).wall_s == pytest.approx(1.0)


def test_a_timed_plan_is_never_interpreted_and_an_untimed_one_may_be(query):
    Loading.blocks.clear()
    Loading().plan(query, np.random.default_rng(0))
    Loading().untimed(query, np.random.default_rng(0))
    assert Loading.blocks == [1, 0]


@pytest.mark.skipif(bool(os.environ.get("NUMBA_DISABLE_JIT")), reason="needs compiled kernels")
def test_numba_accounts_for_kernels_of_others():
    before = kernel_cache.account.seconds
    mine = numba.njit(lambda x: x + 6.5)
    mine(1.0)
    after = kernel_cache.account.seconds
    mine(2.0)
    assert before < after == kernel_cache.account.seconds
