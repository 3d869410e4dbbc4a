"""A search finds different worlds in which a careless set-up fails, and says the same again with the same seed."""

import itertools
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from antdrive.planners import AStar, Query, load_planner
from antdrive.robots import outline_of
from antdrive.runs.failures import failure as failing
from antdrive.runs.failures import hunt as hunting
from antdrive.runs.failures import reproducers
from antdrive.runs.failures.failure import Attempt, failure_of
from antdrive.runs.failures.handover import expectation, renamed
from antdrive.runs.failures.hunt import (
    METHODS,
    POINTS,
    REHEARSED,
    Hunt,
    driven_line,
    find_failures,
    guided_world,
    is_new,
    line_distance,
    rehearsed_clearance,
    world_of,
)
from antdrive.runs.failures.reproducers import write_reproducers
from antdrive.runs.failures.shrinker import shrink
from antdrive.runs.suites.demands import Demands
from antdrive.runs.suites.evaluation import unmet_demands
from antdrive.runs.suites.suite import load_suite
from antdrive.sim import Outcome, Scenario, run
from antdrive.sim.log.margin import CAUSES
from antdrive.worlds import Disc, World, rasterise
from antdrive.worlds.grid import DISC
from antdrive.worlds.passage import feasible

PLACES = st.tuples(st.integers(-5, 5), st.integers(-5, 5))
LINES = st.lists(PLACES, min_size=1, max_size=4).map(lambda places: np.array(places, dtype=np.float64))


def every_alignment(rows, columns):
    """All ways through a table from corner to corner, by steps down, right and diagonal."""
    if rows == columns == 1:
        return [[(0, 0)]]
    ways = []
    for di, dj in ((1, 0), (0, 1), (1, 1)):
        if rows - di >= 1 and columns - dj >= 1:
            ways += [[*way, (rows - 1, columns - 1)] for way in every_alignment(rows - di, columns - dj)]
    return ways


@given(LINES, LINES)
def test_the_pairs_are_those_of_the_cheapest_alignment(one, other):
    alignments = every_alignment(len(one), len(other))
    sums = [sum(float(np.hypot(*(one[i] - other[j]))) for i, j in way) for way in alignments]
    cheapest = {
        round(total / len(way), 9) for total, way in zip(sums, alignments, strict=True) if total < min(sums) + 1e-9
    }
    assert round(line_distance(one, other), 9) in cheapest


def test_parallel_lines_are_as_far_apart_as_they_are():
    line = np.column_stack([np.linspace(0, 5, 50), np.zeros(50)])
    assert line_distance(line, line) == 0
    assert line_distance(line, line + [0.0, 0.4]) == pytest.approx(0.4)
    assert is_new(line, [], 0.3)
    assert is_new(line, [line + [0.0, 0.4]], 0.3)
    assert not is_new(line, [line + [0.0, 5.0], line + [0.0, 0.2]], 0.3)


def test_a_line_has_equal_steps_and_ends_at_the_first_contact(collided_run):
    rollout = collided_run.rollout
    line = driven_line(rollout)
    assert line.shape == (POINTS, 2)
    assert line[-1] == pytest.approx(rollout.pose[int(rollout.contacts[0, 0]), :2])
    steps = [float(np.hypot(*(b - a))) for a, b in itertools.pairwise(line)]
    assert max(steps) - min(steps) < 1e-3


CARELESS = {"margin": 0.0, "noise": 6.0, "smoothing": "none", "physics_hz": 120}


@pytest.fixture(scope="module")
def careless(jackal):
    """A set-up that fails in about every second world: no margin, and six times the robot's noise."""
    return Scenario.of("empty", "astar", jackal, **CARELESS)


@pytest.fixture(scope="module")
def found(careless):
    return find_failures(careless, budget=6, seed=3, method="random")


def test_every_finding_fails_again_and_leaves_room(found):
    assert found.runs == 6
    assert found.findings
    for finding in found.findings:
        scenario = finding.scenario
        done = run(scenario)
        assert (failure_of(done), Attempt(done.scenario, done).fingerprint) == (finding.failure, finding.fingerprint)
        kept = done.rollout.record.footprint_margin
        outline = DISC if kept is None else outline_of(scenario.robot.footprint, kept)
        grid = rasterise(scenario.task.world, 0.02, scenario.inflate, outline)
        plan = load_planner("dijkstra").plan(Query.between(grid, scenario.task), np.random.default_rng(0))
        assert plan.solved, "a fine grid has a path with the clearance that the set-up claims"


def test_a_test_of_a_finding_demands_what_was_touched_and_why(found):
    finding = next(one for one in found.findings if one.failure.touched == "cylinder")
    done, failure = run(finding.scenario), finding.failure
    expected = expectation(done)
    assert expected == {"outcome": "collided", "touched": "cylinder", "cause": failure.cause}
    assert list(unmet_demands(done, Demands.of(expected))) == []
    other = next(cause for cause in CAUSES if cause != failure.cause)
    assert list(unmet_demands(done, Demands.of({**expected, "cause": other}))) == [
        f"cause: {failure.cause} took most of the margin, expected {other}"
    ]
    assert list(unmet_demands(done, Demands.of({**expected, "touched": "wall"}))) == [
        "touched: cylinder, expected wall"
    ]


def test_the_same_seed_finds_the_same(found, careless):
    again = find_failures(careless, budget=3, seed=3, method="random")
    first = [finding for finding in found.findings if finding.number <= 3]
    assert [finding.scenario for finding in again.findings] == [finding.scenario for finding in first]
    assert [finding.fingerprint for finding in again.findings] == [finding.fingerprint for finding in first]


