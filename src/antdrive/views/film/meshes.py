"""Meshes for films: cylinders, and a robot."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from antdrive.base.types import Floats, Ints
from antdrive.robots.spec import RobotSpec
from antdrive.views.colours import INK, SHELL, TURRET, WHITE, Colour, mixed


@dataclass(frozen=True, eq=False)
class Mesh:
    """Triangles with a normal per vertex."""

    vertices: Floats  # points (V, 3) [m]; those on a sharp edge occur once per face
    normals: Floats  # unit vectors (V, 3)
    triangles: Ints  # vertex indices (T, 3), counter-clockwise from outside


@dataclass(frozen=True, eq=False)
class Part:
    """Rigid part of the robot in one colour."""

    mesh: Mesh
    colour: Colour


def join(*meshes: Mesh) -> Mesh:
    """Join meshes into one."""
    starts = np.cumsum([0, *(len(mesh.vertices) for mesh in meshes)])
    return Mesh(
        np.vstack([mesh.vertices for mesh in meshes]),
        np.vstack([mesh.normals for mesh in meshes]),
        np.vstack([mesh.triangles + start for mesh, start in zip(meshes, starts, strict=False)]),
    )


def cylinder(radius: float, low: float, high: float, *, sides: int = 48, x: float = 0.0, y: float = 0.0) -> Mesh:
    """Return an upright cylinder with a smooth side, a sharp rim and no bottom."""
    angle = np.arange(sides) * (2 * math.pi / sides)
    ring = np.column_stack([np.cos(angle), np.sin(angle)])
    rim = np.column_stack([x + radius * ring[:, 0], y + radius * ring[:, 1]])
    floor, roof = (np.column_stack([rim, np.full(sides, z)]) for z in (low, high))
    out = np.column_stack([ring, np.zeros(sides)])
    here, there = np.arange(sides), (np.arange(sides) + 1) % sides
    upper, lower = np.column_stack([here, there, there + sides]), np.column_stack([here, there + sides, here + sides])
    lid = np.column_stack([np.full(sides, 3 * sides), here + 2 * sides, there + 2 * sides])
    up = np.tile([0.0, 0.0, 1.0], (sides + 1, 1))
    vertices = np.vstack([floor, roof, roof, [[x, y, high]]])
    return Mesh(vertices, np.vstack([out, out, up]), np.vstack([upper, lower, lid]))


def prism(outline: Floats, low: float, high: float, *, chamfer: float = 0.0) -> Mesh:
    """Extrude a counter-clockwise outline (K, 2) from `low` to `high`, with a chamfered upper edge.

    It is convex, or whole in sight of its first point.
    """
    count = len(outline)
    centre = outline.mean(axis=0)
    reach = np.hypot(*(outline - centre).T).max()
    lid = centre + (outline - centre) * (1 - chamfer / reach)
    levels = [(outline, low), (outline, high - chamfer), (lid, high)]
    faces = [_band(levels[i], levels[i + 1]) for i in range(2) if levels[i + 1][1] > levels[i][1]]
    fan = np.column_stack([np.zeros(count - 2), np.arange(1, count - 1), np.arange(2, count)]).astype(np.int64)
    top = Mesh(np.column_stack([lid, np.full(count, high)]), np.tile([0.0, 0.0, 1.0], (count, 1)), fan)
    return join(*faces, top)


def robot_height(body: RobotSpec) -> float:
    """Return the robot's drawn height [m], without a tall mast, which would hide the path."""
    return min(body.height, max(1.1 * body.footprint.radius, 2.4 * body.wheel_radius))


def robot_parts(body: RobotSpec, deck_colour: Colour = SHELL) -> tuple[Part, ...]:
    """Return the robot's parts, relative to the ground below the axle's centre, heading along +x.

    The deck has the footprint's exact outline. On it are a turret and a white arrow.
    """
    foot, r = body.footprint, body.wheel_radius
    xmin, ymin, xmax, ymax = foot.bounds
    middle, half = np.array([(xmin + xmax) / 2, (ymin + ymax) / 2]), min(xmax - xmin, ymax - ymin) / 2
    outline, low = np.array(foot.outline()), 0.3 * r
    deck = max(min(1.45 * r, 0.8 * robot_height(body)), low + 0.3 * r)
    roof = max(robot_height(body), deck + 0.2 * r)
    back = middle[0] - 0.04 * (xmax - xmin)
    smaller = (outline - middle) * (0.60 if foot.is_disc else 0.66) + [back, middle[1]]
    arrow = [back, middle[1]] + 0.5 * half * np.array([(0.95, 0.0), (-0.75, 0.72), (-0.30, 0.0), (-0.75, -0.72)])
    top = TURRET if deck_colour == SHELL else mixed(deck_colour, INK, 0.3)
    return (
        Part(prism(outline, low, deck, chamfer=0.12 * (deck - low)), deck_colour),
        Part(prism(smaller, deck, roof, chamfer=0.05 * half), top),
        Part(prism(arrow, roof, 1.01 * roof), WHITE),
    )


def _band(low: tuple[Floats, float], high: tuple[Floats, float]) -> Mesh:
    """Return the flat faces between two outlines of the same number of points, each at its height."""
    (a, za), (b, zb) = low, high
    count = len(a)
    following = (np.arange(count) + 1) % count
    corners = ((a, za), (a[following], za), (b[following], zb), (b, zb))
    quads = np.stack([np.column_stack([points, np.full(count, z)]) for points, z in corners], axis=1)
    normal = np.cross(quads[:, 1] - quads[:, 0], quads[:, 3] - quads[:, 0])
    normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-12)
    first = 4 * np.arange(count)
    halves = [np.column_stack([first, first + k, first + k + 1]) for k in (1, 2)]
    return Mesh(quads.reshape(-1, 3), np.repeat(normal, 4, axis=0), np.vstack(halves))
