"""`antdrive run` and `antdrive plan`."""

import contextlib
import json
import os
import re
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import pytest

from antdrive.base.atomic import folder_lock
from antdrive.robots import list_robots
from antdrive.runs.campaigns.campaign import make_campaign
from antdrive.runs.campaigns.expanding import expand
from antdrive.runs.suites.scenarios import scenario_of, select
from antdrive.worlds import Disc, Task, World, save_task


def test_a_run_writes_the_files_it_lists_and_verify_agrees(antdrive, small, tmp_path):
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


def test_a_run_reports_its_outcome_and_certificate(antdrive, small):
    code, out, _ = antdrive(
        "run", small, "--planner", "aco-han", "--set", "planner.ants=50", "--seed", "3", "--no-figures"
    )
    assert code == 0
    assert "stopped at the goal without contact" in out
    assert "certified collision-free" in out
    assert Path("out/small-aco-han-turtlebot-3/rollout.npz").exists()


def test_a_collision_is_exit_code_1_and_verify_refuses_the_log(antdrive, small, collided_run):
    disc = collided_run.scenario.unseen[0]
    hidden = f"{disc.x},{disc.y},{disc.radius}"
    code, out, _ = antdrive("run", small, "-p", "astar", "--unseen", hidden, "--json", "--no-figures", "--out", "r")
    facts = json.loads(out)
    assert code == 1
    assert facts["outcome"] == "collided"
    assert facts["digest"] == collided_run.rollout.digest
    code, out, _ = antdrive("verify", "r/rollout.npz")
    assert code == 1
    assert "NOT certified" in out


def test_no_path_is_exit_code_1_with_a_reason(antdrive):
    code, out, _ = antdrive("run", "no-path", "--no-figures", "--json")
    facts = json.loads(out)
    assert (code, facts["outcome"]) == (1, "no_path")
    assert facts["reason"]
    assert antdrive("plan", "no-path")[0] == 1


def test_a_run_without_a_path_removes_the_log_of_an_earlier_run(antdrive, small):
    antdrive("run", small, "-p", "astar", "--no-figures", "--out", "r")
    assert Path("r/rollout.npz").exists()
    antdrive("run", "no-path", "-p", "astar", "--no-figures", "--out", "r")
    assert not Path("r/rollout.npz").exists()


@pytest.mark.slow
def test_a_run_replaces_the_files_of_an_earlier_run_and_no_others(antdrive, small, tmp_path):
    antdrive(
        "run",
        small,
        "-p",
        "aco-han",
        "-s",
        "planner.ants=50",
        "-s",
        "planner.iterations=5",
        "--figures",
        "pdf",
        "--out",
        "o",
    )
    written = {
        "drive.html",
        "result.json",
        "rollout.npz",
        "overview.png",
        "overview.pdf",
        "certificate.pdf",
        "plan.pdf",
    }
    assert {path.name for path in (tmp_path / "o").iterdir()} == written
    (tmp_path / "o" / "mine.txt").touch()
    antdrive("run", "no-path", "-p", "astar", "--out", "o")
    assert {path.name for path in (tmp_path / "o").iterdir()} == {"result.json", "overview.png", "mine.txt"}


def test_no_bar_outlives_an_error_on_a_terminal(tmp_path):
    """Planners with options are user code, at which the process forks: nothing draws for the parent that waits."""
    leader, follower = os.openpty()
    words = [sys.executable, "-m", "antdrive", "run", "empty", "-p", "astar", "-s", "planner.ants=3"]
    streams = dict.fromkeys(("stdin", "stdout", "stderr"), follower)
    with subprocess.Popen(words, **streams, cwd=tmp_path, env={**os.environ, "TERM": "xterm"}):
        os.close(follower)
        shown = b""
        with contextlib.suppress(OSError):  # the terminal's end
            while part := os.read(leader, 4096):
                shown += part
    os.close(leader)
    before, _, after = shown.partition(b"no option of astar is called")
    assert b"reading the scenario" in before
    assert before.rindex(b"\x1b[?25h") < before.rindex(b"\x1b[2K"), "the cursor is shown, the line is erased"
    assert b"reading" not in after


def test_figures_of_unknown_formats_are_refused(antdrive, small):
    assert "choose from png, pdf, svg" in antdrive("run", small, "-p", "astar", "--figures", "pdf,bmp")[2]
    assert "contradicts" in antdrive("run", small, "-p", "astar", "--figures", "pdf", "--no-figures")[2]


@pytest.mark.slow
def test_a_run_reports_replans_and_avoidance_which_can_be_switched_off(antdrive, tmp_path):
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


def test_noise_of_a_robot_whose_file_has_none_is_said_to_change_nothing(antdrive, small):
    text = antdrive("robots", "turtlebot")[1]
    Path("bare.yaml").write_text("".join(line for line in text.splitlines(True) if not line.startswith("noise")))
    words = ("run", small, "-p", "astar", "--no-figures", "--out", "o", "--noise", "1")
    said = antdrive(*words, "-r", "bare.yaml")[2]
    assert said == "antdrive: noise has no effect: the robot file of turtlebot has no noise section\n"
    assert antdrive(*words)[2] == ""


def test_without_figures_a_run_writes_its_log_and_result(antdrive, small):
    assert antdrive("run", small, "-p", "astar", "--no-figures", "--no-view", "--out", "bare")[0] == 0
    assert sorted(path.name for path in Path("bare").iterdir()) == ["result.json", "rollout.npz"]


