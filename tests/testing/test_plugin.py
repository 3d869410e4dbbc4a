"""The pytest plugin, in runs of pytest of its own."""

import importlib
import os
import re
import subprocess
import sys
import xml.etree.ElementTree
from pathlib import Path

import numba
import pybullet  # noqa: F401
import pytest

# pytester forgets what a run of pytest has imported, so that the next run would import all of it again.
from antdrive import list_robots
from antdrive.base import kernel_cache
from antdrive.base.kernel_cache import COMPILING
from antdrive.testing import evaluation

# What the compiler loads when it first compiles must not be forgotten either: it cannot be loaded twice.
numba.njit(lambda: 0.0)()
pytest_plugins = ["pytester"]
PLUGIN = ("-p", "antdrive.testing.plugin", "-p", "no:cacheprovider")
RUN_FIGURES, PLAN_FIGURES = (f"antdrive.views.figures.{name}_figures." for name in ("run", "plan"))
for module in (RUN_FIGURES, PLAN_FIGURES, "antdrive.testing.evaluation"):  # what is replaced here is not forgotten
    importlib.import_module(module.removesuffix("."))
SUITE = """schema: 1
defaults: {planner: astar, world: small.yaml}
scenarios:
  clear: {}
  closed: {margin: 1.2, expect: {outcome: no_path}}
"""
HIT = "  hit: {unseen: [{x: 2, y: 1, radius: 0.2}]}\n"
SMALL = "{schema: 1, bounds: [0, 0, 4, 2], start: [1.3, 1, 0], goal: [2.7, 1], cell: 0.25}\n"


@pytest.fixture
def pictures():
    """Whether pictures are drawn; else empty files stand for them, which is quicker."""
    return False


@pytest.fixture
def project(pytester, monkeypatch, pictures):
    """A folder with a suite; results go beside it."""
    if not pictures:
        monkeypatch.setattr(RUN_FIGURES + "overview", lambda rollout, path: Path(path).touch())
        monkeypatch.setattr(PLAN_FIGURES + "plan_figure", lambda task, grid, plan, robot, path: Path(path).touch())
    monkeypatch.setenv("XDG_CACHE_HOME", str(pytester.path / "cache"))
    monkeypatch.setenv("PYTEST_ADDOPTS", "")
    monkeypatch.setenv("PYTEST_DISABLE_PLUGIN_AUTOLOAD", "1")  # loading the others takes longer than a drive
    monkeypatch.delenv("GITHUB_STEP_SUMMARY", raising=False)
    pytester.makefile(".drive.yaml", a=SUITE)
    pytester.makefile(".yaml", small=SMALL)
    return pytester


def test_a_suite_is_collected_driven_and_compared(project):
    add_collision(project)
    project.runpytest(*PLUGIN, "--collect-only", "-q").stdout.fnmatch_lines(
        ["*::clear[[]0]", "*::closed[[]0]", "*::hit[[]0]"]
    )
    first = project.runpytest(*PLUGIN, "-k", "clear")
    first.assert_outcomes(failed=1, deselected=2)
    first.stdout.fnmatch_lines(
        ["baseline: baselines/a/clear-0.json is missing; accept this drive with antdrive accept*"]
    )
    project.runpytest(*PLUGIN, "--drive-update-new").assert_outcomes(passed=2, failed=1)
    assert sorted(path.name for path in (project.path / "baselines" / "a").iterdir()) == [
        "clear-0.json",
        "closed-0.json",
    ]
    second = project.runpytest(*PLUGIN)
    second.assert_outcomes(passed=2, failed=1)
    second.stdout.fnmatch_lines([
        "outcome: collided, expected succeeded",
        "touched unseen[[]0] at (2, 1) with radius 0.2; the robot was at (*",
        "repeat: antdrive check 'a.drive.yaml::hit[[]0]'",
    ])  # fmt: skip
    second.stdout.no_fnmatch_line("*Traceback*")


