"""Shrinking keeps the failure, leaves nothing that can be left out, and goes on where it stopped."""

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from antdrive.base import InputError
from antdrive.runs.failures import candidates, passes
from antdrive.runs.failures.candidates import CandidateRunner, identity_of, room_in
from antdrive.runs.failures.ddmin import one_minimal
from antdrive.runs.failures.failure import Failure, failure_of, parse_bound
from antdrive.runs.failures.shrinker import shrink
from antdrive.sim import plan, run
from antdrive.worlds import Cruising, Disc, Task, World
from antdrive.worlds.passage import feasible
from tests.records import COARSE

Property = Callable[[Sequence[int]], bool]


def first_of(holds):
    return lambda lists: next((some for some in lists if holds(some)), None)


@given(st.integers(1, 40), st.sets(st.integers(0, 39), max_size=6))
def test_the_needed_items_are_found_exactly(count, needed):
    needed = {item for item in needed if item < count}
    found = one_minimal(list(range(count)), first_of(lambda some: needed <= set(some)))
    assert set(found) == needed


@given(st.integers(1, 9), st.data())
def test_the_result_is_one_minimal_whatever_the_property(count, data):
    everything = tuple(range(count))
    subsets = st.sets(st.integers(0, count - 1)).map(lambda some: tuple(sorted(some)))
    failing = {everything, *data.draw(st.sets(subsets, max_size=40))}

    def holds(some):
        return tuple(sorted(some)) in failing

    found = tuple(one_minimal(everything, first_of(holds)))
    assert holds(found)
    assert not any(holds(found[:i] + found[i + 1 :]) for i in range(len(found)))


def test_nothing_is_asked_about_an_empty_list():
    assert one_minimal([], first_of(lambda some: 1 / 0 > 0)) == []


SIDE = 6.0


def clutter(count, rng):
    """Cylinders along the lower and the upper wall, out of everybody's way."""
    return tuple(
        Disc(float(rng.uniform(0.3, SIDE - 0.3)), float(y), float(rng.uniform(0.05, 0.1)))
        for y in rng.choice([0.2, SIDE - 0.2], count)
    )


def task_with(*discs):
    return Task(World("planted", (0.0, 0.0, SIDE, SIDE), discs), (0.61234, 3.0, 0.0), (5.4, 3.0), cell=0.25)


@pytest.fixture(scope="module")
def fenced(small_scenario):
    """No path: a fence of cylinders from wall to wall, among clutter; without movers nothing is driven, so it is quick."""
    fence = [Disc(3.0 + 0.01 * k, 0.4 + 0.74 * k, 0.26) for k in range(8)]
    discs = [*fence, *clutter(6, np.random.default_rng(1))]
    return replace(
        small_scenario, task=task_with(*(discs[i] for i in np.random.default_rng(2).permutation(14))), seed=5
    )


@pytest.fixture(scope="module")
def fenced_small(fenced, tmp_path_factory):
    """What is left of it, and the journal of the session."""
    journal = tmp_path_factory.mktemp("fenced") / "journal.json"
    return shrink(fenced, journal=journal), journal.read_text()


@pytest.fixture(scope="module")
def struck(small_scenario):
    """A contact with one of two unseen cylinders on the route, by a noisy robot."""
    unseen = (Disc(3.0, 3.0, 0.2), Disc(1.0, 5.0, 0.2), Disc(4.0, 3.1, 0.3))
    task = task_with(*clutter(5, np.random.default_rng(3)))
    return replace(small_scenario, task=task, unseen=unseen, noise=0.5, seed=12, **COARSE)


@pytest.fixture(scope="module")
def steps(struck):
    """The steps by which the contact is made small; the last one is the result."""
    return []


@pytest.fixture(scope="module")
def struck_small(struck, steps):
    first = CandidateRunner.first

    def watched(self, candidates):
        found = first(self, candidates)
        if found is not None:
            steps.append(found)
        return found

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(CandidateRunner, "first", watched)
        return shrink(struck)


def without_one(scenario):
    """The scenario without each one of its obstacles, unseen obstacles and movers."""
    discs, unseen, movers = scenario.task.world.obstacles, scenario.unseen, scenario.task.world.movers
    return [
        *(passes.with_obstacles(scenario, discs[:i] + discs[i + 1 :]) for i in range(len(discs))),
        *(passes.with_unseen(scenario, unseen[:i] + unseen[i + 1 :]) for i in range(len(unseen))),
        *(passes.with_movers(scenario, movers[:i] + movers[i + 1 :]) for i in range(len(movers))),
    ]


