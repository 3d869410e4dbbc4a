"""Messages for invalid options, names and queries of planners, listed in `messages.yml`."""

import math

import numpy as np

from antdrive.planners import (
    AcoHan,
    AgeingAnts,
    AntSystem,
    ExploringAnts,
    GaHan,
    Hybrid,
    MaxMinAnts,
    MaxMinDStar,
    MergingAnts,
    PotentialField,
    PotentialFieldAnts,
    Tangent,
    WarmStartedColony,
    load_planner,
    plan_in_time,
    planner_version,
)
from tests.messages import check_messages
from tests.planners.graph.test_sipp import SPEED, Passing, corridor
from tests.planners.worlds_to_solve import catalogue

#: Values out of range by class; `inf` and `nan` are floats.
OPTIONS = {
    AcoHan: (
        "ants 0", "iterations 0", "max_steps 0", "evaporation 1.5", "deposit 0.0", "attraction -1.0", "elitism -1", "elite_of us",
        "form song", "time_budget 0.0", "min_weight nan",
    ),
    AntSystem: (
        "alpha -1.0", "beta -1.0", "initial 0.0", "threads 0", "heuristic smell", "ranks 0",
        "update_every 0", "restart_every 0", "mix 2.0",
    ),
    AgeingAnts: ("q_min 0.0", "q_max 0.01"),
    ExploringAnts: ("depositors few", "explorers -1", "elite -1.0", "ties few"),
    MaxMinAnts: ("p_best 1.0", "patience 0"),
    MergingAnts: ("scouts -1", "settled 0", "beta 2.0", "heuristic step"),
    MaxMinDStar: ("alpha 0.0", "beta -1.0", "alpha_max 0.5", "evaporation 1.0"),
    PotentialFieldAnts: (
        "ants 0", "ranks 0", "evaporation 1.5", "mix -0.1", "beta_2 -1.0", "influence 0.0", "min_pheromone 0.0", "form steep",
        "field end", "memory some", "repulsion nan",
    ),
    PotentialField: ("k_att 0.0", "k_rep -1.0", "influence 0.0", "k_att nan"),
    GaHan: ("via_points 0", "population 1", "crossover 1.5", "tries 0"),
    Hybrid: ("colony aco-ham",),
    Tangent: ("bulge 0.0",),
}  # fmt: skip
#: Options as text: all of aco-han except the last.
WRITTEN = (
    {"ants": "many"}, {"ants": 2.5}, {"ants": True}, {"ants": "0"}, {"ants": None}, {"antz": 5}, {"evaporation": "nan"},
    {"evaporation": "1.5"}, {"form": "song"}, {"time_budget": "-1"},
)  # fmt: skip
NAMES = (
    "no_such_module_here:Mine", "antdrive.planners.graph.search:Astar", ":Mine", "nowhere.py:Mine", "nosuch", "aco_han",
)  # fmt: skip


def value_of(text):
    for kind in (int, float):
        try:
            return kind(text)
        except ValueError:
            continue
    return text


def test_invalid_options_names_and_queries_are_refused_in_one_line(data_regression):
    def warm(**words):
        return WarmStartedColony(MergingAnts(), catalogue()["empty"], np.random.default_rng(0), **words)

    def timed(movers=(), **words):
        return plan_in_time(corridor(3), movers, **{"speed": SPEED, **words})

    calls = {
        kind.__name__: {text: lambda k=kind, t=text: k(**{t.split()[0]: value_of(t.split()[1])}) for text in texts}
        for kind, texts in OPTIONS.items()
    }
    calls["written options"] = {
        **{str(options): lambda o=options: load_planner("aco-han", **o) for options in WRITTEN},
        "none to choose from": lambda: load_planner("astar", ants=5),
        "no ant planner": lambda: load_planner("hybrid", colony="astar"),
    }
    calls["names"] = {name: lambda n=name: load_planner(n) for name in NAMES}
    calls["names of versions"] = {name: lambda n=name: planner_version(n) for name in NAMES}
    calls["colonies that start warm"] = {key: lambda k=key: warm(**{k: 0}) for key in ("settled", "reach")}
    calls["plans in time"] = {
        **{
            str(words): lambda w=words: timed(**w) for words in ({"speed": 0.0}, {"speed": math.inf}, {"horizon": -1.0})
        },
        "a mover that is nowhere": lambda: timed([Passing(0.1, (math.nan, 0.0), (0.0, 0.0))]),
    }
    check_messages(calls, data_regression)
