"""Playback of a log between its rows, at jumps and at contacts."""

from dataclasses import replace

import numpy as np
import pytest

from antdrive.views.film.playback import Playback
from antdrive.views.scene import Scene, contact_point, jumps, mover_tracks


@pytest.fixture(scope="module")
def jumped(made_up_drive):
    """Two movers: one at 0.5 m/s that jumps back before row 120, one at rest."""
    drive = made_up_drive(movers=2)
    movers = drive.movers.copy()
    movers[:, 0] = np.column_stack([0.5 * drive.t, 0 * drive.t])
    movers[120:, 0, 0] -= movers[120, 0, 0]
    movers[:, 1] = (3.5, 0.5)
    return replace(drive, movers=movers)


def test_a_jumping_mover_is_never_between_its_two_positions(jumped):
    playback = Playback(jumped)
    before, after = jumped.movers[119, 0, 0], jumped.movers[120, 0, 0]
    assert playback.movers(119.9 / 240)[0, 0] == before
    assert playback.movers(120 / 240)[0, 0] == after
    assert playback.movers(60.5 / 240)[0, 0] == pytest.approx(0.5 * 60.5 / 240)


def test_movers_have_the_velocity_of_their_rows(jumped):
    playback = Playback(jumped)
    np.testing.assert_allclose(playback.mover_velocities(0.1), [(0.5, 0), (0, 0)], atol=1e-9)
    np.testing.assert_allclose(playback.mover_velocities(119.5 / 240), [(0, 0), (0, 0)], atol=1e-9)
    np.testing.assert_allclose(playback.mover_velocities(99.0), [(0.5, 0), (0, 0)], atol=1e-9)


def test_tracks_are_cut_at_jumps_and_nowhere_else(jumped):
    assert np.argwhere(jumps(jumped.movers)).tolist() == [[119, 0]]
    one, two, stood = mover_tracks(jumped.movers)
    assert (len(one), len(two), len(stood)) == (120, len(jumped.t) - 120, len(jumped.t))
    fast = np.zeros((100, 1, 2))
    fast[:, 0, 0] = np.arange(100) * 20 / 240
    assert not jumps(fast).any(), "20 m/s is fast, but no jump"
    closest = jumped.movers[jumped.clearance.argmin()]
    assert Scene.of(jumped).movers == tuple(map(tuple, closest.tolist()))


def test_contact_points_lie_on_obstacles_movers_and_walls(jumped):
    scene = Scene.of(jumped)
    count, movers = len(scene.obstacles), jumped.movers[0]
    x, y = contact_point(scene, (3.0, 0.5, 0.0), count + 1, movers)
    assert (x, y) == pytest.approx((3.5 - 0.12, 0.5))
    assert contact_point(scene, (0.2, 1.0, 0.0), count + 2, movers) == (0.0, 1.0)
    assert contact_point(scene, (0.2, 1.0, 0.0), count + 5, movers) == (0.2, 3.0)
    ox, oy, radius, _ = scene.obstacles[0]
    assert contact_point(scene, (ox + 1.0, oy, 0.0), 0, movers) == pytest.approx((ox + radius, oy))


def test_slow_motion_is_around_the_first_contact(made_up_drive):
    playback = Playback(made_up_drive(collide=True, seconds=2.0))
    first = playback.duration  # the made-up drive ends at its contact
    assert playback.slow_motion(1.0) == pytest.approx((first - 0.3, first))
    assert playback.slow_motion(2.0) == pytest.approx((first - 0.6, first))
    early = made_up_drive(seconds=2.0)
    early = replace(early, contacts=np.array([[24.0, 0.0, -0.001, 9.0], [480.0, 0.0, -0.001, 9.0]]))
    assert Playback(early).slow_motion(1.0) == pytest.approx((0.0, 0.1 + 0.1))
    assert Playback(made_up_drive()).slow_motion(1.0) is None


def test_the_least_clearance_is_that_up_to_the_moment(made_up_drive):
    drive = made_up_drive()
    clearance = np.full(len(drive.t), 0.5)
    clearance[100] = 0.1
    playback = Playback(replace(drive, clearance=clearance))
    shown = [playback.min_clearance(row / 240) for row in (99, 99.5, 100, 101)]
    assert shown == pytest.approx([0.5, 0.3, 0.1, 0.1]), "never above the clearance shown beside it"


def test_tracked_movers_are_those_of_the_last_scan(jumped):
    """Turtlebot's lidar scans at 5 Hz: after two periods without a mover, none is tracked."""
    rows = [(0, 0, 1.0, 0.5, 0.5, 0, 0.2), (48, 0, 1.1, 0.5, 0.5, 0, 0.2), (48, 1, 3.0, 2.0, 0, 0.1, 0.3)]
    playback = Playback(replace(jumped, tracks=np.array(rows, dtype=np.float32)))
    assert np.allclose(playback.tracked(0.1), [[1.0, 0.5, 0.5, 0.0, 0.2]])
    assert np.allclose(playback.tracked(0.2), [[1.1, 0.5, 0.5, 0, 0.2], [3.0, 2.0, 0, 0.1, 0.3]])
    assert len(playback.tracked(0.39)) == 2
    assert playback.tracked(0.5).shape == (0, 5)
    assert Playback(jumped).tracked(0.1).shape == (0, 5)
