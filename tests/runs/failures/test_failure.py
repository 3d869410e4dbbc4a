"""What counts as a failure, which failures are the same, and the scenario that is rebuilt from a log's record."""

import dataclasses
from dataclasses import replace

import pytest

from antdrive.base import InputError
from antdrive.planners import PLANNERS, GridPlanner
from antdrive.robots import Avoidance, PurePursuit
from antdrive.runs.failures.failure import Failure, bound_broken_in, failure_of, parse_bound, without_numbers
from antdrive.runs.suites import Baseline, Demands, load_suite
from antdrive.runs.suites.demands import Bound
from antdrive.sim import METRICS, Certificate, DriveRecord, Outcome, Perception, ReplanPolicy, Scenario, run
from antdrive.sim.log.record import ComponentRecord, settings_of
from antdrive.sim.recorded import rebuilt
from antdrive.worlds import Cruising, Disc, Task, World
from tests.records import made_up_record


def test_a_certified_success_is_no_failure(small_run):
    assert failure_of(small_run) is None


def test_a_contact_names_what_was_touched(collided_run):
    assert failure_of(collided_run) == Failure("collided", "unseen cylinder", "")


def test_a_contact_with_a_mover_is_told_apart(small_scenario):
    world = World("m", (0.0, 0.0, 4.0, 3.0), movers=(Cruising(radius=0.2, position=(3.5, 1.5), velocity=(-0.5, 0.0)),))
    task = Task(world, (0.5, 1.5, 0.0), (3.5, 1.5))
    blind = replace(small_scenario, task=task, avoidance=None, replanning=None)
    assert failure_of(run(blind)) == Failure("collided", "mover", "")


def test_a_refused_certificate_is_a_failure_with_the_check_that_refused(small_run):
    certificate = Certificate(False, 0, 0.1, 0.1, ("pose: the steps at t = 1.234 s do not follow",))
    found = failure_of(replace(small_run, certificate=certificate))
    assert found == Failure("succeeded", "nothing", "certificate: pose: the steps at t = # s do not follow")


def test_no_path_is_a_failure(small_scenario):
    fence = tuple(Disc(2.0, 0.25 + 0.5 * k, 0.26) for k in range(6))
    task = Task(World("fence", (0.0, 0.0, 4.0, 3.0), fence), (0.5, 1.5, 0.0), (3.5, 1.5))
    found = failure_of(run(replace(small_scenario, task=task)))
    assert (found.outcome, found.touched) == (Outcome.NO_PATH.key, "nothing")
    assert "of # m (radius # + margin #)" in found.cause, "to be the same in other worlds"
    assert "of 0.21 m (radius 0.18 + margin 0.03)" in found.sentence
    assert "#" not in found.sentence
    assert found == replace(found, reason="")


@pytest.mark.parametrize(("text", "holds"), [("min_clearance_m < 0.9", True), ("min_clearance_m>=.9", False)])
def test_a_bound_replaces_the_verdict(small_run, text, holds):
    found = failure_of(small_run, parse_bound(text))
    assert (found is not None) == holds
    if found:
        assert found == Failure("succeeded", "nothing", "min_clearance_m < 0.9")


def test_reasons_from_different_worlds_are_the_same_without_their_numbers():
    one = (
        "turning on the spot at the start would bring jackal into obstacles[3] at (1.5, -2) with radius 0.3; x 0.363 m"
    )
    two = "turning on the spot at the start would bring jackal into the left wall; x 1e-05 m"
    assert without_numbers(one) == without_numbers(two)
    assert without_numbers("movers[0] stands") != without_numbers("nothing stands")


@pytest.fixture
def case(tmp_path):
    """A test that expects nothing of the small run's metrics; its baseline says what each test below writes into it."""
    path = tmp_path / "a.drive.yaml"
    path.write_text("{schema: 1, scenarios: {small: {world: empty}}}")
    return load_suite(path)[0]


def accepted(case, run, line=0.0, **metrics):
    """Write the baseline of a drive with other metrics, and with its end elsewhere."""
    made = Baseline.of(run, case.id)
    x, y, yaw, rule = made.line[-1]
    moved = (*made.line[:-1], (x + line, y, yaw, rule))
    dataclasses.replace(made, metrics={**made.metrics, **metrics}, line=moved).save(case.baseline_path)


def demanding(case, **expect):
    return dataclasses.replace(case, demands=Demands.of(expect))


def test_a_test_that_is_worse_than_its_baseline_fails_by_the_bound_that_this_sets(case, small_run):
    assert bound_broken_in(case, small_run) is None, "there is no baseline"
    accepted(case, small_run)
    assert bound_broken_in(case, small_run) is None, "it is as good as its baseline"
    drove = small_run.metrics
    for name, then, sign in (
        ("duration_s", drove["duration_s"] - 1.0, ">"),
        ("min_clearance_m", drove["min_clearance_m"] + 0.1, "<"),
        ("jerk_rms", drove["jerk_rms"] / 2, ">"),
    ):
        accepted(case, small_run, **{name: then})
        found = bound_broken_in(case, small_run)
        assert (found.metric, found.sign) == (name, sign)
        allowed = METRICS[name].tolerance.allowed(then)
        assert found.value == pytest.approx(then + (allowed if sign == ">" else -allowed), abs=2e-6)
        failure = failure_of(small_run, found)
        assert failure.cause == str(found)


