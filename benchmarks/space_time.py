"""Planning time among movers with known motions: `python -m benchmarks.space_time`. Prints Markdown.

Corner to corner over cells of 0.2 m, 15 % of them blocked at random, at 0.5 m/s with a clearance of 0.25 m. Movers of 0.2 to
0.5 m radius shuttle between two random points, or circle, at 0.1 to 0.5 m/s. Worlds without a path among static obstacles, or
with a mover on the start, are redrawn. Times are the best of three, after compilation.
"""

from __future__ import annotations

import dataclasses
import math
import statistics
from collections.abc import Callable

import numpy as np

from antdrive.base import Floats
from antdrive.planners import Query, TimedPlan, plan_in_time, reachable
from antdrive.worlds import Grid, MoverMotion
from benchmarks.markdown import command_line, print_table, seconds

SMALLEST = ("--worlds 1 --sizes 1",)
CELL, SPEED, INFLATE = 0.2, 0.5, 0.25
SIZES = (
    (50, 10, 60.0),
    (50, 40, 60.0),
    (100, 10, 120.0),
    (200, 10, 240.0),
    (200, 40, 240.0),
)  # cells, movers, horizon [s]


@dataclasses.dataclass(frozen=True)
class Shuttle:
    radius: float
    ends: Floats  # (2, 2) [m]
    period: float  # [s], one way

    def at(self, t: Floats) -> Floats:
        share = np.abs(np.asarray(t) / self.period % 2 - 1)[:, np.newaxis]
        return np.asarray(share * self.ends[0] + (1 - share) * self.ends[1])


@dataclasses.dataclass(frozen=True)
class Carousel:
    radius: float
    centre: Floats  # (2,) [m]
    far: float  # [m]
    speed: float  # [m/s]

    def at(self, t: Floats) -> Floats:
        angle = np.asarray(t) * self.speed / self.far
        return np.asarray(self.centre + self.far * np.stack([np.cos(angle), np.sin(angle)], axis=-1))


def shuttle(rng: np.random.Generator, side: float) -> MoverMotion:
    ends = rng.uniform(0, side, (2, 2))
    return Shuttle(float(rng.uniform(0.2, 0.5)), ends, math.dist(*ends) / float(rng.uniform(0.1, 0.5)))


def carousel(rng: np.random.Generator, side: float) -> MoverMotion:
    far, speed = float(rng.uniform(0.5, side / 3)), float(rng.uniform(0.1, 0.5))
    return Carousel(float(rng.uniform(0.2, 0.5)), rng.uniform(0, side, 2), far, speed)


Maker = Callable[[np.random.Generator, float], MoverMotion]


def world(size: int, count: int, make: Maker, rng: np.random.Generator) -> tuple[Query, list[MoverMotion]]:
    while True:
        free = rng.random((size, size)) >= 0.15
        free[0, 0] = free[-1, -1] = True
        grid = dataclasses.replace(Grid.from_free(free, cell=CELL), inflate=INFLATE)
        query = Query(grid, (0, 0), (size - 1, size - 1))
        movers = [make(rng, CELL * size) for _ in range(count)]
        clear = all(math.hypot(*m.at(np.zeros(1))[0]) > m.radius + INFLATE + 0.01 for m in movers)
        if clear and reachable(query):
            return query, movers


def main() -> None:
    given = command_line(__doc__, worlds=(20, "of each size and kind"), sizes=(len(SIZES), "how many of the sizes"))
    rows = []
    for size, count, horizon in SIZES[: given.sizes]:
        for make in (shuttle, carousel):
            rng = np.random.default_rng([size, count])
            plans: list[TimedPlan] = []
            walls = []
            for _ in range(given.worlds):
                query, movers = world(size, count, make, rng)
                tries = [plan_in_time(query, movers, speed=SPEED, horizon=horizon) for _ in range(3)]
                walls.append(min(plan.wall_s for plan in tries))
                plans.append(tries[0])
                if plans[-1].solved:
                    assert plans[-1].clearance(movers) >= INFLATE
            ways = [plan for plan in plans if plan.solved]
            rows.append([
                f"{size}×{size}", f"{count}, {'to and fro' if make is shuttle else 'round'}", f"{len(ways)}/{given.worlds}",
                f"{statistics.median(plan.duration for plan in ways):.1f} s",
                f"{sum(plan.waited > 0 for plan in ways)}",
                f"{statistics.median(plan.work for plan in plans):.0f}", seconds(statistics.median(walls)), seconds(max(walls)),
            ])  # fmt: skip
    heads = "grid | movers | a way exists | arrival, median | with waits | intervals expanded | time | most"
    print_table(heads, rows)


if __name__ == "__main__":
    main()
