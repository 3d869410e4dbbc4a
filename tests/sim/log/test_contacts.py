"""Who caused a contact: the edges of the rules, each worked out by hand."""

import math

import numpy as np
import pytest

from antdrive.robots.spec import Footprint
from antdrive.sim import Outcome
from antdrive.sim.log.contacts import Attribution, Touch, _gap, touches_of

HZ, ROWS = 100, 300
DISCS = 2  # obstacles 0 and 1 are cylinders, 2 to 4 movers, 5 and more walls
FOOT = Footprint.disc(0.2)


def told(*contacts, **changes):
    """The touches of a robot of 0.2 m that stands at the origin; mover m is 0.1 (m + 1) m large and comes at 1 m/s."""
    values = {
        "pose": np.zeros((ROWS, 3)),
        "twist": np.zeros((ROWS, 2)),
        "movers": np.stack([approach(1.0)] * 3, axis=1),
        "jumps": np.zeros((ROWS - 1, 3), dtype=np.bool_),
        "hz": HZ,
        "discs": DISCS,
        "radii": np.array([0.1, 0.2, 0.3]),
        "footprint": FOOT,
        "deceleration": 0.5,
    }
    points = np.array([(step, obstacle, -0.001, 5.0) for step, obstacle in contacts])
    return Attribution(**{**values, **changes}).touches(points)


def approach(speed):
    """Places of a mover that comes along x (T, 2) [m]."""
    return np.stack([5.0 - speed * np.arange(ROWS) / HZ, np.zeros(ROWS)], axis=1)


def moving(speed=0.0, yaw_rate=0.0):
    return np.tile([speed, yaw_rate], (ROWS, 1))


def who(obstacle=3, step=50, **changes):
    (touch,) = told((step, obstacle), **changes)
    assert (touch.step, touch.obstacle) == (step, obstacle)
    return touch.outcome


def test_contacts_up_to_half_a_second_apart_are_one_touch():
    assert [touch.step for touch in told((10, 2), (60, 3), (110, 2))] == [10]
    assert [touch.step for touch in told((10, 2), (61, 3), (111, 2), (162, 4))] == [10, 61, 162]
    assert [touch.step for touch in told((0, 2), (1, 2))] == [0]


def test_only_movers_hit_a_standing_robot():
    hit = [who(obstacle) is Outcome.HIT_WHILE_STANDING for obstacle in range(7)]
    assert hit == [False, False, True, True, True, False, False]


@pytest.mark.parametrize(
    ("speed", "yaw_rate", "stands"),
    [
        (0.02, 0.0, True), (0.0201, 0.0, False), (-0.0201, 0.0, False), (0.0, 0.0999, True), (0.0, 0.101, False),
        (0.0, -0.101, False), (0.011, 0.05, False), (0.009, 0.05, True),
    ],
)  # fmt: skip
def test_a_robot_stands_if_no_point_of_it_moves_faster_than_2_cm_a_second(speed, yaw_rate, stands):
    """At 0.1 rad/s its rim moves at 2 cm/s."""
    expected = Outcome.HIT_WHILE_STANDING if stands else Outcome.COLLIDED
    assert who(twist=moving(speed, yaw_rate)) is expected


def test_a_robot_that_is_faster_than_the_mover_ran_into_it():
    """The mover's speed is that over the step to the contact, and so is the robot's."""
    slow = {"movers": np.stack([approach(0.015)] * 3, axis=1)}
    assert who(**slow, twist=moving(0.0149)) is Outcome.HIT_WHILE_STANDING
    assert who(**slow, twist=moving(0.0151)) is Outcome.COLLIDED
    braked, began = moving(0.5), moving(0.0)
    braked[49:], began[50:] = 0.0, 0.5
    assert who(twist=braked) is Outcome.HIT_WHILE_STANDING
    assert who(twist=began) is Outcome.HIT_WHILE_STANDING, "the step was taken from the row before"
    began[49] = 0.5
    assert who(twist=began) is Outcome.COLLIDED
    stops = np.stack([approach(1.0)] * 3, axis=1)
    stops[49:] = stops[49]
    assert who(movers=stops, twist=moving(0.01)) is Outcome.COLLIDED, "the mover stood, the robot crept into it"
    stops[50:] += 0.01
    assert who(movers=stops, twist=moving(0.01)) is Outcome.HIT_WHILE_STANDING


def test_a_contact_in_the_first_row_has_no_step_that_led_to_it():
    assert who(step=0, twist=moving(0.5)) is Outcome.HIT_WHILE_STANDING
    assert who(step=1, twist=moving(0.5)) is Outcome.COLLIDED
    assert who(step=1) is Outcome.HIT_WHILE_STANDING
    stopped = moving(0.0)
    stopped[0] = 0.5
    assert who(step=1, twist=stopped) is Outcome.COLLIDED


