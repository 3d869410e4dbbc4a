"""Claims and their verdicts, on synthetic runs with a known answer."""

import dataclasses
import heapq
import itertools
import math
from functools import partial
from types import SimpleNamespace

import numpy as np
import pytest

from antdrive.base.errors import FieldError
from antdrive.planners import PLANNERS, History, PlannerError, Query
from antdrive.planners.colonies.mmas_dstar import closed_gates
from antdrive.runs.papers import maps, reproduction
from antdrive.runs.papers.claims import (
    CLAIMS,
    FEWEST,
    RELATIONS,
    STATISTICS,
    TIMED,
    Arm,
    Claim,
    Decision,
    _claim,
    evaluate,
    runs_needed,
    verdict_facts,
)
from antdrive.runs.papers.experiment import Experiment
from antdrive.runs.papers.experiments import PAPERS
from antdrive.runs.papers.lee2008 import placement
from antdrive.runs.papers.maps import (
    HASAN,
    TWO_WALLS,
    MoveCount,
    candidate,
    closing_gates,
    environment,
    environments,
    optimum,
    separate_obstacles,
    winding_candidate,
)
from antdrive.runs.papers.paper_runs import (
    TURNS,
    FirstTouchDStar,
    PaperRun,
    Strollers,
    concentration,
    drive,
    drive_among,
    interleaved,
    limits,
    solve,
    total_cost,
)
from antdrive.runs.papers.reproduction import load_runs, runs_key, save_runs, too_few_seeds
from antdrive.worlds import DIRECTIONS, Grid

ONE, TWO = Arm("m", "one"), Arm("m", "two")


def runs(values, worlds=0):
    """Runs whose gap is the value; nan: no path."""
    made = []
    for seed, value in enumerate(values):
        solved = not math.isnan(value)
        result = SimpleNamespace(solved=solved, line_length=100.0 + value if solved else math.inf)
        made.append(PaperRun(seed, seed % worlds if worlds else seed, result, 100.0, 0.1, 0.0))
    return made


def claim(statistic, relation, bound=0.0, *, maps=1, **facts):
    """A claim on arms ONE and TWO, or on ONE alone where the statistic is of a single planner."""
    arms = (ONE,) if statistic in ("median", "mean", "arrived", "failed") else (ONE, TWO)
    facts = {"cases": (arms,) * maps, **facts}
    words = {"paper": "lee2008", "id": "L1", "kind": "claim", "source": "s", "sentence": "x", "printed": "p"}
    return Claim(statistic=statistic, relation=relation, bound=bound, **{**words, **facts})


LESS, NO_MORE = claim("difference", "<"), claim("difference", "<=")
#: The margin of "no longer than" [points]: a small effect, A = 0.56 (Vargha & Delaney 2000), wins 56 : 44.
SMALL_EFFECT = 12.0
OFTENER, NO_WORSE, WIDER = claim("balance", "<"), claim("balance", "<=", SMALL_EFFECT), claim("scatter", ">")


def verdict(test, first, second=(), worlds=0):
    return evaluate(test, {ONE: runs(first, worlds), TWO: runs(second, worlds)})


def test_every_claim_names_experiments_of_its_paper():
    for paper, experiments in PAPERS.items():
        known = {Arm(e.map, e.name) for e in experiments() if e.name != "steps"}
        claims = [one for one in CLAIMS if one.paper == paper]
        assert claims
        for one in claims:
            assert one.arms <= known, one.sentence
            assert one.printed
            assert one.statistic in STATISTICS
            assert one.relation in RELATIONS
            quantities = {*dir(PaperRun), *PaperRun.__dataclass_fields__, ""}
            assert quantities >= {*one.quantity}
        for experiment in experiments():
            assert len(experiment.seeds(7)) == min(7 * experiment.rounds, experiment.most_seeds)
        for one in claims:
            if TIMED in one.quantity:  # times are compared within a group only
                groups = {Arm(e.map, e.name): e.group for e in experiments()}
                assert all(groups[first] == groups[second] != "" for first, second in one.cases), one.reading
        texts = [(one.sentence, one.reading) for one in claims]
        assert len(set(texts)) == len(texts)
        names = [(e.map, e.name) for e in experiments()]
        assert len(set(names)) == len(names)


