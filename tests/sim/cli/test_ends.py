"""Other starts and goals in a world, from the command line and from the world's file."""

import json
from pathlib import Path

import pytest

from tests.sim.cli.calling import Call, Refused

OFFICE = """\
schema: 1
bounds: [0, 0, 4, 3]
start: [0.6, 0.6, 0]
goal: [3.4, 0.6]
cell: 0.25
tasks:
  - {name: dock, goal: [3.4, 2.4]}
"""


@pytest.fixture
def office(tmp_path: Path) -> Path:
    path = tmp_path / "office.yaml"
    path.write_text(OFFICE)
    return path


def test_a_run_takes_a_named_task_and_other_ends(antdrive: Call, office: Path) -> None:
    words = ("--task", "dock", "--start", "0.6,2.4,0.5", "-p", "astar", "--no-figures", "--json", "--out", "r")
    code, out, _ = antdrive("run", office, *words)
    facts = json.loads(out)
    assert (code, facts["outcome"]) == (0, "succeeded")
    assert facts["task"] == {"start": [0.6, 2.4, 0.5], "goal": [3.4, 2.4], "goal_tolerance_m": 0.25}
    assert antdrive("verify", "r")[0] == 0


def test_plan_and_show_take_them_too(antdrive: Call, office: Path) -> None:
    _, out, _ = antdrive("plan", office, "--goal", "0.6,2.4", "-p", "astar", "--json")
    assert json.loads(out)["cells"][-1] == [9, 2]
    _, out, _ = antdrive("worlds", "show", office, "--task", "dock", "--json")
    shown = json.loads(out)
    assert (shown["goal"], shown["tasks"]) == ([3.4, 2.4], ["dock"])


def test_each_run_of_a_comparison_says_how_to_repeat_it(antdrive: Call, office: Path) -> None:
    code, _, _ = antdrive(
        "compare", office, "-p", "astar", "-p", "tangent", "--task", "dock", "--no-figures", "--out", "c"
    )
    assert code == 0
    command = json.loads(Path("c/astar/result.json").read_text())["command"]
    assert "--task=dock" in command


def test_a_sweep_drives_the_tasks_of_a_file(antdrive: Call, office: Path) -> None:
    code, out, _ = antdrive("sweep", "--world", office, "-p", "astar", "--tasks", "named", "--dry-run", "--json")
    assert (code, json.loads(out)["runs"]) == (0, 1)
    _, out, _ = antdrive("sweep", "--world", office, "-p", "astar", "--tasks", "7:1.5", "--dry-run", "--json")
    assert json.loads(out)["runs"] == 7


@pytest.mark.parametrize(
    ("words", "error"),
    [
        (("run", "--task", "dok"), "no task 'dok'; did you mean dock?"),
        (("run", "--start", "1,2"), "--start 1,2: write 3 numbers separated by commas"),
        (("plan", "--goal", "9,9"), "--goal: (9, 9) is out of bounds"),
        (("run", "--start", "0.1,1,0"), "office: start: turtlebot at (0.1, 1)"),
    ],
)
def test_wrong_ends_are_refused(refused: Refused, office: Path, words: tuple[str, ...], error: str) -> None:
    assert error in refused(words[0], office, *words[1:])


@pytest.mark.parametrize("tasks", ["0", "many", "3:", "3:far", "-3"])
def test_wrong_numbers_of_tasks_are_refused(refused: Refused, office: Path, tasks: str) -> None:
    assert f"--tasks {tasks}" in refused("sweep", "--world", office, "-p", "astar", f"--tasks={tasks}", "--dry-run")


def test_a_world_without_tasks_has_none_to_sweep(refused: Refused) -> None:
    words = ("--world", "empty", "-p", "astar", "--tasks", "named", "--dry-run")
    assert "tasks: the file of world empty lists no tasks" in refused("sweep", *words)
