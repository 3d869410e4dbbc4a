"""The pytest plugin, in runs of pytest of its own."""

from __future__ import annotations

import subprocess
import sys

import pytest

pytest_plugins = ["pytester"]
PLUGIN = ("-p", "antdrive.sim.regression.plugin", "-p", "no:cacheprovider")
SUITE = """schema: 1
defaults: {planner: astar, world: small.yaml}
scenarios:
  clear: {}
  closed: {margin: 1.2, expect: {outcome: no_path}}
  hit: {unseen: [{x: 2, y: 1, radius: 0.2}]}
"""
SMALL = "{schema: 1, bounds: [0, 0, 4, 2], start: [0.6, 1, 0], goal: [3.4, 1], cell: 0.2}\n"


@pytest.fixture
def project(pytester: pytest.Pytester) -> pytest.Pytester:
    """A folder with a suite of three scenarios."""
    pytester.makefile(".drive.yaml", a=SUITE)
    pytester.makefile(".yaml", small=SMALL)
    return pytester


def test_a_suite_is_collected_driven_and_compared(project: pytest.Pytester) -> None:
    project.runpytest(*PLUGIN, "--collect-only", "-q").stdout.fnmatch_lines(
        ["*::clear[[]0]", "*::closed[[]0]", "*::hit[[]0]"]
    )
    first = project.runpytest(*PLUGIN)
    first.assert_outcomes(failed=3)
    first.stdout.fnmatch_lines(
        ["baseline: baselines/a/clear-0.json is missing; accept this drive with antdrive accept*"]
    )
    project.runpytest(*PLUGIN, "--drive-update-new").assert_outcomes(passed=2, failed=1)
    assert sorted(path.name for path in (project.path / "baselines" / "a").iterdir()) == [
        "clear-0.json",
        "closed-0.json",
    ]
    second = project.runpytest(*PLUGIN)
    second.assert_outcomes(passed=2, failed=1)
    second.stdout.fnmatch_lines([
        "outcome: collided, expected succeeded",
        "touched unseen[[]0] at (2, 1) with radius 0.2; the robot was at (*",
        "repeat: antdrive check 'a.drive.yaml::hit[[]0]'",
    ])  # fmt: skip
    second.stdout.no_fnmatch_line("*Traceback*")


def test_a_wrong_suite_is_one_line_of_collection(project: pytest.Pytester) -> None:
    project.makefile(".drive.yaml", b="schema: 1\nscenarios:\n  x: {world: small.yaml, planner: astarr}\n")
    found = project.runpytest(*PLUGIN)
    found.assert_outcomes(errors=1)
    found.stdout.fnmatch_lines(["*b.drive.yaml:3: scenarios.x.planner: no planner is called 'astarr'; did you mean*"])
    found.stdout.no_fnmatch_line("*Traceback*")


HEAVY = "('numpy', 'numba', 'pybullet', 'matplotlib', 'PIL', 'pydantic', 'yaml', 'hypothesis')"


def test_the_plugin_imports_nothing_for_a_run_that_does_not_use_it(pytester: pytest.Pytester) -> None:
    pytester.makepyfile("def test_one(): pass")
    code = (
        f"import sys, pytest; code = pytest.main(['-q', '-p', '{PLUGIN[1]}', '-p', 'no:hypothesispytest', '-p', 'no:regressions',"
        "'-p', 'no:datadir'])\n"
        f"print(int(code), [name for name in {HEAVY} if name in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.splitlines()[-1] == "0 []"


def test_collecting_loads_no_physics_and_no_compiler(project: pytest.Pytester) -> None:
    code = (
        f"import sys, pytest; pytest.main(['-q', '--collect-only', '-p', '{PLUGIN[1]}'])\n"
        "print([name for name in ('numba', 'pybullet', 'matplotlib', 'PIL') if name in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.splitlines()[-1] == "[]"
