"""Lidar of a drive in the true world, and what a mapless robot is given of that world at its start."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from antdrive.base import Floats, Point, Pose
from antdrive.robots.control.observation import FirstSight
from antdrive.robots.lidar import Lidar
from antdrive.sim.driving.parts import Rows
from antdrive.sim.log.rollout import scans_logged
from antdrive.sim.log.streams import random_stream
from antdrive.sim.sensing.scanner import Scanner
from antdrive.worlds import Trajectories, World
from antdrive.worlds.world import PointWorld

BEYOND = 0.2  # what is farther than this beyond a radius meets no cell of a map within it [m]


@dataclass(eq=False)
class SimulatedLidar:
    """Simulated lidar in the true world."""

    scanner: Scanner  # ray casting in the true world
    world: World  # the static obstacles
    trajectories: Trajectories | None  # true motions of the movers; None without movers
    rng: np.random.Generator | None  # source of range noise; None for no noise
    hz: int  # control periods per second
    taken: list[tuple[int, Floats]] = field(default_factory=list)  # all scans so far, with their control periods

    @classmethod
    def of(
        cls, lidar: Lidar, world: World, trajectories: Trajectories, *, seed: int, noisy: bool, hz: int
    ) -> SimulatedLidar:
        """Create a lidar in a world, with noise from a drive's seed and at most one scan per control period."""
        rng = random_stream(seed, "lidar") if noisy else None
        return cls(Scanner.of(lidar.at(hz), world), world, trajectories or None, rng, hz)

    def scan(self, tick: int, pose: Pose) -> Floats | None:
        """Return a scan (beams,) [m] from a true pose, if one is due in a control period. The first is due at once."""
        if self.taken and (tick == self.taken[-1][0] or not self.scanner.lidar.due(tick, self.hz)):
            return None
        movers = self.trajectories
        places = movers.positions(np.array([tick / self.hz]))[0] if movers else None
        ranges = self.scanner.scan(pose, places, movers.radii if movers else None, self.rng)
        self.taken.append((tick, ranges))
        return ranges

    def first(self, start: Pose, radius: float) -> FirstSight:
        """Return what a mapless robot is given at its start, with ground within a radius [m]."""
        movers, none = self.trajectories, np.empty((0, 3))
        there = np.column_stack((movers.positions(np.zeros(1))[0], movers.radii)) if movers else none
        ranges = self.scan(0, start)
        assert ranges is not None
        return FirstSight(start_ground(self.world, start[:2], radius, there), ranges)

    def logged(self, log: Rows, per_tick: int) -> dict[str, Any]:
        """Return the log's arrays of scans."""
        return scans_logged(self.taken, per_tick, len(log.t))


def start_ground(world: World, place: Point, radius: float, movers: Floats) -> World:
    """Return the part of a world within a radius [m] of a place; discs (M, 3) stand for its movers."""
    reach = radius + BEYOND
    discs = np.concatenate((world.discs, movers.reshape(-1, 3)))
    near = np.hypot(discs[:, 0] - place[0], discs[:, 1] - place[1]) <= reach + discs[:, 2]
    (x, y), (x0, y0, x1, y1) = place, world.bounds
    bounds = max(x0, x - reach), max(y0, y - reach), min(x1, x + reach), min(y1, y + reach)
    return PointWorld.of("start", bounds, discs[near])
