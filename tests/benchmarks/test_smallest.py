"""Every benchmark and every audit runs in its smallest size: `SMALLEST` of its module has the words of each call."""

import ast
import contextlib
import importlib
import json
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


CALLS = {
    f"{room}.{path.stem}": smallest(path)
    for room in ("benchmarks", "tests.audit")
    for path in sorted((ROOT / room.replace(".", "/")).glob("*.py"))
}


def test_every_benchmark_has_a_smallest_size():
    assert [name for name, calls in CALLS.items() if calls == []] == []
    assert len([name for name, calls in CALLS.items() if calls]) > 20


@pytest.mark.parametrize("name", CALLS)
def test_a_benchmark_finds_what_it_imports(name):
    with contextlib.suppress(SystemExit):  # packages are missing
        importlib.import_module(name)


#: Runs each command that it reads in a copy of itself, which has imported and loaded what most of them need.
COPIES = """
import json, os, runpy, sys
from antdrive.sim import Scenario, run
run(Scenario.of("empty", "astar", noise=1.0))
for line in sys.stdin:
    folder, module, *words = json.loads(line)
    child = os.fork()
    if not child:
        os.chdir(folder)
        for number, name in ((0, os.devnull), (1, "stdout"), (2, "stderr")):
            os.dup2(os.open(name, os.O_CREAT | os.O_RDWR), number)
        sys.argv = [module, *words]
        runpy.run_module(module, run_name="__main__", alter_sys=True)
        sys.exit()
    print(os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]), flush=True)
"""


@pytest.fixture(scope="module")
def copies():
    env = {**os.environ, "PYTHONPATH": str(ROOT)}
    pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE, "text": True, "env": env}
    with subprocess.Popen([sys.executable, "-c", COPIES], **pipes) as process:
        yield process


@pytest.mark.slow
@pytest.mark.skipif(not hasattr(os, "fork"), reason="needs processes that begin as copies")
@pytest.mark.parametrize(("name", "words"), [(name, words) for name, calls in CALLS.items() for words in calls or ()])
def test_a_benchmark_runs_in_its_smallest_size(name, words, tmp_path, copies):
    copies.stdin.write(json.dumps([str(tmp_path), name, *shlex.split(words)]) + "\n")
    copies.stdin.flush()
    code, said = int(copies.stdout.readline()), (tmp_path / "stderr").read_text()
    if code == MISSING:
        pytest.skip(said.strip())
    assert code == 0, said
    assert (tmp_path / "stdout").read_text().strip()