def assert_small(shrunk):
    """The small scenario fails in the same way, and no longer without any one of its parts."""
    assert shrunk.complete
    assert failure_of(run(shrunk.scenario)) == shrunk.failure
    for smaller in without_one(shrunk.scenario):
        assert smaller is None or failure_of(run(smaller)) != shrunk.failure


def test_a_world_without_a_path_keeps_the_cylinders_that_close_it(fenced, fenced_small):
    shrunk, _ = fenced_small
    assert shrunk.failure.outcome == "no_path"
    assert_small(shrunk)
    small = shrunk.scenario
    assert 0 < len(small.task.world.obstacles) <= 8 < len(fenced.task.world.obstacles)
    assert small.seed == 0
    assert small.task.start == (round(small.task.start[0], 2), 3.0, 0.0), "digits"
    assert np.ptp(small.task.world.bounds) < SIDE


def test_a_contact_with_an_unseen_cylinder_keeps_that_cylinder_alone(struck, struck_small):
    shrunk = struck_small
    assert shrunk.failure == Failure("collided", "unseen cylinder", "")
    assert_small(shrunk)
    small = shrunk.scenario
    assert (len(small.unseen), len(small.task.world.obstacles), small.noise, small.seed) == (1, 0, 0.0, 0)
    assert small.task.start[0] > struck.task.start[0]
    assert feasible(small.task, small.inflate)


def test_the_mover_that_was_touched_is_kept_alone(small_scenario):
    movers = tuple(Cruising(radius=0.2, position=(5.0, y), velocity=(-0.6, 0.0)) for y in (1.0, 3.0, 5.0))
    world = World("movers", (0.0, 0.0, SIDE, SIDE), clutter(3, np.random.default_rng(3)), movers=movers)
    task = Task(world, (0.6, 3.0, 0.0), (5.4, 3.0), cell=0.25)
    shrunk = shrink(replace(small_scenario, task=task, avoidance=None, replanning=None, **COARSE))
    assert shrunk.failure == Failure("collided", "mover", "")
    assert_small(shrunk)
    assert (len(shrunk.scenario.task.world.movers), shrunk.scenario.task.world.obstacles) == (1, ())


def test_a_bound_on_a_metric_persists(small_scenario):
    bound = parse_bound("min_clearance_m < 0.05")
    task = replace(task_with(Disc(3.0, 2.5, 0.3), Disc(3.0, 3.5, 0.25)), start=(2.2, 3.0, 0.0), goal=(3.8, 3.0))
    shrunk = shrink(replace(small_scenario, task=task, margin=0.0, smoothing="taut", **COARSE), bound=bound)
    rollout = run(shrunk.scenario).rollout
    assert rollout.clearance.min() < 0.05
    assert len(shrunk.scenario.task.world.obstacles) <= 1
    with pytest.raises(InputError, match=r"does not fail.*the bound is min_clearance_m < 0.05"):
        shrink(small_scenario, bound=bound)


def test_a_success_cannot_be_shrunk(small_scenario):
    with pytest.raises(InputError, match="small: this run does not fail, so there is nothing to shrink"):
        shrink(small_scenario)


@pytest.mark.slow
def test_two_processes_give_the_same_result(fenced):
    alone, together = shrink(fenced), shrink(fenced, jobs=2)
    assert alone.scenario.key == together.scenario.key
    assert together.complete


def test_a_session_that_ran_out_of_time_is_taken_up_where_it_stopped(fenced, fenced_small, tmp_path, monkeypatch):
    clock, planned = iter(range(10**6)), []
    monkeypatch.setattr("antdrive.runs.failures.candidates.time.monotonic", lambda: float(next(clock)))
    monkeypatch.setattr(candidates, "plan", lambda scenario: planned.append(1) or plan(scenario))
    journal, (whole, _) = tmp_path / "journal.json", fenced_small
    cut = shrink(fenced, seconds=60, journal=journal)
    assert not cut.complete
    assert failure_of(run(cut.scenario)) == cut.failure
    planned.clear()
    rest = shrink(fenced, seconds=1e6, journal=journal)
    assert (rest.complete, rest.recalled) == (True, cut.runs)
    assert len(planned) == rest.runs
    assert rest.scenario.key == whole.scenario.key
    assert whole.runs == cut.runs + rest.runs


