"""The map holds every hit, calls free only what beams have passed, and lets go of what has moved on."""

import dataclasses
import math

import hypothesis
import numpy as np
import pytest
from hypothesis import strategies as st

from antdrive.robots import Footprint, Lidar
from antdrive.sim.driving.senses import start_ground
from antdrive.sim.sensing import OccupancyMap, Scanner, clear_way, shape_of
from antdrive.sim.sensing._kernels_mapping import SQUARE, begins
from antdrive.worlds import Disc, World

EYE = Lidar(beams=240, field_of_view=4.7, min_range=0.1, max_range=6.0, rate=10.0, resolution=0.01, sigma=0.003, x=0.1)
POSTS = np.array([[2.0, 0.4, 0.3], [1.0, -1.2, 0.2], [3.5, 1.5, 0.4]])


def inside(points, discs):
    away = np.hypot(*(points[:, None, :] - discs[None, :, :2]).transpose(2, 0, 1))
    return np.any(away <= discs[:, 2], axis=1)


def clear_distance(grid, pose, speed, yaw_rate, foot, limit, **more):
    return clear_way(grid, pose, speed, yaw_rate, shape_of(foot), limit, **more)


def clear_turn(grid, pose, yaw_rate, foot, limit, **more):
    return clear_way(grid, pose, 0.0, yaw_rate, shape_of(foot), limit, **more)


def cell_of(found, x, y):
    return math.floor((y - found.origin[1]) / found.cell), math.floor((x - found.origin[0]) / found.cell)


def test_beams_are_needed_from_where_their_neighbours_miss_a_cell():
    """Every second, fourth, ... beam is enough nearer by."""
    out = np.empty(9)
    begins(9, 0.01, 0.05, out)
    odd = 0.05 / (2 * 0.01)
    assert out == pytest.approx([0.0, odd, odd / 2, odd, odd / 4, odd, odd / 2, odd, odd / 8])


def test_unknown_ground_stops_a_turn_unless_it_counts_as_free():
    grid = OccupancyMap(EYE, 0.05)
    assert clear_turn(grid, (0.0, 0.0, 0.0), 1.0, Footprint.rectangle(0.5, 0.3), 2.0) < 0.01
    assert clear_turn(grid, (0.0, 0.0, 0.0), 1.0, Footprint.rectangle(0.5, 0.3), 2.0, freespace=True) == 2.0


def test_a_way_ends_where_the_map_does():
    grid, foot = OccupancyMap(EYE, 0.05, horizon=3.0, bounds=(-2.0, -1.0, 3.0, 4.0)), Footprint.disc(0.2)
    (x, y), (rows, cols) = grid.origin, grid.seen_free.shape
    sides = -x, -y, x + 0.05 * cols, y + 0.05 * rows
    assert len({round(side, 3) for side in sides}) > 2
    for yaw, side in zip((math.pi, -math.pi / 2, 0.0, math.pi / 2), sides, strict=True):
        way = clear_distance(grid, (0.0, 0.0, yaw), 1.0, 0.0, foot, 50.0, freespace=True)
        assert way == pytest.approx(side - 0.2, abs=0.06)


def test_what_a_map_shows_cannot_be_written():
    grid = OccupancyMap(EYE, 0.05)
    for mask in (grid.seen_free, grid.occupied):
        with pytest.raises(ValueError, match="read-only"):
            mask[0, 0] = True


worlds = st.lists(st.tuples(st.floats(-5, 5), st.floats(-5, 5), st.floats(0.02, 1.0)), min_size=1, max_size=8)
poses = st.lists(st.tuples(st.floats(-8, 8), st.floats(-8, 8), st.floats(-4, 4)), min_size=1, max_size=3)


