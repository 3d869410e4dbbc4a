"""Cost of importing, planning and driving in a building of 40 x 30 m (0.05 m per pixel), and of 10,000 cylinders.

python -m benchmarks.building               # tables for docs/notebook/building.md
python -m benchmarks.building tasks         # 30 random tasks in it, with the campaign's statistics
python -m benchmarks.building --map DIR     # only write the map
"""

from __future__ import annotations

import contextlib
import itertools
import os
import resource
import shlex
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
from PIL import Image

from antdrive.planners import Query, load_planner, smooth, validated
from antdrive.robots import PurePursuit, load_robot
from antdrive.sim import Engine, Rollout, Scenario, certify, run
from antdrive.sim.driving.drive import follow
from antdrive.worlds import import_map_server, load_task, rasterise, save_task
from benchmarks.loop import task_among, winding
from benchmarks.markdown import chosen, command_line

RESOLUTION = 0.05  # [m]
SIZE = (40.0, 30.0)  # [m]
START, GOAL = (1.5, 15.0, 0.0), (38.0, 26.6)
DOOR, WALL, CORRIDOR = 1.0, 0.15, 2.2  # widths [m]
SMALLEST = ("loop --rounds 1",)
T = TypeVar("T")


def building(seed: int = 0) -> np.ndarray:
    """Return the free pixels: rooms with doors and furniture along three corridors."""
    rng = np.random.default_rng(seed)
    width, height = (round(side / RESOLUTION) for side in SIZE)
    free = np.ones((height, width), dtype=bool)

    def fill(x0: float, y0: float, x1: float, y1: float, value: bool = False) -> None:
        box = [round(v / RESOLUTION) for v in (y0, y1, x0, x1)]
        free[max(0, box[0]) : box[1], max(0, box[2]) : box[3]] = value

    for x0, y0, x1, y1 in ((0, 0, 40, WALL), (0, 30 - WALL, 40, 30), (0, 0, WALL, 30), (40 - WALL, 0, 40, 30)):
        fill(x0, y0, x1, y1)
    corridors = (5.0, 15.0, 25.0)  # along x
    for y in corridors:
        for side in (-1, 1):
            wall = y + side * CORRIDOR / 2
            fill(0, wall - WALL / 2, 40, wall + WALL / 2)
    fill(19.0 - WALL, 0, 19.0, 30)  # a corridor along y joins the three
    fill(21.0, 0, 21.0 + WALL, 30)
    fill(19.0, WALL, 21.0, 30 - WALL, True)
    for y in corridors:
        fill(WALL, y - CORRIDOR / 2 + WALL / 2, 40 - WALL, y + CORRIDOR / 2 - WALL / 2, True)
    for low, high in ((WALL, 3.9), (6.1, 13.9), (16.1, 23.9), (26.1, 30 - WALL)):
        for left, right in ((WALL, 19.0 - WALL), (21.0 + WALL, 40 - WALL)):
            edges = np.linspace(left, right, 6)
            for x in edges[1:-1]:
                fill(x - WALL / 2, low, x + WALL / 2, high)
            for a, b in itertools.pairwise(edges):
                _furnish(rng, fill, float(a), low, float(b), high)
    for y in corridors:  # doors on both sides
        for left, right in ((WALL, 19.0 - WALL), (21.0 + WALL, 40 - WALL)):
            for middle in np.linspace(left, right, 11)[1::2]:
                for side in (-1, 1):
                    wall = y + side * CORRIDOR / 2
                    fill(middle - DOOR / 2, wall - WALL, middle + DOOR / 2, wall + WALL, True)
    return free


def _furnish(rng: np.random.Generator, fill: Callable[..., None], x0: float, y0: float, x1: float, y1: float) -> None:
    """Place desks and chairs, with a free aisle before the doors."""
    for _ in range(5):
        wide, deep = rng.uniform(0.4, 1.4), rng.uniform(0.4, 0.8)
        x = rng.uniform(x0 + 0.2, max(x0 + 0.21, x1 - wide - 0.2))
        y = rng.uniform(y0 + 0.9, max(y0 + 0.91, y1 - deep - 0.9))
        fill(x, y, x + wide, y + deep)
    for _ in range(3):
        x, y = rng.uniform(x0 + 0.4, x1 - 0.8), rng.uniform(y0 + 0.9, max(y0 + 0.91, y1 - 1.3))
        fill(x, y, x + 0.4, y + 0.4)


def write_map(folder: Path) -> Path:
    """Write the building as a map_server map."""
    picture = np.where(building()[::-1], 254, 0).astype(np.uint8)
    Image.fromarray(picture).save(folder / "building.png")
    path = folder / "building.yaml"
    path.write_text(
        f"image: building.png\nresolution: {RESOLUTION}\norigin: [0.0, 0.0, 0.0]\nnegate: 0\n"
        "occupied_thresh: 0.65\nfree_thresh: 0.196\n"
    )
    return path


def stage(name: str, work: Callable[[], T]) -> T:
    """Run `work` and print its time, its processor time and the peak memory of the process so far."""
    started, used = time.perf_counter(), processor_time()
    result = work()
    seconds, used = time.perf_counter() - started, processor_time() - used
    memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    print(f"{name:44} {seconds:8.2f} s   {used:8.2f} s of processor time   {memory:7.0f} MB", flush=True)
    return result


