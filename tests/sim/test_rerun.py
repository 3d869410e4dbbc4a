"""The scenario of a log drives the same log again; a forged value does not follow from any scenario."""

import math
from dataclasses import replace

import numpy as np
import pytest

from antdrive.base import InputError
from antdrive.planners import load_planner
from antdrive.robots import Footprint, load_robot
from antdrive.sim import Perception, Scenario, plan, run
from antdrive.sim import rerun as rerun_module
from antdrive.sim.log.consistency import wrong_optima
from antdrive.sim.log.rollout import FORMS
from antdrive.sim.rerun import ROUNDING, ReplayCheck, mismatches, replayed, rerun
from tests.records import COARSE, changed

pytestmark = pytest.mark.xdist_group("reruns")

KINDS = {
    "footprint": {
        "footprint": "exact",
        "robot": replace(load_robot("turtlebot"), footprint=Footprint.rectangle(0.4, 0.3)),
    },
    "noise": {"noise": 1.0, "seed": 4},
    "odometry": {"localisation": "odometry", "time_limit": 4.0},
    "plain": {},
}
AMONG_MOVERS = {
    "positions": ("turtlebot", {"perception": Perception(kind="positions", range=3.0)}),
    "lidar": ("jackal", {"perception": Perception(kind="lidar"), "noise": 1.0}),
    "mapless": ("jackal", {"map": "none", "localisation": "matching"}),
    "no avoidance": ("turtlebot", {"avoidance": None, "replanning": None}),
}


@pytest.fixture(scope="module")
def seen():
    """A noisy drive among movers that are seen by lidar, with every array but none of a contact."""
    settings = {"noise": 1.0, "map": "none", "time_limit": 7.0, **COARSE}
    return run(Scenario.of("plaza-moving", "astar", "jackal", **settings)).rollout


@pytest.fixture(scope="module")
def seen_again(seen):
    return rerun(seen)


@pytest.fixture(scope="module")
def noisy(small_scenario):
    return run(replace(small_scenario, noise=1.0, seed=4, **COARSE)).rollout


def rewritten(record, key, value):
    """A record with another value at a dotted key; `[]` is the first entry."""
    name, _, rest = key.partition(".")
    inner = getattr(record, name.removesuffix("[]"))
    if not rest:
        return replace(record, **{name: value})
    if name.endswith("[]"):
        return replace(record, **{name[:-2]: (rewritten(inner[0], rest, value), *inner[1:])})
    return replace(record, **{name: rewritten(inner, rest, value)})


@pytest.mark.parametrize("name", KINDS)
def test_a_genuine_log_is_driven_again_bit_for_bit(name, small_scenario):
    check = replayed(run(replace(small_scenario, **KINDS[name], **COARSE)).rollout)
    assert (check.exact, check.problems, check.rounded) == (True, (), ())
    assert check.sentence == "replayed bit for bit"


def test_a_collided_log_is_driven_again_bit_for_bit(collided_run):
    assert replayed(collided_run.rollout).exact


@pytest.mark.parametrize("name", AMONG_MOVERS)
def test_a_genuine_log_among_movers_is_driven_again_bit_for_bit(name):
    robot, settings = AMONG_MOVERS[name]
    check = replayed(run(Scenario.of("plaza-moving", "astar", robot, time_limit=5.0, **COARSE, **settings)).rollout)
    assert (check.exact, check.problems) == (True, ())


