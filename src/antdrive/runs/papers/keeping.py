"""The trials of an experiment in a file, so that an interrupted reproduction goes on where it stopped."""

from __future__ import annotations

import functools
import hashlib
import json
import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any
from zipfile import BadZipFile

import numpy as np
import numpy.typing as npt

import antdrive.planners
import antdrive.runs.papers
import antdrive.worlds
from antdrive.base.atomic import written_whole
from antdrive.planners import History, PlanResult, PlanStatus
from antdrive.runs.papers.experiments import Experiment
from antdrive.runs.papers.trials import Trial

JUDGING = ("claims", "verdicts")  # modules on which no trial depends
HISTORY = ("best", "iteration_best", "iteration_mean", "arrived")
NUMBERS = ("optimum", "cpu_s", "total", "concentration")  # in the order of `Trial`
NONE = -1  # the size of waypoints that a plan does not have


def trials_key(experiment: Experiment, seeds: int) -> str:
    """What the trials of an experiment depend on, the source code included: a file with another key is not used."""
    facts = {
        "map": experiment.map,
        "name": experiment.name,
        "planner": experiment.planner if experiment.made is None else repr(experiment.made),
        "options": dict(experiment.options),
        "worlds": experiment.worlds,
        "work": experiment.work,
        "movers": experiment.movers,
        "seeds": seeds,
        "code": code_hash(),
    }
    return json.dumps(facts, sort_keys=True)


@functools.cache
def code_hash() -> str:
    """The hash of the source files of worlds, planners and papers' experiments, but for those that only judge and draw."""
    found = hashlib.sha256()
    for package in (antdrive.worlds, antdrive.planners, antdrive.runs.papers):
        for folder in package.__path__:
            for path in sorted(Path(folder).rglob("*.py")):
                if package is antdrive.runs.papers and path.stem in JUDGING:
                    continue
                found.update(path.read_bytes())
    return found.hexdigest()


def keep_trials(trials: Sequence[Trial], path: Path, key: str) -> None:
    """Write trials to a file; plans lose their fields, options and planning times."""
    plans = [trial.result for trial in trials]
    lines = [plan.waypoints for plan in plans]
    arrays: dict[str, Any] = {
        "key": np.array(key),
        "seed": np.array([trial.seed for trial in trials]),
        "world": np.array([trial.world for trial in trials]),
        "numbers": np.array([[getattr(trial, name) for name in NUMBERS] for trial in trials]).reshape(-1, len(NUMBERS)),
        "status": np.array([plan.status.name for plan in plans], dtype=np.str_),
        "work": np.array([plan.work for plan in plans]),
        "lengths": np.array([[plan.cost, _or_nan(plan.length)] for plan in plans]).reshape(-1, 2),
        "cells": np.concatenate([np.empty((0, 2), dtype=np.int32), *(plan.cells for plan in plans)]),
        "sizes": np.array([len(plan.cells) for plan in plans]),
        "waypoints": np.concatenate([np.empty((0, 2)), *(line for line in lines if line is not None)]),
        "waypoint_sizes": np.array([NONE if line is None else len(line) for line in lines]),
        "history_sizes": np.array([len(plan.history) for plan in plans]),
    }
    for name in HISTORY:
        arrays[name] = np.concatenate([getattr(History(), name), *(getattr(plan.history, name) for plan in plans)])
    with written_whole(path) as temporary, temporary.open("wb") as file:
        np.savez_compressed(file, **arrays)


def kept_trials(path: Path, key: str) -> list[Trial] | None:
    """The trials of a file; None if there is no such file, or it has another key or cannot be read."""
    try:
        with path.open("rb") as opened, np.load(opened, allow_pickle=False) as file:
            if str(file["key"]) != key:
                return None
            arrays = {name: file[name] for name in file.files}
    except (OSError, ValueError, KeyError, EOFError, BadZipFile):
        return None
    cells = _parts(arrays["cells"], arrays["sizes"])
    waypoints = _parts(arrays["waypoints"], np.maximum(arrays["waypoint_sizes"], 0))
    histories = [_parts(arrays[name], arrays["history_sizes"]) for name in HISTORY]
    trials = []
    for k, (seed, world) in enumerate(zip(arrays["seed"], arrays["world"], strict=True)):
        cost, length = (float(value) for value in arrays["lengths"][k])
        plan = PlanResult(
            status=PlanStatus[str(arrays["status"][k])],
            cells=cells[k],
            cost=cost,
            length=None if math.isnan(length) else length,
            waypoints=None if arrays["waypoint_sizes"][k] == NONE else waypoints[k],
            work=int(arrays["work"][k]),
            history=History(*(parts[k] for parts in histories)),
        )
        trials.append(Trial(int(seed), int(world), plan, *map(float, arrays["numbers"][k])))
    return trials


def _or_nan(value: float | None) -> float:
    return math.nan if value is None else value


def _parts(joined: npt.NDArray[Any], sizes: npt.NDArray[np.int64]) -> list[npt.NDArray[Any]]:
    return np.split(joined, np.cumsum(sizes)[:-1]) if len(sizes) else []
