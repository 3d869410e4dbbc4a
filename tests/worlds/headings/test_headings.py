"""Free headings, turns and sweeps against sampling, shapely, and each other."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from antdrive.worlds import DIRECTIONS
from antdrive.worlds.headings import Outline, sweep_clearance, turn_clear
from antdrive.worlds.headings._kernels_headings import clear_moves, heading_bits
from tests.worlds.headings.intervals import TURN, free_headings
from tests.worlds.headings.oracle import BAND, OUTLINES, crowd, gap, outlines, sampled

EVERY = pytest.mark.parametrize("outline", OUTLINES.values(), ids=OUTLINES)
NONE = np.zeros((0, 3))
SQUARE = OUTLINES["rectangle"]


def in_any(intervals, yaws):
    """Whether headings lie inside an interval, (N,)."""
    after = (np.asarray(yaws)[:, None] - intervals[:, 0]) % TURN
    return ((after > 0) & (after < intervals[:, 1] - intervals[:, 0])).any(axis=1) | covers_all(intervals)


def covers_all(intervals):
    return len(intervals) == 1 and intervals[0, 1] - intervals[0, 0] >= TURN


def places(seed, count=40, size=6.0):
    return np.random.default_rng(seed).uniform(0.2, size - 0.2, (count, 2))


@EVERY
def test_free_headings_are_those_of_samples(outline):
    discs, bounds = crowd(0)
    yaws = np.linspace(0, TURN, 250, endpoint=False)
    for x, y in places(0, 30):
        gaps = gap(outline, x, y, yaws, discs, bounds)
        sure = np.abs(gaps) > BAND
        found = in_any(free_headings(x, y, outline, discs, bounds), yaws)
        assert (found[sure] == (gaps > 0)[sure]).all()


@EVERY
def test_ends_of_intervals_touch_and_starts_are_sorted(outline):
    discs, bounds = crowd(3)
    for x, y in places(3, 25):
        intervals = free_headings(x, y, outline, discs, bounds)
        assert (np.diff(intervals[:, 0]) > 0).all()
        assert ((intervals[:, 0] >= 0) & (intervals[:, 0] < TURN) & (intervals[:, 0] < intervals[:, 1])).all()
        assert (intervals[1:, 0] > intervals[:-1, 1]).all()
        if not covers_all(intervals):
            np.testing.assert_allclose(gap(outline, x, y, intervals.ravel(), discs, bounds), 0.0, atol=1e-9)


@EVERY
def test_turns_are_clear_where_samples_are(outline):
    discs, bounds = crowd(10)
    rng = np.random.default_rng(0)
    for x, y in places(10, 30):
        yaw, turn = rng.uniform(-7, 7), rng.choice([0.0, 0.3, math.pi / 4, 2.0, TURN, 9.0]) * rng.choice([-1, 1])
        least, slack = sampled(outline, x, y, yaw, yaw + turn, discs, bounds)
        clear = turn_clear(x, y, yaw, turn, outline, discs, bounds)
        if least < -BAND:
            assert not clear
        if least > slack + BAND:
            assert clear


@EVERY
def test_swept_distances_are_those_of_another_library(outline):
    """The exact distance of the hull of both ends from each disc's centre."""
    import shapely

    discs, bounds = crowd(5, count=12)
    rng = np.random.default_rng(5)
    for x, y in places(5, 25):
        yaw, (tx, ty) = rng.uniform(0, TURN), rng.uniform(-0.5, 0.5, 2) * rng.choice([0, 0.1, 1, 3])
        cos, sin = math.cos(yaw), math.sin(yaw)
        at = outline.corners @ np.array([(cos, sin), (-sin, cos)]) + (x, y)
        both = np.vstack([at, at + (tx, ty)])
        body = shapely.MultiPoint(both).convex_hull
        apart = [body.distance(shapely.Point(dx, dy)) - radius for dx, dy, radius in discs]
        room = np.minimum(both - bounds[:2], np.array(bounds[2:]) - both).min()
        expected = min([room, *apart]) - outline.reach
        found = sweep_clearance(x, y, x + tx, y + ty, yaw, outline, discs, bounds)
        if expected > BAND:
            assert found == pytest.approx(expected, abs=1e-12)
        elif expected < -BAND:
            assert found <= 0


def of_cells(outline, discs, bounds, cell=0.15):
    rows, cols = (round((bounds[k + 2] - bounds[k]) / cell) for k in (1, 0))
    bits, moves = np.zeros((rows, cols), np.uint16), np.zeros((rows, cols), np.uint8)
    args = discs, np.array(bounds), bounds[0] + cell / 2, bounds[1] + cell / 2, cell, outline.corners, outline.reach
    heading_bits(*args, bits)
    clear_moves(*args, bits, moves)
    return bits, moves


@EVERY
@pytest.mark.parametrize(("seed", "cell"), [(0, 0.15), (1, 0.4)])
def test_bits_and_moves_are_those_of_the_exact_functions(outline, seed, cell):
    discs, bounds = crowd(seed + 20, count=25, size=4.0)
    bits, moves = of_cells(outline, discs, bounds, cell)
    for r, c in np.ndindex(bits.shape):
        x, y = cell * (c + 0.5), cell * (r + 0.5)
        intervals = free_headings(x, y, outline, discs, bounds)
        for k, (dr, dc) in enumerate(DIRECTIONS):
            assert in_any(intervals, [k * math.pi / 4])[0] == bool(bits[r, c] >> k & 1)
            if bits[r, c] >> k & 1 or bits[r, c] >> 8 + k & 1:
                clear = turn_clear(x, y, k * math.pi / 4, math.pi / 4, outline, discs, bounds)
                assert clear == bool(bits[r, c] >> (8 + k) & 1)
            inside = 0 <= r + dr < bits.shape[0] and 0 <= c + dc < bits.shape[1]
            if not inside:
                assert not moves[r, c] >> k & 1
            elif bits[r, c] >> k & 1:
                swept = sweep_clearance(x, y, x + dc * cell, y + dr * cell, k * math.pi / 4, outline, discs, bounds)
                assert (swept > 0) == bool(moves[r, c] >> k & 1)
            else:
                assert not moves[r, c] >> k & 1


