"""`antdrive compare`."""

import json
import shlex
from pathlib import Path

import pytest

from antdrive import robots
from tests.sim.cli.calling import Call, Refused

CATALOGUE = Path(robots.__path__[0]) / "catalog"


def test_planners_are_compared_in_a_table_a_figure_and_a_film(antdrive: Call, small: Path, tmp_path: Path) -> None:
    words = ("--out", "c", "--video", "c.mp4", "--speed", "20")
    code, out, err = antdrive("compare", small, "-p", "astar", "-p", "tangent", *words, "--json")
    facts = json.loads(out)
    assert (code, err) == (0, "")
    assert set(facts["runs"]) == {"astar", "tangent"}
    for name in facts["runs"]:
        result = json.loads((tmp_path / "c" / name / "result.json").read_text())
        assert result["command"].startswith("antdrive run ")
        assert f"--planner {name}" in result["command"]
    assert Path("c.mp4").stat().st_size > 1000
    logs = [tmp_path / "c" / name / "rollout.npz" for name in facts["runs"]]
    assert antdrive("render", *logs, "-o", "again.gif", "--size", "320x240", "--speed", "30")[0] == 0
    assert Path("again.gif").exists()


def test_fewer_than_two_paths_are_nothing_to_compare(antdrive: Call, tmp_path: Path) -> None:
    words = ["compare", "no-path", "-p", "astar", "-p", "dijkstra", "--out", str(tmp_path / "c"), "--no-figures"]
    code, _, err = antdrive(*words)
    assert code == 1
    assert "nothing to compare" in err


def test_the_command_that_repeats_a_run_names_the_robot_as_it_was_given(antdrive: Call, small: Path) -> None:
    Path("mine.yaml").write_text((CATALOGUE / "turtlebot.yaml").read_text().replace("name: turtlebot", "name: mine"))
    words = ["-p", "astar", "-p", "dijkstra", "--robot", "mine.yaml", "--no-figures", "--out", "c"]
    assert antdrive("compare", small, *words)[0] == 0
    command = shlex.split(json.loads(Path("c/astar/result.json").read_text())["command"])
    assert command[command.index("--robot") + 1] == "mine.yaml"
    assert antdrive(*command[1:], "--no-figures", "--out", "again")[0] == 0


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (["compare", "empty", "-p", "astar"], "two to six different planners"),
        (["compare", "empty", "-p", "astar", "-p", "astar"], "two to six different planners"),
    ],
    ids=lambda value: " ".join(value) if isinstance(value, list) else "",
)
def test_wrong_input_is_one_line_and_exit_code_2(refused: Refused, words: list[str], says: str) -> None:
    assert says in refused(*words)
