"""Comparisons: known differences are found, equal planners are not told apart, nothing unpaired is compared."""

import dataclasses
import itertools
import math

import numpy as np
import pytest

from antdrive.base import FieldError
from antdrive.runs.statistics.comparison import _needed, compare_metric, compare_success, not_worse, pairs_of
from antdrive.runs.statistics.pairing import PairedRuns
from antdrive.runs.statistics.price import prices
from antdrive.runs.statistics.run_table import CONFIGURATION, PLACE, RunTable, described, matching, merged
from antdrive.runs.statistics.success import common_medians, success_table
from tests.runs.made_up_campaign import Skill, made_up_columns, made_up_runs

PLANNERS = {"good": Skill(0.95, 1.05), "same": Skill(0.95, 1.05), "poor": Skill(0.6, 1.3)}


def rows_of(columns, keep):
    places = [k for k in range(len(columns["planner"])) if keep({name: values[k] for name, values in columns.items()})]
    return RunTable({name: [values[k] for k in places] for name, values in columns.items()})


@pytest.fixture(scope="module")
def paired():
    return PairedRuns.of(made_up_runs(PLANNERS, worlds=20, seeds=6))


def test_shares_are_counted(paired):
    columns = made_up_columns(PLANNERS, worlds=20, seeds=6)
    for row in success_table(paired):
        of = [
            done for label, done in zip(columns["planner"], columns["succeeded"], strict=True) if label == row.planner
        ]
        assert (row.runs, row.counted, row.successes) == (120, 120, sum(of))
        assert row.interval.low < row.fraction < row.interval.high
        assert row.over_worlds.low <= row.fraction <= row.over_worlds.high
        assert sum(row.outcomes.values()) == 120


def test_a_known_difference_is_found_and_none_where_there_is_none(paired):
    found = {(row.first, row.second): row for row in compare_success(paired, pairs_of(paired))}
    assert {pair: row.better for pair, row in found.items()} == {
        ("good", "same"): "", ("good", "poor"): "good", ("same", "poor"): "same",
    }  # fmt: skip
    row = found["good", "poor"]
    assert row.pairs == 120
    assert row.first_wins + row.second_wins + row.ties == 120
    assert row.interval.low < row.difference < row.interval.high
    assert row.interval.low <= 0.35 <= row.interval.high
    assert row.p <= row.p_holm
    assert row.p_worlds <= row.p_worlds_holm


def test_metrics_are_compared_where_both_succeeded(paired):
    rows = compare_metric(paired, pairs_of(paired), "duration_s", "lower")
    for row in rows:
        i, j = (paired.planners.index(name) for name in (row.first, row.second))
        both = paired.success[:, i] & paired.success[:, j]
        assert (row.pairs, row.dropped) == (both.sum(), (~both).sum())
        values = paired.values("duration_s")[both]
        assert row.difference == pytest.approx(np.median(values[:, i] - values[:, j]))
        assert row.first_wins == (values[:, i] < values[:, j]).sum()
    assert [row.better for row in rows] == ["", "good", "same"]
    assert rows[1].effect == 1
    higher = compare_metric(paired, pairs_of(paired), "duration_s", "higher")
    assert [row.better for row in higher] == ["", "poor", "poor"]


def test_one_planner_is_compared_with_each_other_one(paired):
    rows = compare_success(paired, pairs_of(paired, against="same"))
    assert [(row.first, row.second) for row in rows] == [("good", "same"), ("same", "poor")]
    assert rows[1].p_holm == pytest.approx(2 * rows[1].p), "Holm over two comparisons"


def test_the_order_of_rows_changes_nothing():
    columns = made_up_columns(PLANNERS, worlds=6, seeds=3)
    order = np.random.default_rng(0).permutation(len(columns["seed"]))
    order = sorted(order, key=lambda k: columns["planner"][k] != "good")  # the planners keep their order
    order = sorted(order, key=lambda k: columns["planner"][k] == "poor")
    mixed = PairedRuns.of(RunTable({name: [values[k] for k in order] for name, values in columns.items()}))
    plain = PairedRuns.of(RunTable(columns))
    for compare in (compare_success, lambda p, pairs: compare_metric(p, pairs, "plan_s", "lower")):
        assert repr(compare(mixed, pairs_of(mixed))) == repr(compare(plain, pairs_of(plain)))


