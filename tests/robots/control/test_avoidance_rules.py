"""The parts of local avoidance, each by itself."""

import dataclasses
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from antdrive.robots import (
    Avoidance,
    AvoidanceState,
    Footprint,
    PurePursuit,
    PursuitState,
    Twist,
    footprint_clearance,
    load_robot,
    robot_to_dict,
)
from antdrive.robots.control._kernels_avoidance import first_contact, intrusion, is_close
from antdrive.robots.control._kernels_lines import CHECKED
from antdrive.robots.control.avoidance import _weights
from antdrive.worlds import Disc, Route, World
from tests.robots.control.kinematics import avoiding

OPEN = World("open", (-20, -20, 20, 20))
NEAR = np.array([0])
coordinate = st.floats(-2, 2)
point = st.tuples(coordinate, coordinate)


pose = st.tuples(coordinate, coordinate, st.floats(-3, 3))
FEET = {
    "disc": Footprint.disc(0.3),
    "off the axle": Footprint.disc(0.3, (0.1, 0.05)),
    "rectangle": Footprint.rectangle(0.9, 0.6),
    "off-centre": Footprint.rectangle(0.9, 0.6, (0.15, 0.0)),
}


def weights_of(foot, clearance=0.1):
    return _weights(Avoidance(min_clearance=clearance), foot.radius, foot)


@given(start=point, end=point, mover=point, mover_end=point, radius=st.floats(0.1, 0.5), distance=st.floats(0.6, 1.0))
def test_the_first_contact_is_that_of_sampled_motion(start, end, mover, mover_end, radius, distance):
    places, weights = np.array([[mover], [mover_end]]), weights_of(Footprint.disc(0.05), distance - radius - 0.05)
    share, clearance = first_contact(
        np.array([*start, 0.0]), np.array([*end, 1.0]), places, 0, np.array([radius]), NEAR, np.array([distance]),
        weights, math.inf,
    )  # fmt: skip
    f = np.linspace(0, 1, 2001)[:, None]
    gap = np.hypot(*((1 - f) * mover + f * mover_end - (1 - f) * start - f * end).T)
    assert clearance == pytest.approx(gap.min() - distance, abs=2e-3)
    inside = np.flatnonzero(gap < distance)
    if len(inside):
        assert share <= f[inside[0], 0]
        assert share == 0 or np.interp(share, f[:, 0], gap) == pytest.approx(distance, abs=2e-3)
    elif gap.min() > distance + 2e-3:
        assert share == 2


def gaps_to(foot, start, end, mover, mover_end, share):
    """Distances from the footprint to a mover's centre along a step, by another implementation."""
    poses = (1 - share) * np.array(start) + share * np.array(end)
    places = (1 - share) * np.array(mover) + share * np.array(mover_end)
    worlds = (World("", (-99, -99, 99, 99), (Disc(*map(float, place), 1e-3),)) for place in places)
    return 1e-3 + np.array([footprint_clearance(w, foot, p[None])[0] for w, p in zip(worlds, poses, strict=True)])


@settings(max_examples=60, deadline=None)
@given(foot=st.sampled_from(list(FEET)), start=pose, end=pose, mover=point, mover_end=point, radius=st.floats(0.1, 0.5))
def test_an_outline_has_contact_at_its_own_distance_and_its_circle_has_the_clearance(
    foot, start, end, mover, mover_end, radius
):
    """A closest pose is missed by at most half of the distance between two checked ones."""
    foot, start = FEET[foot], np.array(start)
    end, mover_end = start + 0.1 * np.array(end), np.array(mover) + 0.1 * np.array(mover_end)
    weights, places = weights_of(foot), np.array([[mover], [mover_end]])
    reach = np.array([radius + foot.radius + 0.1])
    share, clearance = first_contact(start, end, places, 0, np.array([radius]), NEAR, reach, weights, math.inf)
    f = np.linspace(0, 1, 101)[:, None]
    gaps = gaps_to(foot, start, end, mover, mover_end, f) - radius - 0.1
    between = (1 - f) * (np.array(mover) - start[:2]) + f * (np.array(mover_end) - end[:2])
    assert clearance == pytest.approx(np.hypot(*between.T).min() - reach[0], abs=2e-3)
    if gaps.min() < -CHECKED / 2:
        assert share <= 1
    if share <= 1:
        assert gaps[round(100 * share)] < 1e-2
    if gaps.min() > 1e-6:
        assert share == 2


@pytest.mark.parametrize("foot", FEET)
def test_a_mover_is_close_where_the_outline_is(foot):
    foot, rng = FEET[foot], np.random.default_rng(0)
    for _ in range(200):
        here, mover = rng.uniform((-1, -1, -3), (1, 1, 3)), rng.uniform(-1.5, 1.5, 2)
        gap = gaps_to(foot, here, here, mover, mover, np.zeros((1, 1)))[0] - 0.25
        if abs(gap - 0.1) > 1e-6:
            assert is_close(*here, mover[None], np.array([0.25]), weights_of(foot)) == (gap < 0.1)


