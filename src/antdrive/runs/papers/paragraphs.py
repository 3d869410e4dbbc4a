"""Paragraphs of the papers that claim something, each with the rows that test it or the reason why none does.

Line numbers are those of the papers' plain text, one per printed line.
"""

from __future__ import annotations

import csv
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path


@dataclass(frozen=True, kw_only=True)
class Paragraph:
    """What one paragraph of a paper claims."""

    paper: str
    lines: str  # "76" or "146-162"
    place: str  # section, figure or table
    quote: str  # verbatim, apart from line breaks; " ... " where words are left out
    rows: tuple[str, ...]  # ids of claims
    reason: str  # why no row tests it, or part of it; empty if rows test all


def read_table(folder: str, paper: str) -> Iterator[dict[str, str]]:
    """Yield the rows of a paper's table in `folder`, by heading."""
    with (Path(__file__).parent / folder / f"{paper}.csv").open(newline="", encoding="utf-8") as file:
        yield from csv.DictReader(file)


def paragraphs(paper: str) -> list[Paragraph]:
    """Return the paragraphs of a paper, in the order of its text."""
    return [
        Paragraph(paper=paper, **{**row, "rows": tuple(filter(None, row["rows"].split(" | ")))})  # type: ignore[arg-type]
        for row in read_table("paragraphs", paper)
    ]
