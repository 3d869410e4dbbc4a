"""Whether the last scan met something where a route leads, against the same with numpy."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from antdrive.sim.driving._kernels_hits import beside, hit_within, point_at


@settings(max_examples=60, deadline=None)
@given(st.integers(0, 10_000))
def test_a_route_is_met_where_a_hit_is_nearer_than_it_needs(seed: int) -> None:
    rng = np.random.default_rng(seed)
    angles = np.sort(rng.uniform(-2, 2, 40))
    beams, ranges = np.column_stack((np.cos(angles), np.sin(angles))), rng.uniform(0.5, 6, 40)
    ranges[::7], ranges[::11] = np.inf, -np.inf
    points, needed, ahead = rng.uniform(-3, 3, (9, 2)), rng.uniform(0, 0.3, 9), np.sort(rng.uniform(0, 3, 9))
    x, y, yaw = rng.uniform(-1, 1, 3).tolist()
    turned = beams @ np.array([[np.cos(yaw), np.sin(yaw)], [-np.sin(yaw), np.cos(yaw)]])
    ends = (np.array([x, y]) + ranges[:, None] * turned)[np.isfinite(ranges)]
    room = np.hypot(*(points[:, None] - ends).transpose(2, 0, 1)).min(axis=1)
    expected = bool((room < needed - (0.01 + 0.02 * ahead)).any())
    assert hit_within(points, needed, ahead, 0.01, 0.02, x, y, yaw, beams, ranges) == expected


def test_a_point_of_a_route_is_interpolated() -> None:
    xy, arc = np.array([[0.0, 0.0], [2.0, 0.0], [2.0, 1.0]]), np.array([0.0, 2.0, 3.0])
    for at in (-1.0, 0.0, 0.5, 2.0, 2.25, 3.0, 9.0):
        assert point_at(xy, arc, at) == (np.interp(at, arc, xy[:, 0]), np.interp(at, arc, xy[:, 1]))


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 10_000))
def test_what_covers_a_place_is_left_out(seed: int) -> None:
    rng = np.random.default_rng(seed)
    discs = np.column_stack((rng.uniform(-1, 1, (30, 2)), rng.uniform(0, 0.5, 30)))
    places = rng.uniform(-1, 1, (2, 2))
    clear = np.all([np.hypot(*(discs[:, :2] - place).T) > discs[:, 2] + 0.1 for place in places], axis=0)
    assert np.array_equal(beside(discs, places, 0.1), discs[clear])
