"""Experiments of Suganthi and Subha (suganthi2019)."""

from __future__ import annotations

from typing import Any

from antdrive.runs.papers.experiment import CANDIDATES, MANY_CANDIDATES, Experiment, candidates


def suganthi2019() -> list[Experiment]:
    """Return table 2: four sizes, three planners, and interpretations of the paper's open points.

    The paper does not state what an ant does in a dead end, whether loops are cut, or whether the elite's factor in eq. 7
    is the alpha of eq. 5. The constants of `pfaco` are those of Table 1, whose first value is missing in the text.
    """
    common = {"alpha": 1.0, "beta": 1.0, "evaporation": 0.3, "deposit": 1.0, "heuristic": "step", "iterations": 100}
    freed, letter = {"backtrack": True, "shortcut": True}, {"backtrack": False, "shortcut": False}
    many: dict[str, Any] = {"ants": 25, "explorers": 75, **common}
    wild = ("as, ants die", "iaco, ants die")  # two of their runs differ by a quarter of the length
    arms: list[tuple[str, str, dict[str, Any]]] = [
        ("as", "as", {"ants": 50, **common, **freed}),
        ("pfaco", "pfaco", {"ants": 50, "iterations": 100, "ranks": 15, "repulsion": 5.0, "influence": 10.0}),
        ("iaco", "iaco", {**many, **freed}),
        ("as", "as, ants die", {"ants": 50, **common, **letter}),
        ("iaco", "iaco, ants die", {**many, **letter}),
        ("iaco", "iaco, a = 25", {**many, **freed, "elite": 25.0}),
        ("iaco", "iaco, all deposit", {**many, **freed, "depositors": "all"}),
    ]
    printed = {
        10: (13.899, 13.899, 13.899),
        20: (28.627, 38.627, 28.627),
        30: (46.527, 59.355, 42.184),
        50: (96.125, 109.761, 94.326),
    }
    kinds: dict[int, tuple[tuple[int, int], dict[str, Any]]] = {
        10: ((4, 7), {"blocked": 0.15}),
        20: ((6, 16), {"blocked": 0.15}),
        30: ((4, 27), {"blocked": 0.08}),
        50: ((42, 37), {"blocked": 0.05, "blocks": 6, "largest": 35, "thin": True}),
    }
    return [
        Experiment(
            paper="suganthi2019",
            map=f"{size}×{size}",
            planner=planner,
            label=label,
            options=options,
            printed=value,
            query=candidates(size, 100 * size, kinds[size][0], **kinds[size][1]),
            worlds=MANY_CANDIDATES if size < 50 else CANDIDATES,
            comparable=True,
            slow=size >= 30,
            rounds=10 if label in wild and size < 50 else 1,
        )
        for size, values in printed.items()
        for (planner, label, options), value in zip(
            arms, (*values, values[0], values[2], values[2], values[2]), strict=True
        )
    ]
