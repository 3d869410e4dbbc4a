"""What counts as a failure, and which failures are the same."""

from dataclasses import replace

import pytest

from antdrive.sim import Certificate, Outcome, Run, Scenario, run
from antdrive.sim.falsify.failure import Failure, failure_of, parse_bound, without_numbers
from antdrive.worlds import Cruising, Disc, Task, World
from antdrive.worlds.errors import FieldError


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
