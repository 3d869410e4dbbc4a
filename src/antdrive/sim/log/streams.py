"""Random numbers of a run: one seed, and a stream of its own for each purpose."""

from __future__ import annotations

import zlib

import numpy as np


def random_stream(seed: int, purpose: str) -> np.random.Generator:
    """The random stream of a purpose; another purpose's draws do not change it."""
    return np.random.default_rng([seed, zlib.crc32(purpose.encode())])
