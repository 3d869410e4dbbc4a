"""Frame rate of rendering and encoding films: `python -m benchmarks.film`.

`--parts` measures films in new processes with start-up, and start-up, painter and encoder alone;
`--memory` measures the peak memory of films of ten seconds and of five minutes, each in its own process;
`--sight` measures the cost of showing the occupancy map of a mapless robot.
"""

from __future__ import annotations

import dataclasses
import json
import os
import resource
import statistics
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
from antdrive.views.film.video import encoding, film, frame_times, process_count
from antdrive.worlds import Cruising, Task, World
from benchmarks.markdown import command_line, print_table

SMALLEST = (
    "--rounds 1 --seconds 0.2 --frames 2",
    "--parts --rounds 1 --seconds 0.2",
    "--sight --rounds 1 --frames 2",
    "--memory --seconds 0.2",
)
SIZES = ((640, 480), (1280, 720))
PARTS = ((0, SIZES[0]), (6, SIZES[0]), (0, SIZES[1]))  # movers and size of each film


def cut(rollout: Rollout, seconds: float) -> Rollout:
    """Return the first `seconds` of a run, repeating a shorter run."""
    step = float(rollout.t[1] - rollout.t[0])
    rows = np.arange(round(seconds / step) + 1) % len(rollout.t)
    arrays = {
        name: getattr(rollout, name)[rows] for name in ("pose", "twist", "command", "clearance", "limiter", "movers")
    }
    return dataclasses.replace(rollout, t=np.arange(len(rows)) * step, contacts=np.empty((0, 4)), **arrays)


def hall_drive(movers: int) -> Rollout:
    """Return a drive through a hall of 20 m with movers beside the route."""
    rng, found = np.random.default_rng(1), list[Cruising]()
    while len(found) < movers:
        x, y = rng.uniform(0.5, 19.5, 2).tolist()
        angle, speed = rng.uniform(0, 2 * np.pi), rng.uniform(0.2, 0.7)
        velocity = (speed * float(np.cos(angle)), speed * float(np.sin(angle)))
        if abs(y - 10) > 2:
            found.append(Cruising(radius=0.3, position=(x, y), velocity=velocity))
    task = Task(World("hall", (0, 0, 20, 20), movers=tuple(found)), (1, 10, 0), (19, 10))
    log = run(Scenario.of(task, "astar", avoidance=None, replanning=None)).rollout
    assert log is not None
    return log


def parts(rounds: int, seconds: float) -> None:
    """Print the rates of films, each in a new process, and the costs of their parts."""
    found: dict[int, list[dict[str, float]]] = {k: [] for k in range(len(PARTS))}
    with tempfile.TemporaryDirectory() as folder:
        logs = [cut(hall_drive(movers), seconds).save(Path(folder) / f"{movers}.npz") for movers, _ in PARTS]
        for _ in range(rounds):
            for k, (_, size) in enumerate(PARTS):
                code = f"from benchmarks.film import part; part({str(logs[k])!r}, {size})"
                done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
                found[k].append(json.loads(done.stdout))
    print(f"{seconds:g} s of film in the hall, camera oblique; median of {rounds}; CPU: processor time")
    heads = "movers | size | film [frames/s] | start-up [s] | CPU [s] | "
    heads += "painter [frames/s] | CPU [ms] | encoder [frames/s] | CPU [ms]"
    names = {"film": ".0f", "start": ".2f", "start_cpu": ".2f"}
    names |= {"painter": ".0f", "painter_cpu": ".2f", "encoder": ".0f", "encoder_cpu": ".2f"}
    print_table(
        heads,
        (
            [str(movers), f"{size[0]}×{size[1]}"]
            + [format(statistics.median(one[name] for one in found[k]), style) for name, style in names.items()]
            for k, (movers, size) in enumerate(PARTS)
        ),
    )


def part(log: str, size: tuple[int, int]) -> None:
    """Print the rate of a film in this new process, and the costs of start-up, painter and encoder, as JSON."""

    def clocks() -> tuple[float, float, float]:
        times = os.times()
        return time.perf_counter(), time.process_time(), times.children_user + times.children_system

    rollout, first = Rollout.load(log), list[tuple[float, float, float]]()
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "a.mp4"
        started = clocks()
        info = film(rollout, path, size=size, jobs=1, progress=lambda _: first.append(clocks()) if not first else None)
        shot, again = Shot(rollout, size=size), Shot(rollout, size=size)
        times = frame_times(shot.playback.duration, info.fps, 1.0)
        before_painter = clocks()
        for at in times:
            shot.frame(at)
        after_painter = clocks()
        frames = [again.frame(at) for at in times]
        before_encoder = clocks()
        with encoding(path, size, info.fps) as send:
            for frame in frames:
                send(frame)
        end = clocks()
    count = len(frames)
    found = {
        "film": info.frames / info.wall_s,
        "start": first[0][0] - started[0],
        "start_cpu": first[0][1] - started[1],
    }
    found |= {"painter": count / (after_painter[0] - before_painter[0])}
    found |= {"painter_cpu": 1e3 * (after_painter[1] - before_painter[1]) / count}
    found |= {"encoder": count / (end[0] - before_encoder[0])}
    found |= {"encoder_cpu": 1e3 * sum(end[k] - before_encoder[k] for k in (1, 2)) / count}
    print(json.dumps(found))


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
        parts=(False, "measure films with start-up, and their parts, instead"),
        memory=(False, "measure peak memory instead of the rate"),
        sight=(False, "measure frames that show what the robot has seen instead"),
        rounds=(3, "of each film"),
        seconds=(10.0, "length of the filmed part of the run [s]"),
        frames=(40, "with --sight: of each camera and round, evenly over a drive"),
    )
    if given.sight:
        sight(given.rounds, given.frames)
        return
    if given.parts:
        parts(given.rounds, given.seconds)
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
