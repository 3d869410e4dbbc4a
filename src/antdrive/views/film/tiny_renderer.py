"""PyBullet's software renderer, TinyRenderer: meshes in, pictures with depth out."""

from __future__ import annotations

from typing import Any, TypeAlias

import numpy as np

from antdrive.sim.physics.bullet import bullet
from antdrive.views.film.camera import Camera
from antdrive.views.film.meshes import Mesh
from antdrive.views.style import Colour

AMBIENT, DIFFUSE = 0.62, 0.46  # strength of the light from all sides and from the lamp

Box: TypeAlias = tuple[int, int, int, int]  # x0, y0, x1, y1 [px]; x1 and y1 are excluded


def add_mesh(number: int, mesh: Mesh, colour: Colour) -> int:
    """Add a mesh that is visible but cannot collide to PyBullet client `number`; returns its body number."""
    p = bullet()
    shape = p.createVisualShape(
        p.GEOM_MESH,
        vertices=mesh.vertices.tolist(),
        normals=mesh.normals.tolist(),
        indices=mesh.triangles.ravel().tolist(),
        rgbaColor=[*(channel / 255 for channel in colour), 1.0],
        physicsClientId=number,
    )
    body: int = p.createMultiBody(0, -1, shape, physicsClientId=number)
    return body


def render(
    number: int, camera: Camera, box: Box | None, fine: int, light: tuple[float, float, float]
) -> tuple[Any, Any, Any]:
    """Render a PyBullet client's bodies: picture (h, w, 4), depth (h, w) and body numbers (h, w), -1 for none."""
    p = bullet()
    x0, y0, x1, y1 = box or (0, 0, *camera.size)
    view, projection = camera.matrices(box)
    width, height = (x1 - x0) * fine, (y1 - y0) * fine
    _, _, image, depth, seg = p.getCameraImage(
        width,
        height,
        view,
        projection,
        lightDirection=light,
        lightColor=[1, 1, 1],
        lightAmbientCoeff=AMBIENT,
        lightDiffuseCoeff=DIFFUSE,
        lightSpecularCoeff=0.0,
        shadow=0,
        renderer=p.ER_TINY_RENDERER,
        physicsClientId=number,
    )
    return (
        np.reshape(np.asarray(image, dtype=np.uint8), (height, width, 4)),
        np.array(depth, dtype=np.float32).reshape(height, width),
        np.reshape(np.asarray(seg, dtype=np.int32), (height, width)),
    )


def overlap(a: Box, b: Box) -> bool:
    """Whether two boxes share a pixel."""
    return a[0] < b[2] and b[0] < a[2] and a[1] < b[3] and b[1] < a[3]


def merged(boxes: list[Box]) -> list[Box]:
    """The boxes, overlapping ones joined: bodies that may hide each other are drawn together, and no pixel twice."""
    done: list[Box] = []
    for box in boxes:
        while True:
            hit = next((b for b in done if overlap(b, box)), None)
            if hit is None:
                break
            done.remove(hit)
            box = (min(hit[0], box[0]), min(hit[1], box[1]), max(hit[2], box[2]), max(hit[3], box[3]))
        done.append(box)
    return done
