"""Location of third-party worlds and maps: BARN, DynaBARN and MovingAI (docs/how-to/data.md).

Tests and benchmarks read them. Without them, tests that need them are skipped, and benchmarks require a path.
"""

from __future__ import annotations

import os
from pathlib import Path


def data_folder() -> Path:
    """Return the folder in the environment variable `ANTDRIVE_DATA`, else `shared/data` next to the checkout."""
    named = os.environ.get("ANTDRIVE_DATA")
    return Path(named).expanduser() if named else Path(__file__).parents[2] / "shared" / "data"


BARN = data_folder() / "barn" / "barn50.tar.xz"
DYNABARN = data_folder() / "dynabarn" / "dynabarn10.json"
MOVINGAI = data_folder() / "movingai" / "movingai_dev.tar.xz"
