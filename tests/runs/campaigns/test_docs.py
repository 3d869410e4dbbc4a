"""What the pages about campaigns show is right: the file, the columns, the line that reads the table, the manifest."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from antdrive.base.document import parse_document
from antdrive.runs.campaigns import make_campaign, sweep
from antdrive.runs.campaigns.campaign import CampaignFile
from antdrive.runs.campaigns.rows import GRID, RESULT
from antdrive.runs.campaigns.store import read_manifest
from antdrive.sim.log.metrics import METRICS

DOCS = Path(__file__).parents[3] / "docs"
TEXT = (DOCS / "how-to" / "campaigns.md").read_text()
FOLDER = (DOCS / "reference" / "formats" / "campaign-folder.md").read_text()


def test_the_file_that_the_page_shows_has_every_key_and_is_right() -> None:
    block = max(re.findall(r"```yaml\n(.*?)```", TEXT, flags=re.DOTALL), key=len)  # the others are first steps
    data = parse_document(block, "docs/how-to/campaigns.md").data
    assert make_campaign(data).entry.rollouts == "failed"
    assert set(data) == {info.alias or name for name, info in CampaignFile.model_fields.items()}


def test_the_page_names_every_column() -> None:
    names = {*GRID, *RESULT} - set(METRICS) | {"plan_s", "drive_wall_s"}
    assert [name for name in names if f"`{name}`" not in FOLDER and not name.startswith("version.")] == []


def test_the_page_names_every_key_of_the_manifest(tmp_path: Path) -> None:
    sweep({"worlds": "empty", "planners": "astar"}, tmp_path / "out", jobs=0)
    table = FOLDER.partition("`manifest.json` has these keys:")[2].partition("\n## ")[0]
    assert re.findall(r"^\| `(\w+)` \|", table, flags=re.MULTILINE) == list(read_manifest(tmp_path / "out"))


def test_the_line_for_pandas_reads_the_table(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    pandas = pytest.importorskip("pandas")
    monkeypatch.chdir(tmp_path)
    results = sweep({"worlds": "empty", "planners": "astar"}, "out/first", jobs=0)
    (line,) = re.findall(r"^\| pandas \| `(.*)` \|$", TEXT, flags=re.MULTILINE)
    assert results.pandas().equals(eval(line, {"pandas": pandas}))
