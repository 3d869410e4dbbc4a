"""Lists of planners, worlds and robots, and the version, printed without importing what they list.

`python -m tools.reference` writes the rows of the lists to `listed.tsv`; a test compares them with the catalogues.
"""

from __future__ import annotations

import platform
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from pathlib import Path

from antdrive.base.optional import PLANNER_GROUP
from antdrive.base.tables import table

Row = Sequence[str]
Rows = Iterable[Row]
LISTED = Path(__file__).with_name("listed.tsv")
#: Words of command lines that only list, by what they list.
LISTS = {
    ("planners",): "planners",
    ("worlds", "list"): "worlds",
    ("robots",): "robots",
    ("robots", "list"): "robots",
}


def lines_of(words: Sequence[str]) -> Iterator[str] | None:
    """Return the lines of a command line that only lists; None for other ones, and where a package adds planners."""
    if list(words) == ["--version"]:
        return iter([version_line()])
    kind = LISTS.get(tuple(words))
    if kind is None or (kind == "planners" and _planners_are_added()):
        return None
    lines = LISTED.read_text(encoding="utf-8").splitlines()
    return LINES[kind]([line.split("\t")[1:] for line in lines if line.startswith(f"{kind}\t")])


def version_line() -> str:
    """Return the name and version of this program, those of its physics and of Python."""
    from antdrive.base.version import __version__, physics_version

    return f"antdrive {__version__} (pybullet {physics_version()}, python {platform.python_version()})"


def planner_lines(rows: Rows) -> Iterator[str]:
    """Yield the list of planners from name, summary, and the shapes that their plans keep clear."""
    rows = list(rows)
    yield from table(("planner", "about"), (row[:2] for row in rows))
    yield ""
    names = {shape: [row[0] for row in rows if row[2] == shape] for _, _, shape in rows}
    yield from table(("plan for", "planners"), ((shape, ", ".join(each)) for shape, each in names.items()))
    yield "options: antdrive planners NAME"


def world_lines(rows: Rows) -> Iterator[str]:
    """Yield the list of worlds from name, size, numbers of obstacles and movers, and summary."""
    yield from table(("world", "size m", "obstacles", "movers", "about"), rows)
    yield "details: antdrive worlds show NAME"


def robot_lines(rows: Rows) -> Iterator[str]:
    """Yield the list of robots from name, radius, speed, acceleration, and summary."""
    yield from table(("robot", "radius m", "m/s", "m/s2", "about"), rows)
    yield "details: antdrive robots NAME, antdrive robots show NAME"


LINES: Mapping[str, Callable[[Rows], Iterator[str]]] = {
    "planners": planner_lines,
    "worlds": world_lines,
    "robots": robot_lines,
}


def _planners_are_added() -> bool:
    import importlib.metadata

    return bool(importlib.metadata.entry_points(group=PLANNER_GROUP))