def test_runs_without_a_partner_are_counted_and_left_out():
    columns = made_up_columns(PLANNERS, worlds=6, seeds=3)
    table = rows_of(columns, lambda row: row["planner"] != "good" or row["seed"] > 0)
    row = compare_success(PairedRuns.of(table), [(0, 1)])[0]
    assert (row.pairs, row.unpaired) == (12, 6)
    metric = compare_metric(PairedRuns.of(table), [(0, 1)], "duration_s", "lower")[0]
    assert metric.pairs + metric.dropped == 12


@pytest.mark.parametrize("key", ["world", "world_hash", "task", "seed", *CONFIGURATION])
def test_runs_that_differ_in_anything_are_no_pairs(key):
    columns = made_up_columns({"a": Skill(), "b": Skill()}, worlds=2, seeds=2)
    columns[key] = [
        f"other {value}" if isinstance(value, str) else (value or 0) + 50 if name == "b" else value
        for name, value in zip(columns["planner"], columns.get(key, [None] * 8), strict=True)
    ]
    if isinstance(columns[key][0], str):
        columns[key] = [f"{value} of {name}" for name, value in zip(columns["planner"], columns[key], strict=True)]
    with pytest.raises(FieldError, match="no two share a run"):
        pairs_of(PairedRuns.of(RunTable(columns)))


def test_seeds_that_change_no_drive_are_no_evidence():
    planners = {"astar": Skill(0.8, seeded=False), "dijkstra": Skill(0.8, seeded=False), "ants": Skill(0.8)}
    paired = PairedRuns.of(made_up_runs(planners, worlds=30, seeds=10))
    assert paired.seeded.all(axis=0).tolist() == paired.seeded.any(axis=0).tolist() == [False, False, True]
    rows = success_table(paired)
    assert [(row.runs, row.counted) for row in rows] == [(300, 30), (300, 30), (300, 300)]
    once = success_table(PairedRuns.of(made_up_runs(planners, worlds=30, seeds=1)))[0]
    assert rows[0].counted == once.counted
    assert [row.pairs for row in compare_success(paired, pairs_of(paired))] == [30, 300, 300]
    assert compare_metric(paired, [(0, 1)], "duration_s", "lower")[0].pairs <= 30
    still = PairedRuns.of(paired.table, ["astar", "dijkstra"])
    assert common_medians(still, ["duration_s"])[0] == still.success.all(axis=1).sum() / 10


def repeated(columns, times):
    """Each run `times` times, with seeds of its own that change no drive."""
    found = {name: [value for value in values for _ in range(times)] for name, values in columns.items()}
    found["seed"] = [times * seed + k for seed in columns["seed"] for k in range(times)]
    return RunTable(found)


@pytest.mark.parametrize("noise", [0.0, 1.0], ids=["alone", "with runs of another setting"])
def test_repetitions_change_no_figure(noise):
    planners = {"astar": Skill(0.8, 1.0, seeded=False), "dijkstra": Skill(0.7, 1.02, seeded=False)}
    columns = made_up_columns(planners, worlds=15, seeds=1)
    other = made_up_columns(planners, worlds=15, seeds=1, rng_seed=2)
    other["noise"] = [noise] * 30
    tables = []
    for times in (1, 2, 7):
        still = repeated(columns, times).columns
        both = RunTable({name: [*still[name], *(other[name] if noise else ())] for name in columns})
        paired = PairedRuns.of(both)
        rows = [
            (row.planner, row.counted, row.successes, row.interval, row.over_worlds) for row in success_table(paired)
        ]
        pairs = [dataclasses.replace(row, unpaired=0) for row in compare_success(paired, [(0, 1)])]
        pairs += compare_metric(paired, [(0, 1)], "duration_s", "lower")
        tables.append(repr((rows, pairs, common_medians(paired, ["duration_s"]))))
    assert tables[0] == tables[1] == tables[2]


def test_a_wall_time_of_repeated_drives_is_their_median():
    columns = made_up_columns({"astar": Skill(1.0, seeded=False), "ants": Skill(1.0)}, worlds=2, seeds=3)
    columns["plan_s"] = [0.3, 0.1, 0.2, 4, 5, 6, 0.9, 0.7, 0.8, 7, 8, 9]
    paired = PairedRuns.of(RunTable(columns))
    assert paired.values("plan_s").T.tolist() == [[0.2] * 3 + [0.8] * 3, [4, 5, 6, 7, 8, 9]]
    assert common_medians(PairedRuns.of(paired.table, ["astar"]), ["plan_s"])[1]["plan_s"][0][0] == 0.5
    first = [paired.table.columns["duration_s"][k] for k in (0, 6)]
    assert paired.values("duration_s")[[0, 3], 0].tolist() == first


