"""Cameras, shapes on the ground and bodies against closed forms."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from antdrive.views.colours import BAD, GOOD, HIT, MOVER, WHITE
from antdrive.views.film.camera import CAMERAS, camera_for
from antdrive.views.film.compositor import _post as post
from antdrive.views.film.ground import band, discs, rectangle
from antdrive.views.film.meshes import Mesh, Part, cylinder
from antdrive.views.film.painter import Painter
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


def drawn(bodies, view):
    """Return the picture (H, W, 3) of bodies on black."""
    painter = Painter(view, 0.6)
    painter.pixels[:] = 0, 0, 0, 255
    painter.draw_bodies(bodies)
    return painter.pixels[..., :3].astype(int)


def test_a_disc_on_the_ground_is_where_the_camera_projects_it(scene):
    view = camera(scene)
    painter = Painter(view, 0.3)
    painter.pixels[:] = 0, 0, 0, 255
    painter.fill(discs(np.array([(1.5, 1.2)]), 0.4), WHITE)
    rows, cols = np.mgrid[: SIZE[1], : SIZE[0]] + 0.5
    back = np.stack([cols, rows, np.ones_like(rows)], axis=-1) @ np.linalg.inv(view.ground).T
    away = np.hypot(back[..., 0] / back[..., 2] - 1.5, back[..., 1] / back[..., 2] - 1.2)
    inside = painter.pixels[..., 0] > 127
    assert (inside == (away < 0.4))[np.abs(away - 0.4) > view.pixel].all()
    assert inside.sum() > 1000


def test_a_path_without_points_is_not_drawn(scene):
    painter = Painter(camera(scene), 0.3)
    before = painter.pixels.copy()
    for line in (np.empty((0, 2)), np.array([(1.0, 1.0)])):
        painter.fill(band(line, 0.1), WHITE)
    assert (painter.pixels == before).all()


def test_the_union_of_shapes_is_filled_once(scene):
    painter = Painter(camera(scene), 0.3)
    painter.pixels[:] = 0, 0, 0, 255
    painter.fill(discs(np.array([(1.5, 1.2), (1.7, 1.2)]), 0.4), WHITE, 0.5)
    assert set(np.unique(painter.pixels[..., 0])) & set(range(129, 256)) == set()


def test_a_search_without_a_path_yet_draws_none(scene):
    painter = Painter(camera(scene), 0.3)
    before = painter.pixels.copy()
    painter.fill(band(np.zeros((0, 2)), 0.1), WHITE)
    assert (painter.pixels == before).all()


@pytest.mark.parametrize("name", CAMERAS)
def test_shapes_behind_the_camera_are_not_drawn(scene, name):
    painter = Painter(camera_for(name, (-1, -0.6), (1, 0.6), 0.3, SIZE), 0.3)
    before = painter.pixels.copy()
    painter.fill([rectangle(-9, -90, 9, -60)], WHITE)
    assert (painter.pixels == before).all()
    painter.fill([rectangle(-90, -90, 90, 90)], WHITE)
    assert (painter.pixels == 255).all()


def test_a_grid_is_laid_on_its_cells(scene):
    view = camera(scene, "top")
    painter = Painter(view, 0.3)
    painter.pixels[:] = 0, 0, 0, 255
    opacity = np.zeros((3, 4), dtype=np.uint8)
    opacity[1, 2] = 255
    painter.lay(WHITE, opacity, np.array([(1.0, 0, 0), (0, 1.0, 0), (0, 0, 1.0)]))
    centre, beside = (view.pixels([(x, y, 0)])[0].astype(int) for x, y in ((2.5, 1.5), (1.5, 1.5)))
    assert painter.pixels[centre[1], centre[0], 0] == 255
    assert painter.pixels[beside[1], beside[0], 0] == 0


def test_near_bodies_hide_far_ones_in_any_order():
    view = camera_for("follow", (0, 0), (4, 3), 0.5, SIZE)
    near, far = post(2.0, 1.0, 0.3, 0.5, GOOD), post(2.0, 1.6, 0.3, 0.2, BAD)
    one, other, alone = drawn([near, far], view), drawn([far, near], view), drawn([far], view)
    assert (one == other).all()
    red, hidden = ((picture[..., 0] > picture[..., 1]).sum() for picture in (alone, one))
    assert 0 < hidden < red


@settings(max_examples=20)
@given(st.lists(st.tuples(st.floats(0.5, 4.5), st.floats(0.5, 3.5), st.floats(0.1, 0.6)), min_size=2, max_size=5))
def test_the_nearest_body_on_a_ray_is_the_one_in_the_picture(places):
    """Disjoint cylinders, against the first of them that the ray through a pixel meets at the height of the ground."""
    places = [p for k, p in enumerate(places)
              if all(np.hypot(p[0] - q[0], p[1] - q[1]) > p[2] + q[2] for q in places[:k])]  # fmt: skip
    view = camera_for("oblique", (0, 0), (5, 4), 0.6, SIZE)
    tints = [(40 + 40 * k, 0, 200 - 40 * k) for k in range(len(places))]
    picture = drawn([post(*place, 0.6, tint) for place, tint in zip(places, tints, strict=True)], view)
    for x, y, radius in places:
        side = np.array([x, y]) - view.eye[:2]
        foot = np.array([x, y]) - radius * side / np.hypot(*side)  # of the front
        col, row = (view.pixels([(*foot, 0.1)])[0]).astype(int)
        reach = np.linspace(0.0, 1.0, 400)[:, None]
        ray = view.eye + reach * (np.array([*foot, 0.1]) - view.eye)
        met = [
            (
                reach[((np.hypot(*(ray[:, :2] - place[:2]).T) <= place[2] + 1e-6) & (ray[:, 2] <= 0.6))].min(
                    initial=2.0
                ),
                k,
            )
            for k, place in enumerate(places)
        ]
        first = min(met)[1]
        ratio = np.array(tints[first])[[0, 2]] / max(tints[first])
        seen = picture[row, col][[0, 2]] / max(1, picture[row, col].max())
        gaps = sorted(hit for hit, _ in met if hit < 2)
        if len(gaps) < 2 or gaps[1] - gaps[0] > 0.02:
            assert np.abs(seen - ratio).max() < 0.15


def test_a_mesh_is_drawn_from_outside_only():
    view = camera_for("top", (0, 0), (5, 4), 0.6, SIZE)
    shape = cylinder(1.0, 0.0, 1.0)
    body = post(2.5, 2.0, 0.5, 0.6, MOVER)
    inside_out = Part(Mesh(shape.vertices, shape.normals, shape.triangles[:, ::-1].copy()), MOVER)
    assert drawn([body], view).any()
    assert not drawn([body._replace(parts=[inside_out])], view)[115:125, 155:165].any()


def test_a_hit_is_hidden_by_a_body_before_it(scene):
    view = camera_for("follow", (0, 0), (4, 3), 0.5, SIZE)
    hits = np.array([(2.0, 0.65, 0.2), (2.0, 1.35, 0.2)])  # before and behind
    painter = Painter(view, 0.6)
    painter.draw_bodies([post(2.0, 1.0, 0.3, 0.5, MOVER)], hits=hits)
    near, far = (painter.pixels[row, col, :3].astype(int) for col, row in view.pixels(hits).astype(int))
    assert np.abs(near - HIT).max() < 0.5 * np.abs(far - HIT).max()
