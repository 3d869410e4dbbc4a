"""When the rows of a table were last edited: below each table of measurements stand the commit and the day, as git knows them.

On pages of measurements (`PAGES`) these are all tables. Elsewhere it is a table after a comment
`<!-- measured by: COMMAND | MACHINE -->`, and command and machine stand below it, too.

A table's commit is the newest one that changed a row of it; other rows may be older. In an archive and in a clone without
its history nothing is written. Where git fails for another reason, the build says why and goes on.
"""

from __future__ import annotations

import datetime
import functools
import re
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

if TYPE_CHECKING:
    from sphinx.application import Sphinx

#: Pages with tables of measurements.
PAGES = re.compile(r"benchmarks|papers/\w+")
BLAMED = re.compile(r"^(?P<commit>[0-9a-f]{40}) \d+ (?P<line>\d+)")
MARK = re.compile(r"^<!-- measured by: (?P<command>[^|]+?) \| (?P<machine>.+?) -->$")
RULE = re.compile(r"^\|[\s:|-]+\|\s*$")


class Change(NamedTuple):
    """Who changed a line last.

    Attributes:
        time: of the commit, in seconds since 1970
        commit: its hash; only zeros where the line is not committed
    """

    time: int
    commit: str


def git(folder: Path, *words: str) -> str:
    """What git prints; empty, with a line on the build's log, where it fails."""
    try:
        done = subprocess.run(["git", *words], cwd=folder, capture_output=True, text=True, check=False)
    except OSError as error:
        told(f"git: {error.strerror}")
        return ""
    if done.returncode:
        told(f"git {words[0]}: {' '.join(done.stderr.split()) or f'exit code {done.returncode}'}")
        return ""
    return done.stdout


@functools.cache
def told(reason: str) -> None:
    """Say once why tables have no dates; no warning of Sphinx, which would end the build."""
    print(f"Tables of measurements have no dates: {reason}", file=sys.stderr)


def repository_of(folder: Path) -> Path | None:
    """The nearest folder above that has a `.git`."""
    return next((one for one in (folder, *folder.parents) if (one / ".git").exists()), None)


def changes_of(page: Path) -> dict[int, Change]:
    """For each line of a file, from 1, who changed it last; nothing where git cannot know."""
    if (
        repository_of(page.parent) is None
        or git(page.parent, "rev-parse", "--is-shallow-repository").strip() != "false"
    ):
        return {}
    found: dict[int, Change] = {}
    times: dict[str, int] = {}
    commit, line = "", 0
    for text in git(page.parent, "blame", "-w", "--porcelain", "--", page.name).splitlines():
        begins = BLAMED.match(text)
        if begins:
            commit, line = begins["commit"], int(begins["line"])
        elif text.startswith("committer-time "):
            times[commit] = int(text.split()[1])
        elif text.startswith("\t"):
            found[line] = Change(times[commit], commit)
    return found


def tables_of(lines: list[str]) -> Iterator[tuple[int, int]]:
    """The numbers, from 1, of the first and the last row of each table's figures."""
    for number, line in enumerate(lines, start=1):
        if RULE.match(line) and number > 1 and lines[number - 2].startswith("|"):
            last = number
            while last < len(lines) and lines[last].startswith("|"):
                last += 1
            if last > number:
                yield number + 1, last


def mark_before(lines: list[str], first: int) -> re.Match[str] | None:
    """The comment before a table whose first row of figures has this number."""
    above = (line.strip() for line in reversed(lines[: first - 3]))
    return MARK.match(next((line for line in above if line), ""))


def dated(text: str, changes: dict[int, Change], every: bool = True) -> str:
    """A page's text with a line below each table that says when its rows were last edited.

    Args:
        text: the page, in Markdown
        changes: for each of its lines who changed it last
        every: of every table; else of those with a comment that names command and machine
    """
    lines = text.splitlines()
    for first, last in reversed(list(tables_of(lines))):
        mark = mark_before(lines, first)
        if not (every or mark):
            continue
        said = [f"`{mark['command']}` measures it again. Measured on {mark['machine']}."] if mark else []
        rows = [changes.get(number) for number in range(first, last + 1)]
        newest = None if None in rows else max(row for row in rows if row)
        if newest and newest.commit.strip("0"):
            day = datetime.datetime.fromtimestamp(newest.time, datetime.timezone.utc).date()
            said.append(f"Rows last edited in commit `{newest.commit[:7]}`, {day.isoformat()}.")
        if said:
            lines[last:last] = ["", "{.antdrive-measured}", " ".join(said)]
    return "\n".join(lines) + "\n"


def page_read(app: Sphinx, docname: str, source: list[str]) -> None:
    """Date the tables of a page."""
    path = Path(app.env.doc2path(docname))
    every = PAGES.fullmatch(docname) is not None
    if path.suffix == ".md" and (every or "<!-- measured by: " in source[0]):
        source[0] = dated(source[0], changes_of(path), every)
        repository = repository_of(path.parent)
        commits = repository / ".git" / "logs" / "HEAD" if repository else None
        if commits and commits.exists():
            app.env.note_dependency(commits, docname=docname)  # rows get their date when they are committed


def setup(app: Sphinx) -> dict[str, Any]:
    """Date tables when pages are read, before anything changes their lines."""
    app.connect("source-read", page_read, priority=100)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
