"""Claims and their verdicts, on synthetic runs with a known answer."""

import dataclasses
import itertools
import math
from types import SimpleNamespace

import numpy as np
import pytest

from antdrive.base.errors import FieldError
from antdrive.planners import PLANNERS, History, PlannerError, Query
from antdrive.runs.papers import maps
from antdrive.runs.papers.claims import (
    CLAIMS,
    FEWEST,
    RELATIONS,
    SMALL_EFFECT,
    STATISTICS,
    Arm,
    Claim,
    Decision,
    evaluate,
    runs_needed,
    verdict_facts,
)
from antdrive.runs.papers.experiments import PAPERS
from antdrive.runs.papers.lee2008 import placement
from antdrive.runs.papers.maps import (
    TWO_WALLS,
    MoveCount,
    candidate,
    environments,
    move_counts,
    optimum,
    winding_candidate,
)
from antdrive.runs.papers.paper_runs import (
    FirstTouchDStar,
    PaperRun,
    Strollers,
    concentration,
    drive,
    drive_among,
    limits,
    solve,
    total_cost,
)
from antdrive.runs.papers.reproduction import load_runs, runs_key, save_runs, too_few_seeds
from antdrive.worlds import Grid

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
            assert len(experiment.seeds(7)) == 7 * experiment.rounds
            fewer = {"hasan": (20,), "lee2008": (12, 20, 50)}.get(paper, (50 * experiment.rounds,))
            assert len(experiment.seeds(50)) in fewer
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


def test_equal_values_refute_less_but_not_no_more():
    same = np.full(20, 3.0)
    assert verdict(LESS, same, same).decision is Decision.REFUTED
    assert verdict(NO_MORE, same, same).decision is Decision.HOLDS
    assert verdict(claim("difference", "<=", 1.0), same + 1.0, same).decision is Decision.HOLDS
    assert verdict(claim("difference", "<=", 1.0), same + 1.1, same).decision is Decision.REFUTED


def test_oftener_counts_pairs_where_the_median_difference_is_zero():
    same, other = np.zeros(40), np.r_[np.ones(16), np.zeros(24)]
    assert verdict(LESS, same, other).value == 0.0
    found = verdict(OFTENER, same, other)
    assert found.decision is Decision.HOLDS
    assert found.value == pytest.approx(-40.0)
    assert "below in 16 of 40 pairs, above in 0: -40 points" in found.ours
    assert verdict(OFTENER, other, same).decision is Decision.REFUTED
    assert verdict(OFTENER, same, same).decision is Decision.REFUTED
    both = np.resize([-1.0, 1.0], 40)
    assert verdict(OFTENER, both, np.zeros(40)).decision is Decision.OPEN


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


def test_no_worse_lets_a_small_effect_pass_and_no_larger_one():
    same = np.zeros(200)

    def share(longer, shorter):
        first = np.r_[np.ones(longer), -np.ones(shorter), np.zeros(200 - longer - shorter)]
        return verdict(NO_WORSE, first, same)

    assert share(0, 0).decision is Decision.HOLDS
    assert share(20, 20).decision is Decision.HOLDS  # 0 points [-6, 6]
    assert share(8, 0).decision is Decision.HOLDS  # 4 points, which a strict test refutes
    assert share(70, 10).decision is Decision.REFUTED  # 30 points
    unclear = share(40, 12)  # 14 points
    assert unclear.value == pytest.approx(14.0)
    assert unclear.decision is Decision.OPEN
    assert "contains 12; the difference is small beside the spread" in unclear.why


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


def test_what_may_happen_is_borne_out_by_one_run_and_refuted_by_none():
    assert verdict(claim("failed", ">"), [1.0] * 9 + [math.nan]).decision is Decision.HOLDS
    never = verdict(claim("failed", ">"), [1.0] * 50)
    assert never.decision is Decision.OPEN
    assert "but others may" in never.why


def test_where_neither_gets_anywhere_nothing_can_be_told():
    none = np.full(20, math.nan)
    for test in (NO_MORE, OFTENER, NO_WORSE):
        found = verdict(test, none, none)
        assert found.decision is Decision.OPEN
        assert found.why.startswith("neither ever reaches it")


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
    assert too_few_seeds(["han2007"], 6) == ""
    assert "use 6" in too_few_seeds(["han2007"], 5)
    assert too_few_seeds(["lee2008"], 6, quick=True) == ""


def test_a_path_is_less_than_none():
    none = np.full(20, math.nan)
    assert verdict(LESS, np.full(20, 500.0), none).decision is Decision.HOLDS
    assert verdict(LESS, none, np.full(20, 500.0)).decision is Decision.REFUTED
    assert "no path" in verdict(claim("median", "<=", 5.0), none).ours


