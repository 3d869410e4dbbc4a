"""Tables of measurements name the command that measures them, and the site says when their rows were last edited."""

from __future__ import annotations

import importlib
import os
import re
import subprocess
from pathlib import Path
from typing import Any

import pytest

from antdrive.cli.app import COMMANDS

ROOT = Path(__file__).resolve().parents[2]
COMMAND = re.compile(r"`(?:python -m (?P<module>[\w.]+)|make (?P<target>[\w-]+)|antdrive (?P<command>[\w-]+))[^`]*`")
TABLE = re.compile(r"^\|[\s:|-]+\|$", re.MULTILINE)


def sections(page: Path) -> dict[str, str]:
    """The text below each heading of a page, up to the next one."""
    found: dict[str, str] = {}
    for part in re.split(r"^(?=## )", page.read_text(), flags=re.MULTILINE)[1:]:
        for section in re.split(r"^(?=### )", part, flags=re.MULTILINE):
            found[section.partition("\n")[0]] = section
    return found


SECTIONS = {head: text for head, text in sections(ROOT / "docs" / "benchmarks.md").items() if TABLE.search(text)}


def test_there_are_tables() -> None:
    assert len(SECTIONS) >= 20


@pytest.mark.parametrize("head", SECTIONS)
def test_a_section_with_a_table_names_a_command_that_exists(head: str) -> None:
    commands = list(COMMAND.finditer(SECTIONS[head]))
    assert commands, "which command measures it again?"
    for found in commands:
        assert exists(found), found[0]


def exists(found: re.Match[str]) -> bool:
    """Whether there is the module, the target of make or the command of antdrive."""
    if found["target"]:
        return re.search(rf"^{found['target']}:", (ROOT / "Makefile").read_text(), re.MULTILINE) is not None
    if found["command"]:
        return found["command"] in {*COMMANDS, "worlds", "robots"}
    path = ROOT / found["module"].replace(".", "/")
    return path.with_suffix(".py").exists() or (path / "__main__.py").exists()


@pytest.mark.parametrize("wrong", ["make nonsense", "antdrive nonsense", "python -m benchmarks.nonsense"])
def test_a_command_that_does_not_exist_is_noticed(wrong: str) -> None:
    (found,) = COMMAND.finditer(f"`{wrong} --jobs 2`")
    assert not exists(found)


@pytest.fixture
def measured(monkeypatch: pytest.MonkeyPatch) -> Any:
    monkeypatch.syspath_prepend(str(ROOT / "docs" / "_ext"))
    return importlib.import_module("antdrive_measured")


def git(folder: Path, *words: str, day: str = "2026-01-01") -> str:
    env = {"PATH": os.environ["PATH"], "GIT_CONFIG_NOSYSTEM": "1"}
    env |= {f"GIT_{who}_{key}": value for who in ("AUTHOR", "COMMITTER") for key, value in
           {"NAME": "a", "EMAIL": "a@b.example", "DATE": f"{day}T12:00:00+00:00"}.items()}  # fmt: skip
    done = subprocess.run(
        ["git", *words], cwd=folder, env={**env, "HOME": str(folder)}, capture_output=True, text=True, check=True
    )
    return done.stdout.strip()


PAGE = "# Title\n\n| a | b |\n|---|---|\n| 1 | 2 |\n| 3 | 4 |\n\nText.\n\n| c |\n|---|\n| 5 |\n"


def test_a_table_has_the_newest_commit_of_its_rows(measured: Any, tmp_path: Path) -> None:
    page = tmp_path / "page.md"
    page.write_text(PAGE)
    assert measured.dated(PAGE, measured.changes_of(page)) == PAGE, "no repository"
    git(tmp_path, "init", "-q")
    git(tmp_path, "add", "page.md")
    git(tmp_path, "commit", "-qm", "first")
    old = git(tmp_path, "rev-parse", "HEAD")
    page.write_text(PAGE.replace("| 3 | 4 |", "| 3 | 44 |").replace("Text", "Prose"))
    git(tmp_path, "commit", "-qam", "second", day="2026-02-03")
    new = git(tmp_path, "rev-parse", "HEAD")
    text = measured.dated(page.read_text(), measured.changes_of(page))
    assert f"| 3 | 44 |\n\n{{.antdrive-measured}}\nRows last edited in commit `{new[:7]}`, 2026-02-03.\n\nProse" in text
    assert text.endswith(f"| 5 |\n\n{{.antdrive-measured}}\nRows last edited in commit `{old[:7]}`, 2026-01-01.\n")
    page.write_text(PAGE.replace("| 5 |", "| 55 |"))
    assert measured.dated(page.read_text(), measured.changes_of(page))[-7:] == "| 55 |\n", "not committed"


MARKED = "Text.\n\n| a |\n|---|\n| 1 |\n\n<!-- measured by: make bench | two cores -->\n| b |\n|---|\n| 2 |\n"


def test_elsewhere_a_marked_table_has_its_command_and_machine_too(measured: Any) -> None:
    changes = {number: measured.Change(0, "a" * 40) for number in range(1, 11)}
    head, _, foot = measured.dated(MARKED, changes, every=False).partition("| 2 |\n")
    assert head + "| 2 |\n" == MARKED, "a table without a mark is left alone"
    assert foot == (
        "\n{.antdrive-measured}\n`make bench` measures it again. Measured on two cores."
        " Rows last edited in commit `aaaaaaa`, 1970-01-01.\n"
    )
    assert measured.dated(MARKED, {}, every=False).endswith("again. Measured on two cores.\n"), "an archive"


MARKS = {
    (page.relative_to(ROOT).as_posix(), command)
    for page in sorted((ROOT / "docs").rglob("*.md"))
    if not {"_build", "_gallery"} & set(page.parts)
    for command in re.findall(r"^<!-- measured by: (.+?) \|", page.read_text(), re.MULTILINE)
}


def test_there_are_marks() -> None:
    assert len(MARKS) >= 3


@pytest.mark.parametrize(("page", "command"), sorted(MARKS))
def test_a_mark_names_a_command_that_exists(page: str, command: str) -> None:
    found = COMMAND.fullmatch(f"`{command}`")
    assert found
    assert exists(found)


def test_a_fault_of_git_is_told_once_and_an_archive_is_none(
    measured: Any, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    page = tmp_path / "page.md"
    page.write_text(PAGE)
    assert measured.changes_of(page) == {}
    assert capsys.readouterr().err == "", "no repository"
    (tmp_path / ".git").write_text("gitdir: nowhere\n")
    assert measured.changes_of(page) == measured.changes_of(page) == {}
    assert capsys.readouterr().err.startswith("Tables of measurements have no dates: git rev-parse: fatal: ")
    measured.told.cache_clear()


def test_a_clone_without_its_history_says_nothing(measured: Any, tmp_path: Path) -> None:
    (tmp_path / "from").mkdir()
    page = tmp_path / "from" / "page.md"
    for text in ("", PAGE):
        page.write_text(text)
        if not text:
            git(tmp_path / "from", "init", "-q")
            git(tmp_path / "from", "add", "page.md")
        git(tmp_path / "from", "commit", "-qam", "one")
    git(tmp_path, "clone", "-q", "--depth", "1", f"file://{tmp_path / 'from'}", "to")
    assert measured.changes_of(page)
    assert measured.changes_of(tmp_path / "to" / "page.md") == {}
