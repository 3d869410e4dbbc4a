"""Say below each table of a page when its figures came into the page: `python -m tools.entered docs/benchmarks.md`.

Git knows the commit of every row. The line below a table names the commits that brought its rows, the one with most rows
first, and is written anew each time. A row that is not committed yet is left out.
"""

from __future__ import annotations

import re
import subprocess
import sys
from collections import Counter
from pathlib import Path
from typing import NamedTuple

ENTERED = re.compile(r"^\*Entered .*\*$")
UNCOMMITTED = "0" * 40


class Origin(NamedTuple):
    """Where a line comes from.

    Attributes:
        commit: its commit
        date: the day of that commit
    """

    commit: str
    date: str


def origins(page: Path) -> list[Origin]:
    """The origin of each line of a page, as git knows it."""
    words = ["git", "blame", "-w", "-M", "-C", "--line-porcelain", "--", page.name]
    done = subprocess.run(words, cwd=page.parent, capture_output=True, text=True, check=True)  # noqa: S603
    found, commit, when = [], "", ""
    for line in done.stdout.splitlines():
        head = re.match(r"^([0-9a-f]{40}) ", line)
        if head:
            commit = head[1]
        elif line.startswith("committer-time "):
            when = day(int(line.split()[1]))
        elif line.startswith("\t"):
            found.append(Origin(commit, when))
    return found


def day(seconds: int) -> str:
    """The day (UTC) of a time since 1970 [s]."""
    from datetime import datetime, timezone

    return datetime.fromtimestamp(seconds, timezone.utc).date().isoformat()


def told(rows: list[Origin]) -> str:
    """The line below a table whose rows have these origins; empty if none is committed."""
    counts = Counter(row for row in rows if row.commit != UNCOMMITTED)
    ordered = sorted(counts, key=lambda one: (-counts[one], one))
    named = [f"{one.date} ({one.commit[:7]})" for one in ordered]
    return f"*Entered {', some rows '.join(named[:2])}{''.join(f', {one}' for one in named[2:])}.*" if named else ""


def rewritten(text: str, lines: list[Origin]) -> str:
    """A page with the line below each of its tables.

    Args:
        text: the page, in Markdown
        lines: the origin of each of its lines
    """
    old = text.splitlines()
    new: list[str] = []
    rows: list[Origin] = []
    for k, line in enumerate(old):
        if ENTERED.match(line):
            continue
        new.append(line)
        if line.startswith("|"):
            rows.append(lines[k])
        elif rows and not line:  # the first two rows are the head and its rule
            said, rows = told(rows[2:]), []
            new += [said, ""] if said else []
    kept = "\n".join(new) + "\n"
    return re.sub(r"(^\*Entered .*\*\n)\n{2,}", r"\1\n", kept, flags=re.MULTILINE)


def main(words: list[str]) -> int:
    """Write the lines into pages."""
    for name in words:
        page = Path(name).resolve()
        page.write_text(rewritten(page.read_text(encoding="utf-8"), origins(page)), encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
