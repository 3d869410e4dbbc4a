"""`antdrive check` and `antdrive accept`: what they print, write and return."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from tests.sim.cli.calling import Call

SUITE = """schema: 1
defaults: {planner: astar, world: small.yaml}
scenarios:
  clear: {seeds: [0, 1]}
  closed: {margin: 1.2, expect: {outcome: no_path}}
"""
HIT = "  hit: {unseen: [{x: 2, y: 1, radius: 0.2}]}\n"


@pytest.fixture
def suite(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    (tmp_path / "small.yaml").write_text(
        "{schema: 1, bounds: [0, 0, 4, 2], start: [0.6, 1, 0], goal: [3.4, 1], cell: 0.2}\n"
    )
    path = tmp_path / "a.drive.yaml"
    path.write_text(SUITE)
    return path


def test_a_suite_is_accepted_and_then_passes(antdrive: Call, suite: Path) -> None:
    code, out, _ = antdrive("check", "a.drive.yaml::closed", "--jobs", "1", "--film", "never")
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


def test_a_collision_fails_is_explained_and_is_not_accepted(antdrive: Call, suite: Path) -> None:
    suite.write_text(SUITE + HIT)
    code, out, _ = antdrive("accept", "a.drive.yaml", "--only", "hit")
    assert code == 1
    assert "not accepted, because the drive is not what the test expects" in out
    assert not (suite.parent / "baselines").exists()
    code, out, _ = antdrive("check", "a.drive.yaml::hit", "--json", "--film", "never", "--results", "res")
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


def test_the_command_in_a_message_repeats_the_drive(antdrive: Call, suite: Path) -> None:
    import shlex

    suite.write_text(SUITE + HIT)
    _, out, _ = antdrive("check", "a.drive.yaml::hit", "--json", "--film", "never")
    (test,) = json.loads(out)["tests"]
    words = shlex.split(test["commands"][1])
    code, out, _ = antdrive(*words[1:], "--no-figures", "--json", "--out", "again")
    again = json.loads(out)
    assert (code, again["outcome"], again["metrics"]["duration_s"]) == (1, "collided", test["metrics"]["duration_s"])


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["check", "b.drive.yaml"], "b.drive.yaml: cannot be read (No such file or directory)"),
        (["check", "a.drive.yaml::x"], "a.drive.yaml: no test 'x'; choose from clear[0], clear[1], closed[0]"),
        (["check", "a.drive.yaml", "--film", "often"], "--film often: unknown; choose from never, failed, always"),
        (["check", "small.yaml"], "small.yaml: is no suite; the name of a suite ends in .drive.yaml"),
    ],
)
def test_wrong_input_is_one_line(antdrive: Call, suite: Path, words: list[str], message: str) -> None:
    code, _, err = antdrive(*words)
    assert (code, err) == (2, f"antdrive: {message}\n")


@pytest.mark.slow
def test_processes_change_nothing(antdrive: Call, suite: Path) -> None:
    antdrive("accept", ".", "--jobs", "1")
    alone = {path.name: path.read_bytes() for path in (suite.parent / "baselines" / "a").iterdir()}
    antdrive("accept", ".", "--jobs", "2")
    assert {path.name: path.read_bytes() for path in (suite.parent / "baselines" / "a").iterdir()} == alone


def test_the_schema_of_suites_is_printed(antdrive: Call) -> None:
    code, out, _ = antdrive("schema", "suite")
    schema = json.loads(out)
    assert (code, schema["required"]) == (0, ["schema", "scenarios"])
