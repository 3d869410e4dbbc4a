"""Cameras and meshes against closed forms and PyBullet's TinyRenderer."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from antdrive.robots import load_robot
from antdrive.sim.physics.bullet import bullet, client
from antdrive.views.colours import MOVER
from antdrive.views.film.camera import CAMERAS, camera_for
from antdrive.views.film.meshes import Mesh, cylinder, robot_parts
from antdrive.views.film.solids import AMBIENT, DIFFUSE, Solid, draw_solids, merged, overlap, placed
from antdrive.views.scene import Scene
from tests.views.film.test_compositor import camera

SIZE = (320, 240)


@pytest.fixture(scope="module")
def scene(made_up_drive):
    return Scene.of(made_up_drive())


@pytest.mark.parametrize("name", CAMERAS)
@pytest.mark.parametrize(("low", "high"), [((0, 0), (4, 3)), ((-2, 5), (18, 9)), ((0, 0), (2, 9))])
def test_a_camera_frames_all_corners_tightly(name, low, high):
    view = camera_for(name, low, high, 0.4, SIZE)
    corners = [(x, y, z) for x in (low[0], high[0]) for y in (low[1], high[1]) for z in (0, 0.4)]
    at = view.pixels(corners)
    assert (at >= 0).all()
    assert (at <= SIZE).all()
    filled = (at.max(axis=0) - at.min(axis=0)) / SIZE
    assert filled.max() > 0.85


def test_a_world_long_in_y_is_turned_to_fill_a_wide_picture():
    tall = camera_for("top", (0, 0), (2, 9), 0.3, SIZE).pixels([(1, 0, 0), (1, 9, 0)])
    assert abs(tall[1, 0] - tall[0, 0]) > abs(tall[1, 1] - tall[0, 1])


def test_the_ground_map_agrees_with_the_projection(scene):
    view = camera(scene)
    points = np.array([(0.3, 0.4), (2.0, 1.0), (3.9, 2.8)])
    mapped = np.column_stack([points, np.ones(3)]) @ view.ground.T
    assert np.allclose(mapped[:, :2] / mapped[:, 2:], view.pixels(np.column_stack([points, np.zeros(3)])))


def test_a_moved_camera_keeps_its_scale(scene):
    view = camera(scene, "follow")
    assert view.moved(50.0, -80.0).pixel == pytest.approx(view.pixel)
    at = view.pixels([(0, 0, 0)]) - view.moved(3.0, 4.0).pixels([(3.0, 4.0, 0)])
    assert np.abs(at).max() < 1e-9


def test_bodies_behind_the_camera_are_omitted(scene):
    view = camera(scene)
    eye = -view.view[:3, :3].T @ view.view[:3, 3]
    centres = np.array([(2.0, 1.5, 0.0), eye, (2.0, -40.0, 0.0), (60.0, 1.5, 0.0)])
    assert view.sees(centres, np.full(4, 0.3)).tolist() == [True, False, False, False]
    everything = np.array([(x, y, 0.0) for x in (0, 4) for y in (0, 3)])
    assert view.sees(everything, np.full(4, 0.1)).all()


SUN = (-0.62, -0.25, 0.74)


def add_mesh(number, mesh, colour):
    """Add a visible mesh to PyBullet client `number` and return its body number."""
    p = bullet()
    lists = {
        "vertices": mesh.vertices.tolist(),
        "normals": mesh.normals.tolist(),
        "indices": mesh.triangles.ravel().tolist(),
    }
    tint = [*(channel / 255 for channel in colour), 1.0]
    shape = p.createVisualShape(p.GEOM_MESH, rgbaColor=tint, physicsClientId=number, **lists)
    return p.createMultiBody(0, -1, shape, physicsClientId=number)


def rendered(bodies, camera, box, fine):
    """Render with PyBullet's TinyRenderer: picture (h, w, 3), depth (h, w) and body indices (h, w), -1 for none."""
    p, (x0, y0, x1, y1), (wide, high) = bullet(), box, camera.size
    across, down = (x0 + x1) / wide - 1, 1 - (y0 + y1) / high
    projection = camera.projection.copy()
    projection[0] = wide / (x1 - x0) * (camera.projection[0] - across * camera.projection[3])
    projection[1] = high / (y1 - y0) * (camera.projection[1] - down * camera.projection[3])
    width, height = (x1 - x0) * fine, (y1 - y0) * fine
    with client() as number:
        for mesh, colour, (x, y, *yaw) in bodies:
            body = add_mesh(number, mesh, colour)
            turn = p.getQuaternionFromEuler((0, 0, *(yaw or [0])))
            p.resetBasePositionAndOrientation(body, (x, y, 0), turn, physicsClientId=number)
        _, _, image, depth, seg = p.getCameraImage(
            width, height, camera.view.T.ravel().tolist(), projection.T.ravel().tolist(), lightDirection=SUN,
            lightColor=[1, 1, 1], lightAmbientCoeff=AMBIENT, lightDiffuseCoeff=DIFFUSE, lightSpecularCoeff=0.0, shadow=0,
            renderer=p.ER_TINY_RENDERER, physicsClientId=number,
        )  # fmt: skip
    return (
        np.reshape(np.asarray(image, dtype=np.uint8), (height, width, 4))[..., :3],
        np.array(depth, dtype=np.float32).reshape(height, width),
        np.reshape(np.asarray(seg, dtype=np.int32), (height, width)),
    )