def test_a_wrong_suite_is_one_line_of_collection(project):
    project.makefile(".drive.yaml", b="schema: 1\nscenarios:\n  x: {world: small.yaml, planner: astarr}\n")
    found = project.runpytest(*PLUGIN)
    found.assert_outcomes(errors=1)
    found.stdout.fnmatch_lines(["*b.drive.yaml:3: scenarios.x.planner: no planner is called 'astarr'; did you mean*"])
    found.stdout.no_fnmatch_line("*Traceback*")


@pytest.fixture
def accepted(project):
    """The same with baselines."""
    project.runpytest(*PLUGIN, "--drive-update-new").assert_outcomes(passed=2)
    return project


def add_collision(project):
    """Add a scenario that fails."""
    project.makefile(".drive.yaml", a=SUITE + HIT)


FIXTURE = """
import pytest
from antdrive import load_planner

def test_named(drive):
    run = drive("small.yaml", planner=load_planner("astar"), seed=1, expect={"min_clearance_m": ">= 0.05"})
    assert run.succeeded

class TestGroup:
    @pytest.mark.parametrize("noise", [0.0, 0.5])
    def test_noise(self, drive, noise):
        drive("small.yaml", "astar", noise=noise)
        assert drive.run("small.yaml", "dijkstra").succeeded

def test_plain():
    pass
"""


def test_tests_in_python_have_baselines_of_their_own(project):
    project.makepyfile(test_mine=FIXTURE)
    first = project.runpytest(*PLUGIN, "test_mine.py")
    first.assert_outcomes(failed=3, passed=1)
    first.stdout.fnmatch_lines(["E*is missing; accept this drive with antdrive accept test_mine.py::test_named"])
    first.stdout.no_fnmatch_line("*fixture.py*")  # the traceback ends in the test
    project.runpytest(*PLUGIN, "test_mine.py", "--drive-update").assert_outcomes(passed=4)
    found = sorted(path.name for path in (project.path / "baselines" / "test_mine").iterdir())
    assert [re.sub("[0-9a-f]{8}", "#", name) for name in found] == [
        "TestGroup.test_noise-0.0-#.json", "TestGroup.test_noise-0.5-#.json", "test_named.json",
    ]  # fmt: skip
    project.runpytest(*PLUGIN, "test_mine.py", "--drive-strict").assert_outcomes(passed=4)
    (project.path / "test_mine.py").write_text(FIXTURE.replace("test_named", "test_other"))
    last = project.runpytest(*PLUGIN, "test_mine.py", "--drive-strict")
    last.stdout.fnmatch_lines(["FAILED: unused baseline: *test_named.json; remove it"])


@pytest.mark.parametrize("pictures", [True])
def test_a_worse_drive_fails_with_what_was_lost_and_where_it_parts(accepted):
    folder = accepted.path / "res"
    (accepted.path / "slow.yaml").write_text(_robot().replace("max_speed: 0.7", "max_speed: 0.4"))
    text = SUITE.replace("clear: {}", "clear: {robot: slow.yaml}")
    accepted.makefile(".drive.yaml", a=text)
    found = accepted.runpytest(*PLUGIN, "-k", "clear", "--drive-results", "res")
    found.assert_outcomes(failed=1, deselected=1)
    found.stdout.fnmatch_lines([
        "duration_s: * s, in the baseline * s: * s longer, tolerance * s",
        "the drives diverge at t = * s, at (*, 1.00) instead of (*, 1.00); *; at most * m apart at the same time",
        "changed since the baseline: robot",
        "repeat: antdrive check 'a.drive.yaml::clear[[]0]'",
        "        antdrive run small.yaml --planner astar --robot slow.yaml --seed 0",
        f"overview: {folder}/a/clear-0/overview.png",
    ])  # fmt: skip
    written = sorted(path.name for path in (folder / "a" / "clear-0").iterdir())
    assert all(path.stat().st_size > 10_000 for path in (folder / "a" / "clear-0").glob("*.png"))
    assert written == ["commands.txt", "drive.html", "overview.png", "result.json", "rollout.npz"]
    accepted.makefile(".drive.yaml", a=SUITE)
    accepted.runpytest(*PLUGIN, "-k", "clear", "--drive-results", "res").assert_outcomes(passed=1, deselected=1)
    assert not (folder / "a" / "clear-0").exists(), "what an earlier run wrote about a test that passes now is removed"


