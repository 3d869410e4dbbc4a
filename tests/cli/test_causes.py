"""Causes of failed checks: each is planted alone; `antdrive check`, its JSON and JUnit, and pytest name it."""

import json
import subprocess
import sys
import xml.etree.ElementTree as ET
from pathlib import Path

import numba
import pybullet  # noqa: F401
import pytest

from antdrive import list_robots
from antdrive.base import kernel_cache, user_code
from antdrive.sim.driving.rules import Pursuit
from antdrive.sim.rerun import UNSTEADY
from antdrive.testing import evaluation

# pytester forgets what a run of pytest has imported; what the compiler loads at first must not be forgotten.
numba.njit(lambda: 0.0)()
ANTDRIVE = Path(sys.executable).with_name("antdrive")
pytest_plugins = ["pytester"]
SUITE = """schema: 1
scenarios:
  a: {world: w.yaml, robot: r.yaml, planner: "mine.py:Mine", trajectory: exact}
"""
WORLD = "{schema: 1, bounds: [0, 0, 4, 2], start: [1.2, 1, 0], goal: [2.8, 1], cell: 0.1}\n"
PLANNER = """
import random, time
from dataclasses import dataclass
import numpy as np
from antdrive.planners import GridPlanner, PlanResult, PlanStatus, path_cost
from beside import BITS

@dataclass(frozen=True, kw_only=True)
class Mine(GridPlanner):
    def search(self, query, rng):
        bits = BITS
        (r, c), (_, c1) = query.start, query.goal
        rows = [r, *(r + (bits >> k & 1) for k in range(c1 - c - 1)), r]
        cells = np.array([*zip(rows, range(c, c1 + 1))], dtype=np.int32)
        return PlanResult(status=PlanStatus.SOLVED, cells=cells, cost=path_cost(cells, query.grid.cell))
"""
NAMES = "'antdrive plans a route around every pillar of this hall twice a day'.split()"
SAME = "world, robot, settings and planner file equal the baseline's"
MINE = "changed since the baseline: planner file (mine.py)"


def edit(name, old, new):
    def plant(folder, monkeypatch):
        text = (folder / name).read_text()
        assert old in text
        (folder / name).write_text(text.replace(old, new))

    return plant


def planner(code):
    return edit("mine.py", "bits = BITS", code)


def baseline(**values):
    """Edit the baseline: its values, and those within its objects."""

    def plant(folder, monkeypatch):
        (path,) = (folder / "baselines" / "s").iterdir()
        data = json.loads(path.read_text())
        for name, value in values.items():
            data[name] = {**data[name], **value} if isinstance(value, dict) else value
        path.write_text(json.dumps(data))

    return plant


def version(name):
    return baseline(versions={name: "0.0.1"}, drive_digest="0")


def other_antdrive(folder, monkeypatch):
    apply = Pursuit.apply
    slower = lambda step: step._replace(command=step.command._replace(speed=step.command.speed * 0.9))  # noqa: E731
    monkeypatch.setattr(Pursuit, "apply", lambda *given: slower(apply(*given)))


#: What is planted; what all reports say of it.
CAUSES = {
    "world": (edit("w.yaml", "[2.8, 1]", "[2.4, 1]"), "changed since the baseline: world"),
    "robot": (edit("r.yaml", "max_speed: 0.7", "max_speed: 0.6"), "changed since the baseline: robot"),
    "settings": (edit("s.drive.yaml", "exact", "exact, noise: 1"), "changed since the baseline: settings"),
    "smoothing": (
        edit("s.drive.yaml", "exact", "exact, smoothing: taut"),
        "changed since the baseline: settings (smoothing none -> taut)",
    ),
    "other plan": (planner("bits = 0b11000"), MINE),
    "invalid plan": (planner("query = __import__('dataclasses').replace(query, start=(1, 1)); bits = 0"), MINE),
    "raises": (planner("raise RuntimeError('lost')"), "planner Mine raised RuntimeError: lost (mine.py:", MINE),
    "never ends": (planner("while True: pass"), "planner Mine took longer than the limit of 0.2 s (mine.py:", MINE),
    "unsteady plan": (planner("bits = random.getrandbits(64)"), UNSTEADY, MINE),
    "imported module": (edit("beside.py", "0", "0b11"), f"{SAME}; so a module that the planner imports"),
    "antdrive": (version("antdrive"), SAME, "versions since the baseline: antdrive 0.0.1 -> "),
    "numpy": (version("numpy"), SAME, "versions since the baseline: numpy 0.0.1 -> "),
    "pybullet": (version("pybullet"), SAME, "versions since the baseline: pybullet 0.0.1 -> "),
    "antdrive's code": (other_antdrive, f"{SAME}; so a module that the planner imports, antdrive's code or the"),
    "seed": (edit("s.drive.yaml", "exact", "exact, seeds: [1]"), "baseline: baselines/s/a-1.json is missing"),
    "metrics of the baseline": (
        baseline(metrics={"duration_s": 1.0}),
        "the drive equals the baseline's bit for bit",
        "the baseline's file was edited: the same drive has another duration_s;",
    ),
    "digest of the baseline": (baseline(drive_digest="0"), f"{SAME}; so ", "or the baseline's file has changed"),
}
#: Sentences that name a cause; those of other causes are not said.
NAMED = (
    "changed since the baseline",
    "versions since",
    UNSTEADY,
    "equal the baseline's; so",
    "was edited",
    "is missing",
)