@pytest.mark.parametrize(("shift", "decision"), [(-2.0, Decision.HOLDS), (2.0, Decision.REFUTED), (0.0, Decision.OPEN)])
def test_less_is_decided_by_the_interval_of_the_paired_difference(shift, decision):
    rng = np.random.default_rng(1)
    second = rng.uniform(5, 9, 50)
    first = second + shift + np.resize([-1.0, 1.0], 50) * rng.uniform(0.1, 1, 50)
    found = verdict(LESS, first, second)
    assert found.decision is decision
    assert found.low <= found.value <= found.high
    assert found.value == pytest.approx(np.median(first - second))


HOLDS, REFUTED, OPEN = Decision.HOLDS, Decision.REFUTED, Decision.OPEN
SAME, NONE, MOST = np.full(20, 3.0), np.full(20, math.nan), np.resize([math.nan, *[1.0] * 49], 50)
RARELY = np.resize([1.0, *[math.nan] * 24], 50)
LIMITED, WITHIN, CENTRED = claim("difference", "<=", 1.0), claim("median", "<=", 10.0), np.linspace(-0.5, 0.5, 50)
CALM, WILD = np.random.default_rng(0).uniform(4, 6, 50), np.random.default_rng(1).uniform(0, 40, 50)
MEANS = {bound: claim("mean", "about", bound, quantity=("length",)) for bound in (101.0, 105.2, 120.0)}


def pairs(longer, shorter, of=200):
    """Values whose pairs with zeros are above in `longer` and below in `shorter` cases."""
    return np.r_[np.ones(longer), -np.ones(shorter), np.zeros(of - longer - shorter)]


@pytest.mark.parametrize(
    ("test", "first", "second", "decision", "words"),
    [
        # An interval that touches the bound neither confirms nor refutes "less".
        (LESS, SAME, SAME, OPEN, "the interval touches 0"), (LESS, SAME + 1e-6, SAME, REFUTED, ""),
        (NO_MORE, SAME, SAME, HOLDS, ""),
        (LIMITED, SAME + 1.0, SAME, HOLDS, ""), (LIMITED, SAME + 1.1, SAME, REFUTED, ""),
        # A path is less than none.
        (LESS, SAME, NONE, HOLDS, ""), (LESS, NONE, SAME, REFUTED, ""),
        *((test, NONE, NONE, OPEN, "neither ever reaches it") for test in (NO_MORE, OFTENER, NO_WORSE)),
        # "Oftener" counts pairs, also where the median difference is 0; "no worse" lets a small effect pass.
        (OFTENER, pairs(0, 16, 40), np.zeros(40), HOLDS, "below in 16 of 40 pairs, above in 0: -40 points"),
        (OFTENER, pairs(16, 0, 40), np.zeros(40), REFUTED, ""), (OFTENER, SAME, SAME, OPEN, ""),
        (OFTENER, pairs(20, 20, 40), np.zeros(40), OPEN, ""), (NO_WORSE, pairs(0, 0), np.zeros(200), HOLDS, ""),
        (NO_WORSE, pairs(20, 20), np.zeros(200), HOLDS, ""), (NO_WORSE, pairs(8, 0), np.zeros(200), HOLDS, "+4 points"),
        (NO_WORSE, pairs(70, 10), np.zeros(200), REFUTED, "+30 points"),
        (NO_WORSE, pairs(40, 12), np.zeros(200), OPEN, "contains 12; the difference is small beside the spread"),
        # One planner.
        (WITHIN, np.linspace(4, 8, 30), (), HOLDS, ""), (WITHIN, np.linspace(14, 18, 30), (), REFUTED, ""),
        (WITHIN, np.linspace(5, 15, 30), (), OPEN, ""), (WITHIN, np.linspace(4, 8, 5), (), OPEN, ""),
        (WITHIN, NONE, (), REFUTED, "no path"),
        (MEANS[101.0], CENTRED, (), HOLDS, ""), (MEANS[120.0], CENTRED, (), REFUTED, ""),
        (MEANS[105.2], CENTRED, (), OPEN, ""),
        (MEANS[101.0], NONE, (), OPEN, ""),
        # Arrivals are judged by Wilson's interval; one failure confirms that a planner may fail, none does not refute it.
        (claim("arrived", "<=", 0.2), RARELY, (), HOLDS, "2/50"), (claim("arrived", "<=", 0.2), MOST, (), REFUTED, ""),
        (claim("arrived", ">=", 0.8), MOST, (), HOLDS, ""), (claim("arrived", ">=", 0.97), MOST, (), OPEN, ""),
        (claim("failed", ">"), MOST, (), HOLDS, ""), (claim("failed", ">"), SAME, (), OPEN, "but others may"),
        # The scatter is the range between quartiles; cases are counted.
        (WIDER, WILD, CALM, HOLDS, ""), (WIDER, CALM, WILD, REFUTED, ""), (WIDER, CALM, CALM, OPEN, ""),
        (claim("wins", ">=", 2, maps=2), [1.0], [2.0], HOLDS, ""),
        (claim("wins", ">=", 2, maps=2), [2.0], [2.0], REFUTED, ""),
    ],
)  # fmt: skip
def test_a_verdict_follows_from_the_interval_of_its_statistic(test, first, second, decision, words):
    found = verdict(test, first, second)
    assert found.decision is decision
    assert words in f"{found.ours}; {found.why}"
    assert verdict_facts(found)["verdict"] == decision.value


