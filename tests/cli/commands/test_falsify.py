"""`antdrive falsify`."""

import json
import re
from pathlib import Path

import pytest

from antdrive.runs.suites.scenarios import scenario_of
from antdrive.runs.suites.suite import load_suite

GREEDY = """from dataclasses import dataclass
from antdrive.planners import AStar

@dataclass(frozen=True)
class Greedy(AStar):
    calm: float = 1.0
"""
CARELESS = ["-r", "jackal", "--margin", "0", "--noise", "6", "--smoothing", "none"]


@pytest.mark.slow
@pytest.mark.parametrize("planner", ["astar", "mine.py:Greedy", pytest.param("mine:Greedy", marks=pytest.mark.slow)])
def test_failures_are_handed_over_as_a_suite(antdrive, planner):
    """Those of a planner of one's own, too: its class is found beside, by other processes as well."""
    Path("mine.py").write_text(GREEDY)
    words = [
        "falsify",
        *CARELESS,
        "--budget",
        "2",
        "--seed",
        "3",
        "--method",
        "random",
        "--shrink",
        "0",
        "--no-figures",
    ]
    words += ["-p", planner, *(["--set", "planner.calm=0.5"] if ":" in planner else [])]
    for name in ("failure-9/result.json", "failure-9/drive.html", "failure-8/mine.txt"):
        path = Path("found") / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.touch()
    code, out, err = antdrive(*words, "--json", "--out", "found")
    assert (code, err) == (1, "")
    facts = json.loads(out)
    assert (facts["runs"], facts["interrupted"]) == (2, False)
    assert all(one["repeats"] for one in facts["reported"])
    cases = load_suite(Path("found") / "failures.drive.yaml")
    assert len(cases) == facts["distinct"] == len(facts["reported"])
    assert {scenario_of(case).noise for case in cases} == {6.0}
    assert all(getattr(scenario_of(case).planner, "calm", 0.5) == 0.5 for case in cases)
    assert not Path("found/failure-9").exists(), "of an earlier search"
    assert Path("found/failure-8/mine.txt").exists()
    logs = sorted(Path("found").glob("failure-*/rollout.npz"))
    assert [log.parent.name for log in logs] == [case.name for case in cases]
    result = json.loads((logs[0].parent / "result.json").read_text())
    assert (result["outcome"], result["command"]) == (
        facts["reported"][0]["outcome"],
        "antdrive check found/failures.drive.yaml::failure-1",
    )
    assert antdrive("report", "found", "-o", "page.html")[0] == 0
    if ":" in planner:
        assert antdrive("check", "found/failures.drive.yaml", "--jobs", "1")[0] == 0


def test_a_set_up_without_failures_is_exit_code_0(antdrive):
    code, out, err = antdrive("falsify", "-p", "astar", "--budget", "1", "--out", "none")
    assert (code, err) == (0, "")
    assert out == "after 1 run (the robot drove in 1): 0 failures, 0 distinct\n"
    assert [path.name for path in Path("none").iterdir()] == ["falsify.json"]


def test_other_searches_have_other_folders(antdrive):
    search = ("falsify", "-p", "astar", "--budget", "1", "--margin")
    for margin in ("0.03", "0.04", "0.03"):
        assert antdrive(*search, margin)[0] == 0
    first, second = sorted(path.name for path in Path("out").iterdir())
    assert first == "falsify-astar-turtlebot-0"
    assert re.fullmatch(f"{first}-[0-9a-f]{{8}}", second)


def test_nothing_of_an_earlier_search_is_left(antdrive):
    Path("none/failure-1").mkdir(parents=True)
    for name in ("failures.drive.yaml", "failure-1/rollout.npz"):
        (Path("none") / name).touch()
    assert antdrive("falsify", "-p", "astar", "--budget", "1", "--out", "none")[0] == 0
    assert [path.name for path in Path("none").iterdir()] == ["falsify.json"]


@pytest.mark.slow
def test_failures_are_shrunk_and_have_pages(antdrive):
    code, out, _ = antdrive(
        "falsify", "-p", "astar", *CARELESS, "--budget", "2", "--seed", "3", "--method", "random", "--out", "found"
    )
    assert code == 1
    assert "failure-1  " in out
    assert antdrive("verify", "found/failure-1/drive.html")[0] in (0, 1)
    assert "repeat: antdrive check found/failures.drive.yaml" in out
    assert antdrive("check", "found/failures.drive.yaml", "--jobs", "1")[0] == 0
