import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from antdrive.robots import Footprint, footprint_clearance
from antdrive.worlds import Disc, World

coordinate = st.floats(-3, 3)
FOOTPRINTS = [Footprint.disc(0.3), Footprint.rectangle(0.5, 0.4), Footprint(0.2, 0.1, 0.05)]


def outline(foot, pose):
    """Points on a footprint's outline, from its definition: a rectangle's outline moved outwards."""
    sides = np.linspace(-1, 1, 801)
    hx, hy = foot.half_length, foot.half_width
    along = [np.stack([hx * sides, np.full_like(sides, s * hy)], 1) + [0, s * foot.rounding] for s in (-1, 1)]
    across = [np.stack([np.full_like(sides, s * hx), hy * sides], 1) + [s * foot.rounding, 0] for s in (-1, 1)]
    angles = np.linspace(0, 2 * math.pi, 4001)
    round_corner = foot.rounding * np.stack([np.cos(angles), np.sin(angles)], 1)
    corners = np.concatenate([round_corner + [a * hx, b * hy] for a in (-1, 1) for b in (-1, 1)])
    points = np.concatenate([*along, *across, corners])
    x, y, yaw = pose
    rotation = np.array([[math.cos(yaw), -math.sin(yaw)], [math.sin(yaw), math.cos(yaw)]])
    return points @ rotation.T + [x, y]


@pytest.mark.parametrize("foot", FOOTPRINTS, ids=["disc", "rectangle", "rounded"])
@given(x=coordinate, y=coordinate, yaw=st.floats(-4, 4), dx=coordinate, dy=coordinate, radius=st.floats(0.05, 1))
def test_distance_to_a_disc_is_that_of_the_outline(foot, x, y, yaw, dx, dy, radius):
    world = World("w", (-50, -50, 50, 50), (Disc(dx, dy, radius),))
    brute = np.hypot(*(outline(foot, (x, y, yaw)) - [dx, dy]).T).min() - radius
    exact = footprint_clearance(world, foot, [(x, y, yaw)])[0]
    if exact > -radius:  # the disc's centre is outside the footprint
        assert exact == pytest.approx(brute, abs=2e-3)
    else:
        assert brute < 0.5


@pytest.mark.parametrize("foot", FOOTPRINTS, ids=["disc", "rectangle", "rounded"])
@given(x=coordinate, y=coordinate, yaw=st.floats(-4, 4))
def test_distance_to_the_walls_is_that_of_the_outline(foot, x, y, yaw):
    world = World("w", (-4, -5, 6, 7))
    points = outline(foot, (x, y, yaw))
    brute = min(points[:, 0].min() + 4, 6 - points[:, 0].max(), points[:, 1].min() + 5, 7 - points[:, 1].max())
    assert footprint_clearance(world, foot, [(x, y, yaw)])[0] == pytest.approx(brute, abs=1e-4)


def test_the_radius_is_that_of_the_circumscribed_circle():
    assert Footprint.rectangle(0.508, 0.430).radius == pytest.approx(0.3328, abs=1e-4)
    assert Footprint.disc(0.18).radius == 0.18


def test_discs_whose_centres_are_far_may_still_be_the_nearest():
    """Beside a blade of 2 m: one disc lies before its tip, one is so large that it comes near."""
    blade = Footprint.rectangle(2.0, 0.2)
    beside = Disc(0.0, -0.6, 0.05)
    for far, gap in ((Disc(1.2, 0.0, 0.05), 0.15), (Disc(0.0, 3.0, 2.5), 0.4)):
        world = World("w", (-50, -50, 50, 50), (beside, far))
        np.testing.assert_allclose(footprint_clearance(world, blade, [(0.0, 0.0, 0.0)]), gap)
        walk = [(0.01 * k, 0.0, 0.0) for k in range(60)]
        alone = [footprint_clearance(world, blade, [pose])[0] for pose in walk]
        np.testing.assert_array_equal(footprint_clearance(world, blade, walk), alone)