def test_a_margin_or_threshold_that_no_paper_prints_is_called_ours():
    for one in CLAIMS:
        test, needs = (one.statistic, one.relation), []
        if test == ("balance", "<="):
            needs.append(f"margin ours: {SMALL_EFFECT:g} points")
            assert one.bound == SMALL_EFFECT
        if one.statistic == "difference" and one.bound:
            needs.append("margin ours" if one.bound != 2.3853 else "the margin is the printed difference")
        if one.statistic == "mean" or (one.statistic == "median" and one.bound):
            needs.append("margin ours")
        if one.statistic == "arrived" or {"near", "effort"} & {*one.quantity}:
            needs.append("threshold ours")
        assert all(words in one.remark for words in needs), (one.sentence, one.remark)


def test_a_ratio_compares_planners_on_maps_of_their_own():
    row = {"maps": "large / small", "planners": "a | a", "quantity": "gap", "bound": "2", "statistic": "ratio"}
    words = {
        "id": "I1",
        "kind": "claim",
        "source": "s",
        "sentence": "x",
        "reading": "ours",
        "printed": "p",
        "remark": "",
    }
    grows = _claim("ibraheem2016", {**row, **words, "relation": ">"})
    assert grows.cases == ((Arm("large", "a"), Arm("small", "a")),)
    small = np.random.default_rng(4).uniform(5, 9, 20)
    found = evaluate(grows, {Arm("large", "a"): runs(3 * small), Arm("small", "a"): runs(small)})
    assert found.decision is Decision.HOLDS
    assert found.value == pytest.approx(3.0)


def test_the_gain_of_one_step_is_less_than_that_of_another():
    rng = np.random.default_rng(2)
    low, middle, high = (value + rng.normal(0, 1, 50) for value in (36.0, 39.0, 46.0))
    arms = {Arm("m", name): runs(values) for name, values in zip("abc", (high, middle, low), strict=True)}
    a, b, c = arms
    gained = claim("gain", "<", quantity=("length",), cases=((b, c, a, b),))
    found = evaluate(gained, arms)
    assert found.decision is Decision.HOLDS
    assert found.value == pytest.approx(-4.0, abs=0.8)  # gains of 3 and 7
    assert gained.arms == set(arms)
    turned = dataclasses.replace(gained, cases=((a, b, b, c),))
    assert evaluate(turned, arms).decision is Decision.REFUTED


def test_several_means_are_those_printed_only_if_each_is():
    rng = np.random.default_rng(2)
    known = {Arm("m", name): runs(rng.normal(value, 0.5, 50) - 100) for name, value in zip("ab", (40, 30), strict=True)}
    near = claim("means", "about", 1.0, quantity=("length",), cases=(tuple(known),), printed="41, 30")
    found = evaluate(near, known)
    assert found.decision is Decision.HOLDS
    assert found.ours.startswith("means 40.")
    assert found.value == pytest.approx(40 / 41, abs=0.01)  # the mean farthest off
    assert evaluate(dataclasses.replace(near, printed="40, 34"), known).decision is Decision.REFUTED
    assert evaluate(dataclasses.replace(near, printed="40, 28.6"), known).decision is Decision.OPEN


def test_a_case_may_compare_two_maps():
    row = dict.fromkeys(("id", "kind", "source", "sentence", "printed", "statistic", "relation"), "x")
    made = _claim("han2007", {**row, "maps": "m / n | k", "planners": "a | b", "quantity": "work", "bound": "0"})
    assert made.cases == ((Arm("m", "a"), Arm("n", "b")), (Arm("k", "a"), Arm("k", "b")))