def test_intrusion_is_measured_from_where_a_reversed_mover_would_be():
    places = np.array([[(0.0, 0.0)], [(1.0, 0.0)]])  # reversed, the mover would be at (-1, 0)
    weights = weights_of(Footprint.disc(0.35))
    assert intrusion(np.array([-1.0, 0.7, 2.0]), places, 1, np.array([0.3]), NEAR, weights) == pytest.approx(0.1)
    assert intrusion(np.array([1.0, 0.0, 0.0]), places, 1, np.array([0.3]), NEAR, weights) == 0.0
    beside = weights_of(Footprint.rectangle(0.9, 0.6))
    for yaw, expected in ((0.0, 0.05), (math.pi / 2, 0.2)):
        got = intrusion(np.array([-1.0, 0.7, yaw]), places, 1, np.array([0.3]), NEAR, beside)
        assert got == pytest.approx(expected)


@pytest.fixture
def tracked(turtlebot):
    route = Route(np.array([(0.0, 0.0), (5.0, 0.0)]))
    return PurePursuit().prepare(route, OPEN, turtlebot, 0.05, 1 / 60)


def avoid(tracked, robot, mover, **settings):
    """The decision of a robot that drives along the route at 0.7 m/s, 1 m from its start, near a standing mover."""
    avoidance = Avoidance(**settings)
    places = np.tile(np.array(mover), (len(avoidance.prediction_times), 1, 1))
    state, last = PursuitState(1.0), Twist(0.7, 0.0)
    return avoidance.avoid(
        tracked, robot, (1.0, 0.0, 0.0), last, state, last, AvoidanceState(), places, np.array([0.2])
    )


def test_the_controllers_command_is_kept_where_no_mover_is_close(tracked, turtlebot):
    for mover in ((1.0, 6.0), (3.0, 1.0), (0.0, -1.5)):
        assert avoid(tracked, turtlebot, mover) == (Twist(0.7, 0.0), False, AvoidanceState())


def test_the_command_changes_where_a_mover_blocks_the_route(tracked, turtlebot):
    command, changed, _ = avoid(tracked, turtlebot, (2.0, 0.0))
    assert changed
    assert command != Twist(0.7, 0.0)
    assert command.speed >= 0.7 - turtlebot.max_acceleration / 60 - 1e-9
    assert abs(command.yaw_rate) <= turtlebot.max_yaw_acceleration / 60 + 1e-9


def test_a_high_clearance_weight_makes_the_robot_leave_the_route(tracked, turtlebot):
    beside = (2.0, turtlebot.radius + 0.2 + 0.15)  # 5 cm more than the minimum clearance
    assert not avoid(tracked, turtlebot, beside, clearance_weight=0.0)[1]
    assert avoid(tracked, turtlebot, beside, clearance_weight=20.0)[1]


def test_the_prediction_covers_the_horizon_in_equal_steps():
    times = Avoidance(horizon=1.0, step=0.1).prediction_times
    np.testing.assert_allclose(times, np.arange(11) / 10)
    assert Avoidance(horizon=0.95, step=0.1).prediction_times[-1] == pytest.approx(1.0)


JACKAL = load_robot("jackal")


def speed_near(place, velocity, speed=2.0):
    places = np.array([[place], [np.add(place, np.multiply(velocity, Avoidance().step))]], float)
    return Avoidance().speed_near(JACKAL, (0.0, 0.0, 0.0), Twist(speed, 0.0), places, np.array([0.3]))


@given(gap=st.floats(0.0, 8.0), mover=st.floats(-1.4, 1.4), speed=st.floats(0.0, 2.0))
def test_a_robot_that_brakes_in_time_is_slow_within_a_metre_of_a_mover(gap, mover, speed):
    """Both move on one line; from the allowed speed the robot brakes as late as it may."""
    distance, slow = Avoidance().near_distance, JACKAL.near_speed
    v = speed_near((JACKAL.radius + 0.3 + gap, 0.0), (-mover, 0.0), speed)
    assert v >= slow
    braking = (v - slow) / JACKAL.max_acceleration
    covered = max(mover, 0.0) * braking + (v**2 - slow**2) / (2 * JACKAL.max_acceleration)
    assert gap - covered >= distance - 1e-9 or v == pytest.approx(slow)


