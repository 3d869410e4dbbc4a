"""The canonical table of a campaign, for comparisons of its bits."""

import pyarrow

from antdrive.runs.campaigns import canonical_table


def canonical_bytes(folder):
    """The table of a folder in Arrow's stream format."""
    table, sink = canonical_table(folder), pyarrow.BufferOutputStream()
    with pyarrow.ipc.new_stream(sink, table.schema) as writer:
        writer.write_table(table)
    return sink.getvalue().to_pybytes()
