"""The smoothing kernels' shortcuts change no result: the oracles check everything with numpy."""

import math

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from antdrive.planners.smoothing import _kernels_smooth as kernels

seeds = st.integers(0, 10_000)


def winding(loop, points):
    """Return a closed polyline's winding numbers around points: the sum of the angles of its sides."""
    ends = loop[None] - points[:, None]
    angles = np.arctan2(ends[..., 1], ends[..., 0])
    turns = np.diff(np.column_stack((angles, angles[:, :1])), axis=1)
    return np.asarray(np.rint((turns - 2 * np.pi * np.rint(turns / (2 * np.pi))).sum(axis=1) / (2 * np.pi)))


@settings(max_examples=25, deadline=None)
@given(seeds, st.floats(0.1, 3.0))
def test_a_loop_encloses_what_it_winds_around(seed, height):
    rng = np.random.default_rng(seed)
    scale = np.array([4.0, height])
    there, back = (rng.uniform(-1, 1, (size, 2)) * scale for size in (9, 6))
    back[[0, -1]] = there[[0, -1]]
    points = rng.uniform(-1.1, 1.1, (12, 2)) * scale
    around = winding(np.vstack((there, back[-2:0:-1])), points) != 0
    assert [kernels.encloses(there, back, point[None]) for point in points] == around.tolist()
    assert kernels.encloses(there, back, points) == around.any()


@settings(max_examples=25, deadline=None)
@given(seeds, st.booleans())
def test_discs_within_others_are_omitted(seed, tall):
    rng = np.random.default_rng(seed)
    discs = np.column_stack(
        (rng.uniform(0, 1, (40, 2)) * ((0.3, 2.0) if tall else (2.0, 0.3)), rng.uniform(0, 0.3, 40))
    )
    discs[7] = discs[21]
    apart = np.hypot(*(discs[:, None, :2] - discs[None, :, :2]).transpose(2, 0, 1))
    within = apart + discs[:, None, 2] - discs[None, :, 2] < -1e-9
    equal = np.tril(apart + abs(discs[:, None, 2] - discs[None, :, 2]) == 0, -1)
    assert np.array_equal(kernels.outermost(discs), ~(within | equal).any(axis=1))


@settings(max_examples=25, deadline=None)
@given(seeds)
def test_a_gap_that_the_line_passes_is_split_evenly(seed):
    """Each disc may grow by half of the narrowest gap that the line passes."""
    rng = np.random.default_rng(seed)
    discs = np.column_stack((rng.uniform(-2, 2, 30), rng.uniform(-9, 9, 30), rng.uniform(0.2, 0.5, 30)))
    xy = np.column_stack((0.3 * np.sin(np.arange(20)), np.linspace(-9.5, 9.5, 20)))
    box, ends, most = np.array([-2.5, -10.0, 2.5, 10.0]), xy[[0, -1]], 0.2
    room = np.empty(30)
    kernels.room_to_grow(xy, discs, box, ends, most, room)
    expected = np.clip(np.min([np.hypot(*(discs[:, :2] - e).T) - discs[:, 2] - 1e-6 for e in ends], axis=0), 0, most)
    for i, (x, y, r) in enumerate(discs):
        feet = [(2.5, y), (x, 10.0), (-2.5, y), (x, -10.0), *discs[:, :2]]
        gaps = [2.5 - x - r, 10 - y - r, x + 2.5 - r, y + 10 - r]
        gaps += [math.dist((x, y), d[:2]) - r - d[2] for d in discs]
        for j, (foot, gap) in enumerate(zip(feet, gaps, strict=True)):
            if j != 4 + i and gap >= (0.0 if j < 4 else -1e-9) and kernels.crosses(xy, x, y, *foot):
                expected[i] = min(expected[i], max(0.49 * gap, 0.0))
    np.testing.assert_allclose(room, expected, rtol=0, atol=1e-12)


@settings(max_examples=40, deadline=None)
@given(seeds, st.floats(0.0, 4.0), st.sampled_from([1.0, -1.0]))
def test_every_direction_of_an_arc_is_covered(seed, sweep, turn):
    rng = np.random.default_rng(seed)
    begin, (x, y) = rng.uniform(0, 2 * np.pi), rng.uniform(-1, 1, 2).tolist()
    bx, by = 0.4 * math.cos(begin), 0.4 * math.sin(begin)
    ahead = (turn * (math.atan2(y, x) - begin)) % (2 * math.pi)
    outside = kernels.outside(x, y, kernels.wedge_of(bx, by, turn, sweep))
    assert not (outside and ahead <= sweep)
    if 1e-3 < sweep < 1.5 and ahead > sweep + 1e-3:
        assert outside
