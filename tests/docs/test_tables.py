"""Tables that people write on pages of the reference name what the code has, no more and no less."""

from __future__ import annotations

import dataclasses
import re
from pathlib import Path

from antdrive.runs.suites.baseline import Baseline
from antdrive.sim.driving.driver import EXPLORING_LIMITERS

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
