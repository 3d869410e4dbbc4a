"""Suites: what they may say, and one line with file, line, key and remedy for everything else."""

import inspect
import json
import os
import re
from dataclasses import fields
from pathlib import Path

import pytest

from antdrive import Disc, Outcome, Scenario
from antdrive.base.errors import InputError
from antdrive.base.user_code import is_importable_elsewhere
from antdrive.cli.commands.run import run as command
from antdrive.runs.margins.choice import Calibration
from antdrive.runs.margins.loss import calibration_key
from antdrive.runs.suites import Baseline, load_suite, scenario_of, select
from antdrive.runs.suites.scenarios import run_command
from antdrive.runs.suites.suite import ScenarioEntry
from antdrive.testing import evaluate_case

PLAIN = """schema: 1
scenarios:
  one: {world: empty}
"""


def suite(folder, text, name="s.drive.yaml"):
    path = folder / name
    path.write_text(text)
    return path


def only(folder, keys):
    """The one test of a suite with one scenario of these keys."""
    (case,) = load_suite(suite(folder, f"schema: 1\nscenarios:\n  one: {{{keys}}}\n"))
    return case


def test_a_plain_scenario_is_that_of_the_defaults_of_python(tmp_path):
    (case,) = load_suite(suite(tmp_path, PLAIN))
    assert (case.id, case.baseline_path) == ("one[0]", tmp_path / "baselines" / "s" / "one-0.json")
    assert scenario_of(case) == Scenario.of("empty")


def test_every_key_reaches_the_scenario(tmp_path):
    case = only(
        tmp_path,
        "world: empty, start: [1, 2, 0.5], goal: [4, 3], robot: jackal, planner: {name: aco-han, ants: 7}, margin: 0.05, "
        "controller: {lookahead_time: 0.4}, smoothing: taut, cell: 0.4, noise: 0.5, unseen: [{x: 3, y: 3, radius: 0.2}], "
        "sees: 'positions:3', avoid: {horizon: 2}, replan: {patience: 5}, time_limit: 9, physics_hz: 120, control_hz: 30, "
        "seeds: [5]",
    )
    made = scenario_of(case)
    assert (made.task.start, made.task.goal, made.robot.name) == ((1, 2, 0.5), (4, 3), "jackal")
    assert (made.planner_name, made.planner.ants) == ("aco-han", 7)
    assert (made.margin, made.cell, made.noise, made.smoothing, made.seed) == (0.05, 0.4, 0.5, "taut", 5)
    assert (made.controller.lookahead_time, made.unseen) == (0.4, (Disc(3, 3, 0.2),))
    assert (made.perception.kind, made.perception.range) == ("positions", 3)
    assert (made.avoidance.horizon, made.replanning.patience, made.replanning.around_movers) == (2, 5, True)
    assert (made.time_limit, made.physics_hz, made.control_hz) == (9, 120, 30)


def test_switches_turn_avoidance_and_replanning_off(tmp_path):
    made = scenario_of(only(tmp_path, "world: empty, avoid: false, replan: false"))
    assert made.avoidance is None
    assert not made.replanning.around_movers
    never = scenario_of(only(tmp_path, "world: empty, avoid: none, replan: none"))
    assert (never.avoidance, never.replanning) == (None, None)


def test_a_suite_can_express_every_setting_of_a_scenario():
    """Each field of Scenario is that of a key; so is each option of `antdrive run` that is about the drive."""
    keys = {
        **{name: name for name in ScenarioEntry.model_fields},
        "task": "world",
        "avoidance": "avoid",
        "replanning": "replan",
        "perception": "sees",
        "seed": "seeds",
        "planner_name": "planner",
        "margin_choice": "margin",
        "named_as": "world",
        "frame": "start",  # suites have places of the world itself
    }
    assert all(keys[field.name] in ScenarioEntry.model_fields for field in fields(Scenario))
    about_files = {"settings", "out", "film", "prelude", "camera", "size", "speed", "figures", "no_figures"}
    about_files |= {"no_view", "json"}
    asked = set(inspect.signature(command).parameters) - about_files
    assert {keys[name] for name in asked} <= set(ScenarioEntry.model_fields)


