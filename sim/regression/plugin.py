"""The pytest plugin: suites `*.drive.yaml` are collected, and tests have the fixture `drive`.

Importing it must cost nothing: a run of pytest that collects no suite and uses no fixture imports nothing else of antdrive.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

if TYPE_CHECKING:
    from antdrive.sim.regression.checking import CheckResult, Update
    from antdrive.sim.regression.suite import SuiteCase

SUFFIX = ".drive.yaml"


def pytest_addoption(parser: pytest.Parser) -> None:
    """Add the options `--drive-*`."""
    group = parser.getgroup("antdrive", "drives (antdrive)")
    group.addoption(
        "--drive-update", action="store_true", help="write the baselines of all drives that are as expected"
    )
    group.addoption("--drive-update-new", action="store_true", help="write the baselines that are missing")


def pytest_collect_file(file_path: Path, parent: pytest.Collector) -> DriveSuite | None:
    """Collect suites."""
    return DriveSuite.from_parent(parent, path=file_path) if file_path.name.endswith(SUFFIX) else None


class DriveSuite(pytest.File):
    """A suite as pytest collects it."""

    def collect(self) -> Iterator[DriveItem]:
        """One item for each scenario and seed."""
        from antdrive.sim.regression.names import check_names
        from antdrive.sim.regression.suite import load_suite
        from antdrive.worlds.errors import InputError

        try:
            cases = load_suite(self.path)
            for case in cases:
                check_names(case)
        except InputError as error:
            raise self.CollectError(str(error)) from None
        for case in cases:
            yield DriveItem.from_parent(self, name=case.id, case=case)


class DriveFailure(Exception):
    """A test of a suite failed; its message says why.

    Attributes:
        result: what came out of the test
    """

    def __init__(self, result: CheckResult) -> None:
        super().__init__(result.message)
        self.result = result


class DriveItem(pytest.Item):
    """A scenario of a suite with one seed.

    Attributes:
        case: the test
    """

    def __init__(self, *, case: SuiteCase, **others: Any) -> None:
        super().__init__(**others)
        self.case = case

    def runtest(self) -> None:
        """Drive and judge."""
        from antdrive.sim.regression.checking import check_case

        result = check_case(self.case, update=update_of(self.config))
        if not result.passed:
            raise DriveFailure(result)

    def repr_failure(self, excinfo: pytest.ExceptionInfo[BaseException], style: Any = None) -> Any:
        """The message alone, where a drive or what people wrote is wrong; else the traceback."""
        from antdrive.planners import PlannerError
        from antdrive.worlds.errors import InputError

        if isinstance(excinfo.value, DriveFailure | InputError | PlannerError):
            return str(excinfo.value)
        return super().repr_failure(excinfo, style)

    def reportinfo(self) -> tuple[Path, int | None, str]:
        """The suite, the line of the scenario, and the test's name."""
        line = self.case.document.lines.get(("scenarios", self.case.name))
        return self.path, None if line is None else line - 1, self.case.id


def update_of(config: pytest.Config) -> Update:
    """Which baselines this run of pytest writes."""
    if config.getoption("drive_update"):
        return "all"
    return "new" if config.getoption("drive_update_new") else ""
