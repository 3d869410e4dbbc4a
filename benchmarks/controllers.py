"""Drives by every controller: `python -m benchmarks.controllers barn|dynabarn --results FOLDER [--worlds N] [--trials N]`.

Each table is one campaign: `jackal` with `astar`, noise 1, the static map given. Repeat the command to resume it.

- barn: BARN's worlds
- dynabarn: DynaBARN's easy worlds from ten moments on; the robot is given the movers' positions and velocities
"""

from __future__ import annotations

import argparse
import dataclasses
import statistics
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from antdrive.robots import CONTROLLERS
from antdrive.runs.barn_challenge import OFFICIAL, campaign_data, reference_times, unpacked
from antdrive.runs.campaigns import sweep
from antdrive.worlds import import_dynabarn, save_task
from benchmarks.dynamic import CLASSES, START_INTERVAL
from benchmarks.markdown import command_line, missing, print_tables, table
from tools.shared_data import BARN, DYNABARN

SMALLEST = ("barn dynabarn --worlds 1 --trials 1 --jobs 0 --results out",)
HEADS = "controller | certified | contacts | other endings | mean time [s] | tracking error, p95 [cm] | wall time [s]"


def barn(given: argparse.Namespace) -> Iterator[str]:
    """Drive BARN's worlds."""
    if not given.barn.exists():
        missing(f"no worlds at {given.barn}; docs/how-to/data.md says where BARN's are")
    folder = unpacked(given.barn, given.results / "worlds")
    fastest = reference_times(folder)
    worlds = campaign_data(folder, 1, "astar", "jackal", {"noise": 1.0})["worlds"]

    def score(run: Mapping[str, Any]) -> float:
        return OFFICIAL.score(run["succeeded"], run["arrival_s"], fastest[run["world"]])

    rows = driven(given, "barn", worlds[: given.worlds or None])
    yield from table(
        f"{HEADS} | score", ([*row(n, some), f"{statistics.fmean(map(score, some)):.4f}"] for n, some in rows)
    )


def dynabarn(given: argparse.Namespace) -> Iterator[str]:
    """Drive DynaBARN's easy worlds."""
    if not given.dynabarn.exists():
        missing(f"no worlds at {given.dynabarn}; docs/how-to/data.md says where DynaBARN's are")
    tasks = [one for one in import_dynabarn(given.dynabarn) if int(one.world.name.split("-")[1]) in CLASSES["easy"]]
    files = []
    for task in tasks[: given.worlds or None]:
        for moment in range(1 if given.worlds else 10):
            world = task.world.later(START_INTERVAL * moment)
            files.append(str((given.results / "easy" / f"{task.world.name}-{moment}.yaml").resolve()))
            save_task(dataclasses.replace(task, world=world), files[-1])
    yield from table(HEADS, (row(name, some) for name, some in driven(given, "dynabarn", files)))


def driven(given: argparse.Namespace, name: str, worlds: Sequence[Any]) -> Iterator[tuple[str, list[dict[str, Any]]]]:
    """Drive a campaign over all controllers; yield the runs of each."""
    data = {
        "worlds": worlds,
        "planners": ["astar"],
        "robots": ["jackal"],
        "noise": [1.0],
        "seeds": given.trials,
        "settings": {"controller": [*CONTROLLERS], "time_limit": 100.0},
    }
    runs = sweep(data, given.results / name, jobs=given.jobs, keep="failed").table.to_pylist()
    for controller in CONTROLLERS:
        yield controller, [run for run in runs if run["controller"].replace("default", "pure-pursuit") == controller]


def row(name: str, runs: Sequence[Mapping[str, Any]]) -> list[str]:
    """Return a controller's row of the table."""
    good = [run for run in runs if run["succeeded"]]
    ends = Counter(run["outcome"] for run in runs if not run["succeeded"] and run["outcome"] != "collided")
    mean = {
        key: f"{scale * statistics.fmean(run[key] for run in some):.2f}" if some else "–"
        for key, scale, some in (("arrival_s", 1, good), ("tracking_error_p95_m", 100, good), ("drive_wall_s", 1, runs))
    }
    others = ", ".join(f"{count} {end}" for end, count in sorted(ends.items())) or "–"
    contacts = sum(run["outcome"] == "collided" for run in runs)
    return [f"`{name}`", f"{len(good)} of {len(runs)}", str(contacts), others, *mean.values()]


def main() -> None:
    given = command_line(
        __doc__,
        tables=([], "barn, dynabarn"),
        results=(Path("out/controllers"), "folder for what was driven"),
        barn=(BARN, "folder or archive of BARN's world_*.world files"),
        dynabarn=(DYNABARN, "DynaBARN's worlds"),
        worlds=(0, "how many worlds; 0: all"),
        trials=(10, "how many seeds"),
        jobs=(1, "processes; 0: this one"),
    )
    print_tables(given.tables, {"barn": barn, "dynabarn": dynabarn}, given)


if __name__ == "__main__":
    main()
