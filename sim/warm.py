"""Compile every kernel into the cache: `python -m sim.warm` (the set-up command does it)."""

from __future__ import annotations

from dataclasses import replace

from planners import PLANNERS
from robots import load_robot
from sim.scenario import Scenario, plan, run
from worlds import Disc, Task, World


def warm() -> None:
    """Plan with every planner and drive once, in a world so small that compiling is all it costs."""
    world = World("warm", (0.0, 0.0, 3.0, 3.0), (Disc(1.5, 1.5, 0.2),))
    task = Task(world, (0.75, 0.75, 0.0), (2.25, 2.25), cell=0.25)
    scenario = Scenario(task=task, planner=PLANNERS["astar"], robot=load_robot("turtlebot"))
    for planner in PLANNERS.values():
        plan(replace(scenario, planner=planner))
    run(scenario)


if __name__ == "__main__":
    warm()
