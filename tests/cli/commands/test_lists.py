"""Commands that list, describe and generate."""

import dataclasses
import importlib.metadata
import json
import math
import re

import numpy as np
import pytest

from antdrive.base.files import as_json
from antdrive.base.optional import PLANNER_GROUP
from antdrive.cli.groups import exit_code_of
from antdrive.cli.listings import LISTS
from antdrive.planners import PLANNERS
from antdrive.robots import PurePursuit, RobotSpec, list_robots
from antdrive.worlds import Disc, Task, World, list_worlds, load_task, save_task


def test_every_planner_is_listed_with_its_options(antdrive):
    code, out, err = antdrive("planners", "--json")
    found = json.loads(out)
    assert (code, err) == (0, "")
    assert list(found)[: len(PLANNERS)] == list(PLANNERS)
    assert found["aco-han-elite"]["options"]["elitism"] == 100
    code, out, _ = antdrive("planners", "aco-han-elite")
    assert code == 0
    assert re.search(r"^elitism +100 +e of eq\. 4\.2\.4", out, re.MULTILINE)
    assert "ants guided" not in out.lower().replace("aco-han-elite: ants guided", "")
    assert antdrive("planners", "acohan")[0] == 2


def test_a_planner_of_ones_own_is_described_as_built_in_ones_are(antdrive, tmp_path):
    own = [
        "class Mine(AStar):",
        '    """My own search.',
        "",
        "    Attributes:",
        "        eagerness: its zeal",
        '    """',
    ]
    lines = [
        "from dataclasses import dataclass",
        "from antdrive.planners import AStar",
        "@dataclass(frozen=True, kw_only=True)",
    ]
    (tmp_path / "mine.py").write_text("\n".join([*lines, *own, "    eagerness: float = 2.0"]))
    code, out, err = antdrive("planners", "mine.py:Mine")
    assert (code, err) == (0, "")
    assert out.startswith("mine.py:Mine: My own search.\n")
    assert re.search("^eagerness +2.0 +its zeal$", out, re.MULTILINE)


@pytest.mark.parametrize("words", LISTS, ids=" ".join)
def test_a_list_prints_what_its_command_prints(antdrive, capsys, words):
    code = exit_code_of(list(words))
    printed = capsys.readouterr()
    assert antdrive(*words) == (code, *printed)
    assert printed.out.count("\n") > 5


def test_planners_of_other_packages_are_listed(antdrive, monkeypatch):
    assert antdrive("planners")[1].startswith("planner ")
    added = importlib.metadata.EntryPoint("mine", "antdrive.planners:AStar", PLANNER_GROUP)
    monkeypatch.setattr("importlib.metadata.entry_points", lambda group: [added] if group == PLANNER_GROUP else [])
    code, out, _ = antdrive("planners")
    assert code == 0
    assert re.search(r"^mine +The shortest path", out, re.MULTILINE)


def test_every_option_of_the_controller_is_listed_with_default_unit_and_meaning(antdrive):
    code, out, err = antdrive("controller", "--json")
    assert (code, err) == (0, "")
    found = json.loads(out)
    assert {name: one["default"] for name, one in found.items()} == vars(PurePursuit())
    assert all(one["about"] and "[" not in one["about"] for one in found.values())
    assert (found["lookahead_time"]["unit"], found["lookahead_time"]["routes"]) == ("s", "smooth")
    assert "corner_blend" in antdrive("controller")[1]


def test_counterparts_of_nav2_parameters_are_options_of_the_controller_or_limits_of_robots(antdrive):
    code, out, _ = antdrive("controller", "--nav2", "--json")
    found = json.loads(out)
    named = {name for text in found.values() for name in re.findall(r"`([^`]+)`", text)}
    assert code == 0
    assert named <= {one.name for kind in (PurePursuit, RobotSpec) for one in dataclasses.fields(kind)}
    assert found["desired_linear_vel"] == "`max_speed` of the robot"
    assert "allow_reversing" in antdrive("controller", "--nav2")[1]


@pytest.mark.parametrize("words", [[], ["world"], ["robot"], ["suite"], ["campaign"]], ids=" ".join)
def test_the_schema_of_a_file_is_printed(antdrive, words):
    code, out, err = antdrive("schema", *words)
    assert (code, err) == (0, "")
    assert json.loads(out)["title"] == f"antdrive {words[0] if words else 'world'}"


@pytest.mark.parametrize(("kind", "known"), [("worlds", list_worlds()), ("robots", list_robots())])
def test_every_world_and_robot_is_listed(antdrive, kind, known):
    code, out, err = antdrive(kind, "list", "--json")
    assert (code, err) == (0, "")
    assert list(json.loads(out)) == list(known)


