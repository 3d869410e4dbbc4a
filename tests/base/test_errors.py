"""The exceptions for wrong values."""

import math
import pickle

import pytest

from antdrive.base import FieldError, InputError
from antdrive.base.errors import input_error, require_finite, require_positive
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
def test_a_key_can_be_seen_from_outside(parent, key, whole):
    error = FieldError(key, "is wrong").under(parent)
    assert (error.key, error.problem) == (whole, "is wrong")


def test_a_field_error_survives_its_way_from_a_worker_process():
    error = pickle.loads(pickle.dumps(FieldError("radius", "is wrong")))
    assert (error.key, error.problem, str(error)) == ("radius", "is wrong", "radius: is wrong")


def test_records_report_the_field():
    with pytest.raises(FieldError) as caught:
        Disc(0.0, 0.0, -1.0)
    assert (caught.value.key, caught.value.problem) == ("radius", "must be greater than 0, got -1")


@pytest.mark.parametrize("value", [0.0, -1.0, math.nan, math.inf])
def test_positive_numbers_are_finite_and_above_0(value):
    with pytest.raises(FieldError, match=r"^size: must be greater than 0"):
        require_positive("size", value)
    require_positive("size", 1e-300)


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf])
def test_infinity_and_nan_are_not_finite(value):
    with pytest.raises(FieldError, match=r"^size: must be a finite number"):
        require_finite("size", value)
    require_finite("size", -1e300)


def test_an_input_error_is_one_line_of_printable_characters():
    error = input_error("a\nb", "c\u2028d\x1b[31m")
    assert isinstance(error, InputError)
    assert str(error) == "a\\nb: c\\u2028d\\x1b[31m"
