"""Planner kernels against slow definitions, for errors that plans alone do not reveal."""

import itertools

import numpy as np

from antdrive.planners.anyangle._kernels_ga import tighten_all
from antdrive.planners.anyangle._kernels_lines import Terrain, clear_cells, clear_line, corridor_moves, pull
from antdrive.planners.colonies._kernels_colony import next_random
from antdrive.planners.colonies._kernels_mmas_dstar import close_gates
from antdrive.planners.graph._kernels_dstar_lite import update_vertex
from antdrive.planners.graph._kernels_incremental import COST, DIAGONAL, STRAIGHT, put
from antdrive.worlds import DIRECTIONS, Grid

NO_DISCS, NO_WALLS = np.empty((0, 3)), np.zeros(4)


def test_gates_lie_between_two_diagonally_opposite_blocked_cells():
    rng = np.random.default_rng(3)
    for _ in range(60):
        rows, cols = rng.integers(3, 9, 2)
        free = rng.random((rows, cols)) >= 0.25
        free[0, 0] = free[-1, -1] = True
        allowed = Grid.from_free(free).moves
        moves = allowed.copy()
        gates = free.copy() & False
        for r, c in itertools.product(range(1, rows - 1), range(1, cols - 1)):
            opposite = [(free[r + dr, c + dc], free[r - dr, c - dc]) for dr, dc in ((1, 1), (1, -1))]
            gates[r, c] = free[r, c] and any(not a and not b for a, b in opposite)
        start = tuple(np.argwhere(gates)[0]) if gates.any() else (0, 0)
        gates[start] = False
        assert close_gates(free, moves, *start, rows - 1, cols - 1) == gates.sum()
        expected = np.zeros_like(moves)
        for r, c, k in itertools.product(range(rows), range(cols), range(8)):
            to = r + DIRECTIONS[k][0], c + DIRECTIONS[k][1]
            if allowed[r, c] >> k & 1 and not gates[r, c] and not gates[to]:
                expected[r, c] |= 1 << k
        np.testing.assert_array_equal(moves, expected)


def test_a_vertex_that_is_consistent_leaves_the_queue_even_from_its_top():
    g, rhs = np.array([5, 6, 7]), np.array([9, 9, 9])
    heap, place, size = np.zeros((4, 3), np.int64), np.full(3, -1), 0
    for u in range(3):
        size = put(heap, place, size, u, int(g[u]), int(g[u]))
    assert (size, place[0]) == (3, 0)
    rhs[0] = g[0]
    size = update_vertex(0, 0, 0, g, rhs, heap, place, size)
    assert size == 2
    assert place.tolist() == [-1, *(0 if heap[0, 2] == u else 1 for u in (1, 2))]
    assert update_vertex(0, 0, 0, g, rhs, heap, place, size) == 2
    assert update_vertex(1, 3, 4, g, rhs, heap, place, size) == 2
    assert heap[place[1], :2].tolist() == [6 + 3 + 4, 6]


def test_moves_cost_what_their_direction_says():
    assert COST.tolist() == [DIAGONAL if dr and dc else STRAIGHT for dr, dc in DIRECTIONS]


def test_a_line_touches_the_cell_behind_a_border_within_a_billionth():
    free = np.ones((3, 3), np.bool_)
    free[1] = False
    for row, touches in ((0.5, True), (0.5 - 5e-10, True), (0.5 - 2e-9, False), (0.4, False)):
        assert clear_cells(free, row, 0.0, row, 2.0) is not touches
        assert clear_cells(free.T.copy(), 0.0, row, 2.0, row) is not touches
        assert clear_cells(free, 2.0 - row, 2.0, 2.0 - row, 0.0) is not touches


def test_a_pulled_line_goes_each_time_to_the_last_point_in_sight():
    rng, shorter = np.random.default_rng(4), 0
    for _ in range(40):
        free = rng.random((9, 9)) >= 0.15
        land = Terrain(NO_DISCS, NO_WALLS, 0.0, free, 0.0, 0.0, 1.0, True)
        xy = np.concatenate([[(0.0, 0.0)], rng.integers(0, 9, (6, 2)).astype(float), [(8.0, 8.0)]])
        expected = [0]
        while expected[-1] < 7:
            i = expected[-1]
            seen = [j for j in range(i + 2, 8) if clear_line(land, *xy[i], *xy[j])]
            expected.append(max(seen, default=i + 1))
        assert pull(land, xy).tolist() == expected
        shorter += len(expected) < 8
    assert shorter > 10


def distance(point, line):
    a, b = line[:-1], line[1:]
    length2 = ((b - a) ** 2).sum(axis=1)
    f = np.clip(((point - a) * (b - a)).sum(axis=1) / np.where(length2 > 0, length2, 1.0), 0.0, 1.0)
    return float(np.hypot(*(a + f[:, None] * (b - a) - point).T).min())


def test_the_corridor_holds_the_cells_within_its_width():
    rng = np.random.default_rng(5)
    for _ in range(40):
        rows, cols = (int(n) for n in rng.integers(2, 10, 2))
        line = rng.uniform((0, 0), (rows - 1, cols - 1), (int(rng.integers(2, 5)), 2))
        width = float(rng.uniform(0.3, 2.0))
        moves = Grid.from_free(rng.random((rows, cols)) >= 0.1).moves
        inside = np.array([[distance(np.array([r, c]), line) <= width for c in range(cols)] for r in range(rows)])
        expected = np.zeros_like(moves)
        for r, c, k in itertools.product(range(rows), range(cols), range(8)):
            to = r + DIRECTIONS[k][0], c + DIRECTIONS[k][1]
            if moves[r, c] >> k & 1 and inside[r, c] and inside[to]:
                expected[r, c] |= 1 << k
        np.testing.assert_array_equal(corridor_moves(moves, line, width), expected)


def test_random_numbers_are_those_of_xorshift64():
    state = 88172645463325252
    for _ in range(50):
        actual = int(next_random(np.uint64(state)))
        for shift, left in ((13, True), (7, False), (17, True)):
            state ^= (state << shift if left else state >> shift) & (1 << 64) - 1
        assert actual == state


def test_via_points_without_obstacles_go_to_the_line_between_their_neighbours():
    land = Terrain(NO_DISCS, NO_WALLS, 0.0, np.ones((30, 30), np.bool_), 0.0, 0.0, 1.0, True)
    rng, ends = np.random.default_rng(7), np.array([(2.0, 3.0), (25.0, 20.0)])
    for count in (1, 3, 5):
        via = rng.uniform(1, 28, (count, 2))
        expected = np.concatenate([ends[:1], via, ends[1:]])
        for _, k in itertools.product(range(2), range(1, count + 1)):
            a, b = expected[k - 1], expected[k + 1]
            expected[k] = a + np.clip((expected[k] - a) @ (b - a) / ((b - a) @ (b - a)), 0.0, 1.0) * (b - a)
        length = tighten_all(via, ends, land, 2)
        np.testing.assert_allclose(via, expected[1:-1], atol=1e-9)
        np.testing.assert_allclose(length, np.hypot(*np.diff(expected, axis=0).T).sum())
