"""User planners that end their process, never end, or answer nonsense: named in one line, and other runs go on."""

import json
import re
import signal
import subprocess
import sys
import time
from pathlib import Path

import pyarrow.parquet
import pytest

ANTDRIVE = Path(sys.executable).with_name("antdrive")
PLANNERS = """
import itertools, os, time
from antdrive.planners import load_planner

class Right:
    count = 0
    def plan(self, query, rng):
        self.count += 1
        self.before()
        return load_planner("astar").plan(query, rng)
    def before(self): ...

class Endless(Right):
    def before(self):
        while True: pass

class Stubborn(Right):
    def before(self):
        while True:
            try: time.sleep(99)
            except BaseException: self.before = lambda: time.sleep(99)

class Compiled(Right):
    def before(self): any(itertools.repeat(0))

class Exits(Right):
    def before(self): os._exit(0)

class Crashes(Right):
    def before(self): os.kill(os.getpid(), 11)

class EndlessLater(Right):
    def before(self):
        while self.count > 1: pass

class ExitsLater(Right):
    def before(self): self.count > 1 and os._exit(0)

class Threads(Right):
    def before(self):
        import threading
        threading.Thread(target=time.sleep, args=(99,), daemon=False).start()
"""
#: What a planner may do to the process; the run goes on and keeps its results.
CHANGES = {
    "streams": "import sys; sys.stdout.close(); sys.stderr.close(); sys.stdin.close()",
    "replaced streams and folder": "import sys; sys.stdout = sys.stderr = sys.stdin = None; os.chdir('/')",
    "files and umask": "os.closerange(0, 3); os.umask(0o777)",
    "depth and variables": (
        "import sys, inspect; sys.setrecursionlimit(len(inspect.stack(0)) + 40); os.environ.clear()"
    ),
    "warnings and floats": "import numpy, warnings; warnings.simplefilter('error'); numpy.seterr(all='raise')",
}
OVER = "took longer than the limit of 0.3 s"
EXITS = "(mine.py:7) ended the process with exit code 0"
#: What the error says of each class of the file, after its name.
SLOW = {
    "Endless": f"{OVER} (mine.py:15)",
    "Stubborn": OVER,
    "Exits": EXITS,
    "Crashes": "(mine.py:7) ended the process by SIGSEGV",
    "EndlessLater": f"{OVER} (mine.py:34)",
    "ExitsLater": EXITS,
}
ENDS = {"Compiled": f"(mine.py:7) {OVER}", **SLOW}
MOVING = """
schema: 1
bounds: [0, 0, 5, 3]
start: [0.6, 1.5, 0]
goal: [4.4, 1.5]
movers: [{radius: 0.3, position: [2.6, 1.5], velocity: [0.01, 0]}]
"""
SHORT = "schema: 1\nbounds: [0, 0, 3, 2]\nstart: [0.6, 1, 0]\ngoal: [1.6, 1]\n"


@pytest.fixture
def folder(tmp_path, monkeypatch):
    (tmp_path / "mine.py").write_text(PLANNERS)
    (tmp_path / "moving.yaml").write_text(MOVING)
    (tmp_path / "short.yaml").write_text(SHORT)
    monkeypatch.chdir(tmp_path)
    return tmp_path


def process(*words, limit="0.3"):
    """The finished process of a command, with a limit on planning time."""
    return subprocess.run([ANTDRIVE, *words, "--plan-limit", limit], capture_output=True, text=True, timeout=100)


def said_in_one_line(done, name, words):
    """Whether a process failed because of a planner that it names."""
    assert done.returncode == 3, done.stderr
    assert "Traceback" not in done.stderr + done.stdout
    assert done.stderr.count("\n") == 1
    return done.stderr.startswith(f"antdrive: planner {name}") and words in done.stderr


@pytest.mark.parametrize("name", ["Compiled", *(pytest.param(name, marks=pytest.mark.slow) for name in SLOW)])
def test_a_planner_that_ends_its_process_or_never_ends_is_named(folder, name):
    world = "moving.yaml" if name.endswith("Later") else "short.yaml"
    done = process("run", world, "--planner", f"mine.py:{name}", "--no-figures", "-o", "out")
    assert said_in_one_line(done, name, ENDS[name])


