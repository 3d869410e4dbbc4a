"""What counts as a failure, and which failures are the same."""

import dataclasses
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from antdrive.base.errors import FieldError, InputError
from antdrive.runs.failures.failure import Failure, bound_broken_in, failure_of, parse_bound, without_numbers
from antdrive.runs.suites import Baseline, Demands, SuiteCase, load_suite
from antdrive.runs.suites.demands import Bound
from antdrive.sim import METRICS, Certificate, Outcome, Run, Scenario, run
from antdrive.worlds import Cruising, Disc, Task, World


def test_a_certified_success_is_no_failure(small_run: Run) -> None:
    assert failure_of(small_run) is None


def test_a_contact_names_what_was_touched(collided_run: Run) -> None:
    assert failure_of(collided_run) == Failure("collided", "unseen cylinder", "")


def test_a_contact_with_a_mover_is_told_apart(small_scenario: Scenario) -> None:
    world = World("m", (0.0, 0.0, 4.0, 3.0), movers=(Cruising(radius=0.2, position=(3.5, 1.5), velocity=(-0.5, 0.0)),))
    task = Task(world, (0.5, 1.5, 0.0), (3.5, 1.5))
    blind = replace(small_scenario, task=task, avoidance=None, replanning=None)
    assert failure_of(run(blind)) == Failure("collided", "mover", "")


def test_a_refused_certificate_is_a_failure_with_the_check_that_refused(small_run: Run) -> None:
    certificate = Certificate(False, 0, 0.1, 0.1, ("pose: the steps at t = 1.234 s do not follow",))
    found = failure_of(replace(small_run, certificate=certificate))
    assert found == Failure("succeeded", "nothing", "certificate: pose: the steps at t = # s do not follow")


def test_no_path_is_a_failure(small_scenario: Scenario) -> None:
    fence = tuple(Disc(2.0, 0.25 + 0.5 * k, 0.26) for k in range(6))
    task = Task(World("fence", (0.0, 0.0, 4.0, 3.0), fence), (0.5, 1.5, 0.0), (3.5, 1.5))
    found = failure_of(run(replace(small_scenario, task=task)))
    assert found is not None
    assert (found.outcome, found.touched) == (Outcome.NO_PATH.key, "nothing")


@pytest.mark.parametrize(("text", "holds"), [("min_clearance_m < 0.9", True), ("min_clearance_m>=.9", False)])
def test_a_bound_replaces_the_verdict(small_run: Run, text: str, holds: bool) -> None:
    found = failure_of(small_run, parse_bound(text))
    assert (found is not None) == holds
    if found:
        assert found == Failure("succeeded", "nothing", "min_clearance_m < 0.9")


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("clearance < 1", "unknown metric 'clearance'; did you mean min_clearance_m"),
        ("plan_s < 1", "plan_s depends on the machine"),
        ("spl = 1", "write METRIC < NUMBER"),
        ("spl < much", "write METRIC < NUMBER"),
        ("spl < 1.2.3", "write METRIC < NUMBER"),
        ("spl < 1e999", "write METRIC < NUMBER"),
    ],
)
def test_a_wrong_bound_is_refused(text: str, says: str) -> None:
    with pytest.raises(FieldError, match=says):
        parse_bound(text)


def test_reasons_from_different_worlds_are_the_same_without_their_numbers() -> None:
    one = (
        "turning on the spot at the start would bring jackal into obstacles[3] at (1.5, -2) with radius 0.3; x 0.363 m"
    )
    two = "turning on the spot at the start would bring jackal into the left wall; x 1e-05 m"
    assert without_numbers(one) == without_numbers(two)
    assert without_numbers("movers[0] stands") != without_numbers("nothing stands")


@pytest.fixture
def case(tmp_path: Path) -> SuiteCase:
    """A test that expects nothing of the small run's metrics; its baseline says what each test below writes into it."""
    path = tmp_path / "a.drive.yaml"
    path.write_text("{schema: 1, scenarios: {small: {world: empty}}}")
    return load_suite(path)[0]


def accepted(case: SuiteCase, run: Run, line: float = 0.0, **metrics: float) -> None:
    """Write the baseline of a drive with other metrics, and with its end elsewhere."""
    made = Baseline.of(run, case.id)
    x, y, yaw, rule = made.line[-1]
    moved = (*made.line[:-1], (x + line, y, yaw, rule))
    dataclasses.replace(made, metrics={**made.metrics, **metrics}, line=moved).save(case.baseline_path)


def demanding(case: SuiteCase, **expect: Any) -> SuiteCase:
    return dataclasses.replace(case, demands=Demands.of(expect))


def test_a_test_that_is_worse_than_its_baseline_fails_by_the_bound_that_this_sets(
    case: SuiteCase, small_run: Run
) -> None:
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
        assert found is not None
        assert (found.metric, found.sign) == (name, sign)
        allowed = METRICS[name].tolerance.allowed(then)
        assert found.value == pytest.approx(then + (allowed if sign == ">" else -allowed), abs=2e-6)
        failure = failure_of(small_run, found)
        assert failure is not None
        assert failure.cause == str(found)


def test_a_bound_of_the_test_comes_before_its_baseline(case: SuiteCase, small_run: Run) -> None:
    accepted(case, small_run, duration_s=0.5)
    assert bound_broken_in(demanding(case, spl=">= 0.9999"), small_run) == Bound("spl", "<", 0.9999)
    contacts = demanding(case, contacts_driving=2)
    assert bound_broken_in(contacts, small_run) == Bound("contacts_driving", "<", 2.0)


def test_a_run_that_ends_otherwise_is_the_failure_itself(case: SuiteCase, small_run: Run, collided_run: Run) -> None:
    accepted(case, small_run, duration_s=0.5)
    assert bound_broken_in(case, collided_run) is None
    assert bound_broken_in(demanding(case, outcome="collided", touched="unseen cylinder"), collided_run) is None


def test_what_no_other_world_repeats_is_said_in_one_line(case: SuiteCase, small_run: Run) -> None:
    accepted(case, small_run, line=0.2)
    with pytest.raises(
        InputError, match=r"a\.drive\.yaml::small\[0\]: end_m: .* 0\.2 m apart.*; no other world repeats that"
    ):
        bound_broken_in(case, small_run)
