"""Every benchmark runs in its smallest size: `SMALLEST` of its module has the words of each call."""

import ast
import os
import shlex
import subprocess
import sys
from pathlib import Path

import pytest

from benchmarks.markdown import MISSING

ROOT = Path(__file__).parents[2]


def smallest(path):
    """The words of each call; None of a module that is no benchmark. Nothing is imported: packages may be missing."""
    body = ast.parse(path.read_text(encoding="utf-8")).body
    if not any(isinstance(one, ast.FunctionDef) and one.name == "main" for one in body):
        return None
    values = [one.value for one in body if isinstance(one, ast.Assign) and ast.unparse(one.targets[0]) == "SMALLEST"]
    return list(ast.literal_eval(values[0])) if values else []


CALLS = {path.stem: smallest(path) for path in sorted((ROOT / "benchmarks").glob("*.py"))}


def test_every_benchmark_has_a_smallest_size():
    assert [name for name, calls in CALLS.items() if calls == []] == []
    assert len([name for name, calls in CALLS.items() if calls]) > 20


@pytest.mark.slow
@pytest.mark.parametrize(("name", "words"), [(name, words) for name, calls in CALLS.items() for words in calls or ()])
def test_a_benchmark_runs_in_its_smallest_size(name, words, tmp_path):
    command = [sys.executable, "-m", f"benchmarks.{name}", *shlex.split(words)]
    env = {**os.environ, "PYTHONPATH": str(ROOT)}
    done = subprocess.run(command, cwd=tmp_path, env=env, capture_output=True, text=True, check=False)
    if done.returncode == MISSING:
        pytest.skip(done.stderr.strip())
    assert done.returncode == 0, done.stderr
    assert done.stdout.strip()
