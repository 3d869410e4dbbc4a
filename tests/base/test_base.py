"""Errors, optional packages, angles and polylines."""

import math
import pickle

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from antdrive.base import FieldError, InputError, arc_lengths, polyline_length, wrap_angle
from antdrive.base.errors import input_error, require
from antdrive.base.files import format_size
from antdrive.base.optional import optional
from antdrive.base.plane import format_disc, format_numbers, format_point, format_position, segment_lengths, tidy
from antdrive.worlds import Disc


def test_a_field_error_reads_as_key_and_problem():
    error = FieldError("radius", "must be greater than 0, got -1")
    assert str(error) == "radius: must be greater than 0, got -1"
    assert isinstance(error, ValueError)
    assert str(FieldError("", "must be a mapping")) == "must be a mapping"


@pytest.mark.parametrize(
    ("parent", "key", "whole"),
    [
        ("robot", "radius", "robot.radius"),
        ("movers[0]", "walk.start", "movers[0].walk.start"),
        ("movers", "[0].radius", "movers[0].radius"),
        ("movers[0]", "", "movers[0]"),
        ("", "radius", "radius"),
    ],
)
def test_a_key_takes_its_parents_prefix(parent, key, whole):
    error = FieldError(key, "is wrong").under(parent)
    assert (error.key, error.problem) == (whole, "is wrong")


def test_a_field_error_survives_pickling():
    error = pickle.loads(pickle.dumps(FieldError("radius", "is wrong")))
    assert (error.key, error.problem, str(error)) == ("radius", "is wrong", "radius: is wrong")


def test_records_report_the_field():
    with pytest.raises(FieldError) as caught:
        Disc(0.0, 0.0, -1.0)
    assert (caught.value.key, caught.value.problem) == ("radius", "must be greater than 0, got -1")


@pytest.mark.parametrize("value", [0.0, -1.0, math.nan, math.inf])
def test_positive_numbers_are_finite_and_above_0(value):
    with pytest.raises(FieldError, match=r"^size: must be greater than 0"):
        require("size", value, above=0)
    require("size", 1e-300, above=0)


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf])
def test_infinity_and_nan_are_not_finite(value):
    with pytest.raises(FieldError, match=r"^size: must be a finite number"):
        require("size", value)
    require("size", -1e300)


def test_an_input_error_is_one_line_of_printable_characters():
    error = input_error("a\nb", "c\u2028d\x1b[31m")
    assert isinstance(error, InputError)
    assert str(error) == "a\\nb: c\\u2028d\\x1b[31m"


def test_what_is_missing_is_named_with_its_extra():
    with pytest.raises(
        InputError, match=r"^no_such_package: not installed; pictures need it: pip install 'antdrive\[pics\]'$"
    ):
        optional("no_such_package.part", "pics", "pictures need it")


def test_what_is_there_is_given():
    import json.decoder

    assert optional("json.decoder", "any", "nothing") is json.decoder


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


def test_positions_print_as_a_person_writes_them():
    assert format_point((9.85, 5.0)) == "(9.85, 5)"
    assert format_point((300.0, -1.77636e-15)) == "(300, 0)"
    assert format_point((10.00001, 12345.678901)) == "(10.00001, 12345.678901)"
    assert format_point((1e300, -1e300)) == "(1e+300, -1e+300)"
    assert format_point((-1e-9, 1e300), 2) == "(0.00, 1e+300)"
    assert format_point((-0.001, 2.345), 2) == "(0.00, 2.35)"
    assert format_numbers((0.15000000000000002, 0.0, 3.9000000000000004, 2.9)) == "[0.15, 0, 3.9, 2.9]"
    assert format_disc(2.0, 0.45000000000000007, 0.1118033998749895) == "at (2, 0.45) with radius 0.111803"
    assert format_position((10.0, 0.0, 0.0), 1.0, -1e-17, None) == "(1, 0) in the world, (11, 0) in its map"


@given(st.floats(-1e6, 1e6))
def test_tidy_numbers_lose_only_their_rounding_error(value):
    assert tidy(value) == pytest.approx(value, rel=1e-12, abs=1e-12)
    short = round(value, 3)
    assert tidy(short + math.ulp(short)) == short + 0.0


def test_small_sizes_are_not_zero():
    assert [format_size(n) for n in (7, 20_000, 200_000, 999_700, 1 << 29, 2_100_000_000)] == [
        "7 bytes", "20 kB", "200 kB", "1 MB", "537 MB", "2.1 GB",
    ]  # fmt: skip
