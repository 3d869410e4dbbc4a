"""`antdrive compare`."""

import json
import shlex
import subprocess
import sys
from pathlib import Path

import pytest

from antdrive import robots

CATALOGUE = Path(robots.__path__[0]) / "catalog"


@pytest.mark.slow
def test_planners_are_compared_in_a_table_a_figure_a_page_and_a_film(antdrive, small, tmp_path):
    words = ("--out", "c", "--film", "c.mp4", "--speed", "20")
    code, out, err = antdrive("compare", small, "-p", "astar", "-p", "tangent", *words, "--json")
    facts = json.loads(out)
    assert (code, err) == (0, "")
    assert set(facts["runs"]) == {"astar", "tangent"}
    for name in facts["runs"]:
        result = json.loads((tmp_path / "c" / name / "result.json").read_text())
        assert result["command"].startswith("antdrive run ")
        assert f"--planner {name}" in result["command"]
    assert Path("c.mp4").stat().st_size > 1000
    assert [antdrive("verify", f"c/drives.html#{k}")[0] for k in (1, 2)] == [0, 0]
    logs = [tmp_path / "c" / name / "rollout.npz" for name in facts["runs"]]
    assert antdrive("render", *logs, "-o", "again.gif", "--size", "320x240", "--speed", "30")[0] == 0
    assert Path("again.gif").exists()


def test_a_prelude_without_a_film_or_an_iterative_planner_is_refused_before_any_drive(refused, small):
    words = ["compare", small, "-p", "astar", "-p", "tangent", "--prelude", "2"]
    assert "--prelude: needs --film" in refused(*words)
    assert "--prelude: needs an iterative planner" in refused(*words, "--film", "c.mp4")
    assert not Path("out").exists()


def test_fewer_than_two_paths_are_nothing_to_compare(antdrive, tmp_path):
    words = ["compare", "no-path", "-p", "astar", "-p", "dijkstra", "--out", str(tmp_path / "c"), "--no-figures"]
    code, _, err = antdrive(*words)
    assert code == 1
    assert "no comparison figure, page or film" in err


def test_the_command_that_repeats_a_run_names_the_robot_as_it_was_given(antdrive, small):
    Path("mine.yaml").write_text((CATALOGUE / "turtlebot.yaml").read_text().replace("name: turtlebot", "name: mine"))
    words = ["-p", "astar", "-p", "dijkstra", "--robot", "mine.yaml", "--no-figures", "--out", "c"]
    assert antdrive("compare", small, *words)[0] == 0
    command = shlex.split(json.loads(Path("c/astar/result.json").read_text())["command"])
    assert command[command.index("--robot") + 1] == "mine.yaml"
    assert antdrive(*command[1:], "--no-figures", "--out", "again")[0] == 0


@pytest.mark.slow
def test_planners_have_options_of_their_own_and_are_paired_over_worlds_and_seeds(antdrive, small):
    Path("other.yaml").write_text(small.read_text().replace("name: small", "name: other"))
    words = [
        "-p", "few=aco-han", "-p", "aco-han", "-p", "astar", "--set", "few.ants=3", "--set", "aco-han.iterations=4"
    ]  # fmt: skip
    words += ["--set", "controller.lookahead_time=0.6", "--seeds", "2", "--no-figures"]
    code, out, err = antdrive("compare", small, "other.yaml", *words, "--json")
    facts = json.loads(out)
    assert code == 0
    assert [line.partition(":")[2].split(":")[0].strip() for line in err.splitlines()] == [
        "controller.lookahead_time has no effect",
        "seed has no effect in 2 of 6 configurations, such as small with astar",
    ]
    assert set(facts["runs"]) == {"few", "aco-han", "astar"}
    assert len(facts["drives"]) == 2 * 2 * 3
    first = facts["runs"]["few"]
    assert (first["planner"], first["options"]["ants"], first["options"]["iterations"]) == ("aco-han", 3, 50)
    assert facts["runs"]["aco-han"]["options"]["iterations"] == 4
    assert first["settings"]["controller"] == {"lookahead_time": 0.6}
    assert {(d["world"], d["seed"]) for d in facts["drives"]} == {(w, s) for w in ("small", "other") for s in (0, 1)}
    folders = [Path(d["folder"]) for d in facts["drives"]]
    assert len({str(folder) for folder in folders}) == 12
    written = json.loads((folders[-3] / "result.json").read_text())
    command = shlex.split(written["command"])
    assert "planner.ants=3" in command
    assert antdrive(*command[1:], "--no-figures", "--out", "again")[0] == 0
    assert json.loads(Path("again/result.json").read_text())["digest"] == written["digest"]
    for entry in facts["differences"]:
        mine = [d for d in facts["drives"] if d["label"] == entry["planner"]]
        apart = [d["metrics"]["duration_s"] - f["metrics"]["duration_s"]
                 for d, f in zip(mine, [d for d in facts["drives"] if d["label"] == "few"], strict=True)]  # fmt: skip
        assert (entry["succeeded"], entry["pairs"]) == (4, 4)
        if entry["planner"] != "few":
            low, high = sorted(apart)[1:3]
            assert entry["duration_s"] == pytest.approx([(low + high) / 2, min(apart), max(apart)])
    table = antdrive("compare", small, "other.yaml", *words)[1]
    assert "few      4/4        4" in table


