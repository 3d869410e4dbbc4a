"""Shares, rooms and doors of floors with known ones."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from antdrive.base.errors import FieldError
from antdrive.worlds import Disc, World, forest, rasterise
from antdrive.worlds.coverage import coverage
from antdrive.worlds.generators.generate import OFFICE_DOORS, office


def two_rooms(gaps):
    """Two rooms of 4 x 6 m; the wall between them has openings (middle, width)."""
    ys = np.arange(0.0, 6.001, 0.05)
    clear = [y for y in ys.tolist() if all(abs(y - at) > width / 2 + 0.05 for at, width in gaps)]
    ends = [at + side * (width / 2 + 0.05) for at, width in gaps for side in (-1, 1)]
    return World("rooms", (0.0, 0.0, 8.0, 6.0), tuple(Disc(4.0, y, 0.05) for y in sorted({*clear, *ends})))


def covered(world, inflate, start=(1.0, 3.0), cell=0.1):
    return coverage(world, [rasterise(world, cell, inflate)], start)[0]


def test_an_empty_room_is_one_room_and_its_share_is_that_of_its_cells():
    result = covered(World("room", (0.0, 0.0, 4.0, 3.0)), 0.5, (1.0, 1.0))
    assert (result.room_count, result.rooms_reached, result.doors) == (1, {0}, ())
    assert result.share == (30 * 20) / (40 * 30)


@pytest.mark.parametrize("cell", [0.1, 0.25])
def test_a_door_that_is_reached_from_one_side_only_is_not_passed(cell):
    """The robot fits beside the wall's line, where the gap is a little wider, but not on it."""
    world = two_rooms([(3.05, 0.9)])
    for start in ((1.0, 3.0), (7.0, 3.0)):
        fine, coarse = coverage(world, [rasterise(world, each, 0.451) for each in (0.1, cell)], start)
        assert fine.reached[30, 39 if start[0] < 4 else 40]
        assert [door.passed for each in (fine, coarse) for door in each.doors] == [False, False]


@pytest.mark.parametrize("start", [(1.2, 1.2), (6.8, 1.2)])
def test_a_room_is_reached_only_through_a_passed_door(start):
    """The border lies up to some fine cells off the door's line, within the last coarse cell before it."""
    world = two_rooms([(1.3, 0.71), (3.7, 0.48)])
    for each in coverage(world, [rasterise(world, cell, 0.36) for cell in (0.5, 0.05)], start):
        assert [door.passed for door in each.doors] == [False, False]
        assert len(each.rooms_reached) == 1


def walled(*walls):
    """A floor of 9 x 5 m; walls of overlapping discs (along axis, at, from, opening's middle, width) end at its sides."""
    discs = []
    for axis, at, first, middle, width in walls:
        for low, high in ((first, middle - width / 2 - 0.1), (middle + width / 2 + 0.1, (9.0, 5.0)[axis])):
            along = np.linspace(low, high, math.ceil((high - low) / 0.15) + 1).tolist()
            discs += [Disc(*((s, at) if axis == 0 else (at, s)), 0.1) for s in along]
    return World("walled", (0.0, 0.0, 9.0, 5.0), tuple(discs))


@pytest.mark.parametrize(
    "walls",
    [
        [(1, 3.0, 0.0, 2.69, 0.71), (1, 6.0, 0.0, 2.1, 0.77)],
        [(1, 4.5, 0.0, 1.25, 0.84), (0, 2.5, 4.7, 6.9, 1.39)],
        [(1, 4.5, 0.0, 3.75, 0.46)],
    ],
)
def test_cells_of_half_a_metre_find_the_doors_and_none_inside_a_wall(walls):
    """They see the floor's sides behind the walls' ends, and their middles lie 0.25 m off a wall's line."""
    found = covered(walled(*walls), 0.2, (1.2, 1.2), 0.5).doors
    real = [(*((at, middle) if axis else (middle, at)), width) for axis, at, _, middle, width in walls]
    assert [(*door.at, door.width) for door in found] == [pytest.approx(door) for door in real]