@pytest.fixture
def folder(antdrive, pytester, monkeypatch):
    """A folder with an accepted suite of a custom planner, in which no other process is asked."""
    monkeypatch.chdir(pytester.path)
    monkeypatch.setenv("XDG_CACHE_HOME", str(pytester.path / "cache"))
    monkeypatch.setenv("ANTDRIVE_PLAN_LIMIT", "0.2")
    monkeypatch.setenv("PYTEST_DISABLE_PLUGIN_AUTOLOAD", "1")
    monkeypatch.setattr(kernel_cache, "on_compile", kernel_cache.ignore)  # the plugin sets its own
    monkeypatch.setattr(evaluation, "in_new_process", lambda call: None)
    monkeypatch.setattr(evaluation, "write_artefacts", lambda *given, **named: {})
    files = {"s.drive.yaml": SUITE, "w.yaml": WORLD, "mine.py": PLANNER, "beside.py": "BITS = 0\n"}
    for name, text in files.items():
        (pytester.path / name).write_text(text)
    (pytester.path / "r.yaml").write_text(list_robots()["turtlebot"].read_text())
    return pytester.path


def forget():
    """Forget what a new process would not have imported."""
    user_code._loaded.cache_clear()
    sys.modules.pop("beside", None)


def reports(antdrive, pytester):
    """The texts of a check: printed, as JSON, as JUnit and of pytest."""
    words = ("check", "s.drive.yaml", "--jobs", "1", "--plan-limit", "0.2")
    _, out, _ = antdrive(*words)
    yield out
    _, out, _ = antdrive(*words, "--json", "--junit", "j.xml")
    (test,) = json.loads(out)["tests"]
    yield "\n".join((*test["faults"], *test["details"]))
    yield ET.parse(pytester.path / "j.xml").find(".//failure").text
    plugin = ("-p", "antdrive.testing.plugin", "-p", "no:cacheprovider")
    yield pytester.runpytest_inprocess(*plugin, "--drive-plan-limit", "0.2").stdout.str()


@pytest.mark.parametrize(
    "name", [pytest.param(one, marks=[pytest.mark.slow] * (one in ("numpy", "pybullet"))) for one in CAUSES]
)
def test_every_report_names_the_planted_cause(antdrive, folder, pytester, monkeypatch, name):
    plant, *said = CAUSES[name]
    forget()
    assert antdrive("accept", "s.drive.yaml", "--jobs", "1")[0] == 0
    plant(folder, monkeypatch)
    forget()
    others = [one for one in NAMED if not any(one in words for words in said)]
    for text in reports(antdrive, pytester):
        for words in said:
            assert words in text
        assert not [one for one in others if one in text]


FLAKY = {
    "drawn": "bits = random.getrandbits(64)",
    "time": "bits = time.perf_counter_ns() >> 4",
    "kept": "bits = vars(np).setdefault('_bits', []).append(0) or len(vars(np)['_bits'])",
}


@pytest.mark.parametrize("name", FLAKY)
def test_an_unsteady_planner_is_named_on_accept_and_on_check(antdrive, folder, pytester, monkeypatch, name):
    planner(FLAKY[name])(folder, monkeypatch)
    forget()
    code, out, _ = antdrive("accept", "s.drive.yaml", "--jobs", "1")
    assert (code, UNSTEADY in out) == (0, True)
    for text in reports(antdrive, pytester):
        assert UNSTEADY in text
        assert "code" not in text.replace(UNSTEADY, "")
    assert antdrive("run", "w.yaml", "-r", "r.yaml", "-p", "mine.py:Mine", "--no-figures", "-o", "out")[0] == 0
    monkeypatch.setattr("antdrive.runs.pool.in_new_process", lambda call: None)
    assert f"replay: {UNSTEADY}" in antdrive("verify", "out", "--replay", "--planner", "mine.py:Mine")[1]


@pytest.mark.slow
def test_a_planner_that_depends_on_the_order_of_a_set_is_named(folder, monkeypatch):
    """Sets of texts keep their order within a process, so another one is asked."""
    planner(f"bits = hash(tuple(set({NAMES}))) & 0xFFF")(folder, monkeypatch)
    monkeypatch.delenv("PYTHONHASHSEED", raising=False)
    for words in (
        "accept s.drive.yaml",
        "check s.drive.yaml",
        "run w.yaml -r r.yaml -p mine.py:Mine -o out --no-figures",
    ):
        done = subprocess.run([ANTDRIVE, *words.split()], capture_output=True, text=True, timeout=100)
        assert (UNSTEADY in done.stdout) == (not words.startswith("run"))
    words = "verify out --replay --planner mine.py:Mine"
    assert UNSTEADY in subprocess.run([ANTDRIVE, *words.split()], capture_output=True, text=True, timeout=100).stdout