def test_two_quantities_of_the_same_runs_are_compared():
    rng = np.random.default_rng(3)
    made = []
    for seed in range(20):
        best = 100 + np.r_[rng.normal(0, 5, 10), rng.normal(0, 1, 30)]
        result = SimpleNamespace(solved=True, line_length=100.0, history=SimpleNamespace(iteration_best=best))
        made.append(PaperRun(seed, 0, result, 100.0, 0.1, 0.0))
    settles = claim("difference", "<", quantity=("unrest", "early_unrest"), cases=((ONE, ONE),))
    assert evaluate(settles, {ONE: made}).decision is Decision.HOLDS
    back = dataclasses.replace(settles, quantity=("early_unrest", "unrest"))
    assert evaluate(back, {ONE: made}).decision is Decision.REFUTED


def test_an_open_verdict_says_why():
    few = verdict(LESS, np.zeros(5), np.ones(5))
    assert few.decision is Decision.OPEN
    assert few.why.startswith("5 runs, but an interval needs at least 6")
    # 0.2 below the margin, with an interval of about a half to each side: some six times as many.
    wide = verdict(LESS, np.linspace(-1.2, 0.8, 21), np.zeros(21))
    assert wide.decision is Decision.OPEN
    factor = float(wide.why.split("about ")[1].split(" times")[0])
    assert factor == pytest.approx(((wide.high - wide.value) / 0.2) ** 2, rel=0.1)
    short = verdict(claim("arrived", ">=", 0.9), np.ones(20))
    assert short.decision is Decision.OPEN
    assert "20 runs, but the interval needs at least 35" in short.why


def test_the_trials_that_a_test_needs_are_the_fewest_with_which_it_can_hold():
    test = claim("arrived", ">=", 0.9)
    needed = runs_needed(test)
    assert needed == 35  # n / (n + 1.96^2) reaches 0.9
    assert verdict(test, np.ones(needed)).decision is Decision.HOLDS
    assert verdict(test, np.ones(needed - 1)).decision is Decision.OPEN
    assert runs_needed(LESS) == FEWEST
    assert verdict(LESS, np.zeros(FEWEST), np.ones(FEWEST)).decision is Decision.HOLDS
    assert runs_needed(claim("wins", ">=", 1)) == 1


def test_seeds_that_are_too_few_are_told_of_in_one_line():
    assert too_few_seeds(["suganthi2019"], 50) == ""
    line = too_few_seeds(["suganthi2019"], 3)
    assert line.startswith("seeds: 3 are too few to decide ")
    assert line.endswith("claims; use 35")
    assert "\n" not in line
    assert too_few_seeds(["han2007"], 35) == ""
    assert "use 35" in too_few_seeds(["han2007"], 34)
    assert too_few_seeds(["lee2008"], 6, quick=True) == ""


def test_runs_of_one_map_do_not_count_as_maps():
    rng = np.random.default_rng(0)
    by_map = np.array([-1.0, 2.0, -1.5, 1.0, -0.5])
    first = np.resize(by_map, 100) + rng.normal(0, 0.01, 100)
    second = np.zeros(100)
    apart = verdict(LESS, first, second)
    together = verdict(LESS, first, second, worlds=5)
    assert together.high - together.low >= apart.high - apart.low
    assert together.decision is Decision.OPEN


def timed(*times):
    """Runs with these processor times [s]."""
    return [PaperRun(seed, seed, SimpleNamespace(solved=True), 100.0, cpu, 0.0) for seed, cpu in enumerate(times)]


@pytest.mark.parametrize(
    ("factors", "decision", "ours"),
    [
        ((0.8, 0.9, 0.7), Decision.HOLDS, "less in 3 of 3, equal in 0, more in 0"),
        ((0.8, 0.9, 1.0), Decision.OPEN, "less in 2 of 3, equal in 0, more in 0"),  # the third could tip it
        ((0.8, 0.9, 1.2), Decision.REFUTED, "less in 2 of 3, equal in 0, more in 1"),
        ((0.8, 1.0, 1.2), Decision.REFUTED, "less in 1 of 3, equal in 0, more in 1"),  # the second could not
    ],
)
def test_times_are_decided_case_by_case_by_the_interval_of_paired_ratios(factors, decision, ours):
    """Times of seeds differ tenfold, times of a pair by the factor and 5 % of noise: unpaired medians would tell nothing."""
    rng, arms, cases = np.random.default_rng(4), {}, []
    for k, factor in enumerate(factors):
        second = rng.uniform(0.1, 1.0, 40)
        noise = 1 + np.resize([-0.05, 0.05], 40) * rng.uniform(0.1, 1.0, 40)
        case = Arm(str(k), "one"), Arm(str(k), "two")
        arms |= dict(zip(case, (timed(*(second * factor * noise)), timed(*second)), strict=True))
        cases.append(case)
    faster = claim("wins of ratios", ">=", 3, quantity=("cpu_ms",), cases=tuple(cases))
    found = evaluate(faster, arms)
    assert (found.decision, found.ours) == (decision, ours)
    few = evaluate(faster, {arm: times[:5] for arm, times in arms.items()})
    assert few.decision is Decision.OPEN


