"""The example of a repository with regression tests of drives: its tests pass, and every command of its page works."""

import json
import os
import re
import shutil
import subprocess
import sys
import xml.etree.ElementTree
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
EXAMPLE = ROOT / "examples" / "regression_suite"
PAGE = (EXAMPLE / "README.md").read_text()
PLUGIN = ("-p", "antdrive.testing.plugin", "-p", "no:cacheprovider")


@pytest.fixture
def checkout(tmp_path):
    """A copy of the example, as it is in version control."""
    return Path(shutil.copytree(EXAMPLE, tmp_path / "checkout", ignore=shutil.ignore_patterns("__pycache__")))


@pytest.fixture
def variables(tmp_path):
    """The environment of a user who has antdrive and pytest installed: both are on the path."""
    for name, module in (("antdrive", "antdrive"), ("pytest", f"pytest {' '.join(PLUGIN)}")):
        script = tmp_path / "bin" / name
        script.parent.mkdir(exist_ok=True)
        script.write_text(f'#!/bin/sh\nexec "{sys.executable}" -m {module} "$@"\n')
        script.chmod(0o755)
    env = {key: value for key, value in os.environ.items() if key not in ("PYTEST_ADDOPTS", "GITHUB_STEP_SUMMARY")}
    return {
        **env,
        "PATH": f"{tmp_path / 'bin'}{os.pathsep}{env['PATH']}",
        "PYTHONPATH": f"{ROOT}{os.pathsep}{ROOT / 'src'}",
    }


def run(words, folder, env):
    return subprocess.run(words, cwd=folder, env=env, capture_output=True, text=True, check=False)


@pytest.mark.slow
def test_its_tests_pass_and_use_every_baseline(checkout, variables):
    done = run(["pytest", "-q", "--drive-strict", "--junitxml=junit.xml"], checkout, variables)
    assert done.returncode == 0, done.stdout
    drives = len(list((checkout / "baselines").rglob("*.json")))
    assert f"{drives} of {drives} drives passed" in done.stdout
    facts = [
        {fact.get("name"): fact.get("value", "") for fact in test.iter("property")}
        for test in xml.etree.ElementTree.parse(checkout / "junit.xml").iter("testcase")
    ]
    driven = [fact for fact in facts if fact.get("drive.outcome") == "succeeded"]
    assert len(driven) == drives - 2  # two of the drives have no path
    assert all(re.fullmatch("[0-9a-f]{64}", fact["drive.digest"]) for fact in driven)


@pytest.mark.slow
def test_a_fault_of_the_planner_fails_its_tests(checkout, variables):
    planner = checkout / "courier.py"
    planner.write_text(planner.read_text().replace("if not moves[here] >> k & 1:", "if not query.grid.free[cell]:"))
    words = ["antdrive", "check", "office.drive.yaml", "--only", "office", "--json", "-j", "1"]
    done = run(words, checkout, variables)
    assert done.returncode == 1, done.stdout
    (test,) = json.loads(done.stdout)["tests"]
    assert test["outcome"] == "invalid_plan"
    assert any("no allowed move" in fault for fault in test["faults"])


def test_baselines_are_small():
    assert all(path.stat().st_size <= 20_000 for path in (EXAMPLE / "baselines").rglob("*.json"))


def test_every_file_of_the_page_exists():
    for name in re.findall(r"^\| (`.*`) \|", PAGE, flags=re.MULTILINE):
        assert all((EXAMPLE / file).exists() for file in re.findall(r"`([^`]+)`", name)), name


@pytest.mark.slow
def test_every_command_of_the_page_works(checkout, variables):
    start, *more, rest = re.findall(r"```sh\n(.*?)```", PAGE, flags=re.DOTALL)
    done = run(["bash", "-ec", "".join([start, *more])], checkout.parent, variables)
    assert done.returncode == 0, done.stdout + done.stderr
    assert "failed, as it should" in done.stdout
    assert re.search(r"touched obstacles\[\d+\] at .*; the robot was at .* at t = ", done.stdout)
    assert done.stdout.count("2 passed in") == 2
    results = checkout.parent / "my-robot" / "results" / "my" / "hall-0"
    assert (results / "drive.html").stat().st_size > 10_000
    assert (checkout.parent / "my-robot" / "report.html").exists()
    everything, _, rest = rest.partition("\n")
    assert everything == "pytest --drive-strict", "which the first test here runs"
    done = run(["bash", "-ec", rest], checkout, variables)
    assert done.returncode == 0, done.stdout + done.stderr
