"""The parts of local avoidance, each by itself."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from antdrive.robots import Avoidance, AvoidanceState, PurePursuit, PursuitState, Twist
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
