"""Footprints against a dense outline: polygons, rectangles and discs beside the axle or centred on it."""

import dataclasses
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from antdrive.base import FieldError
from antdrive.proof.distances import _polygon_to_points, to_walls
from antdrive.robots import Footprint, footprint_clearance, load_robot
from antdrive.robots.clearance import footprint_distances, kernel_shape
from antdrive.robots.control._kernels_obstacles import turn_clearance
from antdrive.robots.spec import yaw_inertia
from antdrive.sim.driving._kernels_movers import lower_by_movers
from antdrive.sim.log.contacts import _gap
from antdrive.worlds import Disc, World

POSES = st.tuples(st.floats(-2, 2), st.floats(-2, 2), st.floats(-4, 4))
DISCS = st.tuples(st.floats(-3, 3), st.floats(-3, 3), st.floats(0.05, 1.0))


@st.composite
def footprints(draw):
    """Polygons of 3 to 8 corners on an ellipse whose centre is not the axle's, and discs that are not centred on it."""
    a, b = draw(st.floats(0.2, 0.8)), draw(st.floats(0.2, 0.8))
    x, y = 0.2 * a * draw(st.floats(-1, 1)), 0.2 * b * draw(st.floats(-1, 1))
    count = draw(st.sampled_from([1, 3, 4, 5, 8]))
    if count == 1:
        return Footprint.disc(a, (x + 0.01, y))
    angles = [2 * math.pi * (k + draw(st.floats(-0.15, 0.15))) / count for k in range(count)]
    return Footprint.polygon([(x + a * math.cos(angle), y + b * math.sin(angle)) for angle in angles])


def outline(foot, pose):
    """Points every few millimetres of a footprint's edge at a pose, as x + iy, from its definition alone."""
    corners = np.array([complex(*corner) for corner in foot.corners])
    if len(corners) == 1:
        edge = corners + foot.rounding * np.exp(2j * math.pi * np.linspace(0, 1, 2000))
    else:
        share = np.linspace(0, 1, 500)[:, None]
        edge = (corners + share * (np.roll(corners, 1) - corners)).ravel()
    return complex(*pose[:2]) + edge * np.exp(1j * pose[2])


def contains(foot, pose, x, y):
    """Whether a point is within the footprint, by how often its outline winds around it."""
    seen = np.angle(outline(foot, pose) - complex(x, y))
    if len(foot.corners) > 1:  # in the order of the outline
        seen = seen.reshape(500, -1)[:, ::-1].T.ravel()
    turns = (np.diff(np.append(seen, seen[0])) + math.pi) % (2 * math.pi) - math.pi
    return abs(turns.sum()) > math.pi


@settings(max_examples=60)
@given(footprints(), POSES, DISCS)
def test_the_distance_to_a_disc_is_that_of_the_outline_for_everyone_who_computes_it(foot, pose, disc):
    """The drive, the placing, the movers, the contacts and the certificate have code of their own."""
    x, y, radius = disc
    world = World("w", (-50.0, -50.0, 50.0, 50.0), (Disc(x, y, radius),))
    robot = dataclasses.replace(load_robot("warehouse"), footprint=WIDE)
    object.__setattr__(robot, "footprint", foot)  # its wheels need not be inside
    moving = np.full(1, math.inf)
    shape, corners = np.array([0.0, 0.0, foot.rounding]), np.array(foot.corners)
    lower_by_movers(np.array([pose]), shape, corners, np.array([[[x, y]]]), np.array([radius]), moving)
    seen = (complex(x, y) - complex(*pose[:2])) * np.exp(-1j * pose[2])
    found = {
        "driving": footprint_clearance(world, foot, [pose])[0],
        "placing": footprint_distances(world, robot, [pose])[0, 0],
        "movers": moving[0],
        "contacts": _gap(foot, pose, (x, y), radius),
        "certificate": _polygon_to_points(foot.corners, np.array([seen]))[0] - foot.rounding - radius,
    }
    assert max(found.values()) - min(found.values()) < 1e-9, found
    away = np.abs(outline(foot, pose) - complex(x, y)).min()
    expected = -away if contains(foot, pose, x, y) else away
    assert found["driving"] == pytest.approx(expected - radius, abs=3e-3)


WIDE = Footprint.rectangle(4.0, 4.0, (0.1, 0.0))


@settings(max_examples=40)
@given(footprints(), POSES)
def test_the_distance_to_the_walls_is_that_of_the_outline(foot, pose):
    world = World("w", (-4.0, -5.0, 6.0, 7.0))
    edge = outline(foot, pose)
    expected = [edge.real.min() + 4, 6 - edge.real.max(), edge.imag.min() + 5, 7 - edge.imag.max()]
    assert footprint_clearance(world, foot, [pose])[0] == pytest.approx(min(expected), abs=1e-4)
    walls = to_walls(foot, np.array([pose]), world.bounds)[0]
    np.testing.assert_allclose(walls, expected, atol=1e-4)
    robot = dataclasses.replace(load_robot("warehouse"), footprint=WIDE)
    object.__setattr__(robot, "footprint", foot)
    left, low, right, high = footprint_distances(world, robot, [pose])[0]
    np.testing.assert_allclose((left, right, low, high), expected, atol=1e-4)


