"""Clearances against slow oracles, and transformations that must not change them."""

import math
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from antdrive.worlds import Disc, World, point_clearance, polyline_clearance, segment_clearance
from tests.worlds.oracles import clearance_of_point, clearance_of_segment, coordinates, worlds

points = st.tuples(coordinates(-7, 7), coordinates(-7, 7))


def moved(world, dx, dy):
    xmin, ymin, xmax, ymax = world.bounds
    discs = tuple(Disc(d.x + dx, d.y + dy, d.radius) for d in world.obstacles)
    return World(world.name, (xmin + dx, ymin + dy, xmax + dx, ymax + dy), discs)


def mirrored(world):
    xmin, ymin, xmax, ymax = world.bounds
    return World(world.name, (-xmax, ymin, -xmin, ymax), tuple(Disc(-d.x, d.y, d.radius) for d in world.obstacles))


def turned(world):
    """By a quarter, counter-clockwise."""
    xmin, ymin, xmax, ymax = world.bounds
    return World(world.name, (-ymax, xmin, -ymin, xmax), tuple(Disc(-d.y, d.x, d.radius) for d in world.obstacles))


@given(worlds(), points)
def test_point_clearance_is_the_distance_to_the_nearest_surface(world, p):
    assert point_clearance(world, [p])[0] == pytest.approx(clearance_of_point(world, *p), abs=1e-12)


@settings(max_examples=25)
@given(worlds(max_discs=4), points, points)
def test_segment_clearance_is_the_least_along_the_segment(world, a, b):
    assert segment_clearance(world, [a], [b])[0] == pytest.approx(clearance_of_segment(world, a, b), abs=1e-7)


@settings(max_examples=25)
@given(worlds(), st.lists(st.tuples(points, points), min_size=2, max_size=6))
def test_clearances_in_a_batch_equal_single_ones(world, ends):
    """Bit for bit: each search starts from the previous result."""
    starts, stops = (np.array(side, dtype=float) for side in zip(*ends, strict=True))
    one_by_one = [point_clearance(world, [start])[0] for start in starts]
    assert point_clearance(world, starts).tolist() == one_by_one
    one_by_one = [segment_clearance(world, [a], [b])[0] for a, b in zip(starts, stops, strict=True)]
    assert segment_clearance(world, starts, stops).tolist() == one_by_one


@given(worlds(), points, points, st.floats(0, 1))
def test_no_point_of_a_segment_has_less_clearance_than_the_segment(world, a, b, t):
    between = (a[0] + t * (b[0] - a[0]), a[1] + t * (b[1] - a[1]))
    assert point_clearance(world, [between])[0] >= segment_clearance(world, [a], [b])[0] - 1e-12


@given(worlds(), points, points)
def test_a_segment_is_as_clear_backwards(world, a, b):
    assert segment_clearance(world, [a], [b])[0] == pytest.approx(segment_clearance(world, [b], [a])[0], abs=1e-12)


@given(worlds(), points)
def test_a_segment_without_length_is_a_point(world, a):
    assert segment_clearance(world, [a], [a])[0] == pytest.approx(point_clearance(world, [a])[0], abs=1e-12)


@given(worlds(), points, points, coordinates(-50, 50), coordinates(-50, 50))
def test_moving_everything_changes_no_clearance(world, a, b, dx, dy):
    there = segment_clearance(moved(world, dx, dy), [(a[0] + dx, a[1] + dy)], [(b[0] + dx, b[1] + dy)])
    assert there[0] == pytest.approx(segment_clearance(world, [a], [b])[0], abs=1e-9)


@given(worlds(), points, points)
def test_mirroring_or_rotating_everything_changes_no_clearance(world, a, b):
    here = segment_clearance(world, [a], [b])[0]
    assert segment_clearance(mirrored(world), [(-a[0], a[1])], [(-b[0], b[1])])[0] == pytest.approx(here)
    assert segment_clearance(turned(world), [(-a[1], a[0])], [(-b[1], b[0])])[0] == pytest.approx(here)


@given(worlds(), st.lists(points, min_size=1, max_size=6))
def test_a_polyline_is_as_clear_as_its_worst_segment(world, line):
    pairs = list(pairwise(line)) or [(line[0], line[0])]
    worst = min(segment_clearance(world, [a], [b])[0] for a, b in pairs)
    assert polyline_clearance(world, line) == pytest.approx(worst, abs=1e-12)


def test_clearance_is_negative_inside_a_disc_and_beyond_a_wall():
    world = World("w", (0, 0, 10, 10), (Disc(5, 5, 2),))
    assert point_clearance(world, [(5, 5), (-1, 5), (5, 4)]).tolist() == [-2.0, -1.0, -1.0]


def test_no_points_have_no_clearances():
    world = World("w", (0, 0, 10, 10))
    assert point_clearance(world, np.empty((0, 2))).shape == (0,)
    assert segment_clearance(world, np.empty((0, 2)), np.empty((0, 2))).shape == (0,)


def test_a_disc_is_passed_where_the_foot_of_the_perpendicular_lies_on_the_segment():
    world = World("w", (-100, -100, 100, 100), (Disc(0, 3, 1),))
    assert segment_clearance(world, [(-5, 0)], [(5, 0)])[0] == pytest.approx(2.0)
    assert segment_clearance(world, [(4, 0)], [(9, 0)])[0] == pytest.approx(math.hypot(4, 3) - 1)
