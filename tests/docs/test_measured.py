"""Tables of measurements name the command that measures them."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from antdrive.cli.commands import COMMANDS

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


MARKS = {
    (page.relative_to(ROOT).as_posix(), command)
    for page in sorted((ROOT / "docs").rglob("*.md"))
    if not {"_build", "_gallery"} & set(page.parts)
    for command in re.findall(r"^<!-- measured by: (.+?) \|", page.read_text(), re.MULTILINE)
}


@pytest.mark.parametrize(("page", "command"), sorted(MARKS))
def test_a_mark_names_a_command_that_exists(page: str, command: str) -> None:
    found = COMMAND.fullmatch(f"`{command}`")
    assert found
    assert exists(found)