def test_a_start_that_overlaps_an_obstacle_is_shown(antdrive, tmp_path):
    world = World("tight", (0, 0, 6, 4), (Disc(2.5, 1.8, 0.4),))
    save_task(Task(world, (3.0, 2.0, 0.0), (5.3, 2.0)), tmp_path / "tight.yaml")
    _, out, _ = antdrive("worlds", "show", "tight.yaml")
    assert re.search("^passable +no", out, re.MULTILINE)
    assert re.search(r"^start for turtlebot +overlaps obstacles\[0\] at", out, re.MULTILINE)
    (line,) = [line for line in out.splitlines() if line.startswith("start is free for  ")]
    free = line.removeprefix("start is free for  ").lstrip().split(", ")
    for robot in list_robots():
        assert bool(re.search(f"^start for {robot} +overlaps", out, re.MULTILINE)) != (robot in free)
    assert re.search(
        f"^start is free for +{', '.join(list_robots())}$", antdrive("worlds", "show", "gate")[1], re.MULTILINE
    )
    starts = json.loads(antdrive("worlds", "show", "gate", "--json")[1])["starts"]
    assert starts == dict.fromkeys(list_robots(), "")


def test_runs_that_differ_have_folders_of_their_own(antdrive, small_run, tmp_path):
    task = small_run.scenario.task
    save_task(task, tmp_path / "a.yaml")
    save_task(replace(task, goal_tolerance=0.3), tmp_path / "b.yaml")  # of the same name

    def folder(*words):
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


def test_two_runs_do_not_write_into_one_folder_at_once(refused, small):
    with folder_lock("r"):
        line = refused("run", small, "-p", "astar", "--out", "r")
    assert line.startswith("antdrive: r: another run (process ")


def test_a_plan_is_drawn_and_printed_without_a_drive(antdrive, small, tmp_path):
    code, out, _ = antdrive("plan", small, "--planner", "astar", "--json", "--out", tmp_path / "p")
    facts = json.loads(out)
    assert code == 0
    assert facts["status"] == "solved"
    assert len(facts["cells"]) > 10
    assert Path(facts["files"]["plan"]).read_bytes().startswith(b"\x89PNG")


@pytest.mark.parametrize(("goal", "options"), [((9.85, 5.0), "--cell 0.1"), ((9.95, 5.0), "--goal 9.75,4.75")])
def test_options_that_a_reason_names_work_as_typed(antdrive, tmp_path, goal, options):
    task = Task(World("shelf", (0.0, 0.0, 10.0, 10.0)), (5.0, 5.0, 0.0), goal, 0.25 if goal[0] < 9.9 else 0.1)
    save_task(task, tmp_path / "shelf.yaml")
    code, out, _ = antdrive("plan", "shelf.yaml", "-p", "astar")
    assert code == 1
    assert f"; {options} finds one)" in out
    assert f"; {options} finds one\n" in antdrive("worlds", "show", "shelf.yaml")[1]
    assert antdrive("plan", "shelf.yaml", "-p", "astar", *options.split())[0] == 0


def test_a_plan_of_a_file_is_checked_driven_and_verified_until_it_changes(antdrive, small, small_run):
    """From another folder, verify takes the file by name."""
    Path("plans").mkdir()
    file = Path("plans/nav2.csv")
    file.write_text("\n".join(f"{x},{y}" for x, y in small_run.rollout.route.tolist()))
    code, out, _ = antdrive("plan", small, "-p", file)
    assert code == 0
    assert re.match(r"small: nav2\.csv found a path \(at least 0\.\d+ m from obstacles\)\n", out)
    assert antdrive("run", small, "-p", file, "--no-figures", "--out", "r")[0] == 0
    assert "replayed bit for bit" in antdrive("verify", "r", "--replay")[1]
    file.rename("moved.csv")
    code, out, _ = antdrive("verify", "r", "--replay")
    assert (code, out.splitlines()[1]) == (1, "  replay: planner: plans/nav2.csv: no such file")
    assert "replayed bit for bit" in antdrive("verify", "r", "--replay", "-p", "moved.csv")[1]
    file.write_text(Path("moved.csv").read_text().rpartition("\n")[0] + "\n0,0\n")
    assert "plans/nav2.csv holds another plan than before" in antdrive("verify", "r", "--replay")[1]
    code, out, _ = antdrive("plan", small, "-p", file, "--json")
    assert (code, json.loads(out)["status"]) == (1, "invalid")
    assert json.loads(out)["reason"].startswith("waypoints: ")


@pytest.mark.parametrize("kind", ["suite", "campaign"])
def test_suites_and_campaigns_name_plans_beside_them(kind, small, small_run, tmp_path):
    home = tmp_path / "home"
    home.mkdir()
    (home / "nav2.csv").write_text("\n".join(f"{x},{y}" for x, y in small_run.rollout.route.tolist()))
    if kind == "campaign":
        jobs = expand(make_campaign({"worlds": [str(small.absolute())], "planners": ["astar", "nav2.csv"]}, home))
        job = jobs.jobs[-1]
        digest = job.case.scenario(0).planner.digest
        assert (job.case.planner.label, job.case.planner.version) == ("nav2.csv", f"nav2.csv {digest[:8]}")
        assert job.case.written.planner == f"planners/{digest[:8]}/nav2.csv"
        assert jobs.codes == {job.case.written.planner: home / "nav2.csv"}
        return
    (home / "s.drive.yaml").write_text(
        f"schema: 1\nscenarios:\n  a: {{world: {small.absolute()}, planner: nav2.csv}}\n"
    )
    (case,) = select([str(home / "s.drive.yaml")])
    scenario = scenario_of(case)
    assert (scenario.smoothing, scenario.planner_label) == ("none", "nav2.csv")
    assert scenario.written.planner == str(home / "nav2.csv")
