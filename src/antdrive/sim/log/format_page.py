"""Tables of the reference, generated from the code: `python -m antdrive.sim.log.format_page docs/reference/*.md`.

Arrays and record of a log, outcomes, metrics: each has its place on one page. A test checks that the pages agree with the code.
"""

from __future__ import annotations

import dataclasses
import re
import sys
from collections.abc import Iterable
from pathlib import Path

from antdrive.sim.log.metrics import METRICS
from antdrive.sim.log.outcome import Outcome
from antdrive.sim.log.record import attributes_of, record_keys
from antdrive.sim.log.rollout import Rollout


def with_tables(page: str) -> str:
    """A page with those tables that it has as they must be. Each stands between `<!-- table NAME -->` and `<!-- end -->`."""
    for name, table in tables().items():
        start, end = f"<!-- table {name} -->\n", "<!-- end -->"
        before, found, rest = page.partition(start)
        if found:
            page = f"{before}{start}{table}{end}{rest.partition(end)[2]}"
    return page


def tables() -> dict[str, str]:
    """Each table by its name, in Markdown."""
    codes = {Outcome.SUCCEEDED: "0 if the log proves it, else 1"}
    return {
        "arrays": _table(("array", "shape", "dtype", "content"), _arrays()),
        "record": _table(("key", "JSON", "content"), ((f"`{key}`", kind, text) for key, kind, text in record_keys())),
        "outcomes": _table(
            ("outcome", "sentence", "exit code"), ((f"`{one.key}`", one.value, codes.get(one, "1")) for one in Outcome)
        ),
        "metrics": _table(
            ("metric", "unit", "better", "definition"),
            ((f"`{metric.name}`", metric.unit, metric.better, metric.definition) for metric in METRICS.values()),
        ),
    }


def _arrays() -> Iterable[tuple[str, ...]]:
    """Name, shape, dtype and content of each array, from the docstring and annotations of `Rollout`."""
    contents = attributes_of(Rollout)
    for field in dataclasses.fields(Rollout):
        dtype = re.search(r"np\.(\w+)\]$", str(field.type))
        shape = re.search(r"\((T|N|K|P|S)[\w, ]*\)", contents[field.name])
        if dtype and shape:
            yield f"`{field.name}`", shape[0], dtype[1], contents[field.name]


def _table(heads: tuple[str, ...], rows: Iterable[tuple[str, ...]]) -> str:
    lines = [heads, ("---",) * len(heads), *rows]
    return "".join("| " + " | ".join(cell.replace("|", "\\|") for cell in line) + " |\n" for line in lines)


if __name__ == "__main__":
    for target in map(Path, sys.argv[1:]):
        target.write_text(with_tables(target.read_text(encoding="utf-8")), encoding="utf-8")
