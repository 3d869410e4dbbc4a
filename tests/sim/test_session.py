"""Drives that are observed and commanded from outside."""

from __future__ import annotations

import math

import pytest

from antdrive import InputError, Session, certify, run
from antdrive.base.errors import FieldError
from antdrive.robots import PurePursuit, PursuitState, Twist
from antdrive.sim import Outcome, Rollout
from antdrive.sim.rerun import rerun
from antdrive.worlds import Disc
from tests.records import changed


@pytest.fixture
def scenario(small_scenario):
    return small_scenario


def followed(scenario, periods=math.inf):
    """A drive that is commanded by pure pursuit from outside, for some periods."""
    controller = PurePursuit()
    with Session(scenario) as drive:
        command, state = Twist(0.0, 0.0), PursuitState()
        while not drive.ended and (now := drive.observe()).tick < periods:
            command, state = controller.pursue(drive.path, now.pose, command, state)
            drive.step(command)
    return drive.run


def test_a_session_stepped_by_its_mind_is_the_run(scenario):
    with Session(scenario) as drive:
        while not drive.ended:
            drive.step(*drive.mind.act(drive.observe()))
    assert drive.run.rollout.digest == run(scenario).rollout.digest
    assert drive.run.certified


def test_a_drive_commanded_from_outside_is_logged_and_certified(scenario, tmp_path):
    done = followed(scenario)
    assert done.succeeded
    assert done.rollout.record.controller.name == "Session"
    done.rollout.save(tmp_path / "log.npz")
    again = Rollout.load(tmp_path / "log.npz")
    assert not certify(again).problems
    with pytest.raises((FieldError, InputError), match="Session"):
        rerun(again)


def test_a_session_that_is_left_early_has_an_honest_log(scenario):
    done = followed(scenario, periods=5)
    assert (done.outcome, len(done.rollout.t)) == (Outcome.STOPPED, 1 + 5 * 4)
    assert "left" in done.reason
    assert not done.certificate.problems


def test_an_exception_ends_the_log_where_it_was_raised(scenario):
    drive = Session(scenario)

    def fails():
        with drive:
            drive.step(Twist(0.1, 0.0))
            drive.step(Twist(1 / 0, 0.0))

    with pytest.raises(ZeroDivisionError):
        fails()
    assert (drive.run.outcome, len(drive.rollout.t)) == (Outcome.STOPPED, 1 + 4)
    assert "ZeroDivisionError" in drive.run.reason


@pytest.mark.parametrize("command", [(math.nan, 0.0), (0.0, math.inf), (0.1,), 0.1, "ab", (None, 1.0)])
def test_a_wrong_command_is_named_and_loses_no_row(scenario, command):
    with Session(scenario) as drive:
        drive.step(Twist(0.1, 0.0))
        with pytest.raises(FieldError, match="command: must be two finite numbers"):
            drive.step(command)
    assert len(drive.rollout.t) == 1 + 4


def test_a_session_drives_within_its_block_alone(scenario):
    drive = Session(scenario)
    with pytest.raises(FieldError, match="`with`"):
        drive.observe()
    with drive:
        drive.step(Twist(0.1, 0.0))
    with pytest.raises(FieldError, match="has ended"):
        drive.step(Twist(0.1, 0.0))


def test_a_session_without_a_path_ends_before_it_begins(scenario):
    shut = changed(scenario, "task.world", obstacles=tuple(Disc(2.0, y / 4, 0.2) for y in range(1, 12)))
    with Session(shut) as drive:
        assert drive.ended.outcome is Outcome.NO_PATH
        with pytest.raises(FieldError, match="no path"):
            drive.observe()
    assert (drive.run.outcome, drive.rollout) == (Outcome.NO_PATH, None)