@pytest.mark.parametrize(
    ("metric", "value", "says"),
    [
        ("duration_s", "99.0", "better than its baseline: a.drive.yaml::clear[[]0] (duration_s: * better); *"),
        (
            "spl",
            "null",
            "a.drive.yaml::clear[[]0]: not compared: spl; the baseline has no value; antdrive accept adds it",
        ),
    ],
    ids=["better", "hidden"],
)
def test_a_drive_that_passes_beside_another_baseline_says_so(accepted, metric, value, says):
    path = accepted.path / "baselines" / "a" / "clear-0.json"
    path.write_text(re.sub(rf'"{metric}": [\d.]+', f'"{metric}": {value}', path.read_text()))
    found = accepted.runpytest(*PLUGIN, "-k", "clear")
    found.assert_outcomes(passed=1, deselected=1)
    found.stdout.fnmatch_lines([says])
    accepted.runpytest(*PLUGIN, "-k", "clear", "--drive-update").stdout.fnmatch_lines(["baseline renewed: *"])
    accepted.runpytest(*PLUGIN, "-k", "clear").stdout.no_fnmatch_line(says)


def test_unused_baselines_are_told_and_fail_if_asked_to(accepted):
    folder = accepted.path / "baselines"
    (folder / "a" / "gone-0.json").write_text((folder / "a" / "clear-0.json").read_text())
    (folder / "b").mkdir()
    (folder / "b" / "x-0.json").write_text("{}")
    chosen = (*PLUGIN, "-k", "clear", "a.drive.yaml")
    plain = accepted.runpytest(*chosen)
    plain.stdout.fnmatch_lines(
        ["unused baseline: *a/gone-0.json; remove it", "unused baseline: *b/x-0.json; remove it"]
    )
    assert plain.ret == 0
    assert accepted.runpytest(*chosen, "--drive-strict").ret == 1


def test_a_suite_that_is_reached_through_a_link_uses_its_baselines(accepted):
    link = accepted.path.parent / f"{accepted.path.name}-link"
    link.symlink_to(accepted.path, target_is_directory=True)
    found = accepted.runpytest(
        *PLUGIN, "--rootdir", str(link), str(link / "a.drive.yaml"), "-k", "closed", "--drive-strict"
    )
    assert found.ret == 0
    found.stdout.no_fnmatch_line("*unused baseline*")


def test_a_suite_and_a_module_of_one_name_use_their_own_baselines(accepted):
    accepted.makepyfile(a="def test_one(drive): drive('small.yaml', 'astar')\n")
    accepted.runpytest(*PLUGIN, "a.py", "--drive-update-new").assert_outcomes(passed=1)
    folder = accepted.path / "baselines" / "a"
    assert len(list(folder.iterdir())) == 3
    chosen = (*PLUGIN, "a.drive.yaml", "a.py", "-k", "closed", "--drive-strict")
    assert accepted.runpytest(*chosen).ret == 0
    (folder / "gone-0.json").write_text("{}")
    assert accepted.runpytest(*chosen).ret == 1


def test_last_failed_calls_no_baseline_unused(accepted):
    """pytest leaves out the tests that passed before it says which tests there are."""
    accepted.makepyfile(
        test_m="def test_one(drive): drive('small.yaml', 'astar')\n"
        "def test_two(drive): drive('small.yaml', 'astar', baseline=False); assert not drive\n"
    )
    accepted.runpytest(*PLUGIN[:2], "test_m.py", "--drive-update-new").assert_outcomes(passed=1, failed=1)
    again = accepted.runpytest(*PLUGIN[:2], "test_m.py", "--lf", "--collect-only")
    again.stdout.no_fnmatch_line("*unused baseline*")
    again.stdout.no_fnmatch_line("*test_one*")


def test_a_page_of_a_ci_run_that_cannot_be_written_is_one_line(accepted, monkeypatch):
    monkeypatch.setenv("GITHUB_STEP_SUMMARY", str(accepted.path / "none" / "page.md"))
    found = accepted.runpytest(*PLUGIN, "-k", "closed")
    assert found.ret == 0
    found.stdout.fnmatch_lines(["GITHUB_STEP_SUMMARY: *page.md: cannot be written (No such file or directory)"])


