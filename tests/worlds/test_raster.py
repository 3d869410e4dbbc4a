"""Rasters that follow changing discs against rasterising each list from scratch."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from antdrive.worlds import World, rasterise
from antdrive.worlds._kernels_raster import differences
from antdrive.worlds.raster import Raster
from antdrive.worlds.world import PointWorld

BOUNDS = (-1.3, 2.1, 7.7, 9.0)


def changed_at_random(rng, discs, cell, *, snapped):
    """Drop some discs, shift some, add some, and sometimes shuffle; snapped ones have cell centres on their rims."""
    discs = discs[rng.random(len(discs)) > 0.3]
    moved = rng.random(len(discs)) < 0.4
    discs[moved] += np.abs(rng.normal(0, 0.01, (int(moved.sum()), 3)))
    count = int(rng.integers(0, 12))
    new = np.column_stack([rng.uniform(-2, 9, count), rng.uniform(1, 10, count), rng.uniform(0.01, 0.6, count)])
    discs = np.concatenate([discs, new])
    if snapped:
        discs = np.maximum(np.round(2 * discs / cell) * cell / 2, (-np.inf, -np.inf, cell / 2))
    if rng.random() < 0.3:
        rng.shuffle(discs)
    return discs


@settings(max_examples=30, deadline=None)
@given(
    st.integers(0, 2**32 - 1),
    st.sampled_from([0.05, 0.1, 0.25, 0.31]),
    st.sampled_from([0.0, 0.02, 0.1, 0.25, 0.46, 1.0]),
    st.booleans(),
)
def test_a_raster_has_the_bits_of_rasterising_and_names_all_changes(seed, cell, inflate, snapped):
    rng = np.random.default_rng(seed)
    raster, discs = Raster(BOUNDS, cell, inflate), np.empty((0, 3))
    first = raster.grid.free.copy(), raster.grid.moves.copy()
    for _ in range(6):
        before, updates = (raster.grid.free.copy(), raster.grid.moves.copy()), raster.updates
        discs = changed_at_random(rng, discs, cell, snapped=snapped)
        raster.update(discs)
        whole = rasterise(PointWorld.of("whole", BOUNDS, discs), cell, inflate)
        assert (whole.origin, whole.cell, whole.inflate) == (raster.grid.origin, cell, inflate)
        np.testing.assert_array_equal(raster.grid.free, whole.free)
        np.testing.assert_array_equal(raster.grid.moves, whole.moves)
        for since, (free, moves) in ((updates, before), (0, first)):
            differ = np.flatnonzero((free != whole.free) | (moves != whole.moves))
            named = raster.changed_since(since)
            assert np.isin(differ, named).all()
            if since == updates:
                np.testing.assert_array_equal(named, differ)
            assert (np.diff(named) > 0).all()


def test_an_update_with_the_same_discs_changes_nothing():
    raster, discs = Raster(BOUNDS, 0.1, 0.2), np.array([(2.0, 4.0, 0.5)])
    raster.update(discs)
    assert raster.updates == 1
    raster.update(discs.copy())
    assert raster.updates == 1
    assert len(raster.changed_since(1)) == 0


def test_a_raster_s_grid_cannot_be_written():
    raster = Raster(BOUNDS, 0.5, 0.2)
    for array in (raster.grid.free, raster.grid.moves):
        with pytest.raises(ValueError, match="read-only"):
            array[0, 0] = 1
    assert not rasterise(World("empty", BOUNDS), 0.5, 0.2).free.flags.writeable


@settings(max_examples=30, deadline=None)
@given(st.lists(st.integers(0, 6), max_size=20), st.lists(st.integers(0, 6), max_size=20))
def test_differences_leave_equal_lists(old, new):
    """The rows outside the pairs are the same in both lists, in the same order."""
    a, b = (np.repeat(np.array(rows, dtype=float).reshape(-1, 1), 3, axis=1) for rows in (old, new))
    pairs = np.empty((len(a) + len(b), 2), dtype=np.int64)
    pairs = pairs[: differences(a, b, pairs)]
    rest = [np.delete(rows, pairs[pairs[:, side] >= 0, side], axis=0).tolist() for side, rows in enumerate((a, b))]
    assert rest[0] == rest[1]
    assert (pairs >= 0).any(axis=1).all()


def test_differences_find_a_removed_and_an_added_row():
    old = np.arange(30.0).reshape(10, 3)
    new = np.concatenate([old[:2], old[3:7], [(0.5, 0.5, 0.5)], old[7:]])
    pairs = np.empty((20, 2), dtype=np.int64)
    assert pairs[: differences(old, new, pairs)].tolist() == [[2, -1], [-1, 6]]
