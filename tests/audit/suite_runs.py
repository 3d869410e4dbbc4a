"""Suite runs in other processes, for `tests.audit.planted`.

As a pytest plugin, `-p tests.audit.suite_runs`, it writes each test's result to the file named by ANTDRIVE_RUN, and shuffles the
tests with the seed in ANTDRIVE_SHUFFLE.
"""

from __future__ import annotations

import json
import os
import random
import subprocess
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, TypeAlias

import pytest

ROOT = Path(__file__).parents[2]
EXAMPLE = ROOT / "examples" / "regression_suite"
PLUGINS = ("-p", "antdrive.testing.plugin", "-p", "tests.audit.suite_runs", "-p", "no:cacheprovider")

#: What came out of each test, by its name.
Tests: TypeAlias = dict[str, dict[str, Any]]

_RESULTS: Tests = {}


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    seed = os.environ.get("ANTDRIVE_SHUFFLE")
    if seed:
        random.Random(int(seed)).shuffle(items)


def pytest_runtest_logreport(report: pytest.TestReport) -> None:
    if report.when == "call" or report.failed:
        facts = {name.removeprefix("drive."): value for name, value in report.user_properties}
        _RESULTS[report.nodeid.rpartition("/")[2]] = {
            "passed": report.passed,
            "message": report.longreprtext,
            **{key: facts.get(key, "") for key in ("digest", "outcome", "results")},
        }


def pytest_collectreport(report: pytest.CollectReport) -> None:
    if report.failed:
        facts = dict.fromkeys(("digest", "outcome", "results"), "")
        _RESULTS[report.nodeid] = {"passed": False, "message": report.longreprtext, **facts}


def pytest_sessionfinish(session: pytest.Session) -> None:
    path = os.environ.get("ANTDRIVE_RUN")
    if path and not hasattr(session.config, "workeroutput"):
        Path(path).write_text(json.dumps(_RESULTS))


def with_pytest(
    folder: Path, *words: str, flags: Sequence[str] = (), env: Mapping[str, str] | None = None, cwd: Path | None = None
) -> Tests:
    """Run the tests of a folder. Return their results by name.

    Args:
        folder: holds the suites
        words: further words for pytest
        flags: for the interpreter
        env: variables to set
        cwd: the working directory; by default the folder
    """
    out = folder / "tests.json"
    out.unlink(missing_ok=True)
    command = [sys.executable, *flags, "-m", "pytest", "-q", *PLUGINS, *words]
    env = environment(out, env)
    done = subprocess.run(command, cwd=cwd or folder, env=env, capture_output=True, text=True, check=False)
    if not out.exists():
        raise RuntimeError(done.stdout[-2000:] + done.stderr[-2000:])
    found = json.loads(out.read_text())
    assert isinstance(found, dict)
    return found


def with_check(folder: Path, *words: str, env: Mapping[str, str] | None = None) -> Tests:
    """Run `antdrive check` on the suites of a folder. Return the results by test."""
    command = [sys.executable, "-m", "antdrive", "check", ".", "--json", *words]
    env = environment(None, env)
    done = subprocess.run(command, cwd=folder, env=env, capture_output=True, text=True, check=False)
    tests = json.loads(done.stdout)["tests"]
    return {
        test["address"]: {
            "passed": test["passed"], "message": "\n".join([*test["faults"], *test["details"]]), "digest": test["digest"],
            "outcome": test["outcome"], "results": "",
        }
        for test in tests
    }  # fmt: skip


def environment(out: Path | None, extra: Mapping[str, str] | None) -> dict[str, str]:
    """Return the environment of a run: results next to the suite, and no bytecode."""
    own = {"PYTHONPATH": str(ROOT), "PYTHONDONTWRITEBYTECODE": "1"}
    env = {**os.environ, **own, **(extra or {})}
    for name in ("GITHUB_STEP_SUMMARY", "PYTEST_ADDOPTS"):
        env.pop(name, None)
    return env | ({"ANTDRIVE_RUN": str(out)} if out else {})
