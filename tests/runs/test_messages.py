"""What is said of wrong questions about many runs: all of it is in `messages.yml`."""

import json
import math

import numpy as np

from antdrive import Scenario
from antdrive.runs.barn_challenge import unpacked
from antdrive.runs.campaigns import expand, make_campaign, read_results, sweep
from antdrive.runs.failures.failure import parse_bound
from antdrive.runs.failures.hunt import find_failures
from antdrive.runs.margins.choice import least_margin, predicted_loss
from antdrive.runs.margins.loss import Loss
from antdrive.runs.statistics.comparison import compare_metric, not_worse, pairs_of
from antdrive.runs.statistics.intervals import wilson
from antdrive.runs.statistics.pairing import PairedRuns
from antdrive.runs.statistics.run_table import REQUIRED, RunTable, merged
from antdrive.runs.statistics.success import distributions, performance_profiles
from antdrive.runs.suites import Baseline, Demands, load_suite, scenario_of
from antdrive.testing.strategies import worlds
from tests.messages import check_messages, numbered
from tests.runs.campaigns import test_campaign
from tests.runs.made_up_campaign import Skill, made_up_columns
from tests.runs.suites import test_suite

BOUNDS = ("clearance < 1", "plan_s < 1", "spl = 1", "spl < much", "spl < 1.2.3", "spl < 1e999")
DEMANDS = (
    ({"spll": 1}, {}, None), ({}, {"spll": 1}, None), ({}, {}, "near"), ({}, {"duration_s": True}, None),
    ({"duration_s": True}, {}, None), ({"plan_s": "< 1"}, {}, None), ({"drive_wall_s": "< 1"}, {}, None),
    ({}, {"end_m": "10 %"}, None), ({"min_clearance_m": 0.05}, {}, None),
)  # fmt: skip
NO_BASELINES = ("{", "[]", '{"schema": 1}')
GAPS = (
    {"line": []}, {"metrics": {"nonsense": 1.0}}, {"metrics": None}, {"drive_digest": ""}, {"hashes": {}}, {"line_hz": 0.0},
)  # fmt: skip


