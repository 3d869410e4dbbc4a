"""Discs, worlds, tasks and routes."""

import dataclasses

import numpy as np
import pytest

from antdrive.base.errors import FieldError
from antdrive.base.records import unchecked_copy
from antdrive.worlds import Cruising, Disc, Route, Task, World
from antdrive.worlds.world import PointWorld

ROOM = World("room", (0.0, 0.0, 10.0, 8.0), (Disc(5.0, 4.0, 1.0), Disc(2.0, 6.0, 0.5)))


def test_a_world_has_its_discs_as_an_array_and_its_size():
    assert ROOM.discs.tolist() == [[5.0, 4.0, 1.0], [2.0, 6.0, 0.5]]
    assert ROOM.size == (10.0, 8.0)
    assert World("none", (0, 0, 1, 1)).discs.shape == (0, 3)


def test_a_route_drops_repeated_points_and_measures_itself():
    route = Route(np.array([[0.0, 0.0], [0.0, 0.0], [3.0, 4.0], [3.0, 4.0], [3.0, 5.0]]))
    assert route.xy.tolist() == [[0.0, 0.0], [3.0, 4.0], [3.0, 5.0]]
    assert route.arc.tolist() == [0.0, 5.0, 6.0]
    assert route.length == 6.0
    with pytest.raises(ValueError, match="read-only"):
        route.xy[0, 0] = 1.0


ROWS = np.array([[1.0, 2.0, 0.3], [4.0, 3.0, 0.1]])
BOUNDS = (0.0, 0.0, 5.0, 5.0)


def test_it_has_the_cylinders_of_its_rows():
    seen, plain = PointWorld.of("a", BOUNDS, ROWS), World("a", BOUNDS, (Disc(1.0, 2.0, 0.3), Disc(4.0, 3.0, 0.1)))
    assert np.array_equal(seen.discs, plain.discs)
    assert seen.obstacles == plain.obstacles
    assert dataclasses.replace(seen, name="b").obstacles == plain.obstacles


def test_a_derived_task_has_the_other_values_unchecked_and_the_rest_of_the_first():
    task = Task(World("a", BOUNDS), (1.0, 1.0, 0.0), (2.0, 2.0), goal_tolerance=0.1)
    covered = World("b", BOUNDS, (Disc(1.0, 1.0, 0.3),))
    made = unchecked_copy(task, world=covered)
    assert (made.world, made.start, made.goal, made.goal_tolerance) == (covered, task.start, task.goal, 0.1)
    assert task.world.name == "a"
    with pytest.raises(FieldError, match="inside obstacles"):
        dataclasses.replace(task, world=covered)


def test_positions_at_the_bounds_may_be_rounded():
    world = World("rounded", (0.15000000000000002, 0.0, 2.9000000000000004, 3.0))
    assert Task(world, (1.0, 1.0, 0.0), (0.15, 2.0)).goal == (0.15, 2.0)
    with pytest.raises(FieldError, match=r"goal: \(0\.14, 2\) is out of bounds \[0\.15, 0, 2\.9, 3\]"):
        Task(world, (1.0, 1.0, 0.0), (0.14, 2.0))
    mover = Cruising(radius=0.2, position=(0.35, 1.0), velocity=(0.0, 0.5))
    assert world.bounds[0] + mover.radius > 0.35
    assert dataclasses.replace(world, movers=(mover,)).movers == (mover,)