def test_runs_of_one_map_do_not_count_as_maps():
    rng = np.random.default_rng(0)
    by_map = np.array([-1.0, 2.0, -1.5, 1.0, -0.5])
    first = np.resize(by_map, 100) + rng.normal(0, 0.01, 100)
    second = np.zeros(100)
    apart = verdict(LESS, first, second)
    together = verdict(LESS, first, second, worlds=5)
    assert together.high - together.low >= apart.high - apart.low
    assert together.decision is Decision.OPEN


def test_a_median_is_within_a_bound_or_beyond_it():
    assert verdict(claim("median", "<=", 10.0), np.linspace(4, 8, 30)).decision is Decision.HOLDS
    assert verdict(claim("median", "<=", 10.0), np.linspace(14, 18, 30)).decision is Decision.REFUTED
    assert verdict(claim("median", "<=", 10.0), np.linspace(5, 15, 30)).decision is Decision.OPEN
    assert verdict(claim("median", "<=", 10.0), np.linspace(4, 8, 5)).decision is Decision.OPEN  # too few


def test_a_mean_is_the_printed_one_within_its_margin():
    values = np.linspace(-0.5, 0.5, 50)
    assert verdict(claim("mean", "about", 101.0, quantity=("length",)), values).decision is Decision.HOLDS
    assert verdict(claim("mean", "about", 120.0, quantity=("length",)), values).decision is Decision.REFUTED
    assert verdict(claim("mean", "about", 105.2, quantity=("length",)), values).decision is Decision.OPEN
    assert verdict(claim("mean", "about", 101.0, quantity=("length",)), np.full(9, math.nan)).decision is Decision.OPEN


def test_arrivals_are_judged_by_wilsons_interval():
    few, most = np.resize([1.0, *[math.nan] * 24], 50), np.resize([math.nan, *[1.0] * 49], 50)
    assert verdict(claim("arrived", "<=", 0.2), few).decision is Decision.HOLDS
    assert verdict(claim("arrived", "<=", 0.2), most).decision is Decision.REFUTED
    assert verdict(claim("arrived", ">=", 0.8), most).decision is Decision.HOLDS
    assert verdict(claim("arrived", ">=", 0.97), most).decision is Decision.OPEN
    assert verdict(claim("arrived", "<=", 0.2), few).value == 2 / 50


def test_scatter_is_the_range_between_quartiles():
    rng = np.random.default_rng(0)
    calm, wild = rng.uniform(4, 6, 50), rng.uniform(0, 40, 50)
    assert verdict(WIDER, wild, calm).decision is Decision.HOLDS
    assert verdict(WIDER, calm, wild).decision is Decision.REFUTED
    assert verdict(WIDER, calm, calm).decision is not Decision.HOLDS


def test_cases_are_counted():
    assert verdict(claim("wins", ">=", 2, maps=2), [1.0], [2.0]).decision is Decision.HOLDS
    assert verdict(claim("wins", ">=", 2, maps=2), [2.0], [2.0]).decision is Decision.REFUTED
    assert verdict_facts(verdict(claim("wins", ">=", 2, maps=2), [2.0], [2.0]))["verdict"] == "does not hold"
    middle, least = claim("wins", ">=", 2, maps=2), claim("wins of best runs", ">=", 2, maps=2)
    assert verdict(middle, [0.0, 3.0, 3.0], [2.0, 2.0, 2.0]).decision is Decision.REFUTED
    assert verdict(least, [0.0, 3.0, 3.0], [2.0, 2.0, 2.0]).decision is Decision.HOLDS
    timed = claim("wins", ">=", 2, maps=2, quantity=("cpu_ms",))
    assert verdict(timed, [1.0] * 5, [1.0] * 5).decision is Decision.OPEN  # times of five runs tell nothing
    assert verdict(timed, [1.0] * 6, [1.0] * 6).decision is Decision.REFUTED


@pytest.mark.parametrize(
    ("printed", "digits", "expected"),
    [
        (13.899, 3, [(4, 7)]),
        (28.627, 3, [(6, 16)]),
        (42.184, 3, [(4, 27)]),
        (96.125, 3, [(24, 51)]),
        (59.355, 3, [(24, 25)]),
        (109.761, 3, []),  # suganthi2019 prints it, and no path over square cells has it
        (123.6102, 4, [(43, 57)]),
    ],
)
def test_a_printed_length_tells_the_moves(printed, digits, expected):
    assert move_counts(printed, digits) == [MoveCount(*pair) for pair in expected]
    for straight, diagonal in expected:
        assert straight + math.sqrt(2) * diagonal == pytest.approx(printed, abs=10.0**-digits)


def test_the_lengths_and_cells_that_lee2008_prints_agree():
    tables = {
        72.0833: 59, 83.3970: 67, 154.2376: 125, 175.2376: 146, 168.6518: 139, 59.2548: 47, 64.0833: 51, 123.6102: 101,
        135.8234: 107, 131.6812: 107,
    }  # fmt: skip
    for length, cells in tables.items():
        (moves,) = move_counts(length, 4)
        assert moves.straight + moves.diagonal + 1 == cells


