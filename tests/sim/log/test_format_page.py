"""The reference's tables of arrays, keys, outcomes and metrics agree with the code."""

import dataclasses
import json
import re
from pathlib import Path

from antdrive.sim.log.format_page import tables, with_tables
from antdrive.sim.log.record import DriveRecord, MarginRecord, SensingRecord, record_keys
from antdrive.sim.log.rollout import ARRAYS, SENSED
from tests.records import made_up_record

PAGE = Path(__file__).parents[3] / "docs" / "reference" / "rollout-format.md"
ON = {"arrays": PAGE.name, "record": PAGE.name, "outcomes": "exit-codes.md", "metrics": "metrics.md"}


def test_the_pages_tables_are_those_of_the_code() -> None:
    pages = {path: path.read_text(encoding="utf-8") for path in PAGE.parent.glob("*.md")}
    for path, page in pages.items():
        assert with_tables(page) == page, f"run python -m antdrive.sim.log.format_page {path}"
    for name in tables():
        assert [path.name for path, page in pages.items() if f"<!-- table {name} -->" in page] == [ON[name]]


def test_the_page_describes_every_array_and_every_key() -> None:
    page = PAGE.read_text(encoding="utf-8")
    choice = MarginRecord(loss_m=0.03, reserve_m=0.01, probability=1e-3, drives=80)
    sensing = SensingRecord(map="none", localisation="odometry", odometry=1.0)
    record = made_up_record(margin_choice=choice, sensing=sensing)
    written = json.loads(record.to_json())
    assert set(written) == {field.name for field in dataclasses.fields(DriveRecord)}
    for name in (*ARRAYS, *SENSED, *written, *(f"plan.{key}" for key in written["plan"]), "margin_choice.loss_m"):
        assert re.search(rf"^\| `{re.escape(name)}` \|", page, re.MULTILINE), name


def test_every_key_has_a_description() -> None:
    assert all(kind and text for _, kind, text in record_keys())
