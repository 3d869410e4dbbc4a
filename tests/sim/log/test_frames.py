"""Frames of estimated poses, against complex numbers."""

import numpy as np

from antdrive.sim.log.frames import frame_at, laid

RANDOM = np.random.default_rng(5)
OWN, TRUE = RANDOM.uniform(-9, 9, (2, 40, 3))


def flat(points: np.ndarray) -> np.ndarray:
    return points[:, 0] + 1j * points[:, 1]


def test_a_frame_lies_so_that_both_poses_are_one() -> None:
    frames = frame_at(OWN, TRUE)
    turn = np.exp(1j * frames[:, 2])
    np.testing.assert_allclose(flat(frames) + turn * flat(OWN), flat(TRUE), atol=1e-12)
    np.testing.assert_allclose(turn * np.exp(1j * OWN[:, 2]), np.exp(1j * TRUE[:, 2]), atol=1e-12)


def test_what_the_robot_sees_lies_as_it_lies_from_the_robot() -> None:
    seen = RANDOM.uniform(-9, 9, (40, 2))
    ahead = (flat(seen) - flat(OWN)) * np.exp(-1j * OWN[:, 2])
    there = flat(TRUE) + ahead * np.exp(1j * TRUE[:, 2])
    np.testing.assert_allclose(flat(laid(seen, frame_at(OWN, TRUE))), there, atol=1e-12)