def test_a_ratio_counts_a_missing_path_as_infinitely_long():
    none, all_of = np.full(20, math.nan), np.full(20, 5.0)
    shorter = claim("wins of ratios", ">=", 1, quantity=("length",))
    assert verdict(shorter, all_of, none).decision is Decision.HOLDS
    assert verdict(shorter, none, all_of).decision is Decision.REFUTED
    assert "∞" in verdict(shorter, none, all_of).why
    assert verdict(shorter, none, none).decision is Decision.REFUTED  # no case is below
    equal = verdict(shorter, all_of, all_of)
    assert (equal.decision, equal.ours) == (Decision.REFUTED, "less in 0 of 1, equal in 1, more in 0")
    touching = verdict(shorter, all_of + np.resize([0.0, 1.0, 0.0], 20), all_of)  # its interval begins at 1
    assert (touching.decision, touching.low, touching.high) == (Decision.OPEN, 0, 1)


def test_arms_that_are_timed_together_bear_a_drift_alike():
    """A machine that gets slower from call to call: equal work takes equal times, although each call takes longer."""
    for arms in (2, 3):
        clock, order = itertools.count(1), []

        def call(name, clock=clock, order=order):
            order.append(name)
            return PaperRun(name, 0, None, 1.0, float(next(clock)), 0.0)

        found = interleaved([partial(call, name) for name in range(arms)])
        assert [run.seed for run in found] == list(range(arms))
        assert order[: 2 * arms] == [*range(arms), *reversed(range(arms))]
        assert len({run.cpu_s for run in found}) == 1
        assert len(order) == arms * TURNS
    assert interleaved([lambda: PaperRun(7, 0, None, 1.0, 3.0, 0.0)])[0].cpu_s == 3.0


def test_moves_that_can_be_monotone():
    assert MoveCount(6, 16).monotone(19, 19)
    assert MoveCount(43, 57).monotone(99, 58)
    assert not MoveCount(24, 51).monotone(49, 49)  # more diagonal moves than rows
    assert not MoveCount(14, 32).monotone(24, 24)


def test_a_candidate_has_the_length_asked_for_and_depends_on_the_seed_alone():
    moves = MoveCount(6, 16)
    made = candidate.__wrapped__  # without its cache
    one, same, other = (made((20, 20), (0, 0), (19, 19), moves, seed, blocked=0.15) for seed in (1, 1, 2))
    for query in (one, other):
        assert optimum(query) == pytest.approx(moves.length)
        assert query.grid.free[:2, :2].all()
    assert (one.grid.free == same.grid.free).all()
    assert (one.grid.free != other.grid.free).any()


def test_a_candidate_has_the_obstacles_asked_for_away_from_its_ends():
    query = candidate((20, 20), (0, 0), (19, 19), MoveCount(6, 16), 1, blocks=10, largest=4, margin=2, obstacles=10)
    assert query.grid.free[:3, :3].all()
    assert query.grid.free[-3:, -3:].all()
    assert separate_obstacles(query.grid.free) == 10


def test_obstacles_that_touch_by_a_corner_are_one():
    picture = ["#.#.", ".#.#", "....", "#..#"]
    assert separate_obstacles(np.array([[cell == "." for cell in row] for row in picture])) == 3


def test_a_winding_candidate_has_the_moves_asked_for_and_turns_back_in_rows_and_columns():
    moves = MoveCount(14, 32)  # lee2008's map 1: 78 cells over rows and columns, of which the map has 24 + 24
    for seed in (101, 102):
        query = winding_candidate((25, 25), moves, seed, largest=6)
        steps = np.diff(PLANNERS["astar"].plan(query, np.random.default_rng(0)).cells, axis=0)
        diagonal = int((np.abs(steps).sum(axis=1) == 2).sum())
        assert (len(steps) - diagonal, diagonal) == (14, 32)
        assert (steps.min(axis=0) == -1).all()
        assert (steps.max(axis=0) == 1).all()
        same = winding_candidate((25, 25), moves, seed, largest=6)
        assert (same.grid.free == query.grid.free).all()
        assert (same.start, same.goal) == (query.start, query.goal)


