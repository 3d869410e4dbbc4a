"""Cameras: framing, projection, and bodies out of sight."""

import numpy as np
import pytest

from antdrive.views.film.camera import CAMERAS, Camera, camera_for
from antdrive.views.film.compositor import drawn_height
from antdrive.views.scene import Scene

SIZE = (320, 240)


@pytest.fixture(scope="module")
def scene(made_up_drive):
    return Scene.of(made_up_drive())


def camera(scene, name="oblique", size=SIZE) -> Camera:
    return camera_for(name, scene.bounds[:2], scene.bounds[2:], drawn_height(scene), size)


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


def test_bodies_that_reach_behind_the_camera_are_left_out(scene):
    view = camera(scene)
    eye = -view.view[:3, :3].T @ view.view[:3, 3]
    centres = np.array([(2.0, 1.5, 0.0), eye, (2.0, -40.0, 0.0), (60.0, 1.5, 0.0)])
    assert view.sees(centres, np.full(4, 0.3)).tolist() == [True, False, False, False]
    everything = np.array([(x, y, 0.0) for x in (0, 4) for y in (0, 3)])
    assert view.sees(everything, np.full(4, 0.1)).all()