def test_every_array_is_compared(seen, seen_again, collided_run):
    filled = {name: log for log in (collided_run.rollout, seen) for name in FORMS if getattr(log, name).size}
    assert set(filled) == set(FORMS)
    again = {id(seen): seen_again, id(collided_run.rollout): rerun(collided_run.rollout)}
    for name, log in filled.items():
        array = getattr(log, name)
        least = 2 * ROUNDING if array.dtype.kind == "f" else 1
        middle = array.copy()
        middle[len(middle) // 2] += array.dtype.type(least)
        for forged in (middle, array[:-1], array[:0]):
            (found,) = mismatches(replace(log, **{name: forged}), again[id(log)])
            assert (found.name, found.rounded) == (name, False)


def test_the_first_row_that_differs_is_named(seen):
    estimate, tracks = seen.estimate.copy(), seen.tracks.copy()
    estimate[161:, 0] += 0.01
    tracks[-1, 4] += 0.1
    problems = replayed(replace(seen, estimate=estimate, tracks=tracks, route=seen.route[:-1])).problems
    assert "replay: the rerun differs in estimate, from t = 2.013 s" in problems
    assert f"replay: the rerun differs in tracks, from t = {tracks[-1, 0] / 80:.3f} s" in problems
    assert f"replay: the rerun differs in route, from point {len(seen.route)}" in problems
    assert sum("the rerun differs in" in problem for problem in problems) == 3


@pytest.mark.parametrize("name", ["estimate", "actuated"])
def test_noise_is_that_of_the_seed_to_a_millionth(name, noisy):
    again = rerun(noisy)
    for error, rounded in ((5e-7, True), (2e-6, False)):
        (found,) = mismatches(replace(noisy, **{name: getattr(noisy, name) + error}), again)
        assert (found.name, found.rounded) == (name, rounded)


def test_headings_are_compared_on_the_circle(seen, seen_again):
    turned = seen.estimate.copy()
    turned[:, 2] += 2 * np.pi
    (found,) = mismatches(replace(seen, estimate=turned), seen_again)
    assert found.rounded


def test_searches_that_the_log_omits_are_missed(seen):
    emptied = replace(seen, record=replace(seen.record, replans=()))
    assert "record.replans[].route" in [found.name for found in mismatches(emptied, seen)]


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("noise", 0.5), ("seed", 5), ("margin", 0.2), ("cell", 0.1), ("control_hz", 40), ("smoothing.asked", "none"),
        ("planner.name", "dijkstra"), ("controller.settings", {"lookahead_time": 2.0}), ("unseen", ()),
    ],
)  # fmt: skip
def test_another_input_drives_another_log(key, value, noisy):
    record = rewritten(noisy.record, key, value)
    check = replayed(replace(noisy, record=replace(record, inflate=record.robot.radius + record.margin)))
    assert bool(check.problems) == (key != "unseen")


def test_an_input_without_influence_describes_a_genuine_drive(small_run):
    """Other seeds of a perfect robot with A* drive the same log."""
    record = replace(small_run.rollout.record, seed=7)
    assert replayed(replace(small_run.rollout, record=record)).exact


def test_claims_are_not_compared(small_run):
    log = small_run.rollout
    times = replace(log.record.times, plan_s=99.0)
    record = changed(replace(log.record, times=times, versions={"antdrive": "9"}), "task.world", name="other")
    assert replayed(replace(log, record=record)).exact


def test_values_within_rounding_are_named_and_not_bit_for_bit(small_run):
    log = small_run.rollout
    pose = log.pose.copy()
    pose[5] += [1e-5, 0.0, 2e-5]
    plan = replace(log.record.plan, length_m=log.record.plan.length_m + 1e-6)
    check = replayed(replace(log, pose=pose, record=replace(log.record, plan=plan)))
    assert (check.exact, check.problems, check.rounded) == (False, (), ("pose", "record.plan.length_m"))
    assert check.sentence == (
        "replayed within rounding (pose, record.plan.length_m): at most 1e-05 m, 2e-05 rad and 0 m/s or rad/s off"
    )


def test_other_versions_are_named_with_a_difference(small_run):
    log = small_run.rollout
    record = replace(log.record, versions={**log.record.versions, "numpy": "1.0"}, reason="made up")
    problems = replayed(replace(log, record=record)).problems
    assert "record.reason: 'made up' in the log, '' in the rerun" in problems[0]
    assert problems[1].startswith("replay: the log says numpy 1.0, here numpy ")


