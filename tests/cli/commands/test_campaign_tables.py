"""`antdrive report` and `antdrive compare` with the folder of a campaign."""

import json
import re
import sys
from pathlib import Path

import pyarrow as pa
import pytest

from antdrive.cli.campaign_tables import MARKS
from antdrive.runs.campaigns import store
from antdrive.runs.campaigns.rows import GRID, RESULT, result_schema
from antdrive.runs.campaigns.store import write_table
from tests.cli.calling import Call, Refused
from tests.runs.made_up_campaign import Skill, made_up_columns

PLANNERS = {"astar": Skill(0.99, 1.0), "ants ants=10": Skill(0.6, 1.2, name="ants", options={"ants": 10})}


def written(folder: Path, planners: dict[str, Skill], rng_seed: int = 1) -> Path:
    """The folder of a campaign that was never run, of 10 worlds and 6 seeds; the runs of the last seed are not done."""
    columns = made_up_columns(planners, worlds=10, seeds=6, rng_seed=rng_seed)
    rows = [dict(zip(columns, values, strict=True)) for values in zip(*columns.values(), strict=True)]
    (folder / "parts").mkdir(parents=True)
    grid = [{name: row.get(name) for name in (*GRID, "option.ants")} for row in rows]
    write_table(pa.Table.from_pylist(grid), folder / "grid.parquet")
    results = [{name: row.get(name) for name in RESULT} for row in rows if row["seed"] < 5]
    write_table(pa.Table.from_pylist(results, schema=result_schema()), folder / "parts" / "1.parquet")
    (folder / "manifest.json").write_text(json.dumps({"size": len(rows)}))
    return folder


@pytest.fixture
def campaign(tmp_path: Path) -> Path:
    """A folder with 100 of 120 runs done."""
    return written(tmp_path / "camp", PLANNERS)


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
    words = ("--metric", "plan_s", "--metric", "spl", "--against", "astar", "--allow", "success=0.02", "--json")
    code, out, _ = antdrive("compare", campaign, *words)
    facts = json.loads(out)
    assert code == 0
    assert (facts["runs"], facts["size"]) == (100, 120)
    assert [(row["planner"], row["not_worse"]) for row in facts["not_worse"]] == [("ants ants=10", False)]
    assert list(facts["comparisons"]) == ["success", "plan_s", "spl"]
    row = facts["comparisons"]["success"][0]
    assert (row["pairs"], row["better"]) == (50, "astar")
    assert row["interval"][0] <= row["difference"] <= row["interval"][1]


def test_some_runs_are_taken(antdrive: Call, campaign: Path, tmp_path: Path) -> None:
    code, out, _ = antdrive("compare", campaign, "--where", "world=world-003", "--where", "noise=0", "--json")
    facts = json.loads(out)
    assert (code, facts["runs"], facts["size"]) == (0, 10, 12)
    assert facts["notes"][0] == "2 of 12 runs are not done yet."
    assert any("one world" in note for note in facts["notes"])
    assert antdrive("report", campaign, "-o", tmp_path / "r.md", "--where", "ants=10")[0] == 0
    assert "astar" not in (tmp_path / "r.md").read_text()
    words = ("--where", "seed=0", "--where", "seed=3..5", "--where", "succeeded=true", "--json")
    facts = json.loads(antdrive("compare", campaign, *words)[1])
    assert (facts["runs"], facts["size"]) == (sum(row["runs"] for row in facts["planners"]), facts["runs"] + 20)
    assert all(set(row["outcomes"]) == {"succeeded"} for row in facts["planners"])


def test_a_report_takes_planners_metrics_and_one_to_compare_with(
    antdrive: Call, tmp_path: Path, campaign: Path
) -> None:
    words = ("--metric", "spl", "--against", "astar", "-p", "astar", "-p", "ants ants=10", "--allow", "success=0.1")
    assert antdrive("report", campaign, "-o", tmp_path / "r.tex", *words)[0] == 0
    text = (tmp_path / "r.tex").read_text()
    assert "% spl" in text
    assert "% Not worse by more than allowed" in text
    assert "% duration" not in text
    assert antdrive("report", campaign, "-o", tmp_path / "r.md", "-p", "astar")[0] == 0
    text = (tmp_path / "r.md").read_text()
    assert "ants" not in text
    assert "**50** of 60 runs done" in text


def test_several_campaigns_are_compared(antdrive: Call, tmp_path: Path, campaign: Path) -> None:
    other = written(tmp_path / "later", {"astar": Skill(0.7), "mmas": Skill(0.9)}, rng_seed=5)
    facts = json.loads(antdrive("compare", campaign, other, "--json")[1])
    assert [row["planner"] for row in facts["planners"]] == ["astar @camp", "ants ants=10", "astar @later", "mmas"]
    assert {row["pairs"] for row in facts["comparisons"]["success"]} == {50}
    assert (facts["runs"], facts["size"]) == (200, 240)
    one = json.loads(antdrive("compare", campaign, other, "-p", "astar @later", "-p", "mmas", "--json")[1])
    assert (one["runs"], one["size"]) == (100, 120)
    assert antdrive("report", campaign, other, "-o", tmp_path / "page.html")[0] == 0
    page = (tmp_path / "page.html").read_text()
    data = json.loads(page.split('id="data">')[1].split("</script>")[0])
    logs = next(column for column in data["columns"] if column["name"] == "rollout")["texts"]
    assert {log.split("/")[0] for log in logs if log} == {"camp", "later"}
    assert "folder" in data["shown"]


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
        (["compare", "camp", "--where", "noise=2"], "camp: noise: no run with '2'; the campaign has 0"),
        (["report", "camp", "-o", "r.md", "--where", "x=2"], "camp: x: no such column; choose from key, world"),
        (["report", ".", "-o", "r.md", "--where", "x=2"], "--where: is for the folder of a campaign"),
        (["compare", "camp", "forest"], "camp forest: name folders of campaigns, or worlds"),
        (["compare", "camp", "./camp"], "camp: name each folder once"),
        (["compare", "camp", "--allow", "success=0.1"], "--allow success=0.1: needs --against PLANNER"),
        (
            ["compare", "camp", "--against", "astar", "--allow", "success"],
            "--allow success: must be MEASURE=DIFFERENCE",
        ),
        (
            ["compare", "camp", "--against", "astar", "--allow", "fun=1"],
            "camp: allow: unknown 'fun'; choose from success",
        ),
        (["compare", "kamp"], "kamp: no such file, nor a world of the catalogue"),
        (
            ["compare", "camp/parts", "-p", "astar"],
            "camp/parts: neither a world file nor the folder of a campaign, as antdrive sweep",
        ),
        (["compare", "forest"], "--planner: name two to six different planners"),
        (["report", "camp", ".", "-o", "r.md"], ".: is no campaign's folder, as camp is; report about them apart"),
        (["report", ".", "-o", "r.md", "--against", "x"], "--against: is for the folder of a campaign; . is none"),
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
    assert "pip install 'antdrive[campaigns]'" in refused("compare", str(campaign))


def test_a_campaign_without_a_finished_run_is_refused(refused: Refused, campaign: Path) -> None:
    (campaign / "parts" / "1.parquet").unlink()
    for words in ((), ("--where", "noise=1")):
        assert "runs: none; the campaign has no finished run" in refused("compare", str(campaign), *words)


def test_a_campaign_is_told_by_the_files_that_its_store_writes() -> None:
    assert MARKS == (store.MANIFEST, store.GRID_FILE)
