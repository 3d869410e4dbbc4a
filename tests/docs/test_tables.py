"""Tables, files and measurements on pages: those that people write name what the code has and work, the others are made."""

import dataclasses
import json
import re
import subprocess
import sys
from pathlib import Path

import pytest

from antdrive.base.document import parse_document
from antdrive.cli.commands import COMMANDS
from antdrive.runs.campaigns import make_campaign, sweep
from antdrive.runs.campaigns.campaign import CampaignFile
from antdrive.runs.campaigns.rows import GRID, RESULT
from antdrive.runs.campaigns.store import read_manifest
from antdrive.runs.suites.baseline import Baseline
from antdrive.runs.suites.suite import ScenarioEntry, load_suite, suite_schema
from antdrive.sim.driving.parts import EXPLORING_LIMITERS
from antdrive.sim.log.metrics import METRICS
from antdrive.sim.log.record import MarginRecord, SensingRecord
from antdrive.sim.log.rollout import ARRAYS, SENSED
from tests.records import made_up_record
from tools.reference import GENERATED, pages, stale, written
from tools.rooms import PICTURE, drawn

ROOT = Path(__file__).resolve().parents[2]
DOCS = ROOT / "docs"


def first_cells(page, heading):
    """What stands in backticks in the first column of the table below a heading."""
    table = (DOCS / page).read_text().partition(f"{heading}\n")[2].partition("|---|")[2].partition("\n\n")[0]
    return [name for row in table.splitlines()[1:] for name in re.findall(r"`([^`]+)`", row.split("|")[1])]


def test_every_limiter_is_explained_in_its_order():
    assert first_cells("explanation/following.md", "### Limiters") == list(EXPLORING_LIMITERS)


def test_every_key_of_a_baseline_is_explained():
    named = first_cells("reference/formats/baseline.md", "# The keys of a baseline")
    assert sorted(named) == sorted(field.name for field in dataclasses.fields(Baseline))


def test_every_variable_that_the_code_reads_is_explained():
    folders = [ROOT / "src", ROOT / "tools"]
    sources = "".join(path.read_text() for folder in folders for path in folder.rglob("*.py"))
    read = set(re.findall(r"os\.environ(?:\.get\(|\[)\"(\w+)\"", sources))
    read |= set(re.findall(r" = \"(ANTDRIVE_\w+)\"", sources))
    assert sorted(read) == sorted(first_cells("reference/environment.md", "## Variables of the environment"))


def test_generated_parts_of_pages_and_rows_of_lists_are_up_to_date():
    assert [path.name for path in stale()] == [], "run `python -m tools.reference`"


def test_the_picture_of_the_rooms_is_up_to_date():
    assert PICTURE.read_text() == drawn(), "run `python -m tools.rooms`"


def test_every_generated_part_stands_on_a_page():
    marks = [mark for page in pages() for mark in re.findall("<!-- generated: ([a-z-]+)", page.read_text())]
    assert set(marks) == set(GENERATED)


def test_a_stale_part_is_noticed():
    page = DOCS / "reference" / "exit-codes.md"
    assert written(page.read_text().replace("| `succeeded` |", "| `arrived` |")) == page.read_text()


def test_every_array_and_every_key_of_a_log_is_explained():
    choice = MarginRecord(loss_m=0.03, reserve_m=0.01, probability=1e-3, drives=80)
    sensing = SensingRecord(map="none", localisation="odometry", odometry=1.0)
    written = json.loads(made_up_record(margin_choice=choice, sensing=sensing).to_json())
    table = "\n".join([*GENERATED["arrays"](), *GENERATED["record"]()])
    for name in (*ARRAYS, *SENSED, *written, *(f"plan.{key}" for key in written["plan"]), "margin_choice.loss_m"):
        assert f"\n| `{name}` |" in table, name


CAMPAIGNS = (DOCS / "how-to" / "campaigns.md").read_text()
FOLDER = (DOCS / "reference" / "formats" / "campaign-folder.md").read_text()


def test_the_file_that_the_guide_to_campaigns_shows_has_every_key_and_is_right():
    block = max(re.findall(r"```yaml\n(.*?)```", CAMPAIGNS, flags=re.DOTALL), key=len)  # the others are first steps
    data = parse_document(block, "docs/how-to/campaigns.md").data
    assert make_campaign(data).entry.rollouts == "failed"
    assert set(data) == {info.alias or name for name, info in CampaignFile.model_fields.items()}


def test_every_column_of_a_campaign_is_explained():
    names = {*GRID, *RESULT} - set(METRICS) | {"plan_s", "drive_wall_s"}
    assert [name for name in names if f"`{name}`" not in FOLDER and not name.startswith("version.")] == []


