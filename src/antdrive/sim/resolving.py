"""From what people call worlds and robots to files and tasks."""

from __future__ import annotations

from antdrive.base.reuse import reused
from antdrive.worlds import Task, generate


@reused(64)
def generated(kind: str, seed: int, options: tuple[tuple[str, str], ...]) -> Task:
    """The random world that {generate: KIND, seed: SEED} with options stands for.

    Raises:
        InputError: an unknown kind or option, a wrong value, or no such world was found.
    """
    import numpy as np

    return generate(kind, np.random.default_rng(seed), dict(options), name=f"{kind}-{seed}", note=f"seed {seed}")
