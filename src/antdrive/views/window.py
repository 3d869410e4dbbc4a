"""Real-time playback of a run in PyBullet's viewer."""

from __future__ import annotations

import os
import sys
import time

import numpy as np

from antdrive.base.errors import InputError
from antdrive.sim.log.rollout import Rollout
from antdrive.sim.physics.bullet import bullet
from antdrive.views.colours import KERB, OBSTACLE, UNSEEN, Colour
from antdrive.views.film.compositor import drawn_height, part_pose
from antdrive.views.film.ground import kerb_width
from antdrive.views.film.meshes import Mesh, cylinder, join, kerb, robot_parts
from antdrive.views.film.playback import Playback
from antdrive.views.scene import Scene

AT_ONCE = 400  # meshes per body: PyBullet accepts at most 131072 vertices


def check_display() -> None:
    """Raise `InputError` unless a window can open."""
    if sys.platform.startswith("linux") and not os.environ.get("DISPLAY"):
        raise InputError("--gui: no display (DISPLAY is not set); --film FILE.mp4 works without one")


def add_mesh(number: int, mesh: Mesh, colour: Colour) -> int:
    """Add a visible mesh to PyBullet client `number` and return its body number."""
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


def show(rollout: Rollout, *, hold: float = 3.0) -> None:
    """Play a run in a window until it ends or the window is closed."""
    check_display()
    p = bullet()
    number = p.connect(p.GUI)
    if number < 0:
        raise InputError("--gui: PyBullet's viewer did not open")
    try:
        p.configureDebugVisualizer(p.COV_ENABLE_GUI, 0, physicsClientId=number)
        scene, playback = Scene.of(rollout), Playback(rollout)
        tall = np.minimum(scene.obstacles[:, 3], drawn_height(scene))
        width = kerb_width(scene)
        add_mesh(number, join(*kerb(scene.bounds, width, 0.8 * width)), KERB)
        discs = list(zip(scene.obstacles.tolist(), tall.tolist(), scene.unseen, strict=True))
        for colour in (OBSTACLE, UNSEEN):
            alike = [cylinder(r, 0.0, z, x=x, y=y) for (x, y, r, _), z, late in discs if late == (colour is UNSEEN)]
            for k in range(0, len(alike), AT_ONCE):
                add_mesh(number, join(*alike[k : k + AT_ONCE]), colour)
        robot = [(part, add_mesh(number, part.mesh, part.colour)) for part in robot_parts(scene.robot)]
        for a, b in zip(rollout.route[:-1], rollout.route[1:], strict=True):
            p.addUserDebugLine([*a, 0.01], [*b, 0.01], [0.1, 0.13, 0.26], 2, physicsClientId=number)
        x0, y0, x1, y1 = scene.bounds
        middle = [(x0 + x1) / 2, (y0 + y1) / 2, 0.0]
        p.resetDebugVisualizerCamera(0.9 * max(x1 - x0, y1 - y0), 0, -52, middle, physicsClientId=number)
        started = time.monotonic()
        while (at := time.monotonic() - started) < playback.duration + hold and p.isConnected(physicsClientId=number):
            now = min(at, playback.duration)
            for part, body in robot:
                place, turn = part_pose(part, *playback.pose(now), playback.wheels(now))
                p.resetBasePositionAndOrientation(body, place, turn, physicsClientId=number)
            time.sleep(1 / 60)
    finally:
        if p.isConnected(physicsClientId=number):
            p.disconnect(number)
