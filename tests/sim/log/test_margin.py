"""Margin budgets against numbers worked by hand, and the search for the smallest safe margin."""

import dataclasses
import math
from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest

from antdrive.robots import Footprint, load_robot
from antdrive.sim import Outcome, Rollout, Scenario, run
from antdrive.sim.log.margin import CAUSES, budget, find_margin
from antdrive.worlds.world import Disc, Task, World
from tests.records import made_up_record


def passing(offset: float, *, estimated: float | None = None, commanded: float = 0.0, **changes: Any) -> Rollout:
    """Past a disc of radius 0.5 at (2, 1), a disc robot of radius 0.2 along y = offset; the route is y = 0.27: margin 0.03."""
    hz = 100
    t = np.arange(401) / hz
    pose = np.stack([t, np.full(401, offset), np.zeros(401)], axis=1)
    task = Task(World("one", (-5, -5, 9, 9), (Disc(2, 1, 0.5),)), (0, 0.27, 0), (4, 0.27))
    robot = dataclasses.replace(load_robot("turtlebot"), footprint=Footprint.disc(0.2))
    estimate = pose + (0, 0 if estimated is None else estimated - offset, 0)
    log = Rollout(
        t=t, pose=pose, twist=np.tile([1.0, 0.0], (401, 1)), command=np.tile([1.0, commanded], (401, 1)),
        clearance=np.ones(401), limiter=np.zeros(401, np.uint8), movers=np.empty((401, 0, 2)), contacts=np.empty((0, 4)),
        route=np.array([(0.0, 0.27), (4.0, 0.27)]), cells=np.empty((0, 2), np.int32),
        estimate=np.empty((0, 3)) if estimated is None else estimate,
        record=made_up_record(task=task, robot=robot, physics_hz=hz, margin=0.03, inflate=0.23),
    )  # fmt: skip
    return dataclasses.replace(log, **changes)


def losses(log: Rollout) -> dict[str, float]:
    spent = budget(log)
    total = sum(part.at_tightest for part in spent.contributions)
    assert total == pytest.approx(spent.margin - spent.left)
    assert [part.cause for part in spent.contributions] == list(CAUSES)
    return {part.cause: part.metres for part in spent.contributions}


def test_on_the_route_nothing_is_lost() -> None:
    spent = budget(passing(0.27))
    assert spent.left == pytest.approx(0.03)  # 1 - 0.27 - 0.5 - 0.2
    assert max(losses(passing(0.27)).values()) == pytest.approx(0, abs=1e-12)


def test_tracking_error_towards_the_disc_costs_margin_and_away_from_it_does_not() -> None:
    assert losses(passing(0.28)) == pytest.approx({**dict.fromkeys(CAUSES, 0.0), "tracking": 0.01})
    spent = budget(passing(0.28))
    assert (spent.largest.cause, spent.largest.x, spent.largest.t) == ("tracking", pytest.approx(2), pytest.approx(2))
    assert max(losses(passing(0.25)).values()) == 0


def test_a_wrong_estimate_is_not_the_controllers_fault() -> None:
    assert losses(passing(0.28, estimated=0.27)) == pytest.approx({**dict.fromkeys(CAUSES, 0.0), "localisation": 0.01})


def test_slip_is_motion_that_was_not_commanded() -> None:
    """Commanded to turn away by 0.2 rad/s, for 0.25 s at 1 m/s: 0.00625 m off, had it turned."""
    loss = losses(passing(0.28, commanded=-0.2))
    away = sum(math.sin(-0.2 * (step - 0.5) * 0.01) * 0.01 for step in range(1, 26))
    # The farther point is also a little ahead of the disc's nearest, which changes its room by less than a tenth of a millimetre.
    assert loss["slip"] == pytest.approx(-away, abs=1e-4)
    assert loss["tracking"] == pytest.approx(0.01 + away, abs=1e-3)


def test_a_route_too_close_is_rounding_and_near_a_corner_it_is_cutting() -> None:
    close = passing(0.28, route=np.array([(0.0, 0.28), (4.0, 0.28)]))
    assert losses(close) == pytest.approx({**dict.fromkeys(CAUSES, 0.0), "rounding": 0.01})
    bent = passing(0.28, route=np.array([(0.0, 0.27), (2.1, 0.27), (4.0, -1.0)]))
    loss = losses(bent)
    assert loss["cutting"] > 0.009
    assert loss["tracking"] < 0.001


def test_unseen_obstacles_do_not_count() -> None:
    log = passing(0.27)
    post, task = Disc(1.0, 0.5, 0.1), log.record.task
    hidden = dataclasses.replace(log, record=dataclasses.replace(log.record, unseen=(post,)))
    assert budget(hidden).left == pytest.approx(0.03)
    world = dataclasses.replace(task.world, obstacles=(*task.world.obstacles, post))
    known = dataclasses.replace(log.record, task=dataclasses.replace(task, world=world))
    assert budget(dataclasses.replace(log, record=known)).left < 0


def test_a_real_noisy_drive_adds_up(small_scenario: Scenario) -> None:
    result = run(dataclasses.replace(small_scenario, robot=load_robot("turtlebot"), noise=1.0, smoothing="taut"))
    assert result.rollout is not None
    loss = losses(result.rollout)
    assert loss["localisation"] > 0.001


@dataclass
class Faked:
    """A drive that leaves `left` of room."""

    rollout: Rollout | None
    outcome: Outcome
    succeeded: bool


def fake(margin: float, seed: int) -> Any:
    """Each drive loses a centimetre more than that of the seed before; seed 9 has no path beyond 0.1 m."""
    if seed == 9 and margin > 0.1:
        return Faked(None, Outcome.NO_PATH, False)
    left = margin - 0.01 * seed
    return Faked(passing(0.3 - left), Outcome.SUCCEEDED if left > 0 else Outcome.COLLIDED, left > 0)


def test_the_smallest_safe_margin_is_found() -> None:
    trials = list(find_margin(fake, [1, 3, 2], reserve=0.004))
    safe = [trial.margin for trial in trials if trial.safe]
    assert min(safe) == pytest.approx(0.035)  # seed 3 loses 0.03, and 0.004 must be left
    assert {trial.failed for trial in trials} == {None, 3}


def test_worlds_that_a_margin_closes_are_not_counted() -> None:
    trials = list(find_margin(fake, [9], reserve=0.0))
    assert trials[0].impassable == 1
    assert not trials[0].safe
    assert min(trial.margin for trial in trials if trial.safe) == pytest.approx(0.095)


def test_without_a_safe_margin_the_search_ends() -> None:
    trials = list(find_margin(fake, [50]))
    assert len(trials) == 1
    assert trials[0].failed == 50
    with pytest.raises(ValueError, match="resolution"):
        next(find_margin(fake, [1], resolution=0.5))
