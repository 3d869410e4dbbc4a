"""Kernels give the same results as plain Python."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

from antdrive.planners import PLANNERS

CODE = """
import dataclasses
import numpy as np
from antdrive.planners import PLANNERS, Query, capabilities_of, plan_in_time
from antdrive.worlds import Disc, Grid, Task, World, rasterise
free = np.ones((6, 7))
free[1:5, 3] = 0
bare = Query(Grid.from_free(free), (2, 1), (3, 5))
task = Task(World("w", (0, 0, 4, 3), (Disc(2, 1.5, 0.5), Disc(2.4, 1.9, 0.3))), (0.75, 1.25, 0), (3.25, 1.75))
query = Query.between(rasterise(task.world, 0.5, 0.1), task)
few = {"ants": 4, "iterations": 3, "population": 6, "ant_iterations": 2, "ant_runs": 1, "backtrack": True, "shortcut": True}
for name, planner in PLANNERS.items():
    known = {f.name for f in dataclasses.fields(planner)}
    planner = dataclasses.replace(planner, **{key: value for key, value in few.items() if key in known})
    for q in [query] if capabilities_of(planner).needs_world else [bare, query]:
        result = planner.plan(q, np.random.default_rng(0))
        print(name, result.status.name, round(result.line_length, 9), result.cells.tolist(), result.work)
class Mover:
    radius = 0.4
    def at(self, t):
        return np.column_stack([np.abs((t / 2 % 4) - 2) + 2, 0 * t])
result = plan_in_time(bare, [Mover()], speed=1.0)
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
    assert plain.count("SOLVED") >= 2 * len(PLANNERS) - 4  # potentials and ants may get stuck
    assert plain == run(NUMBA_DISABLE_JIT="0")
