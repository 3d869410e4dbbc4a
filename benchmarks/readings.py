"""Claims of papers under different readings: `python -m benchmarks.readings [PLANNER ...] [--seeds N]`.

Planners: pfaco (lee2008), as and iaco (suganthi2019), maco (ibraheem2016). Each reading of an unspecified detail runs on the
same recreated maps with the same seeds and number of ant steps. For pfaco a second table varies the unspecified constants
over two levels each, in a fractional design of eight runs (resolution III, generators D = AB, E = AC). A gap is the excess
length over the shortest path with the same moves. Intervals are bootstrapped over maps; p is Wilcoxon's, against the rival
on the same maps. Constants given by the paper are fixed.
"""

from __future__ import annotations

import itertools
import math
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from antdrive.planners import Query
from antdrive.runs.papers.experiment import Experiment
from antdrive.runs.papers.ibraheem2016 import ibraheem2016
from antdrive.runs.papers.maps import blocks, scattered
from antdrive.runs.papers.paper_runs import PaperRun, solve
from antdrive.runs.statistics.intervals import medians_by_world
from antdrive.runs.statistics.significance import wilcoxon
from benchmarks.markdown import chosen, command_line

Options = Mapping[str, Any]
SMALLEST = ("iaco --seeds 1",)
NO_PATH = 1e6  # the gap that stands for no path [%]


@dataclass(frozen=True)
class Search:
    """A search over readings.

    Attributes:
        maps: by name, the maps of the search, a map for each seed
        rival: the planner to beat, with its options
        planner: the planner whose readings are searched
        fixed: its options that are not searched
        work: ant steps for everyone; inf: the iterations of the options
        readings: by option, the readings to combine
        constants: by option, the low and the high value
        under: the readings under which the constants are varied
    """

    maps: Mapping[str, Callable[[int], Query]]
    rival: tuple[str, Options]
    planner: str
    fixed: Options
    work: float
    readings: Mapping[str, Sequence[Any]]
    constants: Mapping[str, tuple[Any, Any]]
    under: Sequence[Options]


LEE = {
    "3: 100×100": lambda seed: blocks(100, 100, 25, 16, 300 + seed),
    "4: 100×100": lambda seed: blocks(100, 100, 25, 16, 400 + seed),
    "5: 100×100": lambda seed: blocks(100, 100, 25, 16, 500 + seed),
}


def _numbered(experiment: Experiment) -> Callable[[int], Query]:
    """Return the experiment's maps, one per seed."""
    return lambda seed: experiment.query(experiment.world(seed))


SUGANTHI = {f"{size}×{size}": partial(scattered, size, 0.15) for size in (20, 30, 50)}
TABLE_1 = {"alpha": 1.0, "beta": 1.0, "evaporation": 0.3, "deposit": 1.0}

SEARCHES = {
    "pfaco": Search(
        LEE,
        ("as", {"ants": 500, "beta": 2.0, "evaporation": 0.01}),
        "pfaco",
        {},
        3e6,
        {"form": ("letter", "rise", "local"), "field": ("start", "goal"), "memory": ("tabu", "none")},
        {
            "repulsion": (1.0, 100.0),
            "influence": (2.0, 6.0),
            "deposit": (0.2, 20.0),
            "min_pheromone": (1e-4, 1e-2),
            "convergence": (0.005, 0.1),
        },
        ({"form": "letter"}, {"form": "local"}),
    ),
    "as": Search(
        SUGANTHI,
        ("as", {"ants": 50, **TABLE_1, "heuristic": "step", "iterations": 100}),
        "as",
        {"ants": 50, "iterations": 100, **TABLE_1},
        math.inf,
        {"heuristic": ("step", "goal"), "backtrack": (False, True), "shortcut": (False, True)},
        {},
        (),
    ),
    "iaco": Search(
        SUGANTHI,
        ("as", {"ants": 50, **TABLE_1, "heuristic": "step", "iterations": 100}),
        "iaco",
        {"ants": 25, "explorers": 75, "iterations": 100, **TABLE_1, "heuristic": "step"},
        math.inf,
        {"backtrack": (False, True), "shortcut": (False, True), "depositors": ("common", "all"), "elite": (1.0, 25.0)},
        {},
        (),
    ),
    "maco": Search(
        {e.map: _numbered(e) for e in ibraheem2016() if e.planner == "maco" and e.map[0] in "34"},
        ("as", {"ants": 50, "iterations": 100, "evaporation": 0.3}),
        "maco",
        {"ants": 50, "iterations": 100, "evaporation": 0.3},
        math.inf,
        {"q_max": (1.0, 2.0, 5.0, 20.0), "q_min": (0.1, 0.5)},
        {},
        (),
    ),
}


