"""`antdrive run`."""

import json
import re
from dataclasses import replace
from pathlib import Path

import pytest

from antdrive.base.atomic import claimed
from antdrive.robots import list_robots
from antdrive.sim import Run
from antdrive.worlds import Disc, Task, World, save_task
from tests.cli.calling import Call, Refused


def test_a_run_writes_the_files_it_lists_and_verify_agrees(antdrive: Call, small: Path, tmp_path: Path) -> None:
    code, out, err = antdrive("run", small, "--out", tmp_path / "r", "--json")
    facts = json.loads(out)
    assert (code, err) == (0, "")
    assert facts["outcome"] == "succeeded"
    assert facts["certificate"]["certified"]
    for path in facts["files"].values():
        assert Path(path).stat().st_size > 0
    assert json.loads((tmp_path / "r" / "result.json").read_text()) == facts
    code, out, _ = antdrive("verify", facts["files"]["rollout"])
    assert code == 0
    assert "certified collision-free" in out


def test_a_run_reports_its_outcome_and_certificate(antdrive: Call, small: Path) -> None:
    code, out, _ = antdrive("run", small, "--planner", "aco-han", "--set", "planner.ants=50", "--seed", "3")
    assert code == 0
    assert "stopped at the goal without contact" in out
    assert "certified collision-free" in out
    assert Path("out/small-aco-han-turtlebot-3/rollout.npz").exists()


def test_a_collision_is_exit_code_1_and_verify_refuses_the_log(antdrive: Call, small: Path, collided_run: Run) -> None:
    disc = collided_run.scenario.unseen[0]
    hidden = f"{disc.x},{disc.y},{disc.radius}"
    code, out, _ = antdrive("run", small, "-p", "astar", "--unseen", hidden, "--json", "--out", "r")
    facts = json.loads(out)
    assert code == 1
    assert facts["outcome"] == "collided"
    assert facts["digest"] == collided_run.rollout.digest  # type: ignore[union-attr]
    code, out, _ = antdrive("verify", "r/rollout.npz")
    assert code == 1
    assert "NOT certified" in out


def test_no_path_is_exit_code_1_with_a_reason(antdrive: Call) -> None:
    code, out, _ = antdrive("run", "no-path", "--json")
    facts = json.loads(out)
    assert (code, facts["outcome"]) == (1, "no_path")
    assert facts["reason"]
    assert antdrive("plan", "no-path")[0] == 1


def test_a_run_without_a_path_removes_the_log_of_an_earlier_run(antdrive: Call) -> None:
    antdrive("run", "empty", "-p", "astar", "--no-figures", "--out", "r")
    assert Path("r/rollout.npz").exists()
    antdrive("run", "no-path", "-p", "astar", "--no-figures", "--out", "r")
    assert not Path("r/rollout.npz").exists()


def test_a_run_replaces_the_files_of_an_earlier_run_and_no_others(antdrive: Call, small: Path, tmp_path: Path) -> None:
    antdrive(
        "run", small, "-p", "aco-han", "-s", "planner.ants=50", "-s", "planner.iterations=5", "--vector", "--out", "o"
    )
    (tmp_path / "o" / "mine.txt").touch()
    antdrive("run", "no-path", "-p", "astar", "--out", "o")
    assert {path.name for path in (tmp_path / "o").iterdir()} == {"result.json", "overview.png", "mine.txt"}


def test_a_run_reports_replans_and_avoidance_which_can_be_switched_off(antdrive: Call, tmp_path: Path) -> None:
    world = tmp_path / "crossing.yaml"
    world.write_text(
        "schema: 1\nname: crossing\nbounds: [0, 0, 6, 4]\nstart: [1, 2, 0]\ngoal: [5, 2]\ncell: 0.25\n"
        "movers: [{radius: 0.3, loop: once, keyframes: [[0, 3, 0.5], [3.5, 3, 1.9], [8, 3, 3.5]]}]\n"
    )
    words = ["run", str(world), "-p", "dstar-lite", "--out", str(tmp_path), "--json"]
    code, out, _ = antdrive(*words)
    measured = json.loads(out)["metrics"]
    assert code == 0
    assert measured["replans"] + measured["avoiding_s"] > 0
    assert measured["tracking_error_max_m"] < 1.0, "measured from the route that was followed at the time"
    assert "avoided movers for" in antdrive(*words[:-1])[1]
    code, out, _ = antdrive(*words, "--no-avoid", "--no-replan")
    assert code == 1
    assert json.loads(out)["outcome"] == "collided"
    assert json.loads(out)["metrics"]["replans"] == json.loads(out)["metrics"]["avoiding_s"] == 0


