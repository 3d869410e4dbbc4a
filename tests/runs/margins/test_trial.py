"""One drive of a calibration: its loss is the margin less what a certificate proves."""

import dataclasses
import math
import zlib
from typing import Any

import numpy as np
import pytest

from antdrive.base.errors import FieldError
from antdrive.robots import Footprint, PurePursuit, RobotSpec
from antdrive.runs.margins.courses import course
from antdrive.runs.margins.trial import Conditions, least_bound, loss_on_course
from antdrive.sim import Run, Scenario, run
from antdrive.sim.driving.driver import Driver


def conditions(robot: RobotSpec, **changes: Any) -> Conditions:
    return Conditions(**{"robot": robot, "controller": PurePursuit(), "noise": 1.0, "smoothing": "taut", **changes})


def test_the_bound_is_that_of_the_certificate(small_run: Run, collided_run: Run) -> None:
    for done in (small_run, collided_run):
        assert done.rollout is not None
        assert done.certificate is not None
        found = least_bound(done.rollout, done.scenario.robot.radius, done.rollout.clearance)
        assert found == pytest.approx(done.certificate.bound, abs=1e-9)


@pytest.mark.parametrize("smoothing", ["none", "taut", "clearance"])
def test_a_trial_is_the_drive_that_the_pipeline_makes(jackal: RobotSpec, smoothing: str) -> None:
    """The same course, driven by `run` without noise: the loss is what its certificate leaves of the margin."""
    margin, seed = 0.08, 2
    with_noise = loss_on_course(conditions(jackal, smoothing=smoothing), margin, seed)
    without = loss_on_course(conditions(jackal, smoothing=smoothing, noise=0.0), margin, seed)
    task = course(jackal, jackal.radius + margin, np.random.default_rng([seed, zlib.crc32(b"course")]))
    done = run(Scenario.of(task, "astar", jackal, margin=margin, smoothing=smoothing))
    assert done.succeeded
    assert done.certificate is not None
    assert without.footprint == pytest.approx(margin - done.certificate.bound, abs=1e-12)
    assert without.disc > without.footprint
    assert with_noise.footprint != without.footprint


def test_a_drive_that_fails_loses_everything(turtlebot: RobotSpec) -> None:
    blind = dataclasses.replace(turtlebot.noise, pose_xy=0.5, pose_yaw=0.5)
    lost = dataclasses.replace(turtlebot, noise=blind)
    assert loss_on_course(conditions(lost), 0.01, 0) == (math.inf, math.inf)


@pytest.mark.parametrize(("smoothing", "margin", "seed"), [("none", 0.1, 37), ("clearance", 0.03, 3)])
def test_a_robot_that_brakes_in_a_bend_does_not_follow_it_into_a_pillar(
    jackal: RobotSpec, smoothing: str, margin: float, seed: int
) -> None:
    """Slip brings the arc on which the robot can stop nearer to a pillar; held, it took the whole margin."""
    assert loss_on_course(conditions(jackal, smoothing=smoothing), margin, seed).disc < margin / 2


def test_a_robot_that_turns_to_and_fro_drives_off(turtlebot: RobotSpec, monkeypatch: pytest.MonkeyPatch) -> None:
    """Among this course's pillars the carrot jumps from -0.29 to 0.45 rad while the robot turns to it, and back."""
    here = conditions(turtlebot, smoothing="none")
    assert loss_on_course(here, 0.03, 5).footprint < 0.03
    monkeypatch.setattr(Driver, "_pursue", lambda driver, *now: driver._controller.step(driver.tracked, *now))
    assert loss_on_course(here, 0.03, 5).footprint == math.inf


def test_every_condition_has_a_part_in_the_key_and_labels_have_none(turtlebot: RobotSpec) -> None:
    usual = conditions(turtlebot)
    others = [
        conditions(dataclasses.replace(turtlebot, footprint=Footprint.disc(0.19))),
        conditions(dataclasses.replace(turtlebot, noise=dataclasses.replace(turtlebot.noise, slip=0.03))),
        conditions(turtlebot, controller=PurePursuit(lookahead_time=0.3)),
        conditions(turtlebot, noise=0.5),
        conditions(turtlebot, smoothing="none"),
        conditions(turtlebot, physics_hz=480),
        conditions(turtlebot, control_hz=30),
    ]
    assert len({usual.key, *(other.key for other in others)}) == 1 + len(others)
    assert conditions(dataclasses.replace(turtlebot, name="mine", source=None)).key == usual.key


def test_an_unknown_smoothing_is_refused(turtlebot: RobotSpec) -> None:
    with pytest.raises(FieldError, match="smoothing: unknown 'round'; choose from none"):
        conditions(turtlebot, smoothing="round")
