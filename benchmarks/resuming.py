"""Results in pieces: files with one JSON object in each line, which a benchmark appends to and goes on from."""

from __future__ import annotations

import json
import subprocess
from collections.abc import Mapping
from pathlib import Path
from typing import Any


def read_lines(path: Path | None) -> list[dict[str, Any]]:
    """The objects of a file, without a last line that was cut short; none if there is no file.

    Args:
        path: the file; None: there is none
    """
    if path is None or not path.exists():
        return []
    text = path.read_text(encoding="utf-8")
    whole, _, cut = text.rpartition("\n")
    if cut:  # the process was killed while it wrote
        path.write_text(whole + "\n" if whole else "", encoding="utf-8")
    return [json.loads(line) for line in whole.splitlines()]


def append_line(path: Path | None, value: Mapping[str, Any]) -> None:
    """Append an object to a file.

    Args:
        path: the file; None: nothing is written
        value: the object
    """
    if path is not None:
        path.parent.mkdir(parents=True, exist_ok=True)
        with path.open("a", encoding="utf-8") as file:
            file.write(json.dumps(value) + "\n")


def current_commit() -> str:
    """The commit of antdrive that runs; empty where there is none."""
    command = ["git", "rev-parse", "--short", "HEAD"]
    done = subprocess.run(command, cwd=Path(__file__).parent, capture_output=True, text=True, check=False)
    return done.stdout.strip()
