"""Trajectories of a run's movers, in numpy only: logs can be verified without numba or PyBullet."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from antdrive.base.errors import FieldError, InputError
from antdrive.base.types import Floats, Point
from antdrive.worlds.motions import Motion, motion_of, require_few_draws
from antdrive.worlds.world import World


@dataclass(frozen=True, eq=False)
class Trajectories:
    """All movers of a run as functions of time.

    The result for a time is bit-identical, regardless of the other times requested.

    Attributes:
        radii: each mover's radius (M,) [m]
        heights: each mover's height (M,) [m]
        motions: each mover's motion, M of them
    """

    radii: Floats
    heights: Floats
    motions: tuple[Motion, ...]

    @classmethod
    def of(cls, world: World, start: Point, seed: int = 0) -> Trajectories:
        """Return the trajectories of a world's movers.

        Args:
            world: the world
            start: the robot's start; random first cells of wanderers avoid it [m]
            seed: the run's random seed, for wanderers without their own

        Raises:
            InputError: a wanderer has no free first cell.
        """
        discs, motions = world.discs, []
        for i, mover in enumerate(world.movers):
            try:
                motions.append(motion_of(mover, i, world.bounds, discs, start, seed))
                require_few_draws(motions)
            except FieldError as error:
                raise InputError(str(error.under(f"movers[{i}]"))) from None
        radii, heights = (np.array([getattr(m, key) for m in world.movers]) for key in ("radius", "height"))
        return cls(radii, heights, tuple(motions))

    def __len__(self) -> int:
        return len(self.motions)

    def positions(self, t: npt.ArrayLike) -> Floats:
        """Return the movers' centres at times `t` (T,), or at one time [s], shape (T, M, 2) [m]."""
        times = _times(t)
        return _stacked([motion.at(times) for motion in self.motions], (len(times), 0, 2))

    def velocities(self, t: npt.ArrayLike) -> Floats:
        """Return the movers' velocities at times `t`, right-continuous in time, shape (T, M, 2) [m/s]."""
        times = _times(t)
        return _stacked([motion.velocities(times) for motion in self.motions], (len(times), 0, 2))

    def travel(self, t: npt.ArrayLike) -> Floats:
        """Return an upper bound on each mover's travel between consecutive times `t` (T,), without jumps, (T - 1, M) [m]."""
        times = _times(t)
        return _stacked([np.diff(motion.travelled(times)) for motion in self.motions], (max(0, len(times) - 1), 0))

    def jumps(self, t: npt.ArrayLike) -> npt.NDArray[np.bool_]:
        """Return whether each mover jumps in (t[i], t[i + 1]], for times `t` (T,) [s], shape (T - 1, M)."""
        times = _times(t)
        counts = _stacked([motion.jumped(times) for motion in self.motions], (len(times), 0))
        return np.asarray(np.diff(counts, axis=0) > 0)

    def jump_times(self, until: float) -> tuple[Floats, ...]:
        """Return the times of each mover's jumps up to a time `until` [s], M arrays of shape (J,) [s]."""
        return tuple(motion.jump_times(until) for motion in self.motions)


def _times(t: npt.ArrayLike) -> Floats:
    return np.atleast_1d(np.asarray(t, dtype=np.float64))


def _stacked(rows: list[npt.NDArray[Any]], empty: tuple[int, ...]) -> Floats:
    return np.stack(rows, axis=1) if rows else np.empty(empty)
