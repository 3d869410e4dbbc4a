"""Painter of one camera's picture: shapes and grids on the ground, and shaded bodies, by matplotlib's Agg."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any, NamedTuple, TypeAlias

import numpy as np
import numpy.typing as npt
from matplotlib.backends.backend_agg import RendererAgg
from matplotlib.path import Path
from matplotlib.transforms import Affine2D, Bbox, IdentityTransform
from PIL import Image

from antdrive.base.types import Floats
from antdrive.views.colours import HIT, Colour
from antdrive.views.film.camera import Camera, Picture
from antdrive.views.film.meshes import Part

Box: TypeAlias = tuple[int, int, int, int]  # x0, y0, x1, y1 [px]; x1 and y1 are excluded

HIT_RADIUS = 1 / 640  # of a dot, at least a pixel, as a fraction of the picture's width
HIT_DEPTH = 0.06  # a hit is hidden if it lies farther behind a surface [m]
NO_HITS: Floats = np.empty((0, 3))
AMBIENT, DIFFUSE = 0.62, 0.46  # strength of ambient light and of the lamp
LAMP = np.array([-0.62, -0.25, 0.74]) / np.linalg.norm([0.62, 0.25, 0.74])  # direction: right, ahead, up


class UprightBody(NamedTuple):
    """Upright body at a place."""

    x: float  # axis of the cylinder around it [m]
    y: float  # [m]
    radius: float  # of that cylinder [m]
    height: float  # of that cylinder [m]
    parts: Sequence[Part]  # from the lowest to the highest
    place: Floats  # rotation or scale of the parts and, in the last column, position (3, 4) [m]


class Painter:
    """Painter of the picture of a camera. Later shapes cover earlier ones.

    Attributes:
        camera: the camera
        pixels: the picture so far (H, W, 4), red, green, blue and opacity; a live view
    """

    def __init__(self, camera: Camera, tall: float) -> None:
        self.camera = camera
        width, height = camera.size
        renderer: Any = RendererAgg  # without types
        self._agg: Any = renderer(width, height, 72.0)
        self.pixels: Picture = np.asarray(self._agg.buffer_rgba())
        corners = np.array([(x, y, 1.0) for x in (0, width) for y in (0, height)])
        seen = [corners @ np.linalg.inv(camera.plane(z)).T for z in (0.0, tall)]
        ends = np.concatenate([points[:, :2] / points[:, 2:] for points in seen])
        room = 2 * camera.pixel
        self.low, self.high = ends.min(axis=0) - room, ends.max(axis=0) + room  # of the visible ground [m]

    def near(self, points: Floats, reach: Floats | float = 0.0) -> Any:
        """Return which discs at points (N, 2) with radii `reach` [m] may be visible (N,)."""
        far = np.maximum(self.low - points, points - self.high).max(axis=1)
        return far < reach

    def fill(self, shapes: Iterable[Floats], colour: Colour, opacity: float = 1.0, *, height: float = 0.0) -> None:
        """Fill the union of polygons (N, 2) [m], all in one sense of rotation, on the ground or at a height [m]."""
        shapes = shapes if isinstance(shapes, np.ndarray) else list(shapes)
        if not len(shapes):
            return
        # Vertices out of sight are moved to the edge of the visible ground: none is behind the camera.
        whole = shapes.reshape(-1, 2) if isinstance(shapes, np.ndarray) else np.concatenate(shapes)
        points = np.clip(whole, self.low, self.high)
        codes = np.full(len(points), Path.LINETO, dtype=np.uint8)
        codes[np.cumsum([0, *map(len, shapes[:-1])])] = Path.MOVETO
        plane = self.camera.plane(height)
        at = np.column_stack([points, np.ones(len(points))]) @ plane.T
        path = Path(self._upwards(at[:, :2] / at[:, 2:]), codes)
        tint = (*(channel / 255 for channel in colour), opacity)
        self._agg.draw_path(self._pen(), path, IdentityTransform(), tint)

    def lay(
        self, tints: Picture | Colour, opacity: Picture, cells: Floats, *, outside: int = 0, smooth: bool = False
    ) -> None:
        """Blend a grid of tints (R, C, 3), or one tint, with opacities (R, C), 0 to 255, over the ground.

        `cells` (3, 3) maps the ground [m] to columns and rows of the grid; beyond it the opacity is `outside`.
        """
        back = cells @ np.linalg.inv(self.camera.ground)
        turn, coefficients = Image.Transform.PERSPECTIVE, (back / back[2, 2]).ravel()[:8].tolist()
        mixing = Image.Resampling.BILINEAR if smooth else Image.Resampling.NEAREST

        def seen(grid: Picture, fill: int) -> Image.Image:
            return Image.fromarray(grid).transform(self.camera.size, turn, coefficients, mixing, fillcolor=fill)

        picture = Image.fromarray(self.pixels[..., :3])
        tint = tints if isinstance(tints, tuple) else seen(tints, 0)
        picture.paste(tint, (0, 0, *self.camera.size), seen(opacity, outside))
        self.pixels[..., :3] = np.asarray(picture)

    def draw_bodies(self, bodies: Iterable[UprightBody], box: Box | None = None, hits: Floats = NO_HITS) -> None:
        """Draw bodies within a box, the farthest first, and hits at points (N, 3) [m] that they may hide."""
        eye = self.camera.eye[:2]
        # Of two discs, the one with the smaller power is before the other: their radical axis separates them.
        behind = [(b.radius**2 - (b.x - eye[0]) ** 2 - (b.y - eye[1]) ** 2, b) for b in bodies]
        behind.sort(key=lambda pair: pair[0])
        near = -((np.hypot(*(hits[:, :2] - eye).T) - HIT_DEPTH) ** 2)
        hits, near = hits[np.argsort(near)], np.sort(near)
        drawn, faces = 0, list[tuple[Floats, Floats]]()
        for power, body in behind:
            count = int(np.searchsorted(near, power))
            if count > drawn:
                self._draw_faces(faces, box)
                self._draw_hits(hits[drawn:count])
                drawn, faces = count, []
            faces += [self._faces(part, body.place) for part in body.parts]
        self._draw_faces(faces, box)
        self._draw_hits(hits[drawn:])

    def _draw_hits(self, points: Floats) -> None:
        """Draw dots at points (N, 3) [m]."""
        if len(points):
            path = Path(self._upwards(self.camera.pixels(points)))
            size = Affine2D().scale(max(1.0, HIT_RADIUS * self.camera.size[0]))
            tint = (*(channel / 255 for channel in HIT), 1.0)
            self._agg.draw_markers(self._pen(), Path.unit_circle(), size, path, IdentityTransform(), tint)

    def _draw_faces(self, faces: Sequence[tuple[Floats, Floats]], box: Box | None) -> None:
        """Draw shaded triangles with corners (T, 3, 2) and colours (T, 3, 4)."""
        if faces:
            corners, tints = (np.concatenate(each) for each in zip(*faces, strict=True))
            self._agg.draw_gouraud_triangles(self._pen(box), corners, tints, IdentityTransform())

    def _faces(self, part: Part, place: Floats) -> tuple[Floats, Floats]:
        """Return the corners (T, 3, 2) and colours (T, 3, 4) of a part's triangles that face the camera."""
        mesh, right = part.mesh, self.camera.view[0, :3]
        points = mesh.vertices @ place[:, :3].T + place[:, 3]
        points[:, :2] = np.clip(points[:, :2], self.low, self.high)
        out = mesh.normals @ place[:, :3].T
        lamp = LAMP[0] * right + LAMP[1] * np.array([-right[1], right[0], 0.0]) + [0.0, 0.0, LAMP[2]]
        lit = AMBIENT + DIFFUSE * np.maximum(0.0, out @ lamp / np.maximum(np.linalg.norm(out, axis=1), 1e-12))
        tints = np.ones((len(points), 4))
        tints[:, :3] = np.minimum(1.0, np.array(part.colour) / 255 * lit[:, None])
        corners = self._upwards(self.camera.pixels(points))[mesh.triangles]
        one, other = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
        front = one[:, 0] * other[:, 1] > one[:, 1] * other[:, 0]
        return corners[front], tints[mesh.triangles[front]]

    def box_of(self, bodies: Sequence[UprightBody]) -> npt.NDArray[np.int64]:
        """Return the pixel boxes (N, 4) of bodies: x0, y0, x1, y1, within the picture."""
        corners = [
            (body.x + i * body.radius, body.y + j * body.radius, z)
            for body in bodies
            for i in (-1, 1)
            for j in (-1, 1)
            for z in (0.0, body.height)
        ]
        points = np.array(corners).reshape(-1, 3)
        points[:, :2] = np.clip(points[:, :2], self.low, self.high)
        at, size = self.camera.pixels(points).reshape(-1, 8, 2), self.camera.size
        low, high = np.floor(at.min(axis=1)) - 2, np.ceil(at.max(axis=1)) + 2
        return np.asarray(np.clip(np.hstack([low, high]), 0, (*size, *size)), dtype=np.int64)

    def _upwards(self, pixels: Floats) -> Floats:
        """Return pixels (N, 2) counted from the lower left corner, as Agg does."""
        return np.asarray(pixels * (1, -1) + (0, self.camera.size[1]))

    def _pen(self, box: Box | None = None) -> Any:
        pen = self._agg.new_gc()
        pen.set_linewidth(0.0)
        pen.set_snap(False)
        if box is not None:
            height = self.camera.size[1]
            pen.set_clip_rectangle(Bbox.from_extents(box[0], height - box[3], box[2], height - box[1]))
        return pen