def test_moves_that_can_be_monotone():
    assert MoveCount(6, 16).monotone(19, 19)
    assert MoveCount(43, 57).monotone(99, 58)
    assert not MoveCount(24, 51).monotone(49, 49)  # more diagonal moves than rows
    assert not MoveCount(14, 32).monotone(24, 24)


def test_a_candidate_has_the_length_asked_for_and_depends_on_the_seed_alone():
    moves = MoveCount(6, 16)
    one, same, other = (candidate((20, 20), (0, 0), (19, 19), moves, seed, blocked=0.15) for seed in (1, 1, 2))
    for query in (one, other):
        assert optimum(query) == pytest.approx(moves.length)
        assert query.grid.free[:2, :2].all()
    assert (one.grid.free == same.grid.free).all()
    assert (one.grid.free != other.grid.free).any()


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
    path, key = tmp_path / "t.npz", runs_key(one, 4)
    save_runs(made, path, key)
    read = load_runs(path, key)
    quantities = (
        "length", "gap", "steps", "last", "settled", "near", "effort", "unrest", "early_unrest", "work", "cpu_s",
        "total",
    )  # fmt: skip
    for before, after in zip(made, read, strict=True):
        for name in ("seed", "world", "optimum", "concentration", *quantities):
            np.testing.assert_equal(getattr(after, name), getattr(before, name), err_msg=name)
        np.testing.assert_array_equal(after.result.line, before.result.line)
        assert after.result.status is before.result.status
    assert load_runs(path, runs_key(one, 5)) is None
    assert load_runs(path, runs_key(dataclasses.replace(one, options={"ants": 11}), 4)) is None
    path.write_bytes(path.read_bytes()[:-200])
    assert load_runs(path, key) is None
    assert load_runs(tmp_path / "none.npz", key) is None


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
    run = PaperRun(0, 0, SimpleNamespace(), 100.0, 0.1, 0.0, math.nan, 125.0, 60.0)
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
    assert run.near == math.inf
    assert dataclasses.replace(run, optimum=105.0).near == 4.0  # 110 is within 5 % of 105
    assert run.last == 6.0
    assert run.unrest == run.early_unrest == pytest.approx(np.std([9, 9, 9, 4, 6]))
    assert run.cpu_ms == 100.0
    none = dataclasses.replace(run, result=SimpleNamespace(solved=False, history=history, work=50))
    assert (none.length, none.gap, none.steps, none.settled) == (math.inf,) * 4


def test_the_total_cost_is_that_of_hasans_straight_row():
    # Table 1, 3c: 49 straight moves would cost 1 + 2 + ... + 49 = 1225; the paper prints 1238.6.
    query = environments()["3c vertical rows"]
    assert total_cost(query, PLANNERS["astar"].plan(query, np.random.default_rng(0))) == pytest.approx(1225.0)
    diagonal = Query(Grid.from_free(np.ones((3, 3))), (0, 0), (2, 2))
    assert total_cost(diagonal, PLANNERS["astar"].plan(diagonal, np.random.default_rng(0))) == pytest.approx(1.4 + 2.8)


def test_a_dstar_that_lowers_no_cost_finds_longer_paths_where_walls_are_concave():
    longer = 0
    for query in environments().values():
        plan = FirstTouchDStar().plan(query, np.random.default_rng(0))
        assert plan.solved
        assert plan.cost >= optimum(query) - 1e-9
        longer += plan.cost > 1.05 * optimum(query)
    assert longer >= 3
    shut = np.ones((3, 3))
    shut[1] = 0
    assert not FirstTouchDStar().plan(Query(Grid.from_free(shut), (0, 0), (2, 2)), np.random.default_rng(0)).solved


def test_the_concentration_is_the_share_of_the_field_on_the_path():
    field = np.array([[4.0, 1.0], [1.0, 2.0]])
    cells = np.array([[0, 0], [1, 1]])
    plan = SimpleNamespace(solved=True, field=field, cells=cells)
    assert concentration(plan) == pytest.approx(6 / 8)
    assert math.isnan(concentration(SimpleNamespace(solved=True, field=None, cells=cells)))


def test_hasans_ant_with_the_papers_exponents_goes_in_no_circle():
    for experiment in PAPERS["hasan"]():
        if experiment.name == "mmas-dstar":
            assert solve("mmas-dstar", experiment.options, experiment.query(0), 0).result.reason == ""
        if experiment.name == "mmas-dstar, our rule" and experiment.map[:2] != "3c":
            assert "circles" in solve("mmas-dstar", {}, experiment.query(0), 0).result.reason


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
