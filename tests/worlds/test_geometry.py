"""Clearances against slow oracles, and transformations that must not change them."""

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from antdrive.worlds import Disc, World, point_clearance, polyline_clearance, segment_clearance
from tests.worlds.oracles import clearance_of_point, clearance_of_segment, coordinates, worlds

points = st.tuples(coordinates(-7, 7), coordinates(-7, 7))


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


@given(worlds(), points, points)
def test_a_segment_is_as_clear_backwards(world, a, b):
    assert segment_clearance(world, [a], [b])[0] == pytest.approx(segment_clearance(world, [b], [a])[0], abs=1e-12)


@given(worlds(), points)
def test_a_segment_without_length_is_a_point(world, a):
    assert segment_clearance(world, [a], [a])[0] == pytest.approx(point_clearance(world, [a])[0], abs=1e-12)


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