def test_the_arms_of_a_group_are_kept_in_one_file_and_run_again_together(tmp_path, monkeypatch):
    """Else times of different calls could be compared, where one was interrupted between two arms."""
    query = Query(Grid.from_free(np.ones((4, 4))), (0, 0), (3, 3))
    common = {"paper": "hasan", "map": "m", "query": lambda seed: query, "printed": None}
    alone = Experiment(**common, planner="astar", label="alone")
    arms = [Experiment(**common, planner=name, group="g") for name in ("dstar", "mmas-dstar")]
    monkeypatch.setattr(reproduction, "PAPERS", {"hasan": lambda: [arms[0], alone, arms[1]]})
    first = reproduction.reproduce(["hasan"], tmp_path, seeds=3)
    assert [(e.name, len(runs)) for e, runs in first.measured] == [("dstar", 3), ("alone", 3), ("mmas-dstar", 3)]
    assert sorted(path.name for path in (tmp_path / "trials").iterdir()) == [
        "hasan-m-alone.json.gz",
        "hasan-m-g.json.gz",
    ]
    again = reproduction.reproduce(["hasan"], tmp_path, seeds=3)
    assert again.kept == 3
    works = [solve(e.planner, {}, query, 0).work for e, _ in first.measured]
    assert works[0] != works[2]
    for one in (first, again):  # each arm has its own runs
        assert [runs[-1].work for _, runs in one.measured] == works
    times = [[[run.cpu_s for run in runs] for _, runs in one.measured] for one in (first, again)]
    assert times[0] == times[1]
    arms[1] = dataclasses.replace(arms[1], options={"alpha": 2.0})  # the other arm is timed again, too
    assert reproduction.reproduce(["hasan"], tmp_path, seeds=3).kept == 1


def test_trials_are_kept_in_a_file_with_all_their_quantities(tmp_path):
    kinds = (("14 obstacles", "10 ants"), ("one obstacle of radius 5", "3 via points"))
    one, other = (e for e in PAPERS["han2007"]() if (e.map, e.name) in kinds)
    shut = Query(Grid.from_free(np.eye(3)), (0, 0), (2, 0))  # a run without a path, and one without iterations
    cases = [
        (one.planner, {**one.options, "iterations": 3}, one.query(0)),
        (other.planner, {**other.options, "iterations": 3}, other.query(0)),
        ("astar", {}, one.query(0)),
        ("astar", {}, shut),
    ]
    made = [solve(planner, options, query, 3) for planner, options, query in cases]
    path, key = tmp_path / "t.json.gz", runs_key(one, 4)
    save_runs(made, path, key)
    read = load_runs(path, key)
    quantities = (
        "length", "gap", "steps", "last", "settled", "near", "effort", "unrest", "early_unrest", "work", "cpu_s",
        "total",
    )  # fmt: skip
    for before, after in zip(made, read, strict=True):
        for name in ("seed", "world", "optimum", "concentration", "ants", *quantities):
            np.testing.assert_equal(getattr(after, name), getattr(before, name), err_msg=name)
        np.testing.assert_array_equal(after.result.line, before.result.line)
        assert after.result.status is before.result.status
    assert load_runs(path, runs_key(one, 5)) is None
    for changed in ({"options": {"ants": 11}}, {"movers": 1}, {"enter": True}, {"on_path": True}):
        assert load_runs(path, runs_key(dataclasses.replace(one, **changed), 4)) is None
    path.write_bytes(path.read_bytes()[:-200])
    assert load_runs(path, key) is None
    assert load_runs(tmp_path / "none.json.gz", key) is None


def test_a_length_that_no_map_has_is_refused(monkeypatch):
    monkeypatch.setattr(maps, "MAPS", 3)
    with pytest.raises(FieldError, match="no map of 3 x 3 cells"):
        candidate((3, 3), (0, 0), (2, 2), MoveCount(9, 9), 0)


def test_a_plan_ends_with_the_iteration_that_uses_up_its_ant_steps():
    query = candidate((20, 20), (0, 0), (19, 19), MoveCount(6, 16), 1, blocked=0.15)
    whole = solve("as", {"iterations": 40}, query, 3)
    part = solve("as", {"iterations": 40}, query, 3, work=whole.work / 2)
    assert whole.work / 2 <= part.work < whole.work
    count = len(part.result.history)
    np.testing.assert_array_equal(part.result.history.best, whole.result.history.best[:count])
    with pytest.raises(FieldError, match="plans at once"):
        solve("astar", {}, query, 3, work=10.0)


