"""Metrics against numbers worked out by hand."""

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from antdrive.robots import LIMITERS
from antdrive.sim import METRICS, Outcome, Rollout, measure
from antdrive.sim.log.metrics import AVOIDING, tracking_error
from antdrive.sim.log.record import PlanRecord, ReplanRecord, SensingRecord
from antdrive.worlds import Task, World
from tests.records import made_up_record


def with_record(log: Rollout, **changes: Any) -> Rollout:
    return replace(log, record=replace(log.record, **changes))


def straight(**changes: Any) -> Rollout:
    """4 m along y = 0.1 at 0.5 m/s in 8 s, where the route runs along y = 0; a quarter turn in the last second."""
    hz, t = 10, np.arange(81) / 10
    pose = np.stack([t / 2, np.full(81, 0.1), np.clip(t - 7, 0, 1) * math.pi / 2], axis=1)
    record = made_up_record(
        task=Task(World("plain", (-1.0, -1.0, 6.0, 4.0)), (0.0, 0.1, 0.0), (4.0, 0.1), goal_tolerance=0.5),
        plan=PlanRecord(
            cost_m=5.5,
            length_m=5.5,
            grid_optimum_m=5.0,
            euclidean_optimum_m=3.2,
            work=1,
            work_unit="cells expanded",
        ),
        physics_hz=hz,
    )
    log = Rollout(
        t=t,
        pose=pose,
        twist=np.tile([0.5, 0.0], (81, 1)),
        command=np.zeros((81, 2)),
        clearance=np.linspace(0.2, 1.0, 81),
        limiter=np.zeros(81, np.uint8),
        movers=np.empty((81, 0, 2)),
        contacts=np.empty((0, 4)),
        route=np.array([(0.0, 0.0), (4.0, 0.0)]),
        cells=np.empty((0, 2), np.int32),
        record=record,
    )
    return replace(log, **changes)


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("path_length_m", 5.5),
        ("route_length_m", 4.0),
        ("driven_length_m", 4.0),
        ("gap_to_grid_optimum", 0.1),
        ("gap_to_euclidean_optimum", 0.25),
        ("spl", 0.8),
        ("barn", 1.6 / 6.8),  # OT = 3.2 m / 2 m/s = 1.6 s
        ("min_clearance_m", 0.2),
        ("mean_clearance_m", 0.6),
        ("tracking_error_max_m", 0.1),
        ("tracking_error_p95_m", 0.1),
        ("duration_s", 8.0),
        ("arrival_s", 6.8),  # from x = 0.1 m, at 0.2 s, to x = 3.5 m, at 7 s
        ("plan_s", 0.25),
        ("drive_wall_s", 1.5),
        ("turning_rad_per_m", math.pi / 8),
        ("jerk_rms", 0.0),
        ("contacts_driving", 0),
        ("contacts_standing", 0),
        ("contacts_teleported", 0),
        ("replans", 0),
        ("avoiding_s", 0),
        ("explored_m2", math.nan),  # it had a map; tests/sim/log/test_sights.py has drives without
    ],
)
def test_by_hand(name: str, value: float) -> None:
    assert METRICS[name](straight()) == pytest.approx(value, nan_ok=True)


def test_every_metric_is_worked_by_hand_here() -> None:
    names = {mark.args[1][0][0] for mark in test_by_hand.pytestmark}  # type: ignore[attr-defined]
    worked = {case[0] for case in test_by_hand.pytestmark[0].args[1]}  # type: ignore[attr-defined]
    assert names <= worked == set(METRICS) == set(measure(straight()))


def test_scores_need_success() -> None:
    log = straight()
    failed = with_record(log, outcome=Outcome.COLLIDED)
    assert METRICS["spl"](failed) == METRICS["barn"](failed) == 0


def test_the_barn_score_is_clipped() -> None:
    log = straight()
    for optimum, score in ((20.0, 0.5), (1.0, 0.125)):
        plan = replace(log.record.plan, euclidean_optimum_m=optimum)
        assert METRICS["barn"](with_record(log, plan=plan)) == pytest.approx(score)


def test_jerk_of_a_known_motion() -> None:
    """v = t^2 has the constant jerk 2 m/s^3."""
    log = straight()
    assert METRICS["jerk_rms"](replace(log, twist=np.stack([log.t**2, 0 * log.t], axis=1))) == pytest.approx(2.0)


def test_the_tracking_error_is_to_the_nearest_part_of_the_route() -> None:
    corner = straight(route=np.array([(0.0, 0.0), (2.0, 0.0), (2.0, 2.0)]))
    assert METRICS["tracking_error_max_m"](corner) == pytest.approx(2.0)  # (4, 0.1) is 2 m from x = 2


def test_after_a_replan_the_tracking_error_is_to_the_new_route() -> None:
    """At 4 s, at (2, 0.1), the robot turns to a line 0.3 m beside its way; a replan that fails changes nothing."""
    log = straight()
    new = ReplanRecord(t=4.0, trigger="obstructed", solved=True, cost_m=2.0, work=1, route=((2.0, 0.4), (4.0, 0.4)))
    failed = replace(new, t=5.0, solved=False, cost_m=None, route=())
    renewed = with_record(log, replans=(new, failed))
    assert [(rows.start, rows.stop) for rows, _ in renewed.legs()] == [(0, 40), (40, 81)]
    error = tracking_error(renewed)
    np.testing.assert_allclose(error, np.repeat([0.1, 0.3], [40, 41]), atol=1e-12)
    assert METRICS["replans"](renewed) == 2


def test_the_time_of_giving_way_is_that_of_its_limiter() -> None:
    log = straight(limiter=np.arange(81, dtype=np.uint8) // 61)
    assert METRICS["avoiding_s"](with_record(log, limiters=("path", AVOIDING))) == pytest.approx(2.0)
    assert AVOIDING in LIMITERS


def test_where_there_is_no_optimum_there_is_no_gap_and_no_score() -> None:
    plan = replace(straight().record.plan, grid_optimum_m=None, euclidean_optimum_m=None)
    log = with_record(straight(), plan=plan)
    assert math.isnan(METRICS["gap_to_grid_optimum"](log))
    assert math.isnan(METRICS["gap_to_euclidean_optimum"](log))
    assert METRICS["spl"](log) == METRICS["barn"](log) == 0


def test_the_first_plan_of_a_robot_without_a_map_is_not_held_against_the_optimum_of_a_world_it_had_not_seen() -> None:
    blind = with_record(straight(), sensing=SensingRecord(map="none", localisation="true", odometry=1.0))
    for name in ("gap_to_grid_optimum", "gap_to_euclidean_optimum"):
        assert math.isnan(METRICS[name](blind))
        assert math.isfinite(METRICS[name](straight()))
    assert METRICS["spl"](blind) == METRICS["spl"](straight())  # the drive is


def test_a_run_that_never_drove_has_no_metrics() -> None:
    with pytest.raises(ValueError, match="the run ended before the robot drove"):
        measure(None)
    with pytest.raises(ValueError, match="the run ended before the robot drove"):
        METRICS["spl"](None)


@pytest.mark.parametrize("name", METRICS)
def test_every_metric_has_a_unit_and_a_definition(name: str) -> None:
    metric = METRICS[name]
    assert metric.name == name
    assert metric.definition.endswith(".")
    units = {"turning_rad_per_m": "rad/m", "jerk_rms": "m/s^3", "explored_m2": "m^2"}
    suffix = name.rpartition("_")[2]
    assert metric.unit == units.get(name, suffix if suffix in ("m", "s") else "1")
