"""Margin budgets against numbers worked by hand, and the search for the smallest safe margin."""

import math
from dataclasses import dataclass, replace

import numpy as np
import pytest

from antdrive.robots import Footprint, load_robot
from antdrive.runs.margins.choice import find_margin
from antdrive.sim import Outcome, Rollout, run
from antdrive.sim.log.margin import CAUSES, budget
from antdrive.worlds.world import Disc, Task, World
from tests.records import changed, made_up_log, made_up_record


def passing(offset, *, estimated=None, commanded=0.0, **changes):
    """Past a disc of radius 0.5 at (2, 1), a disc robot of radius 0.2 along y = offset; the route is y = 0.27: margin 0.03."""
    hz = 100
    t = np.arange(401) / hz
    pose = np.stack([t, np.full(401, offset), np.zeros(401)], axis=1)
    task = Task(World("one", (-5, -5, 9, 9), (Disc(2, 1, 0.5),)), (0, 0.27, 0), (4, 0.27))
    robot = replace(load_robot("turtlebot"), footprint=Footprint.disc(0.2))
    estimate = pose + (0, 0 if estimated is None else estimated - offset, 0)
    log = made_up_log(
        pose, hz, made_up_record(task=task, robot=robot, physics_hz=hz, margin=0.03, inflate=0.23),
        twist=np.tile([1.0, 0.0], (401, 1)), command=np.tile([1.0, commanded], (401, 1)),
        route=np.array([(0.0, 0.27), (4.0, 0.27)]), estimate=np.empty((0, 3)) if estimated is None else estimate,
    )  # fmt: skip
    return replace(log, **changes)


def losses(log):
    spent = budget(log)
    total = sum(part.at_tightest for part in spent.contributions)
    assert total == pytest.approx(spent.margin - spent.left)
    assert [part.cause for part in spent.contributions] == list(CAUSES)
    return {part.cause: part.metres for part in spent.contributions}


def test_on_the_route_nothing_is_lost():
    spent = budget(passing(0.27))
    assert spent.left == pytest.approx(0.03)  # 1 - 0.27 - 0.5 - 0.2
    assert max(losses(passing(0.27)).values()) == pytest.approx(0, abs=1e-12)


def test_tracking_error_towards_the_disc_costs_margin_and_away_from_it_does_not():
    assert losses(passing(0.28)) == pytest.approx({**dict.fromkeys(CAUSES, 0.0), "tracking": 0.01})
    spent = budget(passing(0.28))
    assert (spent.largest.cause, spent.largest.x, spent.largest.t) == ("tracking", pytest.approx(2), pytest.approx(2))
    assert max(losses(passing(0.25)).values()) == 0


def test_a_wrong_estimate_is_not_the_controllers_fault():
    assert losses(passing(0.28, estimated=0.27)) == pytest.approx({**dict.fromkeys(CAUSES, 0.0), "localisation": 0.01})


def test_slip_is_motion_that_was_not_commanded():
    """Commanded to turn away by 0.2 rad/s, for 0.25 s at 1 m/s: 0.00625 m off, had it turned."""
    loss = losses(passing(0.28, commanded=-0.2))
    away = sum(math.sin(-0.2 * (step - 0.5) * 0.01) * 0.01 for step in range(1, 26))
    # The farther point is also a little ahead of the disc's nearest, which changes its room by less than a tenth of a millimetre.
    assert loss["slip"] == pytest.approx(-away, abs=1e-4)
    assert loss["tracking"] == pytest.approx(0.01 + away, abs=1e-3)


def test_a_route_too_close_is_rounding_and_near_a_corner_it_is_cutting():
    close = passing(0.28, route=np.array([(0.0, 0.28), (4.0, 0.28)]))
    assert losses(close) == pytest.approx({**dict.fromkeys(CAUSES, 0.0), "rounding": 0.01})
    bent = passing(0.28, route=np.array([(0.0, 0.27), (2.1, 0.27), (4.0, -1.0)]))
    loss = losses(bent)
    assert loss["cutting"] > 0.009
    assert loss["tracking"] < 0.001


