"""Films of mapless robots: unknown ground and undetected obstacles look different until detected."""

import math
from dataclasses import replace

import numpy as np
import pytest

from antdrive.views.film import lidar_view, painter
from antdrive.views.film.camera import CAMERAS
from antdrive.views.film.overlay import legend_entries
from antdrive.views.film.shot import Shot
from antdrive.views.map_reconstruction import MapReconstruction, enclosed, world_points
from antdrive.views.scene import Scene
from tests.made_up_drive import scanned
from tests.records import changed

SIZE = (480, 320)


def known_ground(reconstruction, points):
    """Return whether points of the map lie on known ground, free or hit."""
    cols, rows = np.floor((points - reconstruction.map.origin) / reconstruction.map.cell).astype(int).T
    return reconstruction.seen[rows, cols]


@pytest.fixture(scope="module")
def log(made_up_drive):
    return scanned(made_up_drive(size=(6.0, 4.0), obstacles=40), max_range=2.5)


def picture(log, camera, *moments):
    shot = Shot(log, camera=camera, size=SIZE, bare=True)
    return [shot.view(at) for at in moments][-1].astype(int)


@pytest.fixture(scope="module")
def spots(log):
    """Return rows and columns of ground points (N, 2) in the camera `top`."""
    shot = Shot(log, camera="top", size=SIZE, bare=True)
    camera = shot._camera

    def project(places):
        at = camera.pixels([(x, y, 0.0) for x, y in places])
        return at[:, 1].astype(int), at[:, 0].astype(int)

    return project


def test_obstacles_are_pale_until_a_beam_meets_them(log, spots):
    seen = MapReconstruction(log)
    seen.advance(log.t[-1])
    first, last = (picture(log, "top", at) for at in (0.0, log.t[-1]))
    later = np.flatnonzero((seen.met > 0) & np.isfinite(seen.met))
    assert len(later) > 3
    for j in [*np.flatnonzero(seen.met == 0)[:4], *later[:4], *np.flatnonzero(np.isinf(seen.met))[:2]]:
        body = log.record.world.obstacles[j]
        spot = spots([(body.x, body.y)])
        for shown, at in ((first, 0.0), (last, log.t[-1])):
            assert (shown[spot].mean() > 180) == (seen.met[j] > at), (j, at)


def test_ground_is_veiled_until_it_is_seen(log, spots, monkeypatch):
    with_fan = picture(log, "top", 0.0)
    monkeypatch.setattr(lidar_view.OwnMapPainter, "draw_beams", lambda *_: None)
    first, last = (picture(log, "top", at) for at in (0.0, log.t[-1]))
    x, y, yaw = log.pose[0].tolist()
    ahead = spots([(x + 0.45 * math.cos(yaw), y + 0.45 * math.sin(yaw))])
    red, _, blue = (with_fan - first)[ahead][0]
    assert red < blue - 12  # the fan

    before, after = MapReconstruction(log), MapReconstruction(log)
    before.advance(0.0)
    after.advance(log.t[-1])
    places = np.random.default_rng(1).uniform((0.3, 0.3), (5.7, 3.7), (4000, 2))
    away = [log.record.world.discs[:, 2] + 0.5, 0.5]  # from shadows and the driven path
    clear = (np.hypot(*(places[:, None] - log.record.world.discs[:, :2]).transpose(2, 0, 1)) > away[0]).all(axis=1)
    clear &= np.hypot(*(places[:, None] - log.pose[::20, :2]).transpose(2, 0, 1)).min(axis=1) > away[1]
    known = [known_ground(r, places) for r in (before, after)]
    fresh, old = (spots(places[clear & chosen]) for chosen in (~known[0] & known[1], known[0]))
    assert min(len(fresh[0]), len(old[0])) > 20
    assert last[fresh].mean() > first[fresh].mean() + 6
    assert abs(last[old].mean() - first[old].mean()) < 1


@pytest.mark.parametrize("camera", CAMERAS)
def test_a_picture_depends_on_the_moment_alone(log, camera):
    assert np.array_equal(picture(log, camera, 0.0, 0.45), picture(log, camera, 0.45))