@pytest.mark.slow
def test_it_works_with_xdist_and_in_any_order(accepted):
    add_collision(accepted)
    accepted.makeconftest("def pytest_collection_modifyitems(items): items.reverse()")
    spread = accepted.runpytest(*PLUGIN, "-p", "xdist", "-n", "2")
    spread.assert_outcomes(passed=2, failed=1)
    spread.stdout.fnmatch_lines(["2 of 3 drives passed", "results: *cache/antdrive/results/*/a/hit-0"])
    accepted.runpytest(*PLUGIN, "-x").assert_outcomes(failed=1)
    (accepted.path / "baselines" / "a" / "gone-0.json").write_text("{}")
    strict = accepted.runpytest(*PLUGIN, "-k", "clear", "--drive-strict", "-p", "xdist", "-n", "1")
    assert strict.ret == 1, "the processes tell the first one of unused baselines"


@pytest.mark.slow
def test_last_failed_repeats_the_failed_drive(accepted):
    add_collision(accepted)
    accepted.runpytest(*PLUGIN[:2]).assert_outcomes(passed=2, failed=1)
    accepted.runpytest(*PLUGIN[:2], "--lf").assert_outcomes(failed=1)
    accepted.runpytest(*PLUGIN, "a.drive.yaml::clear[0]").assert_outcomes(passed=1)


@pytest.mark.slow
def test_nothing_is_written_into_the_checkout(accepted):
    def files():
        return {path for path in accepted.path.rglob("*") if path.is_file() and "cache" not in path.parts}

    add_collision(accepted)
    before = files()
    accepted.runpytest(*PLUGIN, "-p", "no:junitxml").assert_outcomes(passed=2, failed=1)
    assert files() == before


@pytest.mark.skipif(not hasattr(os, "geteuid") or os.geteuid() == 0, reason="root can write everywhere")
def test_a_baseline_that_cannot_be_written_is_one_line(accepted):
    folder = accepted.path / "baselines" / "a"
    folder.chmod(0o500)
    found = accepted.runpytest(*PLUGIN, "-k", "clear", "--drive-update")
    folder.chmod(0o700)
    found.stdout.fnmatch_lines(["*clear-0.json: cannot be written*"])


TWO = (
    "def test_two(drive):\n    drive('small.yaml', 'astar', name='one')\n    drive('small.yaml', 'astar', name='two')\n"
)


@pytest.mark.parametrize("change", ["rename", "drop"])
def test_the_baseline_of_a_drive_that_is_gone_is_unused(project, change):
    project.makepyfile(test_m=TWO)
    project.runpytest(*PLUGIN, "test_m.py", "--drive-update-new", "--drive-strict").assert_outcomes(passed=1)
    gone = TWO.replace("'two'", "'other'") if change == "rename" else "".join(TWO.splitlines(keepends=True)[:2])
    (project.path / "test_m.py").write_text(gone)
    found = project.runpytest(*PLUGIN, "test_m.py", "--drive-update-new", "--drive-strict")
    found.stdout.fnmatch_lines(["FAILED: unused baseline: *test_two-two.json; remove it"])
    found.stdout.no_fnmatch_line("*test_two-one.json*")
    assert found.ret == 1
    (project.path / "test_m.py").write_text(gone + "    assert False\n")
    found = project.runpytest(*PLUGIN, "test_m.py", "--drive-strict")
    found.stdout.no_fnmatch_line("*unused baseline*")  # it might have come after what failed


