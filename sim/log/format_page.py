"""The tables of `docs/reference/rollout-format.md`, generated from the code: `python -m antdrive.sim.log.format_page PAGE.md`.

A test checks that the page agrees with the code.
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
    """A page with its tables as they must be. Each stands between `<!-- table NAME -->` and `<!-- end -->`.

    Args:
        page: the page's text
    """
    for name, table in _tables().items():
        start, end = f"<!-- table {name} -->\n", "<!-- end -->"
        before, _, rest = page.partition(start)
        _, _, after = rest.partition(end)
        page = f"{before}{start}{table}{end}{after}"
    return page


def _tables() -> dict[str, str]:
    return {
        "arrays": _table(("array", "shape", "dtype", "content"), _arrays()),
        "record": _table(("key", "JSON", "content"), ((f"`{key}`", kind, text) for key, kind, text in record_keys())),
        "outcomes": _table(("outcome", "sentence"), ((f"`{outcome.key}`", outcome.value) for outcome in Outcome)),
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
    target = Path(sys.argv[1])
    target.write_text(with_tables(target.read_text(encoding="utf-8")), encoding="utf-8")