def test_hits_are_where_the_map_has_them(log, monkeypatch):
    with_hits = picture(log, "top", 0.3)
    monkeypatch.setattr(painter.Painter, "_draw_hits", lambda *_: None)
    painted = np.abs(with_hits - picture(log, "top", 0.3)).max(axis=-1) > 40
    seen = MapReconstruction(log)
    seen.advance(0.3)
    shot = Shot(log, camera="top", size=SIZE, bare=True)
    height = seen.lidar.height
    spots = np.array([shot._compositor.pixel(x, y, height) for x, y, _ in seen.map.discs()])
    rows, cols = np.nonzero(painted)
    apart = np.hypot(cols[:, None] + 0.5 - spots[:, 0], rows[:, None] + 0.5 - spots[:, 1])
    assert len(rows) > 100
    assert apart.min(axis=1).max() < 3.5  # painted nowhere else
    assert (apart.min(axis=0) < 3).mean() > 0.8  # and there, unless a body hides it


def test_a_cylinder_within_another_is_enclosed():
    posts = np.array([[0, 0, 0.5, 1], [0.1, 0, 0.2, 1], [2, 0, 0.2, 1], [0.6, 0, 0.3, 1.0], [2, 0, 0.2, 1]])
    assert enclosed(posts).tolist() == [False, True, False, False, True]


def test_the_legend_names_all_painted_objects(log):
    scene = Scene.of(log)
    assert not scene.has_no_go_area
    plain = {entry.text for entry in legend_entries(scene)}
    named = {entry.text for entry in legend_entries(scene, beams=True, own_map=True)}
    assert named - plain == {"lidar beams", "lidar hit on the occupancy map", "unknown ground"}
    assert not any("inflated" in text for text in named)
    hidden = [replace(scene, mapped=mapped, unseen=np.ones_like(scene.unseen)) for mapped in (True, False)]
    given, none = ({entry.text for entry in legend_entries(one)} for one in hidden)
    assert "placed after planning" in given - none
    assert none - plain == {"not in the world file"}


def test_only_tracked_movers_get_rings(log):
    shot = Shot(log, camera="top", size=SIZE, bare=True)
    shot.view(0.0)
    movers = np.array([[3.0, 2.0, 0.4, 0.0, 0.5]])
    actors = [shot.drives[0].actor(0.0, last=False)]
    plain, ringed = (shot._compositor.frame_of(actors, tracked=shown).astype(int) for shown in (None, movers))
    x, y = (np.array(shot._compositor.pixel(*at)) for at in ((3.0, 2.0), (3.55, 2.0)))
    rows, cols = np.nonzero(np.abs(ringed - plain).max(axis=-1) > 20)
    away = np.hypot(cols + 0.5 - x[0], rows + 0.5 - x[1])
    ring = (away > 0.5 * math.dist(x, y)) & (np.abs(rows + 0.5 - x[1]) > 5)  # not the line ahead
    assert np.count_nonzero(ring) > 60
    assert np.abs(away[ring] - math.dist(x, y)).max() < 4
    red, green, blue = ringed[rows, cols].mean(axis=0)
    assert min(red, blue) > green + 25
    labels = {entry.text for entry in legend_entries(Scene.of(log), tracked=True)}
    assert "mover tracked by lidar, next 1.5 s" in labels


def test_of_a_robot_with_a_map_only_the_beams_are_painted(log, spots, monkeypatch):
    mapped = changed(log, "record", sensing=None)
    at = float(log.t[-1])
    fan = picture(mapped, "top", 0.0, at)
    bare = picture(replace(mapped, scans=log.scans[:0], scan_rows=log.scan_rows[:0]), "top", at)
    assert np.array_equal(picture(mapped, "top", at), fan)
    monkeypatch.setattr(lidar_view.BeamPainter, "draw_beams", lambda *_: None)
    painted = np.abs(fan - picture(mapped, "top", at)).max(axis=-1) > 4
    rows, cols = np.nonzero(painted)
    assert len(rows) > 1000
    eye, ahead = (np.array(spots([log.pose[log.scan_rows[-1], :2] + off])).reshape(2) for off in (0.0, [1.0, 0.0]))
    assert np.hypot(rows - eye[0], cols - eye[1]).max() < 2.6 * math.dist(eye, ahead)  # the lidar's range is 2.5 m
    red, _, blue = (fan - bare)[painted].mean(axis=0)
    assert red < blue - 12
    bodies = spots(log.record.world.discs[:, :2])
    assert np.array_equal(fan[bodies], bare[bodies])  # none is pale


