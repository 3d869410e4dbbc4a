"""Contacts of surfaces that are still apart: with a force where they would meet within the step, and never farther apart."""

from dataclasses import replace

import numpy as np
import pytest

from antdrive import Scenario, run
from antdrive.sim import Outcome, Rollout
from antdrive.worlds import Disc, Keyframed
from tests.sim.log.test_certificate_faults import HZ, drive, only_beyond, says, with_task

APART = "physics reports surfaces no farther apart"
ROW = 400


def touching(apart: float, force: float = 5.0, *, speed: float = 0.0) -> Rollout:
    return replace(drive(speed), contacts=np.array([[ROW, 0, apart, force]]))


@pytest.mark.parametrize("robot", ["turtlebot", "jackal"])
def test_a_genuine_collision_is_refused_for_the_contact_alone(robot: str) -> None:
    """Of the README: the first contact at speed has a force while the surfaces are 1 to 4 mm apart."""
    result = run(Scenario.of("empty", "astar", robot, unseen=(Disc(3.0, 3.0, 0.2),)))
    assert result.outcome is Outcome.COLLIDED
    assert result.rollout is not None
    assert result.rollout.contacts[:, 2].max() > 1e-3
    assert not says(result.rollout, "contacts: ")
    forged = result.rollout.contacts.copy()
    forged[:, 2] = 0.011  # nearer than the closed form's allowance, farther than a step
    assert says(replace(result.rollout, contacts=forged), APART)


def test_how_far_apart_surfaces_in_contact_may_be() -> None:
    only_beyond(2e-4, lambda apart: touching(apart, 0.0, speed=0.5), APART)
    only_beyond(2e-4, lambda apart: touching(apart), APART)
    only_beyond(2e-4 + 0.5 / HZ, lambda apart: touching(apart, speed=0.5), APART)
    assert says(touching(0.0, -1.0), APART)


def test_a_robot_that_turns_or_slides_aside_or_a_mover_comes_nearer_too() -> None:
    turning = touching(0.0)
    twist = turning.twist.copy()
    twist[ROW - 1, 1] = 2.0
    radius = turning.record.robot.footprint.radius
    only_beyond(2e-4 + 2.0 * radius / HZ, lambda a: replace(touching(a), twist=twist), APART)
    pose = turning.pose.copy()
    pose[ROW - 1 :, 1] += 0.002
    only_beyond(2.2e-3, lambda a: replace(touching(a), pose=pose), APART)
    mover = Keyframed(radius=0.2, keyframes=((0.0, 3.0, 3.0), (2.0, 5.0, 3.0)))
    world = replace(turning.record.task.world, obstacles=(), movers=(mover,))
    moving = with_task(turning, world=world)
    places = moving.trajectories().positions(moving.t)
    only_beyond(2e-4 + 1.0 / HZ, lambda a: replace(moving, movers=places, contacts=touching(a).contacts), APART)
