"""The figure of a drive and an earlier one: both lines, where they part, and the contact."""

import dataclasses

import numpy as np
import pytest

from antdrive.base import InputError
from antdrive.views.figures.then_and_now import then_and_now
from antdrive.views.style import BAD, CONTACT, SHELL, START


def count(figure, colour):
    """How many pixels of what was written have a colour."""
    pixels = np.asarray(figure.canvas.buffer_rgba())[..., :3].astype(int)
    return int((np.abs(pixels - colour).max(axis=-1) < 12).sum())


def test_both_drives_and_their_parting_are_drawn(made_up_drive, tmp_path):
    then = made_up_drive()
    now = dataclasses.replace(then, pose=then.pose + [0, 0.2, 0])
    plain = then_and_now(then, now, tmp_path / "a.png", dpi=60)
    marked = then_and_now(then, now, tmp_path / "b.png", parted=(0.3, 1.0, 1.0), dpi=60)
    assert count(plain, START) > 100
    assert count(plain, SHELL) > 100
    assert count(marked, CONTACT) > count(plain, CONTACT) + 20


def test_a_contact_is_marked(made_up_drive, tmp_path):
    then, now = made_up_drive(), made_up_drive(collide=True)
    plain = then_and_now(then, then, tmp_path / "a.png", dpi=60)
    hit = then_and_now(then, now, tmp_path / "b.png", dpi=60)
    assert count(hit, BAD) > count(plain, BAD) + 20


def test_the_suffix_chooses_the_format(made_up_drive, tmp_path):
    drive = made_up_drive()
    with pytest.raises(InputError, match=r"choose one of .png"):
        then_and_now(drive, drive, tmp_path / "a.bmp")