def test_a_journal_of_another_failure_or_an_unreadable_one_is_not_used(fenced, fenced_small, tmp_path):
    whole, journal = fenced_small[1], tmp_path / "journal.json"
    journal.write_text(whole)
    assert shrink(fenced, seconds=0, journal=journal).recalled
    assert shrink(replace(fenced, margin=0.031), seconds=0, journal=journal).recalled == 0
    twice = whole.replace('"answers"', '"answers": {},\n"answers"', 1)
    for text in ("{", "[]", '{"header": "x"}', '{"header": 1, "answers": [1]}', twice):
        journal.write_text(text)
        again = shrink(fenced, seconds=0, journal=journal)
        assert (again.recalled, again.complete) == (0, False)


def test_answers_that_no_longer_hold_are_forgotten(fenced, fenced_small, tmp_path):
    """A journal in which every candidate fails, as if the planner had been mended since, misleads nobody."""
    journal = tmp_path / "journal.json"
    honest, text = fenced_small
    journal.write_text(text.replace("false", "true"))
    again = shrink(fenced, journal=journal)
    assert again.recalled
    assert again.scenario.key == honest.scenario.key


def test_every_accepted_step_fails_in_the_same_way(struck_small, steps):
    assert len(steps) > 3
    assert {failure_of(run(step)) for step in steps} == {struck_small.failure}


def test_a_moved_wall_cuts_no_cylinder_that_was_whole(small_scenario):
    """Each wall is moved to everywhere from outside a cylinder to beyond it; another one was cut from the start."""
    whole, cut = Disc(3.0, 3.0, 0.5), Disc(0.1, 3.0, 0.3)
    task = Task(World("w", (0.0, 0.0, 6.0, 6.0), (whole, cut)), (1.0, 1.0, 0.0), (5.0, 5.0), cell=0.25)
    hidden = Disc(3.0, 4.5, 0.5)
    scenario = replace(small_scenario, task=task, unseen=(hidden,))
    for side, sign in ((0, 1), (1, 1), (2, -1), (3, -1)):
        for moved in np.arange(0.03, 5.0, 0.05):
            limits = list(task.world.bounds)
            limits[side] = round(limits[side] + sign * float(moved), 9)
            bounds = (limits[0], limits[1], limits[2], limits[3])
            smaller = passes._walled(scenario, side, bounds)
            if smaller is None:  # a wall has passed the start or the goal, or the robot's footprint there
                continue
            xmin, ymin, xmax, ymax = smaller.task.world.bounds
            for disc in (whole, hidden):
                room = min(disc.x - xmin, xmax - disc.x, disc.y - ymin, ymax - disc.y)
                assert (disc in smaller.task.world.obstacles + smaller.unseen) == (room >= disc.radius)
            assert (cut in smaller.task.world.obstacles) == (cut.x + cut.radius >= xmin)


def test_the_touched_cylinder_stays_whole_within_the_walls(small_scenario):
    """A contact beside the straight way to the goal, with a cylinder that reaches far aside."""
    blind = Disc(3.0, 3.7, 0.75)
    small = shrink(replace(small_scenario, task=task_with(), unseen=(blind,), **COARSE)).scenario
    xmin, ymin, xmax, ymax = small.task.world.bounds
    (disc,) = small.unseen
    assert min(disc.x - xmin, xmax - disc.x, disc.y - ymin, ymax - disc.y) >= disc.radius
    assert ymax < SIDE


def test_a_world_that_has_a_path_keeps_one(struck, fenced):
    """A cylinder beside the start is farther than the footprint reaches, and nearer than the clearance that is claimed."""
    failure = Failure("collided", "unseen cylinder", "")
    room = room_in(struck, failure)
    assert room == struck.inflate
    x, y, _ = struck.task.start
    near = passes.with_obstacles(struck, [Disc(x, y + 0.5 + struck.inflate - 0.01, 0.5)])
    assert failure_of(run(near)) == failure
    assert not feasible(near.task, struck.inflate)
    assert CandidateRunner(failure).first([near]) is near
    assert CandidateRunner(failure, room=room).first([near]) is None
    no_path = Failure("no_path", "nothing", "")
    assert room_in(fenced, no_path) is None
    assert room_in(struck, no_path) == struck.inflate + struck.task.cell


class Textless:
    """A planner whose class has no text of its own."""

    def __init__(self, ants):
        self.ants = ants

    def plan(self, query, rng):
        raise NotImplementedError


def test_a_journal_knows_a_planner_again_without_a_text_of_its_own(small_scenario):
    first, again, other = (identity_of(replace(small_scenario, planner=Textless(ants))) for ants in (3, 3, 4))
    assert first == again
    assert first != other
