"""Random streams of a run: one seed, one stream per purpose."""

from __future__ import annotations

import zlib

import numpy as np


def random_stream(seed: int, purpose: str) -> np.random.Generator:
    """Return the random stream of a purpose; streams of different purposes are independent."""
    return np.random.default_rng([seed, zlib.crc32(purpose.encode())])