@pytest.mark.slow
@pytest.mark.parametrize(
    ("code", "words"),
    [
        ("while True: pass", f"{OVER} on import (import.py:1)"),
        ("import os; os._exit(0)", "ended the process with exit code 0"),
        ("import itertools; any(itertools.repeat(0))", OVER),
    ],
)
def test_a_file_that_never_ends_or_exits_on_import_is_named(folder, code, words):
    (folder / "import.py").write_text(code)
    assert said_in_one_line(process("plan", "short.yaml", "--planner", "import.py:Mine"), "import.py", words)


def test_a_sweep_and_a_comparison_count_each_error_and_end_as_a_run_does(folder, antdrive, monkeypatch):
    monkeypatch.setenv("ANTDRIVE_PLAN_LIMIT", "off")
    raising = "class Raises:\n    def plan(self, query, rng): raise ValueError('lost')\n"
    (folder / "mine.py").write_text(PLANNERS + raising)
    planners = "-p", "mine.py:Raises", "-p", "astar"
    counted = "antdrive: planner Raises raised ValueError: lost (mine.py:44) (2 runs)\n"
    code, out, err = antdrive(
        "sweep", "-w", "short.yaml", *planners, "--seeds", "2", "-o", "camp", "--jobs", "1", "--json"
    )
    assert code == 3
    assert err.endswith(counted)
    assert json.loads(out)["faults"] == {"planner Raises raised ValueError: lost (mine.py:44)": 2}
    code, _, err = antdrive("compare", "short.yaml", *planners, "--seeds", "2", "--no-figures", "-o", "out")
    assert code == 3
    assert err.count("Raises") == 1
    assert counted in err


@pytest.mark.slow
def test_a_sweep_records_each_of_them_and_goes_on(folder, antdrive, monkeypatch):
    monkeypatch.setenv("ANTDRIVE_PLAN_LIMIT", "off")
    planners = ", ".join(f"mine.py:{name}" for name in ("Exits", "Endless", "Compiled", "Crashes", "Right"))
    (folder / "camp.yaml").write_text(f"schema: 1\nworlds: [short.yaml]\nseeds: 1\nplanners: [{planners}]\n")
    code, _, err = antdrive("sweep", "camp.yaml", "-o", "camp", "--jobs", "1", "--plan-limit", "3")
    assert code == 3
    rows = pyarrow.parquet.read_table(folder / "camp" / "runs.parquet").to_pylist()
    found = {row["planner"].removeprefix("mine.py:"): (row["outcome"], row["reason"]) for row in rows}
    assert found.pop("Right")[0] == "succeeded"
    for name, (outcome, reason) in found.items():
        assert outcome == "planner_fault"
        assert reason == f"planner {name} {ENDS[name].replace('0.3', '3')}"
        assert f"antdrive: {reason} (1 run)\n" in err


def test_a_comparison_goes_on_after_a_planners_error(folder, antdrive, monkeypatch):
    monkeypatch.setenv("ANTDRIVE_PLAN_LIMIT", "off")
    planners = "-p", "a=mine.py:Endless", "-p", "b=mine.py:Right"
    code, out, err = antdrive(
        "compare", "short.yaml", *planners, "--no-figures", "--json", "-o", "out", "--plan-limit", "1"
    )
    assert code == 3
    assert err.startswith(f"antdrive: planner Endless {ENDS['Endless'].replace('0.3', '1')} (1 run)\n")
    runs = json.loads(out)["runs"]
    assert runs["a"]["outcome"] == "planner_fault"
    assert "limit of 1 s" in runs["a"]["reason"]
    assert runs["b"]["succeeded"]


CONTROLLERS = """import os

class Right:
    fault = staticmethod(lambda: None)
    def start(self, briefing, path): return None
    def step(self, now, path, state):
        if now.tick > 9: self.fault()
        return (0.1, 0.0), state

def stubborn():
    while True:
        try: stubborn()
        except BaseException: pass

class Exits(Right): fault = staticmethod(lambda: os._exit(0))
class Crashes(Right): fault = staticmethod(lambda: os.kill(os.getpid(), 11))
class Stubborn(Right): fault = staticmethod(stubborn)
class Raises(Right): fault = staticmethod(lambda: 1 / 0)
"""


