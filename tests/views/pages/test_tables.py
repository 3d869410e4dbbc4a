"""A campaign's tables as Markdown, LaTeX and CSV, and the numbers in their cells."""

import csv
import math
from dataclasses import replace

import hypothesis.strategies as st
import pytest
from hypothesis import given

from antdrive.base.errors import InputError
from antdrive.runs.statistics.intervals import Interval
from antdrive.runs.statistics.run_table import RunTable
from antdrive.views.pages.campaign_summary import headline, summarise
from antdrive.views.pages.quotes import disagreements
from antdrive.views.pages.rendering import json_column, measure_title, percent, percents, probability, short
from antdrive.views.pages.report import Report
from antdrive.views.pages.tables import all_cells, latex_text, outcome_cells, pair_cells, success_cells
from tests.runs.made_up_campaign import Skill, made_up_columns, made_up_runs

PLANNERS = {"good": Skill(0.95, 1.05), "poor_one": Skill(0.5, 1.3)}


@pytest.fixture(scope="module")
def summary():
    return summarise(made_up_runs(PLANNERS, worlds=12, seeds=4), title="made <up>")


def test_csv_holds_the_numbers_as_they_are(summary, tmp_path):
    files = Report.of(summary, tmp_path).write(tmp_path / "t.csv")
    assert [path.name for path in files] == ["t.csv", "t-pairs.csv"]
    rows, pairs = (list(csv.DictReader(path.read_text().splitlines())) for path in files)
    assert [row["planner"] for row in rows] == list(PLANNERS)
    for row, known in zip(rows, summary.success, strict=True):
        assert (int(row["succeeded"]), float(row["share"])) == (known.successes, known.fraction)
        assert (float(row["low"]), float(row["high"])) == known.interval
        assert float(row["duration_s_low"]) <= float(row["duration_s_median"]) <= float(row["duration_s_high"])
    assert [pair["measure"] for pair in pairs] == ["success", "driven_length_m", "duration_s", "plan_s"]
    for pair, known in zip(pairs, [rows[0] for rows in summary.comparisons.values()], strict=True):
        assert float(pair["p_holm"]) == known.p_holm
        assert (float(pair["low"]), pair["better"]) == (known.interval.low, known.better)


def test_latex_has_as_many_cells_in_each_row_as_columns(summary, tmp_path):
    text = Report.of(summary, tmp_path).write(tmp_path / "t.tex")[0].read_text()
    assert text.count(r"\begin{tabular}") == text.count(r"\end{tabular}") == 6
    assert text.count(r"\toprule") == text.count(r"\midrule") == text.count(r"\bottomrule") == 6
    for block in text.split(r"\begin{tabular}{")[1:]:
        align, rest = block.split("}", 1)
        rows = [line for line in rest.splitlines() if line.endswith(r"\\")]
        assert len(rows) >= 2
        assert {line.count(" & ") + 1 for line in rows} == {len(align)}
    assert text.count(r"\begin{table}") == text.count(r"\caption{") == text.count(r"\label{tab:") == 6
    assert r"poor\_one" in text
    assert "poor_one" not in text


def test_columns_select_tables_and_their_columns_in_order(summary, tmp_path):
    columns = ["planner", "95 % interval", "Share"]
    text = Report.of(summary, tmp_path).write(tmp_path / "t.tex", columns)[0].read_text()
    assert text.count(r"\begin{tabular}{lrr}") == text.count(r"\begin{tabular}") == 1
    assert r"planner & 95 \% interval & share [\%] \\" in text
    markdown = Report.of(summary, tmp_path).write(tmp_path / "t.md", columns)[0].read_text()
    assert next(line for line in markdown.splitlines() if line.startswith("|")).count("|") == 4
    (plain,) = Report.of(summary, tmp_path).write(tmp_path / "t.csv", ["planner", "share"])
    assert plain.read_text().startswith("planner,share\n")
    with pytest.raises(InputError, match="--columns: no table has planner, colour; choose from planner, share"):
        Report.of(summary, tmp_path).write(tmp_path / "t.tex", ["planner", "colour"])


@given(st.text(alphabet=st.characters(codec="ascii", exclude_categories=["Cc"]), max_size=12))
def test_latex_text_has_no_bare_special_character(text):
    for piece in (r"\textbackslash{}", r"\textasciitilde{}", r"\textasciicircum{}", "$<$", "$>$", "$-$"):
        text = text.replace(piece, "")
    shown = latex_text(text)
    for piece in (r"\textbackslash{}", r"\textasciitilde{}", r"\textasciicircum{}", "$<$", "$>$", "$-$"):
        shown = shown.replace(piece, "")
    for special in "&%$#_{}":
        shown = shown.replace(f"\\{special}", "")
    assert not set(shown) & set("&%$#_{}\\~^<>")