def test_a_margin_is_chosen_once_and_named_by_the_baseline(tmp_path, monkeypatch):
    """The calibration itself is put in place of its drives: what a suite does with it is the claim here."""
    margins = iter((0.021, 0.034))

    def choose(conditions, **_):
        chosen.append(conditions)
        margin = next(margins)
        return Calibration(
            margin=margin,
            loss=margin - 0.01,
            largest=0.01,
            reserve=0.01,
            probability=0.001,
            drives=80,
            key=calibration_key(conditions),
        )

    chosen = []
    monkeypatch.setattr("antdrive.runs.margins.choice.choose_margin", choose)
    case = only(tmp_path, "world: empty, planner: astar, noise: 0.5, smoothing: taut, margin: auto")
    assert evaluate_case(case, update="new").accepted == "written"
    assert (chosen[0].noise, chosen[0].smoothing) == (0.5, "taut")
    written = json.loads(case.baseline_path.read_text())
    assert written["margin_m"] == 0.021
    baseline = Baseline.load(case.baseline_path)
    assert baseline.to_text() == case.baseline_path.read_text()
    again = evaluate_case(
        only(tmp_path, "world: empty, planner: astar, noise: 0.5, margin: auto, expect: {duration_s: '< 1'}")
    )
    assert "margin: auto chose 0.034 m, for the baseline 0.021 m" in again.details


def test_scenarios_override_defaults_and_add_to_what_is_expected(tmp_path):
    text = """schema: 1
defaults: {world: empty, planner: astar, seeds: 3-5, expect: {duration_s: "<= 30"}, tolerance: {jerk_rms: any}}
scenarios:
  a: {}
  b: {planner: dijkstra, seeds: [1], expect: {outcome: no_path, min_clearance_m: ">= 0.1, < 1"}}
"""
    cases = load_suite(suite(tmp_path, text))
    assert [case.id for case in cases] == ["a[3]", "a[4]", "a[5]", "b[1]"]
    assert [scenario_of(case).planner_name for case in cases] == ["astar"] * 3 + ["dijkstra"]
    assert [str(bound) for bound in cases[-1].demands.bounds] == [
        "duration_s <= 30", "min_clearance_m >= 0.1", "min_clearance_m < 1",
    ]  # fmt: skip
    assert cases[-1].demands.outcome is Outcome.NO_PATH
    assert cases[-1].demands.tolerance("jerk_rms") is None


def test_worlds_and_robots_lie_beside_the_suite_and_are_read_once(tmp_path):
    (tmp_path / "mine.yaml").write_text("{schema: 1, bounds: [0, 0, 5, 4], start: [1, 1, 0], goal: [4, 3]}\n")
    first = scenario_of(only(tmp_path, "world: mine.yaml, planner: astar"))
    again = scenario_of(only(tmp_path, "world: mine.yaml, planner: dijkstra, seeds: [1]"))
    assert first.task.world.name == "mine"
    assert first.task is again.task


def test_a_random_world_is_that_of_the_command_that_writes_it(tmp_path):
    case = only(tmp_path, "world: {generate: forest, seed: 7, count: 3}, planner: astar")
    assert len(scenario_of(case).task.world.obstacles) == 3
    assert run_command(case) == (
        "antdrive worlds generate forest --seed 7 --out forest-7.yaml --set count=3 && "
        "antdrive run forest-7.yaml --planner astar --robot turtlebot --seed 0"
    )


def test_the_command_of_a_test_has_its_start_and_goal(tmp_path):
    case = only(tmp_path, "world: empty, planner: astar, start: [2, 1.5, -0.1], goal: [3, 4]")
    assert run_command(case) == (
        "antdrive run empty --start=2,1.5,-0.1 --goal=3,4 --planner astar --robot turtlebot --seed 0"
    )


def test_a_test_drives_a_task_of_its_world(tmp_path):
    (tmp_path / "mine.yaml").write_text(
        "{schema: 1, bounds: [0, 0, 5, 4], start: [1, 1, 0], goal: [4, 3], tasks: [{name: dock, goal: [2, 3]}]}\n"
    )
    case = only(tmp_path, "world: mine.yaml, planner: astar, task: dock, start: [1, 2, 0]")
    task = scenario_of(case).task
    assert (task.start, task.goal) == ((1, 2, 0), (2, 3))
    assert run_command(case).startswith("antdrive run")
    assert " --task=dock --start=1,2,0 --planner" in run_command(case)
    for words, message in (
        ("world: mine.yaml, task: docks", "mine.yaml: no task 'docks'; did you mean dock?"),
        ("world: empty, task: dock", "no task 'dock'; the world has no named tasks"),
        ("world: {generate: forest}, task: dock", "task: a random world has no named tasks"),
    ):
        with pytest.raises(InputError) as caught:
            scenario_of(only(tmp_path, f"{words}, planner: astar"))
        assert message in str(caught.value)