def rotated(yaw, *, forward=1.0, estimated=None, backwards=False):
    """The same drive by a rectangle of 0.4 x 0.2 m whose plan keeps 0.13 m free, at a constant heading."""
    log = passing(0.27)
    pose = log.pose + (0, 0, yaw)
    route = log.route[::-1] if backwards else log.route
    record = replace(log.record, robot=replace(log.record.robot, footprint=Footprint.rectangle(0.4, 0.2), track=0.15))
    estimate = np.empty((0, 3)) if estimated is None else log.pose + (0, 0, estimated)
    command = np.tile([forward, 0.0], (401, 1))
    record = replace(record, footprint_margin=0.13)
    return replace(log, record=record, pose=pose, route=route, estimate=estimate, command=command)


@pytest.mark.parametrize("backwards", [False, True])
def test_a_footprint_that_leaves_the_heading_of_its_straight_loses_margin(backwards):
    """Its corner, 0.2 m ahead and 0.1 m aside, comes closer to the disc."""
    closer = 0.2 * math.sin(0.1) + 0.1 * math.cos(0.1) - 0.1
    loss = losses(rotated(0.1, backwards=backwards))
    assert loss == pytest.approx({**dict.fromkeys(CAUSES, 0.0), "heading": closer}, abs=2e-4)
    assert max(losses(rotated(0.0, backwards=backwards)).values()) == pytest.approx(0, abs=1e-12)
    unknown = losses(rotated(0.1, estimated=0.0))
    assert unknown == pytest.approx({**dict.fromkeys(CAUSES, 0.0), "localisation": closer}, abs=2e-4)


def test_a_turn_on_the_spot_has_no_heading_to_leave():
    loss = losses(rotated(0.1, forward=0.0))
    assert loss["heading"] == 0
    assert loss["rounding"] > 0.01


def test_unseen_obstacles_do_not_count():
    log = passing(0.27)
    post, task = Disc(1.0, 0.5, 0.1), log.record.task
    hidden = changed(log, "record", unseen=(post,))
    assert budget(hidden).left == pytest.approx(0.03)
    world = replace(task.world, obstacles=(*task.world.obstacles, post))
    known = replace(log.record, task=replace(task, world=world))
    assert budget(replace(log, record=known)).left < 0


def test_a_real_noisy_drive_adds_up(small_scenario):
    result = run(replace(small_scenario, robot=load_robot("turtlebot"), noise=1.0, smoothing="taut"))
    loss = losses(result.rollout)
    assert loss["localisation"] > 0.001


@dataclass
class Faked:
    """A drive that leaves `left` of room."""

    rollout: Rollout | None
    outcome: Outcome
    succeeded: bool


def fake(margin, seed):
    """Each drive loses a centimetre more than that of the seed before; seed 9 has no path beyond 0.1 m."""
    if seed == 9 and margin > 0.1:
        return Faked(None, Outcome.NO_PATH, False)
    left = margin - 0.01 * seed
    return Faked(passing(0.3 - left), Outcome.SUCCEEDED if left > 0 else Outcome.COLLIDED, left > 0)


def test_the_smallest_safe_margin_is_found():
    trials = list(find_margin(fake, [1, 3, 2], reserve=0.004))
    safe = [trial.margin for trial in trials if trial.safe]
    assert min(safe) == pytest.approx(0.035)  # seed 3 loses 0.03, and 0.004 must be left
    assert {trial.failed for trial in trials} == {None, 3}


def test_worlds_that_a_margin_closes_are_not_counted():
    trials = list(find_margin(fake, [9], reserve=0.0))
    assert trials[0].impassable == 1
    assert not trials[0].safe
    assert min(trial.margin for trial in trials if trial.safe) == pytest.approx(0.095)


def test_without_a_safe_margin_the_search_ends():
    trials = list(find_margin(fake, [50]))
    assert len(trials) == 1
    assert trials[0].failed == 50
