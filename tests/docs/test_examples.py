"""The lines after `>>>` in docstrings, which the pages of the API show, run and print what stands below them."""

from __future__ import annotations

import contextlib
import doctest
import importlib
import inspect
import io
import json
from pathlib import Path
from typing import Any

import pytest

import antdrive.runs.suites
import antdrive.sim
import antdrive.views
from antdrive.sim import Run, Scenario
from antdrive.views.report.runs import REQUIRED
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
    for package in (antdrive.sim, antdrive.runs.suites, antdrive.views):
        space |= {name: getattr(package, name) for name in package.__all__}
    assert faults(EXAMPLES[place], space) == []


def faults(text: str, space: dict[str, Any]) -> list[str]:
    """Run the examples of a docstring; what printed something else than stands below it. `...` stands for anything."""
    found = []
    for example in doctest.DocTestParser().get_examples(text):
        out = io.StringIO()
        with contextlib.redirect_stdout(out):
            exec(compile(example.source, "<docstring>", "single"), space)
        shown = example.want
        if shown and not doctest.OutputChecker().check_output(shown, out.getvalue(), doctest.ELLIPSIS):
            found.append(f"{example.source.strip()} shows {shown.strip()}, but printed was {out.getvalue().strip()}")
    return found
