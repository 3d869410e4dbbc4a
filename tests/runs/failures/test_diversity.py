"""The distance between driven lines, and what counts as different."""

import itertools

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from antdrive.base import Floats
from antdrive.runs.failures.diversity import POINTS, driven_line, is_new, line_distance
from antdrive.sim import Run

PLACES = st.tuples(st.integers(-5, 5), st.integers(-5, 5))
LINES = st.lists(PLACES, min_size=1, max_size=4).map(lambda places: np.array(places, dtype=np.float64))


def every_alignment(rows: int, columns: int) -> list[list[tuple[int, int]]]:
    """All ways through a table from corner to corner, by steps down, right and diagonal."""
    if rows == columns == 1:
        return [[(0, 0)]]
    ways = []
    for di, dj in ((1, 0), (0, 1), (1, 1)):
        if rows - di >= 1 and columns - dj >= 1:
            ways += [[*way, (rows - 1, columns - 1)] for way in every_alignment(rows - di, columns - dj)]
    return ways


@given(LINES, LINES)
def test_the_pairs_are_those_of_the_cheapest_alignment(one: Floats, other: Floats) -> None:
    alignments = every_alignment(len(one), len(other))
    sums = [sum(float(np.hypot(*(one[i] - other[j]))) for i, j in way) for way in alignments]
    cheapest = {
        round(total / len(way), 9) for total, way in zip(sums, alignments, strict=True) if total < min(sums) + 1e-9
    }
    assert round(line_distance(one, other), 9) in cheapest


def test_parallel_lines_are_as_far_apart_as_they_are() -> None:
    line = np.column_stack([np.linspace(0, 5, 50), np.zeros(50)])
    assert line_distance(line, line) == 0
    assert line_distance(line, line + [0.0, 0.4]) == pytest.approx(0.4)
    assert is_new(line, [], 0.3)
    assert is_new(line, [line + [0.0, 0.4]], 0.3)
    assert not is_new(line, [line + [0.0, 5.0], line + [0.0, 0.2]], 0.3)


def test_a_line_has_equal_steps_and_ends_at_the_first_contact(collided_run: Run) -> None:
    rollout = collided_run.rollout
    assert rollout is not None
    line = driven_line(rollout)
    assert line.shape == (POINTS, 2)
    assert line[-1] == pytest.approx(rollout.pose[int(rollout.contacts[0, 0]), :2])
    steps = [float(np.hypot(*(b - a))) for a, b in itertools.pairwise(line)]
    assert max(steps) - min(steps) < 1e-3