def doors_driven(world, cell, inflate, doors):
    """Oracle: the doors (x, y, width) that a flood fill from the middle of the first room drives through."""
    discs, (_, _, width, height) = world.discs, world.bounds
    shape = round(height / cell), round(width / cell)
    points = cell * (np.stack(np.indices(shape)[::-1], axis=-1) + 0.5)
    walls = np.minimum(points, (width, height) - points).min(axis=-1)

    def clear(dr, dc):
        """Return whether a move of this many rows and columns from each cell (R, C) touches no disc."""
        way, away = cell * np.array([dc, dr]), discs[:, :2] - points[:, :, None]
        part = (away @ way / max(way @ way, 1e-12)).clip(0, 1)
        return (np.hypot(*np.moveaxis(away - part[..., None] * way, 3, 0)) - discs[:, 2]).min(axis=2) > inflate

    ways = [(dr, dc) for dr in (-1, 0, 1) for dc in (-1, 0, 1) if dr or dc]
    moves, free = {way: clear(*way) for way in ways}, clear(0, 0) & (walls > inflate)
    todo, driven = [(shape[0] // 2, round(1 / cell))], set()
    seen = set(todo)
    while todo:
        r, c = todo.pop()
        for dr, dc in ways:
            there = r + dr, c + dc
            if not (moves[dr, dc][r, c] and free[there] and free[r + dr, c] and free[r, c + dc]):
                continue
            middle = (points[r, c] + points[there]) / 2
            over = [(points[r, c, 0] < door[0]) != (points[there][0] < door[0]) for door in doors]
            driven |= {door for door, on in zip(doors, over, strict=True) if on and abs(middle[1] - door[1]) < 0.6}
            todo += {there} - seen
            seen.add(there)
    return driven


@settings(max_examples=8, deadline=None)
@given(
    st.lists(st.floats(0.5, 1.1), min_size=3, max_size=3),
    st.lists(st.floats(0.9, 1.1), min_size=3, max_size=3),
    st.floats(0.25, 0.55),
    st.sampled_from([0.1, 0.2]),
)
def test_a_door_is_passed_exactly_if_a_flood_fill_drives_through_it(widths, middles, inflate, cell):
    """Two walls part three rooms of 2 x 4 m; the first wall has two doors."""
    (first, second, third), (low, high, single) = widths, middles
    doors, discs = [(2.0, low, first), (2.0, high + 2, second), (4.0, single, third)], []
    for x in (2.0, 4.0):
        gaps = [(at, width) for wall, at, width in doors if wall == x]
        rims = [at + side * (width / 2 + 0.05) for at, width in gaps for side in (-1, 1)]
        solid = [y for y in np.arange(0, 4.001, 0.08) if all(abs(y - at) > width / 2 + 0.05 for at, width in gaps)]
        discs += [Disc(x, float(y), 0.05) for y in (*solid, *rims)]
    world = World("rooms", (0.0, 0.0, 6.0, 4.0), tuple(discs))
    driven = doors_driven(world, cell, inflate, doors)
    result = coverage(world, [rasterise(world, each, inflate) for each in (0.1, cell)], (1.05, 2.05))[1]
    found = result.doors
    assert len(found) == len(doors)
    entered = bool(driven & set(doors[:2]))
    assert len(result.rooms_reached) == 1 + entered + (entered and doors[2] in driven)
    for door in found:
        near = min(doors, key=lambda one: np.hypot(one[0] - door.at[0], one[1] - door.at[1]))
        assert door.width == pytest.approx(near[2])
        assert door.passed == (near in driven)


def test_a_closed_room_is_no_part_of_the_floor():
    result = covered(two_rooms([]), 0.2)
    assert result.room_count == 1
    assert not result.doors
    assert result.floor[:, 40:].sum() == 0


def test_crossing_corridors_are_one_room():
    """The clearance between the crossing and its arms falls to 1 / sqrt(2)."""
    along = np.arange(1.05, 4.0, 0.1).tolist()
    rims = {(a, b) for s in along for a, b in ((1.05, s), (s, 1.05))}
    corners = [Disc(4 + u * a, 4 + v * b, 0.05) for u in (-1, 1) for v in (-1, 1) for a, b in sorted(rims)]
    world = World("crossing", (0.0, 0.0, 8.0, 8.0), tuple(corners))
    assert covered(world, 0.3, (4.0, 4.0)).room_count == 1


@settings(max_examples=8, deadline=None)
@given(st.integers(0, 100), st.floats(0.05, 0.6), st.floats(0.01, 0.5))
def test_a_larger_robot_never_reaches_more(seed, inflate, more):
    task = forest(np.random.default_rng(seed))
    small, large = (covered(task.world, size, task.start[:2], 0.25) for size in (inflate, inflate + more))
    assert not (large.reached & ~small.reached).any()
    assert large.share <= small.share
    assert large.rooms_reached <= small.rooms_reached
    assert all(not far.passed or near.passed for near, far in zip(small.doors, large.doors, strict=True))


@pytest.mark.parametrize("seed", [0, pytest.param(7, marks=pytest.mark.slow)])
def test_every_door_of_an_office_is_found_with_its_width(seed):
    task = office(np.random.default_rng(seed))
    result = covered(task.world, 0.7, task.start[:2])  # a courier of 0.9 x 0.6 m, 0.15 m ahead of its axle
    assert [round(door.width, 3) for door in result.doors] == sorted(OFFICE_DOORS)
    assert [door.passed for door in result.doors] == [False] * 9 + [True]
    assert (result.room_count, len(result.rooms_reached)) == (11, 2)
    assert 0.12 < result.share < 0.14
    jackal = covered(task.world, 0.363, task.start[:2])
    assert len(jackal.rooms_reached) == 11
    assert 0.8 < jackal.share < 0.9


@pytest.mark.parametrize(("key", "value"), [("doors", (0.0, 1.0)), ("corridor", 0.5), ("radius", 1.0)])
def test_an_office_names_a_wrong_size(key, value):
    with pytest.raises(FieldError, match=key):
        office(np.random.default_rng(0), **{key: value})