def test_a_finding_that_resembles_another_is_not_counted_twice(found, careless):
    finding = found.findings[0]
    again = hunting._finding(Attempt.of(finding.scenario), finding.failure, 7, list(found.findings))
    assert not again.is_new
    assert set(found.distinct) == {one for one in found.findings if one.is_new}
    assert found.findings[0].is_new


@pytest.mark.parametrize("method", METHODS)
def test_ctrl_c_keeps_what_was_found(careless, monkeypatch, method):
    runs = []

    def until_the_third(scenario):
        if len(runs) == 2:
            raise KeyboardInterrupt
        runs.append(run(scenario))
        return runs[-1]

    monkeypatch.setattr(failing, "run", until_the_third)
    monkeypatch.setattr(hunting, "REHEARSED", 3)
    stopped = find_failures(careless, budget=50, method=method)
    assert (stopped.runs, stopped.interrupted) == (2, True)
    assert len(stopped.findings) == sum(failure_of(done) is not None for done in runs)
    assert stopped.driven == sum(done.rollout is not None for done in runs)


class Crashes(AStar):
    """A planner that raises something in about every second world."""

    def plan(self, query, rng):
        if query.task is not None and int(1000 * query.task.world.obstacles[-1].y) % 2 == 0:
            raise IndexError("pop from empty list")
        return super().plan(query, rng)


@pytest.mark.slow
@pytest.mark.parametrize("method", METHODS)
def test_a_planner_that_raises_is_a_finding(jackal, tmp_path, monkeypatch, method):
    monkeypatch.setattr(hunting, "REHEARSED", 3)
    setup = Scenario.of("empty", Crashes(), jackal, **CARELESS)
    hunt = find_failures(setup, budget=4, seed=3, method=method, obstacles=2)
    raised = [finding for finding in hunt.findings if finding.failure.outcome == "planner_error"]
    assert hunt.runs == 4
    assert raised
    assert sum(finding.is_new for finding in raised) == 1
    assert "IndexError: pop from empty list" in raised[0].failure.cause
    if method != "random":
        return  # the rest does not depend on the method
    small = shrink(raised[0].scenario, seconds=1)
    assert small.failure == raised[0].failure
    (handed,) = write_reproducers(Hunt((raised[0],), 4), tmp_path, seconds=0)
    (case,) = load_suite(tmp_path / "failures.drive.yaml")
    assert handed.small.scenario.task.world.obstacles == case.written.load_task(case.suite.parent).world.obstacles


@pytest.mark.slow
def test_ctrl_c_while_shrinking_hands_over_what_was_found(found, tmp_path, monkeypatch):
    def interrupted(*_, **__):
        raise KeyboardInterrupt

    monkeypatch.setattr(reproducers, "shrink", interrupted)
    first = found.distinct[0]
    other = replace(first, scenario=renamed(first.scenario, "other"), fingerprint="of another drive")
    reported = write_reproducers(Hunt((first, other), 2), tmp_path)
    assert [one.repeats for one in reported] == [True, False]


def test_no_path_counts_only_where_the_grid_has_no_excuse(small_scenario):
    """Two cylinders leave a gap that the robot fits through, between cells of 0.5 m."""
    gap = 2 * small_scenario.inflate + 0.02
    sides = (Disc(2.0, 0.5, 1.0 - gap / 2), Disc(2.0, 2.5, 1.0 - gap / 2))
    world = World("gap", (0.0, 0.0, 4.0, 3.0), sides)
    tight = replace(small_scenario, task=replace(small_scenario.task, world=world), cell=0.5)
    done = run(tight)
    assert done.outcome is Outcome.NO_PATH
    assert feasible(tight.task, tight.inflate)
    assert hunting._failure(Attempt(done.scenario, done)) is None
    wide = replace(done, scenario=replace(tight, cell=0.005))
    assert hunting._failure(Attempt(wide.scenario, wide)) is not None


@given(st.floats(0.02, 2.0), st.lists(st.tuples(*[st.floats(0, 1)] * 3), min_size=1, max_size=8))
def test_every_point_is_a_world_in_which_both_ends_are_free(radius, point):
    task = world_of(np.array(point), radius, "w")
    assert len(task.world.obstacles) == len(point)
    for x, y in (task.start[:2], task.goal):
        assert min(np.hypot(disc.x - x, disc.y - y) - disc.radius for disc in task.world.obstacles) > radius
        assert min(x, y, task.world.size[0] - x, task.world.size[1] - y) > radius


@pytest.mark.parametrize("noise", [0.0, 1.0])
def test_a_rehearsal_foretells_the_clearance_of_the_drive(careless, noise):
    rng = np.random.default_rng(1)
    for seed in range(4):
        task = world_of(rng.random((4, 3)), careless.robot.radius, "w")
        scenario = replace(careless, task=task, noise=noise, seed=seed)
        done = run(scenario)
        if done.rollout is not None:
            assert rehearsed_clearance(scenario) == pytest.approx(float(done.rollout.clearance.min()), abs=0.03)


def test_the_guided_search_runs_the_world_that_is_rehearsed_worst(small_scenario, monkeypatch):
    drawn = [replace(small_scenario, seed=seed) for seed in range(REHEARSED)]
    waiting = iter([None, *drawn[1:]])
    monkeypatch.setattr(hunting, "rehearsed_clearance", lambda scenario: abs(scenario.seed - 7.2))
    assert guided_world(lambda: next(waiting)) is drawn[7]
    assert guided_world(lambda: None) is None
