"""Drives along one path."""

from __future__ import annotations

from collections.abc import Sequence

from antdrive.robots import PurePursuit, TrackedPath
from antdrive.robots.control.observation import Briefing
from antdrive.sim.driving.body import Body
from antdrive.sim.driving.driver import Driver, full_turn
from antdrive.sim.driving.guide import Follow, Guide, Rule
from antdrive.sim.driving.localising import Exact
from antdrive.sim.driving.parts import Drive, Ending
from antdrive.sim.driving.perceived_movers import PerceivedMovers
from antdrive.sim.driving.plants import Bullet
from antdrive.sim.driving.rules import Pursuit
from antdrive.sim.driving.senses import Senses
from antdrive.sim.physics.engine import Engine
from antdrive.worlds import Task


def drive(body: Body, driver: Driver) -> Ending:
    """Drive until the driver gives up or has arrived, the robot touches something, or the time limit passes."""
    while body.ended is None:
        body.step(*driver.act(body.observe()))
    return driver.with_reason(body.ended, body.tick)


def follow(
    engine: Engine,
    controller: PurePursuit,
    path: TrackedPath,
    task: Task,
    *,
    limit: float,
    control_hz: int = 60,
    senses: Senses | None = None,
    localiser: Exact | None = None,
    rules: Sequence[Rule] = (),
    movers: PerceivedMovers | None = None,
) -> Drive:
    """Drive along a path from the start of a task, for at most `limit` [s]; `rules` apply after pursuit."""
    pursuit = Pursuit(controller, full_turn(engine.robot, control_hz))
    known = Briefing(engine.robot, task.start, task.goal, task.goal_tolerance, control_hz, task.world)
    driver = Driver(known, Guide(), (pursuit, *rules), movers=movers)
    driver.way = Follow(path)
    plant = Bullet(engine, task.start, control_hz)
    localiser = localiser or Exact(task.start, 1 / control_hz)
    body = Body(plant, senses or Senses(), localiser, hz=control_hz, limit=limit, task=task)
    return plant.finish(drive(body, driver))
