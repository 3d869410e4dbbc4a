"""`antdrive check` and `antdrive accept`: what they print, write and return."""

import json
import os
import re
from pathlib import Path
from types import SimpleNamespace
from xml.etree import ElementTree

import pytest

from antdrive import Run, run
from antdrive.runs.suites import Baseline
from antdrive.sim.written import Written
from antdrive.testing import evaluation
from antdrive.testing.checking import evaluate_tests
from antdrive.views.artefacts import Results
from antdrive.views.figures import run_figures

SUITE = """schema: 1
defaults: {planner: astar, world: small.yaml}
scenarios:
  clear: {seeds: [0, 1]}
  closed: {margin: 1.2, expect: {outcome: no_path}}
"""
HIT = "  hit: {unseen: [{x: 2, y: 1, radius: 0.2}]}\n"


@pytest.fixture
def suite(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    monkeypatch.setattr(run_figures, "overview", lambda rollout, path: Path(path).touch())
    (tmp_path / "small.yaml").write_text(
        "{schema: 1, bounds: [0, 0, 4, 2], start: [1.3, 1, 0], goal: [2.7, 1], cell: 0.25}\n"
    )
    path = tmp_path / "a.drive.yaml"
    path.write_text(SUITE)
    return path


def test_a_suite_is_accepted_and_then_passes(antdrive, suite):
    code, out, _ = antdrive("check", "a.drive.yaml::closed", "--jobs", "1")
    assert code == 1
    assert "is missing; accept this drive with antdrive accept 'a.drive.yaml::closed[0]'" in out
    code, out, _ = antdrive("accept", "a.drive.yaml", "--jobs", "1")
    assert (code, out.splitlines()[-2:]) == (0, ["a.drive.yaml::closed[0]: written", "3 of 3 passed"])
    files = {path: path.read_bytes() for path in (suite.parent / "baselines" / "a").iterdir()}
    assert sorted(path.name for path in files) == ["clear-0.json", "clear-1.json", "closed-0.json"]
    assert antdrive("accept", ".", "--jobs", "1")[1].count(": unchanged") == 3
    code, out, _ = antdrive("check", ".", "--jobs", "1", "--only", "clear")
    assert (code, out.splitlines()[-1]) == (0, "2 of 2 passed")
    assert {path: path.read_bytes() for path in files} == files
    older = suite.parent / "baselines" / "a" / "clear-0.json"
    older.write_text(re.sub(r' *"spl": [\d.]+,\n', "", older.read_text()))
    code, out, _ = antdrive("check", ".", "--jobs", "1", "--only", "clear")
    assert (code, out.splitlines()[1]) == (0, "  not compared: spl; the baseline has no value; antdrive accept adds it")


def test_a_collision_fails_is_explained_and_is_not_accepted(antdrive, suite):
    suite.write_text(SUITE + HIT)
    code, out, _ = antdrive("accept", "a.drive.yaml", "--only", "hit", "--results", "first")
    assert code == 1
    assert "not accepted, because the drive misses the test's expectations" in out
    assert not (suite.parent / "baselines").exists()
    assert Path("first/a/hit-0/overview.png").is_file()
    code, out, _ = antdrive("check", "a.drive.yaml::hit", "--json", "--results", "res")
    found = json.loads(out)
    (test,) = found["tests"]
    assert (code, found["passed"], test["outcome"], test["certified"]) == (1, False, "collided", False)
    assert any(
        line.startswith("touched unseen[0] at (2, 1) with radius 0.2; the robot was at (") for line in test["details"]
    )
    assert Path(test["files"]["overview"]).is_relative_to(Path("res"))
    code, out, _ = antdrive("report", "res", "-o", "report.md")
    assert code == 0
    assert "collided" in Path("report.md").read_text()


def test_the_command_in_a_message_repeats_the_drive(antdrive, suite):
    import shlex

    suite.write_text(SUITE + HIT)
    _, out, _ = antdrive("check", "a.drive.yaml::hit", "--json")
    (test,) = json.loads(out)["tests"]
    words = shlex.split(test["commands"][1])
    code, out, _ = antdrive(*words[1:], "--no-figures", "--json", "--out", "again")
    again = json.loads(out)
    assert (code, again["outcome"], again["metrics"]["duration_s"]) == (1, "collided", test["metrics"]["duration_s"])


@pytest.mark.parametrize("command", ["accept", "check"])
def test_a_baseline_that_is_a_pipe_is_refused(antdrive, suite, command):
    folder = suite.parent / "baselines" / "a"
    folder.mkdir(parents=True)
    os.mkfifo(folder / "closed-0.json")
    code, out, _ = antdrive(command, "a.drive.yaml::closed", "--jobs", "1")
    assert code == 2
    assert "closed-0.json: is a pipe; give a baseline" in out


BROKEN = """
class Raises:
    def plan(self, query, rng):
        raise RuntimeError("lost")


class Wrong:
    def __init__(self):
        self.plan = None
"""


@pytest.mark.parametrize("jobs", ["1", pytest.param("2", marks=pytest.mark.slow)])
def test_a_broken_test_hides_no_other(antdrive, suite, jobs, small_run):
    """A damaged baseline, a setting that no drive takes, a planner that raises and one that is none, before a good test."""
    Baseline.of(small_run, "raises[0]").save(suite.parent / "baselines" / "a" / "raises-0.json")
    (suite.parent / "mine.py").write_text(BROKEN)
    suite.write_text(
        "schema: 1\ndefaults: {planner: astar, world: small.yaml}\nscenarios:\n"
        "  merged: {}\n"
        "  fine-cells: {cell: 1.0e-9, baseline: false}\n"
        "  raises: {planner: 'mine.py:Raises'}\n"
        "  none: {planner: 'mine.py:Wrong', baseline: false}\n"
        "  good: {baseline: false}\n"
    )
    damaged = suite.parent / "baselines" / "a" / "merged-0.json"
    damaged.write_text("<<<<<<< HEAD\n{}\n")
    code, out, _ = antdrive("check", ".", "--jobs", jobs, "--results", "res", "--json")
    tests = {test["address"].partition("::")[2]: test for test in json.loads(out)["tests"]}
    assert list(tests) == ["merged[0]", "fine-cells[0]", "raises[0]", "none[0]", "good[0]"]
    assert [test["passed"] for test in tests.values()] == [False] * 4 + [True]
    assert "merged-0.json: not a baseline" in tests["merged[0]"]["faults"][0]
    assert "a.drive.yaml:5: scenarios.fine-cells.cell: " in tests["fine-cells[0]"]["faults"][0]
    assert tests["raises[0]"]["outcome"] == "planner_error"
    assert tests["raises[0]"]["details"] == ["changed since the baseline: world"]
    assert "RuntimeError: lost" in Path(tests["raises[0]"]["files"]["traceback"]).read_text()
    assert code == 2, "of the worst: input is wrong"


@pytest.mark.slow
def test_a_test_that_kills_its_process_is_named(antdrive, suite):
    (suite.parent / "mine.py").write_text(
        "import os\nfrom antdrive.planners import AStar\nclass Deadly(AStar):\n    def plan(self, *_): os._exit(3)\n"
    )
    suite.write_text(SUITE + "  deadly: {planner: 'mine.py:Deadly'}\n")
    antdrive("accept", "a.drive.yaml", "--only", "cl*", "--jobs", "1")
    code, out, _ = antdrive("check", "a.drive.yaml", "--jobs", "2", "--json", "--results", "res")
    *others, deadly = json.loads(out)["tests"]
    assert (code, [test["passed"] for test in others]) == (1, [True] * 3)
    assert deadly["faults"] == ["planner Deadly (mine.py:4) ended the process with exit code 3"]


def test_a_fault_of_the_program_is_told_with_its_traceback(antdrive, suite, monkeypatch):
    def broken(scenario):
        raise IndexError("of another's replanner")

    monkeypatch.setattr(evaluation, "drive", broken)
    code, out, _ = antdrive("check", "a.drive.yaml::closed", "--results", "res")
    assert (code, out.splitlines()[1]) == (3, "  internal error: IndexError: of another's replanner")
    assert "in broken" in Path("res/a/closed-0/traceback.txt").read_text()


def test_results_are_printed_as_they_come(antdrive, suite, monkeypatch):
    """Ctrl-C in the second test leaves the first one's result."""
    made: list[Run] = []

    def interrupted(scenario):
        if made:
            raise KeyboardInterrupt
        made.append(run(scenario))
        return made[0]

    monkeypatch.setattr(evaluation, "drive", interrupted)
    code, out, _ = antdrive("check", "a.drive.yaml", "--jobs", "1")
    assert (code, out.splitlines()[0]) == (130, "a.drive.yaml::clear[0]: FAILED")


def test_results_of_suites_of_one_name_are_kept_apart(antdrive, suite):
    for name, bound in (("x", "< 1"), ("y", "> 1")):
        folder = suite.parent / name
        folder.mkdir()
        entry = f'{{world: ../small.yaml, planner: astar, baseline: false, expect: {{duration_s: "{bound}"}}}}'
        (folder / "s.drive.yaml").write_text(f"schema: 1\nscenarios:\n  one: {entry}\n")
    suite.unlink()
    code, out, _ = antdrive("check", ".", "--jobs", "1", "--results", "res")
    assert (code, "1 of 2 passed" in out) == (1, True)
    assert (suite.parent / "res" / "x" / "s" / "one-0" / "rollout.npz").exists()


def test_results_that_cannot_be_written_do_not_hide_the_fault(antdrive, suite):
    (suite.parent / "res").mkdir()
    (suite.parent / "res" / "a").write_text("a file where a folder is due")
    suite.write_text(SUITE + HIT)
    code, out, _ = antdrive("check", "a.drive.yaml::hit", "--results", "res")
    assert code == 1
    assert "  outcome: collided, expected succeeded" in out
    assert "  results: " in out


def test_ci_gets_junit_a_summary_and_unused_baselines(antdrive, suite, monkeypatch):
    monkeypatch.setenv("GITHUB_STEP_SUMMARY", "page.md")
    suite.write_text(SUITE + HIT)
    gone = suite.parent / "baselines" / "a" / "gone-0.json"
    gone.parent.mkdir(parents=True)
    gone.write_text("{}")
    words = ("check", "a.drive.yaml::hit", "--junit", "out.xml", "--results", "res")
    code, out, _ = antdrive(*words)
    assert (code, "unused baseline: baselines/a/gone-0.json; remove it" in out) == (1, True)
    (case,) = ElementTree.parse("out.xml").iter("testcase")
    told = {entry.get("name"): entry.get("value") for entry in case.iter("property")}
    assert (case.get("classname"), case.get("name"), told["drive.outcome"]) == ("a.drive.yaml", "hit[0]", "collided")
    (failure,) = case.iter("failure")
    assert "touched unseen[0]" in str(failure.text)
    assert Path("page.md").read_text().startswith("### Drives: 0 of 1 passed")
    monkeypatch.setenv("GITHUB_STEP_SUMMARY", str(suite / "page.md"))
    suite.write_text(SUITE.replace("{margin: 1.2, ", "{margin: 1.2, baseline: false, "))
    code, _, err = antdrive("check", "a.drive.yaml::closed")
    assert (code, "GITHUB_STEP_SUMMARY: " in err, err.count("\n")) == (0, True, 1)
    assert antdrive("check", "a.drive.yaml::closed", "--strict")[0] == 1


PYTHON = """
import pytest

from antdrive.sim.written import Written

def test_named(drive):
    drive("small.yaml", "astar")

def test_broken(drive):
    drive("small.yaml", "astar", baseline=False)
    assert 1 == 2, "of its own"

def test_without_drives():
    raise NotImplementedError
"""


@pytest.mark.slow
def test_python_tests_are_accepted_and_checked_like_suites(antdrive, suite):
    """Beside a suite, a module without drives that cannot be imported, and the planner of another test."""
    (suite.parent / "test_accepted_here.py").write_text(PYTHON)
    (suite.parent / "test_of_others.py").write_text("import no_such_module\n")
    words = (".", "--jobs", "1", "--results", "res", "--json")
    code, out, err = antdrive("accept", *words)
    tests = {test["address"]: test for test in json.loads(out)["tests"]}
    assert (code, err) == (1, "")
    assert tests["test_accepted_here.py::test_named"]["accepted"] == "written"
    broken = [test for test in json.loads(out)["tests"] if not test["passed"]]
    assert [test["faults"] for test in broken] == [["AssertionError: of its own"]]
    assert broken[0]["commands"] == ["pytest test_accepted_here.py::test_broken"]
    assert len(json.loads(out)["tests"]) == 3 + 3
    assert (suite.parent / "baselines" / "test_accepted_here" / "test_named.json").exists()
    (suite.parent / "small.yaml").write_text(
        "{schema: 1, bounds: [0, 0, 4, 2], start: [1.3, 1, 0], goal: [2.5, 1], cell: 0.25}\n"
    )
    code, out, _ = antdrive("check", "test_accepted_here.py::test_named", *words[3:-1])
    assert (code, out.splitlines()[0]) == (1, "test_accepted_here.py::test_named: FAILED")
    assert "  changed since the baseline: world" in out
    (results := suite.parent.parent / "results elsewhere").mkdir()  # pytest takes no root from it
    elsewhere = ("--results", results)
    assert antdrive("accept", "test_accepted_here.py::test_named", *elsewhere)[1].splitlines() == [
        "test_accepted_here.py::test_named: renewed", "1 of 1 passed",
    ]  # fmt: skip


def test_a_module_without_drives_is_one_line(antdrive, refused, suite):
    (suite.parent / "test_plain_here.py").write_text("def test_nothing(): pass\n")
    assert "test_plain_here.py: no test uses the fixture drive" in refused("accept", "test_plain_here.py")
    assert "no_such.py" in refused("accept", "no_such.py")


@pytest.mark.slow
def test_processes_change_nothing(antdrive, suite):
    antdrive("accept", ".", "--jobs", "1")
    alone = {path.name: path.read_bytes() for path in (suite.parent / "baselines" / "a").iterdir()}
    antdrive("accept", ".", "--jobs", "2")
    assert {path.name: path.read_bytes() for path in (suite.parent / "baselines" / "a").iterdir()} == alone


@pytest.mark.parametrize(("cores", "asked", "started"), [(3, None, 3), (3, 2, 2), (64, None, 10)])
def test_a_process_for_each_core_that_may_be_used(cores, asked, started, monkeypatch, tmp_path):
    """joblib counts those of a container; the operating system says how many its host has."""
    found: list[int] = []
    case = SimpleNamespace(written=Written(world="empty"), entry=SimpleNamespace(log=None))

    def evaluate_cases(cases, *, jobs, **others):
        found.append(jobs)
        return []

    monkeypatch.setattr("joblib.cpu_count", lambda: cores)
    monkeypatch.setattr("antdrive.testing.checking.select", lambda words, only: [case] * 10)
    monkeypatch.setattr("antdrive.testing.checking.evaluate_cases", evaluate_cases)
    monkeypatch.setattr("antdrive.testing.checking.unused_beside", lambda suites: [])
    how = dict.fromkeys(("choose", "report", "progress"), print)
    assert evaluate_tests(["a"], only=None, jobs=asked, update="", results=Results(tmp_path), **how) == ([], [])
    assert found == [started]