@pytest.mark.parametrize(
    ("place", "velocity", "capped"),
    [
        ((1.0, 0.0), (0.0, 0.0), True),
        ((1.0, 0.0), (0.0, 1.4), True),
        ((-1.0, 0.0), (0.0, 0.0), False),  # behind
        ((1.0, 0.0), (-1.0, 0.0), True),  # head on: driving on does not lead out of its lane
        ((0.3, 1.0), (0.0, -1.2), False),  # the robot crosses its lane
        ((0.3, 1.0), (0.0, -0.5), True),  # slower than the robot may be
        ((1.2, 1.0), (0.0, -1.2), True),  # the robot is not in its lane yet
    ],
)
def test_only_movers_that_the_robot_approaches_limit_its_speed(place, velocity, capped):
    assert speed_near(place, velocity) == (0.8 if capped else math.inf)


def test_a_robot_has_a_speed_near_movers_of_its_own():
    slow = dataclasses.replace(JACKAL, near_speed=0.4)
    still = np.array([[(1.0, 0.0)]] * 2)
    v = Avoidance().speed_near(slow, (0.0, 0.0, 0.0), Twist(2.0, 0.0), still, np.array([0.3]))
    assert v == 0.4
    assert robot_to_dict(slow)["near_speed"] == 0.4
    assert "near_speed" not in robot_to_dict(JACKAL)


def test_the_way_backwards_counts_until_it_is_driven_forwards_again(tracked, turtlebot):
    avoidance, far = Avoidance(), np.tile((9.0, 9.0), (26, 1, 1))
    state = AvoidanceState()
    for speed, way in ((-0.3, 0.3), (-0.3, 0.6), (0.3, 0.3), (0.7, 0.0)):
        for _ in range(60):
            last = Twist(speed, 0.0)
            _, _, state = avoidance.avoid(
                tracked, turtlebot, (1.0, 0.0, 0.0), last, PursuitState(1.0), last, state, far, np.array([0.2])
            )
        assert state.reversed == pytest.approx(way, abs=1e-6)


@pytest.mark.parametrize(("comes", "most"), [(0.0, 0.0), (0.15, 0.3), (1.2, 0.7)])
def test_a_robot_reverses_slowly_unless_it_would_be_hit(tracked, turtlebot, comes, most):
    """A mover comes straight at the robot."""
    avoidance, x = Avoidance(), 1.0 + turtlebot.radius + 0.2 + max(0.5, 1.25 * comes)
    state, last, fastest = AvoidanceState(reversed=0.0), Twist(0.0, 0.0), 0.0
    for _ in range(40):
        places = np.zeros((26, 1, 2))
        places[:, 0, 0] = x - comes * avoidance.prediction_times
        last, _, state = avoidance.avoid(
            tracked,
            turtlebot,
            (1.0, 0.0, 0.0),
            last,
            PursuitState(1.0),
            Twist(0.1, 0.0),
            state,
            places,
            np.array([0.2]),
        )
        x, fastest = x - (comes + last.speed) / 60, max(fastest, -last.speed)
    assert fastest <= most + 1e-9
    assert fastest > 0.3 or comes < 1.0


def passes(walls, mover, speed, hz=20):
    """Whether a robot of 0.9 x 0.6 m passes a mover that comes, without contact, in 20 s."""
    robot, route = load_robot("warehouse"), Route(np.array([(1.0, 0.0), (7.0, 0.0)]))
    tracked = PurePursuit().prepare(route, World("passage", (-9, -3, 15, 3), walls), robot, 0.03, 1 / hz)
    avoidance = Avoidance()

    def movers(k):
        x = mover[0] - speed * (k / hz + avoidance.prediction_times)
        return np.stack([x, np.full(len(x), mover[1])], axis=1)[:, None], None

    poses = list(avoiding(tracked, robot, avoidance, movers, 0.1, start=(1.0, 0.0, 0.0), hz=hz, seconds=20))
    for k, pose in enumerate(poses):
        world = World("with the mover", (-9, -3, 15, 3), (*walls, Disc(*movers(k)[0][0, 0].tolist(), 0.1)))
        if footprint_clearance(world, robot.footprint, [pose])[0] <= 0:
            return False
    return poses[-1][0] > 6.0


def rows(y):
    return tuple(Disc(float(x), side * y, 0.3) for side in (-1, 1) for x in np.arange(-8.0, 14.0, 0.25))


@pytest.mark.parametrize(("gap", "expected"), [(0.2, True), (-0.35, False)])
def test_a_rectangle_passes_a_mover_where_its_circle_does_not(gap, expected):
    """In a passage of 1.5 m, a mover stands beside the robot's way, or on it."""
    assert passes(rows(1.05), (4.0, 0.4 + gap), 0.0) == expected


def test_a_rectangle_passes_a_mover_where_its_circle_has_no_room_to_the_wall():
    """In a passage of 2.1 m a mover comes along the middle: the circle cannot leave its way far enough."""
    assert passes(rows(1.35), (8.0, 0.0), 0.5)
