"""The results of a campaign, as a table to read: Arrow, pandas, and the canonical form that repetitions share."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from antdrive.runs.campaigns.extras import parquet_library
from antdrive.runs.campaigns.rows import NOT_CANONICAL
from antdrive.runs.campaigns.store import TABLE, joined, read_manifest

if TYPE_CHECKING:
    import pyarrow


@dataclass(frozen=True, eq=False)
class SweepResults:
    """What came out of a campaign.

    Attributes:
        folder: the campaign's folder
        table: an Arrow table with a row for each run that is done, in the campaign's order
        size: how many runs the campaign has
        made: how many of them were made by the call that returned this
        notes: what people should know who go on with a campaign, a sentence each
    """

    folder: Path
    table: pyarrow.Table
    size: int
    made: int = 0
    notes: tuple[str, ...] = ()

    @property
    def complete(self) -> bool:
        """Whether all runs of the campaign are done."""
        return len(self.table) == self.size

    @property
    def path(self) -> Path:
        """The table's file."""
        return self.folder / TABLE

    @property
    def succeeded(self) -> int:
        """How many runs stopped at the goal, certified."""
        return sum(self.table["succeeded"].to_pylist())

    @property
    def outcomes(self) -> dict[str, int]:
        """How many runs ended in which way, the most frequent first."""
        return dict(Counter(self.table["outcome"].to_pylist()).most_common())

    def pandas(self) -> Any:
        """The table as a pandas DataFrame; needs pandas."""
        return self.table.to_pandas()


def read_results(folder: str | Path) -> SweepResults:
    """What has come out of a campaign so far, also while it runs and after it was killed.

    Args:
        folder: the campaign's folder

    Raises:
        InputError: the folder holds no campaign, or a file in it is damaged.
    """
    path, manifest = Path(folder), read_manifest(folder)
    return SweepResults(path, joined(path), int(manifest["size"]))


def canonical_table(folder: str | Path) -> pyarrow.Table:
    """The part of the results that every repetition of the campaign shares, sorted by key.

    Wall-clock times and the number of attempts are left out. Processes, machines, order and interruptions do not show.

    Args:
        folder: the campaign's folder
    """
    table = read_results(folder).table
    kept = [name for name in table.column_names if name not in NOT_CANONICAL]
    return table.select(kept).sort_by("key").combine_chunks()


def canonical_bytes(folder: str | Path) -> bytes:
    """The canonical table as bytes in Arrow's stream format, for comparisons.

    Args:
        folder: the campaign's folder
    """
    arrow, table = parquet_library(), canonical_table(folder)
    sink = arrow.BufferOutputStream()
    with arrow.ipc.new_stream(sink, table.schema) as writer:
        writer.write_table(table)
    return bytes(sink.getvalue().to_pybytes())
