"""Size and time of shrunk failures: `python -m benchmarks.shrinking [--failures N] [--seconds S]
[--robot NAME]`.

`turtlebot` drives random forests of 60 cylinders on 14 m with noise and without margin or smoothing. The first failures are
shrunk.
"""

from __future__ import annotations

import itertools
import statistics
import time
from collections.abc import Iterator

import numpy as np

from antdrive.runs.failures.failure import failure_of
from antdrive.runs.failures.passes import with_obstacles
from antdrive.runs.failures.shrinker import shrink
from antdrive.sim import Run, Scenario, run
from antdrive.worlds import generate
from benchmarks.markdown import command_line, print_table

SMALLEST = ("--failures 1 --seconds 2",)
FOREST = {"count": "60", "size": "14", "radius": "0.15,0.5", "clearance": "1.0"}


def failed_runs(robot: str) -> Iterator[Run]:
    """Drives of a robot that fail, by seed."""
    for seed in itertools.count():
        task = generate("forest", np.random.default_rng(seed), FOREST, name=f"forest-{seed}", note="")
        done = run(Scenario.of(task, "astar", robot, margin=0.0, noise=1.0, smoothing="none", seed=seed))
        if not done.succeeded:
            yield done


def is_one_minimal(scenario: Scenario) -> bool:
    """Whether the failure vanishes with each single obstacle."""
    failure, discs = failure_of(run(scenario)), scenario.task.world.obstacles
    smaller = (with_obstacles(scenario, discs[:i] + discs[i + 1 :]) for i in range(len(discs)))
    return all(one is None or failure_of(run(one)) != failure for one in smaller)


def main() -> None:
    arguments = command_line(
        __doc__,
        failures=(10, "how many failures are shrunk"),
        seconds=(600.0, "wall-clock time for each [s]"),
        robot=("turtlebot", "that drives"),
    )
    rows, counts, times = [], [], []
    for done in itertools.islice(failed_runs(arguments.robot), arguments.failures):
        started, cpu = time.perf_counter(), time.process_time()
        shrunk = shrink(done.scenario, seconds=arguments.seconds)
        wall, cpu = time.perf_counter() - started, time.process_time() - cpu
        small = shrunk.scenario
        counts.append(len(small.task.world.obstacles))
        times.append(cpu)
        rows.append(
            [
                done.scenario.task.world.name,
                shrunk.failure.sentence,
                f"60 → {counts[-1]}",
                f"1 → {small.noise:g}",
                f"{small.task.world.size[0]:g} × {small.task.world.size[1]:g} m",
                str(shrunk.runs),
                f"{wall:.0f} s",
                f"{cpu:.1f} s",
                "yes" if shrunk.complete and is_one_minimal(small) else "no",
            ]
        )
        print(rows[-1], flush=True)
    heads = "world | failure | obstacles | noise | size | runs | wall time | CPU time | 1-minimal"
    print_table(heads, rows)
    print(f"Median: {statistics.median(counts):g} obstacles, {statistics.median(times):.1f} s of CPU time.")


if __name__ == "__main__":
    main()
