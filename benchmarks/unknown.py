"""Mapless drives: `python -m benchmarks.unknown ablations|contacts|fixes --results FOLDER [--worlds N] [--jobs N]`.

Prints Markdown. Repeat the command to resume from the results in the folder.

- ablations: BARN's worlds, `jackal`, noise and `--localisation matching`; range, beams or field of view of the lidar, odometry
  errors, or planner differ from the first row. *Price*: ratio of arrival times, and of lengths, to the same drives with the
  map (geometric mean, 95 % interval over worlds). `dstar-lite` repairs its search; `ants` keep their pheromone.
- contacts: contacts while driving in random forests and worlds of BARN's automaton, half of each, with both robots.
- fixes: `--localisation fixes` against `matching`, pair by pair, in random worlds of four kinds from seed `--first` on.
  *Contacts*: drives with contacts. *Time x*, *length x*: ratio fixes / matching where both arrived (median; geometric mean,
  95 % interval over worlds). *Sign test*: its p-value for the pairs in which fixes were slower or faster.
"""

from __future__ import annotations

import argparse
import itertools
import math
import statistics
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from antdrive.base.atomic import atomic_write
from antdrive.robots import list_robots
from antdrive.runs.barn_challenge import by_world, campaign_data, reference_times, unpacked
from antdrive.runs.campaigns import sweep
from antdrive.runs.statistics.intervals import means_by_world
from antdrive.runs.statistics.price import Ratio, prices
from antdrive.runs.statistics.run_table import RunTable
from antdrive.runs.statistics.significance import mcnemar
from antdrive.worlds import generate
from benchmarks.drives import Result, drive
from benchmarks.markdown import call_all, command_line, missing, print_tables, table
from tools.shared_data import BARN

SMALLEST = (
    "ablations --worlds 1 --variants 2 --jobs 0 --results out",
    "contacts --worlds 2 --jobs 0 --results out",
    "fixes --worlds 4 --jobs 0",
)
HEADS = " | certified | score | time [s] | contacts | seen [m²] | time x | length x | wall [s]"


@dataclass(frozen=True)
class Variant:
    """One row of the ablations.

    Attributes:
        name: of its folder and row
        lidar: what differs from the lidar of `jackal`, by the keys of a robot file
        odometry: the factor on the errors of odometry
        planner: the planner's name
        localisation: how the robot knows its pose
    """

    name: str
    lidar: Mapping[str, Any] = field(default_factory=dict)
    odometry: float = 1.0
    planner: str = "astar"
    localisation: str = "matching"


VARIANTS = (
    Variant("as it is"),
    *(Variant(f"range {far:g} m", {"max_range": far}) for far in (10.0, 5.0, 2.5)),
    *(Variant(f"{beams} beams", {"beams": beams}) for beams in (180, 60)),
    *(Variant(f"field of view {view} degrees", {"field_of_view": math.radians(view)}) for view in (180, 90, 57)),
    *(Variant(f"odometry x {factor:g}", odometry=factor) for factor in (0.0, 5.0)),
    *(Variant(f"odometry x {f:g} without matching", odometry=f, localisation="odometry") for f in (1.0, 5.0)),
    *(Variant(planner, planner=planner) for planner in ("dstar-lite", "ants")),
)


def robot_of(variant: Variant, folder: Path) -> str:
    """Return a variant's robot: jackal, or a robot file with another lidar."""
    if not variant.lidar:
        return "jackal"
    data = yaml.safe_load(list_robots()["jackal"].read_text(encoding="utf-8"))
    data["lidar"] |= variant.lidar
    data["name"] = f"jackal {variant.name}"
    path = (folder / f"{variant.name}.yaml").resolve()
    with atomic_write(path) as part:
        part.write_text(yaml.safe_dump(data), encoding="utf-8")
    return str(path)


