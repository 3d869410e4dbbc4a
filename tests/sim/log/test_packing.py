"""Packing of logs: every array comes back bit for bit, and what is no packed log is refused."""

import json

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays_of

from antdrive.sim.log import packing

FLOATS = st.floats(-1e12, 1e12)
MOST = 1 << 24


def packed(arrays, stated=None):
    return packing.pack(arrays, '{"a": 1}', {"digest": "0"}, stated or {})


def unpacked(arrays):
    found, text, _ = packing.unpack(packed(arrays).encode(), MOST)
    assert json.loads(text) == {"a": 1, "digest": "0"}
    return found


def assert_same(found, arrays):
    for name, array in arrays.items():
        assert (found[name].dtype, found[name].shape) == (array.dtype, array.shape)
        assert found[name].tobytes() == array.tobytes()


@given(
    table=arrays_of.arrays("<f8", st.tuples(st.integers(0, 9), st.integers(0, 3), st.integers(1, 2)), elements=FLOATS),
    scans=arrays_of.arrays("<u2", st.tuples(st.integers(0, 6), st.integers(0, 5))),
    cells=arrays_of.arrays("<i4", st.tuples(st.integers(0, 6), st.just(2))),
    tracks=arrays_of.arrays("<f4", st.tuples(st.integers(0, 6), st.just(7))),
    rules=arrays_of.arrays("u1", st.integers(0, 9)),
)
def test_every_array_comes_back_bit_for_bit(table, scans, cells, tracks, rules):
    arrays = {
        "pose": np.zeros((1, 3)),
        "movers": table,
        "limiter": rules,
        "cells": cells,
        "scans": scans,
        "tracks": tracks,
    }
    assert_same(unpacked(arrays), arrays)


@given(
    st.integers(1, 12).flatmap(lambda n: st.tuples(*(arrays_of.arrays("<f8", (n, k), elements=FLOATS) for k in (3, 2))))
)
def test_speeds_come_back_whatever_the_poses_say(pose_and_twist):
    pose, twist = pose_and_twist
    arrays = {"pose": pose, "twist": twist}
    assert_same(unpacked(arrays), arrays)


def test_speeds_that_follow_from_poses_take_less_than_their_history():
    t = np.arange(2400) / 240
    pose = np.column_stack([t + 0.01 * np.sin(9 * t), 0.3 * np.cos(t), np.sin(t)])
    step = np.diff(pose, axis=0, prepend=pose[:1])
    twist = np.column_stack([np.hypot(step[:, 0], step[:, 1]) * 240 * (1 + 1e-4), step[:, 2] * 240])
    twist[::7] *= 1 + 1e-9
    alone, beside = packed({"twist": twist, "pose": pose[:1] * 0}), packed({"pose": pose[:1] * 0, "twist": twist})
    together = len(packed({"pose": pose, "twist": twist})) - len(packed({"pose": pose}))
    assert len(alone) <= len(beside) + 50
    assert together < 0.8 * len(alone)


@pytest.fixture(scope="module")
def content():
    return packed(
        {"pose": np.ones((20, 3)), "scans": np.arange(60, dtype="<u2").reshape(6, 10)}, {"label": "x"}
    ).encode()


def test_long_tables_of_whole_numbers_come_back(monkeypatch):
    monkeypatch.setattr(packing, "MAX_ROWS", 10)
    long = np.arange(40, dtype="<u4").reshape(20, 2)
    assert_same(unpacked({"seen": long}), {"seen": long})
    with pytest.raises(ValueError, match="promises other bytes"):
        unpacked({"pose": np.ones((20, 3))})


def test_what_a_page_states_comes_back(content):
    assert packing.unpack(content, MOST)[2] == {"label": "x"}


@pytest.mark.parametrize(
    "change",
    [
        lambda text: text[:-5],
        lambda text: text + b"00000",
        lambda text: b"~~~~~" + text[5:],
        lambda text: text[:20] + b"<" + text[21:],
        lambda text: b"",
        lambda text: text[: len(text) // 2],
    ],
)
def test_a_log_that_is_cut_or_longer_or_in_other_digits_is_refused(content, change):
    with pytest.raises(Exception) as error:  # `guarded_log` makes one line of every error
        packing.unpack(change(content), MOST)
    assert not isinstance(error.value, AssertionError)


def test_a_log_larger_than_its_limit_is_refused(content):
    with pytest.raises(ValueError, match="damaged"):
        packing.unpack(content, 100)


def test_digits_end_no_element_and_open_no_comment():
    assert not set(b"<\\\"'/") & set(packing.DIGITS)
    assert len(set(packing.DIGITS)) == 85
