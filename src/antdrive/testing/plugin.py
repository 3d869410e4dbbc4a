"""pytest plugin: collects suites (`*.drive.yaml`) and provides the fixture `drive`.

It must be cheap to import: a pytest run without suites and drives imports nothing else of antdrive.
"""

from __future__ import annotations

import contextlib
import os
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

if TYPE_CHECKING:
    from antdrive.runs.suites.suite import SuiteCase
    from antdrive.testing.evaluation import CheckResult, Update
    from antdrive.testing.fixture import DriveFixture
    from antdrive.views.artefacts import Results

SUFFIX = ".drive.yaml"
WORKER_KEY = "antdrive_unused"  # key for unused baselines reported by xdist workers

_RESULTS = pytest.StashKey[list[Any]]()  # results of a test's drives
_UNUSED = pytest.StashKey[set[str]]()  # unused baselines
_COMPILED = pytest.StashKey[bool]()  # whether the kernels are compiled
_LISTENER = pytest.StashKey["_Listener"]()


def pytest_addoption(parser: pytest.Parser) -> None:
    """Add the options `--drive-*`."""
    group = parser.getgroup("antdrive", "drives (antdrive)")
    group.addoption("--drive-update", action="store_true", help="write baselines of drives that meet expectations")
    group.addoption("--drive-update-new", action="store_true", help="write missing baselines")
    group.addoption("--drive-strict", action="store_true", help="fail on unused baselines")
    group.addoption(
        "--drive-results",
        metavar="FOLDER",
        help="folder for logs, pages and figures of failed drives (default: user cache)",
    )
    group.addoption("--drive-keep", action="store_true", help="write results of passed drives, too")
    group.addoption(
        "--drive-plan-limit", metavar="SECONDS", help="limit on the time of a plan or replan (default: 600, or off)"
    )


def pytest_configure(config: pytest.Config) -> None:
    """Initialise the records of this run, and set the limit on planning time for this process and its workers."""
    from antdrive.base.guarded import LIMIT, USUAL_LIMIT

    given = config.getoption("drive_plan_limit")
    if given is not None:
        os.environ[LIMIT] = given
    else:
        os.environ.setdefault(LIMIT, USUAL_LIMIT)
    config.stash[_UNUSED], config.stash[_LISTENER] = set(), _Listener()
    config.pluginmanager.register(config.stash[_LISTENER], "antdrive-listener")


def pytest_collect_file(file_path: Path, parent: pytest.Collector) -> DriveSuite | None:
    """Collect suites."""
    return DriveSuite.from_parent(parent, path=file_path) if file_path.name.endswith(SUFFIX) else None


class DriveSuite(pytest.File):
    """A suite as a pytest collector."""

    def collect(self) -> Iterator[DriveItem]:
        """Yield one item per scenario and seed."""
        from antdrive.base.errors import InputError
        from antdrive.runs.suites.suite import load_suite
        from antdrive.testing.unused import unused_of_suite

        try:
            cases = load_suite(self.path)
            for case in cases:
                case.check_names()
        except InputError as error:
            raise self.CollectError(str(error)) from None
        self.config.stash[_UNUSED].update(str(path) for path in unused_of_suite(self.path, cases))
        for case in cases:
            # A node id given as text makes pytest parse [0] as a parameter, as it does for --lf.
            yield DriveItem.from_parent(self, name=case.id, nodeid=f"{self.nodeid}::{case.id}", case=case)


