"""A campaign's folder: its grid, the results so far, and a table of both.

    manifest.json   the campaign as written, its size and hash, the versions of the latest command
    grid.parquet    a row for each run: its configuration and seed
    parts/          results: a new file every few seconds, merged from time to time
    rollouts/       the logs that are kept
    worlds/, robots/, planners/, controllers/  files for the commands that repeat runs
    runs.parquet    the table of all finished runs, written at the start and the end of a command

Every file is written under a temporary name, synced to the disk and renamed, so a killed process leaves no partial
file. The manifest comes first, so that a folder without one is no campaign's. A run made twice is in two parts but has
one row in the table.
"""

from __future__ import annotations

import json
import os
import time
import uuid
from collections.abc import Iterator, Mapping, Sequence, Set
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

from antdrive.base.atomic import atomic_write, write_text
from antdrive.base.errors import InputError, input_error
from antdrive.base.files import MAX_JSON_BYTES, open_regular, parse_json, read_bytes
from antdrive.base.optional import parquet_library
from antdrive.runs import results_folder
from antdrive.runs.campaigns.rows import CRASHED, NOT_CANONICAL, result_schema, result_table

if TYPE_CHECKING:
    import pyarrow

MANIFEST, GRID_FILE, PARTS, TABLE = "manifest.json", "grid.parquet", "parts", "runs.parquet"
FLUSH_EVERY = 2.0  # finished runs are written at least this often [s]
TRIES = 100  # attempts to read parts while another process merges them
MOST_PARTS = 200  # more are merged into one
MAX_TABLE_VALUES = 200_000_000
UNFINISHED = ".new-"  # prefix of temporary files


class Store:
    """The folder of a campaign, while this process alone writes into it.

    Attributes:
        folder: the folder
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self._rows: list[Mapping[str, Any]] = []
        self._written = time.monotonic()
        self._parts = len(parts_in(folder))

    def claim(self, manifest: Mapping[str, Any]) -> None:
        """Write the manifest, before any other file of a new folder."""
        write_text(self.folder / MANIFEST, json.dumps(manifest, indent=1, ensure_ascii=False) + "\n")
        (self.folder / PARTS).mkdir(exist_ok=True)

    def begin(self, grid: pyarrow.Table) -> None:
        """Write the grid and the table of the runs that it shares with earlier commands."""
        write_table(grid, self.folder / GRID_FILE)
        write_table(joined(self.folder), self.folder / TABLE)  # until the final one replaces it

    def add(self, row: Mapping[str, Any], log: bytes | None = None) -> None:
        """Keep a run's result; it is on the disk after `FLUSH_EVERY` seconds if `tick` is called that often."""
        if log is not None:
            try:
                with atomic_write(self.folder / row["rollout"]) as part:
                    part.write_bytes(log)
            except OSError as error:
                raise InputError(f"{row['rollout']}: cannot be written ({error.strerror or error})") from None
        self._rows.append(row)
        self.tick()

    def tick(self) -> None:
        """Write the pending results if the last write is `FLUSH_EVERY` seconds ago."""
        if time.monotonic() - self._written > FLUSH_EVERY:
            self.flush()

    def flush(self) -> None:
        """Write the pending results."""
        self._written = time.monotonic()
        if self._rows:
            write_table(result_table(self._rows), self.folder / PARTS / _part_name())
            self._rows = []
            self._parts += 1
        if self._parts > MOST_PARTS:
            self.merge()

    def merge(self) -> None:
        """Merge all parts into one. The old ones are deleted once the new one is on the disk."""
        old = parts_in(self.folder)
        if len(old) > 1:
            write_table(_results(self.folder), self.folder / PARTS / _part_name())
            for path in old:
                path.unlink(missing_ok=True)
        self._parts = 1

    def drop(self, keys: Set[str]) -> None:
        """Delete the results of some runs, so that they are made again."""
        old, table = parts_in(self.folder), _results(self.folder)
        names = table["key"].to_pylist()
        write_table(
            _rows(table, [i for i, key in enumerate(names) if key not in keys]), self.folder / PARTS / _part_name()
        )
        for path in old:
            path.unlink(missing_ok=True)
        for i, log in enumerate(table["rollout"].to_pylist()):  # last: a row that names a log has it
            if log is not None and names[i] in keys:
                (self.folder / log).unlink(missing_ok=True)
        self._parts = 1

    def finish(self) -> pyarrow.Table:
        """Write everything, merge the parts, write the table and return it."""
        self.flush()
        self.merge()
        table = joined(self.folder)
        write_table(table, self.folder / TABLE)
        return table


@contextmanager
def opened(folder: str | os.PathLike[str]) -> Iterator[Store]:
    """Open a campaign's folder for this process alone."""
    with results_folder.opened(Path(folder), MANIFEST, kind="a campaign") as path:
        for left in (*path.glob(f"{UNFINISHED}*"), *(path / PARTS).glob(f"{UNFINISHED}*")):
            left.unlink(missing_ok=True)  # of a killed process
        yield Store(path)


def results_in(folder: Path, column: str) -> dict[str, Any]:
    """Return one column of every run ever made in a folder, by key, even if the campaign has changed since."""
    results = _results(folder)
    return dict(zip(results["key"].to_pylist(), results[column].to_pylist(), strict=True))


def former_grid(folder: Path) -> pyarrow.Table | None:
    """Return the grid of the folder's previous campaign; None if there is none."""
    return read_table(folder / GRID_FILE) if (folder / GRID_FILE).exists() else None