BOXES = st.builds(Footprint, st.floats(0.05, 0.5), st.floats(0.05, 0.5), st.sampled_from([0.0, 0.1]))


@settings(max_examples=60)
@given(BOXES, POSES, DISCS)
def test_the_distances_of_a_centred_footprint_are_those_of_its_corners(foot, pose, disc):
    (a, b), (x, y) = (foot.half_length, foot.half_width), pose[:2]
    same = Footprint(rounding=foot.rounding, corners=((a, -b), (a, b), (-a, b), (-a, -b)))
    for world in (World("w", (-50.0, -50.0, 50.0, 50.0), (Disc(*disc),)), World("w", (x - 1, y - 2, x + 3, y + 4))):
        expected = footprint_clearance(world, same, [pose])[0]
        assert footprint_clearance(world, foot, [pose])[0] == pytest.approx(expected, abs=1e-9)


@settings(max_examples=120)
@given(
    footprints() | BOXES,
    POSES,
    st.floats(-math.pi, math.pi),
    st.lists(DISCS, max_size=3),
    st.tuples(*[st.floats(0.3, 2)] * 4),
)
def test_the_clearance_of_a_turn_is_the_least_of_its_headings(foot, pose, turn, discs, walls):
    x, y, yaw = pose
    bounds = (x - walls[0], y - walls[1], x + walls[2], y + walls[3])
    world = World("turn", bounds, tuple(Disc(*disc) for disc in discs))
    poses = np.column_stack([np.full(1500, x), np.full(1500, y), yaw + turn * np.linspace(0, 1, 1500)])
    expected = footprint_clearance(world, foot, poses).min()
    shape, corners = kernel_shape(foot)
    found = turn_clearance(x, y, yaw, turn, *shape, corners, world.discs, np.array(bounds))
    if expected > 0:
        assert expected - 3e-3 <= found <= expected + 1e-9
    else:  # by how much it would overlap does not matter
        assert found <= 1e-9


@pytest.mark.parametrize(
    "foot", [Footprint.polygon([(1.6, 0.0), (-0.2, 0.3), (-0.2, -0.3)]), Footprint.rectangle(0.5, 0.4)]
)
def test_many_poses_at_once_give_the_same_distances_as_one_by_one(foot):
    """The kernel reuses a list of nearby discs; it must never lack the nearest one, ahead of a long nose either."""
    rng = np.random.default_rng(2)
    discs = tuple(Disc(*rng.uniform(-9, 9, 2), float(rng.uniform(0.05, 0.6))) for _ in range(150))
    world = World("w", (-10, -10, 10, 10), discs)
    walk = np.cumsum(rng.normal(0, 0.05, (1500, 3)), axis=0)
    together = footprint_clearance(world, foot, walk)
    alone = [footprint_clearance(world, foot, pose[None])[0] for pose in walk]
    np.testing.assert_array_equal(together, alone)


@settings(max_examples=40)
@given(footprints())
def test_radii_bounds_depth_and_reach_are_those_of_the_outline(foot):
    edge = outline(foot, (0.0, 0.0, 0.0))
    xmin, ymin, xmax, ymax = foot.bounds
    assert foot.radius == pytest.approx(np.abs(edge).max(), abs=1e-4)
    assert foot.inner_radius == pytest.approx(np.abs(edge).min(), abs=2e-3)
    assert (xmin, xmax) == pytest.approx((edge.real.min(), edge.real.max()), abs=1e-4)
    assert (ymin, ymax) == pytest.approx((edge.imag.min(), edge.imag.max()), abs=1e-4)
    for angle in (0.0, 1.0, math.pi, -2.0):
        ray = edge[np.abs(np.angle(edge * np.exp(-1j * angle))).argmin()]
        assert foot.reach(angle) == pytest.approx(abs(ray), abs=2e-2)
        assert foot.depth(*_at(angle, foot.reach(angle))) == pytest.approx(0, abs=1e-9)
    drawn = np.array([complex(*point) for point in foot.outline(32)])
    assert max(np.abs(edge - point).min() for point in drawn) < 3e-3, "what is drawn lies on the outline"
    assert np.abs(drawn).max() == pytest.approx(foot.radius, abs=2e-3)


