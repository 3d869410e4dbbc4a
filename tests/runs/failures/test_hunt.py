"""A search finds worlds in which a careless set-up fails, and says the same again with the same seed."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from antdrive.base import FieldError
from antdrive.planners import AStar, PlanResult, Query, load_planner
from antdrive.robots import RobotSpec
from antdrive.runs.failures import hunt as hunting
from antdrive.runs.failures import report as reporting
from antdrive.runs.failures import search
from antdrive.runs.failures.failure import failure_of
from antdrive.runs.failures.handover import expectation, fingerprint_of
from antdrive.runs.failures.hunt import Hunt, find_failures
from antdrive.runs.failures.report import report
from antdrive.runs.failures.search import METHODS, REHEARSED, guided_world, rehearsed_clearance
from antdrive.runs.failures.shrink import shrink
from antdrive.runs.failures.space import WorldSpace, feasible
from antdrive.runs.suites.demands import Demands
from antdrive.runs.suites.judging import unfulfilled
from antdrive.runs.suites.scenarios import task_of as scenario_task
from antdrive.runs.suites.suite import load_suite
from antdrive.sim import Outcome, Run, Scenario, run
from antdrive.sim.log.margin import CAUSES
from antdrive.worlds import Disc, World, rasterise

CARELESS: dict[str, Any] = {"margin": 0.0, "noise": 6.0, "smoothing": "none", "physics_hz": 120}


@pytest.fixture(scope="module")
def careless(jackal: RobotSpec) -> Scenario:
    """A set-up that fails in about every second world: no margin, and six times the robot's noise."""
    return Scenario.of("empty", "astar", jackal, **CARELESS)


@pytest.fixture(scope="module")
def found(careless: Scenario) -> Hunt:
    return find_failures(careless, budget=6, seed=3, method="random")


def test_every_finding_fails_again_and_leaves_room(found: Hunt) -> None:
    assert found.runs == 6
    assert found.findings
    for finding in found.findings:
        scenario = finding.scenario
        done = run(scenario)
        assert (failure_of(done), fingerprint_of(done)) == (finding.failure, finding.fingerprint)
        grid = rasterise(scenario.task.world, 0.02, scenario.inflate)
        plan = load_planner("dijkstra").plan(Query.between(grid, scenario.task), np.random.default_rng(0))
        assert plan.solved, "a fine grid has a path with the clearance that the set-up claims"


def test_a_test_of_a_finding_demands_what_was_touched_and_why(found: Hunt) -> None:
    finding = next(one for one in found.findings if one.failure.touched == "cylinder")
    done, failure = run(finding.scenario), finding.failure
    expected = expectation(done)
    assert expected == {"outcome": "collided", "touched": "cylinder", "cause": failure.cause}
    assert list(unfulfilled(done, Demands.of(expected))) == []
    other = next(cause for cause in CAUSES if cause != failure.cause)
    assert list(unfulfilled(done, Demands.of({**expected, "cause": other}))) == [
        f"cause: {failure.cause} took most of the margin, expected {other}"
    ]
    assert list(unfulfilled(done, Demands.of({**expected, "touched": "wall"}))) == ["touched: cylinder, expected wall"]


def test_the_same_seed_finds_the_same(found: Hunt, careless: Scenario) -> None:
    again = find_failures(careless, budget=3, seed=3, method="random")
    first = [finding for finding in found.findings if finding.number <= 3]
    assert [finding.scenario for finding in again.findings] == [finding.scenario for finding in first]
    assert [finding.fingerprint for finding in again.findings] == [finding.fingerprint for finding in first]


def test_a_finding_that_resembles_another_is_not_counted_twice(found: Hunt, careless: Scenario) -> None:
    finding = found.findings[0]
    again = hunting._finding(run(finding.scenario), finding.failure, 7, list(found.findings))
    assert not again.is_new
    assert set(found.distinct) == {one for one in found.findings if one.is_new}
    assert found.findings[0].is_new


@pytest.mark.parametrize("method", METHODS)
def test_ctrl_c_keeps_what_was_found(careless: Scenario, monkeypatch: pytest.MonkeyPatch, method: str) -> None:
    runs: list[Run] = []

    def until_the_third(scenario: Scenario) -> Run:
        if len(runs) == 2:
            raise KeyboardInterrupt
        runs.append(run(scenario))
        return runs[-1]

    monkeypatch.setattr(hunting, "run", until_the_third)
    monkeypatch.setattr(search, "REHEARSED", 3)
    stopped = find_failures(careless, budget=50, method=method)
    assert (stopped.runs, stopped.interrupted) == (2, True)
    assert len(stopped.findings) == sum(failure_of(done) is not None for done in runs)
    assert stopped.driven == sum(done.rollout is not None for done in runs)


