"""Checks of the certificate that need a log of their own: stuck drives, late motors, contacts, walls, and short logs."""

import itertools
import math
from dataclasses import replace

import numpy as np
import pytest

from antdrive.robots.spec import Footprint
from antdrive.sim import Outcome, Rollout
from antdrive.sim.log.certificate import Certificate, closed_form_clearance
from antdrive.worlds import World
from tests.sim.log.test_certificate_faults import (
    HZ,
    ROBOT,
    ROWS,
    drive,
    filled,
    noisy,
    only_beyond,
    says,
    touched,
    with_record,
    with_task,
)


def test_the_problems_are_shown_and_numbered_from_one() -> None:
    html = Certificate(False, 0, 1.0, 1.0, ("too near", "too fast"))._repr_html_()
    assert html.index("problem 1") < html.index("too near") < html.index("problem 2") < html.index("too fast")


def test_the_outcome_is_that_of_the_first_contact() -> None:
    assert not says(touched(0.001), "the first contact was")
    standing = with_record(touched(0.001), outcome=Outcome.HIT_WHILE_STANDING)
    assert says(standing, "outcome: hit_while_standing, but the first contact was collided")


def test_physics_reports_no_gap_without_a_force_and_no_pull() -> None:
    for column, value, possible in ((2, 2e-4, True), (2, 2.1e-4, False), (3, 0.0, True), (3, -1e-6, False)):
        contact = np.array([[400, 0, -0.001, 0.0], [401, 0, -0.001, 0.0]])
        contact[1, column] = value
        told = says(replace(touched(0.001), contacts=contact), "contacts: physics reports surfaces no farther")
        assert told is not possible


def test_a_contact_is_looked_for_one_row_before_and_after() -> None:
    for at, near in ((398, False), (399, True), (400, True), (401, True), (402, False)):
        log = touched(0.001, at=at)
        log.contacts[:, 1] = 4  # of one disc and four walls the last, y = 4
        assert says(log, "physics reports a contact with obstacle 4 at row 400") is not near


@pytest.mark.parametrize("yaw", [0.0, 0.6, 1.9, math.pi - 0.3, -0.6, -2.5])
def test_walls_are_as_far_as_the_nearest_corner(yaw: float) -> None:
    """With nothing but walls the clearance is a corner's, less the rounding."""
    foot = Footprint(half_length=0.4, half_width=0.15, rounding=0.05)
    log = with_task(drive(rows=4), world=World("w", (0.0, 0.0, 6.0, 4.0)))
    log = with_record(log, robot=replace(ROBOT, footprint=foot))
    centres = np.array([(0.7, 2.0), (5.3, 2.0), (3.0, 0.7), (3.0, 3.3)])
    found = closed_form_clearance(replace(log, pose=np.column_stack([centres, np.full(4, yaw)])))
    corners = [a * 0.4 + b * 0.15j for a, b in itertools.product((-1, 1), repeat=2)]
    for (x, y), clearance in zip(centres, found, strict=True):
        points = [complex(x, y) + corner * complex(math.cos(yaw), math.sin(yaw)) for corner in corners]
        walls = [min(p.real, 6.0 - p.real, p.imag, 4.0 - p.imag) for p in points]
        assert clearance == pytest.approx(min(walls) - 0.05, abs=1e-12)


@pytest.mark.parametrize("wall", [1, 2, 3, 4])
@pytest.mark.parametrize("yaw", [0.0, 0.6, 1.9, math.pi - 0.3, -0.6, -2.5])
def test_a_contact_with_a_wall_is_where_a_corner_is_near_it(wall: int, yaw: float) -> None:
    foot = Footprint(half_length=0.4, half_width=0.15, rounding=0.05)
    corners = [complex(a * 0.4, b * 0.15) * complex(math.cos(yaw), math.sin(yaw)) for a in (-1, 1) for b in (-1, 1)]
    reach = max(abs(c.real if wall <= 2 else c.imag) for c in corners) + 0.05

    def beside(gap: float) -> Rollout:
        away = reach + gap
        x, y = {1: (away, 1.0), 2: (6.0 - away, 1.0), 3: (1.5, away), 4: (1.5, 4.0 - away)}[wall]
        log = with_record(drive(outcome=Outcome.COLLIDED), robot=replace(ROBOT, footprint=foot))
        pose = np.tile((3.0, 1.0, yaw), (ROWS, 1))
        pose[400] = x, y, yaw
        return replace(log, pose=pose, contacts=np.array([[400.0, wall, -0.001, 5.0]]))

    only_beyond(0.012, beside, f"physics reports a contact with obstacle {wall} at row 400")


