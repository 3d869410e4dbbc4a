"""The lines after `>>>` in docstrings, which the pages of the API show, run."""

from __future__ import annotations

import doctest
import importlib
import inspect
import json
from pathlib import Path
from typing import Any

import pytest

import antdrive.sim
import antdrive.sim.regression
from antdrive.sim import Run, Scenario
from antdrive.sim.view.report.runs import REQUIRED
from tests.docs.test_reference import PACKAGES


def described(package: str) -> dict[str, str]:
    """The docstrings with examples of what a package offers, by the place of what they describe."""
    module = importlib.import_module(package)
    found: dict[str, Any] = {}
    for name in module.__all__:
        thing = getattr(module, name)
        found[name] = thing
        if inspect.isclass(thing):
            found |= {f"{name}.{key}": getattr(thing, key) for key in vars(thing) if not key.startswith("_")}
    routines = {name: thing for name, thing in found.items() if inspect.isclass(thing) or inspect.isroutine(thing)}
    return {
        f"{thing.__module__}.{thing.__qualname__}": doc
        for thing in routines.values()
        if ">>>" in (doc := inspect.getdoc(thing) or "")
    }


EXAMPLES = {place: doc for package in PACKAGES for place, doc in described(package).items()}


def test_there_are_examples() -> None:
    assert len(EXAMPLES) >= 5


@pytest.mark.parametrize("place", EXAMPLES)
def test_the_example_of_a_docstring_runs(
    place: str, small_scenario: Scenario, small_run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    assert small_run.rollout
    Path("out/slalom").mkdir(parents=True)
    small_run.rollout.save("out/slalom/rollout.npz")
    Path("out/slalom/result.json").write_text(json.dumps(dict.fromkeys(REQUIRED, "slalom")))
    task = small_scenario.task
    space: dict[str, Any] = {
        "scenario": small_scenario,
        "task": task,
        "world": task.world,
        "robot": small_scenario.robot,
    }
    space |= {name: getattr(antdrive.sim, name) for name in antdrive.sim.__all__}
    space |= {name: getattr(antdrive.sim.regression, name) for name in antdrive.sim.regression.__all__}
    for example in doctest.DocTestParser().get_examples(EXAMPLES[place]):
        exec(compile(example.source, place, "single"), space)
