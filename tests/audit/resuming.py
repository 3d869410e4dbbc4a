"""Resuming: `python -m tests.audit.resuming` kills `antdrive sweep` at random moments and resumes it.

A quarter of the kills falls into the first two seconds of the process, a quarter into the first two of its folder, the rest
anywhere. Three of four are SIGKILL to the whole process group; the others are SIGTERM. The same command then resumes, and its
folder is compared with that of an uninterrupted campaign. `--results FILE` makes the audit itself
resumable.

- refused: the second command failed
- lost, double: finished runs that the second command repeated, and those with two rows
- other: tables that differ in a bit
- left: folders with temporary files or logs without a row
- orphans: processes that outlived the kill by `GRACE` seconds
- silent: SIGTERM without the command that resumes
"""

from __future__ import annotations

import json
import os
import random
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

from antdrive.runs.campaigns import read_results
from antdrive.runs.campaigns.store import results_in
from antdrive.worlds import Disc, Task, World, save_task
from benchmarks.markdown import append_line, command_line, print_table, read_lines
from tests.runs.canonical import canonical_bytes

SMALLEST = ("--kills 1",)
RUNS = 12
EARLY = 2.0  # [s]
GRACE = 10.0  # longest time for processes to end [s]
FAULTS = ("refused", "lost", "double", "other", "left", "orphans", "silent")
WINDOWS = ("process", "folder", "any", "any")


def sweep_of(folder: Path) -> list[str]:
    """Return the command of a campaign of `RUNS` short runs, beside whose folder its world lies."""
    world = folder.parent / "small.yaml"
    if not world.exists():
        save_task(
            Task(World("small", (0.0, 0.0, 3.0, 3.0), (Disc(1.5, 1.5, 0.2),)), (0.75, 0.75, 0.0), (2.25, 2.25)), world
        )
    words = f"--planner astar --noise 1 --seeds {RUNS} --jobs 1 --keep all --json".split()
    return [sys.executable, "-m", "antdrive", "sweep", "--world", str(world), *words, "--out", str(folder)]


def members(group: int) -> list[int]:
    """Return the living processes of a group."""
    found = []
    for path in Path("/proc").glob("[0-9]*/stat"):
        try:
            state, _, own = path.read_text().rpartition(")")[2].split()[:3]
        except OSError:  # it has ended
            continue
        if int(own) == group and state != "Z":
            found.append(int(path.parent.name))
    return found


def killed(command: list[str], folder: Path, number: int, seconds: float) -> dict[str, Any]:
    """Start a command, kill it at a random moment, and return the facts about its end."""
    rng, window = random.Random(number), WINDOWS[number % len(WINDOWS)]
    sent = signal.SIGTERM if number // len(WINDOWS) % 4 == 3 else signal.SIGKILL
    process = subprocess.Popen(
        command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True, start_new_session=True
    )
    moment = rng.uniform(0.0, EARLY if window != "any" else seconds)
    while window == "folder" and not folder.exists() and process.poll() is None:
        time.sleep(0.001)
    time.sleep(moment)
    alive = process.poll() is None
    if alive and sent == signal.SIGTERM and rng.random() < 0.5:
        process.terminate()
    elif alive:
        os.killpg(process.pid, sent)
    _, said = process.communicate()
    deadline = time.monotonic() + GRACE
    while (orphans := members(process.pid)) and time.monotonic() < deadline:
        time.sleep(0.05)
    code = process.returncode
    silent = code == 128 + signal.SIGTERM and "resume with: antdrive sweep" not in said
    facts = {"window": window, "signal": sent.name, "moment": moment, "ended": not alive, "code": code}
    return {**facts, "orphans": len(orphans), "silent": int(silent or code not in (0, -sent, 128 + sent))}


def trial(folder: Path, number: int, calm: bytes, seconds: float) -> dict[str, Any]:
    """Kill a campaign, resume it, and return what is wrong with its folder."""
    command = sweep_of(folder)
    facts = killed(command, folder, number, seconds)
    finished = len(results_in(folder, "outcome"))
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode != 0:
        return {**facts, "finished": finished, "refused": 1, "said": done.stderr}
    keys = read_results(folder).table["key"].to_pylist()
    logs = {folder / path for path in read_results(folder).table["rollout"].to_pylist()}
    kept = {path for path in folder.rglob("*") if path.is_file()}
    hidden = [path for path in kept if path.name[0] == "."]
    return {
        **facts,
        "finished": finished,
        "lost": json.loads(done.stdout)["made"] - (RUNS - finished),
        "double": len(keys) - len(set(keys)),
        "other": int(canonical_bytes(folder) != calm),
        "left": int(bool(hidden) or {path for path in kept if path.suffix == ".npz"} != logs),
    }


def main() -> None:
    given = command_line(__doc__, kills=(200, "number of kills"), results=(str, "a file for the results"))
    path = None if given.results is None else Path(given.results)
    rows = read_lines(path)
    with tempfile.TemporaryDirectory() as name:
        base = Path(name)
        subprocess.run(sweep_of(base / "warm"), check=True, capture_output=True)
        began = time.monotonic()
        subprocess.run(sweep_of(base / "calm"), check=True, capture_output=True)
        seconds, calm = time.monotonic() - began, canonical_bytes(base / "calm")
        for number in range(len(rows), given.kills):
            row = trial(base / f"killed-{number}", number, calm, seconds)
            append_line(path, row)
            rows.append(row)
    groups = {(row["window"], row["signal"]): [] for row in rows}
    for row in rows:
        groups[row["window"], row["signal"]].append(row)
    print_table(
        ("window", "signal", "kills", "of them in time", "runs finished before", *FAULTS),
        (
            (
                *key,
                str(len(some)),
                str(sum(not row["ended"] for row in some)),
                f"{min(row['finished'] for row in some)} to {max(row['finished'] for row in some)}",
                *(str(sum(row.get(fault, 0) for row in some)) for fault in FAULTS),
            )
            for key, some in sorted(groups.items())
        ),
    )
    sys.exit(any(row.get(fault) for row in rows for fault in FAULTS))


if __name__ == "__main__":
    main()
