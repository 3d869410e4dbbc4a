"""What the page about regression tests shows is true: its suite and its tests pass, its tables are those of the code."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import pytest

from antdrive import METRICS
from antdrive.runs.suites.suite import ScenarioEntry, load_suite, suite_schema

ROOT = Path(__file__).parents[3]
PAGE = (ROOT / "docs" / "how-to" / "regression-tests.md").read_text()
REFERENCE = ROOT / "docs" / "reference"


def block(language: str) -> str:
    (text,) = re.findall(rf"```{language}\n(.*?)```", PAGE, flags=re.DOTALL)
    return str(text)


def test_the_tolerances_are_those_of_the_table_of_metrics() -> None:
    page = (REFERENCE / "regression.md").read_text()
    for name, metric in METRICS.items():
        row = re.search(rf"^\| `{name}` \| (\w+) \| (.*) \|$", page, flags=re.MULTILINE)
        if metric.tolerance is None:
            assert row is None
            continue
        assert row, name
        share = f" + {100 * metric.tolerance.relative:g} %" if metric.tolerance.relative else ""
        unit = "" if metric.unit == "1" else f" {metric.unit}"
        assert row.groups() == (metric.better, f"{metric.tolerance.absolute:g}{unit}{share}")


def test_every_key_of_a_suite_is_explained() -> None:
    table = (REFERENCE / "formats" / "suite.md").read_text().split("| key | meaning |")[1].split("\n\n")[0]
    assert {key for key in ScenarioEntry.model_fields if f"`{key}`" not in table} == {"note"}
    properties = suite_schema()["$defs"]["ScenarioEntry"]["properties"]
    assert all(entry.get("description") for entry in properties.values())


def test_the_suite_is_read(tmp_path: Path) -> None:
    (tmp_path / "page.drive.yaml").write_text(block("yaml"))
    assert [case.id for case in load_suite(tmp_path / "page.drive.yaml")] == [
        "forest[0]", "forest[1]", "random[0]", "random[1]", "random[2]", "closed-door[0]",
    ]  # fmt: skip


@pytest.mark.slow
def test_the_suite_and_the_tests_pass(tmp_path: Path) -> None:
    (tmp_path / "page.drive.yaml").write_text(block("yaml"))
    (tmp_path / "test_page.py").write_text(block("python"))
    command = [sys.executable, "-m", "pytest", "-q", "-p", "antdrive.cli.testing.plugin"]
    for words in (["--drive-update"], ["--drive-strict"]):
        done = subprocess.run([*command, *words], cwd=tmp_path, capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stdout
    assert "8 passed" in done.stdout
