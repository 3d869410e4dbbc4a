"""Angles and polylines."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from antdrive.base import arc_lengths, polyline_length, wrap_angle
from antdrive.base.plane import segment_lengths

LINE = [(0.0, 0.0), (3.0, 4.0), (3.0, 5.0), (3.0, 5.0)]


@given(st.floats(-1e3, 1e3))
def test_a_wrapped_angle_is_the_same_direction_within_half_a_turn(angle):
    wrapped = wrap_angle(angle)
    assert -math.pi <= wrapped < math.pi
    assert (math.cos(wrapped), math.sin(wrapped)) == pytest.approx((math.cos(angle), math.sin(angle)), abs=1e-9)
    assert wrap_angle(np.array([angle, angle]))[1] == wrapped


def test_half_a_turn_is_minus_pi():
    assert wrap_angle(math.pi) == wrap_angle(-math.pi) == -math.pi


def test_lengths_of_a_polyline():
    assert segment_lengths(LINE).tolist() == [5.0, 1.0, 0.0]
    assert arc_lengths(LINE).tolist() == [0.0, 5.0, 6.0, 6.0]
    assert polyline_length(LINE) == 6.0


def test_a_single_point_has_no_length():
    assert segment_lengths([(1.0, 2.0)]).shape == (0,)
    assert arc_lengths([(1.0, 2.0)]).tolist() == [0.0]
    assert polyline_length([(1.0, 2.0)]) == 0.0
