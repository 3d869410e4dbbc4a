"""Runs pytest again and again, each time in a fork that has the libraries and the unchanged modules loaded already.

Loading them takes longer than most tests. The first line of the standard input says which modules to load and which must not be
loaded, as it will be changed; each further line is a run. The answer to a run is pytest's exit code on a line of its own.
"""

from __future__ import annotations

import importlib
import json
import os
import sys
from pathlib import Path


def serve() -> None:
    """Load modules, then run pytest as often as asked."""
    answers = os.fdopen(os.dup(1), "w")
    nowhere = os.open(os.devnull, os.O_WRONLY)
    spoken = os.dup(2)
    os.dup2(nowhere, 1)
    os.dup2(nowhere, 2)  # PyBullet prints when it is loaded
    first = json.loads(sys.stdin.readline())
    for name in first["modules"]:
        importlib.import_module(name)
    os.dup2(spoken, 2)
    if first["changing"] in sys.modules:
        raise ImportError(f"{first['changing']} was loaded before it was changed")
    for line in sys.stdin:
        run = json.loads(line)
        child = os.fork()
        if child == 0:
            _run(run["arguments"], Path(run["output"]))
        _, status = os.waitpid(child, 0)
        print(os.waitstatus_to_exitcode(status), file=answers, flush=True)


def _run(arguments: list[str], output: Path) -> None:
    code = 3
    try:
        import pytest

        written = os.open(output, os.O_WRONLY | os.O_CREAT | os.O_TRUNC, 0o600)
        os.dup2(written, 1)
        os.dup2(written, 2)
        os.dup2(os.open(os.devnull, os.O_RDONLY), 0)
        code = int(pytest.main(arguments))
        sys.stdout.flush()
        sys.stderr.flush()
    finally:
        os._exit(code)


if __name__ == "__main__":
    serve()