def test_markdown_lists_failures_with_their_commands_and_stays_short(tmp_path):
    columns = made_up_columns({f"planner-{k}": Skill(0.5) for k in range(17)}, worlds=20, seeds=5)
    failures = [k for k, done in enumerate(columns["succeeded"]) if not done]
    tails = [f" --planner {columns['planner_name'][k]} --seed {columns['seed'][k]}" for k in failures]
    foreign = (
        "rm -rf ~ # antdrive run x" + tails[1],
        "antdrive run x; rm -rf ~" + tails[2],
        "antdrive run x --planner ants --seed 99",
        "antdrive run $(x)" + tails[4],
        "antdrive run 'x" + tails[5],
        "antdrive run \x1b[31mx" + tails[6],
        "antdrive accept x" + tails[7],
        "rm -rf ~ && antdrive run x" + tails[8],
    )
    for k, command in zip(failures, ("antdrive run '`odd` | x'" + tails[0], *foreign), strict=False):
        columns["command"][k] = command
    columns["reason"][failures[0]] = "\x1b]0;title\x07red"
    summary = summarise(RunTable(columns), title="big", metrics=["duration_s"])
    text = Report.of(summary, tmp_path).write(tmp_path / "t.md")[0].read_text()
    assert len(text.encode()) < 60_000
    failed = int((~summary.table.success).sum())
    assert f"## Failed runs: {failed}" in text
    assert f"{failed - 25} more are in the page." in text
    assert f"``antdrive run '`odd` | x'{tails[0]}``" in text
    assert not any(word in text for word in ("rm -rf", "--seed 99", "$(x)", "antdrive accept", "\x1b", "\x07"))
    assert text.count("antdrive run ") == 25 - len(foreign)
    assert "76 more rows are in the page" in text
    tables = [line for line in text.splitlines() if line.startswith("|")]
    assert len(tables) == 4 * 2 + 17 + 17 + 60 + 60
    assert "smallest distance" not in text, "a note on a column of the table of runs, which only the page has"


def test_notes_state_the_limits_of_the_tables(tmp_path):
    alone = summarise(made_up_runs({"a": Skill()}, worlds=1, seeds=3), title="t", size=10)
    assert alone.comparisons == {}
    assert alone.verdict == ""
    assert alone.notes[0] == "7 of 10 runs are not done yet."
    assert any("one world" in note for note in alone.notes)
    assert any("needs two" in note for note in alone.notes)
    for kind in ("md", "tex", "csv", "html"):
        assert len(Report.of(alone, tmp_path).write(tmp_path / f"t.{kind}")) == 1
    few = summarise(made_up_runs({"a": Skill(), "b": Skill(seeded=False)}, worlds=3, seeds=3), title="t")
    assert any("3 worlds are too few" in note for note in few.notes)
    assert any("Drives of b do not depend on the seed." in note for note in few.notes)


def table_of(planners, worlds, seeds=4, against=None):
    """Planners, each faster than the next in every world."""
    skills = {name: Skill(1.0, 1.0 + 0.3 * k) for k, name in enumerate(planners)}
    runs = made_up_runs(skills, worlds=worlds, seeds=seeds)
    return summarise(runs, title="t", metrics=["duration_s"], against=against)


@pytest.mark.parametrize(
    ("planners", "too_few", "need", "pairs"),
    [("AB", 5, 6, "a pair"), ("ABC", 6, 7, "3 pairs"), ("ABCDE", 8, 9, "10 pairs")],
)
@pytest.mark.parametrize("seeds", [1, 4])
def test_too_few_worlds_for_so_many_pairs_are_said(planners, too_few, need, pairs, seeds):
    few, enough = table_of(planners, too_few, seeds), table_of(planners, need, seeds)
    (note,) = few.notes
    assert note.startswith(f"{too_few} worlds are too few to distinguish {pairs} of planners: ")
    assert f"it takes {need} worlds" in note
    assert few.verdict == f"No difference between planners is shown in {too_few} worlds; it takes at least {need}."
    assert ("--against" in note) == (len(planners) > 2)
    assert {row.better for row in few.comparisons["duration_s"]} == {""}
    assert enough.notes == []
    first = (
        "A has the lower duration, B the higher" if len(planners) == 2 else f"{pairs} differ in duration, A leads most"
    )
    assert enough.verdict == f"{first.replace('pairs', f'of {pairs}')} ({need} worlds)."
    assert "" not in {row.better for row in enough.comparisons["duration_s"]}