@pytest.fixture(scope="module")
def far(made_up_drive):
    return scanned(made_up_drive(size=(6.0, 4.0), obstacles=40))


def bodies_met(far, k):
    """Return the cylinders hit by scan k: the least root of each beam's quadratic for each cylinder."""
    lidar, discs = far.record.robot.lidar, far.record.world.discs
    x, y, yaw = lidar.pose_on(tuple(far.pose[far.scan_rows[k]]))
    angles = yaw - lidar.yaw + lidar.angles
    ways = np.stack([np.cos(angles), np.sin(angles)], axis=1)
    to = discs[:, :2] - (x, y)
    b = ways @ to.T
    root = b**2 - (to**2).sum(axis=1) + discs[:, 2] ** 2
    hits = np.where((root > 0) & (b > 0), b - np.sqrt(np.maximum(root, 0)), np.inf)
    low, high = np.array(far.record.world.bounds).reshape(2, 2)
    with np.errstate(divide="ignore"):
        walls = np.where(ways > 0, (high - (x, y)) / ways, (low - (x, y)) / ways).min(axis=1)
    first = hits.argmin(axis=1)
    best = hits[np.arange(len(ways)), first]
    return set(first[(best < walls) & (best < lidar.max_range) & (best > lidar.min_range)].tolist())


def test_obstacles_are_met_when_a_beam_first_ends_on_them(far):
    expected = np.full(len(far.record.world.obstacles), math.inf)
    for k in reversed(range(len(far.scans))):
        expected[list(bodies_met(far, k))] = far.t[far.scan_rows[k]]
    seen = MapReconstruction(far)
    seen.advance(far.t[-1])
    assert len(set(expected.tolist())) > 4  # some at once, some later
    assert seen.met.tolist() == expected.tolist()


def test_what_was_seen_is_the_same_whatever_the_steps(far):
    once, stepwise = MapReconstruction(far), MapReconstruction(far)
    for at in np.arange(0.0, far.t[-1] + 0.03, 0.03):
        stepwise.advance(at)
    once.advance(far.t[-1])
    assert np.array_equal(once.seen, stepwise.seen)
    assert np.array_equal(once.map.discs(), stepwise.map.discs())


def test_the_map_is_laid_where_the_robot_believes_to_be(far):
    turn, shift = 0.2, np.array([0.5, -0.3])
    cos, sin = math.cos(turn), math.sin(turn)
    wrong = np.column_stack([far.pose[:, :2] @ np.array([[cos, sin], [-sin, cos]]) + shift, far.pose[:, 2] + turn])
    drifted = replace(far, estimate=wrong)
    straight, seen = MapReconstruction(far), MapReconstruction(drifted)
    for reconstruction in (straight, seen):
        reconstruction.advance(0.5)
    assert straight.drift(0.5) == pytest.approx([1, 0, 0, 0])
    there = seen.drift(0.5)
    assert there == pytest.approx([cos, sin, *shift])
    laid, true = world_points(seen.map.discs()[:, :2], there), straight.map.discs()[:, :2]
    apart = np.hypot(*(laid[:, None] - true[None]).transpose(2, 0, 1)).min(axis=1)
    assert apart.max() < 0.04  # grains of 2.5 cm are cut otherwise
    assert np.hypot(*(seen.map.discs()[:, :2][:, None] - true[None]).transpose(2, 0, 1)).min(axis=1).max() > 0.1


def test_a_log_without_scans_is_refused(made_up_drive):
    with pytest.raises(ValueError, match="no scans"):
        MapReconstruction(made_up_drive())