def read_manifest(folder: str | Path) -> dict[str, Any]:
    """Read the manifest of a campaign's folder."""
    path = Path(folder) / MANIFEST
    if not path.exists():
        raise input_error(str(folder), f"no {MANIFEST} here; antdrive sweep writes it")
    text = read_bytes(path, MAX_JSON_BYTES, "a campaign's manifest")
    try:
        data = parse_json(text.decode("utf-8"))
    except (ValueError, RecursionError) as error:
        raise input_error(str(path), f"cannot be read ({error})") from None
    if not isinstance(data, dict) or type(data.get("size")) is not int:
        raise input_error(str(path), "not a campaign's manifest; antdrive sweep writes a new one")
    return data


def joined(folder: Path) -> pyarrow.Table:
    """Return a row for each finished run of the campaign, in the campaign's order."""
    grid, results = read_table(folder / GRID_FILE), _results(folder)
    places = {key: i for i, key in enumerate(results["key"].to_pylist())}
    keys = grid["key"].to_pylist()
    rows = [i for i, key in enumerate(keys) if key in places]
    left, right = _rows(grid, rows), _rows(results, [places[keys[i]] for i in rows])
    command = left.schema.get_field_index("command")
    for name in right.column_names:
        if name != "key" and name not in left.column_names:
            left = left.append_column(name, right[name])
    order = [name for name in left.column_names if name not in ("command", *NOT_CANONICAL)]
    order.insert(_after(order, "rollout"), left.column_names[command])
    return left.select([*order, *NOT_CANONICAL]).combine_chunks()


def _rows(table: pyarrow.Table, numbers: list[int]) -> pyarrow.Table:
    """Return some rows of a table, in this order."""
    arrow = parquet_library()
    return table.take(arrow.array(numbers, type=arrow.int64()))


def _after(names: Sequence[str], name: str) -> int:
    return list(names).index(name) + 1


def write_table(table: pyarrow.Table, path: Path) -> None:
    """Write an Arrow table as Parquet, atomically and synced to the disk."""
    parquet_library()
    import pyarrow.parquet

    temporary = path.with_name(f"{UNFINISHED}{uuid.uuid4().hex}{path.suffix}")
    try:
        with temporary.open("wb") as stream:
            pyarrow.parquet.write_table(table, stream, compression="zstd")
            stream.flush()
            os.fsync(stream.fileno())
        temporary.replace(path)
    except OSError as error:
        temporary.unlink(missing_ok=True)
        raise InputError(f"{path}: cannot be written ({error.strerror})") from None


def parts_in(folder: Path) -> list[Path]:
    """List the parts in a campaign's folder, in the order of writing."""
    return sorted(path for path in (folder / PARTS).glob("*.parquet") if not path.name.startswith(UNFINISHED))


def _part_name() -> str:
    return f"{time.time_ns():020d}-{uuid.uuid4().hex[:8]}.parquet"


def _tables(folder: Path) -> list[pyarrow.Table]:
    """Read the parts of a folder, even while another process merges them."""
    for _ in range(TRIES):
        tables = []
        for path in parts_in(folder):
            try:
                tables.append(_cast(read_table(path), result_schema()))
            except InputError:
                if path.exists():
                    raise
                break  # merged into another one since it was listed
        else:
            return tables
    raise input_error(str(folder / PARTS), "changes faster than it can be read; try again")


def _results(folder: Path) -> pyarrow.Table:
    """Return the results of all runs ever made in a folder, each once; a run that did not crash takes precedence."""
    arrow, schema = parquet_library(), result_schema()
    tables = _tables(folder)
    table = arrow.concat_tables(tables) if tables else schema.empty_table()
    places: dict[str, int] = {}
    outcomes = table["outcome"].to_pylist()
    for i, key in enumerate(table["key"].to_pylist()):
        if key not in places or (outcomes[places[key]] == CRASHED != outcomes[i]):
            places[key] = i
    return table if len(places) == len(table) else _rows(table, sorted(places.values()))


def _cast(table: pyarrow.Table, schema: pyarrow.Schema) -> pyarrow.Table:
    """Cast a table to the current columns; columns missing from another version are null."""
    arrow = parquet_library()
    if table.schema.equals(schema):
        return table
    have = set(table.column_names)
    columns = [
        table[field.name].cast(field.type) if field.name in have else arrow.nulls(len(table), field.type)
        for field in schema
    ]
    return arrow.table(columns, schema=schema)


def read_table(path: Path) -> pyarrow.Table:
    """Read a Parquet file; raise InputError if it is damaged or too large."""
    arrow = parquet_library()
    if not path.exists():
        raise input_error(str(path), "no such file; antdrive sweep writes it")
    try:
        with open_regular(path, kind="a Parquet table") as stream:
            size = arrow.parquet.read_metadata(stream)
            if size.num_rows * size.num_columns > MAX_TABLE_VALUES:
                raise input_error(
                    str(path), f"has {size.num_rows} rows of {size.num_columns} columns, too many to read"
                )
            return arrow.parquet.read_table(stream)
    except (OSError, arrow.ArrowException) as error:
        remedy = "; delete the file to repeat its runs" if path.parent.name == PARTS else ""
        raise input_error(
            str(path), f"cannot be read as Parquet ({getattr(error, 'strerror', None) or error}){remedy}"
        ) from None