def test_outcomes_are_counted_by_planner(summary):
    table = outcome_cells(summary)
    assert table.headings == ("planner", "succeeded", "collided", "runs")
    for cells, row in zip(table.rows, summary.success, strict=True):
        assert cells[:2] == (row.planner, str(row.outcomes["succeeded"]))
        assert int(cells[1]) + int(cells[2]) == int(cells[3]) == 48
    titles = [table.title for table in all_cells(summary)]
    assert len(set(titles)) == len(titles), "no two tables are called the same"


def test_the_headline_favours_no_planner_with_fewer_or_with_more_counted_runs():
    columns = made_up_columns({"A": Skill(1.0), "B": Skill(1.0, seeded=False)}, worlds=10, seeds=2)
    summary = summarise(RunTable(columns), title="t", metrics=[])
    tied = {words: value for value, words in headline(summary.table, summary)}
    assert tied["reached the goal, certified collision-free"] == "40 / 40"
    (best,) = (words for words in tied if words.startswith("succeeded with"))
    assert best == "succeeded with every planner (95 % over worlds: 72.2 to 100.0)"
    hard = [world >= "world-005" for world in columns["world"]]
    columns["succeeded"] = columns["certified"] = [not one for one in hard]
    columns["outcome"] = ["no_path" if one else "succeeded" for one in hard]
    kept = [k for k, planner in enumerate(columns["planner"]) if planner == "A" or not hard[k]]
    some = summarise(RunTable({n: [v[k] for k in kept] for n, v in columns.items()}), title="t", metrics=[], size=40)
    assert [
        value for value, words in headline(some.table, some) if words.startswith("succeeded with every planner")
    ] == ["100.0 %"]
    assert (
        "Shares are over the 10 instances that every planner ran. Omitted runs of other instances: A 10." in some.notes
    )
    assert success_cells(some).headings[-2:] == ("runs", "elsewhere")
    assert [row[-1] for row in success_cells(some).rows] == ["10", "0"]
    pairs = pair_cells("success", some.comparisons["success"])
    assert (pairs.headings[-1], pairs.rows[0][-1]) == ("unpaired", "10")


def test_a_share_without_exception_is_not_shown_as_certain_over_worlds():
    table = success_cells(table_of("AB", 2))
    assert [row[table.headings.index("over worlds")] for row in table.rows] == ["34.2 to 100.0"] * 2


def test_a_metric_without_a_direction_is_lower_or_more(summary):
    columns = made_up_columns({"A": Skill(1.0, 1.0), "B": Skill(1.0, 1.4)}, worlds=8, seeds=2)
    columns["replans"] = columns["duration_s"]
    table = pair_cells("replans", summarise(RunTable(columns), title="t", metrics=["replans"]).comparisons["replans"])
    found = dict(zip(table.headings, table.rows[0], strict=True))
    assert (found["lower"], found["less"], found["more"], "better" in found) == ("A", "16", "0", False)


def test_settings_that_are_mixed_are_named_and_those_of_worlds_are_not():
    columns = made_up_columns(PLANNERS, worlds=6, seeds=4)
    columns["cell"] = [0.1 if world == "world-000" else 0.2 for world in columns["world"]]
    assert summarise(RunTable(columns), title="t", metrics=[]).notes == []
    columns["noise"] = [float(seed % 2) for seed in columns["seed"]]
    columns["margin_asked"] = ["auto" if seed < 2 else "0.03" for seed in columns["seed"]]
    columns["margin"] = [0.03 + 0.001 * seed for seed in columns["seed"]]
    columns["robot_hash"] = [str(seed) for seed in columns["seed"]]
    assert summarise(RunTable(columns), title="t", metrics=[]).notes == [
        "Shares and medians are over several values of noise (0, 1); --where noise=0 selects one.",
        "Shares and medians are over several values of margin_asked (auto, 0.03); --where margin_asked=auto selects one.",
    ]


def test_no_share_is_shown_without_its_interval(summary):
    for table in (success_cells(summary), pair_cells("success", summary.comparisons["success"])):
        for heading, following in zip(table.headings, table.headings[1:], strict=False):
            assert following == "95 % interval" or heading not in ("share [%]", "difference [%]", "difference")
        for heading, cells in zip(table.headings, zip(*table.rows, strict=True), strict=True):
            assert not heading.startswith("median") or all("(" in cell for cell in cells)


