"""The line below a table names the commits that brought its rows."""

from __future__ import annotations

import os
import subprocess
from pathlib import Path

import pytest

from tools.entered import UNCOMMITTED, Origin, main, rewritten, told

TABLE = "| a | b |\n|---|---|\n"


def test_the_commit_of_most_rows_comes_first_and_uncommitted_rows_do_not_count() -> None:
    one, other = Origin("1" * 40, "2026-01-02"), Origin("2" * 40, "2026-01-03")
    assert told([one, other, other]) == "*Entered 2026-01-03 (2222222), some rows 2026-01-02 (1111111).*"
    assert told([one, Origin(UNCOMMITTED, "2026-01-04")]) == "*Entered 2026-01-02 (1111111).*"
    assert told([Origin(UNCOMMITTED, "2026-01-04")]) == ""


def test_an_old_line_gives_way_and_a_second_run_changes_nothing() -> None:
    text = f"# A\n\n{TABLE}| 1 | 2 |\n\n*Entered 2025-01-01 (0000000).*\n\nText.\n"
    row = Origin("1" * 40, "2026-01-02")
    once = rewritten(text, [row] * text.count("\n"))
    assert once == f"# A\n\n{TABLE}| 1 | 2 |\n\n*Entered 2026-01-02 (1111111).*\n\nText.\n"
    assert rewritten(once, [row] * once.count("\n")) == once


def test_git_says_where_rows_are_from(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for key in ("AUTHOR", "COMMITTER"):
        monkeypatch.setenv(f"GIT_{key}_NAME", "A")
        monkeypatch.setenv(f"GIT_{key}_EMAIL", "a@example.org")

    def git(*words: str, date: str = "2026-01-01") -> str:
        env = {**os.environ, "GIT_AUTHOR_DATE": f"{date}T12:00Z", "GIT_COMMITTER_DATE": f"{date}T12:00Z"}
        return subprocess.run(["git", *words], cwd=tmp_path, env=env, capture_output=True, text=True, check=True).stdout

    page = tmp_path / "page.md"
    page.write_text(f"{TABLE}| 1 | 2 |\n| 3 | 4 |\n\nText.\n")
    git("init", "--quiet")
    git("add", "page.md")
    git("commit", "--quiet", "-m", "first")
    page.write_text(page.read_text().replace("| 3 |", "| 5 |"))
    git("commit", "--quiet", "-am", "second", date="2026-01-05")
    first, second = git("log", "--reverse", "--format=%h").split()
    assert main([str(page)]) == 0
    line = page.read_text().splitlines()[5]
    assert {first[:7], second[:7]} == set(line.replace("(", ")").split(")")[1::2])
    assert "2026-01-01" in line
    assert "2026-01-05" in line
