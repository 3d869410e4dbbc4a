"""Cost of the drive loop relative to bare physics: `make bench`.

The same world, robot and commands are stepped three times in turn: by the whole loop (control, contacts,
clearance, log), by `stepSimulation` alone, and with the contacts, pose and velocity that the log has of each step. The last is
the limit: PyBullet has no call that returns more than one of them. The table shows processor time, and the median over all
rounds of the ratio within a round.

A second table compares the loop among 24 movers that the robot avoids with the loop in the same hall without movers. Its limit
is the loop among movers that the robot does not see.

A third table shows what a control period, a physics step and a replan cost among 6 movers in a fenced hall of 100 cylinders, with
more cylinders outside, and with covers of overlapping cylinders in their place, as maps have. The ratio of a round is to the
same robot among 100 cylinders. `--against PATH` then runs the benchmark of another checkout.
"""

from __future__ import annotations

import contextlib
import os
import statistics
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Callable
from typing import Any

import numpy as np

from antdrive.robots import Avoidance, PurePursuit, TrackedPath, load_robot
from antdrive.sim import Perception, Scenario, run
from antdrive.sim.driving.body import Body
from antdrive.sim.driving.drive import follow
from antdrive.sim.driving.driver import Driver
from antdrive.sim.driving.exploring import Exploration
from antdrive.sim.driving.perceived_movers import PerceivedMovers
from antdrive.sim.driving.plants import Bullet
from antdrive.sim.driving.replanning import Replanning
from antdrive.sim.driving.rules import Avoid
from antdrive.sim.driving.senses import MoverSense, Senses
from antdrive.sim.physics.bullet import bullet
from antdrive.sim.physics.engine import CHASSIS_AND_ANY, Engine
from antdrive.worlds import Cruising, Disc, Route, Task, Trajectories, World
from benchmarks.markdown import command_line

SMALLEST = ("--rounds 1 --most 100",)
MOVERS = 24
GROUND, HALL = 160.0, 20.0  # sides of the ground and of the hall in its middle [m]
FENCE = 11  # cylinders along a side of the fence around the hall, beyond which no robot sees
COVER, APART = 9, 0.05  # rows and columns of a cover's cylinders, and their distance [m]
ROBOTS = {
    "ground truth": {},
    "lidar": {"perception": Perception(kind="lidar")},
    "mapless": {"map": "none", "perception": Perception(kind="lidar")},
}
#: Runs a checkout's benchmark in processor time; older ones use wall-clock time.
OTHER = "import runpy, time; time.perf_counter = time.process_time; runpy.run_module('benchmarks.loop', run_name='__main__')"


def task_among(count: int, size: tuple[float, float] = (20.0, 20.0), radius: float = 0.1) -> Task:
    """Return a task of 18 m through the middle of a hall among `count` thin cylinders."""
    rng, middle = np.random.default_rng(0), size[1] / 2
    discs: list[Disc] = []
    while len(discs) < count:
        x, y = rng.uniform((0.2, 0.2), (size[0] - 0.2, size[1] - 0.2)).tolist()
        if abs(y - middle) > 1:
            discs.append(Disc(x, y, radius))
    return Task(World(f"bench-{count}", (0, 0, *size), tuple(discs)), (1, middle, 0), (19, middle))


def winding(task: Task) -> Route:
    """Return the route, which winds about the middle of the hall."""
    x = np.linspace(1, 19, 73)
    return Route(np.stack([x, task.start[1] + 0.4 * np.sin((x - 1) * np.pi / 3)], axis=1))


def with_movers(task: Task) -> Task:
    """Add movers at 0.2 to 0.7 m/s, at least 2 m from the start."""
    rng, movers = np.random.default_rng(1), list[Cruising]()
    while len(movers) < MOVERS:
        x, y = rng.uniform(0.5, 19.5, 2).tolist()
        angle, speed = rng.uniform(0, 2 * np.pi), rng.uniform(0.2, 0.7)
        if np.hypot(x - task.start[0], y - task.start[1]) > 2:
            velocity = (float(speed * np.cos(angle)), float(speed * np.sin(angle)))
            movers.append(Cruising(radius=0.3, position=(x, y), velocity=velocity))
    world = World("bench-movers", task.world.bounds, task.world.obstacles, movers=tuple(movers))
    return Task(world, task.start, task.goal)


