"""`antdrive report` and `antdrive compare` with the folder of a campaign."""

import json
import re
import sys
from pathlib import Path

import pytest

from antdrive.cli.campaign_tables import CAMPAIGN_FILES
from antdrive.runs.campaigns import store
from antdrive.views.pages import charts
from tests.cli.conftest import written
from tests.runs.made_up_campaign import Skill


@pytest.fixture
def one_chart(monkeypatch):
    """Of the charts of a report, which tests of views draw, the first profile alone."""
    known = charts.known_metrics
    monkeypatch.setattr(charts, "known_metrics", lambda paired, names: known(paired, names)[:1])
    for name in ("_differences", "_size_boxes", "_option_charts"):
        monkeypatch.setattr(charts, name, lambda *_: [])


def test_compare_prints_both_tables(antdrive, camp):
    code, out, err = antdrive("compare", camp)
    assert (code, err) == (0, "")
    success, outcomes, pairs, length = out.split("\n\n")[:4]
    assert re.search(r"^astar +\d+\.\d +\d+\.\d to \d+\.\d ", success, re.M)
    assert re.search(r"^astar +ants ants=10 +astar ", pairs, re.M)
    assert re.search(r"^ants ants=10 +\d+ +\d+ +50$", outcomes, re.M)
    assert length.startswith("driven length [m]\n")
    assert "20 of 120 runs are not done yet." in out


def test_compare_as_json(antdrive, camp):
    words = ("--metric", "plan_s", "--metric", "spl", "--against", "astar", "--allow", "success=0.02", "--json")
    code, out, _ = antdrive("compare", camp, *words)
    facts = json.loads(out)
    assert code == 0
    assert (facts["runs"], facts["size"]) == (100, 120)
    assert [(row["planner"], row["not_worse"]) for row in facts["not_worse"]] == [("ants ants=10", False)]
    assert list(facts["comparisons"]) == ["success", "plan_s", "spl"]
    row = facts["comparisons"]["success"][0]
    assert (row["pairs"], row["better"]) == (50, "astar")
    assert row["interval"][0] <= row["difference"] <= row["interval"][1]


def test_some_runs_are_taken(antdrive, camp, tmp_path):
    code, out, _ = antdrive("compare", camp, "--where", "world=world-003", "--where", "noise=0", "--json")
    facts = json.loads(out)
    assert (code, facts["runs"], facts["size"]) == (0, 10, 12)
    assert facts["notes"][0] == "2 of 12 runs are not done yet."
    assert any("one world" in note for note in facts["notes"])
    assert antdrive("report", camp, "-o", tmp_path / "r.md", "--where", "ants=10")[0] == 0
    assert "astar" not in (tmp_path / "r.md").read_text()
    words = ("--where", "seed=0", "--where", "seed=3..5", "--where", "succeeded=true", "--json")
    facts = json.loads(antdrive("compare", camp, *words)[1])
    assert (facts["runs"], facts["size"]) == (sum(row["runs"] for row in facts["planners"]), facts["runs"] + 20)
    assert all(set(row["outcomes"]) == {"succeeded"} for row in facts["planners"])


def test_a_report_takes_planners_metrics_and_one_to_compare_with(antdrive, tmp_path, camp):
    words = ("--metric", "spl", "--against", "astar", "-p", "astar", "-p", "ants ants=10", "--allow", "success=0.1")
    assert antdrive("report", camp, "-o", tmp_path / "r.tex", *words)[0] == 0
    text = (tmp_path / "r.tex").read_text()
    assert "% spl" in text
    assert "% Not worse by more than allowed" in text
    assert "% duration" not in text
    assert antdrive("report", camp, "-o", tmp_path / "r.md", "-p", "astar")[0] == 0
    text = (tmp_path / "r.md").read_text()
    assert "ants" not in text
    assert "**50** of 60 runs done" in text


def test_several_campaigns_are_compared(antdrive, tmp_path, camp, one_chart):
    other = written(tmp_path / "later", {"astar": Skill(0.7), "mmas": Skill(0.9)}, rng_seed=5)
    facts = json.loads(antdrive("compare", camp, other, "--json")[1])
    assert [row["planner"] for row in facts["planners"]] == ["astar @camp", "ants ants=10", "astar @later", "mmas"]
    assert {row["pairs"] for row in facts["comparisons"]["success"]} == {50}
    assert (facts["runs"], facts["size"]) == (200, 240)
    one = json.loads(antdrive("compare", camp, other, "-p", "astar @later", "-p", "mmas", "--json")[1])
    assert (one["runs"], one["size"]) == (100, 120)
    assert antdrive("report", camp, other, "-o", tmp_path / "page.html")[0] == 0
    page = (tmp_path / "page.html").read_text()
    data = json.loads(page.split('id="data">')[1].split("</script>")[0])
    logs = next(column for column in data["columns"] if column["name"] == "rollout")["texts"]
    assert {log.split("/")[0] for log in logs if log} == {"camp", "later"}
    assert "folder" in data["shown"]


@pytest.mark.parametrize("kind", ["html", "md", "csv"])  # TeX: see below
def test_report_writes_every_kind(antdrive, camp, one_chart, tmp_path, kind):
    code, out, err = antdrive("report", camp, "-o", tmp_path / f"r.{kind}", "--title", "My title", "--json")
    assert (code, err) == (0, "")
    files = json.loads(out)["files"]
    assert len(files) == 1 + (kind == "csv")
    text = Path(files[0]).read_text()
    assert "astar" in text
    assert kind not in ("html", "md") or "My title" in text


def test_a_missing_library_is_one_line(refused, camp, monkeypatch):
    monkeypatch.setitem(sys.modules, "statsmodels.stats.proportion", None)
    assert "pip install 'antdrive[campaigns]'" in refused("compare", camp)


def test_a_campaign_without_a_finished_run_is_refused(refused, camp):
    (camp / "parts" / "1.parquet").unlink()
    for words in ((), ("--where", "noise=1")):
        assert "runs: none; the campaign has no finished run" in refused("compare", camp, *words)


def test_a_campaign_is_told_by_the_files_that_its_store_writes():
    assert CAMPAIGN_FILES == (store.MANIFEST, store.GRID_FILE)


def test_a_report_for_a_thesis_is_a_narrow_table_and_its_charts(antdrive, tmp_path, camp, one_chart):
    code, out, _ = antdrive(
        "report",
        camp,
        "-o",
        tmp_path / "t.tex",
        "--columns",
        "planner, share",
        "--metric",
        "spl",
        "--figures",
        tmp_path / "figs",
    )
    assert (code, (tmp_path / "t.tex").read_text().count(r"\begin{tabular}{lr}")) == (0, 1)
    assert {path.suffix for path in (tmp_path / "figs").iterdir()} == {".pdf", ".svg", ".tex"}
    assert "t.tex" in out
    assert "figs" in out
    for words, said in (
        ((), "give -o FILE, --figures DIR"),
        (("-o", tmp_path / "t.html", "--columns", "share"), "--columns: applies to"),
    ):
        code, _, err = antdrive("report", camp, *words)
        assert code == 2
        assert said in err
