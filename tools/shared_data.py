"""Where the worlds and maps are that nobody here made: BARN, DynaBARN and MovingAI (docs/how-to/data.md).

Tests and benchmarks read them there. Without them the tests that need them skip, and the benchmarks ask for a path.
"""

from __future__ import annotations

import os
from pathlib import Path


def data_folder() -> Path:
    """The folder that the environment variable `ANTDRIVE_DATA` names, else `shared/data` beside the checkout."""
    named = os.environ.get("ANTDRIVE_DATA")
    return Path(named).expanduser() if named else Path(__file__).parents[2] / "shared" / "data"


BARN = data_folder() / "barn" / "barn50.tar.xz"
DYNABARN = data_folder() / "dynabarn" / "dynabarn10.json"
MOVINGAI = data_folder() / "movingai" / "movingai_dev.tar.xz"