def ablations(given: argparse.Namespace) -> Iterator[str]:
    """Yield the table of all variants line by line."""
    if not given.barn.exists():
        missing(f"no worlds at {given.barn}; docs/how-to/data.md says where BARN's are")
    given.results.mkdir(parents=True, exist_ok=True)
    worlds = unpacked(given.barn, given.results / "worlds")
    fastest = reference_times(worlds)
    sensing = {"noise": 1.0, "map": "none", "localisation": "matching"}

    def driven(name: str, planner: str, robot: str, settings: Mapping[str, Any]) -> Any:
        data = campaign_data(worlds, given.trials, planner, robot, settings)
        chosen = data["worlds"][:: max(1, len(data["worlds"]) // (given.worlds or len(data["worlds"])))]
        data["worlds"] = chosen[: given.worlds or None]
        return sweep(data, given.results / name, jobs=given.jobs, keep="failed").table

    def rows() -> Iterator[list[str]]:
        known: dict[str, Any] = {}
        for variant in VARIANTS[: given.variants]:
            if variant.planner not in known:
                mapped = {**sensing, "map": "given", "localisation": "fixes"}
                known[variant.planner] = driven(f"{variant.planner} with the map", variant.planner, "jackal", mapped)
                yield row(f"{variant.planner} with the map", known[variant.planner], fastest, None)
            robot = robot_of(variant, given.results)
            settings = {**sensing, "odometry": variant.odometry, "localisation": variant.localisation}
            runs = driven(variant.name, variant.planner, robot, settings)
            yield row(variant.name, runs, fastest, known[variant.planner])

    yield from table(HEADS, rows())


def row(name: str, runs: Any, fastest: Mapping[str, float], known: Any) -> list[str]:
    """Return a variant's results with those of the same drives with the map."""
    line, columns = list(by_world(runs, fastest))[-1], runs.to_pydict()
    seen = [area for area in columns["explored_m2"] if area is not None and area == area]
    time, length = "", ""
    if known is not None:
        others = known.to_pydict()
        (price,) = prices(RunTable({key: columns[key] + others[key] for key in columns}), any_robot=True)
        time, length = shown(price.time), shown(price.length)
    return [
        name,
        f"{line.arrived} of {line.runs}",
        f"{line.score:.4f}",
        f"{line.seconds:.2f}",
        f"{sum(count or 0 for count in columns['contacts_driving']):.0f}",
        f"{statistics.fmean(seen):.1f}" if seen else "",
        time,
        length,
        f"{statistics.fmean(wall for wall in columns['drive_wall_s'] if wall is not None):.2f}",
    ]


def shown(ratio: Ratio) -> str:
    return f"{ratio.mean:.3f} ({ratio.low:.3f}–{ratio.high:.3f})"


def contacts(given: argparse.Namespace) -> Iterator[str]:
    """Contacts by robot and kind of world, and the drives that did not arrive."""
    half = (given.worlds or 1000) // 2
    data = {
        "worlds": [{"generate": kind, "seeds": half} for kind in ("forest", "barn")],
        "planners": ["astar"],
        "robots": ["jackal", "turtlebot"],
        "noise": [1.0],
        "margin": [0.03],
        "settings": {"map": "none", "localisation": "matching"},
    }
    runs = sweep(data, given.results, jobs=given.jobs, keep="failed").table.to_pylist()
    yield from table(("robot", "worlds", "drives", "certified", "contacts while driving", "ends"), counted(runs))
    for run in runs:
        if not run["succeeded"]:
            yield f"- {run['world']}, {run['robot']}: {run['outcome']} {run['reason'] or ''}: `{run['command']}`"


def counted(runs: Sequence[Mapping[str, Any]]) -> Iterator[list[str]]:
    for robot in ("jackal", "turtlebot"):
        for kind in ("forest", "barn"):
            some = [run for run in runs if run["robot"] == robot and run["world"].startswith(kind)]
            ends = Counter(run["outcome"] for run in some).most_common()
            touched = sum(run["contacts_driving"] or 0 for run in some)
            certified = sum(run["succeeded"] for run in some)
            words = ", ".join(f"{name} {count}" for name, count in ends)
            yield [robot, kind, str(len(some)), str(certified), f"{touched:.0f}", words]


#: Random worlds of the table `fixes`: BARN's automaton, usual and dense, forests, and thickets of thin cylinders.
KINDS: tuple[tuple[str, dict[str, str]], ...] = (
    ("barn", {}),
    ("barn", {"fill": "0.25"}),
    ("forest", {}),
    ("forest", {"count": "40", "radius": "0.05,0.4", "clearance": "0.7"}),
)


def fixes(given: argparse.Namespace) -> Iterator[str]:
    """Compare pose fixes with scan matching alone, in the same worlds with the same seeds."""
    seeds = range(given.first, given.first + (given.worlds or 200) // len(KINDS))
    tasks = [
        (seed, generate(kind, np.random.default_rng(seed), options, name=f"{kind} {seed} {options}"))
        for kind, options in KINDS
        for seed in seeds
    ]

    def rows() -> Iterator[list[str]]:
        for planner, robot in itertools.product(given.planners.split(","), given.robots.split(",")):
            calls = (
                partial(
                    drive,
                    task.world.name,
                    task,
                    planner,
                    robot,
                    map="none",
                    localisation=kind,
                    noise=given.noise,
                    seed=seed,
                )
                for kind in ("fixes", "matching")
                for seed, task in tasks
            )
            done = list(call_all(calls, given.jobs))
            yield [f"`{planner}`", f"`{robot}`", f"{given.noise:g}", *compared(done[: len(tasks)], done[len(tasks) :])]

    heads = "planner | robot | noise | certified: fixes | matching | contacts: fixes | matching | time [s]: fixes | matching"
    yield from table(f"{heads} | time x: median | mean | length x | slower | faster | sign test", rows())


def compared(fused: Sequence[Result], alone: Sequence[Result]) -> list[str]:
    """Return the cells of one row of the table `fixes`."""
    both = [
        (one.metrics, other.metrics)
        for one, other in zip(fused, alone, strict=True)
        if one.succeeded and other.succeeded
    ]
    time, length = (
        np.array([math.log(one[key] / other[key]) for one, other in both]) for key in ("arrival_s", "driven_length_m")
    )
    slower, faster = int((time > 0).sum()), int((time < 0).sum())
    return [
        *(f"{sum(run.succeeded for run in runs)} of {len(runs)}" for runs in (fused, alone)),
        *(str(sum(run.contacts > 0 for run in runs)) for runs in (fused, alone)),
        *(f"{statistics.fmean(pair[k]['arrival_s'] for pair in both):.2f}" for k in (0, 1)),
        f"{math.exp(float(np.median(time))):.4f}",
        *(shown(ratio_of(values)) for values in (time, length)),
        str(slower),
        str(faster),
        f"{mcnemar(slower, faster):.2g}",
    ]


def ratio_of(logs: Any) -> Ratio:
    """Return the mean ratio of one pair per world from the logarithms (N,), with its interval."""
    ((low, high),) = means_by_world(logs[:, None], np.arange(len(logs)))
    return Ratio(*map(math.exp, (float(logs.mean()), low, high, float(logs.max()))))


def main() -> None:
    given = command_line(
        __doc__,
        tables=([], "ablations, contacts, fixes"),
        results=(Path("out/unknown"), "folder for what was driven"),
        barn=(BARN, "folder or archive of BARN's world_*.world files"),
        worlds=(0, "how many worlds; 0: all of BARN's, or 1,000 random ones (fixes: 200)"),
        first=(6000, "first seed of the random worlds of fixes"),
        planners=("dstar-lite", "planners of fixes"),
        robots=("jackal", "robots of fixes"),
        noise=(1.0, "noise of fixes"),
        variants=(len(VARIANTS), "how many rows of the ablations"),
        trials=(1, "how often each of BARN's worlds is driven"),
        jobs=(1, "processes; 0: this one"),
    )
    print_tables(given.tables, {"ablations": ablations, "contacts": contacts, "fixes": fixes}, given)


if __name__ == "__main__":
    main()
