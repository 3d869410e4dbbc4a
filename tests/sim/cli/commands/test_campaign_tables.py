"""`antdrive report` and `antdrive compare` with the folder of a campaign."""

import json
import re
import sys
from pathlib import Path

import pyarrow as pa
import pytest

from antdrive.sim.campaigns import store
from antdrive.sim.campaigns.rows import GRID, RESULT, result_schema
from antdrive.sim.campaigns.store import write_table
from antdrive.sim.cli.campaign_tables import MARKS
from tests.sim.cli.calling import Call, Refused
from tests.sim.made_up_campaign import Skill, made_up_columns

PLANNERS = {"astar": Skill(0.99, 1.0), "ants ants=10": Skill(0.6, 1.2, name="ants", options={"ants": 10})}


@pytest.fixture
def campaign(tmp_path: Path) -> Path:
    """The folder of a campaign that was never run, with 100 of 120 runs done."""
    columns = made_up_columns(PLANNERS, worlds=10, seeds=5)
    rows = [dict(zip(columns, values, strict=True)) for values in zip(*columns.values(), strict=True)]
    folder = tmp_path / "camp"
    (folder / "parts").mkdir(parents=True)
    grid = [{name: row.get(name) for name in (*GRID, "option.ants")} for row in rows]
    write_table(pa.Table.from_pylist(grid), folder / "grid.parquet")
    results = [{name: row.get(name) for name in RESULT} for row in rows]
    write_table(pa.Table.from_pylist(results, schema=result_schema()), folder / "parts" / "1.parquet")
    (folder / "manifest.json").write_text(json.dumps({"size": 120}))
    return folder


def test_compare_prints_both_tables(antdrive: Call, campaign: Path) -> None:
    code, out, err = antdrive("compare", campaign)
    assert (code, err) == (0, "")
    success, outcomes, pairs, length = out.split("\n\n")[:4]
    assert re.search(r"^astar +\d+\.\d +\d+\.\d to \d+\.\d ", success, re.M)
    assert re.search(r"^astar +ants ants=10 +astar ", pairs, re.M)
    assert re.search(r"^ants ants=10 +\d+ +\d+ +50$", outcomes, re.M)
    assert length.startswith("driven length [m]\n")
    assert "20 of 120 runs are not done yet." in out


def test_compare_as_json(antdrive: Call, campaign: Path) -> None:
    words = ("--metric", "plan_s", "--metric", "spl", "--against", "astar", "--json")
    code, out, _ = antdrive("compare", campaign, *words)
    facts = json.loads(out)
    assert code == 0
    assert (facts["runs"], facts["size"]) == (100, 120)
    assert list(facts["comparisons"]) == ["success", "plan_s", "spl"]
    row = facts["comparisons"]["success"][0]
    assert (row["pairs"], row["better"]) == (50, "astar")
    assert row["interval"][0] <= row["difference"] <= row["interval"][1]


def test_some_runs_are_taken(antdrive: Call, campaign: Path, tmp_path: Path) -> None:
    code, out, _ = antdrive("compare", campaign, "--where", "world=world-003", "--where", "noise=0", "--json")
    facts = json.loads(out)
    assert (code, facts["runs"], facts["size"]) == (0, 10, 10)
    assert any("one world" in note for note in facts["notes"])
    assert antdrive("report", campaign, "-o", tmp_path / "r.md", "--where", "ants=10")[0] == 0
    assert "astar" not in (tmp_path / "r.md").read_text()


@pytest.mark.parametrize("kind", ["html", "md", "tex", "csv"])
def test_report_writes_every_kind(antdrive: Call, campaign: Path, tmp_path: Path, kind: str) -> None:
    code, out, err = antdrive("report", campaign, "-o", tmp_path / f"r.{kind}", "--title", "My title", "--json")
    assert (code, err) == (0, "")
    files = json.loads(out)["files"]
    assert len(files) == 1 + (kind == "csv")
    text = Path(files[0]).read_text()
    assert "astar" in text
    assert kind not in ("html", "md") or "My title" in text


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (["report", "camp", "-o", "r.pdf"], "r.pdf: unknown suffix '.pdf'; choose one of .html, .md, .tex, .csv"),
        (["compare", "camp", "--metric", "speed"], "camp: metric: unknown 'speed'; choose from"),
        (["compare", "camp", "--against", "mmas"], "camp: against: unknown planner 'mmas'; choose from astar, ants"),
        (["compare", "camp", "-p", "astar"], "camp: planners: astar alone; two are needed"),
        (["compare", "camp", "-p", "astar", "-p", "mmas"], "camp: planner: unknown 'mmas'"),
        (["compare", "camp", "--seed", "3"], "--seed: is for drives; a campaign's folder takes"),
        (["compare", "camp", "--where", "noise"], "--where noise: must be COLUMN=VALUE, such as noise=1"),
        (["compare", "camp", "--where", "noise=2"], "camp: noise: no run with '2'; the campaign has 0.0"),
        (["report", "camp", "-o", "r.md", "--where", "x=2"], "camp: x: no such column; choose from key, world"),
        (["report", ".", "-o", "r.md", "--where", "x=2"], "--where: is for the folder of a campaign"),
        (["compare", "camp", "forest"], "camp forest: name one campaign's folder, or worlds"),
        (["compare", "forest", "-p", "astar", "-p", "ants", "--metric", "spl"], "--metric: is for the folder"),
    ],
    ids=lambda value: " ".join(value) if isinstance(value, list) else "",
)
def test_wrong_input_is_one_line_and_exit_code_2(
    refused: Refused, campaign: Path, monkeypatch: pytest.MonkeyPatch, words: list[str], says: str
) -> None:
    monkeypatch.chdir(campaign.parent)
    assert says in refused(*words)


def test_a_missing_library_is_one_line(refused: Refused, campaign: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "statsmodels.stats.proportion", None)
    assert "statsmodels is not installed; pip install 'antdrive[campaigns]'" in refused("compare", str(campaign))


def test_a_campaign_without_a_finished_run_is_refused(refused: Refused, campaign: Path) -> None:
    (campaign / "parts" / "1.parquet").unlink()
    assert "runs: none; the campaign has no finished run" in refused("compare", str(campaign))


def test_a_campaign_is_told_by_the_files_that_its_store_writes() -> None:
    assert MARKS == (store.MANIFEST, store.GRID_FILE)
