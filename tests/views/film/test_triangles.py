"""Meshes drawn by the kernel compared with PyBullet's TinyRenderer."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from antdrive.robots import load_robot
from antdrive.sim.physics.bullet import bullet, client
from antdrive.views.film.camera import Camera, camera_for
from antdrive.views.film.compositor import part_pose
from antdrive.views.film.meshes import Mesh, cylinder, robot_parts
from antdrive.views.film.tiny_renderer import add_mesh, merged, overlap, render
from antdrive.views.film.triangles import Solid, draw_solids, placed
from antdrive.views.scene import Body
from antdrive.views.style import MOVER, Colour

LIGHT = (-0.62, -0.25, 0.74)
UPRIGHT = (0.0, 0.0, 0.0, 1.0)
Pose = tuple[tuple[float, float, float], tuple[float, float, float, float]]


def rendered(bodies: list[tuple[Mesh, Colour, Pose]], camera: Camera, box: tuple[int, int, int, int], fine: int):
    p = bullet()
    with client() as number:
        for mesh, colour, (at, turn) in bodies:
            body = add_mesh(number, mesh, colour)
            p.resetBasePositionAndOrientation(body, at, turn, physicsClientId=number)
        return render(number, camera, box, fine, LIGHT)


def drawn(bodies: list[tuple[Mesh, Colour, Pose]], camera: Camera, box: tuple[int, int, int, int], fine: int):
    return draw_solids([Solid(mesh, colour, placed(*pose)) for mesh, colour, pose in bodies], camera, box, fine, LIGHT)


def assert_alike(bodies: list[tuple[Mesh, Colour, Pose]], camera: Camera, fine: int, least: int = 200) -> None:
    box = (40, 30, 200, 150)
    image, depth, seg = drawn(bodies, camera, box, fine)
    wanted_image, wanted_depth, wanted_seg = rendered(bodies, camera, box, fine)
    seen = (seg >= 0) & (wanted_seg >= 0)
    assert seen.sum() >= least
    # TinyRenderer computes in single precision, so a sample on an edge may fall on its other side.
    assert ((seg >= 0) != (wanted_seg >= 0)).sum() <= 3
    levels = np.abs(image[seen].astype(int) - wanted_image[seen][:, :3]).max(axis=1)
    away = np.abs(depth[seen] - wanted_depth[seen])
    assert (levels > 1).sum() <= 3
    assert (away > 1e-5).sum() <= 3


@settings(max_examples=25)
@given(
    st.sampled_from(["oblique", "top"]),
    st.integers(1, 3),
    st.lists(st.tuples(st.floats(1.0, 4.0), st.floats(1.0, 3.0), st.floats(0.1, 0.6)), min_size=1, max_size=4),
)
def test_cylinders_are_drawn_as_tiny_renderer_draws_them(
    name: str, fine: int, places: list[tuple[float, float, float]]
) -> None:
    camera = camera_for(name, (0, 0), (5, 4), 0.6, (240, 180))
    # Not at round places: where an edge runs through many samples exactly, rounding decides on all of them.
    bodies = [(cylinder(r, 0.0, 0.6), MOVER, ((x + 0.00137, y - 0.00213, 0.0), UPRIGHT)) for x, y, r in places]
    assert_alike(bodies, camera, fine, least=0)


@pytest.mark.parametrize("robot", ["turtlebot", "jackal"])
@pytest.mark.parametrize(("yaw", "wheels"), [(0.0, (0.0, 0.0)), (2.1, (0.4, -1.7)), (-1.3, (3.0, 3.1))])
def test_robots_are_drawn_as_tiny_renderer_draws_them(robot: str, yaw: float, wheels: tuple[float, float]) -> None:
    camera = camera_for("oblique", (0, 0), (2, 1.6), 0.6, (240, 180))
    parts = robot_parts(Body.of(load_robot(robot)))
    bodies = [(part.mesh, part.colour, part_pose(part, 1.0, 0.8, yaw, wheels)) for part in parts]
    assert_alike(bodies, camera, 2)


def test_a_body_that_reaches_behind_the_camera_is_cut_off_there() -> None:
    """A wide cylinder below the camera: what is ahead is drawn, and it hides what stands behind its wall."""
    camera = camera_for("follow", (-1, -0.6), (1, 0.6), 0.3, (240, 180))
    eye = np.linalg.inv(camera.view)[:3, 3]
    wide = cylinder(1.0, 0.0, float(eye[2]) - 0.2)
    bodies = [(wide, MOVER, ((float(eye[0]), float(eye[1]), 0.0), UPRIGHT))]
    assert (camera.view @ [*eye[:2], 0.0, 1.0])[2] < 0 < (camera.view @ [eye[0], eye[1] - 1.0, eye[2] - 0.2, 1.0])[2]
    image, depth, seg = drawn(bodies, camera, (0, 0, 240, 180), 1)
    # Every sample's ray, by hand: does it meet the roof within the rim?
    across, down = 2 / 240 / camera.projection[0, 0], 2 / 180 / camera.projection[1, 1]
    right, up, back = camera.view[:3, :3]
    for row, col in ((20, 30), (90, 120), (170, 200), (179, 120), (179, 0)):
        ray = (col - 120) * across * right + (90 - row - 1) * down * up - back
        if ray[2] >= 0:
            continue
        meets = -0.2 / ray[2] * ray[:2]
        if math.hypot(*meets) < 0.95:
            assert seg[row, col] == 0, (row, col)
            assert depth[row, col] < 1
            assert image[row, col].any()


def test_a_mesh_is_drawn_from_outside_only() -> None:
    camera = camera_for("top", (0, 0), (5, 4), 0.6, (240, 180))
    shape = cylinder(0.5, 0.0, 0.6)
    inside_out = Mesh(shape.vertices, shape.normals, shape.triangles[:, ::-1].copy())
    for mesh, visible in ((shape, True), (inside_out, False)):
        seg = drawn([(mesh, MOVER, ((2.5, 2.0, 0.0), UPRIGHT))], camera, (0, 0, 240, 180), 1)[2]
        roof = seg[80:100, 110:130]
        assert (roof >= 0).all() == visible


def test_boxes_overlap_where_they_share_a_pixel() -> None:
    a, beside, inside = (0, 0, 10, 10), (10, 0, 20, 10), (9, 9, 12, 12)
    assert not overlap(a, beside)
    assert overlap(a, inside)
    assert overlap(inside, beside)
    assert merged([a, beside]) == [a, beside]
    assert merged([a, beside, inside]) == [(0, 0, 20, 12)]
