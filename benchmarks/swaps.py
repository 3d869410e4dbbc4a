"""Cost of bodies that come and go, and of the check that they are in place: `python -m benchmarks.swaps`.

A robot drives for 24 s through a lane among 24 movers that pass beside it, between cylinders. Bodies that it does not need are
parked, as in antdrive; or parked without the check; or movers' bodies are removed and cylinders built one by one, since PyBullet
returns wrong numbers for a batch after a removal. Processor time; ratios within a round, as medians.
"""

from __future__ import annotations

import statistics
import time

import numpy as np

from antdrive.robots import load_robot
from antdrive.sim import Engine
from antdrive.sim.physics.bodies import Point3
from antdrive.sim.physics.bullet import CHASSIS, OBSTACLE
from antdrive.worlds import Cruising, Disc, Trajectories, World
from benchmarks.markdown import command_line

SMALLEST = ("--rounds 1 --seconds 1",)
MOVERS, LANE, SPEED = 24, 1.3, 0.7  # number; half width [m]; of the robot [m/s]


class Parked(Engine):
    """Bodies as antdrive keeps them."""


class Unchecked(Engine):
    """Bodies parked and never checked."""

    def __enter__(self) -> Engine:
        engine = super().__enter__()
        self._bodies.fault = lambda movers, bodies=None: self._bodies.fresh.clear() or ""  # type: ignore[method-assign,func-returns-value]
        return engine


class Removed(Engine):
    """Bodies of movers removed, and those of cylinders built one by one."""

    def __enter__(self) -> Engine:
        engine = super().__enter__()
        self._park, self._bodies.park = self._bodies.park, self._take  # type: ignore[method-assign]
        return engine

    def _take(self, index: int) -> None:
        if index < len(self.world.obstacles):
            return self._park(index)
        body = self._bodies.held.pop(index)
        del self._bodies.index[body], self._bodies._shapes[body]
        self._bodies.fresh.discard(body)
        return self._p.removeBody(body, physicsClientId=self._client)  # type: ignore[no-any-return]

    def _build_obstacles(self, indices: list[int], shape: int, centres: list[Point3]) -> None:
        p, client = self._p, self._client
        for index, centre in zip(indices, centres, strict=True):
            body = p.createMultiBody(
                0, shape, self._drawn, basePosition=centre, useMaximalCoordinates=1, physicsClientId=client
            )
            p.changeDynamics(body, -1, activationState=p.ACTIVATION_STATE_SLEEP, physicsClientId=client)
            p.setCollisionFilterGroupMask(body, -1, OBSTACLE, CHASSIS, physicsClientId=client)
            self._bodies.add(index, body, shape)


def lane(count: int, sizes: int) -> World:
    """Return a lane of 60 m between cylinders, with movers of a number of sizes along both sides."""
    rng = np.random.default_rng(3)
    aside = rng.uniform(LANE, 9, count) * rng.choice([-1, 1], count)
    places = zip(
        rng.uniform(-29, 29, count).tolist(), aside.tolist(), rng.choice([0.05, 0.1], count).tolist(), strict=True
    )
    movers = [
        Cruising(
            radius=0.2 + 0.002 * (m % sizes), position=(x, (-0.8, 0.8)[m % 2]), velocity=((-v, v)[m // 2 % 2], 0.0)
        )
        for m, (x, v) in enumerate(rng.uniform((-27, 0.3), (20, 2.0), (MOVERS, 2)).tolist())
    ]
    return World("lane", (-30, -10, 30, 10), tuple(Disc(*place) for place in places), movers=tuple(movers))


def costs(kind: type[Engine], world: World, seconds: int) -> tuple[float, float, int]:
    """Return the processor time of a step and of the last audit [us], and the number of bodies."""
    robot = load_robot("turtlebot")
    with kind(world, robot, trajectories=Trajectories.of(world, (-28.0, 0.0))) as engine:
        engine.place((-28.0, 0.0, 0.0))
        engine.command(SPEED, 0.0)
        started = time.process_time()
        for _ in range(60 * seconds):
            _, touched = engine.advance(4, [])
            assert not touched
        driven = time.process_time()
        assert engine.audit() == ""
        return (
            (driven - started) / (240e-6 * seconds),
            1e6 * (time.process_time() - driven),
            len(engine._bodies._shapes),
        )


def main() -> None:
    options = command_line(__doc__, rounds=(9, "of each measurement"), seconds=(24, "of each drive"))
    print("| cylinders | sizes of movers | bodies | us per step | bodies at the end | / parked | audit of all [us] |")
    print("|---|---|---|---|---|---|---|")
    for count in (0, 900, 5000):
        for sizes in (1, MOVERS):
            world, kinds = lane(count, sizes), (Parked, Unchecked, Removed)
            rows = [[costs(kind, world, options.seconds) for kind in kinds] for _ in range(options.rounds + 1)][1:]
            for k, kind in enumerate(kinds):
                spent, audit = (statistics.median(row[k][i] for row in rows) for i in (0, 1))
                ratio = statistics.median(row[k][0] / row[0][0] for row in rows)
                name = kind.__name__.lower()
                print(
                    f"| {count} | {sizes} | {name} | {spent:.1f} | {rows[0][k][2]} | {ratio:.3f} | {audit:.0f} |",
                    flush=True,
                )


if __name__ == "__main__":
    main()
