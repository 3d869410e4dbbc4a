"""Metrics against numbers worked out by hand."""

import itertools
import math
from dataclasses import replace

import numpy as np
import pytest

from antdrive.base import FieldError
from antdrive.sim import METRICS, measure
from antdrive.sim.log.metrics import Tolerance, nearest_on_route
from antdrive.sim.log.record import PlanRecord
from antdrive.worlds import Task, World
from tests.records import changed, made_up_log, made_up_record


def with_record(log, **changes):
    return changed(log, "record", **changes)


def straight(**changes):
    """4 m along y = 0.1 at 0.5 m/s in 8 s, where the route runs along y = 0; a quarter turn in the last second."""
    hz, t = 10, np.arange(81) / 10
    pose = np.stack([t / 2, np.full(81, 0.1), np.clip(t - 7, 0, 1) * math.pi / 2], axis=1)
    record = made_up_record(
        task=Task(World("plain", (-1.0, -1.0, 6.0, 4.0)), (0.0, 0.1, 0.0), (4.0, 0.1), goal_tolerance=0.5),
        plan=PlanRecord(
            cost_m=5.5, length_m=5.5, grid_optimum_m=5.0, euclidean_optimum_m=3.2, work=1, work_unit="cells expanded"
        ),
        physics_hz=hz,
    )
    speed, clearance = np.tile([0.5, 0.0], (81, 1)), np.linspace(0.2, 1.0, 81)
    arrays = {"route": np.array([(0.0, 0.0), (4.2, 0.0)]), "cells": np.array([(4, 4), (4, 26)], np.int32)}
    log = made_up_log(pose, hz, record, twist=speed, clearance=clearance, **arrays)
    return replace(log, **changes)


#: Of the BARN score, OT = 3.2 m / 2 m/s; it arrives from x = 0.1 m, at 0.2 s, at x = 3.5 m, at 7 s. It had a map, and so
#: explored nothing; `test_sights.py` has drives without.
BY_HAND = {
    "path_length_m": 5.5, "route_length_m": 4.2, "driven_length_m": 4.0, "gap_to_grid_optimum": 0.1,
    "gap_to_euclidean_optimum": 0.3125, "spl": 0.8, "barn": 1.6 / 6.8, "min_clearance_m": 0.2, "mean_clearance_m": 0.6,
    "tracking_error_max_m": 0.1, "tracking_error_p95_m": 0.1, "duration_s": 8.0, "arrival_s": 6.8, "plan_s": 0.25,
    "drive_wall_s": 1.5, "turning_rad_per_m": math.pi / 8, "jerk_rms": 0.0, "contacts_driving": 0, "contacts_standing": 0,
    "contacts_teleported": 0, "replans": 0, "avoiding_s": 0, "explored_m2": math.nan,
}  # fmt: skip


@pytest.mark.parametrize("name", METRICS)
def test_by_hand(name):
    assert METRICS[name](straight()) == pytest.approx(BY_HAND[name], nan_ok=True)
    assert set(BY_HAND) == set(METRICS) == set(measure(straight()))


@pytest.mark.parametrize("name", METRICS)
def test_every_metric_has_a_unit_and_a_definition(name):
    metric = METRICS[name]
    assert metric.name == name
    assert metric.definition.endswith(".")
    units = {"turning_rad_per_m": "rad/m", "jerk_rms": "m/s³", "explored_m2": "m²"}
    suffix = name.rpartition("_")[2]
    assert metric.unit == units.get(name, suffix if suffix in ("m", "s") else "1")


def test_the_clock_starts_a_decimetre_from_the_start_and_ends_at_the_tolerance():
    log = straight()
    assert METRICS["arrival_s"](log) == pytest.approx(6.8)
    far = with_record(log, task=replace(log.record.task, goal=(5.5, 0.1)))
    assert METRICS["arrival_s"](far) == math.inf
    assert METRICS["barn"](far) == 0.0
    at_once = with_record(log, task=replace(log.record.task, goal=(0.02, 0.1)))
    assert METRICS["arrival_s"](at_once) == math.inf  # it drives on
    begun = replace(
        at_once, **{name: getattr(at_once, name)[:3] for name in ("t", "pose", "twist", "clearance", "limiter")}
    )
    assert METRICS["arrival_s"](begun) == 0.0
    stands = replace(log, pose=log.pose * 0 + (1.0, 1.0, 0.0))
    assert METRICS["turning_rad_per_m"](stands) == 0.0


