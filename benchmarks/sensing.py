"""Cost of scans, mapping and mover detection: `python -m benchmarks.sensing`. Prints Markdown.

The world: a square hall of 20 m with discs of 7.5 to 30 cm in random places, and six movers for the search. The lidar moves
by 1 cm per scan. Times are processor times of the fastest of nine blocks of 200 scans.
"""

from __future__ import annotations

import dataclasses
import time
from collections.abc import Callable, Iterator

import numpy as np
import numpy.typing as npt

from antdrive.robots import Lidar, load_robot
from antdrive.sim.sensing import MappedGround, MoverTracker, OccupancyMap, Scanner, clear_distance
from benchmarks.markdown import command_line, print_table

SMALLEST = ("--blocks 1 --beams 36",)
HALL = (-10.0, -10.0, 10.0, 10.0)
SCANS = 200


def hall(count: int) -> npt.NDArray[np.float64]:
    """Discs in the hall, none of them on the lidar's way."""
    rng = np.random.default_rng(1)
    rows = np.column_stack((rng.uniform(-9.5, 9.5, (4 * count, 2)), rng.uniform(0.075, 0.3, 4 * count)))
    return rows[np.abs(rows[:, 1]) > 1][:count]


def microseconds(work: Callable[[int], object], blocks: int) -> float:
    """Processor time of a call of `work`, whose argument counts up [µs]."""
    found = []
    for block in range(blocks):
        started = time.process_time()
        for k in range(SCANS):
            work(block * SCANS + k)
        found.append(time.process_time() - started)
    return 1e6 * min(found) / SCANS


def rays(lidar: Lidar, blocks: int) -> Iterator[list[str]]:
    for count in (30, 100, 300, 1000):
        scanner, rng = Scanner(lidar, hall(count), bounds=HALL), np.random.default_rng(0)
        scanner.scan((0, 0, 0), rng=rng)
        exact = microseconds(lambda k, s=scanner: s.scan((0.01 * (k % 100), 0.0, 0.001 * k)), blocks)  # type: ignore[misc]
        noisy = microseconds(lambda k, s=scanner, r=rng: s.scan((0.01 * (k % 100), 0.0, 0.001 * k), rng=r), blocks)  # type: ignore[misc]
        yield [str(count), f"{exact:.0f}", f"{noisy:.0f}"]


def maps(lidar: Lidar, blocks: int) -> Iterator[list[str]]:
    robot = load_robot("jackal")
    rng = np.random.default_rng(0)
    scanner = Scanner(lidar, hall(300), bounds=HALL)
    poses = [(0.01 * (k % 100), 0.0, 0.001 * (k % SCANS)) for k in range(SCANS)]
    scans = [scanner.scan(pose, rng=rng) for pose in poses]
    for cell, horizon in ((0.025, 5.0), (0.05, 5.0), (0.05, 10.0), (0.1, 5.0), (0.1, 10.0)):
        seen = OccupancyMap(lidar, cell, horizon=horizon, bounds=HALL)
        for pose, scan in zip(poses, scans, strict=True):
            seen.insert(pose, scan)
        discs = seen.discs()
        insert = microseconds(lambda k, m=seen: m.insert(poses[k % SCANS], scans[k % SCANS]), blocks)  # type: ignore[misc]
        listed = microseconds(lambda _, m=seen: m.discs(), blocks)  # type: ignore[misc]
        sight = microseconds(
            lambda k, m=seen: clear_distance(m, poses[k % SCANS], 1.5, 0.4, robot.footprint, 1.5),  # type: ignore[misc]
            blocks,
        )
        yield [f"{cell:g}", f"{horizon:g}", f"{insert:.0f}", f"{listed:.0f}", str(len(discs)), f"{sight:.1f}"]


def tracks(lidar: Lidar, blocks: int) -> Iterator[list[str]]:
    for count in (0, 1, 6):
        rng = np.random.default_rng(2)
        start, velocity = rng.uniform((-6, -4), (6, 4), (count, 2)), rng.uniform(-0.8, 0.8, (count, 2))
        scanner, seen, tracker = Scanner(lidar, hall(100), bounds=HALL), OccupancyMap(lidar, 0.05), MoverTracker(lidar)
        spent, most = [], 0
        for k in range(50 + blocks * SCANS):
            here = start + velocity * 2 * np.sin(0.01 * k)  # to and fro
            ranges = scanner.scan((0, 0, 0), here if k >= 50 else here + 90, np.full(count, 0.3), rng)
            started = time.process_time()
            theirs = tracker.update(MappedGround(seen, 100), (0, 0, 0), ranges, k / lidar.rate)
            spent.append(time.process_time() - started)
            seen.insert((0, 0, 0), ranges, omitted=theirs)
            most = max(most, len(tracker.movers().radii))
        yield [str(count), str(most), f"{1e6 * float(np.median(spent)):.0f}"]


def main() -> None:
    given = command_line(
        __doc__,
        blocks=(9, "of 200 scans each; the fastest counts"),
        beams=(720, "beams of the lidar, which else is jackal's"),
    )
    lidar = load_robot("jackal").lidar
    assert lidar is not None
    lidar = dataclasses.replace(lidar, beams=given.beams)
    print_table("discs | exact scan [µs] | with noise [µs]", rays(lidar, given.blocks))
    heads = "cell [m] | horizon [m] | insert [µs] | discs() [µs] | discs | clear way [µs]"
    print_table(heads, maps(lidar, given.blocks))
    print_table("movers | tracked at most | tracking [µs]", tracks(lidar, given.blocks))


if __name__ == "__main__":
    main()
