"""Campaign folders, baselines and logs of an earlier antdrive are read, and nothing is driven again.

`old_files/` was written once and never changes. `campaigns/points.csv` lists the points of the campaigns that are there without
their drives: what was written, the key, and the command; the result of point i lasts i seconds.
"""

import csv
import json
import math
import re
import shutil
from pathlib import Path

import pyarrow.parquet
import pytest

FILES = Path(__file__).parent / "old_files"
RUNS = sorted(path.name for path in (FILES / "runs").iterdir())
CAMPAIGNS = sorted(path.stem for path in (FILES / "campaigns").glob("*.yaml"))
#: Columns that say which code made a row, or for how long.
OF_THE_CODE = ("key", "command", "plan_s", "drive_wall_s", "attempts")

with (FILES / "campaigns" / "points.csv").open(newline="") as stream:
    POINTS = list(csv.DictReader(stream))


@pytest.fixture
def old(tmp_path, monkeypatch):
    """A copy of the files beside the working directory of commands, which is the copy's `campaigns`."""
    shutil.copytree(FILES, tmp_path / "old")
    monkeypatch.chdir(tmp_path / "old" / "campaigns")
    return tmp_path / "old"


def rows_of(folder):
    return pyarrow.parquet.read_table(folder / "runs.parquet").to_pylist()


@pytest.fixture
def resumed(antdrive, old):
    """Resume a campaign, which must have no missing runs: the rows of its table."""

    def resume(name):
        assert missing(antdrive, name) == 0
        _, out, _ = antdrive("sweep", f"{name}.yaml", "-o", name, "--json", "-j", 1)
        assert json.loads(out)["made"] == 0
        return rows_of(old / "campaigns" / name)

    return resume


def missing(antdrive, name):
    code, out, _ = antdrive("sweep", f"{name}.yaml", "-o", name, "--dry-run", "--json")
    assert code == 0
    return json.loads(out)["missing"]


@pytest.mark.parametrize("name", CAMPAIGNS)
def test_no_point_of_an_old_campaign_is_missing(antdrive, old, name):
    assert missing(antdrive, name) == 0


def test_another_seed_is_missing_in_an_old_campaign(antdrive, old):
    path = old / "campaigns" / "named.yaml"
    path.write_text(path.read_text().replace("seeds: 4", "seeds: 5"))
    assert missing(antdrive, "named") == 2


@pytest.mark.parametrize("name", sorted({point["campaign"] for point in POINTS} - {"auto"}))  # it would calibrate again
def test_every_point_has_the_result_of_its_old_key(resumed, name):
    points = [point for point in POINTS if point["campaign"] == name]
    rows = {round(row["duration_s"]): row for row in resumed(name)}
    assert len(rows) == len(points)
    for point in points:
        row, written = rows[int(point["point"])], json.loads(point["written"])
        assert {column: row[column] for column in written} == written
        assert bool(row["command"]) == bool(point["command"])


@pytest.mark.parametrize("name", ["own", "tiny"])
def test_a_driven_campaign_keeps_its_rows(resumed, name):
    before = rows_of(FILES / "campaigns" / name)
    kept = [column for column in before[0] if column not in OF_THE_CODE and not column.startswith("version.")]
    assert [[row[column] for column in kept] for row in resumed(name)] == [
        [row[column] for column in kept] for row in before
    ]


def test_an_old_campaign_is_reported_on(antdrive, old):
    code, _, _ = antdrive("report", "tiny", "-o", "tiny.csv")
    assert code == 0
    assert "ants ants=5 scouts=8 iterations=10" in Path("tiny.csv").read_text()


@pytest.fixture
def check(antdrive, old):
    """Check the old suite: what `--json` prints, and the folder of its baselines."""
    suite = (old / "suite" / "old.yaml").rename(old / "suite" / "old.drive.yaml")  # which pytest would collect
    words = ("--json", "-j", 1, "--strict", "--results", "results")
    return lambda: json.loads(antdrive("check", suite, *words)[1]), suite.parent / "baselines" / "old"


@pytest.mark.slow
def test_drives_are_no_worse_than_their_old_baselines(check):
    found = check[0]()
    assert [test["address"] for test in found["tests"] if not test["passed"]] == found["unused"] == []


@pytest.mark.slow
def test_the_hashes_of_old_baselines_are_todays(check):
    for path in check[1].iterdir():
        path.write_text(re.sub('"duration_s": .*,', '"duration_s": 0.1,', path.read_text()))  # so that there are faults
    tests = check[0]()["tests"]
    assert sum(not test["passed"] for test in tests) == 14
    assert [line for test in tests for line in test["details"] if "changed since the baseline" in line] == []


@pytest.mark.parametrize("name", RUNS)
def test_an_old_run_is_judged_as_it_was(antdrive, old, name):
    was = json.loads((FILES / "runs" / name / "result.json").read_text())["certificate"]
    code, out, err = antdrive("verify", f"../runs/{name}", "--json")
    if was is None:
        assert (code, "ended before the robot drove" in err) == (2, True)
        return
    (now,) = json.loads(out)["rollouts"].values()
    assert (code == 0, now["certified"], now["contacts"]) == (was["certified"], was["certified"], was["contacts"])
    assert math.isclose(now["bound_m"], was["bound_m"], abs_tol=1e-9)


def test_old_runs_have_a_page(antdrive, old):
    code, _, _ = antdrive("report", "../runs", "-o", "page.md")
    assert code == 0
    assert "**3 / 11** reached the goal, certified" in Path("page.md").read_text()


def test_an_old_run_is_exported_and_its_margin_split(antdrive, old):
    assert antdrive("export", "../runs/ants", "--to", "csv", "-o", "drive")[0] == 0
    code, out, _ = antdrive("margin", "../runs/ants", "--json")
    assert (code, round(json.loads(out)["margin"], 3)) == (0, 0.06)
