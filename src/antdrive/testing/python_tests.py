"""Python tests with the fixture `drive`, for `antdrive check` and `antdrive accept`."""

from __future__ import annotations

import contextlib
import fnmatch
import importlib.util
import io
import re
import shlex
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from antdrive.base.errors import InputError, input_error
from antdrive.base.files import MAX_BYTES, read_bytes
from antdrive.runs.suites.suite import SUFFIX
from antdrive.testing.evaluation import INVALID_INPUT, CheckResult, Update

if TYPE_CHECKING:
    import pytest

    from antdrive.views.artefacts import Results

#: Outcome of a test whose drives passed, but not the test.
FAILED_OTHERWISE = "test_failed"
PLUGIN = "antdrive.testing.plugin"
UPDATES: dict[Update, list[str]] = {"": [], "new": ["--drive-update-new"], "all": ["--drive-update"]}


def is_module(word: str) -> bool:
    """Return whether a word of a command names a Python file or one of its tests."""
    return word.partition("::")[0].endswith(".py")


def drive_python_tests(
    words: Sequence[str], only: str | None, update: Update, results: Results
) -> tuple[list[CheckResult], list[str]]:
    """Run the Python tests with the fixture `drive` by pytest; return the results and the unused baselines.

    Args:
        words: files, FILE.py::test, and folders, of which other tests are left out
        only: a pattern with * and ? for the test's name
        update: baselines to write
        results: destination of logs, pages and figures

    Raises:
        InputError: pytest is not installed or cannot run, or a file has no such test.
    """
    named = [word for word in words if is_module(word)]
    if not named and not any(any(Path(word).rglob("*.py")) for word in words):
        return [], []
    if importlib.util.find_spec("pytest") is None:
        if named:
            raise input_error(named[0], "needs pytest, which is not installed: pip install pytest")
        return [], []
    import pytest

    options = ["-p", PLUGIN, "--continue-on-collection-errors", *UPDATES[update]]
    options += [f"--drive-results={results.folder.resolve()}", *["--drive-keep"] * results.keep]
    if importlib.util.find_spec("xdist") is not None:
        options += ["-n", "0"]  # results stay in this process
    drives = _Drives(only)
    said = io.StringIO()
    with contextlib.redirect_stdout(said), contextlib.redirect_stderr(said):
        code = pytest.main([*words, *options], plugins=[drives])
    if code in (pytest.ExitCode.USAGE_ERROR, pytest.ExitCode.INTERNAL_ERROR):
        errors = re.findall(r"^ERROR: (.+)", said.getvalue(), re.MULTILINE)
        raise input_error("pytest", *(errors[:1] or said.getvalue().splitlines()[-1:]))
    if code == pytest.ExitCode.INTERRUPTED and not drives.results:
        raise KeyboardInterrupt
    if named and not drives.results:
        raise InputError(f"{' '.join(named)}: no test{f' matches {only!r} and' if only else ''} uses the fixture drive")
    return drives.results, sorted(drives.unused)


class _Drives:
    """A plugin of pytest: it leaves out tests without the fixture and suites, and keeps the results.

    Attributes:
        results: of all drives, and of tests that failed otherwise
        unused: unused baselines
    """

    def __init__(self, only: str | None) -> None:
        self.results: list[CheckResult] = []
        self.unused: set[str] = set()
        self._only = only
        self._of_test: list[CheckResult] = []  # of the current test

    def pytest_ignore_collect(self, collection_path: Path) -> bool | None:
        """Leave out suites, and modules that do not mention the fixture, without importing them."""
        if collection_path.name.endswith(SUFFIX):
            return True
        module = collection_path.suffix == ".py" and collection_path.name != "conftest.py" and collection_path.is_file()
        return True if module and b"drive" not in read_bytes(collection_path, MAX_BYTES) else None

    def pytest_collection_modifyitems(self, config: pytest.Config, items: list[pytest.Item]) -> None:
        """Leave out tests without the fixture, and those that the pattern does not match."""
        chosen = [item for item in items if "drive" in getattr(item, "fixturenames", ()) and self._matches(item)]
        config.hook.pytest_deselected(items=[item for item in items if item not in chosen])
        items[:] = chosen

    def _matches(self, item: pytest.Item) -> bool:
        name = getattr(item, "originalname", item.name)
        return self._only is None or fnmatch.fnmatchcase(name, self._only) or item.name == self._only

    def pytest_runtest_makereport(self, item: pytest.Item) -> None:
        """Take the results of a test's drives."""
        from antdrive.testing.plugin import results_in

        self._of_test = results_in(item)

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        """Keep the results of a test; add one if it failed otherwise."""
        if report.when == "call":
            self.results += self._of_test
        if report.failed and all(result.passed for result in self._of_test):
            self._add(report, FAILED_OTHERWISE)

    def pytest_collectreport(self, report: pytest.CollectReport) -> None:
        """Keep the error of a module that cannot be imported."""
        if report.failed:
            self._add(report, INVALID_INPUT)

    def pytest_unconfigure(self, config: pytest.Config) -> None:
        """Keep the unused baselines."""
        from antdrive.testing.plugin import unused_in

        self.unused |= unused_in(config)

    def _add(self, report: Any, outcome: str) -> None:
        crash = getattr(report.longrepr, "reprcrash", None)
        errors = re.findall(r"^E +(.+)", report.longreprtext, re.MULTILINE)
        fault = crash.message.splitlines()[0] if crash is not None else (errors or [report.outcome])[-1]
        command = shlex.join(["pytest", report.nodeid])
        self.results.append(
            CheckResult(
                address=report.nodeid,
                passed=False,
                outcome=outcome,
                certified=False,
                faults=(fault,),
                commands=(command,),
            )
        )