def test_wrong_questions_about_many_runs_are_refused_in_one_line(tmp_path, small_run, data_regression):
    def baseline(text):
        (tmp_path / "b.json").write_text(text)
        return Baseline.load(tmp_path / "b.json")

    def changed(values):
        return baseline(json.dumps({**whole, **values}))

    def results(file="", content=""):
        folder = tmp_path / "campaign"
        folder.mkdir(exist_ok=True)
        if file:
            (folder / file).write_text(content)
        return read_results(folder)

    def sweep_with(**options):
        sweep({"worlds": "empty", "planners": "astar", "run_limit": 9}, tmp_path / "out", **options)

    def grid(*texts, planners=("astar",), worlds=("empty",)):
        for text in texts:
            (tmp_path / "mine.py").write_text(text)
        expand(make_campaign({"worlds": [*worlds], "planners": [*planners]}, tmp_path))

    def losses(value):
        return lambda margin: [Loss(value(margin), value(margin))] * 80

    test_campaign.movingai(tmp_path)
    whole = json.loads(Baseline.of(small_run, "small[0]").to_text())
    numbers = {**whole["metrics"]}
    careless = Scenario.of("empty", "astar")
    columns = made_up_columns({"a": Skill(), "b": Skill()}, worlds=2, seeds=4)
    table, narrow = RunTable(columns), RunTable({name: columns[name] for name in REQUIRED})
    paired, one = PairedRuns.of(table), PairedRuns.of(table.of_planners(["a"]))
    apart = RunTable({**columns, "task": [f"{planner}'s own" for planner in columns["planner"]]})
    two = {name: [*values, *values] for name, values in columns.items()}
    told_apart = {"robot_hash": ["1"] * 32, "margin_asked": ["0.03"] * 32}
    newer = RunTable({**columns, "robot_hash": ["1"] * 16, "sees": ["velocities"] * 16})
    calls = {
        "bounds": {text: lambda t=text: parse_bound(t) for text in BOUNDS},
        "demands": {str(demand): lambda d=demand: Demands.of(*d) for demand in DEMANDS},
        "baselines": {
            **{text: lambda t=text: baseline(t) for text in NO_BASELINES},
            **{str(gap): lambda g=gap: changed(g) for gap in GAPS},
            "a metric too many": lambda: changed({"metrics": {**numbers, "nonsense": 1.0}}),
            "no duration": lambda: changed({"metrics": {**numbers, "duration_s": None}}),
        },
        "searches": {
            str(words): lambda w=words: find_failures(careless, **w)
            for words in ({"method": "wise"}, {"budget": 0}, {"obstacles": 0})
        },
        "campaigns": {
            **{
                str(words): lambda w=words: sweep_with(**w) for words in ({"jobs": -1}, {"keep": "fialed"}, {"jobs": 0})
            },
            "no manifest": results,
            **{
                text: lambda t=text: results("manifest.json", t)
                for text in ("{}", "[]", '{"size": "6"}', '{"size": 6, "size": 7}')
            },
        },
        "campaign files": {
            " ".join(text.split()): lambda t=text: test_campaign.expanded(t, tmp_path)
            for text in (
                *test_campaign.WRONG,
                *(f"{test_campaign.HEAD}{one}\n" for one in test_campaign.WRONG_BELOW_THE_HEAD),
            )
        },
        "campaigns' planners": {
            "no file": lambda: grid(planners=["mine.py:Mine"]),
            **{text: lambda t=text: grid(t, planners=["mine.py:Mine"]) for text in test_campaign.WRONG_PLANNERS},
        },
        "problems of maps": {
            str(value): lambda v=value: grid(worlds=[{"import": "m.map", "problem": v}])
            for value in ("0-", [1, 1], "x", 2.5, -1)
        },
        "scenarios": {
            text: lambda t=text: scenario_of(test_suite.only(tmp_path, t))
            for text in (*test_suite.WRONG, *(f"world: empty, {one}" for one in test_suite.WRONG_BESIDE_A_WORLD))
        },
        "suites": {
            " ".join(text.split()): lambda t=text: scenario_of(load_suite(test_suite.suite(tmp_path, t))[0])
            for text in test_suite.WRONG_SUITES
        },
        "barn": {"no worlds": lambda: unpacked(tmp_path, tmp_path / "out")},
        "margins": {
            "few losses": lambda: predicted_loss([0.01] * 10),
            "a loss as large": lambda: least_margin(losses(lambda margin: margin), "k", 0.2),
            "no success": lambda: least_margin(losses(lambda margin: math.inf), "k", 2.0),
        },
        "tables": {
            "no value": lambda: table.where("seed", "9"),
            "no column": lambda: narrow.where("sed", "9"),
            "no planner": lambda: table.of_planners(["a", "c"]),
            "no seed": lambda: RunTable({name: values for name, values in columns.items() if name != "seed"}),
            "other columns": lambda: merged({"may": table, "june": newer}),
        },
        "pairs": {
            "no runs": lambda: PairedRuns.of(RunTable(dict.fromkeys(columns, ()))),
            "runs twice": lambda: PairedRuns.of(RunTable(two)),
            "runs told apart twice": lambda: PairedRuns.of(RunTable({**two, **told_apart})),
            "one planner": lambda: pairs_of(one),
            "no pairs": lambda: pairs_of(PairedRuns.of(apart)),
            "no reference": lambda: pairs_of(paired, against="nobody"),
            "no metric": lambda: compare_metric(paired, [(0, 1)], "speed", "higher"),
        },
        "not worse": numbered(
            lambda w=words: not_worse(paired, *w)
            for words in (
                ("a", "success", 0.0, "higher"),
                ("a", "replans", 1.0, "neither"),
                ("x", "success", 0.1, "higher"),
            )
        ),
        "shares": {
            **{str(counts): lambda c=counts: wilson(*c) for counts in ((0, 0), (3, 2), (-1, 2))},
            "no instances": lambda: distributions(np.zeros((0, 2))),
            "negative costs": lambda: performance_profiles(np.array([[-1.0, 1.0]])),
        },
        "worlds of tests": {"no whole centimetre": lambda: worlds(radius=(0.004, 0.006))},
    }
    check_messages(calls, data_regression, tmp_path)
    assert not (tmp_path / "out").exists(), "refused before anything is written"
