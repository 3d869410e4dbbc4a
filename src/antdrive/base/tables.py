"""Tables of text that fit the terminal, signs of success, and lists of files."""

from __future__ import annotations

import math
import re
import shutil
import sys
import textwrap
from collections.abc import Iterable, Iterator, Mapping, Sequence

GOOD, BAD = "✓", "✗"  # signs of success and failure
LEAST_WRAPPED = 24  # least width of a wrapped column [characters]


def table(headers: Sequence[str], rows: Iterable[Sequence[str]], *, columns: int | None = None) -> Iterator[str]:
    """Yield the lines of a table: aligned columns where they fit the terminal, or `columns` elsewhere (None: any width).

    Where they do not fit, only the last column is wrapped; else rows become columns; else each row is a block with a line
    for each column. Nothing is cut.
    """
    heads, body = tuple(headers), [tuple(row) for row in rows]
    columns = shutil.get_terminal_size().columns if sys.stdout.isatty() else columns
    lines = [heads, *body]
    aligned = list(_aligned(lines))
    if columns is None or _fits(aligned, columns):
        return iter(aligned)
    left = columns - sum(2 + max(len(line[i]) for line in lines) for i in range(len(heads) - 1))
    if left >= max(LEAST_WRAPPED, *(len(word) for line in lines for word in line[-1].split())):
        return _aligned(part for line in lines for part in _wrapped(line, left))
    turned = list(_aligned(zip(*lines, strict=True)))
    return iter(turned) if _fits(turned, columns) else _blocks(heads, body, columns)


def _aligned(lines: Iterable[Sequence[str]]) -> Iterator[str]:
    lines = list(lines)
    widths = [max(len(line[i]) for line in lines) for i in range(len(lines[0]) - 1)]
    for line in lines:
        padded = [cell.ljust(width) for cell, width in zip(line, widths, strict=False)]
        yield "  ".join([*padded, line[-1]]).rstrip()


def _fits(lines: Iterable[str], columns: int) -> bool:
    return all(len(line) <= columns for line in lines)


def _wrapped(line: Sequence[str], width: int) -> Iterator[tuple[str, ...]]:
    """Yield a row as several, its last column wrapped to a width."""
    *first, last = line
    for part in _words(last, width):
        yield (*first, part)
        first = [""] * len(first)


def _blocks(heads: Sequence[str], rows: Iterable[Sequence[str]], columns: int) -> Iterator[str]:
    """Yield each row as a block: a line for each column, those after the first indented."""
    names = [heads[0], *(f"  {head}" for head in heads[1:])]
    width = max(map(len, names))
    for row in rows:
        for name, cell in zip(names, row, strict=True):
            for part in _words(cell, max(LEAST_WRAPPED, columns - width - 2)):
                yield f"{name:{width}}  {part}".rstrip()
                name = ""  # of the lines that follow


def _words(text: str, width: int) -> list[str]:
    return textwrap.wrap(text, width, break_long_words=False, break_on_hyphens=False) or [""]


def marked(good: bool, text: str) -> str:
    """Return a text, on a terminal with the sign of success or failure before it; the command line colours the sign."""
    return f"{GOOD if good else BAD} {text}" if sys.stdout.isatty() else text


def rounded_down(value: float, digits: int) -> float:
    """Round a lower bound down."""
    return math.floor(value * 10**digits + 1e-6) / 10**digits if math.isfinite(value) else value


def file_lines(files: Mapping[str, object]) -> Iterator[str]:
    """Return one line per written file: name and path."""
    width = max([8, *map(len, files)])
    return (f"  {name:{width}} {path}" for name, path in files.items())


def markdown_text(text: str) -> str:
    """Escape a text for Markdown, its tables and HTML blocks; brackets only where they could be a link."""
    return re.sub(r"[&<>|`*_~\\@#]|\](?=[(\[:])|\[(?=\^)", lambda found: f"&#{ord(found[0])};", text)