def test_the_length_at_the_limit_of_work_lies_between_those_of_two_iterations():
    best = np.array([math.inf, 130.0, 120.0])
    spent = np.array([10, 40, 80])
    assert limits(60.0, spent, best, 100.0) == (125.0, 60.0)  # within 25 % only in the iteration that the limit cuts
    assert limits(80.0, spent, best, 110.0) == (120.0, 40.0)
    assert limits(30.0, spent[:2], best[:2], 100.0) == (130.0, math.inf)  # the first path counts in full
    assert limits(9.0, spent[:1], best[:1], 100.0) == (math.inf, math.inf)
    run = PaperRun(0, 0, SimpleNamespace(), 100.0, 0.1, 0.0, even=125.0, close=60.0)
    assert (run.even_gap, run.effort) == (pytest.approx(25.0), 60.0)


def test_placements_are_those_of_monotone_paths_with_the_printed_moves():
    shape, moves = (20, 30), MoveCount(2, 10)
    drawn = [placement(shape, moves, np.random.default_rng(seed)) for seed in range(300)]
    for ends in drawn:
        for row, col in ends:
            assert 0 <= row < 20
            assert 0 <= col < 30
        assert moves.monotone(*(abs(a - b) for a, b in zip(*ends, strict=True)))
    assert {(b[0] > a[0], b[1] > a[1]) for a, b in drawn} == {(x, y) for x in (False, True) for y in (False, True)}
    assert len({start for start, _ in drawn}) > 100


def test_the_quantities_of_a_trial_are_those_worked_out_by_hand():
    best = np.array([math.inf, 150.0, 124.0, 110.0, 110.0])
    history = History(best, np.array([9.0, 9.0, 9.0, 4.0, 6.0]), best, np.ones(5, dtype=np.int64))
    result = SimpleNamespace(solved=True, history=history, work=50, line_length=110.0)
    run = PaperRun(0, 0, result, 100.0, 0.1, 0.0)
    assert (run.effort, run.settled, run.gap) == (30.0, 4.0, pytest.approx(10.0))
    assert run.near == run.reached == math.inf
    assert dataclasses.replace(run, optimum=run.length).reached == 4.0
    assert dataclasses.replace(run, optimum=105.0).near == 4.0  # 110 is within 5 % of 105
    assert run.last == 6.0
    assert run.unrest == run.early_unrest == pytest.approx(np.std([9, 9, 9, 4, 6]))
    assert run.cpu_ms == 100.0
    assert dataclasses.replace(run, ants=4.0).share == 25.0
    none = dataclasses.replace(run, result=SimpleNamespace(solved=False, history=history, work=50))
    assert (none.length, none.gap, none.steps, none.settled) == (math.inf,) * 4


def test_the_total_cost_is_that_of_hasans_straight_row():
    # Table 1, 3c: 49 straight moves would cost 1 + 2 + ... + 49 = 1225; the paper prints 1238.6.
    query = environments()["3c vertical rows"]
    assert total_cost(query, PLANNERS["astar"].plan(query, np.random.default_rng(0))) == pytest.approx(1225.0)
    diagonal = Query(Grid.from_free(np.ones((3, 3))), (0, 0), (2, 2))
    assert total_cost(diagonal, PLANNERS["astar"].plan(diagonal, np.random.default_rng(0))) == pytest.approx(1.4 + 2.8)


@pytest.mark.parametrize("order", ["distance", "cost"])
def test_a_dstar_that_keeps_first_costs_is_a_search_with_its_order_of_the_open_list(order):
    queries = [environment(name, 0) for name in list(HASAN)[1:]]
    longer = 0
    for query in queries:
        (goal, start), onward, cost = (query.goal, query.start), {query.goal: query.goal}, {query.goal: 0}
        queue = [(0, goal)]
        while start not in onward:
            _, (row, col) = heapq.heappop(queue)
            for k, (dr, dc) in enumerate(DIRECTIONS):
                near = (row + dr, col + dc)
                if int(query.grid.moves[row, col]) >> k & 1 and near not in onward:
                    onward[near], cost[near] = (row, col), cost[row, col] + (7 if dr and dc else 5)
                    key = cost[near] if order == "cost" else (near[0] - start[0]) ** 2 + (near[1] - start[1]) ** 2
                    heapq.heappush(queue, (key, near))
        cells = [start]
        while cells[-1] != goal:
            cells.append(onward[cells[-1]])
        plan = FirstTouchDStar(order=order).plan(query, np.random.default_rng(0))
        assert plan.cells.tolist() == [list(cell) for cell in cells]
        assert plan.work == len(onward)
        longer += plan.cost > 1.05 * optimum(query)
    assert (longer >= 3) == (order == "distance")
    shut = np.ones((3, 3))
    shut[1] = 0
    assert not FirstTouchDStar().plan(Query(Grid.from_free(shut), (0, 0), (2, 2)), np.random.default_rng(0)).solved


