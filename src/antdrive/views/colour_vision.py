"""Colour differences for full and for deficient colour vision."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from antdrive.base.types import Floats

#: Linear RGB as seen with full vision, protanopia, deuteranopia and tritanopia (Machado, Oliveira and Fernandes 2009,
#: severity 1.0).
VISIONS = np.array(
    [
        np.eye(3),
        [[0.152286, 1.052583, -0.204868], [0.114503, 0.786281, 0.099216], [-0.003882, -0.048116, 1.051998]],
        [[0.367322, 0.860646, -0.227968], [0.280085, 0.672501, 0.047413], [-0.011820, 0.042940, 0.968881]],
        [[1.255528, -0.076749, -0.178779], [-0.078411, 0.930809, 0.147602], [0.004733, 0.691367, 0.303900]],
    ]
)
_XYZ = np.array(
    [[0.4124564, 0.3575761, 0.1804375], [0.2126729, 0.7151522, 0.0721750], [0.0193339, 0.1191920, 0.9503041]]
)
_WHITE = np.array([0.95047, 1.0, 1.08883])  # D65


def linear(colours: npt.ArrayLike) -> Floats:
    """Return colours (..., 3), 0 to 255, as linear RGB, 0 to 1."""
    share = np.asarray(colours, dtype=np.float64) / 255
    return np.where(share <= 0.04045, share / 12.92, ((share + 0.055) / 1.055) ** 2.4)


def luminance(colour: npt.ArrayLike) -> float:
    """Return a colour's relative luminance (WCAG 2), 0 to 1."""
    return float(linear(colour) @ [0.2126, 0.7152, 0.0722])


def _seen(colours: npt.ArrayLike) -> Floats:
    """Return colours (N, 3) in CIELAB (N, V, 3) for each of the `VISIONS`."""
    visible = np.clip(np.einsum("vij,nj->nvi", VISIONS, linear(colours).reshape(-1, 3)), 0, 1)
    ratio = visible @ _XYZ.T / _WHITE
    f = np.where(ratio > 216 / 24389, np.cbrt(ratio), (24389 / 27 * ratio + 16) / 116)
    return np.stack([116 * f[..., 1] - 16, 500 * (f[..., 0] - f[..., 1]), 200 * (f[..., 1] - f[..., 2])], axis=-1)


def differences(colours: npt.ArrayLike, others: npt.ArrayLike) -> Floats:
    """Return the differences (N, M) of colours (N, 3) and others (M, 3): CIE76, the least over all `VISIONS`."""
    apart = _seen(colours)[:, None] - _seen(others)[None]
    return np.asarray(np.linalg.norm(apart, axis=-1).min(axis=-1))
