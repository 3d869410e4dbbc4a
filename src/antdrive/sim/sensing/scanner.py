"""Lidar simulation: exact rays against the cylinders and walls of the physics."""

from __future__ import annotations

import numpy as np

from antdrive.base import Bounds, Floats, Point, Pose
from antdrive.robots.lidar import Lidar
from antdrive.sim.sensing import _kernels_rays
from antdrive.worlds import World

RESORT = 1.0  # discs are sorted by distance again after this displacement of the lidar [m]


class Scanner:
    """Lidar in a world.

    Ranges follow REP 117, as the challenge's simulator does: `inf` if nothing is in range, `-inf` if something is too near to
    measure, else the distance. Rays have a closed form, so without noise and resolution they are exact to rounding.

    Attributes:
        lidar: the lidar

    Args:
        lidar: the lidar
        discs: static cylinders: x, y and radius (N, 3) [m]
        heights: the cylinders' heights (N,) [m]; those below the beams are invisible. None: all are visible
        bounds: the inner faces of the walls [m], always high enough; None: no walls
        mover_heights: the movers' heights (M,) [m]; None: all are visible
    """

    def __init__(
        self,
        lidar: Lidar,
        discs: Floats,
        heights: Floats | None = None,
        bounds: Bounds | None = None,
        mover_heights: Floats | None = None,
    ) -> None:
        self.lidar = lidar
        rows = np.ascontiguousarray(discs, dtype=np.float64).reshape(-1, 3)
        rows = rows if heights is None else rows[np.asarray(heights) >= lidar.height]
        self._all = np.ascontiguousarray(rows.T)
        self._bounds = np.asarray(() if bounds is None else bounds, dtype=np.float64)
        self._movers = None if mover_heights is None else np.asarray(mover_heights) >= lidar.height
        angles = lidar.angles - lidar.yaw
        self._beams = np.stack((np.cos(angles), np.sin(angles)))
        self._first, self._spacing = float(angles[0]), lidar.spacing
        self._limits = np.array((lidar.min_range, lidar.max_range, lidar.resolution, lidar.sigma))
        self._silence, self._none = np.zeros(lidar.beams), np.empty((3, 0))
        self._sorted_at = (np.inf, np.inf)

    @classmethod
    def of(cls, lidar: Lidar, world: World) -> Scanner:
        """Create the lidar in a world: its cylinders by height, its movers and its walls.

        Args:
            lidar: the lidar
        """
        heights = np.array([disc.height for disc in world.obstacles])
        return cls(lidar, world.discs, heights, world.bounds, np.array([mover.height for mover in world.movers]))

    def scan(
        self,
        pose: Pose,
        mover_positions: Floats | None = None,
        mover_radii: Floats | None = None,
        rng: np.random.Generator | None = None,
    ) -> Floats:
        """Scan, and return the ranges (beams,) [m].

        With `rng`, ranges have the lidar's noise. Each scan draws one number per beam, hit or not, so invisible objects
        change nothing.

        Args:
            pose: the robot's true pose, not the lidar's
            mover_positions: positions of all movers (M, 2) [m]
            mover_radii: their radii (M,) [m]
            rng: source of the noise; None: no noise
        """
        eye = self.lidar.pose_on(pose)
        if abs(eye[0] - self._sorted_at[0]) + abs(eye[1] - self._sorted_at[1]) > RESORT:
            self._sort(eye[:2])
        movers = self._none
        if mover_positions is not None and mover_radii is not None and len(mover_radii):
            circles = np.column_stack((mover_positions, mover_radii))
            movers = np.ascontiguousarray((circles if self._movers is None else circles[self._movers]).T)
        noise = self._silence if rng is None else rng.standard_normal(self.lidar.beams)
        out = np.empty(self.lidar.beams)
        _kernels_rays.scan(
            *eye, self._beams, self._spacing, self._first, self._limits, self._discs, movers, self._bounds, noise, out
        )  # fmt: skip
        return out

    def _sort(self, eye: Point) -> None:
        """Sort the discs in range until the next sort by distance, so that rays end early."""
        away = np.hypot(self._all[0] - eye[0], self._all[1] - eye[1]) - self._all[2]
        order = np.argsort(away, kind="stable")
        within = np.searchsorted(away[order], self.lidar.max_range + 2 * RESORT)
        self._discs, self._sorted_at = np.take(self._all, order[:within], axis=1), eye
