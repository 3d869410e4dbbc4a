"""Commands that list, describe and generate."""

import dataclasses
import json
import math
import re

import numpy as np
import pytest

from antdrive.base.files import as_json
from antdrive.planners import PLANNERS
from antdrive.robots import PurePursuit, RobotSpec
from antdrive.worlds import list_worlds, load_task


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


def test_every_world_is_listed(antdrive):
    assert "han2007-aco" in antdrive("worlds", "list")[1]
    code, out, err = antdrive("worlds", "list", "--json")
    assert (code, err) == (0, "")
    assert list(json.loads(out)) == list(list_worlds())


def test_show_reports_whether_a_robot_can_cross(antdrive, tmp_path):
    code, out, _ = antdrive("worlds", "show", "gate", "--out", tmp_path / "gate.png")
    assert code == 0
    assert "passable           yes" in out
    assert (tmp_path / "gate.png").exists()
    assert not json.loads(antdrive("worlds", "show", "no-path", "--json")[1])["passable"]
    assert "; antdrive plan says why\n" in antdrive("worlds", "show", "no-path")[1]


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
