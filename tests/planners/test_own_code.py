"""Planners in people's own files and modules."""

from __future__ import annotations

import hashlib
import importlib.metadata
from pathlib import Path

import pytest

from antdrive import Scenario
from antdrive.base.errors import InputError
from antdrive.planners import load_planner, planner_version, record_name

TEXT = """
from dataclasses import dataclass
from antdrive.planners import AStar

@dataclass(frozen=True)
class Mine(AStar):
    width: int = 3
"""


def test_a_file_is_read_again_when_it_has_changed(tmp_path: Path) -> None:
    path = tmp_path / "mine.py"
    path.write_text(TEXT)
    assert load_planner(f"{path}:Mine").width == 3  # type: ignore[attr-defined]
    assert load_planner(f"{path}:Mine", width="5").width == 5  # type: ignore[attr-defined]
    path.write_text(TEXT.replace("3", "4"))
    assert load_planner(f"{path}:Mine").width == 4  # type: ignore[attr-defined]


def test_records_call_it_by_its_class(tmp_path: Path) -> None:
    (tmp_path / "mine.py").write_text(TEXT)
    assert Scenario.of("empty", f"{tmp_path}/mine.py:Mine").planner_label == "Mine"
    assert record_name("astar") == "astar"


def test_a_module_is_found_in_the_working_directory(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "own_module_of_a_test.py").write_text(TEXT)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("sys.path", ["elsewhere"])
    assert load_planner("own_module_of_a_test:Mine", width=7).width == 7  # type: ignore[attr-defined]
    digest = hashlib.sha256(TEXT.encode()).hexdigest()[:8]
    assert planner_version("own_module_of_a_test:Mine") == f"own_module_of_a_test {digest}"


def test_a_module_that_is_taken_from_elsewhere_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "json.py").write_text(TEXT)
    monkeypatch.chdir(tmp_path)
    with pytest.raises(
        InputError, match=r"json is imported from .*, and there is one in the working directory; give it"
    ):
        load_planner("json:Mine")


def test_files_of_different_folders_have_modules_of_their_own(tmp_path: Path) -> None:
    for folder in ("a", "b"):
        (tmp_path / folder).mkdir()
        (tmp_path / folder / "beside_own_code.py").write_text(f"WIDTH = {'ab'.index(folder)}\n")
        text = TEXT.replace("= 3", "= beside_own_code.WIDTH").replace("\nfrom", "\nimport beside_own_code\nfrom", 1)
        (tmp_path / folder / "mine.py").write_text(text)
    widths = [load_planner(f"{tmp_path}/{folder}/mine.py:Mine").width for folder in "abab"]  # type: ignore[attr-defined]
    assert widths == [0, 1, 0, 1]


def test_the_version_of_a_planner_is_that_of_its_distribution() -> None:
    assert planner_version("astar") == f"antdrive {importlib.metadata.version('antdrive')}"


@pytest.mark.parametrize(
    ("name", "problem"),
    [
        ("no_such_module_here:Mine", r"cannot be imported \(ModuleNotFoundError: "),
        ("json:Mine", "json has no 'Mine'; it has "),
        ("json:", "json has no ''"),
        ("antdrive.planners.graph.search:Astar", r"has no 'Astar'; did you mean AStar\?"),
        (":Mine", "cannot be imported"),
        ("nowhere.py:Mine", "nowhere.py: no such file"),
        ("nosuch", "no planner is called 'nosuch'"),
    ],
)
def test_a_wrong_name_is_one_line(name: str, problem: str) -> None:
    for function in (load_planner, planner_version):
        with pytest.raises(InputError, match=problem) as refused:
            function(name)
        assert "\n" not in str(refused.value)
