"""The benchmark of held-out drives judges its drives rightly, and its second audit finds clearances that are known otherwise."""

import collections
import dataclasses
import math

import numpy as np
import pytest

from antdrive.planners import PLANNERS
from antdrive.robots import list_robots
from antdrive.sim import Scenario, certify, run
from antdrive.worlds import Cruising, Keyframed, Task, Trajectories, World
from antdrive.worlds.files.world_file import task_to_dict
from tests.audit.held_out import (
    KINDS,
    SETTINGS,
    case,
    contradictions,
    counted,
    default_case,
    drive,
    failures,
    scenario,
)  # fmt: skip
from tests.audit.second_audit import Least, least_clearance, track

GOOD = {
    "n": 7, "seed": 1, "margins": "fixed", "kind": "barn", "robot": "jackal", "noise": 1.0, "smoothing": "taut",
    "planner": "ants", "outcome": "succeeded", "reason": "", "contacts": 0, "certified": True, "problems": [],
    "bound": 0.1, "second": 0.11, "wrong": [],
}  # fmt: skip


def test_planners_take_turns_in_every_kind_of_world_and_setting():
    lap = len(KINDS) * len(SETTINGS)
    cases = collections.Counter(tuple(case(n).values()) for n in range(lap * len(PLANNERS)))
    by_setting = collections.Counter(c[:4] for c in cases)
    assert len(by_setting) == len(set(KINDS)) * len(SETTINGS)
    assert set(by_setting.values()) == {len(PLANNERS)}


def test_a_drive_is_the_same_each_time_and_both_audits_agree():
    once, again = drive(1, 5, "fixed"), drive(1, 5, "fixed")
    assert once["digest"] == again["digest"]
    assert once["outcome"] == "succeeded"
    assert once["certified"]
    assert once["wrong"] == []
    assert once["bound"] < once["second"] <= once["second_rows"]


def test_drives_with_default_settings_cover_everything_and_give_no_margin():
    cases = [default_case(n, 3) for n in range(600)]
    assert cases == [default_case(n, 3) for n in range(600)] != [default_case(n, 4) for n in range(600)]
    assert {c["planner"] for c in cases} == set(PLANNERS)
    assert len({(c["robot"], c["smoothing"]) for c in cases}) == 3 * len(list_robots())
    assert {c["map"] for c in cases if c["robot"] == "turtlebot"} == {"given", "none"}
    made = scenario(0, 3, "default")
    assert made.margin is None
    assert (made.robot.name, made.noise, made.map) == (cases[0]["robot"], 1.0, cases[0]["map"])


@pytest.mark.parametrize(
    ("least", "says"),
    [
        (Least(0.0, 0.0, 0.0, ""), "overlap"),
        (Least(0.9, 0.9, 0.0, ""), "in the second audit"),
        (Least(0.1, 1e-4, 0.0, ""), "certified to keep"),
    ],
)
def test_a_second_audit_that_finds_less_contradicts_the_certificate(small_run, least, says):
    log = small_run.rollout
    certificate, world = certify(log), task_to_dict(log.record.task)
    agreed = Least(certificate.min_clearance, certificate.bound + 1e-4, 0.0, "")
    assert list(contradictions(log, world, certificate, agreed)) == []
    found = list(contradictions(log, world, certificate, least))
    assert any(says in problem for problem in found)
    assert any("does not begin" in p for p in contradictions(log, world | {"start": [0, 0, 0]}, certificate, agreed))
    assert any("from the goal" in p for p in contradictions(log, world | {"goal": [0, 0]}, certificate, agreed))
    assert list(contradictions(log, world, dataclasses.replace(certificate, certified=False), agreed)) == []


@pytest.mark.parametrize(
    ("change", "heading"),
    [
        ({}, "certified"),
        ({"certified": False, "problems": ["digest"]}, "refused"),
        ({"certified": False, "contacts": 3, "outcome": "collided"}, "contacts"),
        ({"outcome": "timed_out"}, "not arrived"),
        ({"outcome": "no_path", "contacts": None}, "no plan"),
        ({"wrong": ["overlap"]}, "wrong"),
        ({"outcome": "error", "contacts": None}, "errors"),
    ],
)
def test_each_drive_counts_where_it_belongs(change, heading):
    result = {key: value for key, value in (GOOD | change).items() if value is not None}
    head, _, *rows = (line.strip("| ").split("|") for line in counted(("kind", "robot"), [result]) if line)
    found = dict(zip((h.strip() for h in head), (cell.strip() for cell in rows[-1]), strict=False))
    assert found[heading] == "1"
    listed = list(failures([result]))
    assert len(listed) == (heading not in ("certified", "no plan"))
    assert all("--seed 1 --margins fixed --only 7" in line for line in listed)


DISC, BOX = {"radius": 0.18}, {"length": 0.508, "width": 0.43}
HZ = 240