def test_commands_work_where_pytest_was_started_and_in_its_rootdir(project):
    project.makeini("[pytest]\n")
    inner = project.mkdir("inner")
    (inner / "small.yaml").write_text(SMALL)
    (inner / "b.drive.yaml").write_text("{schema: 1, scenarios: {far: {world: small.yaml, planner: astar}}}")
    (inner / "test_b.py").write_text("def test_far(drive): drive('small.yaml', 'astar')\n")
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(inner)
        found = project.runpytest(*PLUGIN, f"--rootdir={project.path}")
    found.assert_outcomes(failed=2)
    found.stdout.fnmatch_lines([f"*accept this drive with antdrive accept '{inner}/b.drive.yaml::far[[]0[]]'"])
    found.stdout.fnmatch_lines([f"repeat: antdrive check '{inner}/b.drive.yaml::far[[]0[]]'"])
    found.stdout.fnmatch_lines([f"        antdrive run {inner}/small.yaml --planner astar*"])
    found.stdout.fnmatch_lines([f"E*repeat: pytest {inner}/test_b.py::test_far"])
    for folder in (inner, project.path):
        with pytest.MonkeyPatch.context() as patch:
            patch.chdir(folder)
            again = project.runpytest(*PLUGIN, f"{inner}/test_b.py::test_far", "--drive-update")
        again.assert_outcomes(passed=1)


def test_a_line_reports_that_kernels_compile(project, monkeypatch, capfd):
    """The first drive compiles two kernels, the second none."""
    waiting = ["astar", "smooth"]
    drive = evaluation.drive

    def compiles(*args, **kwargs):
        while waiting:
            kernel_cache.on_compile(waiting.pop())
        return drive(*args, **kwargs)

    monkeypatch.setattr(evaluation, "drive", compiles)
    for _ in range(2):
        project.runpytest(*PLUGIN, "-k", "closed", "--drive-update-new").assert_outcomes(passed=1, deselected=1)
    assert capfd.readouterr().err.count(f"antdrive: {COMPILING}") == 1


def test_junit_properties_and_the_summary_of_a_ci_run(accepted, monkeypatch):
    add_collision(accepted)
    page = accepted.path / "summary.md"
    page.write_text("before\n")
    monkeypatch.setenv("GITHUB_STEP_SUMMARY", str(page))
    accepted.runpytest(*PLUGIN, "--junit-xml=out.xml")
    cases = {case.get("name"): case for case in xml.etree.ElementTree.parse(accepted.path / "out.xml").iter("testcase")}
    told = {entry.get("name"): entry.get("value") for entry in cases["hit[0]"].iter("property")}
    assert (told["drive.outcome"], told["drive.certified"]) == ("collided", "false")
    assert {"drive.min_clearance_m", "drive.duration_s", "drive.results"} <= told.keys()
    text = page.read_text()
    assert text.startswith("before\n### Drives: 2 of 3 passed\n")
    assert "| a.drive.yaml::hit[0] | collided |" in text
    assert "    antdrive check 'a.drive.yaml::hit[0]'\n" in text


def test_a_planner_that_raises_fails_its_test_in_one_line(project):
    project.makepyfile(mine="class Mine:\n    def plan(self, query, rng):\n        raise RuntimeError('lost')\n")
    text = SUITE.replace("clear: {}", "clear: {planner: 'mine.py:Mine', baseline: false}")
    project.makefile(".drive.yaml", a=text)
    found = project.runpytest(*PLUGIN, "-k", "clear")
    found.stdout.fnmatch_lines(["*Mine*RuntimeError: lost*"])
    found.stdout.no_fnmatch_line("*Traceback*")


def _robot():
    return list_robots()["turtlebot"].read_text()


HEAVY = "('numpy', 'numba', 'pybullet', 'matplotlib', 'PIL', 'pydantic', 'yaml', 'hypothesis')"


def test_the_plugin_imports_nothing_for_a_run_that_does_not_use_it(pytester, monkeypatch):
    monkeypatch.setenv("PYTEST_DISABLE_PLUGIN_AUTOLOAD", "1")
    pytester.makepyfile("def test_one(): pass")
    code = (
        f"import sys, pytest; code = pytest.main(['-q', '-p', '{PLUGIN[1]}'])\n"
        f"print(int(code), [name for name in {HEAVY} if name in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.splitlines()[-1] == "0 []"


def test_collecting_loads_no_physics_and_no_compiler(project):
    code = (
        f"import sys, pytest; pytest.main(['-q', '--collect-only', '-p', '{PLUGIN[1]}'])\n"
        "print([name for name in ('numba', 'pybullet', 'matplotlib', 'PIL') if name in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.splitlines()[-1] == "[]"