def processor_time() -> float:
    """Return the processor time of this process and its finished children [s]."""
    times = os.times()
    return times.user + times.system + times.children_user + times.children_system


def stages(folder: Path) -> None:
    """Import, plan, drive, check, film."""
    from antdrive.views.figures.run_figures import overview
    from antdrive.views.film.video import film

    stage("load kernels with a small world", lambda: run(Scenario.of("gate", "astar")))
    path = stage("draw the map", lambda: write_map(folder))
    task = stage("import it", lambda: import_map_server(path, start=START, goal=GOAL))
    print(f"  {len(task.world.obstacles)} cylinders")
    stage("write the world file", lambda: save_task(task, folder / "world.yaml"))
    task = stage("read the world file", lambda: load_task(folder / "world.yaml"))
    robot = load_robot("turtlebot")
    grid = stage("grid of 0.05 m", lambda: rasterise(task.world, RESOLUTION, robot.radius + 0.03))
    query = Query.between(grid, task)
    answer = stage("plan with astar", lambda: load_planner("astar").plan(query, np.random.default_rng(0)))
    print(f"  {answer.line_length:.1f} m over {len(answer.cells)} cells")
    stage("check the plan", lambda: validated(query, answer))
    route = stage("route with clearance", lambda: smooth(answer, grid, task, kind="clearance"))
    print(f"  {route.length:.1f} m")
    stage("controller's index", lambda: PurePursuit().prepare(route, task.world, robot, 0.03, 1 / 60))

    def build() -> None:
        with Engine(task.world, robot):
            pass

    stage("build the bodies", build)
    result = stage("plan and drive, as antdrive run does", lambda: run(Scenario.of(task, "astar")))
    assert result.rollout is not None
    log = result.rollout
    print(f"  {log.outcome.key} after {log.t[-1]:.1f} s, {log.record.times.drive_wall_s:.2f} s of wall time driving")
    stage("write the log", lambda: log.save(folder / "rollout.npz"))
    log = stage("read the log", lambda: Rollout.load(folder / "rollout.npz"))
    print(f"  {stage('certify it', lambda: certify(log)).sentence}")
    stage("overview figure", lambda: overview(log, folder / "overview.png"))
    film(log, folder / "film.mp4", camera="oblique", size=(320, 240), speed=60.0)
    made: Any = stage(
        "film at 60 times the speed, 640 x 480",
        lambda: film(log, folder / "film.mp4", camera="oblique", size=(640, 480), speed=60.0),
    )
    print(f"  {made.frames} frames")


def tasks(folder: Path, number: int, apart: float, jobs: int) -> None:
    """Drive random tasks in the building with one command and print its report."""
    world = folder / "building.world.yaml"
    save_task(import_map_server(write_map(folder), start=START, goal=GOAL), world)
    command = [
        "antdrive", "sweep", "--world", str(world), "-p", "astar", "--tasks", f"{number}:{apart:g}",
        "--jobs", str(jobs), "-o", str(folder / "tasks"), "--report", str(folder / "tasks.md"),
    ]  # fmt: skip
    print(f"$ {shlex.join(command).replace(str(folder) + os.sep, '')}", flush=True)
    stage("all of it", lambda: subprocess.run([sys.executable, "-m", *command], check=True))
    print((folder / "tasks.md").read_text(encoding="utf-8"))


def loop(rounds: int, counts: tuple[int, ...] = (400, 10_000)) -> None:
    """Print the processor time of a drive-loop step among many cylinders."""
    robot, controller = load_robot("turtlebot"), PurePursuit()
    costs: dict[int, list[float]] = {count: [] for count in counts}
    with contextlib.ExitStack() as stack:
        built = []
        for count in counts:
            task = task_among(count, SIZE, 0.05)
            tracked = controller.prepare(winding(task), task.world, robot, 0.05, 1 / 60)
            built.append((count, task, tracked, stack.enter_context(Engine(task.world, robot))))
        for turn in range(rounds + 1):
            for count, task, tracked, engine in built:
                started = time.process_time()
                log = follow(engine, controller, tracked, task, limit=120)
                assert log.outcome.name == "SUCCEEDED", log.outcome
                if turn:
                    costs[count].append((time.process_time() - started) / (len(log.t) - 1) * 1e6)
    first = costs[counts[0]]
    print("\ncylinders   us/step   / the first")
    for count, values in costs.items():
        ratio = statistics.median(a / b for a, b in zip(values, first, strict=True))
        print(f"{count:9}   {statistics.median(values):7.1f}   {ratio:11.2f}")


def main() -> None:
    given = command_line(
        __doc__,
        parts=([], "stages, tasks, loop; default: all"),
        map=(Path, "only write the map into this folder"),
        tasks=(30, "random tasks"),
        jobs=(2, "processes that drive the tasks"),
        rounds=(7, "of the loop"),
    )
    if given.map is not None:
        given.map.mkdir(parents=True, exist_ok=True)
        print(write_map(given.map))
        return
    parts = chosen(given.parts, ("stages", "tasks", "loop"))
    with tempfile.TemporaryDirectory() as folder:
        if "stages" in parts:
            stages(Path(folder))
        if "tasks" in parts:
            tasks(Path(folder), given.tasks, 10.0, given.jobs)
    if "loop" in parts:
        loop(given.rounds)


if __name__ == "__main__":
    main()
