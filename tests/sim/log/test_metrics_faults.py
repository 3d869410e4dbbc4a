"""Metrics of drives that are not straight, short or successful."""

import itertools
import math
from dataclasses import replace

import numpy as np
import pytest

from antdrive.sim import METRICS, Outcome
from antdrive.sim.log.metrics import Metric, Tolerance, nearest_on_route
from tests.sim.log.test_metrics import straight, with_record


def test_the_clock_starts_a_decimetre_from_the_start_and_ends_at_the_tolerance() -> None:
    log = straight()
    assert METRICS["arrival_s"](log) == pytest.approx(6.8)
    far = with_record(log, task=replace(log.record.task, goal=(5.5, 0.1)))
    assert METRICS["arrival_s"](far) == math.inf
    assert METRICS["barn"](far) == pytest.approx(1 / 8)
    at_once = with_record(log, task=replace(log.record.task, goal=(0.02, 0.1)))
    assert METRICS["arrival_s"](at_once) == 0.0
    stands = replace(log, pose=log.pose * 0 + (1.0, 1.0, 0.0))
    assert METRICS["turning_rad_per_m"](stands) == 0.0


def test_jerk_needs_three_windows() -> None:
    """v = t^2 at 10 Hz, one row a window: of three rows there is one second difference, of two none."""
    log = straight()
    curved = replace(log, twist=np.stack([log.t**2, 0 * log.t], axis=1))
    for rows, jerk in ((4, 2.0), (3, 2.0), (2, 0.0)):
        cut = replace(curved, t=curved.t[:rows], twist=curved.twist[:rows])
        assert METRICS["jerk_rms"](cut) == pytest.approx(jerk)


def test_jerk_is_smoothed_over_a_tenth_of_a_second() -> None:
    """At 100 Hz a window has ten rows, whose mean of v = t^2 differs from v by a constant."""
    log = with_record(straight(), physics_hz=100)
    t = np.arange(81) / 100
    wave = np.where(np.arange(81) % 2, 0.3, -0.3)
    curved = replace(log, t=t, twist=np.stack([t**2 + wave, 0 * t], axis=1))
    assert METRICS["jerk_rms"](curved) == pytest.approx(2.0)


def test_the_nearest_point_is_found_among_segments_and_corners() -> None:
    rng = np.random.default_rng(2)
    route = rng.uniform(-2, 2, (6, 2))
    route[3] = route[2]  # a segment of no length
    points = rng.uniform(-3, 3, (40, 2))
    dense = np.concatenate([a + np.linspace(0, 1, 4001)[:, None] * (b - a) for a, b in itertools.pairwise(route)])
    nearest = [dense[np.hypot(*(dense - p).T).argmin()] for p in points]
    np.testing.assert_allclose(nearest_on_route(points, route), nearest, atol=2e-3)


def test_turning_is_counted_across_the_cut_of_the_angles() -> None:
    log = straight()
    pose = log.pose.copy()
    pose[:, 2] = np.where(np.arange(81) % 2, math.pi - 0.01, -math.pi + 0.01)
    assert METRICS["turning_rad_per_m"](replace(log, pose=pose)) == pytest.approx(80 * 0.02 / 4.0)


@pytest.mark.parametrize("outcome", [o for o in Outcome if o is not Outcome.SUCCEEDED])
def test_only_success_scores(outcome: Outcome) -> None:
    log = with_record(straight(), outcome=outcome)
    assert METRICS["spl"](log) == METRICS["barn"](log) == 0.0


def test_of_twenty_one_errors_the_95th_percentile_is_the_second_largest() -> None:
    log = straight()
    xy = np.stack([np.full(21, 2.0), np.arange(21) / 10, np.zeros(21)], axis=1)
    assert METRICS["tracking_error_p95_m"](replace(log, t=log.t[:21], pose=xy)) == pytest.approx(1.9)


def test_touches_are_counted_by_who_caused_them() -> None:
    """Two touches of a wall, 1 s apart at 10 Hz."""
    log = replace(straight(), contacts=np.array([[20.0, 0.0, -0.001, 5.0], [21, 0, 0, 5], [31, 0, -0.001, 5]]))
    names = ("contacts_driving", "contacts_standing", "contacts_teleported")
    assert [METRICS[name](log) for name in names] == [2, 0, 0]


def test_a_metric_without_a_docstring_has_no_definition() -> None:
    assert Metric("1", lambda log: 0.0).definition == ""


#: How much worse each metric may become: in its unit, and as a share. Metrics that the table leaves out are not compared.
ALLOWED = {
    "path_length_m": (0.01, 0.01), "route_length_m": (0.01, 0.01), "driven_length_m": (0.02, 0.01),
    "gap_to_grid_optimum": (0.01, 0), "gap_to_euclidean_optimum": (0.01, 0), "spl": (0.01, 0), "barn": (0.01, 0),
    "min_clearance_m": (0.005, 0), "mean_clearance_m": (0.01, 0.02), "tracking_error_max_m": (0.005, 0.05),
    "tracking_error_p95_m": (0.005, 0.05), "duration_s": (0.1, 0.01), "arrival_s": (0.1, 0.01),
    "turning_rad_per_m": (0.02, 0.05), "jerk_rms": (0.1, 0.1), "contacts_driving": (0, 0), "contacts_standing": (0, 0),
    "contacts_teleported": (0, 0),
}  # fmt: skip


def test_metrics_may_become_worse_by_so_much() -> None:
    compared = {name: metric.tolerance for name, metric in METRICS.items() if metric.tolerance is not None}
    assert {name: (t.absolute, t.relative) for name, t in compared.items()} == ALLOWED
    better_when_high = {name for name, metric in METRICS.items() if metric.better == "higher"}
    assert better_when_high == {"spl", "barn", "min_clearance_m", "mean_clearance_m"}


def test_allowances_add_up() -> None:
    assert Tolerance().allowed(7.0) == 0.0
    assert Tolerance(0.5).allowed(7.0) == 0.5
    assert Tolerance(0.5, 0.1).allowed(20.0) == Tolerance(0.5, 0.1).allowed(-20.0) == 2.5


def test_the_nearest_points_of_long_logs_and_routes_are_found_part_by_part() -> None:
    """More than a million pairs of a point and a segment."""
    route = np.stack([np.linspace(0, 10, 501), np.zeros(501)], axis=1)
    points = np.stack([np.linspace(0, 10, 4100), np.linspace(-1, 1, 4100)], axis=1)
    np.testing.assert_allclose(nearest_on_route(points, route), points * (1, 0), atol=1e-9)
