"""A command compiles what it needs, where people can see it; `antdrive warm` compiles everything."""

import os
import subprocess
import sys

import pytest

from antdrive.base import kernel_cache
from antdrive.base.kernel_cache import COMPILING
from antdrive.base.progress import bar
from antdrive.cli.console import report_compiling
from antdrive.cli.warming import plan_with
from antdrive.planners import PLANNERS


@pytest.fixture(autouse=True)
def hook(monkeypatch):
    monkeypatch.setattr(kernel_cache, "on_compile", kernel_cache.ignore)


def test_without_a_bar_one_line_says_why_it_takes_a_while(capsys):
    report_compiling()
    for name in ("astar", "smooth"):
        kernel_cache.on_compile(name)
    assert capsys.readouterr() == ("", f"antdrive: {COMPILING}\n")


def test_a_bar_counts_the_kernels(monkeypatch, capsys):
    monkeypatch.setattr(sys.stderr, "isatty", lambda: True)
    monkeypatch.setenv("COLUMNS", "100")
    report_compiling()
    outside = kernel_cache.on_compile
    with bar("driving") as progress:
        for name in ("astar", "smooth"):
            kernel_cache.on_compile(name)
        progress(0.5)
    shown = capsys.readouterr().err
    assert "driving (kernels compiled once: 2)" in shown
    assert shown.count(COMPILING) == 1
    assert kernel_cache.on_compile is outside


@pytest.mark.slow
def test_a_command_compiles_what_it_needs_and_says_so_once(tmp_path):
    """The first plan compiles the search alone, and the second nothing."""
    command = [sys.executable, "-m", "antdrive", "plan", "empty", "-p", "astar", "-o", str(tmp_path / "plan.png")]
    env = {**os.environ, "NUMBA_CACHE_DIR": str(tmp_path / "cache")}
    said = [
        subprocess.run(command, env=env, capture_output=True, text=True, check=True, cwd=tmp_path).stderr
        for _ in range(2)
    ]
    assert said == [f"antdrive: {COMPILING}\n", ""]
    compiled = {path.name.partition(".")[0] for path in (tmp_path / "cache").rglob("*.nbc")}
    assert "_kernels_search" in compiled
    assert not compiled & {"_kernels_colony", "_kernels_tangent", "_kernels_avoidance", "_kernels_sipp"}


def test_warm_compiles_on_request_and_once(antdrive, compiled):
    assert antdrive("warm") == (0, "all planners are compiled\n", "")
    assert antdrive("warm") == (0, "all planners are already compiled\n", "")
    assert compiled == ["all"]


def test_without_a_folder_for_the_cache_warm_is_refused(refused, monkeypatch):
    monkeypatch.setattr("antdrive.base.kernel_cache.cache_folder", lambda: None)
    assert "NUMBA_CACHE_DIR" in refused("warm")


@pytest.mark.parametrize("name", PLANNERS)
def test_warm_plans_with_every_planner(name):
    plan_with(name)