class DriveItem(pytest.Item):
    """A scenario of a suite with one seed.

    Attributes:
        case: the test
    """

    def __init__(self, *, case: SuiteCase, **others: Any) -> None:
        super().__init__(**others)
        self.case = case

    def runtest(self) -> None:
        """Drive and evaluate."""
        from antdrive.testing.evaluation import evaluate_case
        from antdrive.testing.fixture import DriveFailure

        report_compiling(self.config)
        result = evaluate_case(self.case, update=update_of(self.config), results=results_of(self.config))
        note(self, result)
        if not result.passed:
            raise DriveFailure(result)

    def repr_failure(self, excinfo: pytest.ExceptionInfo[BaseException], style: Any = None) -> Any:
        """Return only the message of a failed drive or invalid input, otherwise the traceback."""
        from antdrive.base.errors import InputError
        from antdrive.testing.fixture import DriveFailure

        if isinstance(excinfo.value, DriveFailure | InputError):
            return str(excinfo.value)
        return super().repr_failure(excinfo, style)

    def reportinfo(self) -> tuple[Path, int | None, str]:
        """Return the suite, the scenario's line and the test's name."""
        line = self.case.document.lines.get(("scenarios", self.case.name))
        return self.path, None if line is None else line - 1, self.case.id


@pytest.fixture
def drive(request: pytest.FixtureRequest) -> DriveFixture:
    """Drive scenarios and compare them with their baselines: `drive("forest", planner=MyPlanner(), seed=1)`.

    The test fails if the drive misses a demand or is worse than its baseline; `drive.run(...)` only drives.
    """
    from antdrive.testing.fixture import DriveFixture

    report_compiling(request.config)
    item, config = request.node, request.config
    at_root = config.invocation_params.dir.resolve() == config.rootpath.resolve()
    return DriveFixture(
        file=item.path,
        test=_name_in_file(item),
        address=item.nodeid,
        repeat="" if at_root else f"{item.path}::{item.nodeid.partition('::')[2]}",
        update=update_of(request.config),
        results=results_of(request.config),
        report=lambda result: note(item, result),
    )


def report_compiling(config: pytest.Config) -> None:
    """Print a line when a kernel compiles."""
    if _COMPILED in config.stash:
        return
    config.stash[_COMPILED] = True
    from antdrive.base import kernel_cache

    def say(_: str) -> None:
        kernel_cache.on_compile = kernel_cache.ignore
        capture = config.pluginmanager.getplugin("capturemanager")
        with capture.global_and_fixture_disabled() if capture else contextlib.nullcontext():
            print(f"\nantdrive: {kernel_cache.COMPILING}", file=sys.stderr, flush=True)  # noqa: T201 - also in xdist workers

    kernel_cache.on_compile = say


def note(item: pytest.Item, result: CheckResult) -> None:
    """Record a drive's result for reports."""
    from antdrive.testing.session_summary import properties

    item.stash.setdefault(_RESULTS, []).append(result)
    item.user_properties.extend(properties(result))


def results_in(item: pytest.Item) -> list[CheckResult]:
    """Return the results of a test's drives so far."""
    return [*item.stash[_RESULTS]] if _RESULTS in item.stash else []


def unused_in(config: pytest.Config) -> set[str]:
    """Return the unused baselines that this pytest run has found."""
    return config.stash.get(_UNUSED, set())


def update_of(config: pytest.Config) -> Update:
    """Return which baselines this pytest run writes."""
    if config.getoption("drive_update"):
        return "all"
    return "new" if config.getoption("drive_update_new") else ""