@hypothesis.settings(max_examples=15)
@hypothesis.given(worlds, poses, st.sampled_from([0.03, 0.05, 0.1, 0.25]), st.sampled_from([1, 3]), st.integers(0, 9))
def test_every_hit_lies_in_a_disc_whose_size_is_bounded(found, ways, cell, share, seed):
    """Those of the first scan, which is entered as a whole, and those of the scans between whole ones."""
    scanner, rng = Scanner(EYE, np.array(found)), np.random.default_rng(seed)
    grid = OccupancyMap(EYE, cell, horizon=4.0, share=share)
    for pose in ways:
        ranges = scanner.scan(pose, rng=rng)
        grid.insert(pose, ranges)
        ends = grid.endpoints(pose, ranges)[np.isfinite(ranges) & (ranges <= 4.0)]
        discs = grid.discs()
        assert np.all(inside(ends, discs)) if len(ends) else len(discs) >= 0
        assert np.all(discs[:, 2] <= max(0.5 * math.hypot(cell, cell) / 2, 0.005) + 2e-4)


@hypothesis.settings(max_examples=15)
@hypothesis.given(worlds, poses)
def test_free_ground_was_crossed_by_a_beam_and_no_beam_ended_there(found, ways):
    """The oracle samples the beams of all scans at steps of a tenth of a cell."""
    scanner = Scanner(EYE, np.array(found))
    grid = OccupancyMap(EYE, 0.1, horizon=4.0, bounds=(-20.0, -20.0, 20.0, 20.0))
    cells = set()
    for pose in ways:
        ranges = scanner.scan(pose)
        grid.insert(pose, ranges)
        x, y, _ = EYE.pose_on(pose)
        angles, lengths = EYE.angles + pose[2], np.minimum(ranges, grid.trust)
        t = np.minimum(np.arange(0.0, grid.trust + 0.01, 0.01)[:, None], lengths)[:, lengths > 0]
        samples = np.stack((y + t * np.sin(angles[lengths > 0]), x + t * np.cos(angles[lengths > 0])), axis=-1)
        indices = np.floor((samples - grid.origin[::-1]) / 0.1).astype(np.int64).reshape(-1, 2)
        keys = np.unique(indices[:, 0] * 100_000 + indices[:, 1])
        cells |= set(zip((keys // 100_000).tolist(), (keys % 100_000).tolist(), strict=True))
    free = set(map(tuple, np.argwhere(grid.seen_free).tolist()))
    # Samples miss cells whose corners a beam cuts by less than their step.
    near = {(r + dr, c + dc) for r, c in cells for dr in (-1, 0, 1) for dc in (-1, 0, 1)}
    assert len(free - cells) <= 0.15 * len(free)
    assert free <= near
    assert not np.any(grid.seen_free & grid.occupied)


def crossed(start, angle, length, grow, shape):
    """How long a beam is within each cell of 5 cm [m]: where it enters and leaves each square, grown on all sides."""
    enters, leaves = np.zeros(shape), np.full(shape, length)
    for axis, direction in ((1, math.cos(angle)), (0, math.sin(angle))):
        low = (np.arange(shape[axis]) * 0.05 - grow - start[1 - axis]).reshape((-1, 1) if axis == 0 else (1, -1))
        high = low + 0.05 + 2 * grow
        if abs(direction) < 1e-12:
            leaves = np.where((low <= 0) & (high >= 0), leaves, -1.0)
            continue
        sides = low / direction, high / direction
        enters, leaves = np.maximum(enters, np.minimum(*sides)), np.minimum(leaves, np.maximum(*sides))
    return leaves - enters


@hypothesis.settings(max_examples=30)
@hypothesis.given(st.floats(0.01, 2.99), st.floats(0.01, 1.99), st.floats(-4, 4), st.floats(0.3, 6.0))
def test_a_beam_frees_the_cells_that_it_crosses_and_no_others(x, y, yaw, length):
    """Also where it leaves the map. Cells of which it cuts a nanometre may be either."""
    one = Lidar(beams=3, field_of_view=3.0, min_range=0.01, max_range=8.0, rate=10.0, resolution=0.0, sigma=0.0)
    grid = OccupancyMap(one, 0.05, horizon=0.02, bounds=(0.0, 0.0, 3.0, 2.0))
    grid.trust = 8.0
    grid.insert((x, y, yaw), np.array([length, -math.inf, -math.inf]))
    less, more = (crossed(np.array([x, y]), yaw - 1.5, length, grow, grid.seen_free.shape) for grow in (-1e-9, 1e-9))
    assert grid.seen_free[less > 0].all()
    assert not grid.seen_free[more < 0].any()


def test_a_beam_that_is_left_out_near_the_lidar_leaves_no_ground_unseen():
    grid = OccupancyMap(EYE, 0.05)
    grid.insert((0, 0, 0), np.full(EYE.beams, np.inf))
    for away in (0.2, 0.5, 1.0, 2.0):
        for angle in np.linspace(-2.2, 2.2, 60):
            assert grid.seen_free[cell_of(grid, 0.1 + away * math.cos(angle), away * math.sin(angle))]
    assert not grid.seen_free[cell_of(grid, -1.0, 0.0)]  # the blind wedge
    assert grid.trust == pytest.approx(0.05 / EYE.spacing)
    assert not grid.seen_free[cell_of(grid, 0.1 + grid.trust + 0.15, 0.0)]


def test_something_too_near_to_be_measured_leaves_its_beam_unknown():
    grid = OccupancyMap(EYE)
    assert len(grid.insert((0, 0, 0), np.full(EYE.beams, -np.inf))) == 0


def test_changes_are_returned_cell_by_cell():
    scanner, grid, rng = Scanner(EYE, POSTS), OccupancyMap(EYE), np.random.default_rng(1)
    free, occupied = grid.seen_free.copy(), grid.occupied.copy()
    for k in range(30):
        pose = (0.03 * k, 0.01 * k, 0.02 * k)
        changed = grid.insert(pose, scanner.scan(pose, rng=rng))
        differ = np.argwhere((free != grid.seen_free) | (occupied != grid.occupied))
        assert sorted(map(tuple, changed.tolist())) == sorted(map(tuple, differ.tolist()))
        free, occupied = grid.seen_free.copy(), grid.occupied.copy()
    assert occupied.any()
    assert len(grid.arrays.cells[: grid.arrays.count[0]]) == occupied.sum()


def test_what_has_moved_on_is_free_again_after_nine_scans():
    scanner, grid = Scanner(EYE, np.empty((0, 3)), bounds=(-4.0, -4.0, 4.0, 4.0)), OccupancyMap(EYE)
    for _ in range(20):
        grid.insert((0, 0, 0), scanner.scan((0, 0, 0), np.array([[1.52, 0.02]]), np.array([0.3])))
    here = cell_of(grid, 1.22, 0.02)
    assert grid.occupied[here]
    for _ in range(8):
        grid.insert((0, 0, 0), scanner.scan((0, 0, 0)))
    assert grid.occupied[here]
    grid.insert((0, 0, 0), scanner.scan((0, 0, 0)))
    assert grid.seen_free[here]
    near = np.hypot(*(grid.discs()[:, :2] - (1.5, 0.0)).T) < 0.5
    assert not near.any()


def test_what_stands_still_stays_while_the_robot_drives_past():
    """Beams that pass beside hits, through the same cells, do not wear them away."""
    scanner, grid, rng = Scanner(EYE, POSTS), OccupancyMap(EYE), np.random.default_rng(3)
    ends = []
    for k in range(200):
        pose = (0.02 * k, -0.5, 0.0)
        ranges = scanner.scan(pose, rng=rng)
        grid.insert(pose, ranges)
        ends.append(grid.endpoints(pose, ranges)[np.isfinite(ranges) & (np.abs(ranges) < 3)])
    points, discs = np.concatenate(ends), grid.discs()
    assert np.mean(inside(points, discs)) > 0.97


def test_discs_stand_out_of_the_surface_by_half_a_grain():
    scanner, grid = Scanner(EYE, POSTS), OccupancyMap(EYE, 0.05)
    for k in range(100):
        pose = (0.02 * k, -0.5, 0.0)
        grid.insert(pose, scanner.scan(pose))
    discs = grid.discs()
    away = np.hypot(*(discs[:, None, :2] - POSTS[None, :, :2]).transpose(2, 0, 1)) - POSTS[:, 2]
    assert np.max(discs[:, 2] + np.min(away, axis=1)) < 0.03 + 0.01  # a grain's diagonal, and rounding
    assert np.median(discs[:, 2] + np.min(away, axis=1)) < 0.02


def test_a_map_grows_and_keeps_what_it_holds():
    scanner = Scanner(EYE, POSTS)
    small = OccupancyMap(EYE, horizon=3.0)
    laid_out = OccupancyMap(EYE, horizon=3.0, goal=(-9.9, 8.8))
    large = OccupancyMap(EYE, horizon=3.0, bounds=(-30.0, -30.0, 30.0, 30.0))
    for k in range(12):
        pose = (-0.9 * k, 0.8 * k, 2.0 - 0.1 * k)
        ranges = scanner.scan(pose)
        for grid in (small, laid_out, large):
            grid.insert(pose, ranges)
    assert small.layouts > laid_out.layouts == 1
    assert small.seen_free.sum() == laid_out.seen_free.sum() == large.seen_free.sum()
    discs = [grid.discs()[np.lexsort(grid.discs().T)] for grid in (small, laid_out, large)]
    np.testing.assert_allclose(discs[:2], [discs[2]] * 2, atol=1e-6)
    cells = [
        np.argwhere(grid.occupied) + np.round(np.divide(grid.origin[::-1], 0.05)) for grid in (small, laid_out, large)
    ]
    assert cells[0].tolist() == cells[1].tolist() == cells[2].tolist()


def test_nothing_is_entered_beyond_fixed_bounds():
    grid = OccupancyMap(EYE, bounds=(-1.0, -1.0, 1.0, 1.0))
    grid.insert((0, 0, 0), Scanner(EYE, POSTS).scan((0, 0, 0)))
    assert grid.layouts == 1
    assert np.all(np.abs(grid.discs()[:, :2]) <= 1.0)


def test_ground_under_the_robot_can_be_taken_as_free():
    grid = OccupancyMap(EYE)
    found = grid.mark_free((0.0, 0.0), 0.3)
    assert len(found) == grid.seen_free.sum()
    assert 0.09 * math.pi < len(found) * 0.05**2 < 0.38**2 * math.pi
    assert len(grid.mark_free((0.0, 0.0), 0.3)) == 0


def test_ground_on_which_something_stands_is_not_taken_as_free():
    post, wall = (0.22, 0.1, 0.07), -0.17
    world = World("corner", (wall, -5.0, 5.0, 5.0), (Disc(*post),))
    taken, whole = OccupancyMap(EYE), OccupancyMap(EYE)
    whole.mark_free((0.0, 0.0), 0.3)
    taken.mark_free((0.0, 0.0), 0.3, world)
    rows, cols = np.nonzero(whole.seen_free)
    inside = np.linspace(0.0, 1.0, 21) * taken.cell  # points of a cell, from its corner
    x, y = np.meshgrid(inside, inside)
    for row, col in zip(rows, cols, strict=True):
        px, py = taken.origin[0] + col * taken.cell + x, taken.origin[1] + row * taken.cell + y
        stands = (np.hypot(px - post[0], py - post[1]) <= post[2]).any() or (px < wall - 1e-9).any()
        assert taken.seen_free[row, col] != stands, (row, col)


def test_a_robot_is_given_nothing_far_from_its_start():
    """What it is given frees the same cells of its map as the whole world would."""
    rng = np.random.default_rng(0)
    for _ in range(20):
        discs = tuple(Disc(*rng.uniform((-3, -3, 0.02), (3, 3, 0.6)).tolist()) for _ in range(12))
        world = World("w", (*rng.uniform(-3.0, -0.1, 2).tolist(), *rng.uniform(0.1, 3.0, 2).tolist()), discs)
        movers, (whole, near) = rng.uniform((-1, -1, 0.1), (1, 1, 0.3), (2, 3)), (OccupancyMap(EYE), OccupancyMap(EYE))
        ground = start_ground(world, (0.0, 0.0), 0.3, movers)
        everything = World("w", world.bounds, (*discs, *(Disc(*mover) for mover in movers.tolist())))
        whole.mark_free((0.0, 0.0), 0.3, everything)
        near.mark_free((0.0, 0.0), 0.3, ground)
        assert np.array_equal(near.seen_free, whole.seen_free)
        assert max(map(abs, ground.bounds)) <= 0.5
        assert (np.hypot(*ground.discs[:, :2].T) - ground.discs[:, 2] <= 0.5).all()


@pytest.mark.parametrize("place", [(0.31, -0.77), (9.2, -1.03), (40.0, 0.0)])
def test_a_reset_map_keeps_the_free_ground_around_a_place_and_nothing_else(place):
    old, radius = OccupancyMap(EYE), 0.6
    for x in (0.0, 8.0):
        old.insert((x, 0.0, 0.1), Scanner(EYE, POSTS).scan((x, 0.0, 0.1)))
    new = old.reset_around(place, radius, goal=(9.0, -2.0))
    free = np.argwhere(new.seen_free)
    centres = (free[:, ::-1] + 0.5) * new.cell + new.origin
    # The cells are the same ones, so a centre is one of the old map, too; those that meet the disc lie close to it.
    rows, cols = np.nonzero(old.seen_free)
    known = np.column_stack((cols + 0.5, rows + 0.5)) * old.cell + old.origin
    beyond = np.maximum(np.abs(known - place) - old.cell / 2, 0)
    expected = known[np.hypot(*beyond.T) <= radius]
    assert {*map(tuple, np.round(centres, 6).tolist())} == {*map(tuple, np.round(expected, 6).tolist())}
    assert (len(free) > 0) == (place[0] < 10)
    assert not new.occupied.any()
    squares = np.add.reduceat(
        np.add.reduceat(~new.seen_free, np.arange(0, new.seen_free.shape[0], SQUARE)),
        np.arange(0, new.seen_free.shape[1], SQUARE),
        axis=1,
    )
    assert np.array_equal(new.arrays.unseen, squares)


@pytest.mark.parametrize("fan", [4.7, 2 * math.pi])
def test_a_walker_beyond_the_range_of_free_ground_leaves_no_trail(fan):
    """Posts stay, and so do few hits beside them; a map of things that all stand keeps the trail."""
    eye = dataclasses.replace(EYE, field_of_view=fan, max_range=9.0)
    posts = np.array([[6.5, 1.5, 0.3], [5.5, -2.5, 0.3]])
    for moving in (True, False):
        grid = OccupancyMap(eye, 0.05, moving=moving)
        assert grid.trust < 4.0
        for y in np.linspace(-2.0, 2.0, 81):
            ranges = Scanner(eye, np.vstack((posts, [(5.0, y, 0.25)]))).scan((0.0, 0.0, 0.0))
            grid.insert((0.0, 0.0, 0.0), ranges)
        discs = grid.discs()
        trail = (abs(discs[:, 0] - 5.0) < 0.3) & (discs[:, 1] < 1.2)
        assert (np.count_nonzero(trail) < 6) if moving else (np.count_nonzero(trail) > 30)
        assert inside(posts[:, :2] - (0.3, 0.0), discs + (0.0, 0.0, 0.1)).all()
        assert not grid.seen_free[cell_of(grid, 5.0, -1.0)]


def test_beams_on_a_mover_can_be_omitted():
    scanner, grid = Scanner(EYE, np.empty((0, 3))), OccupancyMap(EYE)
    where, radii = np.array([[1.5, 0.0]]), np.array([0.3])
    ranges = scanner.scan((0, 0, 0), where, radii)
    grid.insert((0, 0, 0), ranges, omitted=np.isfinite(ranges))
    assert not grid.occupied.any()
    grid.insert((0, 0, 0), ranges)
    assert len(grid.discs())


def test_points_on_ground_that_was_free_are_not_explained_until_they_settle():
    scanner, grid = Scanner(EYE, POSTS), OccupancyMap(EYE)
    for _ in range(3):
        grid.insert((0, 0, 0), scanner.scan((0, 0, 0)))
    mover = np.array([[1.2, 0.5]]), np.array([0.2])
    ranges = scanner.scan((0, 0, 0), *mover)
    points = grid.endpoints((0, 0, 0), ranges)
    hit = np.isfinite(ranges)
    theirs = hit & (np.hypot(*(points - mover[0][0]).T) < 0.22)
    for _ in range(2):  # the same before the scan is entered and after it
        known = grid.explained(points[hit], settle=20)
        assert np.array_equal(known, ~theirs[hit])
        grid.insert((0, 0, 0), ranges)
    for _ in range(20):
        grid.insert((0, 0, 0), ranges)
    assert grid.explained(points[hit], settle=20).all()


def test_between_whole_scans_only_hits_are_entered(jackal):
    post, late = np.array([[2.0, 0.0, 0.2]]), np.array([[2.0, 0.0, 0.2], [1.0, 0.5, 0.1]])
    grid = OccupancyMap(jackal.lidar)
    assert (grid.share, grid.stride) == (4, 2)
    for number in range(9):  # the second post comes between two whole scans
        scanner = Scanner(jackal.lidar, post if number < 2 else late)
        ranges = scanner.scan((0.0, 0.0, 0.0), rng=np.random.default_rng(number))
        whole, free, odds = grid.whole, grid.seen_free.copy(), grid.arrays.odds.copy()
        changed = grid.insert((0.0, 0.0, 0.0), ranges)
        assert whole == (number % 4 == 0)
        assert np.all(inside(grid.endpoints((0.0, 0.0, 0.0), ranges)[np.isfinite(ranges)], grid.discs()))
        assert number != 2 or len(changed) > 0
        if not whole:
            assert not np.any(grid.seen_free & ~free)
            assert np.all((grid.arrays.odds == odds) | (odds == 0.0))  # a hit counts where there was none


@pytest.mark.parametrize("grain", [0.0, 0.025])
def test_what_comes_nearer_within_a_cell_is_known_before_the_next_whole_scan(grain):
    """A thing that moves towards the robot within a cell: within the grain that was hit first, or into the one before it."""
    eye = Lidar(beams=9, field_of_view=0.02, min_range=0.1, max_range=6.0, rate=50.0)
    grid, here = OccupancyMap(eye, bounds=(-1.0, -1.0, 3.0, 1.0)), (0.0, 0.02, 0.0)
    grid.mark_free(here[:2], 1.2)
    far, near = 1.049, 1.027 - grain
    ways = []
    for ranges in (np.full(9, far), np.full(9, near)):
        whole = grid.whole
        changed = grid.insert(here, ranges)
        ways.append(clear_distance(grid, here, 1.0, 0.0, Footprint.disc(0.2), 1.5))
    assert not whole
    assert len(changed) == 0
    assert ways == pytest.approx([far - 0.2, near - 0.2], abs=0.012)
    assert np.all(inside(grid.endpoints(here, ranges), grid.discs()))
    assert ways[1] <= near - 0.2


def test_every_beam_has_its_turn(jackal):
    """After two whole scans the ground is seen as after one of all beams."""
    scanner = Scanner(jackal.lidar, POSTS)
    grid, every = OccupancyMap(jackal.lidar), OccupancyMap(jackal.lidar)
    every.stride = 1
    for number in range(13):
        pose = (0.5, 0.2, 0.3) if number else (0.0, 0.0, 0.0)
        for found in (grid, every):
            found.insert(pose, scanner.scan(pose))
    assert np.array_equal(grid.seen_free, every.seen_free)


def test_free_squares_are_passed_without_a_difference(jackal):
    """The oracle is the same map whose squares all count as not free, so that beams walk through every cell."""
    rng = np.random.default_rng(5)
    discs = np.column_stack((rng.uniform(-6, 6, (40, 2)), rng.uniform(0.05, 0.4, 40)))
    scanner = Scanner(jackal.lidar, discs[np.hypot(discs[:, 0], discs[:, 1]) > 1.0])
    quick, walked = (OccupancyMap(jackal.lidar, share=1, horizon=8.0) for _ in range(2))
    for number in range(40):
        pose = (0.15 * number, 0.05 * number, 0.1 * number)
        ranges = scanner.scan(pose, rng=rng)
        walked.arrays.unseen[:] = 200
        assert np.array_equal(quick.insert(pose, ranges), walked.insert(pose, ranges))
        if number == 20:
            for found in (quick, walked):
                found.mark_free((0.0, 8.0), 2.0)
    assert np.array_equal(quick.seen_free, walked.seen_free)
    assert np.array_equal(quick.arrays.odds, walked.arrays.odds)
    (rows, cols), side = quick.seen_free.shape, SQUARE
    padded = np.zeros((-(-rows // side) * side, -(-cols // side) * side), dtype=bool)
    padded[:rows, :cols] = ~quick.seen_free
    counted = padded.reshape(len(padded) // side, side, -1, side).sum(axis=(1, 3))
    assert np.array_equal(quick.arrays.unseen, counted)
    assert quick.layouts > 1
    assert (counted == 0).sum() > 100


SIGHTED = Lidar(beams=240, field_of_view=4.7, min_range=0.1, max_range=6.0, rate=20.0)
BOX, ROUND = Footprint.rectangle(0.5, 0.4), Footprint.disc(0.2)


def seen(unknown, hits=(), side=3.0):
    """A map of free ground with unknown cells and hits at some unseen_places."""
    grid = OccupancyMap(SIGHTED, 0.1, bounds=(-side, -side, side, side))
    grid.arrays.free[:] = True
    for x, y in unknown:
        grid.arrays.free[math.floor((y + side) / 0.1), math.floor((x + side) / 0.1)] = False
    for x, y in hits:  # a scan of a single beam
        ranges = np.full(SIGHTED.beams, -np.inf)
        ranges[0] = 0.5
        angle = SIGHTED.angles[0]
        grid.insert((x - 0.5 * math.cos(angle), y - 0.5 * math.sin(angle), 0.0), ranges)
    return grid


def blockers(grid):
    unknown = np.argwhere(~grid.seen_free & ~grid.occupied)
    centres = (unknown[:, ::-1] + 0.5) * grid.cell + grid.origin
    return np.vstack((np.column_stack((centres, np.full(len(centres), grid.cell / math.sqrt(2)))), grid.discs()))


def gaps(discs, foot, pose):
    """Distance from a footprint to discs, from the outline's own frame."""
    x, y, yaw = pose
    cos, sin = math.cos(yaw), math.sin(yaw)
    local = (discs[:, :2] - (x, y)) @ np.array([[cos, -sin], [sin, cos]])
    over = np.abs(local) - (foot.half_length, foot.half_width)
    return np.hypot(*np.maximum(over, 0).T) + np.minimum(over.max(axis=1), 0) - foot.rounding - discs[:, 2]


def along(pose, speed, yaw_rate, way):
    """The pose after a way, by 2000 small steps."""
    x, y, yaw = pose
    turn = yaw_rate * way / abs(speed)
    headings = yaw + turn * (np.arange(2000) + 0.5) / 2000
    step = math.copysign(way, speed) / 2000
    return x + step * np.cos(headings).sum(), y + step * np.sin(headings).sum(), yaw + turn


unseen_places = st.lists(st.tuples(st.floats(-2.5, 2.5), st.floats(-2.5, 2.5)), max_size=12)


@hypothesis.settings(max_examples=60)
@hypothesis.given(
    unseen_places,
    unseen_places,
    st.sampled_from([BOX, ROUND]),
    st.sampled_from([1.0, -0.5]),
    st.floats(-2, 2),
    st.floats(-3, 3),
)
def test_the_way_is_clear_up_to_the_first_contact(unknown, hits, foot, speed, rate, yaw):
    pose = (0.1, -0.05, yaw)  # what overlaps the robot at first has a rule of its own
    grid = seen(
        *([at for at in places if gaps(np.array([[*at, 0.15]]), foot, pose) > 3e-3] for places in (unknown, hits))
    )
    discs = blockers(grid)
    hypothesis.assume(not len(discs) or gaps(discs, foot, pose).min() > 3e-3)
    way = clear_distance(grid, pose, speed, rate, foot, 1.5)
    assert 0 <= way <= 1.5
    if len(discs):
        nearest = [gaps(discs, foot, along(pose, speed, rate, s)).min() for s in np.linspace(0, way, 60)]
        assert min(nearest) > -5e-4
        if way < 1.5:
            assert gaps(discs, foot, along(pose, speed, rate, way)).min() < 3e-3


@pytest.mark.parametrize("speed", [0.7, -0.7])
def test_unknown_ground_ahead_or_behind_ends_the_way(speed):
    ahead = [(math.copysign(1.55, speed), y) for y in np.arange(-2.95, 3.0, 0.1)]
    way = clear_distance(seen(ahead), (0.0, 0.0, 0.0), speed, 0.0, BOX, 2.0)
    assert way == pytest.approx(1.55 - 0.1 / math.sqrt(2) - 0.25, abs=3e-3)


def test_ground_beyond_the_map_was_not_seen():
    assert clear_distance(seen([], side=1.0), (0.0, 0.0, 0.0), 1.0, 0.0, ROUND, 5.0) == pytest.approx(0.8, abs=2e-3)


def test_a_limit_is_enough():
    assert clear_distance(seen([]), (0.0, 0.0, 0.0), 1.0, 0.5, BOX, 0.6) == 0.6


def test_a_turn_ends_where_a_corner_meets_something():
    grid = seen([], [(0.0, 0.3)])
    turn = clear_turn(grid, (0.0, 0.0, 0.0), 1.0, BOX, math.pi)
    corner, (_, y, size) = math.hypot(0.25, 0.2), grid.discs()[0]
    # The front of the box, 0.25 m ahead, has turned so far that the disc touches its corner or side.
    assert 0 < turn < math.pi / 2
    assert min(gaps(grid.discs(), BOX, (0.0, 0.0, turn))) == pytest.approx(1e-3, abs=2e-3)
    assert y - size < corner
    assert clear_turn(grid, (0.0, 0.0, 0.0), -1.0, BOX, math.pi) == pytest.approx(turn, abs=2e-2)
    assert clear_turn(seen([]), (0.0, 0.0, 0.0), 1.0, BOX, math.pi) == math.pi


def test_a_robot_may_leave_what_it_overlaps_but_not_come_nearer():
    grid = seen([(0.35, 0.05)])  # its disc reaches 0.03 m into the round robot's 0.2 m
    close = (0.1, 0.05, 0.0)
    assert clear_distance(grid, close, 1.0, 0.0, ROUND, 1.0) < 0.01
    assert clear_distance(grid, close, -1.0, 0.0, ROUND, 1.0) == 1.0
    beside = (0.3, -0.15, 0.0)  # drives along the cell
    assert clear_distance(grid, (0.35, -0.15, 0.0), 1.0, 0.0, ROUND, 1.0) == 1.0
    assert clear_distance(grid, beside, 1.0, 0.0, ROUND, 1.0) < 0.02


def test_footprints_off_the_axle_are_swept_as_they_are():
    """The same rectangle reaches 5 cm farther ahead where it is shifted, and no farther than that behind."""
    grid = seen([], [(1.0, 0.1), (-1.0, 0.1)])
    shifted, triangle = (
        Footprint.rectangle(0.5, 0.4, (0.05, 0.0)),
        Footprint.polygon([(0.3, 0.0), (-0.2, 0.3), (-0.2, -0.3)]),
    )
    centred = [clear_distance(grid, (0.0, 0.0, 0.0), way, 0.0, BOX, 2.0) for way in (1.0, -1.0)]
    off = [clear_distance(grid, (0.0, 0.0, 0.0), way, 0.0, shifted, 2.0) for way in (1.0, -1.0)]
    assert np.subtract(off, centred) == pytest.approx([-0.05, 0.05], abs=2e-3)
    # The triangle's slanted side is at x = 0.3 - 0.1 * 5 / 3 where y = 0.1; a disc meets it nearer to its tip.
    x, _, size = grid.discs()[0]
    way = clear_distance(grid, (0.0, 0.0, 0.0), 1.0, 0.0, triangle, 2.0)
    assert way == pytest.approx(x - 0.3 + (0.1 * 0.5 - size * math.hypot(0.5, 0.3)) / 0.3, abs=5e-3)
    assert clear_turn(seen([], [(0.0, 0.25)]), (0.0, 0.0, 0.0), 1.0, triangle, math.pi) < math.pi / 2
    assert clear_turn(seen([], [(0.0, 0.5)]), (0.0, 0.0, 0.0), 1.0, triangle, math.pi) == math.pi
