"""Genuine logs replay bit for bit: static, moving, noisy and collided; forged ones lead elsewhere."""

from dataclasses import replace

import numpy as np
import pytest

from antdrive.sim import run
from antdrive.sim.driving.replay import ReplayCheck, offsets, replay
from tests.records import changed


def driven(found):
    return found.rollout


def test_speeds_count_as_poses_do_and_differences_have_no_sign(small_run):
    log = driven(small_run)
    twist = log.twist.copy()
    twist[5, 0] += 1e-5
    check = replay(replace(log, twist=twist))
    assert not check.exact
    assert check.twist == pytest.approx(1e-5, rel=1e-6)
    assert offsets(log.pose, log.twist, replace(log, twist=twist))[2] == pytest.approx(1e-5, rel=1e-6)


def test_only_values_within_rounding_are_listed():
    check = ReplayCheck(False, 0.1, 0.0, 0.0, ("replay: something",), ("pose",))
    assert check.sentence.startswith("the replay differs: at most 0.1 m")
    assert replace(check, problems=()).sentence.startswith("replayed within rounding (pose): at most")
    assert replace(check, problems=(), rounded=()).sentence.startswith("replayed within rounding: at most")


def test_only_poses_and_twists_that_differ_have_figures():
    check = ReplayCheck(False, 0.0, 0.0, 0.0, ("replay: something",), ("route",))
    assert check.sentence == "the replay differs"
    assert replace(check, problems=()).sentence == "replayed within rounding (route)"
    assert "nan rad" in replace(check, turn=np.nan).sentence


def test_a_log_with_a_command_for_each_row_replays(small_scenario):
    log = driven(run(replace(small_scenario, noise=1.0, control_hz=240, time_limit=1.0)))
    check = replay(log)
    assert (check.exact, check.problems) == (True, ())


def test_a_forged_log_is_far_off(small_run):
    log = driven(small_run)
    world = replace(log.record.task.world, obstacles=())
    straight = replace(log, command=log.command * [1.0, 0.0])
    check = replay(straight)
    assert check.position > 0.3
    assert "lead to poses up to" in check.problems[0]
    through = changed(log.record, "task", world=world)
    assert replay(replace(log, record=through)).exact, "only --world shows that a cylinder is gone"


def test_rounding_is_a_millimetre(small_run):
    for error, fits in ((0.0009, True), (0.0011, False)):
        log = driven(small_run)
        pose = log.pose.copy()
        pose[100, 0] += error
        check = replay(replace(log, pose=pose))
        assert (check.problems == ()) is fits
        assert not check.exact


@pytest.mark.parametrize(("name", "rows"), [("estimate", slice(400, 401)), ("actuated", slice(401, 405))])
def test_noise_is_that_of_the_seed_to_a_millionth(small_scenario, name, rows):
    log = driven(run(replace(small_scenario, noise=1.0, seed=4)))
    for off, wrong in ((0.5e-6, False), (2e-6, True)):
        array = getattr(log, name).copy()
        array[rows, 1] += off
        problems = replay(replace(log, **{name: array})).problems
        assert any(f"{name} differs from the noise of seed 4, from t = " in problem for problem in problems) == wrong


def test_headings_of_estimates_are_compared_on_the_circle(small_scenario):
    log = driven(run(replace(small_scenario, noise=1.0, seed=4)))
    assert replay(replace(log, estimate=log.estimate + [0.0, 0.0, 2 * np.pi])).problems == ()
