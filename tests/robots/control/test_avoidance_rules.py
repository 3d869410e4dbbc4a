"""The parts of local avoidance, each by itself."""

import dataclasses
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from antdrive.robots import Avoidance, AvoidanceState, PurePursuit, PursuitState, Twist, load_robot, robot_to_dict
from antdrive.robots.control._kernels_avoidance import first_contact, intrusion
from antdrive.worlds import Route, World

OPEN = World("open", (-20, -20, 20, 20))
NEAR = np.array([0])
coordinate = st.floats(-2, 2)
point = st.tuples(coordinate, coordinate)


@given(start=point, end=point, mover=point, mover_end=point, radius=st.floats(0.1, 0.5), distance=st.floats(0.6, 1.0))
def test_the_first_contact_is_that_of_sampled_motion(start, end, mover, mover_end, radius, distance):
    places = np.array([[mover], [mover_end]])
    share, clearance = first_contact(
        *start, *end, places, 0, np.array([radius]), NEAR, np.array([distance]), distance - radius, math.inf
    )
    f = np.linspace(0, 1, 2001)[:, None]
    gap = np.hypot(*((1 - f) * mover + f * mover_end - (1 - f) * start - f * end).T)
    assert clearance == pytest.approx(gap.min() - distance, abs=2e-3)
    inside = np.flatnonzero(gap < distance)
    if len(inside):
        assert share <= f[inside[0], 0]
        assert share == 0 or np.interp(share, f[:, 0], gap) == pytest.approx(distance, abs=2e-3)
    elif gap.min() > distance + 2e-3:
        assert share == 2


def test_intrusion_is_measured_from_where_a_reversed_mover_would_be():
    places = np.array([[(0.0, 0.0)], [(1.0, 0.0)]])  # reversed, the mover would be at (-1, 0)
    assert intrusion(-1.0, 0.7, places, 1, np.array([0.3]), NEAR, 0.5) == pytest.approx(0.1)
    assert intrusion(1.0, 0.0, places, 1, np.array([0.3]), NEAR, 0.5) == 0.0


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
    places, velocities = np.array([place], float), np.array([velocity], float)
    return Avoidance().speed_near(JACKAL, (0.0, 0.0, 0.0), Twist(speed, 0.0), places, velocities, np.array([0.3]))


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
    places, still = np.array([(1.0, 0.0)]), np.zeros((1, 2))
    v = Avoidance().speed_near(slow, (0.0, 0.0, 0.0), Twist(2.0, 0.0), places, still, np.array([0.3]))
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
