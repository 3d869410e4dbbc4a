"""The kernels are plain Python too."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

CODE = """
import numpy as np
from planners import Query, find_planner, plan_in_time
from worlds import Grid
free = np.ones((6, 7))
free[1:5, 3] = 0
query = Query(Grid.from_free(free), (2, 1), (3, 5))
colonies = ("aco-han-elite", "as", "maco", "iaco", "mmas", "ants", "pfaco")
for name in ("astar", "dijkstra", "dstar", "dstar-lite", "apf", "mmas-dstar", *colonies):
    options = {"ants": 4, "iterations": 3, "retreat": True, "shortcut": True} if name in colonies else {}
    result = find_planner(name, **options).plan(query, np.random.default_rng(0))
    print(name, result.status.name, round(result.cost, 9), result.cells.tolist(), result.work)
class Mover:
    radius = 0.4
    def at(self, t):
        return np.column_stack([np.abs((t / 2 % 4) - 2) + 2, 0 * t])
result = plan_in_time(query, [Mover()], speed=1.0)
print(result.status.name, result.arrive.round(9).tolist(), result.leave.round(9).tolist(), result.work)
"""


def run(**environment: str) -> str:
    done = subprocess.run(
        [sys.executable, "-W", "error", "-c", CODE],
        cwd=Path(__file__).parents[2],
        env={**os.environ, **environment},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_uncompiled_kernels_give_the_same_plans_without_a_warning() -> None:
    plain = run(NUMBA_DISABLE_JIT="1")
    assert plain.count("SOLVED") == 13
    assert plain == run(NUMBA_DISABLE_JIT="0")
