from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from antdrive.views.colours import MOVER
from antdrive.views.film.camera import camera_for
from antdrive.views.film.compositor import Actor, Compositor, DrivenPath, drawn_height
from antdrive.views.film.meshes import robot_parts
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


def test_a_frame_equals_a_picture_of_everything_at_once(drive, scene):
    """The bodies of a camera that stays are painted once, and again around robot and movers."""
    moving = replace(scene, mover_radii=(0.15, 0.3))
    compositor = Compositor(moving, camera(moving), route=drive.route)
    for at in (0.3, 0.5, 0.8):
        x, y, yaw = drive.pose[int(at * len(drive.pose))]
        places = np.array([(x + 0.2, y - 0.3), (3.4, 0.4)])
        once = Compositor(moving, camera(moving), route=drive.route)
        once.set_camera(camera(moving), moves=True)
        assert (changed(compositor.frame((x, y, yaw), places), once.frame((x, y, yaw), places)) > 6).mean() < 0.001


def empty(compositor):
    """Return the picture without robots."""
    return compositor.frame_of([])


def test_robot_trail_obstacles_route_goal_and_zones_are_in_the_picture(drive, scene):
    view = camera(scene)
    x, y, _ = pose = middle(drive)
    compositor = Compositor(scene, view, route=drive.route)
    before, with_robot = empty(compositor), compositor.frame(pose)
    half = len(drive.pose) // 2
    with_trail = compositor.frame_of([], trails=[DrivenPath([(drive.pose[: half + 1 : 10, :2], (0, 90, 160))])])
    behind = around(compositor, *drive.pose[half // 2, :2], half=4)
    there = around(compositor, x, y)
    goal = around(compositor, *scene.goal, half=6)
    disc = around(compositor, *scene.obstacles[0, :2], half=4)
    route = around(compositor, *drive.pose[3 * len(drive.pose) // 4, :2], half=8)
    assert (changed(with_robot, before)[there] > 40).mean() > 0.3, "robot"
    assert (changed(with_trail, before)[behind] > 40).mean() > 0.2, "trail"
    without = replace(scene, obstacles=scene.obstacles[1:], unseen=scene.unseen[1:])
    bare = empty(Compositor(without, view))
    assert (changed(bare, before)[disc] > 40).mean() > 0.7, "obstacle"
    assert (changed(bare, before)[route] > 40).any(), "route"
    moved = empty(Compositor(replace(scene, goal=(0.5, 0.4), inflate=0.0), view, route=drive.route))
    assert (changed(moved, before)[goal] > 20).mean() > 0.3, "goal"
    assert (changed(moved, before) > 5).mean() > 0.1, "inflated zones"


def test_obstacles_placed_after_planning_have_their_own_colour(drive, scene):
    marked = replace(scene, unseen=np.arange(len(scene.obstacles)) == 0)
    compositor = Compositor(marked, camera(scene), route=drive.route)
    at = around(compositor, *scene.obstacles[0, :2], half=3)
    red, green, blue = empty(compositor)[at].reshape(-1, 3).mean(axis=0)
    assert red > blue > green


def test_a_robot_shines_through_whatever_covers_it(scene):
    posts = np.array([(2.0, 1.0, 0.45, 2.0)])
    wall = replace(scene, obstacles=posts, unseen=np.zeros(1, dtype=bool), inflate=0.0, mover_radii=(0.3,))
    compositor = Compositor(wall, camera(wall))
    away = np.array([(9.0, 9.0)])
    still = compositor.frame_of([], away)
    px, py = (round(value) for value in compositor.pixel(2.0, 1.56, 0.1))
    behind = compositor.frame((2.0, 1.56, 0.0), away).astype(int)[py, px] - still[py, px]
    assert behind[0] > 20  # orange through slate
    assert behind[2] < -15
    px, py = (round(value) for value in compositor.pixel(3.0, 1.42, 0.1))
    alone, before = (compositor.frame((3.0, 1.5, 0.0), at)[py, px].astype(int) for at in (away, [(3.0, 1.05)]))
    assert 20 < np.abs(before - alone).max() < 120
    assert np.abs(before - MOVER).max() > 20


def test_a_line_across_a_gap_lies_over_all_bodies(scene):
    compositor = Compositor(scene, camera(scene))
    x, y = scene.obstacles[0, :2].tolist()
    actor = Actor(scene.robot, robot_parts(scene.robot), (0.5, 1.5, 0.0))
    plain, lined = compositor.frame_of([actor]), compositor.frame_of([actor], gap=((x - 0.3, y), (x + 0.3, y)))
    rows, cols = np.nonzero(changed(lined, plain) > 60)
    assert np.ptp(cols) > 3 * np.ptp(rows)
    assert len(rows) > 20


def test_a_cylinder_inside_another_is_not_in_the_picture(scene):
    outer = np.array([(2.0, 1.0, 0.5, 2.0)])
    alone, nested = (
        empty(Compositor(replace(scene, obstacles=posts, unseen=np.zeros(len(posts), dtype=bool)), camera(scene)))
        for posts in (outer, np.vstack([outer, [(2.1, 0.8, 0.2, 2.0)]]))
    )
    px, py = (round(value) for value in Compositor(scene, camera(scene)).pixel(2.0, 0.6, 0.2))
    assert (alone[py - 15 : py + 15, px - 15 : px + 15] == nested[py - 15 : py + 15, px - 15 : px + 15]).all()


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


def test_a_field_is_drawn_without_the_movers(drive, scene):
    moving = replace(scene, mover_radii=(0.15, 0.15))
    still, grid, levels = (
        Compositor(scene, camera(scene)),
        SimpleNamespace(origin=(0.0, 0.0), cell=0.5),
        np.full((4, 6), 0.5),
    )
    picture = Compositor(moving, camera(scene)).field_frame(grid, levels, [])
    assert np.array_equal(picture, still.field_frame(grid, levels, []))


def test_a_movers_motion_ahead_is_drawn_on_the_ground(drive, scene):
    moving = replace(scene, mover_radii=(0.15,), obstacles=np.empty((0, 4)), unseen=np.zeros(0, dtype=bool))
    places, velocities = np.array([(3.0, 0.6)]), np.array([(-1.0, 0.0)])
    compositor = Compositor(moving, camera(moving, size=(640, 480)))
    without = compositor.frame_of([], places)
    still = compositor.frame_of([], places, velocities=0 * velocities)
    forecast = compositor.frame_of([], places, velocities=velocities)
    ahead, end = (around(compositor, x, 0.6, half=5) for x in (2.3, 1.5))
    beyond, behind = (around(compositor, x, 0.6, half=5) for x in (1.2, 3.4))
    assert (still == without).all()
    difference = changed(forecast, without)
    assert difference[ahead].max() > 30
    assert difference[end].max() > 60
    assert difference[beyond].max() == difference[behind].max() == 0
