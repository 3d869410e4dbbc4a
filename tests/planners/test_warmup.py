"""Planning time excludes the loading of kernels. Instead of timing, the tests list the kernels loaded while timed."""

import os
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest

from antdrive.planners import PLANNERS, GridPlanner, Query, load_planner, on_progress
from antdrive.planners.warmup import kernels_loaded, tiny_query

# Each planner gets its own process without loaded kernels and prints the kernels that its first plan loads.
PLANS = """
import gc, os, sys
from dataclasses import replace
from numba.core.dispatcher import Dispatcher
from antdrive.planners import IterativePlanner, Query, load_planner
from antdrive.planners.warmup import load_kernels
from antdrive.sim import Scenario
from antdrive.worlds import rasterise

def overloads():
    return {f"{d.__module__}.{d.__name__}": len(d.overloads) for d in gc.get_objects() if isinstance(d, Dispatcher)}

for words in sys.argv[1:]:
    if os.fork():
        os.wait()
        continue
    name, *options = words.split()
    planner = load_planner(name, **dict(option.split("=") for option in options))
    if isinstance(planner, IterativePlanner):
        planner = replace(planner, iterations=12)
    s = Scenario.of("plaza-moving", planner)
    query = Query.between(rasterise(s.task.world, s.task.cell, s.inflate), s.task)
    query = replace(query, motions=s.trajectories.motions) if s.timed else query
    load_kernels(planner, query)
    before = overloads()
    status = planner._answer(query, s.rng("planner")).status.name
    loaded = sorted(kernel for kernel, count in overloads().items() if count != before.get(kernel))
    print(words, "-", status, *loaded, flush=True)
    os._exit(0)
"""

# The same for replans, during a drive among movers.
REPLANS = """
import gc, os, sys
from numba.core.dispatcher import Dispatcher
from antdrive.sim import Scenario, run
from antdrive.sim.driving.replanning import CellByCell, Replanning

def overloads():
    return {f"{d.__module__}.{d.__name__}": len(d.overloads) for d in gc.get_objects() if isinstance(d, Dispatcher)}

loaded, driving = set(), False

def recorded(method):
    def replan(self, *args):
        before = overloads()
        path = method(self, *args)
        if self._task.world.name != "tiny":
            loaded.update(k for k, count in overloads().items() if count != before.get(k))
        return path
    return replan

for kind in (Replanning, CellByCell):
    kind.replan = recorded(kind.replan)
for words in sys.argv[1:]:
    if os.fork():
        os.wait()
        continue
    name, smoothing = words.split()
    log = run(Scenario.of("plaza-moving", name, smoothing=smoothing, time_limit=12.0)).rollout
    print(words, "-", len(log.record.replans), *sorted(loaded), flush=True)
    os._exit(0)
"""

COLONIES = [f"{name} backtrack=true shortcut=true" for name in ("aco-han", "as", "mmas", "ants")]

needs_kernels = pytest.mark.skipif(
    os.environ.get("NUMBA_DISABLE_JIT", "0") not in ("", "0") or not hasattr(os, "fork"),
    reason="needs compiled kernels, and processes that begin as copies",
)


def printed(script, *words):
    """Run a script and return its output for each of its words."""
    done = subprocess.run([sys.executable, "-c", script, *words], capture_output=True, text=True, timeout=1800)
    assert done.returncode == 0, done.stderr
    lines = [line.split(" - ") for line in done.stdout.splitlines()]
    assert len(lines) == len(words), done.stderr
    return {name: rest.split() for name, rest in lines}


@pytest.mark.slow
@needs_kernels
def test_every_kernel_of_a_planner_is_loaded_before_the_clock_starts():
    for name, (_, *loaded) in printed(PLANS, *PLANNERS, *COLONIES).items():
        assert loaded == [], name


@needs_kernels
@pytest.mark.slow
def test_every_kernel_of_a_replan_is_loaded_before_the_clock_starts():
    words = ["dstar-lite clearance", "ants taut", "mmas-dstar none", "as clearance", "tangent taut"]
    for name, (count, *loaded) in printed(REPLANS, *words).items():
        assert int(count) > 0, f"{name}: the drive replans"
        assert loaded == [], name


class Counting(GridPlanner):
    """A planner that counts its queries."""

    asked: list[Query] = []  # noqa: RUF012 - shared on purpose

    def search(self, query, rng):
        self.asked.append(query)
        return PLANNERS["astar"].plan(query, rng)


def test_a_planner_warms_up_once_without_the_planners_inside_it():
    Counting.asked.clear()
    query = tiny_query(Query, motions=False, task=True)
    longer = replace(query, start=(1, 1))
    for _ in range(3):
        Counting().plan(longer, np.random.default_rng(1))
    assert [asked.start for asked in Counting.asked] == [query.start, (1, 1), (1, 1), (1, 1)]


@pytest.mark.parametrize("name", ["aco-han", "ga-han", "hybrid"])
def test_warming_up_reports_no_progress_and_draws_no_random_numbers(name):
    query, seen = tiny_query(Query, motions=False, task=True), []
    planner = load_planner(name, iterations=7)
    rng, other = np.random.default_rng(5), np.random.default_rng(5)
    with on_progress(lambda state: seen.append(state.total)):
        first = planner.plan(query, rng)
    assert set(seen) <= {7}
    again = planner.plan(query, other)
    assert np.array_equal(first.cells, again.cells)
    assert rng.bit_generator.state == other.bit_generator.state


def test_a_planner_that_fails_to_warm_up_fails_again_when_timed():
    class Failing(GridPlanner):
        """A planner that always fails."""

        def search(self, query, rng):
            raise ArithmeticError(query.grid.shape)

    query = replace(tiny_query(Query, motions=False, task=True), start=(0, 0))
    with kernels_loaded(Failing(), query):
        pass
    with pytest.raises(ArithmeticError):
        Failing().plan(replace(query, start=query.goal), np.random.default_rng(0))