def test_every_key_of_a_manifest_is_explained(tmp_path):
    sweep({"worlds": "empty", "planners": "astar"}, tmp_path / "out", jobs=0)
    table = FOLDER.partition("`manifest.json` has these keys:")[2].partition("\n## ")[0]
    assert re.findall(r"^\| `(\w+)` \|", table, flags=re.MULTILINE) == list(read_manifest(tmp_path / "out"))


def test_the_line_for_pandas_reads_the_table(tmp_path, monkeypatch):
    import pandas

    monkeypatch.chdir(tmp_path)
    results = sweep({"worlds": "empty", "planners": "astar"}, "out/first", jobs=0)
    (line,) = re.findall(r"^\| pandas \| `(.*)` \|$", CAMPAIGNS, flags=re.MULTILINE)
    assert results.pandas().equals(eval(line, {"pandas": pandas}))


PAGE = (DOCS / "how-to" / "regression-tests.md").read_text()
REFERENCE = DOCS / "reference"


def block(language):
    (text,) = re.findall(rf"```{language}\n(.*?)```", PAGE, flags=re.DOTALL)
    return str(text)


def test_every_key_of_a_suite_is_explained():
    table = (REFERENCE / "formats" / "suite.md").read_text().split("| key | meaning |")[1].split("\n\n")[0]
    assert {key for key in ScenarioEntry.model_fields if f"`{key}`" not in table} == {"note"}
    properties = suite_schema()["$defs"]["ScenarioEntry"]["properties"]
    assert all(entry.get("description") for entry in properties.values())


def test_the_suite_is_read(tmp_path):
    (tmp_path / "page.drive.yaml").write_text(block("yaml"))
    assert [case.id for case in load_suite(tmp_path / "page.drive.yaml")] == [
        "forest[0]", "forest[1]", "random[0]", "random[1]", "random[2]", "closed-door[0]",
    ]  # fmt: skip


@pytest.mark.slow
def test_the_suite_and_the_tests_pass(tmp_path):
    (tmp_path / "page.drive.yaml").write_text(block("yaml"))
    (tmp_path / "test_page.py").write_text(block("python"))
    command = [sys.executable, "-m", "pytest", "-q", "-p", "antdrive.testing.plugin"]
    for words in (["--drive-update"], ["--drive-strict"]):
        done = subprocess.run([*command, *words], cwd=tmp_path, capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stdout
    assert "8 passed" in done.stdout


COMMAND = re.compile(r"`(?:python -m (?P<module>[\w.]+)|make (?P<target>[\w-]+)|antdrive (?P<command>[\w-]+))[^`]*`")
TABLE = re.compile(r"^\|[\s:|-]+\|$", re.MULTILINE)


BENCHMARKS = (DOCS / "benchmarks.md").read_text()
NOTEBOOK = [page for page in sorted((DOCS / "notebook").glob("*.md")) if page.stem != "index"]
SECTIONS = {
    f"{page.stem}: {section.partition(chr(10))[0]}": section
    for page in NOTEBOOK
    for section in re.split(r"^## ", page.read_text(), flags=re.MULTILINE)
    if TABLE.search(section)
}


@pytest.mark.parametrize("head", SECTIONS)
def test_a_section_of_the_notebook_names_a_command_that_exists(head):
    commands = list(COMMAND.finditer(SECTIONS[head]))
    assert commands, "which command measures it again?"
    for command in commands:
        assert exists(command), command[0]


def test_benchmarks_are_one_page_of_ten_figures():
    figures = re.findall(r"^\| \d+ \|.*", BENCHMARKS, re.MULTILINE)
    commands = [COMMAND.search(row.rpartition(" | ")[2]) for row in figures]
    assert len(BENCHMARKS.split()) <= 1200
    assert len(figures) == 10
    assert all(command and exists(command) for command in commands)


def test_benchmarks_link_every_page_of_the_notebook():
    assert [page.name for page in NOTEBOOK if f"| [{title(page)}](notebook/{page.name}) |" not in BENCHMARKS] == []
    listed = (DOCS / "notebook" / "index.md").read_text().partition("```{toctree}")[2]
    assert [page.name for page in NOTEBOOK if f"\n{page.stem}\n" not in listed] == []


def title(page):
    """The first heading of a page."""
    return page.read_text().partition("# ")[2].partition("\n")[0]


def exists(found):
    """Whether there is the module, the target of make or the command of antdrive."""
    if found["target"]:
        return re.search(rf"^{found['target']}:", (ROOT / "Makefile").read_text(), re.MULTILINE) is not None
    if found["command"]:
        return found["command"] in {*COMMANDS, "worlds", "robots"}
    path = ROOT / found["module"].replace(".", "/")
    return path.with_suffix(".py").exists() or (path / "__main__.py").exists()
