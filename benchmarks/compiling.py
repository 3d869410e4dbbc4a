"""Cost of compiling kernels into an empty cache, and of starting commands: `python -m benchmarks.compiling`.

Each command runs in a cache folder of its own; `antdrive warm` compiles everything. Costs are the processor times of the
command and its children. After a run, its log is verified with a full cache. Starts are compared with `python -c pass`, run
alternately; the table has median ratios.
"""

from __future__ import annotations

import argparse
import os
import resource
import shlex
import statistics
import subprocess
import sys
import tempfile
from pathlib import Path

SMALLEST = ("--rounds 1",)
FIRST = {
    "first run": "run forest -p astar",
    "demo without film": "compare forest -p mmas -p astar",
    "everything": "warm",
}
STARTS = ("--help", "--version", "planners", "worlds list", "robots list")
ANTDRIVE = (sys.executable, "-m", "antdrive")


def cost(command: list[str], folder: str) -> float:
    """Run a command with a cache folder. Return its processor time [s]."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    environment = {**os.environ, "NUMBA_CACHE_DIR": folder}
    subprocess.run(
        command, cwd=folder, env=environment, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, check=True
    )
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--rounds", type=int, default=9, help="starts of each command")
    parser.add_argument(
        "--compile", choices=FIRST, action="append", default=[], help="compile for a command (repeatable)"
    )
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        print("| command | times `python -c pass` |\n|---|---|")
        for words in STARTS:
            ratios = [
                cost([*ANTDRIVE, *shlex.split(words)], folder) / cost([sys.executable, "-c", "pass"], folder)
                for _ in range(options.rounds)
            ]
            print(f"| `{words}` | {statistics.median(ratios):.1f} |", flush=True)
    if options.compile:
        print("\n| from an empty cache | processor time [s] | entries |\n|---|---|---|")
    for name in options.compile:
        with tempfile.TemporaryDirectory() as folder:
            seconds = cost([*ANTDRIVE, *shlex.split(FIRST[name])], folder)
            print(f"| {name} | {seconds:.1f} | {len(list(Path(folder).rglob('*.nbc')))} |", flush=True)
            logs = list(Path(folder).rglob("rollout.npz"))[:1]
            for log in logs:  # again: the first time, it compiles
                again = [cost([*ANTDRIVE, "verify", str(log)], folder) for _ in range(1 + options.rounds)][1:]
                print(f"| then `verify` of its log | {statistics.median(again):.2f} | |", flush=True)


if __name__ == "__main__":
    main()
