"""Tables of text: CSV files, and columns between spaces."""

from __future__ import annotations

import csv
import re
from pathlib import Path
from typing import TypeAlias

from antdrive.base.errors import input_error
from antdrive.base.files import read_bytes

Rows: TypeAlias = list[tuple[int, list[str]]]  # numbers of lines, and their cells
_NUMBER = re.compile(r"[-+.\de]+|nan", re.IGNORECASE)


def read_columns(path: Path, most: int) -> tuple[list[str], Rows]:
    """Return the heads and the rows of a table of at most so many bytes.

    The heads are words in its first row, else a comment with as many words as the row, else none.
    """
    try:
        lines = enumerate(read_bytes(path, most, "a table").decode("utf-8-sig").splitlines(), start=1)
        every = [(n, line.strip(" ")) for n, line in lines if line.strip()]
        rows = [(n, line) for n, line in every if line[0] not in "#%"]
        mark = next((sign for sign in ",;\t" if rows and sign in rows[0][1]), " ")
        table = [(n, _cells(line, mark)) for n, line in rows]
        notes = [_cells(line.lstrip("#% "), mark) for _, line in every if line[0] in "#%"]
    except (UnicodeDecodeError, csv.Error) as error:
        raise input_error(str(path), f"is no table of text in UTF-8: {error}") from None
    if table and not any(map(_NUMBER.fullmatch, table[0][1])):
        return table.pop(0)[1], table
    return next((note for note in notes if table and len(note) == len(table[0][1])), []), table


def _cells(line: str, mark: str) -> list[str]:
    return [cell.strip(" ") for cell in next(csv.reader([line], delimiter=mark, skipinitialspace=True))]