def test_a_robot_that_drives_through_the_goal_arrives_when_it_comes_back():
    """It is at the goal from 1 s to 3 s, and again from 13 s, so success and time are those of the second arrival."""
    log = straight()
    there, back = log.pose, log.pose[::-1]
    passing = replace(log, pose=np.concatenate([there, back]), t=np.arange(162) / 10)
    passing = with_record(passing, task=replace(log.record.task, goal=(1.0, 0.1)))
    assert METRICS["arrival_s"](passing) == math.inf
    stays = replace(passing, pose=passing.pose[:152], t=passing.t[:152])
    assert METRICS["arrival_s"](stays) == pytest.approx(13.1 - 0.2)
    assert METRICS["barn"](stays) == pytest.approx(1.6 / 12.8)


def test_jerk_needs_three_windows():
    """v = 3 t^2 at 10 Hz, one row a window: of three rows there is one second difference, of two none."""
    log = straight()
    curved = replace(log, twist=np.stack([3 * log.t**2, 0 * log.t], axis=1))
    for rows, jerk in ((4, 6.0), (3, 6.0), (2, 0.0)):
        cut = replace(curved, t=curved.t[:rows], twist=curved.twist[:rows])
        assert METRICS["jerk_rms"](cut) == pytest.approx(jerk)


def test_the_nearest_point_is_found_among_segments_and_corners():
    rng = np.random.default_rng(2)
    route = rng.uniform(-2, 2, (6, 2))
    route[3] = route[2]  # a segment of no length
    points = rng.uniform(-3, 3, (40, 2))
    dense = np.concatenate([a + np.linspace(0, 1, 4001)[:, None] * (b - a) for a, b in itertools.pairwise(route)])
    nearest = [dense[np.hypot(*(dense - p).T).argmin()] for p in points]
    np.testing.assert_allclose(nearest_on_route(points, route), nearest, atol=2e-3)


def test_turning_is_counted_across_the_cut_of_the_angles():
    log = straight()
    pose = log.pose.copy()
    pose[:, 2] = np.where(np.arange(81) % 2, math.pi - 0.01, -math.pi + 0.01)
    assert METRICS["turning_rad_per_m"](replace(log, pose=pose)) == pytest.approx(80 * 0.02 / 4.0)


#: How much worse each metric may become: in its unit, and as a share. Metrics that the table leaves out are not compared.
ALLOWED = {
    "path_length_m": (0.01, 0.01), "route_length_m": (0.01, 0.01), "driven_length_m": (0.02, 0.01),
    "gap_to_grid_optimum": (0.01, 0), "gap_to_euclidean_optimum": (0.01, 0), "spl": (0.01, 0), "barn": (0.01, 0),
    "min_clearance_m": (0.005, 0), "mean_clearance_m": (0.01, 0.02), "tracking_error_max_m": (0.005, 0.05),
    "tracking_error_p95_m": (0.005, 0.05), "duration_s": (0.1, 0.01), "arrival_s": (0.1, 0.01),
    "turning_rad_per_m": (0.02, 0.05), "jerk_rms": (0.1, 0.1), "contacts_driving": (0, 0), "contacts_standing": (0, 0),
    "contacts_teleported": (0, 0),
}  # fmt: skip


def test_metrics_may_become_worse_by_so_much():
    compared = {name: metric.tolerance for name, metric in METRICS.items() if metric.tolerance is not None}
    assert {name: (t.absolute, t.relative) for name, t in compared.items()} == ALLOWED
    better_when_high = {name for name, metric in METRICS.items() if metric.better == "higher"}
    assert better_when_high == {"spl", "barn", "min_clearance_m", "mean_clearance_m"}


def test_allowances_add_up():
    assert Tolerance().allowed(7.0) == 0.0
    assert Tolerance(0.5).allowed(7.0) == 0.5
    assert Tolerance(0.5, 0.1).allowed(20.0) == Tolerance(0.5, 0.1).allowed(-20.0) == 2.5


def test_the_nearest_points_of_long_logs_and_routes_are_found_part_by_part():
    """More than a million pairs of a point and a segment."""
    route = np.stack([np.linspace(0, 10, 501), np.zeros(501)], axis=1)
    points = np.stack([np.linspace(0, 10, 4100), np.linspace(-1, 1, 4100)], axis=1)
    np.testing.assert_allclose(nearest_on_route(points, route), points * (1, 0), atol=1e-9)


def test_a_run_that_never_drove_has_no_metrics():
    for ask in (measure, METRICS["spl"]):
        with pytest.raises(FieldError, match="the run ended before the robot drove"):
            ask(None)
