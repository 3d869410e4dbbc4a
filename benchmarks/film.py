"""Frame rate of rendering and encoding films: `python -m benchmarks.film`.

`--memory` measures the peak memory of films of ten seconds and of five minutes, each in its own process;
`--sight` measures the cost of showing the occupancy map of a mapless robot.
"""

from __future__ import annotations

import os
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

from antdrive.sim.log.rollout import Rollout
from antdrive.sim.pipeline import run
from antdrive.sim.scenario import Scenario
from antdrive.views.film.shot import Shot
from antdrive.views.film.video import film, process_count
from benchmarks.markdown import command_line

SMALLEST = ("--rounds 1 --seconds 0.2 --frames 2", "--sight --rounds 1 --frames 2", "--memory --seconds 0.2")
SIZES = ((640, 480), (1280, 720))


def cut(rollout: Rollout, seconds: float) -> Rollout:
    """Return the first `seconds` of a run, repeating a shorter run."""
    import dataclasses

    step = float(rollout.t[1] - rollout.t[0])
    rows = np.arange(round(seconds / step) + 1) % len(rollout.t)
    arrays = {
        name: getattr(rollout, name)[rows] for name in ("pose", "twist", "command", "clearance", "limiter", "movers")
    }
    return dataclasses.replace(rollout, t=np.arange(len(rows)) * step, contacts=np.empty((0, 4)), **arrays)


def speed(rollout: Rollout, rounds: int, seconds: float) -> None:
    count = len(rollout.record.world.obstacles)
    print(f"{count} cylinders; best of {rounds}; a moving camera renders in {process_count()} processes")
    print("camera    size        film fps   on one core")
    with tempfile.TemporaryDirectory() as folder:
        for camera in ("top", "oblique", "follow"):
            for size in SIZES:
                part, rates = cut(rollout, seconds), []
                for jobs in (None, 1) if camera == "follow" else (1,):
                    runs = [
                        film(part, Path(folder) / "a.mp4", camera=camera, size=size, jobs=jobs) for _ in range(rounds)
                    ]
                    rates.append(max(info.frames / info.wall_s for info in runs))
                print(f"{camera:8}  {size[0]:4}x{size[1]:<4} {rates[0]:9.0f} {rates[-1]:13.0f}")


def memory(path: Path, seconds: float) -> None:
    """Print the peak memory of rendering and encoding a short and a long film, each in its own process."""
    for camera in ("oblique", "follow"):
        peaks = []
        for length in (seconds, 30 * seconds):
            code = f"from benchmarks.film import peak; peak({str(path)!r}, {camera!r}, {length})"
            done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
            peaks.append(float(done.stdout))
        print(
            f"{camera:8} 640x480   {seconds:g} s: {peaks[0]:.0f} MB   {30 * seconds:g} s: {peaks[1]:.0f} MB   "
            f"difference {peaks[1] - peaks[0]:.0f} MB"
        )


def peak(path: str, camera: str, seconds: float) -> None:
    log = cut(Rollout.load(path), seconds)
    fps = 30 if camera == "oblique" else 2  # a moving camera buffers the same number of frames at any rate
    with tempfile.TemporaryDirectory() as folder:
        film(log, Path(folder) / "a.mp4", camera=camera, size=(640, 480), fps=fps, jobs=1)
    own, child = (resource.getrusage(who).ru_maxrss / 1024 for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN))
    print(own + child)


def sight(rounds: int, frames: int) -> None:
    """Print the processor time per frame of a mapless drive, with and without its occupancy map."""
    import dataclasses

    log = run(Scenario.of("forest", "astar", "jackal", map="none", localisation="matching", noise=1.0, seed=1)).rollout
    assert log is not None
    plain = dataclasses.replace(log, scans=log.scans[:0], scan_rows=log.scan_rows[:0])
    moments = np.linspace(0.0, float(log.t[-1]), frames)
    print("| camera | with what it has seen | without |\n|---|---|---|")
    for camera in ("top", "oblique", "follow"):
        costs = {True: [], False: []}
        for _ in range(rounds):
            for seen in costs:
                shot = Shot(log if seen else plain, camera=camera, size=SIZES[-1])
                for at in moments:
                    started = time.process_time()
                    shot.frame(float(at))
                    costs[seen].append(1000 * (time.process_time() - started))
        print(f"| `{camera}` | {np.median(costs[True]):.0f} ms | {np.median(costs[False]):.0f} ms |")


def main() -> None:
    given = command_line(
        __doc__,
        memory=(False, "measure peak memory instead of the rate"),
        sight=(False, "measure frames that show what the robot has seen instead"),
        rounds=(3, "of each film"),
        seconds=(10.0, "length of the filmed part of the run [s]"),
        frames=(40, "with --sight: of each camera and round, evenly over a drive"),
    )
    if given.sight:
        sight(given.rounds, given.frames)
        return
    log = run(Scenario.of("forest")).rollout
    assert log is not None
    if not given.memory:
        speed(log, given.rounds, given.seconds)
        return
    with tempfile.TemporaryDirectory() as folder:
        memory(log.save(Path(folder) / "rollout.npz"), given.seconds)


if __name__ == "__main__":
    os.environ.setdefault("PYTHONPATH", os.getcwd())
    main()