def table_of_movers(route: Route, rounds: int) -> None:
    """Print what the loop costs among movers: seen and avoided, not seen, and absent."""
    robot, controller, still = load_robot("turtlebot"), PurePursuit(), task_among(10)
    moving = with_movers(still)
    tracked: TrackedPath = controller.prepare(route, still.world, robot, 0.05, 1 / 60)
    motions = Trajectories.of(moving.world, moving.start[:2])
    costs: dict[str, list[float]] = {}
    with Engine(still.world, robot) as empty, Engine(moving.world, robot, trajectories=motions) as full:
        for turn in range(rounds + 1):
            for name, engine, task in (
                ("no movers", empty, still),
                (f"{MOVERS} movers, not seen", full, moving),
                (f"{MOVERS} movers, avoided", full, moving),
            ):
                told, senses = PerceivedMovers(Perception(), len(motions)), Senses()
                senses.movers = MoverSense(motions, Perception(), 60)
                avoid = Avoid(Avoidance(), told, task, robot, 60)
                started = time.process_time()
                parts: Any = {"rules": [avoid], "senses": senses, "movers": told} if name.endswith("avoided") else {}
                log = follow(engine, controller, tracked, task, limit=30, **parts)
                if turn:
                    costs.setdefault(name, []).append((time.process_time() - started) / (len(log.t) - 1) * 1e6)
    print("\nloop                     us/step   / no movers")
    for name, values in costs.items():
        ratio = statistics.median(a / b for a, b in zip(values, costs["no movers"], strict=True))
        print(f"{name:22}   {statistics.median(values):7.1f}   {ratio:11.2f}")