def drawn(bodies, camera, box, fine):
    return draw_solids([Solid(mesh, colour, placed(*pose)) for mesh, colour, pose in bodies], camera, box, fine, SUN)


def assert_alike(bodies, camera, fine, least=200):
    box = (40, 30, 200, 150)
    image, depth, seg = drawn(bodies, camera, box, fine)
    wanted_image, wanted_depth, wanted_seg = rendered(bodies, camera, box, fine)
    seen = (seg >= 0) & (wanted_seg >= 0)
    assert seen.sum() >= least
    # TinyRenderer computes in single precision, so a sample on an edge may fall on its other side.
    assert ((seg >= 0) != (wanted_seg >= 0)).sum() <= 3
    levels = np.abs(image[seen].astype(int) - wanted_image[seen]).max(axis=1)
    away = np.abs(depth[seen] - wanted_depth[seen])
    assert (levels > 1).sum() <= 3
    assert (away > 1e-5).sum() <= 3


@settings(max_examples=12)
@given(
    st.sampled_from(["oblique", "top"]),
    st.integers(1, 3),
    st.lists(st.tuples(st.floats(1.0, 4.0), st.floats(1.0, 3.0), st.floats(0.1, 0.6)), min_size=1, max_size=4),
)
def test_cylinders_are_drawn_as_tiny_renderer_draws_them(name, fine, places):
    camera = camera_for(name, (0, 0), (5, 4), 0.6, (240, 180))
    # Not at round places: where an edge runs through many samples exactly, rounding decides on all of them.
    bodies = [(cylinder(r, 0.0, 0.6), MOVER, (x + 0.00137, y - 0.00213)) for x, y, r in places]
    assert_alike(bodies, camera, fine, least=0)


@pytest.mark.parametrize("robot", ["turtlebot", "jackal"])
@pytest.mark.parametrize("yaw", [0.0, 2.1, -1.3])
def test_robots_are_drawn_as_tiny_renderer_draws_them(robot, yaw):
    camera = camera_for("oblique", (0, 0), (2, 1.6), 0.6, (240, 180))
    parts = robot_parts(load_robot(robot))
    bodies = [(part.mesh, part.colour, (1.0, 0.8, yaw)) for part in parts]
    assert_alike(bodies, camera, 2)


def test_a_body_that_reaches_behind_the_camera_is_cut_off_there():
    """A wide cylinder below the camera: its front is drawn and hides the bodies behind it."""
    camera = camera_for("follow", (-1, -0.6), (1, 0.6), 0.3, (240, 180))
    eye = np.linalg.inv(camera.view)[:3, 3]
    wide = cylinder(1.0, 0.0, float(eye[2]) - 0.2)
    bodies = [(wide, MOVER, (float(eye[0]), float(eye[1])))]
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


def test_near_bodies_hide_far_ones_in_any_order():
    camera = camera_for("follow", (0, 0), (4, 3), 0.5, (240, 180))
    near, far = ((cylinder(0.3, 0.0, z), MOVER, (2.0, y)) for y, z in ((1.0, 0.5), (1.6, 0.2)))
    one, other, alone = (drawn(bodies, camera, (0, 0, 240, 180), 2) for bodies in ([near, far], [far, near], [far]))
    assert (one[1] == other[1]).all()
    assert (other[2] == np.array([1, 0, -1])[one[2]]).all()
    assert 0 < (one[2] == 1).sum() < (alone[2] == 0).sum()


def test_a_mesh_is_drawn_from_outside_only():
    camera = camera_for("top", (0, 0), (5, 4), 0.6, (240, 180))
    shape = cylinder(0.5, 0.0, 0.6)
    inside_out = Mesh(shape.vertices, shape.normals, shape.triangles[:, ::-1].copy())
    for mesh, visible in ((shape, True), (inside_out, False)):
        seg = drawn([(mesh, MOVER, (2.5, 2.0))], camera, (0, 0, 240, 180), 1)[2]
        roof = seg[80:100, 110:130]
        assert (roof >= 0).all() == visible


def test_boxes_overlap_where_they_share_a_pixel():
    a, beside, inside = (0, 0, 10, 10), (10, 0, 20, 10), (9, 9, 12, 12)
    assert not overlap(a, beside)
    assert overlap(a, inside)
    assert overlap(inside, beside)
    assert merged([a, beside]) == [a, beside]
    assert merged([a, beside, inside]) == [(0, 0, 20, 12)]