def off_target(column: int, speed: float, seconds: float) -> Rollout:
    """A robot that is told to stand, drives for so long, and then back until the end."""
    rows, twist = round(seconds * HZ), np.zeros((ROWS, 2))
    twist[1:, column] = -speed
    twist[1 : rows + 1, column] = speed
    return replace(drive(), twist=twist)


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize(("column", "least", "changes"), [(0, 0.01, (0.375, 1.4, 1.4)), (1, 0.05, (3.0, 6.28, 6.28))])
def test_motors_may_be_late_by_two_periods(column: int, least: float, changes: tuple[float, ...], sign: float) -> None:
    """In each window: a least error, 2 % of the way, and what two periods of control and of physics change at most."""
    text = f"the {('forward speed', 'yaw rate')[column]} does not follow the motors' targets"
    late = 2 * (1 / 60 + 1 / 240)
    for seconds, change in zip((0.25, 1.0, 4.0), changes, strict=True):
        limit = sign * (least + late * change) / (1 - 0.02) / seconds
        if seconds == 4.0:  # the shorter windows see less than their limits
            only_beyond(limit, lambda v: off_target(column, v, 4.0), text)
        elif seconds == 0.25:
            only_beyond(limit, lambda v: filled(drive(), "twist", tuple(v * np.eye(2)[column]), slice(301, 361)), text)
        else:
            assert says(off_target(column, 1.01 * limit, seconds), text)


def test_targets_that_are_kept_are_no_problem() -> None:
    for speed in (0.5, -0.5):
        assert not says(filled(drive(speed), "command", (speed, 0.0)), "does not follow")


def test_a_robot_that_stands_off_the_goal_is_stuck_at_any_time() -> None:
    text = "outcome: stuck, but the drive ends after"
    for twist in ((1.0, 0.0), (-1.0, 0.0), (0.0, 1.0), (0.0, -1.0)):
        only_beyond(
            0.02,
            lambda v, t=twist: filled(drive(outcome=Outcome.STUCK), "twist", (v * t[0], v * t[1]), slice(-1, None)),
            text,
        )
    at_goal = with_task(drive(outcome=Outcome.STUCK), goal=(1.2, 1.0), goal_tolerance=0.25)
    assert says(at_goal, text)


def test_a_robot_without_progress_for_eight_seconds_is_stuck() -> None:
    """A quarter of what it could drive, 0.7 m/s x 8 s / 4."""
    only_beyond(1.4, lambda way: drive(way / 8, rows=8 * HZ + 1, outcome=Outcome.STUCK), "farther in the last 8 s")
    assert says(drive(0.1, rows=8 * HZ, outcome=Outcome.STUCK), "stuck, but the drive ends after 7.996 s")
    assert not says(drive(0.1, rows=8 * HZ + 1, outcome=Outcome.STUCK), "outcome: stuck")
    slow_at_first = drive(0.1, rows=10 * HZ + 1, outcome=Outcome.STUCK)
    pose = slow_at_first.pose.copy()
    pose[: 2 * HZ, 0] -= 5.0
    assert not says(replace(slow_at_first, pose=pose), "outcome: stuck")


def test_a_drive_ends_half_a_second_and_two_periods_after_its_first_contact() -> None:
    text = "the first contact ends a drive, but the log goes on for"
    for before, late in ((120, False), (127, False), (129, True), (400, True)):
        assert says(touched(0.001, row=ROWS - 1 - before), text) is late


def test_an_inflation_that_is_off_by_a_micrometre_fits() -> None:
    assert not says(with_record(drive(), margin=1e-6, inflate=ROBOT.radius), "record.inflate")
    assert says(with_record(drive(), margin=1.1e-6, inflate=ROBOT.radius), "record.inflate")


def test_rates_that_contradict_each_other_are_a_problem_and_no_error() -> None:
    assert says(drive(hz=240, control_hz=480), "control_hz")
    assert says(with_record(noisy(), control_hz=480), "control_hz")


@pytest.mark.parametrize("rows", [2, 5, 12, 13, 14])
def test_logs_that_are_shorter_than_the_motors_delay_are_judged(rows: int) -> None:
    names = ("t", "pose", "twist", "command", "clearance", "limiter", "movers", "estimate", "actuated")
    short = replace(noisy(), **{name: getattr(noisy(), name)[:rows] for name in names})
    assert not says(short, "actuated")


def test_motors_are_not_expected_to_do_what_was_commanded_before_the_start() -> None:
    first = filled(noisy(), "command", (0.1, 0.0), slice(0, 1))
    assert says(first, "row 0 is before the first command")
    assert not says(first, "not the delayed command")
