"""hasan's six cases with movers, cell by cell: `python -m benchmarks.moving [--seeds N]`. Prints Markdown.

The environments are recreated (`antdrive.runs.papers.maps`) with the paper's start and goal. The paper has one mover; here
1 and 10 start on random free cells. In every step each mover goes to a random free neighbouring cell other than the
robot's, then the robot decides. With one seed, movers take the same paths for every planner until they meet the robot.
`mmas-dstar` uses one rule for its exponents in all cases; the table shows the exponents that the paper chose per case. The
total cost is the paper's: the cost-to-go in cells, summed over all visited cells.
"""

from __future__ import annotations

import statistics
import time
from collections.abc import Iterator

import numpy as np

from antdrive.planners import OnlineAgent, Query, agent_for, load_planner
from antdrive.runs.papers.maps import environments
from antdrive.runs.papers.paper_runs import Strollers, drive
from benchmarks.markdown import command_line, print_table, seconds

SMALLEST = ("--seeds 1 --cases 1",)

#: hasan, Table 1: alpha/beta, cells propagated, steps, total cost, seconds; basic D*'s total cost and seconds.
PRINTED = {
    "1a": ("7/1", 1531, 65, 2491.8, 3.82, 3318.4, 3.90),
    "2b": ("5/1", 1134, 43, 1052.4, 2.96, 2559.8, 10.06),
    "3c": ("1/1", 1208, 49, 1238.6, 2.98, 1238.6, 3.49),
    "4d": ("5/1", 1689, 64, 2281.2, 4.08, 5857.8, 11.23),
    "5e": ("3/1", 1541, 91, 5086.4, 5.64, 5380.6, 32.89),
    "5f": ("1/0 or 26/1", 1346, 66, 2477.8, 4.76, 3249.2, 10.04),
}


def runs(name: str, query: Query, count: int, seeds: range) -> Iterator[tuple[bool, OnlineAgent, float]]:
    for seed in seeds:
        movers = Strollers(query.grid, count, np.random.default_rng([seed, count]), (query.start, query.goal))
        started = time.perf_counter()
        robot = agent_for(load_planner(name), query, np.random.default_rng(seed))
        drive(robot, query, movers)
        yield robot.arrived, robot, time.perf_counter() - started


def main() -> None:
    given = command_line(__doc__, seeds=(20, "number of runs per case and planner"), cases=(6, "how many of the cases"))
    seeds = range(given.seeds)
    for count in (1, 10):
        rows = []
        for case, query in list(environments().items())[: given.cases]:
            exponents, cells, steps, cost, wall, dstar_cost, dstar_wall = PRINTED[case[:2]]
            rows.append([case, "hasan, printed", exponents, "", str(steps), f"{cost:g}", str(cells), "", f"{wall:g} s"])
            rows.append(["", "its D*", "", "", "", f"{dstar_cost:g}", "", "", f"{dstar_wall:g} s"])
            for name in ("mmas-dstar", "dstar", "dstar-lite"):
                for _ in runs(name, query, count, range(1)):
                    pass  # compile before timing
                done = list(runs(name, query, count, seeds))
                tallies = [robot.stats for _, robot, _ in done]
                spread = {
                    key: f"{statistics.median(values):.0f} ({min(values):.0f}–{max(values):.0f})"
                    for key in ("steps", "cost", "propagated")
                    if (values := [getattr(tally, key) for tally in tallies])
                }
                rows.append([
                    "", f"`{name}`", "the rule" if name == "mmas-dstar" else "",
                    f"{sum(ok for ok, _, _ in done)}/{len(done)}", *spread.values(),
                    f"{statistics.mean(t.cycles for t in tallies):.1f}",
                    seconds(statistics.median(wall for _, _, wall in done)),
                ])  # fmt: skip
        print(f"{count} mover{'s' if count > 1 else ''}; median (range) of {len(seeds)} seeds\n")
        heads = "case |  | alpha/beta | arrived | steps | total cost | cells propagated | cycles broken | time"
        print_table(heads, rows)


if __name__ == "__main__":
    main()
