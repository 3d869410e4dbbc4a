"""Other starts and goals in a world, from the command line and from the world's file."""

import json
import math
from pathlib import Path

from tests.cli.conftest import OFFICE


def test_a_run_takes_a_named_task_and_other_ends(antdrive, office):
    words = ("--task", "dock", "--start", "0.6,2.4,0.5", "-p", "astar", "--no-figures", "--json", "--out", "r")
    code, out, _ = antdrive("run", office, *words)
    facts = json.loads(out)
    assert (code, facts["outcome"]) == (0, "succeeded")
    assert facts["task"] == {"start": [0.6, 2.4, 0.5], "goal": [3.4, 2.4], "goal_tolerance_m": 0.25}
    assert antdrive("verify", "r")[0] == 0


def test_plan_and_show_take_them_too(antdrive, office):
    _, out, _ = antdrive("plan", office, "--goal", "0.6,2.4", "-p", "astar", "--json")
    assert json.loads(out)["cells"][-1] == [9, 2]
    _, out, _ = antdrive("worlds", "show", office, "--task", "dock", "--json")
    shown = json.loads(out)
    assert (shown["goal"], shown["tasks"]) == ([3.4, 2.4], ["dock"])


def test_a_yaw_is_in_radians_or_names_degrees_and_more_than_a_turn_is_noted(antdrive, office):
    def start(text):
        code, out, err = antdrive("worlds", "show", office, "--start", text, "--json")
        return code, json.loads(out)["start"], err

    assert start("0.6,2.4,90deg") == (0, [0.6, 2.4, math.pi / 2], "")
    assert start("0.6,2.4,1.5") == (0, [0.6, 2.4, 1.5], "")
    code, pose, err = start("0.6,2.4,90")
    assert (code, pose) == (0, [0.6, 2.4, 90.0])
    assert err.endswith("a yaw of 90 rad is 117 degrees; write 0.6,2.4,90deg for degrees\n")


def test_places_in_the_map_mean_the_same_as_those_in_the_world(antdrive, office):
    """A world that lies in its map turned by a quarter to the left, with its origin at (10, -2)."""
    office.write_text(OFFICE + "frame: [10, -2, 1.5707963267948966]\n")
    words = ("plan", office, "-p", "astar", "--json")
    there = antdrive(*words, "--start", "0.6,2.4,0", "--goal", "3.4,2.4")[1]
    in_map = antdrive(*words, "--start", "7.6,-1.4,1.5707963267948966", "--goal", "7.6,1.4", "--frame", "map")[1]
    assert json.loads(there)["cells"] == json.loads(in_map)["cells"]
    shown = antdrive("worlds", "show", office)[1]
    assert "frame m, m, rad    [10, -2, 1.570796]" in shown
    assert "goal in its map    [9.4, 1.4]" in shown


def test_answers_name_places_in_both_frames(antdrive, refused, office):
    posts = "obstacles:\n  - {x: 2, y: 0.7, radius: 0.65}\n  - {x: 2, y: 2.3, radius: 0.65}\n"
    office.write_text(OFFICE + posts + "frame: [10, -2, 1.5707963267948966]\n")
    code, out, _ = antdrive("plan", office, "-p", "astar", "--goal", "8.5,1.4", "--frame", "map")
    assert code == 1
    assert "at (2.00, 1.50) in the world, (8.50, 0.00) in its map, between obstacles[0]" in out
    said = refused("run", office, "--start", "7.6,-1.9,0", "--frame", "map")
    assert "start: turtlebot at (0.1, 2.4) in the world, (7.6, -1.9) in its map" in said
    office.write_text(OFFICE + "frame: [10, -2, 1.5707963267948966]\n")
    result = json.loads(antdrive("run", office, "-p", "astar", "--no-figures", "--json", "--out", "r")[1])
    assert (result["frame"], result["task"]["goal"]) == ([10.0, -2.0, 1.5707963267948966], [3.4, 0.6])
    assert antdrive("verify", "r")[0] == 0
    Path("r/result.json").write_text(json.dumps({**result, "frame": [10, -2, 1.5]}))
    assert "result.json: frame: differs from the log" in antdrive("verify", "r")[1]


def test_each_run_of_a_comparison_says_how_to_repeat_it(antdrive, office):
    code, _, _ = antdrive(
        "compare", office, "-p", "astar", "-p", "tangent", "--task", "dock", "--start", "0.6,1,0", "--frame", "map",
        "--no-figures", "--out", "c",
    )  # fmt: skip
    assert code == 0
    command = json.loads(Path("c/astar/result.json").read_text())["command"]
    assert "--task=dock --start=0.6,1,0 --planner astar" in command


def test_a_sweep_drives_the_tasks_of_a_file(antdrive, office):
    code, out, _ = antdrive("sweep", "--world", office, "-p", "astar", "--tasks", "named", "--dry-run", "--json")
    assert (code, json.loads(out)["runs"]) == (0, 1)
    _, out, _ = antdrive("sweep", "--world", office, "-p", "astar", "--tasks", "7:1.5", "--dry-run", "--json")
    assert json.loads(out)["runs"] == 7
