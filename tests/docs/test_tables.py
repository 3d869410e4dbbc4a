"""Tables of the reference: those that people write name what the code has, and the others are made from it."""

from __future__ import annotations

import dataclasses
import importlib
import json
import re
from pathlib import Path
from typing import Any

import pytest

from antdrive.runs.suites.baseline import Baseline
from antdrive.sim.driving.rules import EXPLORING_LIMITERS
from antdrive.sim.log.record import MarginRecord, SensingRecord, record_keys
from antdrive.sim.log.rollout import ARRAYS, SENSED
from tests.records import made_up_record

ROOT = Path(__file__).resolve().parents[2]
DOCS = ROOT / "docs"


def first_cells(page: str, heading: str) -> list[str]:
    """What stands in backticks in the first column of the table below a heading."""
    table = (DOCS / page).read_text().partition(f"{heading}\n")[2].partition("|---|")[2].partition("\n\n")[0]
    return [name for row in table.splitlines()[1:] for name in re.findall(r"`([^`]+)`", row.split("|")[1])]


def test_every_limiter_is_explained_in_its_order() -> None:
    assert first_cells("explanation/following.md", "### Limiters") == list(EXPLORING_LIMITERS)


def test_every_key_of_a_baseline_is_explained() -> None:
    named = first_cells("reference/formats/baseline.md", "# The keys of a baseline")
    assert sorted(named) == sorted(field.name for field in dataclasses.fields(Baseline))


def test_every_variable_that_the_code_reads_is_explained() -> None:
    folders = [ROOT / "src", ROOT / "tools"]
    sources = "".join(path.read_text() for folder in folders for path in folder.rglob("*.py"))
    read = set(re.findall(r"os\.environ(?:\.get\(|\[)\"(\w+)\"", sources))
    assert sorted(read) == sorted(first_cells("reference/environment.md", "## Variables of the environment"))


@pytest.fixture
def known(monkeypatch: pytest.MonkeyPatch) -> Any:
    monkeypatch.syspath_prepend(str(DOCS / "_ext"))
    return importlib.import_module("antdrive_tables").KNOWN


def test_every_table_that_a_page_asks_for_is_made(known: Any) -> None:
    pages = "".join(path.read_text() for path in DOCS.rglob("*.md") if not {"_build", "_gallery"} & set(path.parts))
    asked = {tuple(words.split()) for words in re.findall(r"^\.\. known:: (.+)$", pages, re.MULTILINE)}
    assert {name for name, *_ in asked} == set(known)
    for name, *words in asked:
        assert len(known[name](*words)) > 2, name


def test_every_array_and_every_key_of_a_log_is_explained(known: Any) -> None:
    choice = MarginRecord(loss_m=0.03, reserve_m=0.01, probability=1e-3, drives=80)
    sensing = SensingRecord(map="none", localisation="odometry", odometry=1.0)
    written = json.loads(made_up_record(margin_choice=choice, sensing=sensing).to_json())
    table = "\n".join([*known["arrays"](), *known["record"]()])
    for name in (*ARRAYS, *SENSED, *written, *(f"plan.{key}" for key in written["plan"]), "margin_choice.loss_m"):
        assert f" - ``{name}``" in table, name
    assert all(kind and text for _, kind, text in record_keys())