def test_a_bound_of_the_test_comes_before_its_baseline(case, small_run):
    accepted(case, small_run, duration_s=0.5)
    assert bound_broken_in(demanding(case, spl=">= 0.9999"), small_run) == Bound("spl", "<", 0.9999)
    contacts = demanding(case, contacts_driving=2)
    assert bound_broken_in(contacts, small_run) == Bound("contacts_driving", "<", 2.0)


def test_a_run_that_ends_otherwise_is_the_failure_itself(case, small_run, collided_run):
    accepted(case, small_run, duration_s=0.5)
    assert bound_broken_in(case, collided_run) is None
    assert bound_broken_in(demanding(case, outcome="collided", touched="unseen cylinder"), collided_run) is None


def test_what_no_other_world_repeats_is_said_in_one_line(case, small_run):
    accepted(case, small_run, line=0.2)
    with pytest.raises(
        InputError, match=r"a\.drive\.yaml::small\[0\]: end_m: .* 0\.2 m apart.*; another world cannot repeat that"
    ):
        bound_broken_in(case, small_run)


def record_of(scenario):
    rollout = run(scenario).rollout
    return DriveRecord.from_json(replace(rollout.record, digest="0").to_json())


@pytest.mark.parametrize("name", PLANNERS)
def test_every_planner_is_rebuilt_with_its_options(name):
    planner = replace(PLANNERS[name], **({"ants": 7} if hasattr(PLANNERS[name], "ants") else {}))
    options = {key: getattr(planner, key) for key in vars(planner)}
    record = made_up_record(planner=ComponentRecord(name=name, settings=settings_of(options)))
    scenario = rebuilt(replace(record, controller=ComponentRecord(name="PurePursuit", settings=vars(PurePursuit()))))
    assert scenario.planner == planner
    assert scenario.planner_name == name


@pytest.mark.parametrize(
    "changes",
    [
        {"noise": 1.0, "seed": 4, "unseen": (Disc(2.0, 2.6, 0.1, 0.5),), "margin": 0.01},
        {"smoothing": "none", "cell": 0.2, "controller": PurePursuit(lookahead_time=0.5), "physics_hz": 120},
    ],
    ids=["noise", "settings"],
)
def test_the_rebuilt_scenario_drives_the_same_bits(small_scenario, changes):
    original = replace(small_scenario, **changes)
    done, again = run(original).rollout, run(rebuilt(record_of(original))).rollout
    assert again.digest == done.digest


def test_what_the_robot_knows_of_movers_and_does_about_them_is_rebuilt():
    original = Scenario.of(
        "plaza-moving",
        "astar",
        time_limit=3.0,
        perception=Perception(kind="positions", range=3.0),
        avoidance=Avoidance(horizon=2.0),
        replanning=ReplanPolicy(patience=5.0),
    )
    found = rebuilt(record_of(original))
    keys = ("task", "perception", "avoidance", "replanning", "time_limit")
    assert {key: getattr(found, key) for key in keys} == {key: getattr(original, key) for key in keys}
    blind = replace(original, avoidance=None, replanning=None, perception=Perception())
    assert (rebuilt(record_of(blind)).avoidance, rebuilt(record_of(blind)).perception) == (None, Perception())


class Homemade(GridPlanner):
    """A planner that is not registered."""

    def search(self, query, rng):
        return PLANNERS["astar"].plan(query, rng)


def test_an_unregistered_planner_is_one_line_that_names_it():
    record = made_up_record(planner=ComponentRecord(name="Homemade", settings={}))
    with pytest.raises(InputError, match=r"record\.planner\.name: 'Homemade' is not registered.*entry point"):
        rebuilt(record)
    controller = ComponentRecord(name="PurePursuit", settings=vars(PurePursuit()))
    assert rebuilt(replace(record, controller=controller), Homemade()).planner_name == "Homemade"


def test_the_name_of_a_class_is_found_too():
    controller = ComponentRecord(name="PurePursuit", settings=vars(PurePursuit()))
    record = made_up_record(planner=ComponentRecord(name="AStar", settings={}), controller=controller)
    assert rebuilt(record).planner_name == "astar"


@pytest.mark.parametrize(
    ("controller", "says"),
    [
        (ComponentRecord(name="Mine", settings={}), "record.controller.name: 'Mine' is not registered"),
        (
            ComponentRecord(name="PurePursuit", settings={"speed": 1.0}),
            "record.controller.speed: no option of pure-pursuit is called 'speed'",
        ),
    ],
    ids=lambda value: value.name if isinstance(value, ComponentRecord) else "",
)
def test_another_controller_is_refused(controller, says):
    with pytest.raises(InputError, match=says):
        rebuilt(made_up_record(controller=controller))
