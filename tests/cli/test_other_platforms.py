"""Windows and macOS as far as Linux can pretend: their modules, signals and `sys.platform`."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

PRETENDED = Path(__file__).with_name("pretended_platform.py")
PLANNER = """\
from antdrive import load_planner

class Mine:
    def plan(self, query, rng):
        return load_planner("astar").plan(query, rng)

class Endless:
    def plan(self, query, rng):
        while True:
            pass

class Deaf:
    def plan(self, query, rng):
        while True:
            try:
                while True:
                    pass
            except BaseException:
                pass
"""


COMMON = "--version", "run small.yaml -p mine.py:Mine -o out --no-figures", "verify out"
LINES = {
    "win32": (*COMMON, "planners", "plan small.yaml -p astar -o plan", "worlds show small.yaml"),
    # Workers cannot pretend to be Windows'.
    "darwin": (*COMMON, "sweep -w small.yaml -p mine.py:Mine -o camp --seeds 1 -j 2"),
}
LIMITED = tuple(f"plan small.yaml -p mine.py:{name} --plan-limit 0.3" for name in ("Endless", "Deaf"))


@pytest.mark.parametrize("platform", LINES)
def test_commands_work_and_planning_has_its_limit(platform, small, tmp_path):
    (tmp_path / "mine.py").write_text(PLANNER)
    command = [sys.executable, PRETENDED, platform, *LINES[platform], *LIMITED]
    # The compiler would look for Windows' functions.
    env = os.environ | ({"NUMBA_DISABLE_JIT": "1"} if platform == "win32" else {})
    done = subprocess.run(command, cwd=tmp_path, env=env, capture_output=True, text=True, check=False)
    ends = [line for line in done.stdout.splitlines() if line.startswith("exit code")]
    assert ends == ["exit code 0"] * len(LINES[platform]) + ["exit code 3"], done.stderr
    limit = "took longer than the limit of 0.3 s"
    assert [line.split(" (")[0] for line in done.stderr.splitlines() if limit in line] == [
        f"antdrive: planner Endless {limit}",
        "antdrive: planner Deaf",
    ]
    assert done.returncode == 3
    assert not [*tmp_path.rglob("*.lock")]
