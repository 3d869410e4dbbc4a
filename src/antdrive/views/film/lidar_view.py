"""Lidar in films: beams, and a mapless robot's hits, unknown ground and undetected obstacles."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt

from antdrive.base.types import Floats
from antdrive.sim.log.rollout import Rollout
from antdrive.sim.log.sights import beams_of, lidar_of
from antdrive.views import _kernels_seen as kernels
from antdrive.views.colours import BEAM, HATCH, HIT, PALE, Colour
from antdrive.views.film import _kernels_paint as painting
from antdrive.views.film.camera import Camera, Picture
from antdrive.views.film.ground import capsules
from antdrive.views.map_reconstruction import MapReconstruction, enclosing_cylinders, world_points
from antdrive.views.scene import Scene

VEIL, LINES = 0.62, 0.75  # opacity of the veil over unknown ground and of its hatching
PALENESS = 0.80  # of undetected obstacles
TINT, BEAMS = 0.13, 0.30  # opacity of the scanned area and of the beams
DRAWN_BEAMS = 90  # maximum number of drawn beams in a full circle
HIT_DEPTH = 0.06  # a hit is hidden if it lies farther behind a surface [m]
HATCHING = 9.0  # spacing of the hatching [px]


@dataclass(frozen=True, eq=False)
class Backdrop:
    """Picture of all static bodies by one camera."""

    camera: Camera
    pixels: Picture  # the picture (H, W, 3)
    visible: npt.NDArray[np.float32]  # fraction of each pixel that shows ground (H, W)
    # depth of the bodies in clip space at the rendered resolution, 1 for ground
    depth: npt.NDArray[np.float32]
    bodies: npt.NDArray[np.int32]  # index of the visible obstacle at the rendered resolution, -1 for ground

    @cached_property
    def forward(self) -> Floats:
        """Homography (3, 3) from the ground to pixels."""
        return self.camera.ground

    @cached_property
    def _everywhere(self) -> npt.NDArray[np.float32]:
        return np.ones_like(self.visible)

    @cached_property
    def inverse(self) -> Floats:
        """Homography (3, 3) from pixels to the ground."""
        return np.asarray(np.linalg.inv(self.forward))

    def blend(
        self, frame: Picture, rows: Floats, colour: Colour, strength: float, *, height: float | None = None
    ) -> None:
        """Blend capsules (N, 5) of one colour into the ground of a frame, or at a height [m] over all bodies."""
        visible, forward, inverse = self.visible, self.forward, self.inverse
        if height is not None:
            visible, forward = self._everywhere, self.camera.plane(height)
            inverse = np.asarray(np.linalg.inv(forward))
        painting.blend_capsules(frame, visible, forward, inverse, rows, np.array(colour, dtype=np.float64), strength)


class BeamPainter:
    """Painter of the last scan's beams."""

    def __init__(self, rollout: Rollout) -> None:
        self._rollout, self._lidar = rollout, lidar_of(rollout)
        self._times = rollout.t[rollout.scan_rows]
        self._last = 0

    def advance(self, at: float) -> None:
        """Advance to a time [s]."""
        self._last = max(0, int(np.searchsorted(self._times, at + 1e-9, side="right")) - 1)

    def draw_beams(self, frame: Picture, backdrop: Backdrop) -> None:
        """Draw the beams of the last scan on the ground."""
        lidar, (eye, first, reaches) = self._lidar, beams_of(self._rollout, self._last)
        every = max(1, round(2 * np.pi / lidar.spacing / DRAWN_BEAMS))
        style, colour = np.array([TINT, BEAMS, backdrop.camera.pixel]), np.array(BEAM, dtype=np.float64)
        fan = (eye, first, lidar.spacing, lidar.full_circle, reaches, every)
        kernels.lay_fan(frame, backdrop.visible, backdrop.forward, backdrop.inverse, *fan, style, colour)


class OwnMapPainter(BeamPainter):
    """Painter of a mapless robot's occupancy map. Times must be requested in increasing order."""

    def __init__(self, rollout: Rollout, scene: Scene) -> None:
        super().__init__(rollout)
        self._reconstruction, self._scene = MapReconstruction(rollout), scene
        self._drift = self._reconstruction.drift(0.0)
        self._discs = np.empty((0, 3))
        self._around = enclosing_cylinders(scene.obstacles)

    def advance(self, at: float) -> None:
        """Advance to a time [s]."""
        super().advance(at)
        reconstruction = self._reconstruction
        reconstruction.advance(at)
        self._drift = reconstruction.drift(at)
        discs = reconstruction.map.discs()
        self._discs = np.column_stack([world_points(discs[:, :2], self._drift), discs[:, 2]])

    def to_world(self, points: Floats) -> Floats:
        """Transform points (N, 2) [m] from the robot's map to the world."""
        return world_points(points, self._drift)

    def hatch_unknown(self, frame: Picture, backdrop: Backdrop, fine: int) -> None:
        """Hatch unknown ground and fade undetected obstacles."""
        seen, pixel = self._reconstruction.map, backdrop.camera.pixel
        style = np.array([VEIL, LINES, HATCHING * pixel, pixel])
        tints = np.array([PALE, HATCH], dtype=np.float64)
        arrays, bounds, visible = seen.arrays, np.array(self._scene.bounds), backdrop.visible
        ground = (arrays.free, arrays.occupied, arrays.frame)
        kernels.veil(frame, visible, backdrop.inverse, bounds, self._drift, *ground, style, tints)
        unmet = np.isinf(self._reconstruction.met)[self._around]
        if unmet.any():
            kernels.pale_bodies(frame, visible, backdrop.bodies, fine, unmet, tints[0], PALENESS)

    def draw_hits(self, frame: Picture, backdrop: Backdrop) -> None:
        """Draw the hits of the occupancy map that no body hides, at the height of the beams."""
        camera, height = backdrop.camera, min(self._reconstruction.lidar.height, 0.3)
        points = np.column_stack([self._discs[:, :2], np.full(len(self._discs), height)])
        cols, rows = camera.pixels(points).T
        depth = camera.depths(points, towards=self._discs[:, 2] + HIT_DEPTH)
        high, wide = backdrop.visible.shape
        inside = (cols >= 0) & (rows >= 0) & (cols < wide) & (rows < high)
        fine = backdrop.depth.shape[0] // high
        at = (fine * rows[inside]).astype(int), (fine * cols[inside]).astype(int)
        hits = self._discs[inside][depth[inside] <= backdrop.depth[at]]
        drawn = capsules(hits[:, :2], hits[:, :2], np.maximum(hits[:, 2], 1.1 * camera.pixel))
        backdrop.blend(frame, drawn, HIT, 0.9, height=height)
