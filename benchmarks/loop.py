"""The cost of the drive loop compared with bare physics: `make bench`.

The same world, robot and commands are stepped twice in turn: by the whole loop (control, contacts,
clearance, log) and by `stepSimulation` alone. The table shows the median over all rounds of the ratio
within a round.
"""

from __future__ import annotations

import statistics
import time

import numpy as np

from antdrive.robots import PurePursuit, load_robot
from antdrive.sim.driving.drive import drive
from antdrive.sim.physics.bullet import bullet
from antdrive.sim.physics.engine import Engine
from antdrive.worlds import Disc, Route, Task, World

ROUNDS = 9


def task_among(count: int) -> Task:
    """An 18 m drive among `count` thin cylinders."""
    rng = np.random.default_rng(0)
    discs: list[Disc] = []
    while len(discs) < count:
        x, y = rng.uniform(0.2, 19.8, 2)
        if abs(y - 10) > 1:
            discs.append(Disc(x, y, 0.1))
    return Task(World(f"bench-{count}", (0, 0, 20, 20), tuple(discs)), (1, 10, 0), (19, 10))


def main() -> None:
    robot, controller = load_robot("turtlebot"), PurePursuit()
    p = bullet()
    print("discs   bare us/step   loop us/step   loop / bare   x real time   step / step among 10")
    engines = {}
    for count in (10, 100, 400):
        task = task_among(count)
        x = np.linspace(1, 19, 73)
        route = Route(np.stack([x, 10 + 0.4 * np.sin((x - 1) * np.pi / 3)], axis=1))
        tracked = controller.guide(route, task.world, robot, 0.05, 1 / 60)
        engines[count] = (Engine(task.world, robot).__enter__(), task, tracked)
    bare: dict[int, list[float]] = {count: [] for count in engines}
    loop: dict[int, list[float]] = {count: [] for count in engines}
    for turn in range(ROUNDS + 1):
        for count, (engine, task, tracked) in engines.items():
            started = time.perf_counter()
            log = drive(engine, controller, tracked, task, time_limit=120)
            middle = time.perf_counter()
            assert log.outcome.name == "SUCCEEDED", log.outcome
            commands = log.command[1::4].tolist()
            engine.place(task.start)
            steps, client = len(log.t) - 1, engine._client
            before = time.perf_counter()
            for command in commands:
                engine.command(*command)
                for _ in range(4):
                    p.stepSimulation(client)
            ended = time.perf_counter()
            if turn:  # the first round compiles and fills caches
                loop[count].append((middle - started) / steps * 1e6)
                bare[count].append((ended - before) / steps * 1e6)
    for count in engines:
        ratio = statistics.median(a / b for a, b in zip(loop[count], bare[count], strict=True))
        growth = statistics.median(a / b for a, b in zip(bare[count], bare[10], strict=True))
        us = statistics.median(loop[count])
        print(
            f"{count:5}   {statistics.median(bare[count]):12.1f}   {us:12.1f}   {ratio:11.2f}   {1e6 / 240 / us:11.0f}"
            f"   {growth:20.2f}"
        )
    for engine, _, _ in engines.values():
        engine.__exit__()


if __name__ == "__main__":
    main()