def test_long_values_are_cut(small_run):
    log = small_run.rollout
    (problem,) = replayed(replace(log, record=replace(log.record, reason="x" * 200))).problems
    assert problem == f"replay: record.reason: '{'x' * 59}… in the log, '' in the rerun"


def test_a_rerun_ends_soon_after_its_log(small_run):
    """A log may promise a drive of days."""
    log = small_run.rollout
    half = len(log.t) // 2
    record = replace(log.record, time_limit=1e6)
    cut = {
        name: getattr(log, name)[:half] for name in ("t", "pose", "twist", "command", "clearance", "limiter", "movers")
    }
    again = rerun(replace(log, record=record, **cut))
    assert len(again.t) <= half + 241
    assert again.record.time_limit == 1e6


def test_a_plan_that_fails_is_a_problem(small_run):
    record = replace(small_run.rollout.record, margin=1.4, inflate=small_run.rollout.record.robot.radius + 1.4)
    (problem,) = [one for one in replayed(replace(small_run.rollout, record=record)).problems if "planning" in one]
    assert problem.startswith("replay: cells: planning again ends with no_path")


def test_a_plan_of_a_user_is_refused(small_scenario):
    other = plan(replace(small_scenario, planner=load_planner("dijkstra"), planner_name="dijkstra", margin=0.3))
    grid = plan(small_scenario)[0]
    problems = replayed(run(small_scenario, planned=(grid, other[1])).rollout).problems
    assert any("another planner, or another version of it, made the log's plan" in problem for problem in problems)
    assert replayed(run(small_scenario, planned=plan(small_scenario)).rollout).exact


def test_a_controller_of_a_user_cannot_be_rebuilt(small_run):
    record = changed(small_run.rollout.record, "controller", name="Mine")
    with pytest.raises(InputError, match="'Mine' is not registered, so the run cannot be rebuilt"):
        rerun(replace(small_run.rollout, record=record))


@pytest.mark.parametrize("key", ["grid_optimum_m", "euclidean_optimum_m"])
@pytest.mark.parametrize("value", [60.0, 3.0, None])
def test_the_world_refuses_another_optimum(key, value, small_run):
    record = small_run.rollout.record
    assert list(wrong_optima(record)) == []
    (problem,) = wrong_optima(changed(record, "plan", **{key: value}))
    right = getattr(record.plan, key)
    assert problem.startswith(f"record.plan.{key}: ")
    assert problem.endswith(f"in the log, {right:.6g} m in its world")


def test_equal_arrays_excuse_no_rounding_of_the_record(small_run):
    log = small_run.rollout
    plan = replace(log.record.plan, length_m=log.record.plan.length_m + 1e-6)
    check = replayed(replace(log, record=replace(log.record, plan=plan)))
    assert not check.exact
    assert [problem.split(":")[1] for problem in check.problems] == [" record.plan.length_m"]


def test_only_values_within_rounding_and_rows_that_differ_are_listed():
    check = ReplayCheck(False, 0.1, 0.0, 0.0, ("replay: something",), ("pose",))
    assert check.sentence.startswith("the replay differs: at most 0.1 m")
    assert replace(check, problems=()).sentence.startswith("replayed within rounding (pose): at most")
    assert replace(check, problems=(), rounded=()).sentence.startswith("replayed within rounding: at most")
    assert replace(check, position=0.0).sentence == "the replay differs"
    assert replace(check, position=math.nan).sentence == "not replayed"


def test_rounding_is_a_millimetre(small_run):
    log, again = small_run.rollout, rerun(small_run.rollout)
    for error, rounded in ((0.0009, True), (0.0011, False)):
        pose = log.pose.copy()
        pose[100, 0] += error
        (found,) = mismatches(replace(log, pose=pose), again)
        assert found.rounded is rounded


def test_lists_of_other_lengths_do_not_differ_by_rounding():
    assert rerun_module._within_rounding([1.0, 2.0], [1.0, 2.0 + 1e-6])
    assert not rerun_module._within_rounding([1.0, 2.0], [1.0])
