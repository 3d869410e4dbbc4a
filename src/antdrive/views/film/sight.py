"""What a robot's lidar sees, in a film: beams, and without a map hits, ground not known to be free, obstacles never seen."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from antdrive.sim.log.rollout import Rollout
from antdrive.sim.log.sights import beams_of, lidar_of
from antdrive.views import _kernels_seen as kernels
from antdrive.views.film import _kernels_paint as painting
from antdrive.views.recollection import Recollection, containers, laid_in_world
from antdrive.views.scene import Scene
from antdrive.views.style import BEAM, HATCH, HIT, PALE

if TYPE_CHECKING:
    from antdrive.views.film.compositor import Backdrop

Floats = npt.NDArray[np.float64]
Picture = npt.NDArray[np.uint8]  # (H, W, 3)

VEIL, LINES = 0.62, 0.75  # how much of ground not known to be free is covered by the veil, and by its hatching
PALENESS = 0.80  # of obstacles that were never seen
TINT, BEAMS = 0.13, 0.30  # strength of the fan of beams and of its lines
DRAWN_BEAMS = 90  # in a full circle, at most
HATCHING = 9.0  # distance between the lines of the hatching [px]


class FanPainter:
    """Paints the beams of the last scan into frames."""

    def __init__(self, rollout: Rollout) -> None:
        self._rollout, self._lidar = rollout, lidar_of(rollout)
        self._times = rollout.t[rollout.scan_rows]
        self._last = 0

    def advance(self, at: float) -> None:
        """Go on to a moment [s]."""
        self._last = max(0, int(np.searchsorted(self._times, at + 1e-9, side="right")) - 1)

    def lay_fan(
        self,
        frame: Picture,
        backdrop: Backdrop,
        forward: npt.NDArray[np.floating[Any]],
        inverse: npt.NDArray[np.floating[Any]],
    ) -> None:
        """Lay the beams of the last scan on the ground."""
        lidar, (eye, first, reaches) = self._lidar, beams_of(self._rollout, self._last)
        every = max(1, round(2 * np.pi / lidar.spacing / DRAWN_BEAMS))
        style = np.array([TINT, BEAMS, backdrop.camera.pixel])
        closed, colour = lidar.full_circle, np.array(BEAM, dtype=np.float64)
        visible = backdrop.visible
        kernels.lay_fan(
            frame, visible, forward, inverse, eye, first, lidar.spacing, closed, reaches, every, style, colour
        )


class SightPainter(FanPainter):
    """Paints what a robot without a map had seen into frames. Moments are asked for in increasing order."""

    def __init__(self, rollout: Rollout, scene: Scene) -> None:
        super().__init__(rollout)
        self._recollection, self._scene = Recollection(rollout), scene
        self._drift = self._recollection.drift(0.0)
        self._discs = np.empty((0, 3))
        self._around = containers(scene.obstacles)

    def advance(self, at: float) -> None:
        """Go on to a moment [s]."""
        super().advance(at)
        recollection = self._recollection
        recollection.advance(at)
        self._drift = recollection.drift(at)
        discs = recollection.map.discs()
        self._discs = np.column_stack([laid_in_world(discs[:, :2], self._drift), discs[:, 2]])

    def laid(self, points: Floats) -> Floats:
        """Where places (N, 2) on the robot's map lie in the world now [m]."""
        return laid_in_world(points, self._drift)

    def cover(self, frame: Picture, backdrop: Backdrop, inverse: npt.NDArray[np.floating[Any]], fine: int) -> None:
        """Hatch the ground that is not known to be free, and pale the obstacles that no beam has met."""
        seen, pixel = self._recollection.map, backdrop.camera.pixel
        style = np.array([VEIL, LINES, HATCHING * pixel, pixel])
        tints = np.array([PALE, HATCH], dtype=np.float64)
        arrays, bounds = seen.arrays, np.array(self._scene.bounds)
        visible = backdrop.visible
        kernels.veil(
            frame, visible, inverse, bounds, self._drift, arrays.free, arrays.occupied, arrays.frame, style, tints
        )
        unmet = np.isinf(self._recollection.met)[self._around]
        if unmet.any():
            kernels.pale_bodies(frame, visible, backdrop.bodies, fine, unmet, tints[0], PALENESS)

    def put_hits(self, frame: Picture, backdrop: Backdrop) -> None:
        """Put the hits on the robot's map over everything, at the height of the beams."""
        camera = backdrop.camera
        plane = camera.plane(min(self._recollection.lidar.height, 0.3))
        x, y, radius = self._discs.T
        rows = np.column_stack([x, y, x, y, np.maximum(radius, 1.1 * camera.pixel)])
        everywhere = np.ones_like(backdrop.visible)
        inverse = np.linalg.inv(plane)
        colour = np.array(HIT, dtype=np.float64)
        painting.blend_capsules(frame, everywhere, plane, inverse, np.ascontiguousarray(rows), colour, 0.9)