def crowd(count: int, *, covers: bool = False) -> Task:
    """Return a task of 18 m through a fenced hall of 100 cylinders and 6 movers; of `count` cylinders the others are outside.

    With covers, overlapping cylinders take the place of each cylinder within the fence.
    """
    rng, low, around = np.random.default_rng(2), (GROUND - HALL) / 2, np.arange(FENCE)
    inside = task_among(100 - 4 * FENCE, (HALL, HALL), 0.15).world.discs + (low, low, 0.0)
    if covers:
        grid = APART * (np.stack(np.meshgrid(*2 * [np.arange(COVER)]), axis=-1).reshape(-1, 2) - COVER // 2)
        inside = np.array([(x + dx, y + dy, APART) for x, y, _ in inside.tolist() for dx, dy in grid.tolist()])
    side = 1.0 + HALL / 2
    fence = np.stack(
        [side * (2 * around / FENCE - 1), np.full(FENCE, -side), np.full(FENCE, 1.1 * side / FENCE)], axis=1
    )
    rows = [inside]
    for _ in range(4):
        rows.append(fence + (GROUND / 2, GROUND / 2, 0.0))
        fence = np.stack([-fence[:, 1], fence[:, 0], fence[:, 2]], axis=1)
    while sum(map(len, rows)) < count:
        more = rng.uniform((0.5, 0.5, 0.1), (GROUND - 0.5, GROUND - 0.5, 0.2), (count, 3))
        rows.append(more[np.abs(more[:, :2] - GROUND / 2).max(axis=1) > side + 1.5])
    rows = np.concatenate(rows)[:count].tolist()
    middle, movers = GROUND / 2, list[Cruising]()
    for k in range(6):  # people who walk to and fro across the route
        x, way = low + 4.0 + 2.5 * k, 1.0 if k % 2 else -1.0
        movers.append(Cruising(radius=0.25, position=(x, middle - 3.0 * way), velocity=(0.0, 0.6 * way)))
    world = World("crowd", (0.0, 0.0, GROUND, GROUND), tuple(Disc(*row) for row in rows), movers=tuple(movers))
    return Task(world, (low + 1, middle, 0), (low + 19, middle), cell=0.25)


class Costs:
    """Processor time of the parts of drives [s]: whole control periods, and in them physics and new routes."""

    def __init__(self) -> None:
        self.reset()
        parts = (
            (Body, "observe"),
            (Driver, "act"),
            (Body, "step"),
            (Bullet, "advance"),
            (Replanning, "replan"),
            (Exploration, "replan"),
        )
        for owner, name in parts:
            setattr(owner, name, self._measured(getattr(owner, name), name))

    def reset(self) -> None:
        """Begin a drive."""
        self._spent, self._calls = Counter[str](), Counter[str]()

    def _measured(self, inner: Callable[..., Any], name: str) -> Callable[..., Any]:
        def measured(*args: Any) -> Any:
            started = time.process_time()
            try:
                return inner(*args)
            finally:
                self._spent[name] += time.process_time() - started
                self._calls[name] += 1

        return measured

    def each(self) -> tuple[float, float, float]:
        """Return the costs of a control period without the other two, of a physics step and of a replan [us]."""
        spent, calls = self._spent, self._calls
        period = spent["observe"] + spent["act"] + spent["step"] - spent["advance"] - spent["replan"]
        physics, replans = spent["advance"] / (4 * calls["advance"]), spent["replan"] / max(calls["replan"], 1)
        return 1e6 * period / calls["act"], 1e6 * physics, 1e6 * replans


def table_of_crowds(rounds: int, most: int) -> None:
    """Print what the parts of a drive cost among movers and more and more cylinders."""
    tasks = {f"{count:,}": crowd(count) for count in (100, 5_000, 20_000) if count <= most}
    if most >= 5_000:
        tasks |= {f"{count:,}, covers": crowd(count, covers=True) for count in (5_000, 20_000)}
    meter, found = Costs(), dict[tuple[str, str], list[tuple[float, float, float]]]()
    for turn in range(rounds + 1):
        for robot, settings in ROBOTS.items():
            for name, task in tasks.items():
                meter.reset()
                run(Scenario.of(task, "astar", "jackal", **settings))
                if turn:
                    found.setdefault((robot, name), []).append(meter.each())
    print("\nrobot          cylinders        us/period   / among 100   us/step   / among 100   ms/replan")
    for (robot, name), costs in found.items():
        period, step, replan = (statistics.median(values) for values in zip(*costs, strict=True))
        first = found[robot, "100"]
        by_period, by_step = (
            statistics.median(a[k] / b[k] for a, b in zip(costs, first, strict=True)) for k in range(2)
        )
        print(
            f"{robot:12}   {name:14}   {period:9.1f}   {by_period:11.2f}   {step:7.1f}   {by_step:11.2f}   {replan / 1e3:9.1f}"
        )


def main() -> None:
    options = command_line(
        __doc__,
        rounds=(9, "of each measurement"),
        most=(20_000, "most cylinders of the first and third table"),
        against=("", "root of another checkout"),
    )
    rounds = options.rounds
    robot, controller = load_robot("turtlebot"), PurePursuit()
    p = bullet()
    print("discs   bare us/step   loop us/step   loop / bare   limit / bare   x real time   step / step among 10")
    engines, stack = {}, contextlib.ExitStack()
    for count in (one for one in (10, 100, 400) if one <= options.most):
        task = task_among(count)
        route = winding(task)
        tracked = controller.prepare(route, task.world, robot, 0.05, 1 / 60)
        engines[count] = (stack.enter_context(Engine(task.world, robot)), task, tracked)
    bare: dict[int, list[float]] = {count: [] for count in engines}
    loop: dict[int, list[float]] = {count: [] for count in engines}
    read: dict[int, list[float]] = {count: [] for count in engines}
    for turn in range(rounds + 1):
        for count, (engine, task, tracked) in engines.items():
            started = time.process_time()
            log = follow(engine, controller, tracked, task, limit=120)
            middle = time.process_time()
            assert log.outcome.name == "SUCCEEDED", log.outcome
            commands = log.command[1::4].tolist()
            engine.place(task.start)
            steps, client = len(log.t) - 1, engine._client
            before = time.process_time()
            for command in commands:
                engine.command(*command)
                for _ in range(4):
                    p.stepSimulation(client)
            ended = time.process_time()
            engine.place(task.start)
            reading = time.process_time()
            for command in commands:
                engine.command(*command)
                for _ in range(4):
                    p.stepSimulation(client)
                    p.getContactPoints(engine._robot, *CHASSIS_AND_ANY, client)
                    p.getBasePositionAndOrientation(engine._robot, client)
                    p.getBaseVelocity(engine._robot, client)
            was_read = time.process_time()
            if turn:  # the first round compiles and fills caches
                loop[count].append((middle - started) / steps * 1e6)
                bare[count].append((ended - before) / steps * 1e6)
                read[count].append((was_read - reading) / steps * 1e6)
    for count in engines:
        ratio, limit = (
            statistics.median(a / b for a, b in zip(some[count], bare[count], strict=True)) for some in (loop, read)
        )
        growth = statistics.median(a / b for a, b in zip(bare[count], bare[10], strict=True))
        us = statistics.median(loop[count])
        print(
            f"{count:5}   {statistics.median(bare[count]):12.1f}   {us:12.1f}   {ratio:11.2f}   {limit:12.2f}"
            f"   {1e6 / 240 / us:11.0f}   {growth:20.2f}"
        )
    table_of_movers(route, rounds)
    stack.close()
    table_of_crowds(rounds, options.most)
    if options.against:
        root = os.path.abspath(options.against)
        path = os.pathsep.join([os.path.join(root, "src"), root])
        print(f"\n{root}", flush=True)
        subprocess.run([sys.executable, "-c", OTHER], cwd=root, env={**os.environ, "PYTHONPATH": path}, check=False)


if __name__ == "__main__":
    main()