def test_seeds_that_change_drives_under_some_settings_count_there():
    quiet = made_up_columns({"a": Skill(0.8, seeded=False), "b": Skill(0.9, seeded=False)}, worlds=6, seeds=5)
    noisy = made_up_columns({"a": Skill(0.8), "b": Skill(0.9)}, worlds=6, seeds=5)
    noisy["noise"] = [1.0] * 60
    paired = PairedRuns.of(RunTable({name: [*quiet[name], *noisy[name]] for name in quiet}))
    assert [row.counted for row in success_table(paired)] == [6 + 30, 6 + 30]
    assert compare_success(paired, [(0, 1)])[0].pairs == 36


def test_shares_are_over_the_instances_that_every_planner_ran():
    columns = made_up_columns({"a": Skill(1.0), "b": Skill(1.0)}, worlds=8, seeds=2)
    hard = [world >= "world-004" for world in columns["world"]]
    columns["succeeded"] = columns["certified"] = [not one for one in hard]
    easy_only = rows_of({**columns, "hard": hard}, lambda row: row["planner"] == "a" or not row["hard"])
    rows = success_table(PairedRuns.of(easy_only))
    assert [(row.planner, row.fraction, row.runs, row.elsewhere, row.counted) for row in rows] == [
        ("a", 1.0, 16, 8, 8), ("b", 1.0, 8, 0, 8),
    ]  # fmt: skip
    apart = rows_of({**columns, "hard": hard}, lambda row: (row["planner"] == "a") == row["hard"])
    assert [(row.fraction, row.elsewhere, row.counted) for row in success_table(PairedRuns.of(apart))] == [
        (1.0, 0, 8), (0.0, 0, 8),
    ]  # fmt: skip


def test_where_all_runs_end_alike_whole_worlds_are_counted():
    always, never = Skill(1.0), Skill(0.0)
    rows = success_table(PairedRuns.of(made_up_runs({"a": always, "b": never}, worlds=4, seeds=50)))
    z2 = 1.959963984540054**2
    assert rows[0].over_worlds == pytest.approx((4 / (4 + z2), 1.0)), "Wilson's limit for 4 of 4"
    assert rows[1].over_worlds == pytest.approx((0.0, z2 / (4 + z2)))
    assert rows[0].interval.low > 0.98, "over single runs"
    for first, second, low, high in ((always, always, -z2 / (4 + z2), z2 / (4 + z2)), (never, never, -0.49, 0.49)):
        row = compare_success(PairedRuns.of(made_up_runs({"a": first, "b": second}, worlds=4, seeds=50)), [(0, 1)])[0]
        assert row.interval == pytest.approx((low, high), abs=0.001)
    row = compare_success(PairedRuns.of(made_up_runs({"a": always, "b": never}, worlds=4, seeds=50)), [(0, 1)])[0]
    assert row.interval == pytest.approx((1 - 2**0.5 * z2 / (4 + z2), 1.0)), "Newcombe's for 4 of 4 against 0 of 4"


def test_a_metric_without_a_direction_has_no_better_planner():
    paired = PairedRuns.of(made_up_runs({"a": Skill(1.0, 1.0), "b": Skill(1.0, 1.3)}, worlds=10, seeds=3))
    row = compare_metric(paired, [(0, 1)], "duration_s", "neither")[0]
    assert (row.better, row.lower, row.as_dict()["better"], row.as_dict()["lower"]) == ("", "a", "", "a")
    row = compare_metric(paired, [(0, 1)], "duration_s", "lower")[0]
    assert (row.better, row.lower) == ("a", "")


