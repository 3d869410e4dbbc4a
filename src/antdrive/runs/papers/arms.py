"""Settings of an experiment's planner in the terms that decide a comparison, read from the planner and its map."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import Any

import numpy as np

from antdrive.planners import Planner, Query, load_planner
from antdrive.planners.colonies.ant_system import ibraheem_beta
from antdrive.planners.colonies.colony import Colony, ColonyGraph
from antdrive.planners.colonies.pfaco import PotentialFieldAnts
from antdrive.planners.iterative import as_iterative
from antdrive.runs.papers.experiment import Experiment
from antdrive.worlds import Grid

#: By heading, the options of planners that it shows.
OPTIONS: Mapping[str, tuple[str, ...]] = MappingProxyType(
    {
        "walk": ("backtrack", "shortcut", "revisit", "memory", "min_weight", "tries", "gates"),
        "first pheromone": ("mix",),
        "deposit": (
            *("deposit", "ranks", "graded", "evaporation", "min_pheromone", "q_max", "q_min"),
            *("elite", "ties", "depositors", "elitism", "elite_of", "update_every", "restart_every"),
        ),
        "ants": ("ants", "explorers", "population"),
        "iterations": ("iterations",),
    }
)
UNSHOWN = ("time_budget", "threads", "max_steps", "initial")  # without effect here, or shown by other words
MAPS = 10  # maps whose moves are counted
WORDS = MappingProxyType({"True": "yes", "False": "no", "None": "none"})
REST = "further options"
HEADS = ("planner", "moves", "movers", *OPTIONS, "step limit of an ant", "budget", "counted as work", REST)


def arm_facts(experiment: Experiment) -> dict[str, str]:
    """Return the settings of an experiment's planner by heading of `HEADS`, in words."""
    planner = experiment.made or load_planner(experiment.planner, **experiment.options)
    query = experiment.query(experiment.world(0))
    values = {field.name: getattr(planner, field.name) for field in dataclasses.fields(planner)}  # type: ignore[arg-type]
    if "q_max" in values:
        del values["deposit"]  # an ageing ant's amount lies between its bounds
    if "beta" in values and values["beta"] is None:
        values["beta"] = ibraheem_beta(max(query.grid.shape))
    facts = {"planner": type(planner).__name__, "moves": _moves(experiment), "movers": _movers(experiment)}
    for head, names in OPTIONS.items():
        facts[head] = _listed({name: values[name] for name in names if name in values})
    shown = {*UNSHOWN, *(name for names in OPTIONS.values() for name in names)}
    ants = as_iterative(planner)
    if ants is not None and math.isfinite(experiment.work):
        facts["iterations"] = "until the budget is spent"
    facts["first pheromone"] = ", ".join(filter(None, (facts["first pheromone"], _first_trail(planner, query))))
    facts["step limit of an ant"] = _step_limit(planner, query)
    facts["budget"] = f"{experiment.work:,.0f} {ants.work_unit}" if ants and math.isfinite(experiment.work) else "–"
    planned = ants or planner.plan(query, np.random.default_rng(0))
    facts["counted as work"] = "cells propagated" if experiment.movers else planned.work_unit
    facts[REST] = _listed({name: value for name, value in values.items() if name not in shown})
    return {head: facts[head] or "–" for head in HEADS}


def moves_in_words(queries: Sequence[Query]) -> str:
    """Return which moves the grids of queries allow beyond or short of those that cut no corner."""
    more, fewer = zip(*map(_changed_moves, queries), strict=True)
    words = "eight, corners may be cut" if any(more) else "eight, none cuts a corner"
    closed = " to ".join(str(one) for one in sorted({min(fewer), max(fewer)}))
    return f"{words}; {closed} closed" if any(fewer) else words


def merged(facts: Mapping[str, Mapping[str, str]]) -> dict[str, str]:
    """Return the facts of one arm on several maps, by map: where maps differ, each value with its maps."""
    found: dict[str, str] = {}
    for head in HEADS:
        values: dict[str, list[str]] = {}
        for where, one in facts.items():
            values.setdefault(one[head], []).append(where)
        alone = len(values) == 1
        found[head] = "; ".join(value if alone else f"{value} ({', '.join(maps)})" for value, maps in values.items())
    return found


def _moves(experiment: Experiment) -> str:
    return moves_in_words([experiment.query(world) for world in {*map(experiment.world, experiment.seeds(MAPS))}])


def _changed_moves(query: Query) -> tuple[int, int]:
    """Return the number of moves that a grid has beyond those that cut no corner, and that it lacks."""
    usual, moves = Grid.from_free(query.grid.free).moves, query.grid.moves
    more, fewer = (int(np.unpackbits(one & ~other).sum()) // 2 for one, other in ((moves, usual), (usual, moves)))
    return more, fewer


def _movers(experiment: Experiment) -> str:
    parts = (
        f"{experiment.movers}",
        "on the path" * experiment.on_path,
        "may enter the robot's cell" * experiment.enter,
    )
    return ", ".join(filter(None, parts)) if experiment.movers else ""


def _listed(values: Mapping[str, Any]) -> str:
    return ", ".join(f"{name} {WORDS.get(str(value)) or _number(value)}" for name, value in values.items())


def _number(value: Any) -> str:
    return f"{value:g}" if isinstance(value, float) else f"{value}"


def _first_trail(planner: Planner, query: Query) -> str:
    """Return the range of a colony's pheromone before its first iteration; empty for other planners."""
    graph, rng = ColonyGraph.of(query), np.random.default_rng(0)
    free = graph.of_nodes(query.grid.free)
    if isinstance(planner, PotentialFieldAnts):
        trail = planner.initial_trail(planner.potential(query), free, rng)[free]
    elif isinstance(planner, Colony):
        trail = planner.initial_trail(graph, rng)
    else:
        return ""
    low, high = float(trail.min()), float(trail.max())
    return f"{low:.3g}{'' if low == high else f' to {high:.3g}'} on {'cells' if trail.ndim == 1 else 'arcs'}"


def _step_limit(planner: Planner, query: Query) -> str:
    default = getattr(planner, "default_steps", None)
    if default is None:
        return ""
    steps = getattr(planner, "max_steps", None) or default(query.grid.free.size)
    return f"{steps:,}"
