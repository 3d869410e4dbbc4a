"""Margin budgets against numbers worked by hand, and the search for the smallest safe margin."""

import dataclasses
import math
from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest

from antdrive.robots import load_robot
from antdrive.sim import Outcome, Rollout, Scenario, run
from antdrive.sim.log.margin import EATERS, budget, find_margin
from antdrive.worlds import task_to_dict
from antdrive.worlds.world import Disc, Task, World


def passing(offset: float, *, believed: float | None = None, commanded: float = 0.0, **changes: Any) -> Rollout:
    """Past a disc of radius 0.5 at (2, 1), a disc robot of radius 0.2 along y = offset; the route is y = 0.27: margin 0.03."""
    hz = 100
    t = np.arange(401) / hz
    pose = np.stack([t, np.full(401, offset), np.zeros(401)], axis=1)
    task = Task(World("one", (-5, -5, 9, 9), (Disc(2, 1, 0.5),)), (0, 0.27, 0), (4, 0.27))
    belief = pose + (0, 0 if believed is None else believed - offset, 0)
    log = Rollout(
        t=t, pose=pose, twist=np.tile([1.0, 0.0], (401, 1)), command=np.tile([1.0, commanded], (401, 1)),
        clearance=np.ones(401), limiter=np.zeros(401, np.uint8), movers=np.empty((401, 0, 2)), contacts=np.empty((0, 4)),
        route=np.array([(0.0, 0.27), (4.0, 0.27)]), cells=np.empty((0, 2), np.int32),
        estimate=np.empty((0, 3)) if believed is None else belief,
        meta={
            "task": task_to_dict(task), "physics_hz": hz, "margin": 0.03,
            "robot": {"footprint": {"half_length": 0.0, "half_width": 0.0, "rounding": 0.2}},
        },
    )  # fmt: skip
    return dataclasses.replace(log, **changes)


def shares(log: Rollout) -> dict[str, float]:
    spent = budget(log)
    total = sum(share.at_tightest for share in spent.shares)
    assert total == pytest.approx(spent.margin - spent.left)
    assert tuple(share.cause for share in spent.shares) == EATERS
    return {share.cause: share.metres for share in spent.shares}


def test_on_the_route_nothing_is_eaten() -> None:
    spent = budget(passing(0.27))
    assert spent.left == pytest.approx(0.03)  # 1 - 0.27 - 0.5 - 0.2
    assert max(shares(passing(0.27)).values()) == pytest.approx(0, abs=1e-12)


def test_tracking_error_towards_the_disc_is_eaten_and_away_from_it_is_not() -> None:
    assert shares(passing(0.28)) == pytest.approx({**dict.fromkeys(EATERS, 0.0), "tracking": 0.01})
    spent = budget(passing(0.28))
    assert (spent.largest.cause, spent.largest.x, spent.largest.t) == ("tracking", pytest.approx(2), pytest.approx(2))
    assert max(shares(passing(0.25)).values()) == 0


def test_a_wrong_belief_is_not_the_controllers_fault() -> None:
    assert shares(passing(0.28, believed=0.27)) == pytest.approx({**dict.fromkeys(EATERS, 0.0), "localisation": 0.01})


def test_slip_is_what_commands_did_not_ask_for() -> None:
    """Commanded to turn away by 0.2 rad/s, for 0.25 s at 1 m/s: 0.00625 m off, had it turned."""
    eaten = shares(passing(0.28, commanded=-0.2))
    away = sum(math.sin(-0.2 * (step - 0.5) * 0.01) * 0.01 for step in range(1, 26))
    # The farther point is also a little ahead of the disc's nearest, which changes its room by less than a tenth of a millimetre.
    assert eaten["slip"] == pytest.approx(-away, abs=1e-4)
    assert eaten["tracking"] == pytest.approx(0.01 + away, abs=1e-3)


def test_a_route_too_close_is_rounding_and_near_a_corner_it_is_cutting() -> None:
    close = passing(0.28, route=np.array([(0.0, 0.28), (4.0, 0.28)]))
    assert shares(close) == pytest.approx({**dict.fromkeys(EATERS, 0.0), "rounding": 0.01})
    bent = passing(0.28, route=np.array([(0.0, 0.27), (2.1, 0.27), (4.0, -1.0)]))
    eaten = shares(bent)
    assert eaten["cutting"] > 0.009
    assert eaten["tracking"] < 0.001


def test_unseen_obstacles_are_not_the_margins_business() -> None:
    log = passing(0.27)
    task = {
        **log.meta["task"],
        "obstacles": [*log.meta["task"]["obstacles"], {"x": 1.0, "y": 0.5, "radius": 0.1, "height": 1.0}],
    }
    hidden = dataclasses.replace(log, meta={**log.meta, "task": task, "unseen": [1]})
    assert budget(hidden).left == pytest.approx(0.03)
    assert budget(dataclasses.replace(hidden, meta={**hidden.meta, "unseen": []})).left < 0


def test_a_real_noisy_drive_adds_up(small_scenario: Scenario) -> None:
    result = run(dataclasses.replace(small_scenario, robot=load_robot("turtlebot"), noise=1.0, smoothing="taut"))
    assert result.rollout is not None
    eaten = shares(result.rollout)
    assert eaten["localisation"] > 0.001


@dataclass
class Faked:
    """A drive that leaves `left` of room."""

    rollout: Rollout | None
    outcome: Outcome
    succeeded: bool


def fake(margin: float, seed: int) -> Any:
    """Each drive eats a centimetre more than the seed before it; seed 9 has no path beyond 0.1 m."""
    if seed == 9 and margin > 0.1:
        return Faked(None, Outcome.NO_PATH, False)
    left = margin - 0.01 * seed
    return Faked(passing(0.3 - left), Outcome.SUCCEEDED if left > 0 else Outcome.COLLIDED, left > 0)


def test_the_smallest_safe_margin_is_found() -> None:
    trials = list(find_margin(fake, [1, 3, 2], reserve=0.004))
    safe = [trial.margin for trial in trials if trial.safe]
    assert min(safe) == pytest.approx(0.035)  # seed 3 eats 0.03, and 0.004 must be left
    assert {trial.failed for trial in trials} == {None, 3}


def test_worlds_that_a_margin_closes_teach_nothing() -> None:
    trials = list(find_margin(fake, [9], reserve=0.0))
    assert trials[0].impassable == 1
    assert not trials[0].safe
    assert min(trial.margin for trial in trials if trial.safe) == pytest.approx(0.095)


def test_without_a_safe_margin_it_ends() -> None:
    trials = list(find_margin(fake, [50]))
    assert len(trials) == 1
    assert trials[0].failed == 50
    with pytest.raises(ValueError, match="resolution"):
        next(find_margin(fake, [1], resolution=0.5))
