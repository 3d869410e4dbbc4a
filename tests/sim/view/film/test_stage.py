from dataclasses import replace

import numpy as np
import pytest

from antdrive.sim.physics.engine import client
from antdrive.sim.view.film import _kernels_paint as kernels
from antdrive.sim.view.film import stage as staging
from antdrive.sim.view.film.camera import CAMERAS, Camera, camera_for
from antdrive.sim.view.film.model import cylinder, robot_parts
from antdrive.sim.view.film.paint import paint_ground
from antdrive.sim.view.film.stage import Stage, drawn_height, part_pose, still_pieces
from antdrive.sim.view.film.tiny import add_mesh, merged, render
from antdrive.sim.view.scene import Scene
from antdrive.sim.view.style import MOVER

SIZE = (320, 240)


@pytest.fixture(scope="module")
def drive(made_up_drive):
    return made_up_drive()


@pytest.fixture(scope="module")
def scene(drive):
    return Scene.of(drive)


def camera(scene, name="oblique", size=SIZE) -> Camera:
    return camera_for(name, scene.bounds[:2], scene.bounds[2:], drawn_height(scene), size)


def middle(drive):
    return drive.pose[len(drive.pose) // 2]


def around(stage, x, y, half=10):
    px, py = (round(value) for value in stage.pixel(x, y, 0.05))
    return np.s_[max(0, py - half) : py + half, max(0, px - half) : px + half]


def changed(one, other):
    return np.abs(one.astype(int) - other.astype(int)).max(axis=-1)


@pytest.mark.parametrize("name", CAMERAS)
@pytest.mark.parametrize(("low", "high"), [((0, 0), (4, 3)), ((-2, 5), (18, 9)), ((0, 0), (2, 9))])
def test_a_camera_sees_all_it_should_and_no_more_than_it_must(name, low, high):
    view = camera_for(name, low, high, 0.4, SIZE)
    corners = [(x, y, z) for x in (low[0], high[0]) for y in (low[1], high[1]) for z in (0, 0.4)]
    at = view.pixels(corners)
    assert (at >= 0).all()
    assert (at <= SIZE).all()
    filled = (at.max(axis=0) - at.min(axis=0)) / SIZE
    assert filled.max() > 0.85


def test_what_runs_along_y_is_turned_across_a_wide_picture():
    tall = camera_for("top", (0, 0), (2, 9), 0.3, SIZE).pixels([(1, 0, 0), (1, 9, 0)])
    assert abs(tall[1, 0] - tall[0, 0]) > abs(tall[1, 1] - tall[0, 1])


def test_the_ground_map_agrees_with_the_projection(scene):
    view = camera(scene)
    points = np.array([(0.3, 0.4), (2.0, 1.0), (3.9, 2.8)])
    mapped = np.column_stack([points, np.ones(3)]) @ view.ground.T
    assert np.allclose(mapped[:, :2] / mapped[:, 2:], view.pixels(np.column_stack([points, np.zeros(3)])))


def test_lines_keep_their_width_wherever_a_camera_moves(scene):
    view = camera(scene, "follow")
    assert view.moved(50.0, -80.0).pixel == pytest.approx(view.pixel)
    at = view.pixels([(0, 0, 0)]) - view.moved(3.0, 4.0).pixels([(3.0, 4.0, 0)])
    assert np.abs(at).max() < 1e-9


def test_what_reaches_behind_the_camera_is_left_out(scene):
    view = camera(scene)
    eye = -view.view[:3, :3].T @ view.view[:3, 3]
    centres = np.array([(2.0, 1.5, 0.0), eye, (2.0, -40.0, 0.0), (60.0, 1.5, 0.0)])
    assert view.sees(centres, np.full(4, 0.3)).tolist() == [True, False, False, False]
    everything = np.array([(x, y, 0.0) for x in (0, 4) for y in (0, 3)])
    assert view.sees(everything, np.full(4, 0.1)).all()


def test_a_crop_is_the_same_part_of_the_whole_picture(scene):
    view = camera(scene)
    box = (101, 37, 173, 142)
    with client() as number:
        for mesh, colour in still_pieces(scene, np.full(len(scene.obstacles), 0.3)):
            add_mesh(number, mesh, colour)
        whole, _, _ = render(number, view, None, 2, (0.0, 0.0, 1.0))
        part, _, _ = render(number, view, box, 2, (0.0, 0.0, 1.0))
    difference = changed(whole[2 * box[1] : 2 * box[3], 2 * box[0] : 2 * box[2]], part)
    assert (difference > 2).mean() < 0.01


@pytest.mark.parametrize("fine", [1, 2])
def test_a_frame_equals_a_render_of_everything_at_once(drive, scene, monkeypatch, fine):
    monkeypatch.setattr(staging, "GHOST", 0.0)
    monkeypatch.setattr(Stage, "_shade", lambda *_: None)
    view = camera(scene)
    for at in (0.3, 0.5, 0.8):
        x, y, yaw = drive.pose[int(at * len(drive.pose))]
        with Stage(scene, view, route=drive.route, fine=fine) as stage, client() as number:
            got = stage.frame((x, y, yaw), (0.4, 0.7))
            for mesh, colour in still_pieces(scene, stage.tall):
                add_mesh(number, mesh, colour)
            robot = set()
            for part in robot_parts(scene.robot):
                body = add_mesh(number, part.mesh, part.colour)
                robot.add(body)
                place, turn = part_pose(part, x, y, yaw, (0.4, 0.7))
                staging.bullet().resetBasePositionAndOrientation(body, place, turn, physicsClientId=number)
            image, _, seg = render(number, view, None, fine, stage._light)
            visible = np.empty(SIZE[::-1], dtype=np.float32)
            ground = np.empty(SIZE[::-1], dtype=np.bool_)
            kernels.count_ground(seg, fine, visible, ground)
            rgb = paint_ground(view, scene, drive.route, np.ones_like(ground), stage.tall, stage._sun)
            expected = np.empty_like(got)
            kernels.resolve(rgb, image, seg, fine, visible, expected)
        assert np.isin(seg, list(robot)).sum() > 100 * fine**2
        difference = changed(got, expected)
        # Finer than a pixel, only pixels in which robot, cylinder and ground meet may differ a little.
        assert (difference > 1).mean() <= (0.0002 if fine == 1 else 0.0015)


def test_everything_that_belongs_in_the_picture_is_there(drive, scene):
    view = camera(scene)
    x, y, _ = pose = middle(drive)
    with Stage(scene, view, route=drive.route) as stage:
        before = stage.backdrop.pixels.copy()
        with_robot = stage.frame(pose)
        half = len(drive.pose) // 2
        stage.drive(drive.pose[: half + 1 : 10, :2], drive.twist[: half + 1 : 10, 0])
        with_trail = stage.frame(pose)
        behind = around(stage, *drive.pose[half // 2, :2], half=4)
        there = around(stage, x, y)
        goal = around(stage, *scene.goal, half=6)
        disc = around(stage, *scene.obstacles[0, :2], half=4)
        route = around(stage, *drive.pose[3 * len(drive.pose) // 4, :2], half=8)
    assert (changed(with_robot, before)[there] > 40).mean() > 0.3, "robot"
    assert (changed(with_trail, with_robot)[behind] > 40).mean() > 0.2, "trail"
    without = replace(scene, obstacles=scene.obstacles[1:], unseen=scene.unseen[1:])
    with Stage(without, view, route=drive.route[:1]) as stage:
        bare = stage.backdrop.pixels
    assert (changed(bare, before)[disc] > 40).mean() > 0.7, "obstacle"
    assert (changed(bare, before)[route] > 40).any(), "route"
    elsewhere = replace(scene, goal=(0.5, 0.4), inflate=0.0)
    with Stage(elsewhere, view, route=drive.route) as stage:
        moved = stage.backdrop.pixels
    assert (changed(moved, before)[goal] > 20).mean() > 0.3, "goal"
    assert (changed(moved, before) > 5).mean() > 0.1, "inflated zones"


def test_obstacles_that_the_planner_did_not_know_look_different(drive, scene):
    marked = replace(scene, unseen=np.arange(len(scene.obstacles)) == 0)
    with Stage(marked, camera(scene), route=drive.route) as stage:
        at = around(stage, *scene.obstacles[0, :2], half=3)
        red, green, blue = stage.backdrop.pixels[at].reshape(-1, 3).mean(axis=0)
    assert red > blue > green


def test_a_cylinder_hides_the_robot_behind_it(scene):
    wall = replace(scene, obstacles=np.array([(2.0, 1.0, 0.45, 2.0)]), unseen=np.zeros(1, dtype=bool), inflate=0.0)
    with Stage(wall, camera(wall), route=np.empty((0, 2))) as stage:
        hidden = changed(stage.frame((2.0, 1.56, 0.0)), stage.backdrop.pixels)
        open_ = changed(stage.frame((1.0, 1.56, 0.0)), stage.backdrop.pixels)
        covered = stage.backdrop.visible == 0
    assert (hidden > 60).sum() < 0.75 * (open_ > 60).sum()
    assert hidden[covered].max() < 60, "what is hidden shines through only faintly"


def test_wheels_turn_and_headings_show(drive, scene):
    x, y, _ = middle(drive)
    with Stage(scene, camera(scene), route=drive.route) as stage:
        still, turned = stage.frame((x, y, 0.0)), stage.frame((x, y, 0.0), (0.6, 0.6))
        away = stage.frame((x, y, np.pi))
        there = around(stage, x, y)
    assert (changed(still, turned)[there] > 15).sum() >= 3
    assert (changed(still, away)[there] > 60).sum() >= 5


def test_a_mover_is_drawn_and_hides_the_trail(drive, scene):
    moving = replace(scene, mover_radii=(0.15, 0.15))
    x, y, _ = pose = middle(drive)
    places = np.array([(x + 0.05, y - 0.4), (3.5, 0.3)])
    with Stage(moving, camera(scene), route=drive.route) as stage:
        frame = stage.frame(pose, (0, 0), places)
        for mx, my in places:
            px, py = (round(value) for value in stage.pixel(mx, my, drawn_height(moving)))
            red, _, blue = (int(channel) for channel in frame[py, px])
            assert red > blue + 60


def test_overlapping_boxes_become_one():
    assert merged([(0, 0, 5, 5), (10, 0, 12, 5)]) == [(0, 0, 5, 5), (10, 0, 12, 5)]
    assert merged([(0, 0, 5, 5), (8, 0, 12, 5), (4, 2, 9, 9)]) == [(0, 0, 12, 9)]


def test_a_trail_looks_the_same_painted_at_once_or_bit_by_bit(drive, scene):
    points, speeds = drive.pose[::10, :2], drive.twist[::10, 0]
    with Stage(scene, camera(scene), route=drive.route) as stage:
        stage.drive(points, speeds)
        at_once = stage.frame(middle(drive))
    with Stage(scene, camera(scene), route=drive.route) as stage:
        for k in range(len(points) - 1):
            stage.drive(points[k : k + 2], speeds[k : k + 2])
        assert (stage.frame(middle(drive)) == at_once).all()


def test_a_movers_way_is_foretold_on_the_ground(drive, scene):
    moving = replace(scene, mover_radii=(0.15,), obstacles=np.empty((0, 4)), unseen=np.zeros(0, dtype=bool))
    places, velocities = np.array([(3.0, 0.6)]), np.array([(-1.0, 0.0)])
    pose = (0.5, 2.5, 0.0)
    with Stage(moving, camera(moving, size=(640, 480)), route=np.empty((0, 2))) as stage:
        without = stage.frame(pose, (0, 0), places)
        still = stage.frame(pose, (0, 0), places, 0 * velocities)
        told = stage.frame(pose, (0, 0), places, velocities)
        ahead, end = (around(stage, x, 0.6, half=5) for x in (2.3, 1.5))
        beyond, behind = (around(stage, x, 0.6, half=5) for x in (1.2, 3.4))
    assert (still == without).all()
    difference = changed(told, without)
    assert difference[ahead].max() > 30
    assert difference[end].max() > 60
    assert difference[beyond].max() == difference[behind].max() == 0


def test_a_frame_among_movers_equals_a_render_of_everything_at_once(drive, scene, monkeypatch):
    monkeypatch.setattr(staging, "GHOST", 0.0)
    monkeypatch.setattr(Stage, "_shade", lambda *_: None)
    moving = replace(scene, mover_radii=(0.15, 0.3))
    view = camera(moving)
    x, y, yaw = middle(drive)
    places = np.array([(x + 0.2, y - 0.3), (3.4, 0.4)])
    with Stage(moving, view, route=drive.route, fine=1) as stage, client() as number:
        got = stage.frame((x, y, yaw), (0.4, 0.7), places)
        for mesh, colour in still_pieces(moving, stage.tall):
            add_mesh(number, mesh, colour)
        for part in robot_parts(moving.robot):
            body = add_mesh(number, part.mesh, part.colour)
            place, turn = part_pose(part, x, y, yaw, (0.4, 0.7))
            staging.bullet().resetBasePositionAndOrientation(body, place, turn, physicsClientId=number)
        for (mx, my), radius in zip(places, moving.mover_radii, strict=True):
            add_mesh(number, cylinder(radius, 0.0, drawn_height(moving), x=mx, y=my), MOVER)
        image, _, seg = render(number, view, None, 1, stage._light)
        visible = np.empty(SIZE[::-1], dtype=np.float32)
        ground = np.empty(SIZE[::-1], dtype=np.bool_)
        kernels.count_ground(seg, 1, visible, ground)
        rgb = paint_ground(view, moving, drive.route, np.ones_like(ground), stage.tall, stage._sun)
        expected = np.empty_like(got)
        kernels.resolve(rgb, image, seg, 1, visible, expected)
    assert (changed(got, expected) > 1).mean() <= 0.0005