def test_bits_of_wide_grids_are_those_of_their_parts():
    """Rows of several words of 64 cells."""
    discs, _ = crowd(30, count=60, size=9.0)
    whole, moves = of_cells(SQUARE, discs, (0.0, 0.0, 9.0, 3.0), 0.05)
    some = np.zeros((60, 30), np.uint16)
    walls = np.array((0.0, 0.0, 9.0, 3.0))
    for first in range(0, 180, 30):
        heading_bits(discs, walls, 0.025 + 0.05 * first, 0.025, 0.05, SQUARE.corners, SQUARE.reach, some)
        np.testing.assert_array_equal(some, whole[:, first : first + 30])
    assert len(np.unique(whole)) > 30
    assert moves.any()


@EVERY
def test_nothing_around_leaves_every_heading(outline):
    np.testing.assert_array_equal(free_headings(3.0, 3.0, outline, NONE, (0, 0, 6, 6)), [[0.0, TURN]])
    assert turn_clear(3.0, 3.0, 1.0, 99.0, outline, NONE, (0, 0, 6, 6))
    assert len(free_headings(3.0, 3.0, outline, np.array([(3.0, 3.0, 0.1)]), (0, 0, 6, 6))) == 0
    assert not turn_clear(3.0, 3.0, 1.0, 0.0, outline, np.array([(3.0, 3.0, 0.1)]), (0, 0, 6, 6))


@pytest.mark.parametrize("yaw", [0.0, math.pi / 4, 2.0])
def test_touching_is_not_free(yaw):
    """A disc that touches the front, the flank or a corner, in multiples of the cell; and a wall."""
    bounds, outline = (0.0, 0.0, 6.0, 6.0), Outline(SQUARE.corners, 0.0)
    cos, sin = math.cos(yaw), math.sin(yaw)
    for px, py in ((0.75, 0.1), (0.2, 0.55), (-0.75, -0.1), (0.65, 0.5)):
        for less, free in ((0.0, False), (1e-6, True), (-1e-6, False)):
            disc = np.array([(3.0 + cos * px - sin * py, 3.0 + sin * px + cos * py, 0.25 - less)])
            assert turn_clear(3.0, 3.0, yaw, 0.0, outline, disc, bounds) is free
            assert (sweep_clearance(3.0, 3.0, 3.0, 3.0, yaw, outline, disc, bounds) > 0) is free
            bits = np.zeros((1, 1), np.uint16)
            heading_bits(disc, np.array(bounds), 3.0, 3.0, 0.05, outline.corners, 0.0, bits)
            if yaw < 1:
                assert bool(bits[0, 0] >> round(yaw / (math.pi / 4)) & 1) is free
    assert not turn_clear(0.5, 3.0, 0.0, 0.0, outline, NONE, bounds)
    assert turn_clear(0.500001, 3.0, 0.0, 0.0, outline, NONE, bounds)
    assert sweep_clearance(0.5, 3.0, 1.0, 3.0, 0.0, outline, NONE, bounds) == 0.0


@pytest.mark.parametrize(
    ("x", "y", "turns"),
    [(0.575, 3.0, 0b01100110), (5.425, 3.0, 0b01100110), (3.0, 0.575, 0b10011001), (3.0, 5.425, 0b10011001)],
)
def test_a_wall_stops_a_turn_between_two_free_headings(x, y, turns):
    """0.575 m from a wall all eight headings are free, but the corner at 0.583 m does not pass at 31° from it."""
    bits = np.zeros((1, 1), np.uint16)
    heading_bits(NONE, np.array((0.0, 0.0, 6.0, 6.0)), x, y, 0.05, SQUARE.corners, 0.0, bits)
    assert bits[0, 0] == turns << 8 | 0xFF


@given(outlines(), st.floats(-3, 3), st.integers(0, 30))
@settings(max_examples=25, deadline=None)
def test_rotating_everything_rotates_the_intervals(outline, angle, seed):
    discs, _ = crowd(seed, count=6, size=2.0)
    discs[:, :2] -= 1.0
    cos, sin = math.cos(angle), math.sin(angle)
    turned = np.column_stack([discs[:, :2] @ np.array([(cos, sin), (-sin, cos)]), discs[:, 2]])
    yaws = np.linspace(0, TURN, 90)
    far = (-50, -50, 50, 50)
    before, after = (free_headings(0.0, 0.0, outline, these, far) for these in (discs, turned))
    sure = np.abs(gap(outline, 0.0, 0.0, yaws, discs, far)) > BAND
    assert (in_any(before, yaws) == in_any(after, yaws + angle))[sure].all()


@given(st.floats(0.05, 0.6), st.integers(0, 30))
@settings(max_examples=15, deadline=None)
def test_a_disc_has_all_headings_or_none(radius, seed):
    discs, bounds = crowd(seed, count=10, size=3.0)
    bits, _ = of_cells(Outline(np.zeros((1, 2)), radius), discs, bounds)
    assert set(np.unique(bits)) <= {0, 0xFFFF}
    assert len(free_headings(1.5, 1.5, Outline(np.zeros((1, 2)), radius), discs, bounds)) in (0, 1)