@pytest.mark.parametrize("name", list(HASAN)[1:])
def test_a_candidate_for_hasans_environment_has_the_printed_steps_and_no_more_gates(name):
    query, printed = environment(name, 1), HASAN[name]
    assert (query.start, query.goal) == printed.ends
    assert closed_gates(query)[1] <= printed.gates
    steps = len(PLANNERS["astar"].plan(closing_gates(query), np.random.default_rng(0)).cells) - 1
    assert abs(steps - printed.steps) <= 0.1 * printed.steps
    assert (environment(name, 2).grid.free != query.grid.free).any()


def test_hasans_gates_are_closed_for_every_planner():
    query = environments()["5f the same, across the wall"]
    moves, closed = closed_gates(query)
    gated = closing_gates(query)
    np.testing.assert_array_equal(gated.grid.moves, moves)
    assert closed == 28
    assert optimum(gated) > optimum(query)
    ant = {"alpha": 1.0, "beta": 0.0}
    same = [
        solve("mmas-dstar", {**ant, "gates": gates}, one, 0).total for gates, one in ((True, query), (False, gated))
    ]
    assert same[0] == same[1]


def test_the_concentration_is_the_share_of_the_field_on_the_path():
    field = np.array([[4.0, 1.0], [1.0, 2.0]])
    cells = np.array([[0, 0], [1, 1]])
    plan = SimpleNamespace(solved=True, field=field, cells=cells)
    assert concentration(plan) == pytest.approx(6 / 8)
    assert math.isnan(concentration(SimpleNamespace(solved=True, field=None, cells=cells)))


def test_a_drive_among_movers_depends_on_its_seed_alone():
    query = environments()["3c vertical rows"]
    one, same, other = (drive_among("dstar", {}, query, seed, 10) for seed in (3, 3, 4))
    assert one.result.solved
    np.testing.assert_array_equal(one.result.cells, same.result.cells)
    assert (one.total, one.work) == (same.total, same.work)
    assert one.work != other.work
    assert one.total >= 1225.0  # 49 straight moves, and what movers cost
    shut = np.ones((3, 9))
    shut[:, 4] = 0
    never = drive_among("dstar", {}, Query(Grid.from_free(shut), (0, 0), (2, 8)), 0, 1)
    assert (never.result.solved, never.total) == (False, math.inf)
    # A mover on the robot's path that may enter its cell ends some drives, and no other does.
    met = [
        drive_among("dstar", {}, query, seed, 5, on_path=True, enter=enter)
        for enter in (True, False)
        for seed in range(6)
    ]
    assert not all(run.result.solved for run in met[:6])
    assert all(run.result.solved for run in met[6:])


def test_a_robot_that_goes_into_a_mover_is_blamed():
    query = Query(Grid.from_free(np.ones((1, 4))), (0, 0), (0, 3))
    movers = Strollers(query.grid, 1, np.random.default_rng(0), ((0, 0), (0, 1), (0, 3)))

    class Blind:
        cell, arrived = (0, 0), False

        def step(self, blocked):
            self.cell = (0, 1) if self.cell == (0, 0) else (0, 2)
            return self.cell

    movers.step = lambda robot: None
    with pytest.raises(PlannerError, match=r"planner blind went from \(0, 1\) to \(0, 2\), into a mover"):
        drive(Blind(), query, movers, "blind")


def test_the_two_walls_let_no_line_with_one_bend_pass():
    """By sampling all lines over one via point finely, and a line over two of them."""
    discs = np.array(TWO_WALLS)

    def touches(*points):
        line = np.vstack([np.linspace(a, b, 400) for a, b in itertools.pairwise(points)])
        return bool((np.hypot(*(line[:, None] - discs[:, :2]).transpose(2, 0, 1)) < discs[:, 2]).any())

    for x in range(21):
        for y in range(21):
            assert touches((0, 0), (x, y), (20, 20))
    assert not touches((0, 0), (0, 18), (10, 18), (10, 2), (20, 2), (20, 20))