def test_runs_are_paired_by_the_margin_that_was_asked_for_and_by_the_robots_content():
    columns = made_up_columns({"a": Skill(1.0), "b": Skill(1.0)}, worlds=2, seeds=1)
    two = {name: [*values, *values] for name, values in columns.items()}
    asked = PairedRuns.of(RunTable({**two, "margin_asked": ["0.03"] * 4 + ["auto"] * 4}))
    assert compare_success(asked, [(0, 1)])[0].pairs == 4, "auto chose the margin that was asked for as well"
    chosen = {**columns, "margin_asked": ["auto"] * 4, "margin": [0.03, 0.04, 0.03, 0.04]}
    assert PairedRuns.of(RunTable(chosen)).shared.all(), "both asked for the same"
    robots = PairedRuns.of(RunTable({**two, "robot_hash": ["1"] * 4 + ["2"] * 4}))
    assert compare_success(robots, [(0, 1)])[0].pairs == 4


def test_a_world_that_decides_alone_is_no_evidence_for_other_worlds():
    columns = made_up_columns({"a": Skill(1.0), "b": Skill(1.0)}, worlds=8, seeds=40)
    for k, (world, planner) in enumerate(zip(columns["world"], columns["planner"], strict=True)):
        if (world, planner) == ("world-003", "b"):
            columns["succeeded"][k] = columns["certified"][k] = False
    row = compare_success(PairedRuns.of(RunTable(columns)), [(0, 1)])[0]
    assert row.p < 1e-9, "over runs the difference is beyond doubt"
    assert row.p_worlds == 1, "but one world says nothing about others"
    assert row.better == ""
    assert row.interval.low <= 0


def test_the_test_over_worlds_counts_all_flips_of_whole_worlds():
    paired = PairedRuns.of(made_up_runs({"a": Skill(0.9, 1.1), "b": Skill(0.6, 1.105)}, worlds=7, seeds=5))
    times = paired.values("plan_s")
    gap = times[:, 0] - times[:, 1]
    sizes = sorted(np.abs(gap[~np.isnan(gap)]))
    rank = [0.0 if np.isnan(x) else math.copysign(1 + sizes.index(abs(x)), x) for x in gap]
    for row, scores in (
        (compare_success(paired, [(0, 1)])[0], paired.success[:, 0].astype(float) - paired.success[:, 1]),
        (compare_metric(paired, [(0, 1)], "plan_s", "lower")[0], np.array(rank)),
    ):
        sums = [float(scores[paired.world == w].sum()) for w in range(7)]
        flips = [abs(np.dot(signs, sums)) for signs in itertools.product((1, -1), repeat=7)]
        assert row.p_worlds == pytest.approx(np.mean(np.array(flips) >= abs(sum(sums)) - 1e-9))
        assert 0.01 < row.p_worlds < 1


def test_where_each_world_has_one_pair_the_test_over_worlds_is_left_out():
    row = compare_success(PairedRuns.of(made_up_runs(PLANNERS, worlds=40, seeds=1)), [(0, 2)])[0]
    assert math.isnan(row.p_worlds)
    assert row.decisive_p == row.p_holm
    assert math.isnan(success_table(PairedRuns.of(made_up_runs(PLANNERS, worlds=40, seeds=1)))[0].over_worlds.low)


def test_medians_are_taken_where_every_planner_succeeded(paired):
    common = paired.success.all(axis=1)
    count, found = common_medians(paired, ["duration_s", "no_such_metric"])
    assert count == common.sum()
    assert list(found) == ["duration_s"]
    values = paired.values("duration_s")[common]
    for k, (median, interval) in enumerate(found["duration_s"]):
        assert median == pytest.approx(np.median(values[:, k]))
        assert interval.low <= median <= interval.high


def test_planners_are_selected(paired):
    few = PairedRuns.of(paired.table, ["poor", "good"])
    assert few.planners == ("poor", "good")
    whole = compare_success(paired, [(0, 2)])[0]
    part = compare_success(few, [(1, 0)])[0]
    assert repr(whole) == repr(part)


def test_a_run_that_is_not_certified_is_no_success():
    columns = made_up_columns({"a": Skill(1.0)}, worlds=3, seeds=1)
    columns["certified"] = [True, False, None]
    assert RunTable(columns).success.tolist() == [True, False, True]


@pytest.mark.slow
def test_equal_planners_are_rarely_called_different():
    """Worlds differ much in difficulty; no more than 5 % (and chance) of comparisons of equal planners decide."""
    called = 0
    for k in range(60):
        runs = made_up_runs({"a": Skill(0.6, 1.1), "b": Skill(0.6, 1.1)}, 15, 6, spread=0.4, rng_seed=k)
        called += bool(compare_success(PairedRuns.of(runs), [(0, 1)])[0].better)
    assert called <= 0.05 * 60 + 2 * (0.05 * 0.95 * 60) ** 0.5


