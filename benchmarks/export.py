"""Time of exports of jackal drives (720 beams at 50 Hz), with and without a map.

python -m benchmarks.export

Times are processor times of the function and of the whole command. `--scans` simulates the scans of drives without lidar at
export. Later exports of a process find packages and compiled code loaded.
"""

from __future__ import annotations

import resource
import statistics
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

from antdrive.sim import Perception, Rollout, Scenario, run
from benchmarks.markdown import command_line, print_table

SMALLEST = ("--rounds 1 --drives 1",)
KINDS = ("mcap", "rosbag2", "csv")
#: Scenario settings by row of the table.
DRIVES = {
    "with a map, movers by lidar": ("plaza-moving", "dstar-lite", {"perception": Perception(kind="lidar")}),
    "with a map, movers told": ("plaza-moving", "dstar-lite", {}),
    "without a map": ("forest", "astar", {"map": "none", "localisation": "true"}),
}
#: Exports a log several times in one process and prints the processor time of each [s].
TIMED = """
import sys, time
from pathlib import Path
from antdrive.views.export.exporting import export
log, kind, folder, times, suffix = sys.argv[1:]
for turn in range(int(times)):
    started = time.process_time()
    export(log, kind, Path(folder) / f"{kind}-{turn}{suffix}")
    print(time.process_time() - started)
"""


def in_one_process(log: Path, kind: str, folder: Path, times: int) -> list[float]:
    """Return the processor time of each of several exports in a fresh process [s]."""
    suffix = ".mcap" if kind == "mcap" else ""
    words = [sys.executable, "-c", TIMED, str(log), kind, str(folder), str(times), suffix]
    return [float(line) for line in subprocess.run(words, check=True, capture_output=True, text=True).stdout.split()]


def by_command(log: Path, kind: str, target: Path) -> float:
    """Return the processor time of the command, including interpreter start and imports [s]."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    words = [sys.executable, "-m", "antdrive", "export", str(log), "--to", kind, "-o", str(target)]
    subprocess.run(words, check=True, capture_output=True)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def messages(log: Path) -> tuple[int, int]:
    """Count the messages and scans in the bag of a log."""
    from antdrive.views.export.exporting import topics_of
    from antdrive.views.export.robot_frames import frames_of_spec
    from antdrive.views.export.samples import DriveScans

    rollout = Rollout.load(log)
    scans, body = DriveScans.of(rollout), frames_of_spec(rollout.record.robot)
    return sum(len(topic.stamps) for topic in topics_of(rollout, scans, body)), len(scans.rows)


def rows(folder: Path, rounds: int, drives: int) -> Iterator[list[str]]:
    """Yield the rows of the table."""
    for name, (world, planner, settings) in list(DRIVES.items())[-drives:]:
        log = run(Scenario.of(world, planner, "jackal", **settings)).rollout
        assert log is not None
        file = log.save(folder / f"{name}.npz")
        many, scans = messages(file)
        for kind in KINDS:
            first, later, command = [], [], []
            for turn in range(rounds):
                place = folder / f"{name} {kind} {turn}"
                place.mkdir()
                once, *again = in_one_process(file, kind, place, 4)
                first.append(once)
                later += again
                command.append(by_command(file, kind, place / ("by-command.mcap" if kind == "mcap" else "by-command")))
            size = f"{log.t[-1]:.1f} s, {many:,} messages, {scans} scans"
            yield [name, size, kind, *(f"{statistics.median(found):.2f} s" for found in (first, later, command))]


def main() -> None:
    given = command_line(
        __doc__, rounds=(5, "medians of so many fresh processes"), drives=(len(DRIVES), "how many of the drives")
    )
    with tempfile.TemporaryDirectory() as name:
        heads = "drive | size | to | the first in a process | later ones | the command"
        print_table(heads, rows(Path(name), given.rounds, given.drives))


if __name__ == "__main__":
    main()