def test_cells_by_hand():
    assert [percent(x) for x in (1.0, 0.99996, 0.9992, 0.0, -0.0001, 0.333, math.nan)] == [
        "100.0", "99.99", "99.9", "0.0", "0.0", "33.3", "–",
    ]  # fmt: skip
    assert percents(Interval(0.5, 1.0)) == "50.0 to 100.0"
    assert [short(x) for x in (0.0, 12.345, 1234.5, 0.00123456, -0.5, math.nan, math.inf, 1e-9)] == [
        "0", "12.3", "1234", "0.00123", "-0.500", "–", "∞", "0",
    ]  # fmt: skip
    assert [probability(p) for p in (1.0, 0.0123, 0.0009, math.nan)] == ["1.000", "0.012", "< 0.001", "–"]
    assert short(0.0999999) == "0.100"
    assert json_column("gap_to_grid_optimum", [-2.2e-16, 0.01])["numbers"] == [0, 1], (
        "in percent, without rounding noise"
    )
    names = ("success", "duration_s", "plan_s", "spl", "turning_rad_per_m", "margin", "gap_to_grid_optimum")
    assert [measure_title(name) for name in names] == [
        "success", "duration [s]", "planning time [ms]", "spl", "turning [rad/m]", "margin [m]", "gap to grid optimum [%]",
    ]  # fmt: skip


def test_a_sentence_states_each_measure_with_size_interval_tests_correction_and_clusters():
    summary = table_of("ABC", 7)
    success, duration = (quote for quote in summary.sentences if "p " in quote)
    assert success.startswith(
        "A succeeded in 100.0 % and B in 100.0 % of n = 28 pairs in 7 worlds: difference 0.0 points"
    )
    assert success.endswith("permutation test over worlds p = 1.000 (Holm, 3 pairs).")
    row = min(summary.comparisons["duration_s"], key=lambda one: one.decisive_p)
    low, high = map(short, row.interval)
    assert duration == (
        f"duration, {row.first} minus {row.second}: median {short(row.difference)} s over n = 28 pairs in 7 worlds that both "
        f"solved, 95 % interval {low} to {high} (bootstrap over worlds); Wilcoxon's signed rank test p "
        f"{probability(row.p_holm)}, permutation test over worlds p = {probability(row.p_worlds_holm)} (Holm, 3 pairs)."
    )


def test_against_a_planner_a_sentence_states_each_of_its_pairs():
    stated = [quote for quote in table_of("ABCD", 7, against="C").sentences if quote.startswith("duration, ")]
    assert [quote.split(":")[0] for quote in stated] == [
        f"duration, {pair}" for pair in ("A minus C", "B minus C", "C minus D")
    ]
    assert all(quote.endswith("(Holm, 3 pairs).") for quote in stated)


@pytest.mark.parametrize(
    ("p", "over", "holm", "interval", "why"),
    [
        (0.01, 0.01, 0.02, (1, 2), None),
        (0.20, 0.30, 0.40, (-1, 2), None),
        (0.02, 0.04, 0.08, (1, 2), "it holds for one pair, p for 1 pairs together"),
        (
            0.01,
            0.06,
            0.06,
            (1, 2),
            "worlds are too few: the interval excludes 0, the test over worlds does not; undecided",
        ),
        (0.06, 0.02, 0.06, (1, 2), "it is of the median, the tests are of ranks: no difference is shown"),
        (0.01, 0.01, 0.02, (-1, 2), "it is of the median, the tests are of ranks: the direction is shown"),
    ],
)
def test_an_interval_and_a_p_that_disagree_are_explained(summary, p, over, holm, interval, why):
    (row,) = summary.comparisons["duration_s"]
    row = replace(row, p=p, p_worlds=over, p_holm=p, p_worlds_holm=holm, interval=Interval(*map(float, interval)))
    said = list(disagreements({"duration_s": [row]}))
    assert len(said) == (why is not None)
    assert all(why in one and one.endswith(" (good and poor_one: duration).") for one in said)


def test_every_report_has_the_sentences(summary, tmp_path):
    for kind in ("md", "tex", "html"):
        text = Report.of(summary, tmp_path).write(tmp_path / f"t.{kind}")[0].read_text()
        assert "permutation test over worlds" in text
    assert summary.as_dict()["sentences"] == summary.sentences
