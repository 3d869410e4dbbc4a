"""Drives that are observed and commanded from outside."""

from __future__ import annotations

import dataclasses
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
        state = PursuitState()
        while not drive.ended and (now := drive.observe()).tick < periods:
            command, state = controller.step(now, drive.path, state)
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
    with pytest.raises((FieldError, InputError), match="a loop of its own"):
        rerun(again)


def test_a_drive_commanded_from_outside_may_leave_its_route(scenario):
    with Session(changed(scenario, "task.world", bounds=(-9.0, -9.0, 9.0, 9.0))) as drive:
        while math.dist(drive.true_pose[:2], scenario.task.start[:2]) < 4.0:
            drive.step(Twist(-min(drive.observe().tick / 300, 0.4), 0.0))
    log = drive.rollout
    assert certify(log).certified
    record = dataclasses.replace(log.record, controller=dataclasses.replace(log.record.controller, name="PurePursuit"))
    assert "off it" in " ".join(certify(dataclasses.replace(log, record=record)).problems)


def test_the_true_pose_is_that_of_the_log(scenario):
    with Session(scenario) as drive:
        poses = [drive.true_pose]
        for _ in range(3):
            drive.step(Twist(0.3, 0.1))
            poses.append(drive.true_pose)
    assert [tuple(pose) for pose in drive.rollout.pose[::4].tolist()] == poses
    with pytest.raises(FieldError, match="true_pose: there is no drive"):
        _ = Session(scenario).true_pose


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


@pytest.mark.parametrize("periods", [0, 30])
def test_a_loop_that_stops_off_the_goal_logs_it(scenario, periods):
    with Session(scenario) as drive:
        for _ in range(periods):
            drive.step(Twist(0.3, 0.0))
        drive.step(None)
    assert drive.run.outcome is Outcome.STOPPED
    assert not certify(drive.rollout).problems


def test_commands_of_mind_and_loop_mix_within_the_robots_limits(scenario):
    with Session(scenario) as drive:
        while not drive.ended:
            command, note = drive.mind.act(drive.observe())
            if drive.observe().tick % 40 < 3:
                drive.step(Twist(-9.0, 50.0))
            else:
                drive.step(command, note)
    assert not certify(drive.rollout).problems
    assert drive.rollout.record.controller.name == "Session"


def test_a_note_belongs_to_its_command(scenario):
    with Session(scenario) as drive:
        command, note = drive.mind.act(drive.observe())
        for given in (Twist(math.nan, 0.0), Twist(command.speed / 2, 0.0)):
            with pytest.raises(FieldError, match="note: belongs to another command"):
                drive.step(given, note)
        with pytest.raises(FieldError, match="note: is not the one"):
            drive.step(command, note._replace(limiter=99))


def test_a_drive_by_its_mind_that_is_left_early_repeats(scenario):
    with Session(scenario) as drive:
        for _ in range(50):
            drive.step(*drive.mind.act(drive.observe()))
    assert rerun(drive.rollout).digest == drive.rollout.digest


def test_no_sense_tells_the_true_velocity_of_noisy_wheels(scenario):
    with Session(dataclasses.replace(scenario, noise=1.0)) as drive:
        off = []
        for _ in range(60):
            before, now = drive.true_pose, drive.observe()
            drive.step(Twist(0.3, 0.0))
            off.append(abs(now.twist.speed - math.dist(before[:2], drive.true_pose[:2]) * 60))
    assert max(off[30:]) > 1e-3


def test_a_session_is_driven_once_and_has_its_run_afterwards(scenario):
    drive = Session(scenario)
    with drive:
        with pytest.raises(FieldError, match="leave the `with` block"):
            _ = drive.run
        drive.step(Twist(0.1, 0.0))
    with pytest.raises(FieldError, match="create another"):
        drive.__enter__()