def test_show_reports_whether_a_robot_can_cross(antdrive, tmp_path):
    code, out, _ = antdrive("worlds", "show", "gate", "--out", tmp_path / "gate.png")
    assert code == 0
    assert re.search("^passable +yes, for turtlebot with", out, re.MULTILINE)
    assert (tmp_path / "gate.png").exists()
    margins = [
        json.loads(antdrive("worlds", "show", "gate", "--noise", noise, "--json")[1])["margin"] for noise in "05"
    ]
    assert margins[0] == 0.03 < margins[1]
    assert not json.loads(antdrive("worlds", "show", "no-path", "--json")[1])["passable"]
    assert re.search(
        "^reason +no path for a disc of 0.21 m .*close off the goal", antdrive("worlds", "show", "no-path")[1], re.M
    )


def test_show_reports_what_a_robot_reaches_by_its_disc_and_by_its_footprint(antdrive, tmp_path):
    posts = tuple(Disc(5.0, y / 10, 0.05) for y in range(51) if not 20 < y < 29)  # a door of 0.8 m
    world = World("rooms", (0.0, 0.0, 10.0, 5.0), posts)
    save_task(Task(world, (1.5, 2.5, 0.0), (8.0, 2.5), cell=0.1), tmp_path / "rooms.yaml")
    words = "worlds", "show", tmp_path / "rooms.yaml", "--robot", "warehouse"
    code, out, _ = antdrive(*words)
    assert code == 0
    assert "yes, for warehouse by its footprint with a margin of 0.03 m\n" in out
    assert re.search(r"^by its disc +\d\d% of the connected floor, 1 of 2 rooms, 0 of 1 doors$", out, re.MULTILINE)
    assert re.search(r"^by its footprint +\d\d% of the connected floor, 2 of 2 rooms, 1 of 1 doors$", out, re.MULTILINE)
    assert re.search(r"^door by footprint +0\.80 m wide at \(5\.00, 2\.45\)$", out, re.MULTILINE)
    facts = json.loads(antdrive(*words, "--json")[1])
    assert facts["passable"]
    assert facts["coverage"]["share"] < 0.4 < 0.5 < facts["coverage_by_footprint"]["share"]
    shut = antdrive(*words, "--margin", "0.15")[1]
    assert "no, for warehouse with a margin of 0.15 m\n" in shut
    assert re.search(r"^door not passed +0\.80 m wide", shut, re.MULTILINE)


def test_show_lists_the_doors_that_just_fail_first_and_counts_narrow_gaps(antdrive, tmp_path):
    doors = {4.0: 0.35, 8.0: 0.05, 12.0: 0.3, 16.0: 1.0}  # widths by place
    posts = []
    for x, width in doors.items():
        count = round((4 - width) / 0.1)
        posts += [Disc(x, 0.05 + k * (2 - width / 2 - 0.1) / (count // 2 - 1), 0.05) for k in range(count // 2)]
        posts += [Disc(x, 4 - post.y, 0.05) for post in posts[-(count // 2) :]]
    task = Task(World("rooms", (0.0, 0.0, 20.0, 4.0), tuple(posts)), (18.0, 2.0, 0.0), (14.0, 2.0), cell=0.05)
    save_task(task, tmp_path / "rooms.yaml")
    out = antdrive("worlds", "show", tmp_path / "rooms.yaml", "--robot", "turtlebot")[1]
    assert re.findall(r"^door not passed +(0\.\d+) m wide", out, re.MULTILINE) == ["0.35", "0.30"], out
    assert "1 of 3 doors" in out
    assert re.search(r"^no doors +\d gaps narrower than 0\.\d+ m, half of what the robot needs$", out, re.MULTILINE)


@pytest.mark.parametrize("words", [["forest", "--set", "count=8"], ["barn", "--set", "fill=0.2"]])
def test_one_seed_generates_one_world(antdrive, words):
    for name in ("a.yaml", "b.yaml"):
        assert antdrive("worlds", "generate", *words, "--seed", "5", "-o", name)[0] == 0
    a, b = load_task("a.yaml"), load_task("b.yaml")
    assert a.world.obstacles == b.world.obstacles
    assert antdrive("worlds", "generate", *words, "--seed", "6", "-o", "c.yaml")[0] == 0
    assert load_task("c.yaml").world.obstacles != a.world.obstacles


def test_json_holds_null_where_a_number_is_not_finite():
    value = {"a": math.inf, "b": [math.nan, np.float64(1.5)], 3: (np.int64(2), None)}
    assert json.loads(as_json(value)) == {"a": None, "b": [None, 1.5], "3": [2, None]}
