"""Compile every kernel into the cache: `python -m sim.warm` (the set-up command does it)."""

from __future__ import annotations

import tempfile
from dataclasses import replace
from pathlib import Path

from planners import PLANNERS
from robots import load_robot
from sim.filming.video import film
from sim.scenario import Scenario, plan, run
from worlds import Cruising, Disc, Task, World


def warm() -> None:
    """Plan with every planner drive once and film it, in a world so small that compiling is all it costs."""
    mover = Cruising(radius=0.1, position=(0.2, 2.8), velocity=(0.1, 0.0))
    world = World("warm", (0.0, 0.0, 3.0, 3.0), (Disc(1.5, 1.5, 0.2),), movers=(mover,))
    task = Task(world, (0.75, 0.75, 0.0), (2.25, 2.25), cell=0.25)
    scenario = Scenario(task=task, planner=PLANNERS["astar"], robot=load_robot("turtlebot"))
    for planner in PLANNERS.values():
        plan(replace(scenario, planner=planner))
    log = run(scenario).rollout
    assert log is not None
    with tempfile.TemporaryDirectory() as folder:
        film(log, Path(folder) / "warm.mp4", size=(160, 160), fps=2)


if __name__ == "__main__":
    warm()
