"""Tables of runs that never happened, of planners whose difference is known."""

import json
from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from antdrive.runs.statistics.run_table import RunTable
from antdrive.sim.log.metrics import METRICS


class Skill(NamedTuple):
    """What a made-up planner can do.

    Attributes:
        success: its chance of success in a world of average difficulty
        length: its path's length over the shortest
        seeded: whether the seed changes its drives
        name: the planner's name without options
        options: named by the campaign
    """

    success: float = 0.95
    length: float = 1.1
    seeded: bool = True
    name: str = ""
    options: Mapping[str, Any] = {}


def made_up_columns(planners, worlds=10, seeds=5, *, spread=0.0, rng_seed=1):
    """The columns of a campaign's table.

    Args:
        planners: by label
        worlds: number of worlds
        seeds: number of seeds in each world
        spread: standard deviation of the worlds' difficulty, added to the chance of success
        rng_seed: of everything random
    """
    rng = np.random.default_rng(rng_seed)
    rows = []
    named = sorted({option for skill in planners.values() for option in skill.options})
    for w in range(worlds):
        optimum, hard = 4.0 + 16.0 * w / max(1, worlds - 1), float(rng.normal(0, spread))
        for label, skill in planners.items():
            draws = rng.random(seeds), rng.normal(0, 0.02, seeds)
            for s in range(seeds):
                luck, jitter = (float(draw[s if skill.seeded else 0]) for draw in draws)
                good = luck < skill.success + hard
                length = optimum * skill.length * (1 + abs(jitter))
                name = skill.name or label
                drove = good or luck < 0.999
                rows.append(
                    {
                        "key": f"{w:04x}{s:04x}{len(rows):08x}",
                        "world": f"world-{w:03}",
                        "world_hash": f"{w:064x}",
                        "task": "own",
                        "planner": label,
                        "planner_name": name,
                        "options": json.dumps(dict(skill.options)),
                        **{f"option.{option}": skill.options.get(option) for option in named},
                        "robot": "turtlebot",
                        "smoothing": "clearance",
                        "noise": 0.0,
                        "margin": 0.03,
                        "cell": 0.2,
                        "seed": s,
                        "outcome": "succeeded" if good else ("collided" if drove else "no_path"),
                        "succeeded": good,
                        "certified": good if drove else None,
                        "reason": "" if good else f"touched obstacle {w}",
                        "digest": f"{rng.integers(2**62):x}",
                        "drive_digest": f"{label}{w}{luck!r}",
                        **_metrics(good, drove, length, optimum, luck),
                        "plan_length_m": length if drove else None,
                        "grid_optimum_m": optimum,
                        "rollout": None if good else f"rollouts/{len(rows):08x}.npz",
                        "command": f"antdrive run world-{w:03}.yaml --planner {name} --robot turtlebot --seed {s}",
                        "antdrive": "0.2.0",
                        "attempts": 1,
                    }
                )
    return {name: [row[name] for row in rows] for name in rows[0]}


def made_up_runs(planners, worlds=10, seeds=5, **words):
    return RunTable(made_up_columns(planners, worlds, seeds, **words))


def _metrics(good, drove, length, optimum, luck):
    if not drove:
        return dict.fromkeys(METRICS)
    known = {
        "path_length_m": length,
        "route_length_m": 0.98 * length,
        "driven_length_m": 0.99 * length,
        "gap_to_grid_optimum": length / optimum - 1,
        "duration_s": 2.2 * length,
        "min_clearance_m": 0.02 + 0.1 * luck if good else 0.0,
        "plan_s": 0.001 * length * (1 + luck),
    }
    return {name: known.get(name, 1.0 + luck) for name in METRICS}
