"""How long the export of 10 s of driving among movers takes, with 50 scans of 720 beams a second, and from the command line.

python -m benchmarks.export
"""

from __future__ import annotations

import dataclasses
import resource
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

from antdrive.sim import Rollout, Scenario, run
from antdrive.sim.export.bags import write_mcap
from antdrive.sim.export.exporting import attachments_of, export, topics_of
from antdrive.sim.export.samples import laser_scans
from antdrive.sim.export.topics import nanoseconds

ROUNDS, SECONDS, BEAMS, RATE = 7, 10, 720, 50


def first_seconds(log: Rollout) -> Rollout:
    """The log up to SECONDS."""
    rows = SECONDS * log.record.physics_hz + 1
    replans = tuple(replan for replan in log.record.replans if replan.t < SECONDS)
    names = ("t", "pose", "twist", "command", "clearance", "limiter", "movers")
    cut = {name: getattr(log, name)[:rows] for name in names}
    return dataclasses.replace(log, record=dataclasses.replace(log.record, replans=replans), **cut)


def processor_time(log: Path, target: Path) -> float:
    """What one call of the command takes, start of the interpreter and imports included [s]."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    words = [sys.executable, "-m", "antdrive", "export", str(log), "-o", str(target)]
    subprocess.run(words, check=True, capture_output=True)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def main() -> None:
    done = run(Scenario.of("plaza-moving", "dstar-lite"))
    assert done.rollout is not None
    log = first_seconds(done.rollout)
    ranges = np.random.default_rng(0).uniform(0.2, 10.0, (SECONDS * RATE, BEAMS))
    stamps = nanoseconds(np.arange(len(ranges)) / RATE)
    values = {"angle_min": -np.pi, "angle_max": np.pi, "angle_increment": 0.01, "time_increment": 0.0}
    values |= {"scan_time": 1 / RATE, "range_min": 0.1, "range_max": 12.0}
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        file = log.save(folder / "rollout.npz")
        for kind, suffix in (("mcap", ".mcap"), ("csv", "")):
            times = []
            for turn in range(ROUNDS + 1):
                started = time.perf_counter()
                export(file, kind, folder / f"{kind}-{turn}{suffix}")
                times.append(time.perf_counter() - started)
            print(f"{kind}: {statistics.median(times[1:]):.2f} s, the first {times[0]:.2f} s")
        times = []
        for _ in range(ROUNDS):
            started = time.perf_counter()
            read = Rollout.load(file)
            topics = [*topics_of(read), laser_scans("/scan", stamps, ranges, values)]
            write_mcap(folder / "scans.mcap", topics, attachments_of(read, file))
            times.append(time.perf_counter() - started)
        messages = sum(len(topic.stamps) for topic in topics)
        unknown = run(Scenario.of("forest", "astar", "jackal", map="none", localisation="true")).rollout
        assert unknown is not None
        scanned = unknown.save(folder / "scanned.npz")
        for what, log_file in (("with a map", file), ("without one, with its scans and maps", scanned)):
            spent = [processor_time(log_file, folder / f"{number}-{log_file.stem}.mcap") for number in range(ROUNDS)]
            print(f"mcap from the command line, a drive {what}: {statistics.median(spent):.2f} s of processor time")
        print(f"mcap with {len(ranges)} scans: {statistics.median(times):.2f} s for {messages} messages")


if __name__ == "__main__":
    main()
