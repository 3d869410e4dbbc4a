"""Experiments of Ibraheem and Ajeil (ibraheem2016)."""

from __future__ import annotations

from typing import Any

from antdrive.runs.papers.experiment import MANY_CANDIDATES, Experiment, candidates


def ibraheem2016() -> list[Experiment]:
    """Return table 2: four sizes, ant system and ageing ants."""
    printed = {
        10: (5, 15.07, 15.07, (8, 5)),
        20: (10, 28.6274, 28.6274, (6, 16)),
        30: (15, 45.9411, 45.1127, (14, 22)),
        40: (20, 62.6690, 61.8406, (18, 31)),
    }
    table_1: dict[str, Any] = {"ants": 50, "iterations": 100, "evaporation": 0.3}
    varied: dict[int, dict[str, dict[str, Any]]] = {
        10: {"as, 5 ants": {"ants": 5}, "as, 20 ants": {"ants": 20}},
        20: {
            "as, 5 ants": {"ants": 5},
            "as, 40 ants": {"ants": 40},
            **{f"as, rho {share:g}": {"evaporation": share} for share in (0.1, 0.7, 0.9)},
        },
    }
    return [
        Experiment(
            paper="ibraheem2016",
            map=f"{size}×{size}, {count} obstacles",
            planner=planner,
            label=label,
            printed=value,
            options={**table_1, **options},
            query=candidates(size, 100 * size, moves, blocks=count * 3 // 5, largest=size // 4),
            worlds=MANY_CANDIDATES,
            comparable=True,
            slow=size == 40,
            rounds=4,
        )
        for size, (count, *values, moves) in printed.items()
        for planner, label, value, options in (
            ("as", "as", values[0], {}),
            ("maco", "maco", values[1], {}),
            *(("as", label, None, options) for label, options in varied.get(size, {}).items()),
        )
    ]