@pytest.mark.parametrize("foot", [Footprint.disc(0.3), Footprint.rectangle(0.6, 0.4), Footprint(0.2, 0.1, 0.05)])
def test_what_is_drawn_of_a_centred_footprint_is_its_outline(foot):
    points = foot.outline(16)
    assert max(abs(foot.depth(x, y)) for x, y in points) < 1e-9
    xs, ys = zip(*points, strict=True)
    assert (min(xs), min(ys), max(xs), max(ys)) == pytest.approx(foot.bounds)
    area = sum(x * ys[k - 1] - y * xs[k - 1] for k, (x, y) in enumerate(points)) / -2
    a, b, r = foot.half_length, foot.half_width, foot.rounding
    assert area == pytest.approx(4 * (a * b + (a + b) * r) + math.pi * r**2, rel=2e-3)


def _at(angle, away):
    return away * math.cos(angle), away * math.sin(angle)


def test_a_rectangle_beside_the_axle_is_the_polygon_of_its_corners():
    foot = Footprint.rectangle(0.9, 0.6, (0.15, 0.0))
    assert foot == Footprint.polygon([(0.6, -0.3), (0.6, 0.3), (-0.3, 0.3), (-0.3, -0.3)])
    assert (*foot.box[:2], *foot.box[2]) == pytest.approx((0.9, 0.6, 0.15, 0.0))
    assert Footprint.rectangle(0.9, 0.6).corners == ()
    assert Footprint.rectangle(0.9, 0.6, (0.0, 0.0)) == Footprint.rectangle(0.9, 0.6)
    assert Footprint.polygon([(1, 0), (-1, 1), (-1, -1)]).box is None
    assert Footprint.polygon([(1, 0), (0, 1), (-1, 0), (0, -1)]).box is None, "a square that stands on its corner"


@pytest.mark.parametrize("order", [1, -1])
def test_a_polygon_is_the_same_either_way_round_and_points_on_its_sides_add_nothing(order):
    points = [(0.5, -0.2), (0.5, 0.1), (0.5, 0.2), (-0.3, 0.2), (-0.3, -0.2), (0.1, -0.2)]
    foot = Footprint.polygon(points[::order])
    assert sorted(foot.corners) == [(-0.3, -0.2), (-0.3, 0.2), (0.5, -0.2), (0.5, 0.2)]
    assert foot.depth(0.0, 0.0) == pytest.approx(0.2)
    assert foot.depth(0.6, 0.3) == pytest.approx(-math.hypot(0.1, 0.1))


#: A dent, a pentagram, lines, too many corners and one that is nowhere.
NO_POLYGONS = (
    [(0.5, 0.0), (0.1, 0.05), (0.0, 0.5), (-0.5, 0.0), (0.0, -0.5)],
    [(1, 0), (-0.8, 0.6), (0.3, -0.95), (0.3, 0.95), (-0.8, -0.6)],
    [(0, 0), (1, 0), (2, 0)],
    [(0, 0), (1, 0)],
    [(math.cos(k / 10), math.sin(k / 10)) for k in range(60)],
    [(math.nan, 0), (1, 0), (0, 1)],
)


def test_a_robot_whose_wheels_stand_outside_its_polygon_is_refused(jackal):
    behind = Footprint.rectangle(0.508, 0.43, (0.2, 0.0))  # 54 mm behind the axle, wheels of 98 mm
    with pytest.raises(FieldError, match=r"wheels of 0\.098 m, 0\.3756 m apart, protrude from it at \(-0\.098, "):
        dataclasses.replace(jackal, footprint=behind)
    with pytest.raises(FieldError, match="are 0"):
        dataclasses.replace(jackal, footprint=Footprint.rectangle(0.6, 0.38, (0.1, 0.0)))
    with pytest.raises(FieldError, match=r"must be between 0\.02 and 20"):
        dataclasses.replace(jackal, footprint=Footprint.rectangle(30.0, 0.43, (0.2, 0.0)))
    with pytest.raises(FieldError, match=r"footprint\.corners: must not be given with half_length"):
        dataclasses.replace(jackal, footprint=Footprint(0.5, 0.3, 0.0, ((1.0, -1.0), (1.0, 1.0), (-1.0, 0.0))))


@settings(max_examples=30)
@given(footprints())
def test_the_inertia_is_that_of_a_fine_lattice_of_masses(foot):
    robot = dataclasses.replace(load_robot("warehouse"), footprint=WIDE, mass=7.0)
    object.__setattr__(robot, "footprint", foot)
    xmin, ymin, xmax, ymax = foot.bounds
    x, y = np.meshgrid(np.linspace(xmin, xmax, 60), np.linspace(ymin, ymax, 60))
    inside = [foot.depth(a, b) > 0 for a, b in zip(x.ravel(), y.ravel(), strict=True)]
    expected = 7.0 * (x**2 + y**2).ravel()[inside].mean()
    assert yaw_inertia(robot.mass, robot.footprint) == pytest.approx(expected, rel=0.05)


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
