"""Experiments of Hasan (hasan)."""

from __future__ import annotations

from typing import Any

from antdrive.planners import Planner
from antdrive.runs.papers import maps
from antdrive.runs.papers.experiment import Experiment, for_every_seed
from antdrive.runs.papers.paper_runs import FirstTouchDStar

#: Only the moving obstacle is random in hasan's environments; the seeds repeat the timing.
HASAN_SEEDS = 20


def hasan() -> list[Experiment]:
    """Return table 1: six environments with and without a moving obstacle, with the paper's alpha and beta for each.

    The paper prints steps for its ants, and total costs and times for both planners.
    """
    printed = {
        "1a curved walls": (65, 2491.8, 3318.4, (7.0, 1.0)),
        "2b overlapping curved walls": (43, 1052.4, 2559.8, (5.0, 1.0)),
        "3c vertical rows": (49, 1238.6, 1238.6, (1.0, 1.0)),
        "4d concentric circles": (64, 2281.2, 5857.8, (5.0, 1.0)),
        "5e many shapes": (91, 5086.4, 5380.6, (3.0, 1.0)),
        "5f the same, across the wall": (66, 2477.8, 3249.2, (1.0, 0.0)),
    }
    environments = maps.environments()
    experiments = []
    for name, (steps, cost, rival, (alpha, beta)) in printed.items():
        query, chosen = for_every_seed(environments[name]), {"alpha": alpha, "beta": beta}
        common: dict[str, Any] = {"paper": "hasan", "map": name, "query": query}
        ants: dict[str, Any] = {**common, "planner": "mmas-dstar", "options": chosen}
        experiments.append(
            Experiment(**ants, label="steps", printed=float(steps), quantity="steps", most_seeds=HASAN_SEEDS)
        )
        arms: list[tuple[dict[str, Any], str, float, Planner | None]] = [
            (ants, "mmas-dstar", cost, None),
            ({**common, "planner": "dstar"}, "dstar", rival, None),
            ({**common, "planner": "dstar"}, "D* that lowers no cost", rival, FirstTouchDStar()),
            ({**common, "planner": "mmas-dstar"}, "mmas-dstar, our rule", cost, None),
        ]
        experiments += [
            Experiment(
                **what,
                label=label + (", moving" if movers else ""),
                made=made,
                printed=value,
                quantity="total",
                most_seeds=HASAN_SEEDS,
                movers=movers,
            )
            for movers in (0, 1)
            for what, label, value, made in arms[: 3 if movers else 4]
        ]
    return experiments