def test_a_planner_of_ones_own_comes_from_a_file_or_a_module(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    path = tmp_path / "own_planners_of_a_test.py"
    text = "from antdrive.planners import AStar\nclass Mine(AStar):\n    pass\nREADY = Mine()\n"
    path.write_text(text)
    for name in ("Mine", "READY"):
        for words, in_a_file in (
            (f"{path.name}:{name}", True),
            (f"{{name: '{path.stem}:{name}'}}", False),
        ):
            case = only(tmp_path, f"world: empty, planner: {words}")
            case.written.check_names(case.suite.parent, case.error)
            made = scenario_of(case)
            assert type(made.planner).__name__ == "Mine"
            assert made.planner_label == name
            source = path.name if in_a_file else path.stem
            rest = "--robot turtlebot --smoothing none --seed 0"
            assert run_command(case) == f"antdrive run empty --planner {source}:{name} {rest}"
            elsewhere = run_command(case, anywhere=True)
            assert elsewhere == f"antdrive run empty --planner {path}:{name} {rest}"
    installed = only(tmp_path, "world: empty, planner: 'antdrive.planners:AStar'")
    assert run_command(installed) == f"antdrive run empty --planner antdrive.planners:AStar {rest}"
    (tmp_path / "pack").mkdir()
    inside = only(tmp_path, "world: empty, planner: 'pack.mine:Mine'")
    assert run_command(inside) == f"antdrive run empty --planner pack.mine:Mine {rest}"
    assert run_command(inside, anywhere=True) is None, "antdrive check runs it"
    path.write_text(text.replace("pass", "old = 1"))
    os.utime(path, (1, 1))
    made = scenario_of(only(tmp_path, f"world: empty, planner: {path.name}:Mine"))
    os.utime(path, (1, 1))
    path.write_text(text.replace("pass", "old = 2"))
    os.utime(path, (1, 1))
    again = scenario_of(only(tmp_path, f"world: empty, planner: {path.name}:Mine"))
    assert (made.planner.old, again.planner.old) == (1, 2), "by its content, not by its time"


def test_custom_planners_drive_their_own_plans_unless_the_suite_sets_the_smoothing(tmp_path):
    (tmp_path / "mine.py").write_text("from antdrive.planners import AStar\nclass Mine(AStar): pass\n")
    for planner, given, smoothing in (
        ("mine.py:Mine", "", "none"),
        ("mine.py:Mine", ", smoothing: taut", "taut"),
        ("astar", "", "clearance"),
    ):
        assert scenario_of(only(tmp_path, f"world: empty, planner: '{planner}'{given}")).smoothing == smoothing


#: What is wrong in a scenario; and beside a world that is right.
WRONG = (
    "wrld: empty", "planner: astar", "world: emty", "world: [1]", "world: {seed: 3}", "world: {generate: wood}",
    "world: {generate: forest, size: big}", "world: {generate: forest, seed: -1}",
)  # fmt: skip
WRONG_BESIDE_A_WORLD = (
    "robot: jakal", "planner: astarr", "planner: {ants: 3}", "planner: {name: aco-han, antss: 3}",
    "planner: {name: aco-han, ants: many}", "planner: no.py:X", "planner: math:cosh",
    "planner: colorsys:X", "planner: {name: 'no.py:X', ants: 3}", "planner: no_such_module:X", "planner: math:pi",
    "planner: no.py", "margin: wide", "margin: -1", "noise: 1e99",
    "smoothing: round", "sees: all", "sees: 'positions:x'", "avoid: 1", "replan: never", "replanning: none",
    "perception: positions", "seed: 3", "avoid: {horizn: 1}", "replan: {patience: x}", "controller: {speed: 1}",
    "seeds: []", "seeds: [1, 1]", "seeds: 9-3", "start: [0, 0, 0]", "start: [0, 0]", "expect: {outcome: won}",
    "expect: {outcome: collided, touched: tree}", "expect: {cause: slip}", "expect: {min_clearence_m: 1}",
    "expect: {duration_s: short}", "expect: {certified: maybe}", "tolerance: {duration_s: -1}", "tolerance: {end_m: 10 %}",
    "expect: {plan_s: < 1}", "expect: {min_clearance_m: 0.05}", "baseline: false, trajectory: exact",
    "baseline: false, tolerance: {spl: 1}", "tolerance: {replans: 1}", "trajectory: 0", "unseen: [{x: 1, y: 1}]",
)  # fmt: skip
WRONG_SUITES = (
    "scenarios:\n  a: {world: empty}\n", "schema: 2\nscenarios:\n  a: {world: empty}\n", "schema: 1\nscenarios: {}\n",
    "schema: 1\nscenarios:\n  a/b: {world: empty}\n", "schema: 1\nscenarios:\n  a: {world: empty}\n  a: {world: empty}\n",
    "schema: 1\nscenarios:\n  a: empty\n", "schema: 1\ndefaults:\n  nois: 1\nscenarios:\n  a: {world: empty}\n",
    "schema: 1\ndefaults:\n  planner: no\nscenarios:\n  a: {world: empty}\n",
    "schema: 1\ndefaults:\n  expect: {spll: 1}\nscenarios:\n  a: {world: empty}\n",
    "schema: 1\ndefaults:\n  margin: -2\nscenarios:\n  a: {world: empty}\n", "", "- 1\n",
)  # fmt: skip


def test_words_select_tests(tmp_path):
    (tmp_path / "below").mkdir()
    path = suite(
        tmp_path / "below", "schema: 1\ndefaults: {world: empty, seeds: 0-1}\nscenarios: {a: {}, ab: {}, c: {}}\n"
    )

    wrong = suite(tmp_path, "schema: 1\nscenarios: {a: {world: empty, controller: {brake: 1}}}\n", "wrong.drive.yaml")

    def ids(*words, pattern=None):
        return [case.id for case in select(words, pattern)]

    assert ids(str(path.parent)) == ["a[0]", "a[1]", "ab[0]", "ab[1]", "c[0]", "c[1]"]
    assert ids(f"{path}::a") == ["a[0]", "a[1]"]
    assert ids(f"{path}::c[1]", str(path), pattern="c") == ["c[1]", "c[0]"]
    assert ids(str(path), pattern="a*") == ["a[0]", "a[1]", "ab[0]", "ab[1]"]
    for words, pattern, message in (
        ([f"{path}::d"], None, "no test 'd'; choose from"),
        ([str(path)], "x*", "no test of"),
        (
            [str(wrong)],
            None,
            "scenarios.a.controller.brake: no option of pure-pursuit is called 'brake'; did you mean braking",
        ),
        ([str(tmp_path / "none.drive.yaml")], None, "no such file"),
        ([__file__], None, "not a suite; its name must end in .drive.yaml"),
        ([str(Path(__file__).parent)], None, "contains no suites"),
    ):
        with pytest.raises(InputError, match=re.escape(message)):
            select(words, pattern)


def test_a_file_that_ends_the_program_is_a_wrong_suite(tmp_path):
    (tmp_path / "script.py").write_text("import sys\nsys.exit(0)\n")
    for source in ("script.py", "script"):
        with pytest.raises(
            InputError, match=r"planner: script.*calls exit on import \(exit code 0, script.py:2\); guard"
        ):
            scenario_of(only(tmp_path, f"world: empty, planner: '{source}:Mine'"))


def test_suites_of_different_folders_have_modules_of_their_own(tmp_path):
    """The same names of modules, and of what they import, in two folders; each stays the same class when asked again."""
    mine = (
        "from antdrive.planners.graph.search import AStar\nimport besides\nclass Mine(AStar):\n    of = besides.WHO\n"
    )
    made = {}
    for folder in ("a", "b"):
        (tmp_path / folder).mkdir()
        (tmp_path / folder / "besides.py").write_text(f"WHO = {folder!r}\n")
        (tmp_path / folder / "same_name.py").write_text(mine)
    for folder in ("a", "b", "a", "b"):
        place = tmp_path / folder
        for source in ("same_name.py:Mine", "same_name:Mine"):
            planner = scenario_of(only(place, f"world: empty, planner: {source}")).planner
            assert planner.of == folder
            assert made.setdefault((folder, source), type(planner)) is type(planner)


def test_planners_beside_a_suite_stay_in_their_process(tmp_path):
    (tmp_path / "beside_it.py").write_text(
        "from antdrive.planners.graph.search import AStar\nclass Mine(AStar):\n    pass\n"
    )
    for words in ("beside_it:Mine", "beside_it.py:Mine"):
        assert not is_importable_elsewhere(scenario_of(only(tmp_path, f"world: empty, planner: {words}")).planner)
    assert is_importable_elsewhere(scenario_of(only(tmp_path, "world: empty, planner: astar")).planner)


def test_a_module_that_is_taken_from_elsewhere_is_refused(tmp_path, monkeypatch):
    elsewhere = tmp_path / "elsewhere"
    elsewhere.mkdir()
    for place in (elsewhere, tmp_path):
        (place / "taken_name.py").write_text("from antdrive.planners.graph.search import AStar as Mine\n")
    monkeypatch.syspath_prepend(str(elsewhere))
    with pytest.raises(InputError, match=r"planner: taken_name is imported from .*elsewhere.*beside the suite"):
        scenario_of(only(tmp_path, "world: empty, planner: 'taken_name:Mine'"))