def test_planners_drive_their_own_plans_unless_a_smoothing_is_given(antdrive, small):
    words = ["compare", small, "-p", "astar", "-p", "few=aco-han", "--set", "few.iterations=1", "--no-figures"]
    own, smooth = (antdrive(*words, *more)[1].splitlines() for more in ((), ("--smoothing", "clearance")))
    assert [line.split("  ")[0] for line in own[1:3]] == ["astar", "few"]
    assert smooth[1].startswith("astar, few  ")
    assert (
        smooth[3] == "astar and few drive the same line: smoothing clearance makes one route of their different plans"
    )
    given = json.loads(antdrive(*words, "--json")[1])
    assert [drive["smoothing"] for drive in given["drives"]] == ["none", "none"]
    assert given["same"] == []


def test_the_default_folder_is_never_that_of_another_comparison(antdrive, small):
    words = ["compare", small, "-p", "astar", "-p", "dijkstra", "--no-figures"]
    assert antdrive(*words)[0] == 0
    first = Path("out/compare-small/astar/result.json")
    before = first.read_bytes()
    assert antdrive(*words, "--noise", "0.5", "--json")[0] in (0, 1)
    assert first.read_bytes() == before
    assert len(list(Path("out").iterdir())) == 2
    assert antdrive(*words)[0] == 0
    assert len(list(Path("out").iterdir())) == 2, "the same comparison has the same folder"


def test_a_second_comparison_in_the_same_folder_is_told(refused, small):
    script = (
        "from antdrive.base.atomic import folder_lock\nwith folder_lock('c'):\n print('claimed', flush=True)\n input()"
    )
    with subprocess.Popen([sys.executable, "-c", script], stdin=subprocess.PIPE, stdout=subprocess.PIPE) as other:
        assert other.stdout is not None
        assert other.stdout.readline() == b"claimed\n"
        says = refused("compare", small, "-p", "astar", "-p", "dijkstra", "--out", "c")
        planning = refused("plan", small, "-p", "astar", "--out", "c")
        other.communicate(b"\n")
    assert "is writing to this folder" in says
    assert "is writing to this folder" in planning


def test_controllers_are_compared_with_one_planner(antdrive, small):
    words = (
        "compare",
        small,
        "-p",
        "astar",
        "--controller",
        "stanley",
        "--controller",
        "wide=dwa",
        "--no-figures",
        "--json",
    )
    code, out, _ = antdrive(*words, "--set", "wide.reach=1.5", "--out", "c")
    runs = json.loads(out)["runs"]
    assert code == 0
    assert {name: run["settings"]["controller"] for name, run in runs.items()} == {
        "stanley": {"name": "stanley"},
        "wide": {"name": "dwa", "reach": 1.5},
    }


def test_controllers_are_compared_with_no_other_number_of_planners(refused, small):
    said = refused("compare", small, "-p", "astar", "-p", "sipp", "--controller", "dwa", "--controller", "coulter")
    assert "--planner: give one, with which several controllers are compared" in said