def after_jump(step, gap, *, mover=1, rows=(20,), **changes):
    """The outcome where a mover appears in some rows, the last time `gap` ahead of a robot that drives at 0.5 m/s."""
    jumps = np.zeros((ROWS - 1, 3), dtype=np.bool_)
    for row in rows:
        jumps[row - 1, mover] = True
    movers = np.stack([approach(1.0)] * 3, axis=1)
    movers[rows[-1] :, mover] = (FOOT.radius + 0.1 * (mover + 1) + gap, 0.0)
    values = {"twist": moving(0.5), **changes}
    return who(DISCS + mover, step, jumps=jumps, movers=movers, **values)


def test_a_mover_that_appears_nearer_than_the_robot_can_stop_is_a_teleport():
    """0.5 m/s is braked at 0.5 m/s^2 in 1 s and 0.25 m; 1 cm and two rows are allowed for."""
    assert after_jump(60, 0.2599) is Outcome.HIT_BY_TELEPORT
    assert after_jump(60, 0.2601) is Outcome.COLLIDED
    assert after_jump(60, 0.0101, twist=moving(0.0)) is Outcome.HIT_WHILE_STANDING
    assert after_jump(20, 0.0099, twist=moving(0.0)) is Outcome.HIT_BY_TELEPORT
    assert after_jump(60, -0.1) is Outcome.HIT_BY_TELEPORT
    assert after_jump(60, 0.2599, twist=moving(-0.5)) is Outcome.HIT_BY_TELEPORT


def test_a_teleport_is_over_when_the_robot_could_have_stopped():
    assert after_jump(20 + 102, 0.2) is Outcome.HIT_BY_TELEPORT
    assert after_jump(20 + 103, 0.2) is Outcome.COLLIDED
    assert after_jump(22, 0.0, twist=moving(0.0)) is Outcome.HIT_BY_TELEPORT
    assert after_jump(23, 0.0, twist=moving(0.0)) is Outcome.HIT_WHILE_STANDING


def test_a_teleport_is_attributed_by_the_row_before_it_and_the_row_after_it():
    faster, slower = moving(0.5), moving(0.0)
    faster[20:], slower[20:] = 0.9, 0.5
    assert after_jump(60, 0.2601, twist=faster) is Outcome.COLLIDED
    assert after_jump(60, 0.2, twist=slower) is Outcome.COLLIDED
    driven = np.zeros((ROWS, 3))
    driven[21:, 0] = 3.0
    assert after_jump(60, 0.2, pose=driven) is Outcome.HIT_BY_TELEPORT
    driven[20, 0] = -3.0
    assert after_jump(60, 0.2, pose=driven) is Outcome.COLLIDED


def test_of_several_jumps_the_last_before_the_contact_counts_and_those_of_other_movers_do_not():
    assert after_jump(150, 0.2, rows=(20, 100)) is Outcome.HIT_BY_TELEPORT
    assert after_jump(150, 0.2, rows=(100, 20)) is Outcome.HIT_BY_TELEPORT
    assert after_jump(20, 0.2) is Outcome.HIT_BY_TELEPORT, "in the row in which it appears"
    assert after_jump(19, 0.2) is Outcome.COLLIDED, "before it appears"
    jumps = np.zeros((ROWS - 1, 3), dtype=np.bool_)
    jumps[19, 1] = True
    near = np.zeros((ROWS, 3, 2))
    assert [who(k, 30, jumps=jumps, movers=near, twist=moving(0.5)) for k in (2, 3, 4)] == [
        Outcome.COLLIDED,
        Outcome.HIT_BY_TELEPORT,
        Outcome.COLLIDED,
    ]


@pytest.mark.parametrize("foot", [Footprint.disc(0.2), Footprint.rectangle(0.6, 0.3), Footprint(0.3, 0.1, 0.05)])
def test_the_gap_to_a_disc_is_that_to_the_nearest_point_of_a_dense_outline(foot):
    rng = np.random.default_rng(3)
    u, v = np.meshgrid(np.linspace(-1, 1, 201), np.linspace(-1, 1, 201))
    body = (u * foot.half_length + 1j * v * foot.half_width).ravel()
    for _ in range(60):
        x, y, yaw, radius = rng.uniform((-1, -1, -math.pi, 0.05), (1, 1, math.pi, 0.3))
        centre = rng.uniform(-2, 2, 2)
        nearest = np.abs(x + 1j * y + body * np.exp(1j * yaw) - complex(*centre)).min()
        if nearest > 0.01:  # the centre is outside of the rectangle
            expected = nearest - foot.rounding - radius
            assert _gap(foot, (x, y, yaw), centre, radius) == pytest.approx(expected, abs=3e-3)
    assert _gap(foot, (1.0, 2.0, 0.7), (1.0, 2.0), 0.1) == pytest.approx(-foot.depth(0.0, 0.0) - 0.1)


def test_a_log_tells_its_touches(small_run, collided_run):
    assert touches_of(small_run.rollout) == []
    first = collided_run.rollout.contacts[0]
    assert touches_of(collided_run.rollout) == [Touch(int(first[0]), int(first[1]), Outcome.COLLIDED)]
