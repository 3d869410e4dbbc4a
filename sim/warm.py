"""Compile every kernel into the cache: `python -m sim.warm` (the set-up command does it)."""

from __future__ import annotations

import tempfile
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from joblib import Parallel, delayed

from antdrive.planners import PLANNERS
from antdrive.robots import load_robot
from antdrive.sim.pipeline import plan, run
from antdrive.sim.scenario import Scenario
from antdrive.sim.view.film.video import film
from antdrive.worlds import Cruising, Disc, Task, World

# What shares kernels is compiled by one process; the longest first.
TOGETHER = (
    ("tangent",),
    ("aco-han", "as", "pfaco"),
    ("ga-han", "hybrid"),
    ("sipp",),
    ("dstar-lite", "dstar"),
    ("apf", "mmas-dstar"),
)


def _scenario() -> Scenario:
    """A world so small that compiling is all it costs."""
    mover = Cruising(radius=0.1, position=(0.2, 2.8), velocity=(0.1, 0.0))
    world = World("warm", (0.0, 0.0, 3.0, 3.0), (Disc(1.5, 1.5, 0.2),), movers=(mover,))
    task = Task(world, (0.75, 0.75, 0.0), (2.25, 2.25), cell=0.25)
    return Scenario(task=task, planner=PLANNERS["astar"], robot=load_robot("turtlebot"))


def plan_with(names: Sequence[str]) -> None:
    """Plan with these planners."""
    for name in names:
        plan(replace(_scenario(), planner=PLANNERS[name]))


def drive_and_film() -> None:
    """Drive once and film it."""
    log = run(_scenario()).rollout
    ants = run(replace(_scenario(), planner=PLANNERS["as"], planner_name="as")).rollout
    assert log is not None
    assert ants is not None
    with tempfile.TemporaryDirectory() as folder:
        film(log, Path(folder) / "warm.mp4", size=(160, 160), fps=2)
        film(log, Path(folder) / "warm.mp4", size=(160, 160), fps=2, camera="follow")
        film(ants, Path(folder) / "warm.mp4", size=(160, 160), fps=2, prelude=1.0)


def warm(jobs: int = -1) -> None:
    """Plan with every planner, drive once and film it, on as many processes as there are cores unless told."""
    pool = Parallel(jobs)
    pool([delayed(plan_with)(TOGETHER[0]), delayed(drive_and_film)(), *map(delayed(plan_with), TOGETHER[1:])])
    # Once more from the cache; what two processes wrote at the same moment, and one of them lost, is compiled now.
    pool([delayed(plan_with)(list(PLANNERS)), delayed(drive_and_film)()])


if __name__ == "__main__":
    warm()
