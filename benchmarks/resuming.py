"""Resumable results: JSONL files that a benchmark appends to and resumes from."""

from __future__ import annotations

import json
import subprocess
from collections.abc import Mapping
from pathlib import Path
from typing import Any


def read_lines(path: Path | None) -> list[dict[str, Any]]:
    """Return the objects of a file, ignoring a truncated last line; none without a file.

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
    """Return antdrive's commit; empty without one."""
    command = ["git", "rev-parse", "--short", "HEAD"]
    done = subprocess.run(command, cwd=Path(__file__).parent, capture_output=True, text=True, check=False)
    return done.stdout.strip()
