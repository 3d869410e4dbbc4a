"""Ray casting against closed forms: where cylinders and boxes appear, at which depth, and which bodies hide others."""

import math

import numpy as np
import pytest

from antdrive.views.film.camera import camera_for
from antdrive.views.film.raycast import Solids

SIZE, LIGHT = (320, 240), (0.0, 0.0, 1.0)
RED, GREY = (200, 10, 10), (100, 100, 100)
CAMERA = camera_for("follow", (0, 0), (4, 3), 0.5, SIZE)
NO_BOXES = np.empty((0, 6))


def solids(*cylinders, boxes=NO_BOXES):
    return Solids.of(np.array(cylinders, dtype=float).reshape(-1, 4), [RED] * len(cylinders), np.array(boxes), GREY)


def at(point):
    x, y = CAMERA.pixels([point])[0]
    return int(y), int(x)


def depth_of(point):
    clip = CAMERA.full @ [*point, 1.0]
    return (1 + clip[2] / clip[3]) / 2


@pytest.mark.parametrize("point", [(2.0, 1.5, 0.4), (2.2, 1.6, 0.4), (2.0, 1.1, 0.2), (2.0, 1.1, 0.05)])
def test_a_cylinder_appears_at_the_place_and_depth_of_its_surface(point):
    _, depth, seg = solids((2.0, 1.5, 0.4, 0.4)).render(CAMERA, 1, LIGHT)
    assert seg[at(point)] == 0
    assert depth[at(point)] == pytest.approx(depth_of(point), abs=2e-3)


def test_a_cylinders_outline_is_that_of_its_rims():
    _, _, seg = solids((2.0, 1.5, 0.4, 0.4)).render(CAMERA, 1, LIGHT)
    turn = np.linspace(0, 2 * math.pi, 720)
    rims = [(2 + 0.4 * math.cos(a), 1.5 + 0.4 * math.sin(a), z) for a in turn for z in (0.0, 0.4)]
    low, high = CAMERA.pixels(rims).min(axis=0), CAMERA.pixels(rims).max(axis=0)
    rows, cols = np.nonzero(seg == 0)
    assert np.abs(np.array([cols.min(), rows.min()]) - low).max() <= 1
    assert np.abs(np.array([cols.max() + 1, rows.max() + 1]) - high).max() <= 1


def test_near_bodies_hide_far_ones_in_any_order():
    near, far = (2.0, 1.0, 0.3, 0.5), (2.0, 1.6, 0.3, 0.2)
    one, other = solids(near, far).render(CAMERA, 2, LIGHT), solids(far, near).render(CAMERA, 2, LIGHT)
    assert (one[1] == other[1]).all()
    assert (other[2] == np.array([1, 0, -1])[one[2]]).all()
    assert 0 < (one[2] == 1).sum() < (solids(far).render(CAMERA, 2, LIGHT)[2] == 0).sum()


def test_light_from_above_makes_roofs_brighter_than_sides():
    image, _, _ = solids((2.0, 1.5, 0.4, 0.4)).render(CAMERA, 1, LIGHT)
    roof, side = (int(image[at(point)][0]) for point in ((2.0, 1.5, 0.4), (2.0, 1.1, 0.2)))
    assert roof == pytest.approx(200 * 1.08, abs=1)
    assert side == pytest.approx(200 * 0.62, abs=1)


def test_a_box_appears_at_the_place_and_depth_of_its_faces():
    box = [(1.0, 1.0, 0.0, 3.0, 2.0, 0.3)]
    _, depth, seg = solids(boxes=box).render(CAMERA, 1, LIGHT)
    for point in ((2.0, 1.5, 0.3), (2.0, 1.0, 0.15)):
        assert seg[at(point)] == 0
        assert depth[at(point)] == pytest.approx(depth_of(point), abs=2e-3)
    assert seg[at((2.0, 0.8, 0.0))] == -1


def test_bodies_out_of_sight_or_behind_the_camera_are_not_drawn():
    _, _, seg = solids((2.0, -60.0, 0.4, 0.4), (80.0, 1.5, 0.4, 0.4)).render(CAMERA, 1, LIGHT)
    assert (seg == -1).all()