def test_noise_of_a_robot_whose_file_has_none_is_said_to_change_nothing(antdrive: Call, small: Path) -> None:
    text = antdrive("robots", "turtlebot")[1]
    Path("bare.yaml").write_text("".join(line for line in text.splitlines(True) if not line.startswith("noise")))
    words = ("run", small, "-p", "astar", "--no-figures", "--out", "o", "--noise", "1")
    assert (
        "noise 1 changes nothing: the file of turtlebot has no noise section" in antdrive(*words, "-r", "bare.yaml")[1]
    )
    assert "changes nothing" not in antdrive(*words)[1]


def test_without_figures_a_run_writes_its_log_and_result(antdrive: Call, small: Path) -> None:
    assert antdrive("run", small, "-p", "astar", "--no-figures", "--out", "bare")[0] == 0
    assert sorted(path.name for path in Path("bare").iterdir()) == ["result.json", "rollout.npz"]


def test_a_prelude_needs_a_film(refused: Refused) -> None:
    assert "give --video" in refused("run", "empty", "-p", "as", "--prelude", "2")


def test_a_prelude_needs_a_planner_with_iterations(refused: Refused) -> None:
    words = ["-p", "astar", "--prelude", "2", "--video", "a.mp4"]
    assert "astar does not plan in iterations" in refused("run", "empty", *words)


def test_a_window_needs_a_display(refused: Refused, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("DISPLAY", raising=False)
    assert "no display" in refused("run", "empty", "--gui")


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (["run", "emty"], "did you mean empty"),
        (["run", "empty", "--planner", "asta"], "astar"),
        (["run", "empty", "--robot", "jackel"], "did you mean jackal"),
        (["run", "empty", "--set", "ants=50"], "GROUP.KEY=VALUE"),
        (["run", "empty", "--set", "planner.ants"], "KEY=VALUE"),
        (["run", "empty", "-p", "aco-han", "--set", "planner.ant=50"], "ants"),
        (["run", "empty", "-p", "aco-han", "--set", "planner.ants=many"], "whole number"),
        (["run", "empty", "-p", "aco-han", "--set", "planner.ants=0"], "at least 1"),
        (["run", "empty", "--set", "controller.lookahead=1"], "lookahead_time"),
        (["run", "empty", "--set", "controller.lookahead_margin=7"], "between 0 and 1"),
        (["run", "empty", "--margin", "-1"], "--margin"),
        (["run", "empty", "--cell", "nan"], "cell"),
        (["run", "empty", "--cell", "1e-5"], "cell"),
        (["run", "empty", "--cell", "inf"], "--cell"),
        (["run", "empty", "--margin", "inf"], "--margin"),
        (["run", "empty", "--time-limit", "inf"], "--time-limit"),
        (["run", "empty", "--set", "controller.lookahead_max=inf"], "finite"),
        (["run", "empty", "--set", "controller.lookahead_max=1e9"], "between 0.001 and 100"),
        (["run", "empty", "--set", "controller.lookahead_margin=abc"], "must be a finite number"),
        (["run", "empty", "--unseen", "1e300,1,1"], "none beyond a million"),
        (["run", "empty", "--unseen", "1,2"], "3 numbers"),
        (
            ["run", "empty", "--sees", "all"],
            "--sees all: unknown kind 'all'; choose from positions, velocities, motions",
        ),
        (["run", "empty", "--sees", "positions:far"], "--sees positions:far: write KIND or KIND:METRES"),
        (["run", "empty", "--sees", "positions:-1"], "with a range greater than 0"),
        (["run", "empty", "--unseen", "1,2,-3"], "radius: must be greater than 0"),
        (["run", "empty", "--video", "film.avi"], ".mp4"),
        (["run", "empty", "--out", "/proc/nowhere"], "/proc/nowhere: cannot be written"),
        (["run", "empty", "--video", "folder.mp4"], "--video folder.mp4: is a directory"),
        (
            ["run", "empty", "--smoothing", "straight"],
            "smoothing: unknown 'straight'; choose from none, taut, clearance",
        ),
        (["run", "empty", "--noise", "60"], "noise: 60 times the robot's own is too much: encoder"),
    ],
    ids=lambda value: " ".join(value) if isinstance(value, list) else "",
)
def test_wrong_input_is_one_line_and_exit_code_2(refused: Refused, words: list[str], says: str, tmp_path: Path) -> None:
    (tmp_path / "folder.mp4").mkdir()
    assert says in refused(*words)


