"""Discs, worlds, tasks and routes: what they compute, and which values they refuse."""

import math

import numpy as np
import pytest

from antdrive.worlds import Disc, Route, Task, World

ROOM = World("room", (0.0, 0.0, 10.0, 8.0), (Disc(5.0, 4.0, 1.0), Disc(2.0, 6.0, 0.5)))


def test_a_world_has_its_discs_as_an_array_and_its_size():
    assert ROOM.discs.tolist() == [[5.0, 4.0, 1.0], [2.0, 6.0, 0.5]]
    assert ROOM.size == (10.0, 8.0)
    assert World("none", (0, 0, 1, 1)).discs.shape == (0, 3)


@pytest.mark.parametrize("values", [(0, 0, 0), (0, 0, -1), (math.nan, 0, 1), (0, math.inf, 1), (0, 0, 1, 0)])
def test_a_disc_needs_a_finite_place_and_a_positive_size(values):
    with pytest.raises(ValueError, match="must be"):
        Disc(*values)


@pytest.mark.parametrize("bounds", [(0, 0, 0, 1), (0, 2, 1, 1), (0, 0, math.inf, 1), (math.nan, 0, 1, 1)])
def test_bounds_that_enclose_nothing_are_refused(bounds):
    with pytest.raises(ValueError, match=r"^bounds: "):
        World("w", bounds)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (
            {"start": (5.5, 4.0, 0.0)},
            r"^start: \(5.5, 4\) is inside obstacles\[0\] at \(5, 4\) with radius 1",
        ),
        ({"goal": (2.0, 6.5)}, r"^goal: .* inside obstacles\[1\]"),
        ({"goal": (11.0, 1.0)}, "^goal: .* out of bounds"),
        ({"start": (1.0, -0.1, 0.0)}, "^start: .* out of bounds"),
        ({"start": (1.0, 1.0, math.nan)}, "^start: must be a finite number"),
        ({"goal_tolerance": 0.0}, "^goal_tolerance: must be greater than 0"),
        ({"cell": -0.5}, "^cell: must be greater than 0"),
        ({"goal": (1.0, 1.0)}, "^goal: is where the robot starts"),
    ],
)
def test_a_task_needs_a_free_start_and_a_free_goal(change, message):
    with pytest.raises(ValueError, match=message):
        Task(**{"world": ROOM, "start": (1.0, 1.0, 0.0), "goal": (9.0, 7.0)} | change)


def test_a_route_drops_repeated_points_and_measures_itself():
    route = Route(np.array([[0.0, 0.0], [0.0, 0.0], [3.0, 4.0], [3.0, 4.0], [3.0, 5.0]]))
    assert route.xy.tolist() == [[0.0, 0.0], [3.0, 4.0], [3.0, 5.0]]
    assert route.arc.tolist() == [0.0, 5.0, 6.0]
    assert route.length == 6.0
    with pytest.raises(ValueError, match="read-only"):
        route.xy[0, 0] = 1.0


@pytest.mark.parametrize("xy", [[[0.0, 0.0]], [[0.0, 0.0], [0.0, 0.0]], [0.0, 1.0], [[0.0, math.nan], [1.0, 1.0]]])
def test_a_route_has_length(xy):
    with pytest.raises(ValueError, match=r"^xy: "):
        Route(np.array(xy))
