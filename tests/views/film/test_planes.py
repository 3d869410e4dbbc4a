"""Planes of luma and chroma of frames."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from antdrive.views.film.planes import Planes

SIZE = (162, 160)  # the last block of a row is narrower


def exact(picture):
    """Return luma, blue and red by the formulas of BT.709, limited range, rounded."""
    rgb = picture.astype(float)
    quarter = (rgb[::2, ::2] + rgb[1::2, ::2] + rgb[::2, 1::2] + rgb[1::2, 1::2]) / 4
    light, mean = (part @ np.array([0.2126, 0.7152, 0.0722]) for part in (rgb, quarter))
    planes = [
        16 + light * 219 / 255,
        128 + (quarter[..., 2] - mean) / 1.8556 * 224 / 255,
        128 + (quarter[..., 0] - mean) / 1.5748 * 224 / 255,
    ]
    return np.concatenate([plane.ravel() for plane in planes])


@given(st.integers(0, 2**32 - 1))
def test_planes_follow_bt709_and_do_not_depend_on_earlier_frames(seed):
    rng = np.random.default_rng(seed)
    planes = Planes(SIZE)
    picture = rng.integers(0, 256, (*SIZE[::-1], 3)).astype(np.uint8) * rng.integers(0, 2, dtype=np.uint8)
    for _ in range(3):
        found = planes(picture)
        assert np.abs(found - exact(picture)).max() <= 0.502
        assert np.array_equal(found, Planes(SIZE)(picture))
        picture = picture.copy()
        row, col, channel = rng.integers(0, (*SIZE[::-1], 3))
        picture[row, col, channel] ^= np.uint8(1 << rng.integers(0, 8))


@pytest.mark.parametrize(("colour", "luma", "chroma"), [((0, 0, 0), 16, 128), ((255, 255, 255), 235, 128)])
def test_black_and_white_have_the_ends_of_the_limited_range(colour, luma, chroma):
    area = SIZE[0] * SIZE[1]
    found = Planes(SIZE)(np.full((*SIZE[::-1], 3), colour, dtype=np.uint8))
    assert (found[:area] == luma).all()
    assert (found[area:] == chroma).all()
    assert len(found) == area * 3 // 2
