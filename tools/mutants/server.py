"""Server that runs pytest in forks with preloaded libraries and unchanged modules.

Loading them takes longer than most tests. The first line of the standard input names the modules to load and the module to
exclude, which will change; each further line is a run. The answer to a run is a line: pytest's exit code, or the negative
number of the signal that ended it, and its processor time [s].

Runs are limited by processor time, which endless loops exhaust and load from other programs does not affect.
"""

from __future__ import annotations

import importlib
import json
import math
import os
import resource
import sys
import traceback
from pathlib import Path

#: pytest looks for no plugins (see `Server`); the settings in pyproject.toml need these.
PLUGINS = ("pytest_timeout",)


def serve() -> None:
    """Load modules, then run pytest for each request."""
    answers = os.fdopen(os.dup(1), "w")
    nowhere = os.open(os.devnull, os.O_WRONLY)
    spoken = os.dup(2)
    os.dup2(nowhere, 1)
    os.dup2(nowhere, 2)  # PyBullet prints when it is loaded
    first = json.loads(sys.stdin.readline())
    for name in (*first["modules"], *PLUGINS):
        importlib.import_module(name)
    os.dup2(spoken, 2)
    if first["changing"] in sys.modules:
        raise ImportError(f"{first['changing']} was loaded before it was changed")
    for line in sys.stdin:
        run = json.loads(line)
        child = os.fork()
        if child == 0:
            _run(run["arguments"], Path(run["output"]), run["limit"])
        _, status, used = os.wait4(child, 0)
        answer = {"code": os.waitstatus_to_exitcode(status), "seconds": used.ru_utime + used.ru_stime}
        print(json.dumps(answer), file=answers, flush=True)


def _run(arguments: list[str], output: Path, limit: float) -> None:
    code = 3
    try:
        import pytest

        resource.setrlimit(resource.RLIMIT_CPU, (math.ceil(limit), math.ceil(limit) + 5))
        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
        written = os.open(output, os.O_WRONLY | os.O_CREAT | os.O_TRUNC, 0o600)
        os.dup2(written, 1)
        os.dup2(written, 2)
        os.dup2(os.open(os.devnull, os.O_RDONLY), 0)
        code = int(pytest.main(arguments, plugins=[sys.modules[name] for name in PLUGINS]))
    except BaseException:  # pytest has failed, or a fault has ended it; whoever reads the output wants to know how
        traceback.print_exc()
    finally:
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(code)


if __name__ == "__main__":
    serve()