@pytest.fixture(scope="module")
def three():
    return PairedRuns.of(made_up_runs({"a": Skill(0.9, 1.0), "b": Skill(0.9, 1.0), "c": Skill(0.5, 1.3)}, 40, 4))


def test_the_verdict_turns_at_the_end_of_the_interval(three):
    for measure, better in (("success", "higher"), ("duration_s", "lower")):
        rows = not_worse(three, "a", measure, 0.1, better)
        assert [(row.planner, row.reference) for row in rows] == [("b", "a"), ("c", "a")]
        end = -rows[0].interval.low
        assert [not_worse(three, "a", measure, end * by, better)[0].not_worse for by in (0.999, 1.001)] == [False, True]
        assert rows[1].advantage < 0, "c is worse, whatever direction is better"
        assert not rows[1].not_worse


def test_one_planner_alone_has_the_interval_of_the_comparison(three):
    two = PairedRuns.of(three.table, ["b", "a"])
    assert not_worse(two, "a", "success", 0.1, "higher")[0].interval == compare_success(two, [(0, 1)])[0].interval
    plain = compare_metric(two, [(0, 1)], "duration_s", "lower")[0]
    assert not_worse(two, "a", "duration_s", 1, "higher")[0].interval == plain.interval
    three = not_worse(three, "a", "success", 0.1, "higher")[0].interval
    assert three.low < plain.interval.low or three.low < compare_success(two, [(0, 1)])[0].interval.low, "two tests"


def test_needed_worlds_are_those_of_statsmodels_and_of_wilson():
    from statsmodels.stats.power import normal_sample_size_one_tail

    means = np.random.default_rng(1).normal(0, 0.2, 50)
    known = normal_sample_size_one_tail(0.05, 0.8, 0.025 / 3, std_null=float(np.std(means, ddof=1)))
    assert _needed(means, 0.05, 0.05 / 3, success=False) == math.ceil(known)
    n = _needed(np.zeros(9), 0.02, 0.05, success=True)
    z2 = 1.959963984540054**2
    assert z2 / (n + z2) <= 0.02 < z2 / (n - 1 + z2)


VALUES = [0.0, 1.0, 2.5, None, True, "a,b", "forest", "10"]


@pytest.mark.parametrize(
    ("wanted", "rows"),
    [
        ("0", [0]), ("1.0", [1]), ("0,1", [0, 1]), ("0.5..2.5", [1, 2]), ("1..", [1, 2]), ("..1", [0, 1]), ("..", []),
        ("none", [3]), ("true", [4]), ("True", [4]), ("false", []), ("a,b", [5]), ("forest,a,b", [6]), ("10", [7]),
        ("0..0,forest", [0, 6]), ("x..y", []),
    ],
)  # fmt: skip
def test_values_lists_and_ranges_are_taken(wanted, rows):
    assert matching(VALUES, wanted) == rows


def test_values_are_described_shortly():
    assert described([0.0, 1.5, None, True, "x"]) == "0, 1.5, none, true, x"
    assert described([k / 3 for k in range(40)]) == "0 to 13"
    assert described([f"w{k}" for k in range(23)]).endswith("w19 and 3 more")


def test_a_table_takes_some_of_its_runs():
    table = RunTable(made_up_columns({"a": Skill(), "b": Skill()}, worlds=3, seeds=4))
    assert len(table.where("seed", "1,2").where("world", "world-001")) == 4
    assert len(table.of_planners(["b"])) == 12


def test_every_column_that_describes_a_run_is_paired_by():
    from antdrive.runs.campaigns.rows import GRID

    names = {"key", "planner", "planner_name", "planner_version", "options", "seed", "command", "area_m2"}
    assert set(GRID) - names <= {*PLACE, *CONFIGURATION}


def campaign(*planners, rng_seed=1, **words):
    return made_up_columns(dict.fromkeys(planners, Skill(0.8)), worlds=6, seeds=3, rng_seed=rng_seed, **words)


def test_planners_of_two_campaigns_are_paired():
    both = merged({"may": RunTable(campaign("a")), "june": RunTable(campaign("b", rng_seed=2))})
    paired = PairedRuns.of(both)
    assert (paired.planners, both.texts("folder")) == (("a", "b"), ["may"] * 18 + ["june"] * 18)
    assert compare_success(paired, pairs_of(paired))[0].pairs == 18