def test_a_start_that_overlaps_an_obstacle_is_refused_by_name(refused: Refused, antdrive: Call, tmp_path: Path) -> None:
    world = World("tight", (0, 0, 6, 4), (Disc(2.5, 1.8, 0.4),))
    save_task(Task(world, (3.0, 2.0, 0.0), (5.3, 2.0)), tmp_path / "tight.yaml")
    for command in (["run"], ["plan"], ["compare", "-p", "dijkstra"]):
        line = refused(command[0], "tight.yaml", "-p", "astar", *command[1:])
        assert line.startswith("antdrive: tight.yaml: start: turtlebot at (3, 2) overlaps obstacles[0] at (2.5, 1.8)")
    assert "overlaps unseen[0]" in refused("run", "empty", "--unseen", "1,1,0.5", "--unseen", "3,3,0.5")
    _, out, _ = antdrive("worlds", "show", "tight.yaml")
    assert "passable           no" in out
    assert "start for turtlebot overlaps obstacles[0] at" in out
    (line,) = [line for line in out.splitlines() if line.startswith("start is free for  ")]
    free = line.removeprefix("start is free for  ").split(", ")
    for robot in list_robots():
        assert (f"start for {robot} overlaps" in out) != (robot in free)
    assert f"start is free for  {', '.join(list_robots())}" in antdrive("worlds", "show", "gate")[1]
    starts = json.loads(antdrive("worlds", "show", "gate", "--json")[1])["starts"]
    assert starts == dict.fromkeys(list_robots(), "")


def test_runs_that_differ_have_folders_of_their_own(antdrive: Call, small_run: Run, tmp_path: Path) -> None:
    task = small_run.scenario.task
    save_task(task, tmp_path / "a.yaml")
    save_task(replace(task, goal_tolerance=0.3), tmp_path / "b.yaml")  # of the same name

    def folder(*words: str) -> Path:
        return Path(
            json.loads(antdrive("run", *words, "-p", "astar", "--no-figures", "--json")[1])["files"]["result"]
        ).parent

    first = folder("a.yaml")
    digest = json.loads((first / "result.json").read_text())["digest"]
    assert first == Path("out/small-astar-turtlebot-0")
    others = [
        folder("b.yaml"),
        folder("a.yaml", "--margin", "0.05"),
        folder("a.yaml", "--set", "controller.braking=0.5"),
    ]
    assert all(re.fullmatch(r"small-astar-turtlebot-0-[0-9a-f]{8}", other.name) for other in others)
    assert len({first, *others}) == 4
    assert [folder("a.yaml"), folder("b.yaml")] == [first, others[0]], "the same run again keeps its folder"
    assert json.loads((first / "result.json").read_text())["digest"] == digest


def test_two_runs_do_not_write_into_one_folder_at_once(refused: Refused, small: Path) -> None:
    with claimed("r"):
        line = refused("run", small, "-p", "astar", "--out", "r")
    assert line.startswith("antdrive: r: another run (process ")