class Crashes(AStar):
    """A planner that raises something in about every second world."""

    def plan(self, query: Query, rng: np.random.Generator) -> PlanResult:
        if query.task is not None and int(1000 * query.task.world.obstacles[-1].y) % 2 == 0:
            raise IndexError("pop from empty list")
        return super().plan(query, rng)


@pytest.mark.parametrize("method", METHODS)
def test_a_planner_that_raises_is_a_finding(
    jackal: RobotSpec, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, method: str
) -> None:
    monkeypatch.setattr(search, "REHEARSED", 3)
    setup = Scenario.of("empty", Crashes(), jackal, **CARELESS)
    hunt = find_failures(setup, budget=4, seed=3, method=method, obstacles=2)
    raised = [finding for finding in hunt.findings if finding.failure.outcome == "planner_error"]
    assert hunt.runs == 4
    assert raised
    assert sum(finding.is_new for finding in raised) == 1
    assert "IndexError: pop from empty list" in raised[0].failure.cause
    small = shrink(raised[0].scenario, seconds=1)
    assert small.failure == raised[0].failure
    (handed,) = report(Hunt((raised[0],), 4), tmp_path, seconds=0)
    (case,) = load_suite(tmp_path / "failures.drive.yaml")
    assert handed.scenario.task.world.obstacles == scenario_task(case).world.obstacles


def test_ctrl_c_while_shrinking_hands_over_what_was_found(
    found: Hunt, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def interrupted(*_: object, **__: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(reporting, "shrink", interrupted)
    reported = report(Hunt(found.distinct[:1], 1), tmp_path)
    assert [one.repeats for one in reported] == [True]
    other = replace(found.distinct[0], fingerprint="of another drive")
    assert [one.repeats for one in report(Hunt((other,), 1), tmp_path, seconds=0)] == [False]


def test_no_path_counts_only_where_the_grid_has_no_excuse(small_scenario: Scenario) -> None:
    """Two cylinders leave a gap that the robot fits through, between cells of 0.5 m."""
    gap = 2 * small_scenario.inflate + 0.02
    sides = (Disc(2.0, 0.5, 1.0 - gap / 2), Disc(2.0, 2.5, 1.0 - gap / 2))
    world = World("gap", (0.0, 0.0, 4.0, 3.0), sides)
    tight = replace(small_scenario, task=replace(small_scenario.task, world=world), cell=0.5)
    done = run(tight)
    assert done.outcome is Outcome.NO_PATH
    assert feasible(tight.task, tight.inflate)
    assert hunting._failure(done) is None
    wide = replace(done, scenario=replace(tight, cell=0.005))
    assert hunting._failure(wide) is not None


@pytest.mark.parametrize(
    ("options", "says"),
    [
        ({"method": "wise"}, "method: unknown 'wise'; choose from guided, random"),
        ({"budget": 0}, "budget: must be at least 1"),
        ({"obstacles": 0}, "count: must be from 1 to 50"),
    ],
)
def test_wrong_options_are_refused(careless: Scenario, options: dict[str, Any], says: str) -> None:
    with pytest.raises(FieldError, match=says):
        find_failures(careless, **options)


@given(st.integers(1, 8), st.floats(0.02, 2.0), st.data())
def test_every_point_is_a_world_in_which_both_ends_are_free(count: int, radius: float, data: st.DataObject) -> None:
    space = WorldSpace(count, radius)
    point = np.array(data.draw(st.lists(st.floats(0, 1), min_size=3 * count, max_size=3 * count)))
    task = space.task(point, "w")
    assert len(task.world.obstacles) == count
    for x, y in (task.start[:2], task.goal):
        assert min(np.hypot(disc.x - x, disc.y - y) - disc.radius for disc in task.world.obstacles) > radius
        assert min(x, y, task.world.size[0] - x, task.world.size[1] - y) > radius


@pytest.mark.parametrize("noise", [0.0, 1.0])
def test_a_rehearsal_foretells_the_clearance_of_the_drive(careless: Scenario, noise: float) -> None:
    space, rng = WorldSpace(4, careless.robot.radius), np.random.default_rng(1)
    for seed in range(4):
        task = space.task(rng.random(space.dimensions), "w")
        scenario = replace(careless, task=task, noise=noise, seed=seed)
        done = run(scenario)
        if done.rollout is not None:
            assert rehearsed_clearance(scenario) == pytest.approx(float(done.rollout.clearance.min()), abs=0.03)


def test_the_guided_search_runs_the_world_that_is_rehearsed_worst(
    small_scenario: Scenario, monkeypatch: pytest.MonkeyPatch
) -> None:
    drawn = [replace(small_scenario, seed=seed) for seed in range(REHEARSED)]
    waiting = iter([None, *drawn[1:]])
    monkeypatch.setattr(search, "rehearsed_clearance", lambda scenario: abs(scenario.seed - 7.2))
    assert guided_world(lambda: next(waiting)) is drawn[7]
    assert guided_world(lambda: None) is None