def test_a_planner_of_two_campaigns_is_told_apart_by_them():
    both = merged({"may": RunTable(campaign("a", "b")), "june": RunTable(campaign("a", rng_seed=2))})
    paired = PairedRuns.of(both)
    assert paired.planners == ("a @may", "b", "a @june")
    assert set(both.texts("planner_name")) == {"a", "b"}
    assert [row.pairs for row in compare_success(paired, pairs_of(paired))] == [18, 18, 18]


def test_parts_of_one_grid_are_one_planner():
    later = campaign("a", "b", rng_seed=2)
    later["seed"] = [seed + 3 for seed in later["seed"]]
    paired = PairedRuns.of(merged({"one": RunTable(campaign("a", "b")), "two": RunTable(later)}))
    assert paired.planners == ("a", "b")
    assert compare_success(paired, pairs_of(paired))[0].pairs == 36


def test_one_table_is_left_as_it_is():
    table = RunTable(campaign("a"))
    assert merged({"may": table}) is table


def table(worlds=12, seeds=4, *, lidars=False):
    """Drives without the map take 1.5 times as long on 1.2 times the way, in the mean, more or less by world."""
    rng = np.random.default_rng(3)
    rows = []
    for w in range(worlds):
        hard = math.exp(0.1 * (w - (worlds - 1) / 2))
        for s in range(seeds):
            time = float(rng.uniform(5, 9))
            drives = (("given", "a", time, 10.0), ("none", "b" if lidars else "a", 1.5 * hard * time, 12.0))
            for kind, robot, arrival, length in drives:
                rows.append(
                    {
                        "world": f"w{w}", "world_hash": f"h{w}", "task": "own", "planner": "astar", "robot": robot,
                        "robot_hash": robot, "noise": 1.0, "map": kind, "seed": s, "outcome": "succeeded", "succeeded": True,
                        "localisation": "matching" if kind == "none" else "fixes", "odometry": 1.0,
                        "arrival_s": arrival, "driven_length_m": length,
                    }
                )  # fmt: skip
    return {name: [row[name] for row in rows] for name in rows[0]}


def test_the_mean_ratio_is_geometric_and_its_interval_is_over_worlds():
    (price,) = prices(RunTable(table()))
    assert (price.planner, price.robot, price.localisation, price.odometry) == ("astar", "a", "matching", 1.0)
    assert (price.pairs, price.worlds, price.lost, price.won, price.unpaired) == (48, 12, 0, 0, 0)
    assert price.time.mean == pytest.approx(1.5)
    assert price.time.most == pytest.approx(1.5 * math.exp(0.55))
    assert price.time.low < 1.35 < 1.65 < price.time.high  # ratios differ between worlds by a factor of 3
    assert price.length == pytest.approx([1.2] * 4)
    assert "time x 1.500" in price.sentence
    assert price.as_dict()["length"]["low"] == pytest.approx(1.2)


def test_failures_and_lonely_drives_are_counted_and_left_out():
    columns = table()
    columns["succeeded"][1] = False  # without the map
    columns["succeeded"][2] = False  # with it
    columns["seed"][4] = 99  # its partner has another seed
    (price,) = prices(RunTable(columns))
    assert (price.pairs, price.lost, price.won, price.unpaired) == (45, 1, 1, 1)


def test_another_lidar_is_another_robot_unless_it_may_be():
    columns = table(lidars=True)
    (price,) = prices(RunTable(columns))
    assert (price.pairs, price.unpaired) == (0, 48)
    assert price.as_dict()["time"] == dict.fromkeys(("mean", "low", "high", "most"))
    assert "no pair" in price.sentence
    (price,) = prices(RunTable(columns), any_robot=True)
    assert price.pairs == 48


def test_each_kind_of_drive_has_its_own_price():
    columns = table()
    none = [k for k, kind in enumerate(columns["map"]) if kind == "none"]
    twice = {name: [*values, *(values[k] for k in none)] for name, values in columns.items()}
    twice["odometry"][len(columns["map"]) :] = [5.0] * 48
    assert [price.odometry for price in prices(RunTable(twice))] == [1.0, 5.0]
    assert prices(RunTable({name: values for name, values in columns.items() if name != "map"})) == []
