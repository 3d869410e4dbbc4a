"""A run gives the same, bit for bit, whatever ran before it in the process."""

import itertools
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from antdrive.base import caches
from antdrive.base.caches import bits, cached, clear_caches
from antdrive.planners import PLANNERS, Query
from antdrive.sim import Engine, Scenario, run
from antdrive.worlds import Disc, World, load_task, rasterise, save_task
from antdrive.worlds.world import by_geometry
from tests.records import COARSE


def scenarios():
    """Drives that end at the goal, in a collision, after a contact with several things, and among movers."""
    hit = tuple(Disc(3.0 + dx, 3.0 + dy, 0.2) for dx, dy in ((0, 0), (0.3, -0.25), (-0.3, 0.3)))
    return {
        "slalom": Scenario.of("slalom", "astar", "jackal"),
        "noisy": Scenario.of("slalom", "ants", "jackal", noise=1.0, seed=3, **COARSE),
        "hit": Scenario.of("empty", "astar", "jackal", unseen=hit),
        "movers": Scenario.of("plaza-moving", "astar", avoidance=None, replanning=None, **COARSE),
    }


def outcome_of(name):
    """What must repeat of a drive: arrays, record and certificate."""
    done = run(scenarios()[name])
    return done.rollout.digest, done.certificate


@pytest.fixture(scope="module")
def fresh():
    """Each drive with nothing kept of another."""
    found = {}
    for name in scenarios():
        clear_caches()
        found[name] = outcome_of(name)
    return found


@pytest.mark.parametrize(
    "order", [("hit", "slalom", "movers", "noisy", "hit"), ("noisy", "movers", "slalom", "slalom")]
)
def test_what_ran_before_changes_nothing(order, fresh):
    for name in order:
        assert outcome_of(name) == fresh[name], name


def test_body_numbers_count_ground_robot_and_obstacles_in_order(turtlebot):
    """Contacts name obstacles by the world's order, whichever have the same size."""
    sizes = [(0.1, 1.0), (0.1, 1.0), (0.2, 1.0), (0.1, 1.0), (0.1, 0.01), (0.1, 0.05)]
    discs = tuple(Disc(2.0 + i, 3.0, r, h) for i, (r, h) in enumerate(sizes))
    with Engine(World("w", (0, 0, 10, 10), discs), turtlebot) as engine:
        assert engine._bodies.index == {2 + i: i for i in range(len(discs) + 4)}
        for i, disc in enumerate(discs):
            for gap, touched in ((-0.002, {i}), (0.002, set())):
                engine.place((disc.x, disc.y - disc.radius - turtlebot.radius - gap, 0.0))
                assert {contact.obstacle for contact in engine.contacts()} == touched


def test_only_so_much_is_kept():
    calls = []

    @cached(3)
    def square(x):
        calls.append(x)
        return x * x

    assert [square(x) for x in (1, 2, 3, 3, 1)] == [1, 4, 9, 9, 1]
    assert calls == [1, 2, 3]
    square(4)  # takes the place of 2, which was not asked for the longest
    square(1)
    square(2)
    assert calls == [1, 2, 3, 4, 2]
    assert isinstance(square(2.0), float)  # an equal number of another type is another argument
    assert calls[-1] == 2.0
    clear_caches()
    square(2)
    assert calls[-1] == 2
    assert len(calls) == 7
    caches._caches.pop()


def test_every_cache_is_bounded():
    assert all(0 < cached.cache_parameters()["maxsize"] <= 64 for cached in caches._caches)
    assert len(caches._caches) >= 5


@given(st.floats(), st.floats())
def test_bits_tell_all_numbers_apart(a, b):
    assert (bits(a) == bits(b)) == (a.hex() == b.hex())
    assert bits(0.0) != bits(-0.0)


def test_worlds_are_alike_only_if_every_number_is():
    world = World("a", (0, 0, 4, 3), (Disc(1, 1, 0.2), Disc(2, 1, 0.3)))
    same = World("another name", (0.0, 0.0, 4.0, 3.0), (Disc(1.0, 1, 0.2, 2.0), Disc(2, 1, 0.3)))
    assert by_geometry(world) == by_geometry(same)
    assert hash(by_geometry(world)) == hash(by_geometry(same))
    others = [
        replace(world, bounds=(0, 0, 4, 3.5)),
        replace(world, bounds=(-0.0, 0, 4, 3)),
        replace(world, obstacles=world.obstacles[::-1]),
        replace(world, obstacles=world.obstacles[:1]),
        replace(world, obstacles=(*world.obstacles[:1], Disc(2, 1, float(np.nextafter(0.3, 1))))),
    ]
    for a, b in itertools.combinations([world, *others], 2):
        assert by_geometry(a) != by_geometry(b)


def test_a_file_that_has_changed_is_read_again(tmp_path):
    file = tmp_path / "w.yaml"
    save_task(load_task("slalom"), file)
    first = load_task(file)
    assert load_task(file) is first
    save_task(replace(first, goal_tolerance=0.5), file)
    assert load_task(file).goal_tolerance == 0.5
    file.unlink()
    with pytest.raises(ValueError, match="no such file"):
        load_task(file)


def test_a_fault_is_reported_each_time_with_its_own_file(tmp_path):
    for name in ("a.yaml", "b.yaml", "a.yaml"):
        (tmp_path / name).write_text("schema: 1\nbounds: wide\n")
        with pytest.raises(ValueError, match=name):
            load_task(tmp_path / name)


def test_kept_optima_are_those_of_a_search():
    """Also after other worlds, and where worlds differ by a bit, a margin or a goal."""
    base = Scenario.of("slalom", "astar", "turtlebot")
    tasks = [base.task, replace(base.task, goal=(base.task.goal[0] - 0.5, base.task.goal[1]))]
    wide = replace(base.task.world, obstacles=base.task.world.obstacles[:-1])
    tasks.append(replace(base.task, world=wide))
    for task, margin in itertools.product(tasks, (0.03, 0.05)):
        done = run(replace(base, task=task, margin=margin, time_limit=0.2))
        query = Query.between(rasterise(task.world, task.cell, base.robot.radius + margin), task)
        searches = [PLANNERS[name].plan(query, np.random.default_rng(9)) for name in ("astar", "tangent")]
        found = done.rollout.record.plan
        assert found.grid_optimum_m == searches[0].cost
        assert found.euclidean_optimum_m == searches[1].line_length


def test_nobody_can_change_the_discs_that_a_world_keeps():
    world = load_task("slalom").world
    before = world.discs
    world.discs[:] = 0
    assert np.array_equal(world.discs, before)
    assert world.discs.flags.writeable  # kernels compile once, for arrays of one kind
    assert replace(world, obstacles=()).discs.shape == (0, 3)