def gaps(planner: str, options: Options, search: Search, seeds: int) -> tuple[list[float], list[PaperRun]]:
    """Return the gap of every map and seed, and the plans."""
    trials = [
        solve(planner, options, draw(seed), seed, search.work) for draw in search.maps.values() for seed in range(seeds)
    ]
    return [trial.gap for trial in trials], trials


def line(name: str, found: Sequence[float], rival: Sequence[float], cpu: float) -> str:
    """Return a table row: arrivals, median gap with its interval, wins against the rival, p."""
    large = np.nan_to_num(np.array([found, rival]), posinf=NO_PATH)
    values = large[0]
    low, high = medians_by_world(values[:, None], np.arange(len(values)))[0]
    better, worse = int((large[0] < large[1]).sum()), int((large[0] > large[1]).sum())
    arrived = int((values < NO_PATH).sum())
    cells = [
        name,
        f"{arrived}/{len(values)}",
        f"{_number(float(np.median(values)))} [{_number(low)}, {_number(high)}]",
        f"{better} : {worse}",
        f"{wilcoxon(large[0] - large[1]):.2g}",
        f"{cpu:.2f} s",
    ]
    return f"| {' | '.join(cells)} |"


def _number(value: float) -> str:
    return f"{value:.1f} %" if value < NO_PATH / 10 else "no path"


def designs(search: Search) -> Iterator[tuple[str, Options]]:
    """Run the full factorial of the readings, then the fractional one of the constants under the chosen readings."""
    for values in itertools.product(*search.readings.values()):
        chosen = dict(zip(search.readings, values, strict=True))
        yield ", ".join(map(str, values)), chosen
    for under in search.under:
        for a, b, c in itertools.product((0, 1), repeat=3):
            levels = (a, b, c, a ^ b ^ 1, a ^ c ^ 1)[: len(search.constants)]
            chosen = {key: pair[k] for (key, pair), k in zip(search.constants.items(), levels, strict=True)}
            words = " ".join(f"{key}={value:g}" for key, value in chosen.items())
            yield f"{', '.join(map(str, under.values()))}: {words}", {**under, **chosen}


def run(name: str, seeds: int) -> None:
    """Print the table of a search."""
    search = SEARCHES[name]
    started = time.process_time()
    rival, trials = gaps(*search.rival, search, seeds)
    print(f"{name}: {', '.join(search.maps)}, {seeds} seeds each, {search.work:g} ant steps\n")
    print("| reading | arrived | median gap | shorter : longer than the rival | p | processor time |")
    print("|---|---|---|---|---|---|", flush=True)
    print(line(f"rival: `{search.rival[0]}`", rival, rival, (time.process_time() - started) / len(trials)))
    for words, options in designs(search):
        started = time.process_time()
        found, trials = gaps(search.planner, {**search.fixed, **options}, search, seeds)
        print(line(words, found, rival, (time.process_time() - started) / len(trials)), flush=True)


def main() -> None:
    """Run the searches that are named."""
    given = command_line(__doc__, planners=([], ", ".join(SEARCHES)), seeds=(10, "of each map"))
    for name in chosen(given.planners, SEARCHES):
        run(name, given.seeds)


if __name__ == "__main__":
    main()
