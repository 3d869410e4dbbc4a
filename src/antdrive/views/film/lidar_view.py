"""Lidar in films: beams, and a mapless robot's hits, unknown ground and undetected obstacles."""

from __future__ import annotations

import numpy as np

from antdrive.base.types import Flags, Floats
from antdrive.sim.log.rollout import Rollout
from antdrive.sim.log.sights import beams_of, lidar_of
from antdrive.views.colours import BEAM, PALE
from antdrive.views.film.ground import capsules
from antdrive.views.film.painter import Painter
from antdrive.views.map_reconstruction import MapReconstruction, world_points

VEIL = 190  # opacity of the veil over unknown ground, 0 to 255
PALENESS = 0.80  # of undetected obstacles
TINT, BEAMS = 0.13, 0.30  # opacity of the scanned area and of the beams
DRAWN_BEAMS = 90  # maximum number of drawn beams in a full circle


class BeamPainter:
    """Painter of the last scan's beams."""

    def __init__(self, rollout: Rollout) -> None:
        self._rollout, self._lidar = rollout, lidar_of(rollout)
        self._times = rollout.t[rollout.scan_rows]
        self._last = 0

    def advance(self, at: float) -> None:
        """Advance to a time [s]."""
        self._last = max(0, int(np.searchsorted(self._times, at + 1e-9, side="right")) - 1)

    def draw_beams(self, painter: Painter) -> None:
        """Draw the beams of the last scan on the ground."""
        lidar, ((x, y, yaw), first, reaches) = self._lidar, beams_of(self._rollout, self._last)
        turns, eye = yaw + first + lidar.spacing * np.arange(len(reaches)), np.array([(x, y)])
        ways = reaches[:, None] * np.column_stack([np.cos(turns), np.sin(turns)])
        room = np.where(ways > 0, painter.high - eye, painter.low - eye) / np.where(ways == 0, 1e-9, ways)
        ends = eye + ways * np.clip(room.min(axis=1), 0.0, 1.0)[:, None]  # within the visible ground
        painter.fill([ends if lidar.full_circle else np.vstack([eye, ends])], BEAM, TINT)
        drawn = ends[:: max(1, round(2 * np.pi / lidar.spacing / DRAWN_BEAMS))]
        painter.fill(capsules(np.repeat(eye, len(drawn), axis=0), drawn, 0.5 * painter.camera.pixel), BEAM, BEAMS)


class OwnMapPainter(BeamPainter):
    """Painter of a mapless robot's occupancy map. Times must be requested in increasing order."""

    def __init__(self, rollout: Rollout) -> None:
        super().__init__(rollout)
        self._reconstruction = MapReconstruction(rollout)
        self._drift = self._reconstruction.drift(0.0)

    def advance(self, at: float) -> None:
        """Advance to a time [s]."""
        super().advance(at)
        self._reconstruction.advance(at)
        self._drift = self._reconstruction.drift(at)

    @property
    def unmet(self) -> Flags:
        """Obstacles that no beam has met (N,)."""
        return np.asarray(np.isinf(self._reconstruction.met))

    @property
    def hits(self) -> Floats:
        """Hits of the occupancy map in the world (N, 3) [m]."""
        discs = self._reconstruction.map.discs()
        points = world_points(discs[:, :2], self._drift)
        return np.column_stack([points, np.full(len(points), min(self._reconstruction.lidar.height, 0.3))])

    def to_world(self, points: Floats) -> Floats:
        """Transform points (N, 2) [m] from the robot's map to the world."""
        return world_points(points, self._drift)

    def veil_unknown(self, painter: Painter) -> None:
        """Veil unknown ground."""
        arrays, (cos, sin, x, y) = self._reconstruction.map.arrays, self._drift.tolist()
        left, low, cell = arrays.frame.tolist()
        unknown = np.where(arrays.free | arrays.occupied, 0, VEIL).astype(np.uint8)
        to_map = np.array([(cos, -sin, x - left), (sin, cos, y - low), (0.0, 0.0, cell)])
        painter.lay(PALE, unknown, to_map, outside=VEIL, smooth=True)
