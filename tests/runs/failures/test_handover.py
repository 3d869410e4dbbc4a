"""A suite that is handed over stands for exactly the scenarios that failed."""

from dataclasses import replace

import pytest
import yaml

from antdrive.planners import load_planner
from antdrive.robots import Avoidance, PurePursuit, load_robot
from antdrive.runs.failures.failure import Attempt
from antdrive.runs.failures.handover import (
    _robot,
    expectation,
    renamed,
    run_elsewhere,
    scenario_name,
    write_suite,
)
from antdrive.runs.suites.demands import Bound
from antdrive.runs.suites.scenarios import scenario_of
from antdrive.runs.suites.suite import load_suite
from antdrive.sim import Certificate, Perception, ReplanPolicy, Scenario
from antdrive.sim.log.record import MarginRecord
from antdrive.sim.scenario import MarginChoice
from antdrive.testing.evaluation import evaluate_case
from antdrive.worlds import Disc


def handed(name, done):
    return Attempt(renamed(done.scenario, name), done)


SCENARIOS = {
    "plain": {},
    "planner": {"planner": load_planner("aco-han", ants=7), "planner_name": "aco-han", "seed": 3},
    "settings": {"margin": 0.0, "noise": 1 / 3, "smoothing": "none", "controller": PurePursuit(lookahead_time=0.5)},
    "unseen": {"unseen": (Disc(2.0, 2.6, 0.1, 0.5), Disc(3.0, 2.6, 0.1)), "time_limit": 12.5, "cell": 0.21},
    "rates": {"physics_hz": 120, "control_hz": 30},
    "unknown": {"map": "none", "localisation": "matching", "odometry": 2.0, "replanning": ReplanPolicy(patience=5.0)},
}
MOVERS = {
    "sees": {"perception": Perception(kind="positions", range=1 / 3)},
    "blind": {"avoidance": None, "replanning": ReplanPolicy(around_movers=False)},
    "steadfast": {"replanning": None},
    "careful": {"avoidance": Avoidance(horizon=2.0), "replanning": ReplanPolicy(patience=5.0)},
}


@pytest.mark.parametrize("name", [*SCENARIOS, *MOVERS])
def test_the_suite_gives_the_same_scenario(small_run, tmp_path, name):
    scenario = replace(small_run.scenario, **SCENARIOS.get(name, {}))
    if name in MOVERS:
        scenario = replace(Scenario.of("plaza-moving", "dstar-lite"), **MOVERS[name])
    suite = write_suite(tmp_path / "s.drive.yaml", [handed(name, replace(small_run, scenario=scenario))])
    (case,) = load_suite(suite)
    assert scenario_of(case) == replace(renamed(scenario, name), margin=scenario.planned_margin), (
        "the suite survives other defaults"
    )


@pytest.mark.parametrize("shape", ["disc", "rectangle"])
def test_a_robot_of_ones_own_is_written_beside_the_suite(small_run, jackal, tmp_path, shape):
    own = replace(small_run.scenario.robot if shape == "disc" else jackal, name="my own/1", max_speed=0.61, source=None)
    scenario = replace(small_run.scenario, robot=own)
    suite = write_suite(tmp_path / "s.drive.yaml", [handed("own", replace(small_run, scenario=scenario))])
    (case,) = load_suite(suite)
    assert scenario_of(case).robot == own


def test_two_robots_of_one_name_have_files_of_their_own(small_run, tmp_path):
    spec = small_run.scenario.robot
    robots = [replace(spec, name="mine", max_speed=speed, source=None) for speed in (0.61, 0.62, 0.61)]
    runs = [replace(small_run, scenario=replace(small_run.scenario, robot=robot)) for robot in robots]
    suite = write_suite(tmp_path / "s.drive.yaml", [handed(f"r{k}", done) for k, done in enumerate(runs)])
    assert [scenario_of(case).robot for case in load_suite(suite)] == robots
    assert sorted(path.name for path in (tmp_path / "robots").iterdir()) == ["mine-2.yaml", "mine.yaml"]


def test_the_suite_holds_as_long_as_the_failure_repeats(collided_run, tmp_path):
    suite = write_suite(tmp_path / "s.drive.yaml", [handed("hit", collided_run)], ["as it was"])
    (case,) = load_suite(suite)
    assert evaluate_case(case).faults == ()
    assert case.entry.expect == {"outcome": "collided", "touched": "unseen cylinder"}
    mended = yaml.safe_load(suite.read_text())
    del mended["scenarios"]["hit"]["unseen"]
    suite.write_text(yaml.safe_dump(mended))
    (case,) = load_suite(suite)
    result = evaluate_case(case)
    assert result.faults == ("outcome: succeeded, expected collided",), "and nothing about a missing baseline"


def test_a_chosen_margin_is_handed_over_as_a_number(small_scenario, tmp_path):
    record = MarginRecord(loss_m=0.02, reserve_m=0.01, probability=0.001, drives=80)
    choice = MarginChoice(margin=0.04, record=record, factors=replace(small_scenario, margin=0.04).loss_factors)
    auto = replace(small_scenario, margin=0.04, margin_choice=choice)
    assert auto.chosen == choice
    done = Attempt.of(renamed(auto, "auto"))
    assert run_elsewhere(write_suite(tmp_path / "s.drive.yaml", [done])) == [done.fingerprint]


def test_what_is_expected_of_a_success_that_fails_otherwise(small_run):
    bound = Bound("min_clearance_m", "<", 0.02)
    assert expectation(small_run, bound) == {"outcome": "succeeded", "certified": True, "min_clearance_m": "< 0.02"}
    refused = replace(small_run, certificate=Certificate(False, 0, 0.1, 0.1, ("digest",)))
    assert expectation(refused) == {"outcome": "succeeded", "certified": False}


@pytest.mark.slow
def test_what_was_written_is_what_another_process_runs(small_run, tmp_path):
    suite = write_suite(tmp_path / "s.drive.yaml", [handed(name, small_run) for name in ("one", "two", "three")])
    world = tmp_path / "worlds" / "two.yaml"
    world.write_text(world.read_text().replace("radius: 0.3", "radius: 0.31"))
    (tmp_path / "worlds" / "three.yaml").unlink()
    one, two, three = run_elsewhere(suite)
    assert one == Attempt.of(renamed(small_run.scenario, "one")).fingerprint != two
    assert "scenarios.three.world: worlds/three.yaml: no such file" in three


@pytest.mark.parametrize(
    ("text", "name"), [("a b", "a_b"), ("__hidden", "hidden"), ("ä/é", "failure"), ("x" * 200, "x" * 90)]
)
def test_a_scenario_has_a_name_that_suites_take(small_run, tmp_path, text, name):
    assert scenario_name(text) == name
    suite = write_suite(tmp_path / "s.drive.yaml", [handed(f"{scenario_name(text)}-small", small_run)])
    assert [case.name for case in load_suite(suite)] == [f"{name}-small"]


@pytest.mark.parametrize("name", ["warehouse", "pioneer3dx"])
def test_a_robot_whose_footprint_is_beside_its_axle_is_handed_over_as_it_is(name, tmp_path):
    mine = replace(load_robot(name), name="mine", mass=31.0)
    assert load_robot(tmp_path / _robot(mine, tmp_path, {})) == mine