def results_of(config: pytest.Config) -> Results:
    """Return where this pytest run writes logs, pages and figures."""
    from antdrive.views.artefacts import Results, cached_results

    given = config.getoption("drive_results")
    folder = config.invocation_params.dir / given if given else cached_results(config.rootpath)
    return Results(folder, config.getoption("drive_keep"), config.rootpath)


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Find baselines of removed tests in fully collected modules."""
    if any("::" in str(word) for word in config.args) or config.getoption("lf", False):
        return  # modules may be collected only in part
    modules: dict[Path, set[str]] = {}
    for item in items:
        if not isinstance(item, DriveItem):
            modules.setdefault(item.path, set()).add(_name_in_file(item))
    folders = {path: path.parent / "baselines" / path.stem for path in modules}
    if any(folder.is_dir() for folder in folders.values()):
        from antdrive.testing.unused import unused_of_module

        for path, names in modules.items():
            config.stash[_UNUSED].update(map(str, unused_of_module(path, names)))


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(item: pytest.Item, call: pytest.CallInfo[None]) -> Any:
    """Add figures to the pytest-html report, if installed."""
    report = yield
    if call.when == "call" and _RESULTS in item.stash and item.config.pluginmanager.hasplugin("html"):
        _add_extras(report, item.stash[_RESULTS])
    return report


def _add_extras(report: Any, results: list[CheckResult]) -> None:
    try:
        from pytest_html import extras
    except ImportError:
        return
    import base64

    from antdrive.base.files import MAX_BYTES, read_bytes

    attached = list(getattr(report, "extras", []))
    for result in results:
        for name, path in result.files.items():
            if path.endswith(".png"):
                attached.append(extras.png(base64.b64encode(read_bytes(path, MAX_BYTES)).decode(), name=name))
            else:
                attached.append(extras.url(Path(path).as_uri(), name=name))
    report.extras = attached


class _Listener:
    """Collector of drives in test reports, which come from other processes under xdist.

    Attributes:
        drives: properties of reports with drives
        passed: passed tests, each with the names of its drives that have baselines
    """

    def __init__(self) -> None:
        self.drives: list[Any] = []
        self.passed: dict[str, set[str]] = {}

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        if report.when != "call":
            return
        if report.passed:
            self.passed[report.nodeid] = {str(value) for name, value in report.user_properties if name == "drive.case"}
        if any(name == "drive.test" for name, _ in report.user_properties):
            self.drives.append(report.user_properties)


def _removed_drives(config: pytest.Config) -> Iterator[Path]:
    """Yield baselines without a drive in the passed tests of this run."""
    modules: dict[Path, dict[str, set[str]]] = {}
    for nodeid, drives in config.stash[_LISTENER].passed.items():
        file, _, name = nodeid.partition("::")
        if not file.endswith(SUFFIX):
            modules.setdefault(config.rootpath / file, {})[name.replace("::", ".")] = drives
    for path, made in modules.items():
        if (path.parent / "baselines" / path.stem).is_dir():
            from antdrive.testing.unused import unused_drives_of_module

            yield from unused_drives_of_module(path, made)


@pytest.hookimpl(optionalhook=True)
def pytest_testnodedown(node: Any, error: Any) -> None:
    """Collect the unused baselines of an xdist worker."""
    node.config.stash[_UNUSED].update(getattr(node, "workeroutput", {}).get(WORKER_KEY, ()))


@pytest.hookimpl(trylast=True)
def pytest_sessionfinish(session: pytest.Session) -> None:
    """Fail on unused baselines if requested; in an xdist worker, report them to the controller."""
    config = session.config
    unused = config.stash[_UNUSED]
    if hasattr(config, "workeroutput"):
        config.workeroutput[WORKER_KEY] = sorted(unused)
        return
    unused.update(map(str, _removed_drives(config)))
    if unused and config.getoption("drive_strict") and session.exitstatus == pytest.ExitCode.OK:
        session.exitstatus = pytest.ExitCode.TESTS_FAILED


def pytest_terminal_summary(terminalreporter: Any, config: pytest.Config) -> None:
    """Summarise the drives on the terminal and in the file named by GITHUB_STEP_SUMMARY."""
    reported, found = config.stash[_LISTENER].drives, config.stash[_UNUSED]
    unused = sorted(found)
    if not (reported or unused):
        return
    from antdrive.testing.session_summary import add_to_page, drives_in, lines

    drives = [drive for properties in reported for drive in drives_in(properties)]
    terminalreporter.section("drives")
    for line in lines(drives, unused, config.getoption("drive_strict")):
        terminalreporter.write_line(line)
    add_to_page(drives, unused, terminalreporter.write_line)


def _name_in_file(item: pytest.Item) -> str:
    """Return a test's name in its file, such as TestDoors.test_open[3]."""
    return item.nodeid.partition("::")[2].replace("::", ".")