@pytest.mark.slow
def test_a_sweep_names_controllers_that_end_their_process_or_never_end_and_goes_on(folder):
    (folder / "own.py").write_text(CONTROLLERS)
    names = ("Right", "Exits", "Crashes", "Stubborn", "Raises")
    words = [word for name in names for word in ("--controller", f"own.py:{name}")]
    place = ("--world", "short.yaml", "--planner", "astar", "--time-limit", "0.5", "--jobs", "1", "--out", "out")
    done = process("sweep", *place, *words, "--keep", "none")
    assert done.returncode == 3
    assert re.search(r"controller_fault +4\n", done.stdout)
    assert re.search(r"timed_out +1\n", done.stdout)
    for says in (
        "Exits (own.py:6) ended the process with exit code 0",
        "Crashes (own.py:6) ended the process by SIGSEGV",
        "Stubborn (own.py:6) took longer than the limit of 0.3 s",
        "Raises raised ZeroDivisionError: division by zero (own.py:18)",
    ):
        assert f"antdrive: controller {says} (1 run)\n" in done.stderr


@pytest.mark.slow
def test_suites_name_it_and_go_on(folder):
    names = ("Exits", "Endless", "Right")
    tests = "\n".join(f"  {n.lower()}: {{world: short.yaml, planner: 'mine.py:{n}', baseline: false}}" for n in names)
    (folder / "a.drive.yaml").write_text(f"schema: 1\nscenarios:\n{tests}\n")
    done = process("check", "a.drive.yaml", "--jobs", "2", "--results", "results", limit="3")
    assert done.returncode == 1
    assert "planner Exits (mine.py:7) ended the process with exit code 0" in done.stdout
    assert "planner Endless took longer than the limit of 3 s (mine.py:15)" in done.stdout
    assert "1 of 3 passed" in done.stdout
    done = subprocess.run(
        [sys.executable, "-m", "pytest", "-q", "a.drive.yaml::endless", "a.drive.yaml::right", "--drive-plan-limit", "3"],
        capture_output=True, text=True, timeout=100,
    )  # fmt: skip
    assert "planner Endless took longer than the limit of 3 s (mine.py:15)" in done.stdout
    assert "1 failed, 1 passed" in done.stdout


@pytest.mark.slow
@pytest.mark.parametrize(("number", "code"), [(signal.SIGINT, 130), (signal.SIGTERM, 143)])
def test_a_signal_ends_a_supervised_command_as_any_other(signals, folder, number, code):
    words = [ANTDRIVE, "run", "short.yaml", "--planner", "mine.py:Endless", "--no-figures", "--plan-limit", "off"]
    started = subprocess.Popen(words, stderr=subprocess.PIPE, text=True)
    try:
        time.sleep(5)
        started.send_signal(number)
        _, said = started.communicate(timeout=20)
    finally:
        started.kill()
        started.communicate()
    assert started.returncode == code
    assert said.count("\n") == 1


@pytest.mark.parametrize("name", CHANGES)
def test_what_a_planner_changes_in_the_process_costs_no_result(folder, antdrive, monkeypatch, name):
    monkeypatch.setenv("ANTDRIVE_PLAN_LIMIT", "off")
    after = f"answer = load_planner('astar').plan(query, rng); {CHANGES[name]}; return answer"
    (folder / "mine.py").write_text(PLANNERS.replace('return load_planner("astar").plan(query, rng)', after))
    code, out, err = antdrive("run", "moving.yaml", "-p", "mine.py:Right", "--no-figures", "-o", "out")
    assert (code, err) == (0, ""), out
    assert "certified collision-free" in out
    assert (folder / "out" / "result.json").stat().st_mode & 0o777 == 0o644


def test_a_thread_that_a_planner_leaves_running_does_not_keep_the_command(folder):
    done = process("run", "short.yaml", "-p", "mine.py:Threads", "--no-figures", "-o", "out", limit="off")
    assert (done.returncode, done.stderr) == (0, "")
    assert "certified collision-free" in done.stdout


@pytest.mark.parametrize("text", ["0", "-1", "nan", "soon"])
def test_a_limit_that_is_no_time_is_refused(text, monkeypatch, capsys):
    from antdrive.cli.groups import exit_code_of

    monkeypatch.setenv("ANTDRIVE_PLAN_LIMIT", "off")
    assert exit_code_of(["plan", "short.yaml", "--plan-limit", text]) == 2
    assert capsys.readouterr().err == f"antdrive: --plan-limit: must be seconds, at most 1e+06, or off; got '{text}'\n"
