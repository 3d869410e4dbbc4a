"""What a release needs: one version everywhere, forms and workflows that are valid, a distribution that is checked."""

from __future__ import annotations

import re
import subprocess
from pathlib import Path
from typing import Any

import pytest
import yaml

from tools.dist import built, version_of

ROOT = Path(__file__).parent.parent
VERSION = version_of((ROOT / "pyproject.toml").read_text())
DATED = re.findall(r"^## (\d\S*) - (\d{4}-\d\d-\d\d)$", (ROOT / "CHANGELOG.md").read_text(), re.MULTILINE)


def parsed(path: Path) -> Any:
    return yaml.safe_load(path.read_text())


def test_the_version_is_the_same_everywhere() -> None:
    citation = parsed(ROOT / "CITATION.cff")
    assert (citation["version"], str(citation["date-released"])) == (VERSION, DATED[0][1])
    assert DATED[0][0] == VERSION


def test_the_changelog_has_dated_sections_below_what_is_unreleased() -> None:
    heads = re.findall(r"^## (.+)$", (ROOT / "CHANGELOG.md").read_text(), re.MULTILINE)
    assert heads == ["Unreleased", *(f"{version} - {date}" for version, date in DATED)]


def test_the_version_is_read_from_the_project_and_nowhere_else() -> None:
    assert version_of('[tool.x]\nversion = "9"\n\n[project]\nname = "a"\nversion = "1.2"\n') == "1.2"
    with pytest.raises(ValueError, match="states no version"):
        version_of('[project]\nname = "a"\n\n[tool.x]\nversion = "9"\n')


def test_the_workflow_runs_what_everybody_runs() -> None:
    (job,) = parsed(ROOT / ".github" / "workflows" / "ci.yml")["jobs"].values()
    assert [step["run"] for step in job["steps"] if "run" in step] == [".ci/run"]
    assert (ROOT / ".ci" / "run").stat().st_mode & 0o111


@pytest.mark.parametrize(
    "path",
    [path for path in sorted((ROOT / ".github" / "ISSUE_TEMPLATE").glob("*.yml")) if path.stem != "config"],
    ids=lambda path: path.stem,
)
def test_a_form_for_issues_is_one(path: Path) -> None:
    form = parsed(path)
    assert form["name"]
    assert form["description"]
    questions = [part for part in form["body"] if part["type"] != "markdown"]
    assert {part["type"] for part in questions} <= {"textarea", "input", "dropdown", "checkboxes"}
    assert len({part["id"] for part in questions}) == len(questions)
    assert all(part["attributes"]["label"] for part in questions)
    assert any(part.get("validations", {}).get("required") for part in questions)


def test_a_folder_that_holds_something_else_is_no_distribution(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="holds nothing; must hold antdrive-1-py3-none-any"):
        built(tmp_path, "1")
    for name in ("antdrive-1.tar.gz", "antdrive-1-py3-none-any.whl"):
        (tmp_path / name).touch()
    assert built(tmp_path, "1").suffix == ".whl"
    (tmp_path / "antdrive-0.tar.gz").touch()
    with pytest.raises(ValueError, match=r"holds antdrive-0\.tar\.gz, "):
        built(tmp_path, "1")


def test_make_knows_how_to_build_and_check_it() -> None:
    done = subprocess.run(["make", "-n", "dist"], cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert "-m build" in done.stdout
    assert "-m tools.dist dist" in done.stdout
