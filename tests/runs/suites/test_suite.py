"""Suites: what they may say, and one line with file, line, key and remedy for everything else."""

from __future__ import annotations

import inspect
import json
import os
import re
from dataclasses import fields
from pathlib import Path

import pytest

from antdrive import Disc, Outcome, Scenario
from antdrive.base.errors import InputError
from antdrive.cli.commands.run import run as command
from antdrive.cli.testing import check_case
from antdrive.planners.own_code import is_importable_elsewhere
from antdrive.runs.margins.prediction import Calibration
from antdrive.runs.margins.trial import Conditions
from antdrive.runs.suites import Baseline, SuiteCase, load_suite, scenario_of, select
from antdrive.runs.suites.names import check_names
from antdrive.runs.suites.scenarios import run_command
from antdrive.runs.suites.suite import ScenarioEntry

PLAIN = """schema: 1
scenarios:
  one: {world: empty}
"""


def suite(folder: Path, text: str, name: str = "s.drive.yaml") -> Path:
    path = folder / name
    path.write_text(text)
    return path


def only(folder: Path, keys: str) -> SuiteCase:
    """The one test of a suite with one scenario of these keys."""
    (case,) = load_suite(suite(folder, f"schema: 1\nscenarios:\n  one: {{{keys}}}\n"))
    return case


def test_a_plain_scenario_is_that_of_the_defaults_of_python(tmp_path: Path) -> None:
    (case,) = load_suite(suite(tmp_path, PLAIN))
    assert (case.id, case.baseline_path) == ("one[0]", tmp_path / "baselines" / "s" / "one-0.json")
    assert scenario_of(case) == Scenario.of("empty")


def test_every_key_reaches_the_scenario(tmp_path: Path) -> None:
    case = only(
        tmp_path,
        "world: empty, start: [1, 2, 0.5], goal: [4, 3], robot: jackal, planner: {name: aco-han, ants: 7}, margin: 0.05, "
        "controller: {lookahead_time: 0.4}, smoothing: taut, cell: 0.4, noise: 0.5, unseen: [{x: 3, y: 3, radius: 0.2}], "
        "sees: 'positions:3', avoid: {horizon: 2}, replan: {patience: 5}, time_limit: 9, physics_hz: 120, control_hz: 30, "
        "seeds: [5]",
    )
    made = scenario_of(case)
    assert (made.task.start, made.task.goal, made.robot.name) == ((1, 2, 0.5), (4, 3), "jackal")
    assert (made.planner_name, made.planner.ants) == ("aco-han", 7)  # type: ignore[attr-defined]
    assert (made.margin, made.cell, made.noise, made.smoothing, made.seed) == (0.05, 0.4, 0.5, "taut", 5)
    assert (made.controller.lookahead_time, made.unseen) == (0.4, (Disc(3, 3, 0.2),))
    assert (made.perception.kind, made.perception.range) == ("positions", 3)
    assert made.avoidance is not None
    assert made.replanning is not None
    assert (made.avoidance.horizon, made.replanning.patience, made.replanning.around_movers) == (2, 5, True)
    assert (made.time_limit, made.physics_hz, made.control_hz) == (9, 120, 30)


def test_switches_turn_avoidance_and_replanning_off(tmp_path: Path) -> None:
    made = scenario_of(only(tmp_path, "world: empty, avoid: false, replan: false"))
    assert made.avoidance is None
    assert made.replanning is not None
    assert not made.replanning.around_movers
    never = scenario_of(only(tmp_path, "world: empty, avoid: none, replan: none"))
    assert (never.avoidance, never.replanning) == (None, None)


def test_a_suite_can_express_every_setting_of_a_scenario() -> None:
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
        "frame": "start",  # suites have places of the world itself
    }
    assert all(keys[field.name] in ScenarioEntry.model_fields for field in fields(Scenario))
    about_files = {"settings", "out", "film", "prelude", "vector", "figures", "gui", "json"}
    asked = set(inspect.signature(command).parameters) - about_files
    assert {keys[name] for name in asked} <= set(ScenarioEntry.model_fields)


