"""Size of the project: `python -m tools.size [REVISION ...]` counts lines, reach and circles of commits, HEAD without any."""

from __future__ import annotations

import ast
import io
import subprocess
import sys
import tarfile
import tempfile
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
ROOMS = ("src", "src/antdrive/cli", "tests", "tests/audit", "benchmarks", "tools")


def imports(source: Path) -> dict[str, set[str]]:
    """Return the modules of antdrive that each module imports at its top, those for types alone included."""
    files = {".".join(path.relative_to(source).with_suffix("").parts): path for path in source.rglob("*.py")}
    files = {name.removesuffix(".__init__"): path for name, path in files.items()}
    return {name: set(_imported(path)) & files.keys() - {name} for name, path in files.items()}


def _imported(path: Path) -> Iterator[str]:
    statements = list(ast.parse(path.read_text(encoding="utf-8")).body)
    while statements:
        statement = statements.pop()
        if isinstance(statement, ast.If):  # TYPE_CHECKING
            statements += statement.body
        elif isinstance(statement, ast.Import):
            yield from (alias.name for alias in statement.names)
        elif isinstance(statement, ast.ImportFrom) and statement.module:
            modules = [f"{statement.module}.{alias.name}" for alias in statement.names]
            yield from (*modules, statement.module)


def reached(graph: dict[str, set[str]], start: str) -> set[str]:
    """Return the modules that a module imports, directly or not."""
    found, new = set[str](), [start]
    while new:
        more = graph.get(new.pop(), set()) - found
        found |= more
        new += more
    return found


def circles(graph: dict[str, set[str]]) -> list[int]:
    """Return the sizes of the groups of modules that import each other."""
    reach = {name: reached(graph, name) for name in graph}
    groups = {
        frozenset(other for other in reach[name] if name in reach[other]) for name in graph if name in reach[name]
    }
    return sorted(map(len, groups), reverse=True)


def counts(root: Path) -> dict[str, object]:
    """Return the counts of a tree of the project."""
    lines = {room: sum(len(path.read_bytes().splitlines()) for path in (root / room).rglob("*.py")) for room in ROOMS}
    graph = imports(root / "src")
    scenario = {name for name in reached(graph, "antdrive.sim.scenario") if name.startswith("antdrive.")}
    named = [path for path in (root / "src").rglob("*.py") if "odometry" in path.read_text(encoding="utf-8")]
    return {
        "source": lines["src"],
        "of them the command line": lines["src/antdrive/cli"],
        "tests without audits": lines["tests"] - lines["tests/audit"],
        "audits": lines["tests/audit"],
        "benchmarks and tools": lines["benchmarks"] + lines["tools"],
        "modules that `sim.scenario` reaches": len(scenario),
        "files that name odometry": len(named),
        "circles of modules": circles(graph),
    }


def at(revision: str) -> dict[str, object]:
    """Return the counts of a commit."""
    packed = subprocess.run(["git", "archive", revision], cwd=ROOT, check=True, capture_output=True).stdout  # noqa: S603, S607
    with tempfile.TemporaryDirectory() as folder, tarfile.open(fileobj=io.BytesIO(packed)) as archive:
        archive.extractall(folder, filter="data")
        return counts(Path(folder))


def main(revisions: list[str]) -> int:
    """Print a table with a column for each commit."""
    columns = [at(revision) for revision in revisions]
    sys.stdout.write(f"{'':38}" + "".join(f"{revision:>18}" for revision in revisions) + "\n")
    for name in columns[0]:
        sys.stdout.write(f"{name:38}" + "".join(f"{column[name]!s:>18}" for column in columns) + "\n")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:] or ["HEAD"]))