def audit(world, footprint, pose, twist):
    base = {"bounds": [0.0, 0.0, 10.0, 10.0], "obstacles": []}
    return least_clearance({**base, **world}, footprint, pose, twist, HZ)


def straight_drive(y, rows=480, speed=1.0):
    x = 4.0 + speed * np.arange(rows) / HZ
    return np.column_stack([x, np.full(rows, y), np.zeros(rows)]), np.tile([speed, 0.0], (rows, 1))


def post(x, y, radius):
    return {"obstacles": [{"x": x, "y": y, "radius": radius, "height": 1.0}]}


@pytest.mark.parametrize(("footprint", "side"), [(DISC, 0.18), (BOX, 0.215)])
def test_a_post_that_is_passed(footprint, side):
    found = audit(post(5.0, 5.5, 0.1), footprint, *straight_drive(5.0))
    assert found.rows == pytest.approx(0.5 - 0.1 - side, abs=1e-4)
    assert found.near == "obstacles[0]"


def test_a_corner_that_sweeps_past_a_post():
    """The box turns on the spot; its corner, 0.3328 m from the centre, is nearest."""
    yaw = np.linspace(0.0, 2 * math.pi, 2000)
    pose = np.column_stack([np.full_like(yaw, 5.0), np.full_like(yaw, 5.0), yaw])
    twist = np.column_stack([np.zeros_like(yaw), np.full_like(yaw, (yaw[1] - yaw[0]) * HZ)])
    found = audit(post(5.5, 5.0, 0.1), BOX, pose, twist)
    assert found.between == pytest.approx(0.4 - math.hypot(0.254, 0.215), abs=1e-4)


def test_a_thin_post_inside_the_footprint_is_an_overlap():
    for footprint in (DISC, BOX):
        assert audit(post(5.0, 5.0, 0.01), footprint, *straight_drive(5.0)).rows < 0


def test_a_post_between_two_rows_is_seen_on_the_arc():
    """Rows 0.5 m apart, with the post in the middle."""
    pose = np.array([[4.75, 5.0, 0.0], [5.25, 5.0, 0.0]])
    found = audit(post(5.0, 5.2, 0.01), DISC, pose, np.array([[0.5 * HZ, 0.0]] * 2))
    assert found.rows > 0.1
    assert found.between == pytest.approx(0.2 - 0.01 - 0.18, abs=1e-4)
    assert found.t == pytest.approx(0.5 / HZ)


def test_a_mover_that_comes_after_the_last_row_does_not_count():
    mover = {"radius": 0.1, "position": [6.0, 5.0], "velocity": [-0.6, 0.0]}
    found = audit({"movers": [mover]}, DISC, *straight_drive(5.0, rows=100))
    assert found.between == found.rows


def test_walls_and_movers_count():
    wall = audit({}, BOX, *straight_drive(0.3))
    assert (wall.near, wall.rows) == ("bottom wall", pytest.approx(0.085, abs=1e-4))
    mover = {"radius": 0.1, "position": [5.0, 6.0], "velocity": [0.0, -0.6]}
    found = audit({"movers": [mover]}, DISC, *straight_drive(5.0))
    assert found.near == "movers[0]"
    x, y, t = *straight_drive(5.0)[0].T[:2], np.arange(480) / HZ
    assert found.rows == pytest.approx(np.hypot(x - 5.0, y - 6.0 + 0.6 * t).min() - 0.28, abs=1e-4)


def test_movers_are_where_the_drive_says():
    bounds, t = (0.0, 0.0, 4.0, 3.0), np.arange(20_000) / HZ
    movers = (
        Cruising(radius=0.2, position=(1.0, 1.0), velocity=(-0.9, 0.7), phase=3.7),
        Keyframed(radius=0.2, keyframes=((0.0, 1.0, 1.0), (2.0, 2.0, 1.5), (2.5, 1.0, 2.0)), phase=1.1),
    )
    task = Task(World("m", bounds, movers=movers), (0.5, 2.5, 0.0), (3.5, 2.5))
    places = Trajectories.of(task.world, task.start[:2]).positions(t)
    for m, mover in enumerate(task_to_dict(task)["movers"]):
        np.testing.assert_allclose(track(mover, np.array(bounds), t), places[:, m], atol=1e-9)


def test_a_real_drive_agrees_with_its_certificate(small_run, small_scenario, jackal):
    for robot, footprint in ((small_run.scenario.robot, DISC), (jackal, BOX)):
        log = run(Scenario(task=small_run.scenario.task, planner=small_scenario.planner, robot=robot)).rollout
        found = least_clearance(task_to_dict(log.record.task), footprint, log.pose, log.twist, HZ)
        certificate = certify(log)
        assert found.rows == pytest.approx(certificate.min_clearance, abs=1e-4)
        assert found.between > certificate.bound
