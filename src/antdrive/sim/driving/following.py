"""Drive along one prepared path in physics, without planning: calibration, benchmarks."""

from __future__ import annotations

from collections.abc import Sequence

from antdrive.robots import PurePursuit, TrackedPath
from antdrive.sim.driving.drive import Progress, drive, unheard
from antdrive.sim.driving.driver import Driver, full_turn
from antdrive.sim.driving.given import Exact, GivenMap
from antdrive.sim.driving.parts import Guide, Localiser, Rule
from antdrive.sim.driving.plants import Bullet, Drive
from antdrive.sim.driving.rules import Pursuit
from antdrive.sim.physics.engine import Engine
from antdrive.worlds import Task


class OnePath(Guide):
    """Always the same path."""

    def __init__(self) -> None:
        self.log = []


def follow(
    engine: Engine,
    controller: PurePursuit,
    path: TrackedPath,
    task: Task,
    *,
    limit: float,
    control_hz: int = 60,
    localiser: Localiser | None = None,
    rules: Sequence[Rule] = (),
    progress: Progress = unheard,
) -> Drive:
    """Drive along a path from the start of a task, for at most a time [s]; `rules` apply after pursuit."""
    pursuit = Pursuit(controller, full_turn(engine.robot, control_hz))
    driver = Driver(OnePath(), (pursuit, *rules), path, task, engine.robot, control_hz)
    plant = Bullet(engine, task.start, control_hz)
    ending = drive(plant, driver, localiser or Exact(), GivenMap(), hz=control_hz, limit=limit, progress=progress)
    return plant.finish(ending)
