"""Pages of drives with another log inside."""

import json

from antdrive.sim.log import packing
from antdrive.sim.log.rollout import MAX_BYTES


def changed(path, change):
    """Unpack the log in a page, change its parts, and pack it again."""
    text = path.read_text(encoding="utf-8")
    log = packing.packed_in(text.encode(), path.name)
    arrays, record, stated = packing.unpack(log, MAX_BYTES)
    values = json.loads(record)
    change(arrays, values, stated)
    unhashed = {key: values.pop(key) for key in ("digest", "times", "written") if key in values}
    path.write_text(
        text.replace(log.decode(), packing.pack(arrays, json.dumps(values, sort_keys=True), unhashed, stated))
    )
