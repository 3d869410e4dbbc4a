from dataclasses import replace

import numpy as np
import pytest

from antdrive.views.colours import MOVER
from antdrive.views.film import _kernels_paint as kernels
from antdrive.views.film import compositor as composing
from antdrive.views.film.camera import camera_for
from antdrive.views.film.compositor import Compositor, drawn_height
from antdrive.views.film.meshes import cylinder, robot_parts
from antdrive.views.film.solids import Solid, draw_solids, placed
from antdrive.views.scene import Scene

SIZE = (320, 240)


@pytest.fixture(scope="module")
def drive(made_up_drive):
    return made_up_drive()


@pytest.fixture(scope="module")
def scene(drive):
    return Scene.of(drive)


def camera(scene, name="oblique", size=SIZE):
    return camera_for(name, scene.bounds[:2], scene.bounds[2:], drawn_height(scene), size)


def middle(drive):
    return drive.pose[len(drive.pose) // 2]


def around(compositor, x, y, half=10):
    px, py = (round(value) for value in compositor.pixel(x, y, 0.05))
    return np.s_[max(0, py - half) : py + half, max(0, px - half) : px + half]


def changed(one, other):
    return np.abs(one.astype(int) - other.astype(int)).max(axis=-1)


def test_a_crop_is_the_same_part_of_the_whole_picture(scene):
    view, box = camera(scene), (101, 37, 173, 142)
    solids = [Solid(cylinder(r, 0.0, 0.3, x=x, y=y), MOVER, placed(0.0, 0.0))
              for x, y, r, _ in scene.obstacles]  # fmt: skip
    whole, part = (draw_solids(solids, view, one, 2, (0.0, 0.0, 1.0))[0] for one in ((0, 0, *SIZE), box))
    assert (whole[2 * box[1] : 2 * box[3], 2 * box[0] : 2 * box[2]] == part).all()


@pytest.mark.parametrize(("fine", "radii"), [(1, ()), (2, ()), (1, (0.15, 0.3))])
def test_a_frame_equals_a_render_of_everything_at_once(drive, scene, monkeypatch, fine, radii):
    for name in ("HIDDEN_OPACITY", "SHINES"):
        monkeypatch.setattr(composing, name, 0.0)
    for name in ("_draw_robot_shadow", "_draw_shadow"):
        monkeypatch.setattr(Compositor, name, lambda *_: None)
    moving = replace(scene, mover_radii=radii)
    view = camera(moving)
    for at in (0.3, 0.5, 0.8):
        x, y, yaw = drive.pose[int(at * len(drive.pose))]
        places = np.array([(x + 0.2, y - 0.3), (3.4, 0.4)])[: len(radii)].reshape(-1, 2)
        compositor = Compositor(moving, view, route=drive.route, fine=fine)
        got = compositor.frame((x, y, yaw), places)
        moved = [Solid(part.mesh, part.colour, placed(x, y, yaw)) for part in robot_parts(moving.robot)]
        moved += [Solid(cylinder(radius, 0.0, drawn_height(moving)), MOVER, placed(mx, my))
                  for (mx, my), radius in zip(places, radii, strict=True)]  # fmt: skip
        shown = draw_solids(moved, view, (0, 0, *SIZE), fine, compositor._light)[2] >= 0
        everything = [*compositor._solids, *moved]
        expected = compositor._ground.paint(view)
        image, _, seg = draw_solids(everything, view, (0, 0, *SIZE), fine, compositor._light)
        kernels.put_on_floor(expected, np.empty(SIZE[::-1], dtype=np.float32), image, seg, fine)
        assert shown.sum() > 100 * fine**2
        # Finer than a pixel, only pixels in which robot, cylinder and ground meet may differ a little.
        assert (changed(got, expected) > 1).mean() <= (0.0002 if fine == 1 else 0.0015)


def test_robot_trail_obstacles_route_goal_and_zones_are_in_the_picture(drive, scene):
    view = camera(scene)
    x, y, _ = pose = middle(drive)
    compositor = Compositor(scene, view, route=drive.route)
    before = compositor.backdrop.pixels.copy()
    with_robot = compositor.frame(pose)
    half = len(drive.pose) // 2
    compositor.extend_trail(drive.pose[: half + 1 : 10, :2], np.tile((0.0, 90.0, 160.0), (half // 10, 1)))
    with_trail = compositor.frame(pose)
    behind = around(compositor, *drive.pose[half // 2, :2], half=4)
    there = around(compositor, x, y)
    goal = around(compositor, *scene.goal, half=6)
    disc = around(compositor, *scene.obstacles[0, :2], half=4)
    route = around(compositor, *drive.pose[3 * len(drive.pose) // 4, :2], half=8)
    assert (changed(with_robot, before)[there] > 40).mean() > 0.3, "robot"
    assert (changed(with_trail, with_robot)[behind] > 40).mean() > 0.2, "trail"
    without = replace(scene, obstacles=scene.obstacles[1:], unseen=scene.unseen[1:])
    compositor = Compositor(without, view, route=drive.route[:1])
    bare = compositor.backdrop.pixels
    assert (changed(bare, before)[disc] > 40).mean() > 0.7, "obstacle"
    assert (changed(bare, before)[route] > 40).any(), "route"
    elsewhere = replace(scene, goal=(0.5, 0.4), inflate=0.0)
    compositor = Compositor(elsewhere, view, route=drive.route)
    moved = compositor.backdrop.pixels
    assert (changed(moved, before)[goal] > 20).mean() > 0.3, "goal"
    assert (changed(moved, before) > 5).mean() > 0.1, "inflated zones"


def test_obstacles_placed_after_planning_have_their_own_colour(drive, scene):
    marked = replace(scene, unseen=np.arange(len(scene.obstacles)) == 0)
    compositor = Compositor(marked, camera(scene), route=drive.route)
    at = around(compositor, *scene.obstacles[0, :2], half=3)
    red, green, blue = compositor.backdrop.pixels[at].reshape(-1, 3).mean(axis=0)
    assert red > blue > green


def test_a_robot_shines_through_whatever_covers_it(scene):
    posts = np.array([(2.0, 1.0, 0.45, 2.0)])
    wall = replace(scene, obstacles=posts, unseen=np.zeros(1, dtype=bool), inflate=0.0, mover_radii=(0.3,))
    compositor = Compositor(wall, camera(wall), route=np.empty((0, 2)))
    away, still = np.array([(9.0, 9.0)]), compositor.backdrop.pixels
    covered = changed(compositor.frame((2.0, 1.56, 0.0), away), still)[compositor.backdrop.visible == 0]
    assert (covered > 40).sum() > 100
    px, py = (round(value) for value in compositor.pixel(3.0, 1.42, 0.1))
    alone, before = (compositor.frame((3.0, 1.5, 0.0), at)[py, px].astype(int) for at in (away, [(3.0, 1.05)]))
    assert 20 < np.abs(before - alone).max() < 120
    assert np.abs(before - MOVER).max() > 20


def test_a_line_across_a_gap_lies_over_all_bodies(scene):
    compositor = Compositor(scene, camera(scene), route=np.empty((0, 2)))
    x, y = scene.obstacles[0, :2].tolist()
    actor = composing.Actor(scene.robot, robot_parts(scene.robot), (0.5, 1.5, 0.0))
    plain, lined = compositor.frame_of([actor]), compositor.frame_of([actor], gap=((x - 0.3, y), (x + 0.3, y)))
    rows, cols = np.nonzero(changed(lined, plain) > 60)
    assert np.ptp(cols) > 3 * np.ptp(rows)
    assert len(rows) > 20


def test_headings_are_visible(drive, scene):
    x, y, _ = middle(drive)
    compositor = Compositor(scene, camera(scene), route=drive.route)
    still, away = (compositor.frame((x, y, yaw)) for yaw in (0.0, np.pi))
    assert (changed(still, away)[around(compositor, x, y)] > 60).sum() >= 5


def test_movers_are_drawn_in_their_colour(drive, scene):
    moving = replace(scene, mover_radii=(0.15, 0.15))
    x, y, _ = pose = middle(drive)
    places = np.array([(x + 0.05, y - 0.4), (3.5, 0.3)])
    compositor = Compositor(moving, camera(scene), route=drive.route)
    frame = compositor.frame(pose, places)
    for mx, my in places:
        px, py = (round(value) for value in compositor.pixel(mx, my, drawn_height(moving)))
        red, green, blue = (int(channel) for channel in frame[py, px])
        assert min(red, blue) > green + 30, "violet"


def test_a_trail_painted_at_once_equals_one_painted_step_by_step(drive, scene):
    points = drive.pose[::10, :2]
    tints = np.linspace((20.0, 40.0, 90.0), (200.0, 90.0, 0.0), len(points) - 1)
    compositor = Compositor(scene, camera(scene), route=drive.route)
    compositor.extend_trail(points, tints)
    at_once = compositor.frame(middle(drive))
    compositor = Compositor(scene, camera(scene), route=drive.route)
    for k in range(len(points) - 1):
        compositor.extend_trail(points[k : k + 2], tints[k : k + 1])
    assert (compositor.frame(middle(drive)) == at_once).all()


def test_a_movers_motion_ahead_is_drawn_on_the_ground(drive, scene):
    moving = replace(scene, mover_radii=(0.15,), obstacles=np.empty((0, 4)), unseen=np.zeros(0, dtype=bool))
    places, velocities = np.array([(3.0, 0.6)]), np.array([(-1.0, 0.0)])
    pose = (0.5, 2.5, 0.0)
    compositor = Compositor(moving, camera(moving, size=(640, 480)), route=np.empty((0, 2)))
    without = compositor.frame(pose, places)
    still = compositor.frame(pose, places, 0 * velocities)
    forecast = compositor.frame(pose, places, velocities)
    ahead, end = (around(compositor, x, 0.6, half=5) for x in (2.3, 1.5))
    beyond, behind = (around(compositor, x, 0.6, half=5) for x in (1.2, 3.4))
    assert (still == without).all()
    difference = changed(forecast, without)
    assert difference[ahead].max() > 30
    assert difference[end].max() > 60
    assert difference[beyond].max() == difference[behind].max() == 0
