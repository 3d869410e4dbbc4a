"""A film of each paper: its colony plans on one of its maps, then a robot drives the plan."""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path
from types import MappingProxyType

from antdrive.base import Pose
from antdrive.planners import capabilities_of
from antdrive.robots import load_robot
from antdrive.runs.papers.claims import Arm
from antdrive.runs.papers.experiments import PAPERS
from antdrive.runs.papers.maps import HAN_ANTS
from antdrive.sim.pipeline import run
from antdrive.sim.scenario import Scenario
from antdrive.views.film.video import film
from antdrive.worlds import Disc, Task, World
from antdrive.worlds.formats.cellmap import CellMap, map_task

CELL = 0.8  # side of a cell of a picture [m]: a turtlebot passes between two blocked ones
HAN_UNIT = 0.7  # a unit of han2007 [m]
SIZE, FPS = (480, 360), 20.0
PRELUDE, DRIVE = 3.0, 9.0  # how long the planning and the drive are shown [s]


#: By paper, the experiment whose first map is filmed.
SCENES: Mapping[str, Arm] = MappingProxyType(
    {
        "han2007": Arm("14 obstacles", "100 ants"),
        "suganthi2019": Arm("20×20", "iaco"),
        "ibraheem2016": Arm("20×20, 10 obstacles", "maco"),
        "lee2008": Arm("2: 50×44", "pfaco"),
        "hasan": Arm("1a curved walls", "mmas-dstar"),
    }
)


def paper_scenario(paper: str) -> Scenario:
    """The drive that a paper's film shows: its planner with its parameters, on the first of its maps."""
    scene = SCENES[paper]
    experiment = next(e for e in PAPERS[paper]() if (e.map, e.name) == (scene.map, scene.name))
    if paper == "han2007":
        task = _han_task()
    else:
        query = experiment.query(0)
        (r0, c0), (r1, c1) = query.start, query.goal
        heading = math.atan2(r1 - r0, c1 - c0)
        start: Pose = ((c0 + 0.5) * CELL, (r0 + 0.5) * CELL, heading)
        goal = ((c1 + 0.5) * CELL, (r1 + 0.5) * CELL)
        task = map_task(CellMap(query.grid.free, CELL, (0.0, 0.0)), start, goal, name=f"{paper} {scene.map}")
    return Scenario.of(task, experiment.planner, options=experiment.options, seed=0)


def film_paper(paper: str, folder: Path) -> Path | None:
    """Drive a paper's scenario and film it, the planning first where the planner shows it; None if no drive came about."""
    scenario = paper_scenario(paper)
    result = run(scenario)
    if result.rollout is None:
        return None
    target = folder / f"{paper}.mp4"
    film(
        result.rollout,
        target,
        camera="top",
        size=SIZE,
        fps=FPS,
        speed=max(1.0, float(result.rollout.t[-1]) / DRIVE),
        note=f"{paper}: {scenario.planner_name}",
        prelude=PRELUDE if capabilities_of(scenario.planner).iterative else 0.0,
    )
    return target


def _han_task() -> Task:
    """The map of han2007's ants in metres. The thesis' robot is a point: discs are smaller by the robot's radius and margin."""
    low, high = 0.0, 21.0 * HAN_UNIT
    radius = HAN_UNIT - load_robot("turtlebot").radius - 0.03
    discs = tuple(Disc(x * HAN_UNIT, y * HAN_UNIT, radius) for x, y in HAN_ANTS)
    world = World("han2007 ants", (low, low, high, high), discs)
    start: Pose = (HAN_UNIT, HAN_UNIT, math.pi / 4)
    return Task(world, start, (20 * HAN_UNIT, 20 * HAN_UNIT), cell=HAN_UNIT)