def test_a_margin_is_chosen_once_and_named_by_the_baseline(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The calibration itself is put in place of its drives: what a suite does with it is the claim here."""
    margins = iter((0.021, 0.034))

    def choose(conditions: Conditions, **_: object) -> Calibration:
        chosen.append(conditions)
        margin = next(margins)
        return Calibration(
            margin=margin,
            loss=margin - 0.01,
            largest=0.01,
            reserve=0.01,
            probability=0.001,
            drives=80,
            key=conditions.key,
        )

    chosen: list[Conditions] = []
    monkeypatch.setattr("antdrive.runs.margins.choice.choose_margin", choose)
    case = only(tmp_path, "world: empty, planner: astar, noise: 0.5, smoothing: taut, margin: auto")
    assert check_case(case, update="new").accepted == "written"
    assert (chosen[0].noise, chosen[0].smoothing) == (0.5, "taut")
    written = json.loads(case.baseline_path.read_text())
    assert written["margin_m"] == 0.021
    baseline = Baseline.load(case.baseline_path)
    assert baseline is not None
    assert baseline.to_text() == case.baseline_path.read_text()
    again = check_case(
        only(tmp_path, "world: empty, planner: astar, noise: 0.5, margin: auto, expect: {duration_s: '< 1'}")
    )
    assert "margin: auto chose 0.034 m, for the baseline 0.021 m" in again.details


def test_scenarios_override_defaults_and_add_to_what_is_expected(tmp_path: Path) -> None:
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


def test_worlds_and_robots_lie_beside_the_suite_and_are_read_once(tmp_path: Path) -> None:
    (tmp_path / "mine.yaml").write_text("{schema: 1, bounds: [0, 0, 5, 4], start: [1, 1, 0], goal: [4, 3]}\n")
    first = scenario_of(only(tmp_path, "world: mine.yaml, planner: astar"))
    again = scenario_of(only(tmp_path, "world: mine.yaml, planner: dijkstra, seeds: [1]"))
    assert first.task.world.name == "mine"
    assert first.task is again.task


def test_a_random_world_is_that_of_the_command_that_writes_it(tmp_path: Path) -> None:
    case = only(tmp_path, "world: {generate: forest, seed: 7, count: 3}, planner: astar")
    assert len(scenario_of(case).task.world.obstacles) == 3
    assert run_command(case) == (
        "antdrive worlds generate forest --seed 7 --out forest-7.yaml --set count=3 && "
        "antdrive run forest-7.yaml --planner astar --robot turtlebot --seed 0"
    )


def test_a_planner_of_ones_own_comes_from_a_file_or_a_module(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    path = tmp_path / "own_planners_of_a_test.py"
    source = "from antdrive.planners import AStar\nclass Mine(AStar):\n    pass\nREADY = Mine()\n"
    path.write_text(source)
    for name in ("Mine", "READY"):
        for words, in_a_file in (
            (f"{{file: {path.name}, name: {name}}}", True),
            (f"{{module: {path.stem}, name: {name}}}", False),
            (f"{path.name}:{name}", True),
            (f"{{name: '{path.stem}:{name}'}}", False),
        ):
            case = only(tmp_path, f"world: empty, planner: {words}")
            check_names(case)
            made = scenario_of(case)
            assert type(made.planner).__name__ == "Mine"
            assert made.planner_label == name
            command = (
                f"antdrive run empty --planner {path.name}:{name} --robot turtlebot --seed 0" if in_a_file else None
            )
            assert run_command(case) == command
    path.write_text(source.replace("pass", "old = 1"))
    os.utime(path, (1, 1))
    made = scenario_of(only(tmp_path, f"world: empty, planner: {path.name}:Mine"))
    os.utime(path, (1, 1))
    path.write_text(source.replace("pass", "old = 2"))
    os.utime(path, (1, 1))
    again = scenario_of(only(tmp_path, f"world: empty, planner: {path.name}:Mine"))
    assert (made.planner.old, again.planner.old) == (1, 2), "by its content, not by its time"  # type: ignore[attr-defined]


@pytest.mark.parametrize(
    ("keys", "line", "message"),
    [
        ("wrld: empty", 3, "scenarios.one.wrld: unknown key; did you mean world?"),
        ("planner: astar", 3, "scenarios.one.world: missing; write a world file"),
        ("world: emty", 3, "scenarios.one.world: emty: no such file, nor a world of the catalogue; did you mean"),
        ("world: [1]", 3, "scenarios.one.world: must be a name or a mapping, got [1]"),
        ("world: {seed: 3}", 3, "scenarios.one.world: write a file, a name of the catalogue, or {generate: forest"),
        ("world: {generate: wood}", 3, "scenarios.one.world: generate: unknown kind 'wood'; choose from forest, barn"),
        ("world: {generate: forest, size: big}", 3, "scenarios.one.world: forest: size: must be a number, got big"),
        ("world: {generate: forest, seed: -1}", 3, "scenarios.one.world.seed: must be a whole number of at least 0"),
        ("world: empty, robot: jakal", 3, "scenarios.one.robot: jakal: no such file, nor a robot of the"),
        ("world: empty, planner: astarr", 3, "scenarios.one.planner: no planner is called 'astarr'; did you mean"),
        ("world: empty, planner: {ants: 3}", 3, "scenarios.one.planner.name: missing"),
        ("world: empty, planner: {name: aco-han, antss: 3}", 3, "scenarios.one.planner.antss: no option of aco-han"),
        ("world: empty, planner: {name: aco-han, ants: many}", 3, "scenarios.one.planner.ants: must be a whole number"),
        ("world: empty, planner: {name: X, file: no.py}", 3, "scenarios.one.planner.file: no.py: no such file beside"),
        ("world: empty, planner: no.py:X", 3, "scenarios.one.planner: no.py: no such file beside"),
        ("world: empty, planner: math:cosh", 3, "scenarios.one.planner: planner 'cosh' "),
        ("world: empty, planner: math:X", 3, "scenarios.one.planner: math has no 'X'"),
        ("world: empty, planner: {name: 'a:X', file: no.py}", 3, "scenarios.one.planner.name: must be the class alone"),
        ("world: empty, planner: {name: X, module: no_such_module}", 3, "scenarios.one.planner.module: no_such_module: cannot"),
        ("world: empty, planner: {name: X, module: math}", 3, "scenarios.one.planner.name: math has no 'X'"),
        ("world: empty, planner: {name: pi, module: math}", 3, "scenarios.one.planner: planner 'pi' is not a planner"),
        ("world: empty, margin: wide", 3, 'scenarios.one.margin: must be a number of metres, or auto, got "wide"'),
        ("world: empty, margin: -1", 3, "scenarios.one.margin: must be at least 0"),
        ("world: empty, noise: 1e99", 3, "scenarios.one.noise"),
        ("world: empty, smoothing: round", 3, "scenarios.one.smoothing: unknown 'round'; choose from none"),
        ("world: empty, sees: all", 3, "scenarios.one.sees: unknown kind 'all'; choose from positions"),
        ("world: empty, sees: 'positions:x'", 3, "scenarios.one.sees: write KIND or KIND:METRES"),
        ("world: empty, avoid: 1", 3, "scenarios.one.avoid: must be true, false, none or a mapping of settings, got 1"),
        ("world: empty, replan: never", 3, 'scenarios.one.replan: must be true, false, none or a mapping of settings, got "n'),
        ("world: empty, replanning: none", 3, "scenarios.one.replanning: unknown key; write replan: whether the robot replans"),
        ("world: empty, perception: positions", 3, "scenarios.one.perception: unknown key; write sees: what the robot"),
        ("world: empty, seed: 3", 3, "scenarios.one.seed: unknown key; write seeds: one test for each"),
        ("world: empty, avoid: {horizn: 1}", 3, "scenarios.one.avoid.horizn: unknown setting; did you mean horizon?"),
        ("world: empty, replan: {patience: x}", 3, "scenarios.one.replan.patience: must be"),
        ("world: empty, controller: {speed: 1}", 3, "scenarios.one.controller.speed: unknown setting"),
        ("world: empty, seeds: []", 3, "scenarios.one.seeds: must be whole numbers of at least 0, such as [0, 1, 2]"),
        ("world: empty, seeds: [1, 1]", 3, "scenarios.one.seeds: must be different numbers"),
        ("world: empty, seeds: 9-3", 3, "scenarios.one.seeds: must be whole numbers"),
        ("world: empty, start: [0, 0, 0]", 3, "scenarios.one.start: "),
        ("world: empty, start: [0, 0]", 3, "scenarios.one.start: must have 3 entries, got 2; write [x, y, yaw]"),
        ("world: empty, expect: {outcome: won}", 3, 'scenarios.one.expect.outcome: unknown outcome "won"; choose from'),
        ("world: empty, expect: {outcome: collided, touched: tree}", 3, 'scenarios.one.expect.touched: unknown "tree"; choose'),
        ("world: empty, expect: {cause: slip}", 3, "scenarios.one.expect.cause: nothing is touched where the outcome is"),
        ("world: empty, expect: {min_clearence_m: 1}", 3, "scenarios.one.expect.min_clearence_m: no such metric; did you"),
        ("world: empty, expect: {duration_s: short}", 3, 'scenarios.one.expect.duration_s: must be a bound such as'),
        ("world: empty, expect: {certified: maybe}", 3, "scenarios.one.expect.certified: must be true or false"),
        ("world: empty, tolerance: {duration_s: -1}", 3, "scenarios.one.tolerance.duration_s: must be a number of at least"),
        ("world: empty, tolerance: {end_m: 10 %}", 3, "scenarios.one.tolerance.end_m: must be a distance in metres"),
        ("world: empty, expect: {plan_s: < 1}", 3, "scenarios.one.expect.plan_s: depends on the machine and its load"),
        ("world: empty, expect: {min_clearance_m: 0.05}", 3, 'scenarios.one.expect.min_clearance_m: no drive has exactly'),
        ("world: empty, baseline: false, trajectory: exact", 3, "scenarios.one.trajectory: there is no baseline to compare"),
        ("world: empty, baseline: false, tolerance: {spl: 1}", 3, "scenarios.one.tolerance: there is no baseline to compare"),
        ("world: empty, tolerance: {replans: 1}", 3, "scenarios.one.tolerance.replans: neither more nor less of it is better"),
        ("world: empty, trajectory: 0", 3, "scenarios.one.trajectory: must be exact, or a distance of at least 0.002 m"),
        ("world: empty, unseen: [{x: 1, y: 1}]", 3, "scenarios.one.unseen[0].radius: missing; the radius as built"),
    ],
)  # fmt: skip
def test_what_is_wrong_is_one_line_with_line_key_and_remedy(tmp_path: Path, keys: str, line: int, message: str) -> None:
    with pytest.raises(InputError) as caught:
        scenario_of(only(tmp_path, keys))
    text = str(caught.value)
    assert text.startswith(f"{tmp_path}/s.drive.yaml:{line}: {message}"), text
    assert "\n" not in text


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("scenarios:\n  a: {world: empty}\n", "s.drive.yaml: schema: missing; write schema: 1"),
        ("schema: 2\nscenarios:\n  a: {world: empty}\n", "s.drive.yaml:1: schema: must be 1"),
        ("schema: 1\nscenarios: {}\n", "s.drive.yaml:2: scenarios: holds none; write at least one"),
        ("schema: 1\nscenarios:\n  a/b: {world: empty}\n", "s.drive.yaml:3: scenarios.a/b: a name has letters, digits"),
        ("schema: 1\nscenarios:\n  a: {world: empty}\n  a: {world: empty}\n", "s.drive.yaml:4: scenarios.a: is given twice"),
        ("schema: 1\nscenarios:\n  a: empty\n", "s.drive.yaml:3: scenarios.a: must be a mapping"),
        ("schema: 1\ndefaults:\n  nois: 1\nscenarios:\n  a: {world: empty}\n", "s.drive.yaml:3: defaults.nois: unknown key"),
        ("schema: 1\ndefaults:\n  planner: no\nscenarios:\n  a: {world: empty}\n", "s.drive.yaml:3: defaults.planner: "),
        ("schema: 1\ndefaults:\n  expect: {spll: 1}\nscenarios:\n  a: {world: empty}\n", ":3: defaults.expect.spll: "),
        ("schema: 1\ndefaults:\n  margin: -2\nscenarios:\n  a: {world: empty}\n", "s.drive.yaml:3: defaults.margin: "),
        ("", "s.drive.yaml: is empty"),
        ("- 1\n", "s.drive.yaml: must be a mapping with the keys schema, scenarios"),
    ],
)  # fmt: skip
def test_a_wrong_suite_is_one_line(tmp_path: Path, text: str, message: str) -> None:
    with pytest.raises(InputError, match=re.escape(message)):
        scenario_of(load_suite(suite(tmp_path, text))[0])


def test_words_select_tests(tmp_path: Path) -> None:
    (tmp_path / "below").mkdir()
    path = suite(
        tmp_path / "below", "schema: 1\ndefaults: {world: empty, seeds: 0-1}\nscenarios: {a: {}, ab: {}, c: {}}\n"
    )

    def ids(*words: str, pattern: str | None = None) -> list[str]:
        return [case.id for case in select(words, pattern)]

    assert ids(str(tmp_path)) == ["a[0]", "a[1]", "ab[0]", "ab[1]", "c[0]", "c[1]"]
    assert ids(f"{path}::a") == ["a[0]", "a[1]"]
    assert ids(f"{path}::c[1]", str(path), pattern="c") == ["c[1]", "c[0]"]
    assert ids(str(path), pattern="a*") == ["a[0]", "a[1]", "ab[0]", "ab[1]"]
    for words, pattern, message in (
        ([f"{path}::d"], None, "no test 'd'; choose from"),
        ([str(path)], "x*", "no test of"),
        ([str(tmp_path / "none.drive.yaml")], None, "cannot be read (No such file"),
        ([__file__], None, "is no suite; the name of a suite ends in .drive.yaml"),
        ([str(Path(__file__).parent)], None, "holds no suites"),
    ):
        with pytest.raises(InputError, match=re.escape(message)):
            select(words, pattern)


def test_a_file_that_ends_the_program_is_a_wrong_suite(tmp_path: Path) -> None:
    (tmp_path / "script.py").write_text("import sys\nsys.exit(0)\n")
    for key, source in (("file", "script.py"), ("module", "script")):
        with pytest.raises(InputError, match=rf"planner\.{key}: script.*ends the program .* \(exit code 0\); guard"):
            scenario_of(only(tmp_path, f"world: empty, planner: {{{key}: {source}, name: Mine}}"))


def test_suites_of_different_folders_have_modules_of_their_own(tmp_path: Path) -> None:
    """The same names of modules, and of what they import, in two folders; each stays the same class when asked again."""
    mine = (
        "from antdrive.planners.graph.search import AStar\nimport besides\nclass Mine(AStar):\n    of = besides.WHO\n"
    )
    made: dict[tuple[str, str], type] = {}
    for folder in ("a", "b"):
        (tmp_path / folder).mkdir()
        (tmp_path / folder / "besides.py").write_text(f"WHO = {folder!r}\n")
        (tmp_path / folder / "same_name.py").write_text(mine)
    for folder in ("a", "b", "a", "b"):
        place = tmp_path / folder
        for source in ("{module: same_name, name: Mine}", "{file: same_name.py, name: Mine}", "same_name:Mine"):
            planner = scenario_of(only(place, f"world: empty, planner: {source}")).planner
            assert planner.of == folder  # type: ignore[attr-defined]
            assert made.setdefault((folder, source), type(planner)) is type(planner)


def test_planners_beside_a_suite_stay_in_their_process(tmp_path: Path) -> None:
    (tmp_path / "beside_it.py").write_text(
        "from antdrive.planners.graph.search import AStar\nclass Mine(AStar):\n    pass\n"
    )
    for words in ("{module: beside_it, name: Mine}", "{file: beside_it.py, name: Mine}", "beside_it.py:Mine"):
        assert not is_importable_elsewhere(scenario_of(only(tmp_path, f"world: empty, planner: {words}")).planner)
    assert is_importable_elsewhere(scenario_of(only(tmp_path, "world: empty, planner: astar")).planner)


def test_a_module_that_is_taken_from_elsewhere_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    elsewhere = tmp_path / "elsewhere"
    elsewhere.mkdir()
    for place in (elsewhere, tmp_path):
        (place / "taken_name.py").write_text("from antdrive.planners.graph.search import AStar as Mine\n")
    monkeypatch.syspath_prepend(str(elsewhere))
    with pytest.raises(InputError, match=r"planner\.module: taken_name is imported from .*elsewhere.*beside the suite"):
        scenario_of(only(tmp_path, "world: empty, planner: {module: taken_name, name: Mine}"))
